//! Hostile input for decoders, on the stable toolchain and without instrumentation.
//!
//! A target runs on mutations of its corpus, from the seed `ROSCAUSAL_FUZZ_SEED` (default 1), for
//! `ROSCAUSAL_FUZZ_SECONDS` (default 1), but on [`FEWEST`] at least; or on `ROSCAUSAL_FUZZ_INPUTS` of them. The
//! example `fuzz` does the latter with all targets.
//!
//! A target must not panic. It must not allocate what a length field merely claims: with [`Allocator`] as the
//! global allocator, it may allocate at most a multiple of the input. It must end, and not take more than [`SLOWEST`]. An input that
//! breaks a rule is written into the corpus, so that later runs try it first.

mod allocator;
mod file;
mod mutate;
mod random;
mod structure;
mod watch;

pub use allocator::{Allocator, peak_of};
pub use file::InputFile;
pub use mutate::Mutator;
pub use random::{splitmix64, unit};

use watch::Watch;

use std::{
    collections::hash_map::DefaultHasher,
    fs,
    hash::{Hash, Hasher},
    panic::{AssertUnwindSafe, catch_unwind, resume_unwind},
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

/// Bytes that a target may allocate for any input, however short.
const FREE: usize = 1 << 20;
/// Mutations that every run tries, however slow the target is.
pub const FEWEST: u64 = 200;
/// How much of the processor an input may take; where Linux does not tell that, how long it may take.
pub const SLOWEST: Duration = Duration::from_secs(10);

/// How the line begins that a target prints at its end: its crate and corpus, inputs, seconds, and milliseconds of the slowest.
pub const TOLD: &str = "fuzzed: | ";

/// A decoder under test.
pub struct Target<'a> {
    /// Folder of the corpus, in the repository.
    pub corpus: PathBuf,
    /// Inputs in addition to those of the folder, such as valid messages.
    pub seeds: Vec<Vec<u8>>,
    /// Words of the format, which mutations insert.
    pub tokens: &'a [&'a [u8]],
    /// Bytes that it may allocate per byte of input, in addition to one megabyte.
    pub bytes_per_byte: usize,
}

impl Target<'_> {
    /// Runs `decode` on the corpus and on mutations of it. Returns the number of mutations.
    ///
    /// # Panics
    /// If `decode` breaks a rule; the message names the file with the input.
    pub fn run(&self, decode: impl Fn(&[u8])) -> u64 {
        let watch = Watch::start(&self.corpus);
        let attempt = |input: &[u8]| self.attempt(input, &watch, &decode);
        let mut corpus = files(&self.corpus);
        corpus.extend(self.seeds.iter().cloned());
        let mut slowest = corpus.iter().map(|input| attempt(input)).max().unwrap_or_default();
        let mut mutator = Mutator::new(number("ROSCAUSAL_FUZZ_SEED").unwrap_or(1.0) as u64, self.tokens);
        let inputs = number("ROSCAUSAL_FUZZ_INPUTS").map(|inputs| inputs as u64);
        let seconds =
            number("ROSCAUSAL_FUZZ_SECONDS").unwrap_or(if inputs.is_some() { f64::MAX } else { 1.0 });
        let (begun, mut count) = (Instant::now(), 0);
        let most = inputs.unwrap_or(u64::MAX);
        while count < FEWEST.min(most) || (count < most && begun.elapsed().as_secs_f64() < seconds) {
            slowest = slowest.max(attempt(&mutator.next(&corpus)));
            count += 1;
        }
        println!(
            "{TOLD}{} {} | {count} | {:.1} | {:.0} |",
            std::env::var("CARGO_PKG_NAME").unwrap_or_default(),
            self.corpus.file_name().unwrap_or_default().display(),
            begun.elapsed().as_secs_f64(),
            slowest.as_secs_f64() * 1000.0
        );
        count
    }

    /// Returns how long it took.
    fn attempt(&self, input: &[u8], watch: &Watch, decode: &impl Fn(&[u8])) -> Duration {
        watch.begin(input);
        let (begun, used) = (Instant::now(), cpu_time());
        let before = allocator::begin();
        let outcome = catch_unwind(AssertUnwindSafe(|| decode(input)));
        let most = allocator::peak().saturating_sub(before);
        let took = cpu_time().zip(used).map_or(begun.elapsed(), |(now, used)| now.saturating_sub(used));
        watch.end();
        let allowed = FREE + self.bytes_per_byte * input.len();
        if outcome.is_ok() && most <= allowed && took <= SLOWEST {
            return took;
        }
        let path = keep(&self.corpus, input);
        println!(
            "finding: {}, {most} bytes allocated for {}, {} ms",
            path.display(),
            input.len(),
            took.as_millis()
        );
        if let Err(panic) = outcome {
            resume_unwind(panic);
        }
        assert!(most <= allowed, "{}: allocated {most} bytes, {allowed} are allowed", path.display());
        assert!(took <= SLOWEST, "{}: took {took:?}, {SLOWEST:?} are allowed", path.display());
        took
    }
}

/// Writes an input into the corpus. Returns its path.
fn keep(corpus: &Path, input: &[u8]) -> PathBuf {
    let mut hasher = DefaultHasher::new();
    input.hash(&mut hasher);
    let path = corpus.join(format!("finding-{:016x}", hasher.finish()));
    if let Err(error) = fs::create_dir_all(corpus).and_then(|()| fs::write(&path, input)) {
        println!("the finding cannot be kept: {error}");
    }
    path
}

/// What this thread has had of the processor.
fn cpu_time() -> Option<Duration> {
    let text = fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    text.split(' ').next()?.parse().ok().map(Duration::from_nanos)
}

fn files(dir: &Path) -> Vec<Vec<u8>> {
    let mut paths: Vec<PathBuf> =
        fs::read_dir(dir).into_iter().flatten().flatten().map(|e| e.path()).collect();
    paths.sort();
    paths.iter().filter_map(|path| fs::read(path).ok()).collect()
}

fn number(variable: &str) -> Option<f64> {
    std::env::var(variable).ok()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[global_allocator]
    static ALLOCATOR: Allocator = Allocator;

    fn target(corpus: &Path) -> Target<'_> {
        Target {
            corpus: corpus.to_owned(),
            seeds: vec![vec![0, 0, 0, 0, 1, 2, 3]],
            tokens: &[],
            bytes_per_byte: 10,
        }
    }

    fn finds(decode: impl Fn(&[u8])) -> bool {
        let corpus =
            std::env::temp_dir().join(format!("roscausal_fuzz-{}-{:p}", std::process::id(), &decode));
        let found = catch_unwind(AssertUnwindSafe(|| target(&corpus).run(decode))).is_err();
        assert_eq!(files(&corpus).len(), usize::from(found));
        let _ = fs::remove_dir_all(&corpus);
        found
    }

    #[test]
    fn a_decoder_that_trusts_a_length_is_found() {
        assert!(finds(|input| {
            if let Some(&length) = input.first_chunk() {
                drop(std::hint::black_box(Vec::<u8>::with_capacity(u32::from_le_bytes(length) as usize)));
            }
        }));
    }

    #[test]
    fn a_decoder_that_panics_is_found_and_a_good_one_is_not() {
        assert!(finds(|input| assert!(input.len() < 9)));
        assert!(!finds(|input| drop(std::hint::black_box(input.to_vec()))));
    }

    #[test]
    fn a_slow_decoder_has_its_least_number_of_inputs_too() {
        let corpus = std::env::temp_dir().join(format!("roscausal_fuzz-slow-{}", std::process::id()));
        let count = target(&corpus).run(|_| std::thread::sleep(Duration::from_millis(8)));
        assert_eq!(count, FEWEST);
    }
}
