//! The journal of the open batch: what was measured but is in no file yet, so that a crash loses little of it.
//!
//! The recorder collects its samples in a `log::Log`. Every 0.2 s the data node hands them to a [`Journal`], which
//! appends them to `.PREFIX<number>.journal` in the pool of raw batches at once, and syncs every 0.4 s. The journal is
//! removed when its batch is a complete file (see [`super::writer`]). A journal that exists at a start belongs to a
//! batch that was never written, and [`replay`] turns it into one.

mod file;
mod format;
mod log;

pub use file::{Journal, JournalStatus};
pub use format::{Entry, Header, MAGIC, Sample, Subject, decode, encode};
pub(super) use log::Log;

use super::{Recording, recorder::Recorder};

/// The batches in the bytes of a journal: what the recorder would have written, the last one cut short. If the
/// journal ends in the middle, or has bytes that were never written, it counts up to there.
///
/// # Errors
/// One sentence if not even the beginning is that of a journal.
pub fn replay(bytes: &[u8]) -> Result<Vec<Recording>, String> {
    let (header, samples) = decode(bytes)?;
    Recorder::replay(&header, &samples)
}
