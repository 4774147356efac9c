//! Changes of mechanisms as the node records them beside its models.

use std::{fs, path::Path};

use roscausal_discovery::changes::ChangeEvent;
use serde::{Deserialize, Serialize};

use crate::{Error, Result, batch::pool::with_ending};

/// Folder beside the models that holds a file for each event.
pub const CHANGES_FOLDER: &str = "changes";

/// An event as the node records it: with the batch that told it, and with stamps in seconds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RecordedChange {
    /// Counts the events, from 1.
    pub number: usize,
    /// The event; its times are rows.
    #[serde(flatten)]
    pub event: ChangeEvent,
    /// Name of the batch that told it, without extension.
    pub batch: String,
    /// Stamp of the last sample read.
    pub told: f64,
    /// Stamps between which the link changed; of a confirmed event.
    pub changed_from_to: Option<[f64; 2]>,
}

/// The events that a node recorded beside its models in `dir`, oldest first.
///
/// # Errors
/// A file that cannot be read.
pub fn recorded_changes(dir: &Path) -> Result<Vec<RecordedChange>> {
    let dir = dir.join(CHANGES_FOLDER);
    if !dir.is_dir() {
        return Ok(Vec::new());
    }
    let read = |path: &std::path::PathBuf| {
        let text = fs::read(path).map_err(|e| Error::file(path, e))?;
        serde_json::from_slice(&text).map_err(|e| Error::file(path, e))
    };
    with_ending(&dir, ".json")?.iter().map(read).collect()
}
