//! The journal of the open batch: what was measured and is in no file yet, so that a crash costs little of it.
//!
//! The recorder notes its samples in a `log::Log`; the data node hands the notes five times a second to a
//! [`Journal`], which appends them to `.PREFIX<number>.journal` in the pool of raw batches at once, and waits for the
//! disk every 0.4 s. The journal of a batch goes when the batch is a whole file (see [`super::writer`]); one that is there
//! at a start belongs to a batch that was never written, and [`replay`] makes it one.

mod file;
mod format;
mod log;

pub use file::{Journal, JournalStatus};
pub use format::{Entry, Header, MAGIC, Sample, decode, encode};
pub(super) use log::Log;

use super::{Recording, recorder::Recorder};

/// The batches in the bytes of a journal: what the recorder would have written, the last one cut short. A journal that
/// ends in the middle, or has bytes that were never written, counts up to there.
///
/// # Errors
/// One sentence when not even the beginning is that of a journal.
pub fn replay(bytes: &[u8]) -> Result<Vec<Recording>, String> {
    let (header, samples) = decode(bytes)?;
    Recorder::replay(&header, &samples)
}
