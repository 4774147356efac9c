//! How much memory reading may take. A file is read as far as it goes; what it claims of its size allocates nothing.
//!
//! 1. Nothing that is read takes more than a limit: the user's, or what the machine has free.
//! 2. Packed data may grow by [`GROWTH`], or to [`FREE`] bytes. A table of constant columns grows about a hundredfold if it has a
//!    column of times; without one ten thousand times, and a million rows of ten such columns have 40 MB.

use std::{
    fs::{self, File},
    io::{self, ErrorKind, Read},
    path::Path,
};

use roscausal_discovery::Named;

use crate::{Error, Result, ensure};

/// Data of more than [`FREE`] bytes are at most this many times as long as their packed form.
pub const GROWTH: u64 = 1000;
/// Data of at most this many bytes may be packed as tightly as can be.
pub const FREE: u64 = 1 << 28;
/// Memory of a machine that does not tell, bytes.
const USUAL: u64 = 16_000_000_000;

/// The most memory that reading may take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Memory {
    bytes: u64,
}

impl Memory {
    /// At most these bytes; `None`: what the machine has free now.
    pub fn of(limit: Option<u64>) -> Self {
        Self { bytes: limit.unwrap_or_else(free) }
    }

    /// The limit in bytes.
    pub fn bytes(self) -> u64 {
        self.bytes
    }

    /// Checks that something fits.
    ///
    /// # Errors
    /// It does not.
    pub fn check(self, needed: u64) -> std::result::Result<(), String> {
        ensure(needed <= self.bytes, || {
            let (size, flag) = (size(self.bytes), Named("max_memory"));
            format!("reading it takes more than {size} of memory; split it, or allow more with {flag}")
        })
    }

    /// Checks that what was made of `packed` bytes fits, and did not grow beyond what data do.
    ///
    /// # Errors
    /// It does not fit, or is too long for data.
    pub fn check_growth(self, needed: u64, packed: u64) -> std::result::Result<(), String> {
        self.check(needed)?;
        ensure(needed <= most_grown(packed), || {
            format!("it holds more than {} in {packed} bytes, which no data do", size(most_grown(packed)))
        })
    }

    /// The bytes of a file or a pipe.
    ///
    /// # Errors
    /// A file that cannot be read, or does not fit.
    pub fn read(self, path: &Path) -> Result<Vec<u8>> {
        let fault = |error: io::Error| Error::file(path, error);
        let file = File::open(path).map_err(fault)?;
        let length = file.metadata().map_err(fault)?.len();
        self.check(length).map_err(|reason| Error::file(path, reason))?;
        let mut bytes = Vec::with_capacity(usize::try_from(length).unwrap_or(0));
        file.take(self.bytes.saturating_add(1)).read_to_end(&mut bytes).map_err(fault)?;
        self.check(bytes.len() as u64).map_err(|reason| Error::file(path, reason))?;
        Ok(bytes)
    }

    /// What comes out of a decoder that was given `packed` bytes.
    ///
    /// # Errors
    /// The decoder's; of kind [`ErrorKind::FileTooLarge`] for what does not fit, or grows beyond what data do.
    pub fn unpack(self, decoder: impl Read, packed: u64) -> io::Result<Vec<u8>> {
        let mut out = Vec::new();
        decoder.take(self.bytes.min(most_grown(packed)).saturating_add(1)).read_to_end(&mut out)?;
        let fits = self.check_growth(out.len() as u64, packed);
        fits.map(|()| out).map_err(|reason| io::Error::new(ErrorKind::FileTooLarge, reason))
    }
}

/// The most bytes that `packed` bytes may become.
pub fn most_grown(packed: u64) -> u64 {
    packed.saturating_mul(GROWTH).max(FREE)
}

/// How far the packed parts of one file have grown. Each may grow by [`GROWTH`]; what they grow beyond that comes from [`FREE`]
/// bytes for all of them.
#[derive(Debug)]
pub struct Growth {
    spare: u64,
}

impl Default for Growth {
    fn default() -> Self {
        Self { spare: FREE }
    }
}

impl Growth {
    /// The most bytes that the next part, of `packed` bytes, may become.
    pub fn most(&self, packed: u64) -> u64 {
        packed.saturating_mul(GROWTH).saturating_add(self.spare)
    }

    /// Counts a part that says of itself that it will be `unpacked` bytes.
    ///
    /// # Errors
    /// It does not fit, or is too long for data.
    pub fn check(&mut self, unpacked: u64, packed: u64, memory: Memory) -> std::result::Result<(), String> {
        memory.check(unpacked)?;
        let most = self.most(packed);
        ensure(unpacked <= most, || {
            format!("it holds more than {} in {packed} bytes, which no data do", size(most))
        })?;
        self.count(packed, unpacked);
        Ok(())
    }

    /// Counts a part that became `unpacked` bytes.
    pub fn count(&mut self, packed: u64, unpacked: u64) {
        let beyond = unpacked.saturating_sub(packed.saturating_mul(GROWTH));
        self.spare = self.spare.saturating_sub(beyond);
    }
}

/// Memory that is free for this process, bytes: on this machine, in its container, and by its own limit.
fn free() -> u64 {
    let reported = fs::read_to_string("/proc/meminfo").ok();
    let line =
        reported.as_deref().and_then(|text| text.lines().find_map(|line| line.strip_prefix("MemAvailable:")));
    let kilobytes = line.and_then(|line| line.split_whitespace().next()?.parse::<u64>().ok());
    let free = kilobytes.map_or(USUAL, |kilobytes| kilobytes * 1024);
    let container = fs::read_to_string("/sys/fs/cgroup/memory.max").ok();
    let container = container.and_then(|text| text.trim().parse().ok()).unwrap_or(u64::MAX);
    #[cfg(unix)]
    let own = rustix::process::getrlimit(rustix::process::Resource::As).current.unwrap_or(u64::MAX);
    #[cfg(not(unix))]
    let own = u64::MAX;
    // The program and its threads take a part of an address space.
    free.min(container).min(own / 4 * 3)
}

/// `300 MB`, `1.5 GB`.
fn size(bytes: u64) -> String {
    let megabytes = bytes as f64 / 1e6;
    if megabytes < 1000.0 { format!("{megabytes:.0} MB") } else { format!("{:.1} GB", megabytes / 1000.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_grows_beyond_data_or_the_limit_is_refused_after_that_many_bytes() {
        let unpack = |limit, bytes, packed| {
            let read = Memory::of(limit).unpack(io::repeat(0).take(bytes), packed);
            read.map(|out| out.len() as u64).map_err(|error| (error.kind(), error.to_string()))
        };
        assert_eq!(unpack(Some(1 << 20), 1 << 20, 10), Ok(1 << 20));
        let (kind, reported) = unpack(Some(1 << 20), u64::MAX, 10).expect_err("it has no end");
        assert!(kind == ErrorKind::FileTooLarge && reported.contains("max_memory"), "{reported}");
        let (kind, reported) = unpack(Some(u64::MAX), u64::MAX, 10).expect_err("it has no end");
        assert!(kind == ErrorKind::FileTooLarge && reported.contains("268 MB in 10 bytes"), "{reported}");
        assert_eq!(most_grown(1 << 20), 1000 << 20);
        assert!(Memory::of(None).bytes() > 1 << 20);
    }

    #[test]
    fn many_small_parts_of_a_file_share_what_they_may_grow() {
        let mut growth = Growth::default();
        let mut whole = 0;
        for _ in 0..10_000 {
            let part = growth.most(10).min(1 << 20);
            growth.count(10, part);
            whole += part;
        }
        assert!(whole <= FREE + 10_000 * 10 * GROWTH, "{whole}");
        growth.count(1 << 20, 1000 << 20);
        assert_eq!(growth.most(1 << 20), 1000 << 20);
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_device_without_an_end_is_read_up_to_the_limit() {
        let reported = Memory::of(Some(5_000_000)).read(Path::new("/dev/zero")).expect_err("no end");
        assert!(reported.to_string().contains("more than 5 MB of memory"), "{reported}");
    }
}
