//! The runs of an experiment, each in a file of its own, so that a sweep can be interrupted, distributed and
//! merged.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
    time::Instant,
};

use ndarray::Array2;
use roscausal_core::{
    Error, Result,
    batch::{
        Recording,
        postprocess::{Feature, Obstacle, Postprocess},
        risk::RiskModel,
    },
};
use roscausal_discovery::{
    Control, DataFrame, Model, Settings, analyse,
    confidence::{Resampling, analyse_resampled},
};
use roscausal_hrisim::Scenario;
use serde::{Deserialize, Serialize};

use super::{grid::Setting, recordings::batches};
use crate::{expected, interrupt::Interrupt, output};

/// Folder of the run files.
const FOLDER: &str = "runs";
/// As in the paper: metres, and the names of speed, distance to goal and risk.
const OBS_SIZE: f64 = 2.0;
const SAFE_DIST: f64 = 5.0;
pub(super) const NAMES: [&str; 3] = ["h_v", "h_dg", "h_risk"];

/// One run: its setting and its result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Run {
    pub(crate) setting: Setting,
    pub(crate) seed: u64,
    /// Everything else that the result depends on, so that a change makes a new run.
    pub(crate) rest: String,
    /// Samples analysed.
    pub(crate) n_samples: usize,
    /// Cross links found: cause and effect, at any lag.
    pub(crate) found: Vec<(String, String)>,
    /// Cross links that the scenario has.
    pub(crate) expected: Vec<(String, String)>,
    /// With resamples: each possible cross link and its share.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) shares: Vec<Share>,
    /// Wall time of the analysis on one core, seconds.
    pub(crate) run_time_s: f64,
}

/// The share of the resamples in which there is a link, at any lag.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Share {
    pub(crate) cause: String,
    pub(crate) effect: String,
    pub(crate) share: f64,
}

/// What all runs of a sweep share.
pub(crate) struct Common {
    pub(crate) analysis: Settings,
    pub(crate) resampling: Option<Resampling>,
    pub(crate) risk_noise: f64,
    pub(crate) out: PathBuf,
}

impl Common {
    /// The file of a run.
    pub(crate) fn path(&self, setting: &Setting, scenario: &Scenario, seed: u64) -> PathBuf {
        self.out.join(FOLDER).join(file_name(setting, seed, &self.rest(setting, scenario)))
    }

    /// What a run depends on in addition to its setting and seed.
    fn rest(&self, setting: &Setting, scenario: &Scenario) -> String {
        let analysis = setting.analysis(&self.analysis);
        let resampling = self.resampling.as_ref().map_or(String::new(), |of| format!(" {of:?}"));
        format!(
            "version {} risk_noise {} {:016x} {analysis:?}{resampling}",
            env!("CARGO_PKG_VERSION"),
            self.risk_noise,
            hash(&format!("{scenario:?}"))
        )
    }

    /// Post-processes and analyses a recording, and writes the run's file.
    pub(crate) fn analyse(
        &self,
        setting: &Setting,
        scenario: &Scenario,
        seed: u64,
        recording: &Recording,
        interrupt: &Interrupt,
    ) -> Result<()> {
        let risk_model = setting.risk_model.parse().map_err(|reason| Error::param("risk-models", reason))?;
        let postprocess = Postprocess { risk_model, ..postprocess(setting.risk_lag, self.risk_noise, seed)? };
        let (mut names, mut tables) = (Vec::new(), Vec::new());
        for batch in batches(recording, setting.length)? {
            let mut columns = postprocess.run(&batch)?.columns;
            // An intervention that is never active does not vary.
            let n_rows = (setting.length / setting.step).round() as usize;
            let is_idle = |rows: &Vec<Vec<f64>>| is_constant(&rows[..n_rows.min(rows.len())]);
            columns.retain(|column| !recording.context.get(&column.name).is_some_and(is_idle));
            let values = |(row, i): (usize, usize)| columns[i].values[row];
            tables.push(Array2::from_shape_fn((batch.n_rows(), columns.len()), values));
            names = columns.into_iter().map(|column| column.name).collect();
        }
        let mut settings = setting.analysis(&self.analysis);
        settings.exogenous = recording.context.keys().filter(|name| names.contains(name)).cloned().collect();
        let data = DataFrame::new(tables, names)?;
        let control = Control::default().cancel_on(interrupt.flag());
        let start = Instant::now();
        let model = match &self.resampling {
            Some(resampling) => analyse_resampled(&data, &settings, resampling, &control)?,
            None => analyse(&data, &settings, &control)?,
        };
        let run_time_s = start.elapsed().as_secs_f64();
        let others = model.links.iter().filter(|link| link.cause != link.effect);
        let found: BTreeSet<_> = others.map(|link| (link.cause.clone(), link.effect.clone())).collect();
        let run = Run {
            setting: setting.clone(),
            seed,
            rest: self.rest(setting, scenario),
            n_samples: model.n_samples,
            found: found.into_iter().collect(),
            expected: expected::links_of(scenario),
            shares: shares(&model),
            run_time_s,
        };
        run.write(&self.out)
    }
}

/// What the data node makes of a recording: the paper's variables.
pub(super) fn postprocess(risk_lag: usize, risk_noise: f64, seed: u64) -> Result<Postprocess> {
    let (obs_size, safe_dist, obstacle) = (OBS_SIZE, SAFE_DIST, Obstacle::Robot);
    let features = Feature::defaults(&NAMES.map(str::to_owned))?;
    let risk_model = RiskModel::default();
    Ok(Postprocess { risk_model, risk_lag, risk_noise, seed, obs_size, safe_dist, obstacle, features })
}

/// The shares of all cross links among the paper's variables.
fn shares(model: &Model) -> Vec<Share> {
    let Some(confidence) = &model.confidence else { return Vec::new() };
    let mut shares = Vec::new();
    for (cause, row) in model.features.iter().zip(&confidence.summary_frequency) {
        for (effect, share) in model.features.iter().zip(row) {
            let of_paper = [cause, effect].iter().all(|name| NAMES.contains(&name.as_str()));
            if cause != effect && of_paper {
                shares.push(Share { cause: cause.clone(), effect: effect.clone(), share: *share });
            }
        }
    }
    shares
}

impl Run {
    /// Whether the scenario has the link of a share.
    pub(crate) fn has(&self, share: &Share) -> bool {
        self.expected.iter().any(|(cause, effect)| *cause == share.cause && *effect == share.effect)
    }

    /// Writes the run into the folder of runs below `out`.
    ///
    /// # Errors
    /// The error of the file system.
    pub(crate) fn write(&self, out: &Path) -> Result<()> {
        let name = file_name(&self.setting, self.seed, &self.rest);
        let text = serde_json::to_string_pretty(self).map_err(|e| Error::Data(e.to_string()))? + "\n";
        output::write_file(&out.join(FOLDER), &name, text.as_bytes())
    }

    /// Reads the file of a run; `None` if it does not exist.
    ///
    /// # Errors
    /// A file that is not a run.
    pub(crate) fn read(path: &Path) -> Result<Option<Self>> {
        match fs::read(path) {
            Ok(text) => {
                serde_json::from_slice(&text).map(Some).map_err(|e| Error::file(path, format!("no run: {e}")))
            }
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(None),
            Err(e) => Err(Error::file(path, e)),
        }
    }

    /// All runs below `out`, in the order of their file names.
    ///
    /// # Errors
    /// A folder without runs, or a file that is not a run.
    pub(crate) fn all(out: &Path) -> Result<Vec<Self>> {
        let folder = out.join(FOLDER);
        let entries = fs::read_dir(&folder)
            .map_err(|e| Error::file(&folder, format!("{e}; give the --out folder of an experiment")))?;
        let mut paths: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
        paths.retain(|path| {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            name.ends_with(".json") && !name.starts_with('.')
        });
        paths.sort();
        paths.iter().filter_map(|path| Self::read(path).transpose()).collect()
    }
}

fn is_constant(rows: &[Vec<f64>]) -> bool {
    rows.windows(2).all(|pair| pair[0] == pair[1])
}

fn file_name(setting: &Setting, seed: u64, rest: &str) -> String {
    let plain = |text: &str| -> String {
        let legal = |c: char| if c.is_alphanumeric() || "._".contains(c) { c } else { '-' };
        text.rsplit(['/', '\\']).next().unwrap_or_default().chars().map(legal).collect()
    };
    let cells: Vec<String> = setting.cells().iter().map(|cell| plain(cell)).collect();
    format!("{}_seed{seed}_{:016x}.json", cells.join("_"), hash(&format!("{setting:?} {rest}")))
}

/// FNV-1a, 64 bits: the same on every machine.
fn hash(text: &str) -> u64 {
    text.bytes()
        .fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}
