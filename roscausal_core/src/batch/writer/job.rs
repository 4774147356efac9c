//! A batch on its way to disk: how far it is, and the marker that says so after a crash.

use std::path::PathBuf;

use crate::batch::Recording;

/// Suffixes of the names of markers (see [`Step`]).
pub(super) const COMMIT: &str = ".commit";
pub(super) const DONE: &str = ".done";

/// Progress of a batch on its way to disk. Exactly one rename lies between two steps, so at any moment it is
/// certain what is done. The raw batch is staged, *its journal becomes `.NAME.commit`*, the raw batch gets its
/// name. The post-processed batch is staged, *the marker becomes `.NAME.done`*, the post-processed batch gets its
/// name, the marker is removed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Step {
    Recorded,
    Staged,
    Written,
    Processed,
}

/// Where the journal of a batch is.
#[derive(Debug)]
pub(super) enum Origin {
    /// There is none.
    None,
    /// The [`Journal`] has it under this number.
    Open(u64),
    /// A process that is gone left it.
    Left(PathBuf),
}

/// A batch on its way to disk.
#[derive(Debug)]
pub(super) struct Job {
    pub(super) batch: Recording,
    pub(super) journal: Origin,
    pub(super) recovered: bool,
    pub(super) step: Step,
    pub(super) name: String,
    /// There is a marker.
    pub(super) protected: bool,
}

impl Job {
    pub(super) fn new(batch: Recording, journal: Origin) -> Self {
        Self { batch, journal, recovered: false, step: Step::Recorded, name: String::new(), protected: false }
    }

    pub(super) fn left_at(name: String, step: Step) -> Self {
        Self { name, step, protected: true, ..Self::new(Recording::default(), Origin::None) }
    }
}

/// Name of the marker of a batch that is between two steps.
pub(super) fn marker(name: &str, kind: &str) -> String {
    format!(".{name}{kind}")
}
