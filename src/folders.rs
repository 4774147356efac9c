//! The folder of a run of nodes: pools, models, and the outcome of an analysis.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::{Arc, Mutex},
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
use roscausal_discovery::{Evidence, Model, lock};

use crate::{
    interrupt::Interrupt,
    results::{Results, check_whole, renamed},
};

/// Prefix of the batches' names.
const PREFIX: &str = "data_";

/// Name of the evidence beside a `model.json`.
pub(crate) const EVIDENCE: &str = "evidence.json";

/// Where the nodes put their files: first where the run works, later where its results are.
pub(crate) struct Folders {
    pub(crate) dir: PathBuf,
    pub(crate) raw: PathBuf,
    pub(crate) processed: PathBuf,
    pub(crate) models: PathBuf,
    /// The folder of the results.
    out: PathBuf,
    /// Until the results are kept; shared with an end of the process at once.
    results: Arc<Mutex<Option<Results>>>,
}

/// The state of the analysis.
pub(crate) enum Outcome {
    Waiting,
    Model(Box<Model>),
    Rejected(String),
}

impl Folders {
    /// Empty folders of a run with results in `out`. If the process is ended at once, what is recorded is kept.
    pub(crate) fn begin(out: &Path, reads: &[PathBuf], interrupt: &Interrupt) -> Result<Self> {
        let results = Results::begin(out, None, reads)?;
        let folders = Self::in_dir(results.folder(), out, Arc::new(Mutex::new(Some(results))));
        for folder in [&folders.raw, &folders.processed, &folders.models] {
            fs::create_dir_all(folder).map_err(|e| folders.named(Error::file(folder, e)))?;
        }
        let (results, raw) = (folders.results.clone(), folders.raw.clone());
        let out = folders.out.clone();
        interrupt.do_at_end(move || {
            if keep(&results, &raw).unwrap_or(false) {
                tell!("ended; {} keeps batches and models so far", out.display());
            }
        });
        Ok(folders)
    }

    fn in_dir(dir: PathBuf, out: &Path, results: Arc<Mutex<Option<Results>>>) -> Self {
        let [raw, processed, models] = ["data_pool", "pp_pool", "cm_pool"].map(|name| dir.join(name));
        Self { dir, raw, processed, models, out: out.to_owned(), results }
    }

    /// What the run has made takes the place of the results before, unless no batch was recorded. Returns where it is then.
    pub(crate) fn keep(&self) -> Result<Self> {
        keep(&self.results, &self.raw)?;
        Ok(Self::in_dir(self.out.clone(), &self.out, self.results.clone()))
    }

    /// An error in words about the folder of the results.
    pub(crate) fn named(&self, error: Error) -> Error {
        renamed(error, &self.dir, &self.out)
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
        read_evidence(&self.models.join(EVIDENCE_FOLDER).join(path.file_name().unwrap_or_default()))
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
                reasons.push(self.named(Error::file(&path, reason.trim())).to_string());
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

impl Drop for Folders {
    fn drop(&mut self) {
        // What was not kept: an end of the process at once need not know of it any more.
        drop(lock(&self.results).take());
    }
}

/// Keeps the results if there is a batch, and says whether; else all stays as it was.
fn keep(results: &Mutex<Option<Results>>, raw: &Path) -> Result<bool> {
    // Held to the end: whoever comes second waits.
    let mut results = lock(results);
    match results.take() {
        Some(results) if !with_ending(raw, ".csv")?.is_empty() => results.finish().map(|()| true),
        _ => Ok(false),
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
    check_whole(path)?;
    let path = &model_in(path)?;
    let text = bounded::read(path, bounded::MODEL)?;
    let is_other = path.extension().is_none_or(|ending| ending != "json");
    if is_other && !text.trim_ascii_start().starts_with(b"{") {
        return Err(Error::file(path, "not a model, which is JSON; of data, 'roscausal discover' makes one"));
    }
    Model::from_json(&text).map_err(|e| Error::file(path, e))
}

/// The file of a model: that of a folder is its `model.json`, or else the newest model in its `cm_pool` or in the folder itself.
pub(crate) fn model_in(path: &Path) -> Result<PathBuf> {
    let own = path.join("model.json");
    if !path.is_dir() || own.exists() {
        return Ok(if path.is_dir() { own } else { path.to_owned() });
    }
    let pool = Some(path.join("cm_pool")).filter(|pool| pool.is_dir()).unwrap_or_else(|| path.to_owned());
    let is_model = |file: &PathBuf| read_model(file).is_ok();
    with_ending(&pool, ".json")?.into_iter().rev().find(is_model).ok_or_else(|| {
        let reason = "there is no model here; give a folder of demo, replay or discover --out, or a model; of data, 'roscausal discover' \
                      makes one";
        Error::file(path, reason)
    })
}

/// The evidence in a file, checked; `None` if there is no such file.
pub(crate) fn read_evidence(path: &Path) -> Result<Option<Evidence>> {
    if !path.exists() {
        return Ok(None);
    }
    Evidence::from_json(&bounded::read(path, bounded::MODEL)?).map(Some).map_err(|e| Error::file(path, e))
}
