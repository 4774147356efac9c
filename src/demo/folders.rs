//! The demo's folder: pools, models, and how to tell that an analysis has ended.

use std::{
    fs,
    path::{Path, PathBuf},
};

use roscausal_core::{Error, Result, discovery::Model};

/// Says that a folder is a demo's and may be emptied by the next one.
const MARK: &str = ".roscausal_demo";

/// Where the demo's nodes put their files.
pub(crate) struct Folders {
    pub(super) raw: PathBuf,
    pub(super) processed: PathBuf,
    pub(super) models: PathBuf,
}

/// How far the analysis is.
pub(super) enum Outcome {
    Waiting,
    Model(Box<Model>),
    Rejected(String),
}

impl Folders {
    /// Empty folders in `out`; those of an earlier demo go, anything else is left alone and is an error.
    pub(super) fn fresh(out: &Path) -> Result<Self> {
        let folders =
            Self { raw: out.join("data_pool"), processed: out.join("pp_pool"), models: out.join("cm_pool") };
        let ours = out.join(MARK).exists();
        for folder in [&folders.raw, &folders.processed, &folders.models] {
            if folder.exists() && !ours {
                let reason = "there is something here that no demo made; choose another --out";
                return Err(Error::file(folder, reason));
            }
            if folder.exists() {
                fs::remove_dir_all(folder).map_err(|e| Error::file(folder, e))?;
            }
            fs::create_dir_all(folder).map_err(|e| Error::file(folder, e))?;
        }
        fs::write(out.join(MARK), "").map_err(|e| Error::file(out, e))?;
        Ok(folders)
    }

    /// Whether a model or a rejection is there.
    pub(super) fn outcome(&self) -> Result<Outcome> {
        if let Some(path) = with_ending(&self.models, ".json")?.first() {
            let text = fs::read(path).map_err(|e| Error::file(path, e))?;
            let model = serde_json::from_slice(&text).map_err(|e| Error::file(path, e))?;
            return Ok(Outcome::Model(Box::new(model)));
        }
        for pool in [&self.processed, &self.raw] {
            let rejected = pool.join("rejected");
            if rejected.exists()
                && let Some(path) = with_ending(&rejected, ".reason.txt")?.first()
            {
                let reason = fs::read_to_string(path).map_err(|e| Error::file(path, e))?;
                return Ok(Outcome::Rejected(format!("{}: {}", path.display(), reason.trim())));
            }
        }
        Ok(Outcome::Waiting)
    }

    /// The batches behind the model.
    pub(super) fn analysed_batches(&self) -> Result<Vec<PathBuf>> {
        with_ending(&self.processed.join("analysed"), ".csv")
    }
}

fn with_ending(folder: &Path, ending: &str) -> Result<Vec<PathBuf>> {
    let entries = fs::read_dir(folder).map_err(|e| Error::file(folder, e))?;
    let named = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        name.ends_with(ending) && !name.starts_with('.')
    };
    let mut paths: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).filter(named).collect();
    paths.sort();
    Ok(paths)
}
