//! Hostile input for decoders, on the stable toolchain and without instrumentation.
//!
//! A target runs on mutations of its corpus for `ROSCAUSAL_FUZZ_SECONDS` (default 1), from the seed
//! `ROSCAUSAL_FUZZ_SEED` (default 1). It must not panic, and it must not allocate what a length field merely
//! claims: with [`Allocator`] as the global allocator, it may allocate at most a multiple of the input. An input
//! that breaks either rule is written into the corpus, so that later runs try it first.

mod allocator;
mod mutate;
mod random;

pub use allocator::{Allocator, peak_of};
pub use mutate::Mutator;
pub use random::{splitmix64, unit};

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
    /// Runs `decode` on the corpus and on mutations of it until the time is up. Returns the number of inputs.
    ///
    /// # Panics
    /// If `decode` panics or allocates too much; the message names the file with the input.
    pub fn run(&self, decode: impl Fn(&[u8])) -> u64 {
        let mut corpus = files(&self.corpus);
        corpus.extend(self.seeds.iter().cloned());
        corpus.iter().for_each(|input| self.attempt(input, &decode));
        let mut mutator = Mutator::new(number("ROSCAUSAL_FUZZ_SEED", 1.0) as u64, self.tokens);
        let end = Instant::now() + Duration::from_secs_f64(number("ROSCAUSAL_FUZZ_SECONDS", 1.0));
        let mut count = corpus.len() as u64;
        while Instant::now() < end {
            for _ in 0..64 {
                self.attempt(&mutator.next(&corpus), &decode);
                count += 1;
            }
        }
        println!("{}: {count} inputs without a finding", self.corpus.display());
        count
    }

    fn attempt(&self, input: &[u8], decode: &impl Fn(&[u8])) {
        let before = allocator::begin();
        let outcome = catch_unwind(AssertUnwindSafe(|| decode(input)));
        let most = allocator::peak().saturating_sub(before);
        let allowed = FREE + self.bytes_per_byte * input.len();
        if outcome.is_ok() && most <= allowed {
            return;
        }
        let mut hasher = DefaultHasher::new();
        input.hash(&mut hasher);
        let path = self.corpus.join(format!("finding-{:016x}", hasher.finish()));
        let kept = fs::create_dir_all(&self.corpus).and_then(|()| fs::write(&path, input));
        println!("finding: {} ({kept:?}), {most} bytes allocated for {}", path.display(), input.len());
        match outcome {
            Err(panic) => resume_unwind(panic),
            Ok(()) => {
                assert!(most <= allowed, "{}: allocated {most} bytes, {allowed} are allowed", path.display())
            }
        }
    }
}

fn files(dir: &Path) -> Vec<Vec<u8>> {
    let mut paths: Vec<PathBuf> =
        fs::read_dir(dir).into_iter().flatten().flatten().map(|e| e.path()).collect();
    paths.sort();
    paths.iter().filter_map(|path| fs::read(path).ok()).collect()
}

fn number(variable: &str, default: f64) -> f64 {
    std::env::var(variable).ok().and_then(|text| text.parse().ok()).unwrap_or(default)
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
}
