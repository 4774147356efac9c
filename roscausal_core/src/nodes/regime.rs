//! The present regime: which batches the models are made of, what changed, and how old each link is.
//!
//! Without keeping analysed batches, those of the window lie in `regime/` of the pool, moved there by one rename each. `regime.json`
//! beside them is the whole state. It is replaced in one step *before* anything of a batch is published. It names the batch that
//! was read last, so a process that takes over reads that batch no second time: an event is neither lost nor told twice.

use std::{
    collections::BTreeMap,
    fs::{self, File},
    path::{Path, PathBuf},
};

use roscausal_discovery::{
    Control, DataFrame, Model,
    changes::{ChangeEvent, Detector, Form, Levels, Status},
    names::position,
    spelled_out,
};
use serde::{Deserialize, Serialize};

use super::{link_ages::Age, recorded_changes::RecordedChange};
use crate::{
    Error, Result, Time,
    batch::{
        joint::{Joint, Part, People},
        pool::{Claim, Pool, sidecar, try_lock, write_whole},
    },
    error::parameter,
};

/// Name of the folder in the pool, and of the state in it.
const FOLDER: &str = "regime";
const FILE: &str = "regime.json";
/// Events that are kept for whoever comes late.
const EVENTS: usize = 64;
/// Stretches of rows whose times are kept.
const STRETCHES: usize = 64;

/// How the node rolls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RollParams {
    /// Most batches of a model.
    pub(super) batches: usize,
    /// Most samples of a model; 0: any number.
    pub(super) samples: usize,
    /// Whether changes are looked for, and by which levels.
    pub(super) changes: Option<Levels>,
    /// Rows that are compared at a time; 0: each batch as a whole.
    pub(super) change_rows: usize,
}

/// The state, as it stands in `regime.json`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Regime {
    /// The batch that was read last.
    pub(super) last: String,
    /// Stamp of its first sample, seconds.
    last_start: f64,
    /// The batches of the present model and their rows, oldest first.
    pub(super) window: Vec<(String, usize)>,
    /// Per person; the name is empty for the model of all.
    whose: BTreeMap<String, Whose>,
    /// The last events, oldest first.
    pub(super) events: Vec<RecordedChange>,
    /// Events told so far.
    n_events: usize,
    /// Changes told so far, all stages of one as one.
    n_changes: usize,
}

/// What is known of one person.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Whose {
    detector: Option<Detector>,
    stretches: Vec<Stretch>,
    /// Where the present regime begins: batch, and row in it.
    begins: Option<(String, usize)>,
    /// Stamp of that row, seconds.
    since: f64,
    /// Batches of the present regime.
    batches: u32,
    pub(super) links: Vec<Age>,
}

/// The rows of one batch, as the detector counts them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Stretch {
    batch: String,
    first: usize,
    rows: usize,
    /// Stamp of the first row, and the step, seconds.
    start: f64,
    dt: f64,
}

/// The state with its place on disk. Only one node has it at a time.
pub(super) struct Rolling {
    pub(super) params: RollParams,
    pub(super) regime: Regime,
    pool: Pool,
    /// Where analysed batches are kept, if they are.
    kept: Option<PathBuf>,
    _lock: File,
}

impl Rolling {
    /// Opens the state in a pool, or begins one.
    pub(super) fn open(pool: &Pool, params: RollParams, kept: Option<PathBuf>) -> Result<Self> {
        let dir = pool.path(FOLDER);
        fs::create_dir_all(&dir).map_err(|e| Error::file(&dir, e))?;
        let lock = File::open(&dir).map_err(|e| Error::file(&dir, e))?;
        Error::ensure(try_lock(&lock, &dir)?, "data_dir", || {
            format!("another node keeps its regime in {}; give each its own folder", dir.display())
        })?;
        let path = dir.join(FILE);
        let regime = match fs::read(&path) {
            Ok(text) => serde_json::from_slice(&text).unwrap_or_else(|error| {
                tracing::warn!("{}: {error}; a new regime begins", path.display());
                Regime::default()
            }),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Regime::default(),
            Err(error) => return Err(Error::file(&path, error)),
        };
        Ok(Self { params, regime, pool: pool.clone(), kept, _lock: lock })
    }

    /// The batches of a window in which `new` is the newest. Those that are gone are left out.
    pub(super) fn paths(&self, regime: &Regime, new: &Path) -> Vec<PathBuf> {
        let older = regime.window.iter().filter(|(name, _)| *name != regime.last);
        let places = [Some(self.pool.path(FOLDER)), self.kept.clone()];
        let find =
            |name: &String| places.iter().flatten().map(|dir| dir.join(name)).find(|path| path.exists());
        older.filter_map(|(name, _)| find(name)).chain([new.to_owned()]).collect()
    }

    /// Writes the state, so that it is the old or the new one at any moment.
    pub(super) fn save(&mut self, regime: Regime) -> Result<()> {
        if regime != self.regime {
            let text = serde_json::to_vec(&regime).map_err(|e| Error::Data(format!("{FILE}: {e}")))?;
            write_whole(&self.pool.path(FOLDER).join(FILE), &text)?;
            self.regime = regime;
        }
        Ok(())
    }

    /// Releases the newest batch: it is kept where it is found again. Batches that left the window go.
    pub(super) fn finish(&self, claims: Vec<Claim>) -> Result<()> {
        let dir = self.pool.path(FOLDER);
        self.pool.finish(claims, Some(self.kept.as_deref().unwrap_or(&dir)))?;
        self.tidy()
    }

    /// Completes what a process that is gone began, and removes what left the window.
    pub(super) fn tidy(&self) -> Result<()> {
        let dir = self.pool.path(FOLDER);
        for (name, _) in &self.regime.window {
            let (here, there) = (self.pool.path(&sidecar(name)), dir.join(sidecar(name)));
            if dir.join(name).exists() && here.exists() && !self.pool.path(name).exists() {
                fs::rename(&here, &there).map_err(|e| Error::file(&here, e))?;
            }
        }
        for entry in fs::read_dir(&dir).map_err(|e| Error::file(&dir, e))?.flatten() {
            let name = entry.file_name().to_string_lossy().into_owned();
            let in_window = |(batch, _): &(String, usize)| name == *batch || name == sidecar(batch);
            if name != FILE && !name.starts_with('.') && !self.regime.window.iter().any(in_window) {
                fs::remove_file(entry.path()).map_err(|e| Error::file(entry.path(), e))?;
            }
        }
        Ok(())
    }
}

/// A batch that is read.
pub(super) struct NewBatch<'a> {
    pub(super) name: &'a str,
    pub(super) path: &'a Path,
    pub(super) people: People,
    pub(super) tau_max: usize,
    pub(super) form: Form,
    /// Variables that the user calls exogenous: they are not effects.
    pub(super) exogenous: &'a [String],
}

impl Regime {
    /// The state after a batch: what changed, and which batches the model is made of. A batch that was read before changes
    /// nothing.
    pub(super) fn read(&mut self, new: &NewBatch<'_>, params: &RollParams, control: &Control) -> Result<()> {
        if self.last == new.name {
            return Ok(());
        }
        let mut joint = Joint::read(&[new.path])?;
        let announced = joint.announced();
        let (start, dt) = (joint.span().0.unwrap_or_default(), joint.dt.unwrap_or_default());
        let mut rows = 0;
        for part in joint.parts(new.people)? {
            rows = rows.max(part.data.recordings().iter().map(|recording| recording.nrows()).sum());
            let (Some(levels), [_]) = (params.changes, part.data.recordings()) else { continue };
            let key = key(&part);
            let mut whose = self.whose.remove(&key).unwrap_or_default();
            let reported =
                whose.read(self.n_changes, new, &part, &announced, (start, dt), levels, params, control);
            self.whose.insert(key, whose);
            let (reported, n_changes) = reported?;
            self.n_changes = n_changes;
            for (event, told, changed_from_to) in reported {
                self.n_events += 1;
                let (number, batch) = (self.n_events, stem(new.name));
                self.events.push(RecordedChange { number, event, batch, told, changed_from_to });
            }
        }
        self.events.drain(..self.events.len().saturating_sub(EVENTS));
        self.last = new.name.to_owned();
        self.last_start = start;
        self.window.push((new.name.to_owned(), rows));
        self.shorten(params);
        Ok(())
    }

    /// Forgets the batches before the newest one: they cannot be analysed with it.
    pub(super) fn begin_anew(&mut self) {
        self.window.retain(|(name, _)| *name == self.last);
        self.whose.values_mut().for_each(|whose| whose.begins = None);
    }

    /// The window's limits: batches, samples, and the present regime of somebody.
    fn shorten(&mut self, params: &RollParams) {
        let begins: Option<Vec<&str>> = (self.whose.values())
            .map(|whose| whose.begins.as_ref().map(|(batch, _)| batch.as_str()))
            .collect();
        let place = |batch: &str| self.window.iter().position(|(name, _)| name == batch);
        // A regime whose first batch has left the window has all of it.
        let of_regime =
            begins.into_iter().flatten().map(|batch| place(batch).unwrap_or(0)).min().unwrap_or(0);
        let mut first = self.window.len().saturating_sub(params.batches).max(of_regime);
        let rows = |window: &[(String, usize)]| window.iter().map(|(_, rows)| rows).sum::<usize>();
        while params.samples > 0
            && first + 1 < self.window.len()
            && rows(&self.window[first..]) > params.samples
        {
            first += 1;
        }
        self.window.drain(..first);
    }

    /// The rows of the present regime: what lies before it is cut off the recordings of a part.
    pub(super) fn of_present(&self, part: Part, names: &[String]) -> Result<Part> {
        let begins = self.whose.get(&key(&part)).and_then(|whose| whose.begins.as_ref());
        let Some((place, row)) =
            begins.and_then(|(batch, row)| Some((names.iter().position(|name| name == batch)?, *row)))
        else {
            return Ok(part);
        };
        let (mut recordings, mut sources) = (Vec::new(), Vec::new());
        for (recording, source) in part.data.recordings().iter().zip(&part.sources) {
            let from = if *source == place { row.min(recording.nrows()) } else { 0 };
            if *source >= place && from < recording.nrows() {
                recordings.push(recording.slice(ndarray::s![from.., ..]).to_owned());
                sources.push(*source);
            }
        }
        let data = DataFrame::new(recordings, part.data.var_names().to_vec())?.of_sources(&sources)?;
        Ok(Part { data, sources, ..part })
    }

    /// Gives the links of a model their ages. A batch counts once.
    pub(super) fn age(&mut self, person: &str, model: &mut Model, is_new: bool) {
        let whose = self.whose.entry(person.to_owned()).or_default();
        if is_new {
            Age::count(&mut whose.links, model, self.last_start);
        }
        Age::write(&whose.links, model);
    }

    /// Stamp of the present regime's first sample and its batches: of the person whose regime began last.
    pub(super) fn since(&self) -> (Time, u32) {
        let of = self.whose.values().filter(|whose| whose.detector.is_some());
        let latest = of.max_by(|a, b| a.since.total_cmp(&b.since));
        latest.map_or((Time::ZERO, 0), |whose| (Time::from_secs_f64(whose.since), whose.batches))
    }

    /// Number of the present regime of whoever had most, from 1; 0 without detector.
    pub(super) fn number(&self) -> usize {
        let detectors = self.whose.values().filter_map(|whose| whose.detector.as_ref());
        detectors.map(Detector::regime).max().unwrap_or(0)
    }

    /// How many of the last events have this status.
    pub(super) fn count(&self, status: Status) -> usize {
        self.events.iter().filter(|reported| reported.event.status == status).count()
    }

    /// The last event, if it is a suspicion: what the next rows decide.
    pub(super) fn suspicion(&self) -> Option<String> {
        let last = self.events.last().filter(|reported| reported.event.status == Status::Suspected)?;
        Some(last.event.sentence())
    }
}

/// An event, the stamp of the last sample read, and those between which the link changed.
type Timed = (ChangeEvent, f64, Option<[f64; 2]>);

impl Whose {
    /// Reads a batch. Returns what is told, and how many changes were told in all.
    #[expect(clippy::too_many_arguments, reason = "what a batch is, where it is, and how it is read")]
    fn read(
        &mut self,
        n_changes: usize,
        new: &NewBatch<'_>,
        part: &Part,
        announced: &[(String, Vec<f64>)],
        (start, dt): (f64, f64),
        levels: Levels,
        params: &RollParams,
        control: &Control,
    ) -> Result<(Vec<Timed>, usize)> {
        let base: Vec<String> =
            part.data.var_names().iter().filter(|name| !part.exogenous.contains(name)).cloned().collect();
        if base.len() < 2 {
            return Ok((Vec::new(), n_changes));
        }
        let given: Vec<String> =
            base.iter().filter(|name| position(new.exogenous, name).is_some()).cloned().collect();
        let knows = |detector: &Detector| detector.is_for(&base, &given, new.tau_max, levels, new.form);
        let mut detector = match self.detector.take() {
            Some(detector) if knows(&detector) => detector,
            before => {
                if before.is_some() {
                    let why = "other variables or settings than before";
                    tracing::warn!("{}: {why}: a new regime begins", new.name);
                }
                *self = Self { since: start, ..Self::default() };
                Detector::new(base.clone(), new.tau_max, &given, levels)?.of_form(new.form)
            }
        }
        .numbered_after(n_changes);
        let set = |(_, values): &&(String, Vec<f64>)| values.iter().any(|value| value.abs() > 0.0);
        for (name, _) in announced.iter().filter(set) {
            if !detector.names().contains(name) {
                detector.add_exogenous(name);
            }
        }
        let values = columns(&part.data, detector.names(), announced);
        let first = detector.rows();
        let rows = values.nrows();
        let size =
            if params.change_rows == 0 { rows } else { params.change_rows }.max(detector.fewest_rows());
        if rows < detector.fewest_rows() {
            let (name, fewest) = (new.name, detector.fewest_rows());
            tracing::warn!("{name}: {rows} rows; a change is looked for in batches of {fewest} or more");
        }
        let (before, fitted) = (detector.regime(), detector.misfit().is_none());
        let events = detector.read_in_parts(values.view(), &[], size, control)?;
        if let Some(misfit) = detector.misfit().filter(|_| fitted) {
            tracing::warn!("{}", spelled_out(&misfit, parameter));
        }
        self.stretches.push(Stretch { batch: new.name.to_owned(), first, rows, start, dt });
        self.stretches.drain(..self.stretches.len().saturating_sub(STRETCHES));
        if detector.regime() == before {
            self.batches += 1;
        } else {
            self.begin(detector.since());
        }
        let stamp = |row: usize| self.stamp(row);
        let timed = |event: ChangeEvent| {
            let changed = event.changed_between.map(|[from, to]| [stamp(from), stamp(to)]);
            let reported = stamp(event.time.saturating_sub(1));
            (event, reported, changed)
        };
        let reported = events.into_iter().map(timed).collect();
        let n_changes = detector.reported();
        self.detector = Some(detector);
        Ok((reported, n_changes))
    }

    /// A regime begins at a row.
    fn begin(&mut self, row: usize) {
        self.since = self.stamp(row);
        let place = self.stretches.iter().rposition(|stretch| stretch.first <= row);
        if let Some((place, stretch)) = place.and_then(|place| Some((place, self.stretches.get(place)?))) {
            self.begins = Some((stretch.batch.clone(), row - stretch.first));
            self.batches = u32::try_from(self.stretches.len() - place).unwrap_or(u32::MAX);
        }
    }

    /// When a row was recorded.
    fn stamp(&self, row: usize) -> f64 {
        let stretch = self.stretches.iter().rfind(|stretch| stretch.first <= row).or(self.stretches.first());
        stretch.map_or(0.0, |stretch| stretch.start + stretch.dt * row.saturating_sub(stretch.first) as f64)
    }
}

/// The columns in this order; those that were announced as they are, 0 where nothing was.
fn columns(data: &DataFrame, names: &[String], announced: &[(String, Vec<f64>)]) -> ndarray::Array2<f64> {
    let recording = &data.recordings()[0];
    let mut values = ndarray::Array2::zeros((recording.nrows(), names.len()));
    for (i, name) in names.iter().enumerate() {
        let mut column = values.column_mut(i);
        if let Some((_, given)) = announced.iter().find(|(other, _)| other == name) {
            column.iter_mut().zip(given).for_each(|(to, from)| *to = *from);
        } else if let Some(place) = data.var_names().iter().position(|other| other == name) {
            column.assign(&recording.column(place));
        }
    }
    values
}

fn key(part: &Part) -> String {
    part.person.map_or(String::new(), |id| format!("_person_{id}"))
}

/// File name without extension.
fn stem(name: &str) -> String {
    name.strip_suffix(".csv").unwrap_or(name).to_owned()
}
