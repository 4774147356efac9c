//! The folder of a run: pools, models, and the outcome of an analysis.

use std::{
    fs,
    path::{Path, PathBuf},
};

use roscausal_core::{
    Error, Result,
    batch::{
        joint::Facts,
        pool::{Pool, with_ending},
    },
    bounded,
    nodes::EVIDENCE_FOLDER,
};
use roscausal_discovery::{Evidence, Model};

use crate::presets;

/// Marks a folder of a demo or replay, which the next one may empty.
pub(crate) const MARK: &str = ".roscausal_demo";

/// Prefix of the batches' names.
const PREFIX: &str = "data_";

/// Where the nodes put their files.
pub(crate) struct Folders {
    pub(crate) raw: PathBuf,
    pub(crate) processed: PathBuf,
    pub(crate) models: PathBuf,
}

/// The state of the analysis.
pub(crate) enum Outcome {
    Waiting,
    Model(Box<Model>),
    Rejected(String),
}

impl Folders {
    /// Empty folders in `out`. Those of an earlier demo are removed; anything else is left alone and is an error.
    pub(crate) fn fresh(out: &Path) -> Result<Self> {
        let folders =
            Self { raw: out.join("data_pool"), processed: out.join("pp_pool"), models: out.join("cm_pool") };
        let ours = out.join(MARK).exists();
        for folder in [&folders.raw, &folders.processed, &folders.models] {
            if folder.exists() && !ours {
                let reason = "there is something here that no demo or replay made; choose another --out";
                return Err(Error::file(folder, reason));
            }
            if folder.exists() {
                fs::remove_dir_all(folder).map_err(|e| Error::file(folder, e))?;
            }
            fs::create_dir_all(folder).map_err(|e| Error::file(folder, e))?;
        }
        let settings = out.join(presets::FILE);
        if ours && settings.exists() {
            fs::remove_file(&settings).map_err(|e| Error::file(settings, e))?;
        }
        fs::write(out.join(MARK), "").map_err(|e| Error::file(out, e))?;
        Ok(folders)
    }

    /// Whether there is a model or a rejection.
    pub(crate) fn outcome(&self) -> Result<Outcome> {
        if let Some(path) = self.model_files()?.first() {
            return Ok(Outcome::Model(Box::new(read_model(path)?)));
        }
        Ok(self.rejections()?.into_iter().next().map_or(Outcome::Waiting, Outcome::Rejected))
    }

    /// The models' files, oldest first.
    pub(crate) fn model_files(&self) -> Result<Vec<PathBuf>> {
        with_ending(&self.models, ".json")
    }

    /// What stands behind the first model, if it was kept.
    pub(crate) fn evidence(&self) -> Result<Option<Evidence>> {
        let Some(path) = self.model_files()?.into_iter().next() else { return Ok(None) };
        let name = path.file_name().unwrap_or_default();
        read_evidence(&self.models.join(EVIDENCE_FOLDER).join(name))
    }

    /// Why batches were rejected, one sentence each.
    pub(crate) fn rejections(&self) -> Result<Vec<String>> {
        let mut reasons = Vec::new();
        for pool in [&self.processed, &self.raw] {
            let rejected = pool.join("rejected");
            if !rejected.exists() {
                continue;
            }
            for path in with_ending(&rejected, ".reason.txt")? {
                let reason = fs::read_to_string(&path).map_err(|e| Error::file(&path, e))?;
                reasons.push(format!("{}: {}", path.display(), reason.trim()));
            }
        }
        Ok(reasons)
    }

    /// Batches that wait for analysis.
    pub(crate) fn waiting(&self) -> Result<usize> {
        Ok(Pool::open(&self.processed, PREFIX)?.contents()?.batches.len())
    }

    /// The batches that the model was made from.
    pub(crate) fn analysed_batches(&self) -> Result<Vec<PathBuf>> {
        with_ending(&self.processed.join("analysed"), ".csv")
    }
}

/// The batches in the folder of a demo, a replay, a result, or a node; or the CSV files in any other folder. If some batches
/// are complete, only those.
///
/// # Errors
/// A folder without any.
pub(crate) fn batches_in(folder: &Path) -> Result<Vec<PathBuf>> {
    let csv_files =
        |folder: PathBuf| if folder.is_dir() { with_ending(&folder, ".csv") } else { Ok(Vec::new()) };
    for pool in [folder.join("pp_pool"), folder.join("batches"), folder.to_path_buf()] {
        let mut batches = csv_files(pool.join("analysed"))?;
        batches.extend(csv_files(pool)?);
        batches.retain(|path| path.file_name().is_some_and(|name| name != "links.csv"));
        batches.sort_by_key(|path| path.file_name().map(ToOwned::to_owned));
        if batches.iter().any(|batch| Facts::read(batch).complete) {
            batches.retain(|batch| Facts::read(batch).complete);
        }
        if !batches.is_empty() {
            return Ok(batches);
        }
    }
    let reason = "there is nothing to analyse in this folder: no .csv, .bag, .mcap or .db3 file, and no pp_pool or batches \
                  with some";
    Err(Error::file(folder, reason))
}

/// The model in a file, checked.
pub(crate) fn read_model(path: &Path) -> Result<Model> {
    let text = bounded::read(path, bounded::MODEL)?;
    Model::from_json(&text).map_err(|e| Error::file(path, e))
}

/// The evidence in a file, checked; `None` if there is no such file.
pub(crate) fn read_evidence(path: &Path) -> Result<Option<Evidence>> {
    if !path.exists() {
        return Ok(None);
    }
    let text = bounded::read(path, bounded::MODEL)?;
    Evidence::from_json(&text).map(Some).map_err(|e| Error::file(path, e))
}
