//! Writes recorded batches to files, on a thread of its own, so that recording never waits for a disk or a script.

use std::{
    fs::{self, File},
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
        mpsc::{Receiver, SyncSender, TrySendError, sync_channel},
    },
    thread::{self, JoinHandle},
    time::Duration,
};

use chrono::{DateTime, format::StrftimeItems};
use serde_json::{Map, Value as Json, json};

use super::{
    journal::{self, Journal, JournalStatus},
    pool::{Limits, Pool, sidecar, sync_dir},
    postprocess::Postprocess,
    recording::{Column, Recording},
    script::Script,
};
use crate::{Error, Result};

/// Most batches that wait to be written.
const WAITING: usize = 64;
/// Time before a batch that could not be written is tried again.
const TRY_AGAIN: Duration = Duration::from_secs(1);
/// How often a request to end is checked meanwhile.
const LOOK_AGAIN: Duration = Duration::from_millis(50);
/// Suffixes of the names of markers (see [`Step`]).
const COMMIT: &str = ".commit";
const DONE: &str = ".done";
/// Version of the metadata beside a batch.
const SCHEMA: &str = "roscausal-batch/1";

/// What happens to a raw batch.
#[derive(Clone, Debug)]
pub enum Processing {
    /// Nothing: the raw batch is the result.
    None,
    /// The built-in post-processing.
    BuiltIn(Postprocess),
    /// A program of the user.
    Script(Script),
}

/// Where and how batches are written.
#[derive(Clone, Debug)]
pub struct WriterConfig {
    /// Folder of raw batches.
    pub raw: Pool,
    /// Folder of post-processed batches.
    pub processed: Pool,
    /// `strftime` format of a batch's id, from the stamp of its first row (UTC).
    pub id_format: String,
    /// Raw columns in the original's spelling.
    pub legacy_columns: bool,
    /// Whether the raw batch is deleted once the post-processed one is written.
    pub delete_raw: bool,
    /// What happens to a raw batch.
    pub processing: Processing,
    /// Parameters to note beside each batch.
    pub parameters: Map<String, Json>,
    /// How much each of the two pools may hold.
    pub limits: Limits,
    /// Whether the open batch is journalled.
    pub journal: bool,
}

/// Progress of a batch on its way to disk. Exactly one rename lies between two steps, so at any moment it is
/// certain what is done. The raw batch is staged, *its journal becomes `.NAME.commit`*, the raw batch gets its
/// name. The post-processed batch is staged, *the marker becomes `.NAME.done`*, the post-processed batch gets its
/// name, the marker is removed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    Recorded,
    Staged,
    Written,
    Processed,
}

/// Where the journal of a batch is.
#[derive(Debug)]
enum Origin {
    /// There is no journal.
    None,
    /// The [`Journal`] has it under this number.
    Open(u64),
    /// A process that is gone left it.
    Left(PathBuf),
}

/// A batch on its way to disk.
#[derive(Debug)]
struct Job {
    batch: Recording,
    journal: Origin,
    recovered: bool,
    step: Step,
    name: String,
    /// There is a marker.
    protected: bool,
}

impl Job {
    fn new(batch: Recording, journal: Origin) -> Self {
        Self { batch, journal, recovered: false, step: Step::Recorded, name: String::new(), protected: false }
    }

    fn left_at(name: String, step: Step) -> Self {
        let job = Self::new(Recording::default(), Origin::None);
        Self { name, step, protected: true, ..job }
    }
}

/// State of the writer, for the diagnostics.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct WriterStatus {
    /// Batches written.
    pub written: u64,
    /// Batches post-processed.
    pub processed: u64,
    /// Post-processings that failed; their raw batches stay.
    pub failed: u64,
    /// Batches lost because the disk refused them for too long.
    pub lost: u64,
    /// Batches recovered from what a killed node left.
    pub recovered: u64,
    /// Batches dropped because the pool was full.
    pub dropped: u64,
    /// Whether the pool is full and nothing may be dropped: recording has to stop.
    pub full: bool,
    /// Why the last step failed, until one succeeds.
    pub trouble: Option<String>,
    /// Why the last post-processing failed, until one succeeds.
    pub last_failure: Option<String>,
    /// Name of the last batch written.
    pub last: Option<String>,
}

/// The thread that writes. Dropping it waits until all batches are written.
#[derive(Debug)]
pub struct Writer {
    batches: Option<SyncSender<Job>>,
    journal: Option<Arc<Journal>>,
    first_journal: u64,
    _lock: File,
    thread: Option<JoinHandle<()>>,
    ending: Arc<AtomicBool>,
    status: Arc<Mutex<WriterStatus>>,
}

impl WriterConfig {
    /// Checks the format of ids.
    ///
    /// # Errors
    /// A format that strftime does not know, as an error of the parameter `id_format`.
    pub fn check(&self) -> Result<()> {
        use chrono::format::Item;
        if self.id_format.is_empty()
            || StrftimeItems::new(&self.id_format).any(|item| matches!(item, Item::Error))
        {
            let reason = format!("'{}' is no strftime format; such as %Y%m%d_%H%M%S", self.id_format);
            return Err(Error::param("id_format", reason));
        }
        Ok(())
    }

    /// Writes a batch and post-processes it, in step with its journal (see [`Step`]).
    fn write(&self, job: &mut Job, journal: Option<&Journal>, status: &Mutex<WriterStatus>) -> Result<()> {
        if job.step == Step::Recorded {
            let stamp = DateTime::from_timestamp(i64::from(job.batch.start.sec), job.batch.start.nanosec);
            let id = stamp.unwrap_or_default().format(&self.id_format).to_string();
            let name = free_name(&self.raw, &self.processed, &id);
            let raw = job.batch.columns(self.legacy_columns);
            let (facts, text) = (self.metadata(job, &raw, None), csv(&job.batch, &raw));
            self.make_room(&self.raw, facts.len() + text.len(), status)?;
            // The metadata comes first, so whoever sees the batch finds it.
            self.raw.write(&sidecar(&name), &facts)?;
            let staged = self.raw.stage(&name, &text)?;
            job.name.clone_from(&name);
            job.protected = match &job.journal {
                Origin::None => false,
                Origin::Open(number) => match journal {
                    Some(journal) => journal.retire(*number, &marker(&name, COMMIT))?,
                    None => false,
                },
                Origin::Left(path) => {
                    self.rename(path, &self.raw.path(&marker(&name, COMMIT))).map(|()| true)?
                }
            };
            job.step = Step::Staged;
            staged.publish()?;
            self.has_written(job, status);
        }
        if job.step == Step::Staged {
            if let Some(staged) = self.raw.staged(&job.name) {
                staged.publish()?;
                self.has_written(job, status);
            }
            job.step = Step::Written;
        }
        if job.step == Step::Written && !self.postprocess(job, status)? {
            return self.forget_marker(job, COMMIT);
        }
        if job.step == Step::Processed {
            if let Some(staged) = self.processed.staged(&job.name) {
                staged.publish()?;
            }
            if self.delete_raw {
                for file in [job.name.clone(), sidecar(&job.name)] {
                    remove(&self.raw.path(&file))?;
                }
            }
            self.forget_marker(job, DONE)?;
        }
        Ok(())
    }

    fn has_written(&self, job: &Job, status: &Mutex<WriterStatus>) {
        tracing::info!("wrote {} ({} rows)", self.raw.path(&job.name).display(), job.batch.n_rows());
        let mut status = lock(status);
        status.written += 1;
        status.last = Some(job.name.clone());
    }

    /// Post-processes a batch. Returns whether there is a result.
    fn postprocess(&self, job: &mut Job, status: &Mutex<WriterStatus>) -> Result<bool> {
        let name = &job.name;
        let done = match &self.processing {
            Processing::None => return Ok(false),
            Processing::BuiltIn(postprocess) => postprocess.run(&job.batch).map(|features| {
                (self.metadata(job, &features.columns, Some(name)), csv(&job.batch, &features.columns))
            }),
            Processing::Script(script) => script
                .run(name, self.raw.dir(), self.processed.dir())
                .map(|bytes| (self.metadata(job, &[], Some(name)), bytes)),
        };
        match done {
            Ok((facts, text)) => {
                self.make_room(&self.processed, facts.len() + text.len(), status)?;
                self.processed.write(&sidecar(name), &facts)?;
                let staged = self.processed.stage(name, &text)?;
                if job.protected {
                    let path = |kind| self.raw.path(&marker(name, kind));
                    self.rename(&path(COMMIT), &path(DONE))?;
                }
                job.step = Step::Processed;
                let mut status = lock(status);
                (status.processed, status.last_failure) = (status.processed + 1, None);
                drop(status);
                staged.publish().map(|()| true)
            }
            Err(error) => {
                let dir = self.raw.dir().display();
                tracing::error!("{name} is not post-processed and stays in {dir}: {error}");
                let mut status = lock(status);
                status.failed += 1;
                status.last_failure = Some(error.to_string());
                Ok(false)
            }
        }
    }

    fn make_room(&self, pool: &Pool, bytes: usize, status: &Mutex<WriterStatus>) -> Result<()> {
        let Some(dropped) = pool.make_room(self.limits, bytes as u64)? else {
            lock(status).full = true;
            return Err(Error::file(
                pool.dir(),
                "the pool holds as much as max_pool_size and max_pool_bytes allow and recording has stopped; move batches \
                 away, or set pool_policy to drop_oldest",
            ));
        };
        for name in &dropped {
            tracing::warn!("dropped {}: no room in the pool for a new batch", pool.path(name).display());
        }
        lock(status).dropped += dropped.len() as u64;
        Ok(())
    }

    fn forget_marker(&self, job: &Job, kind: &str) -> Result<()> {
        if job.protected { remove(&self.raw.path(&marker(&job.name, kind))) } else { Ok(()) }
    }

    fn rename(&self, from: &Path, to: &Path) -> Result<()> {
        match fs::rename(from, to) {
            // It was renamed before something else failed.
            Err(e) if e.kind() == std::io::ErrorKind::NotFound && to.exists() => {}
            done => done.map_err(|e| Error::file(from, e))?,
        }
        sync_dir(self.raw.dir())
    }

    /// Continues where a process that is gone stopped: completes what was being written, and makes batches from
    /// journals. Returns what remains to be done.
    fn recover(&self) -> Result<Vec<Job>> {
        let mut jobs = Vec::new();
        jobs.extend(self.raw.hidden(DONE)?.into_iter().map(|name| Job::left_at(name, Step::Processed)));
        for name in self.raw.hidden(COMMIT)? {
            let path = self.raw.path(&marker(&name, COMMIT));
            if let Some(staged) = self.raw.staged(&name) {
                staged.publish()?;
            }
            let mut job = Job::left_at(name, Step::Staged);
            if !matches!(self.processing, Processing::None)
                && let Some(batch) = self.replayed(&path)?.into_iter().next()
            {
                job.batch = batch;
            }
            jobs.push(job);
        }
        // A staged file that belongs to none of these was incomplete.
        for pool in [&self.raw, &self.processed] {
            for name in pool.hidden(".tmp")? {
                if !jobs.iter().any(|job| job.name == name) {
                    remove(&pool.path(&format!(".{name}.tmp")))?;
                }
            }
        }
        let journals = self.raw.hidden(".journal")?;
        for (i, name) in journals.iter().enumerate() {
            let path = self.raw.path(&format!(".{name}.journal"));
            let mut batches = self.replayed(&path)?.into_iter();
            let Some(batch) = batches.next() else {
                remove(&path)?;
                continue;
            };
            jobs.push(Job { recovered: true, ..Job::new(batch, Origin::Left(path)) });
            // What follows is in the next journal, if there is one.
            if i + 1 == journals.len() {
                jobs.extend(batches.map(|batch| Job { recovered: true, ..Job::new(batch, Origin::None) }));
            }
        }
        Ok(jobs)
    }

    /// The batches of a journal that was left behind. An unreadable journal is moved to `rejected/`.
    fn replayed(&self, path: &Path) -> Result<Vec<Recording>> {
        let bytes = fs::read(path).map_err(|e| Error::file(path, e))?;
        match journal::replay(&bytes) {
            Ok(batches) => Ok(batches),
            // Killed before the journal had any content.
            Err(_) if bytes.len() < 4096 => remove(path).map(|()| Vec::new()),
            Err(reason) => {
                let folder = self.raw.path("rejected");
                fs::create_dir_all(&folder).map_err(|e| Error::file(&folder, e))?;
                let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
                let to = folder.join(name.trim_start_matches('.'));
                fs::rename(path, &to).map_err(|e| Error::file(path, e))?;
                tracing::error!("{} is no journal ({reason}); moved to {}", path.display(), to.display());
                Ok(Vec::new())
            }
        }
    }

    /// The JSON beside a batch.
    fn metadata(&self, job: &Job, columns: &[Column], source: Option<&str>) -> Vec<u8> {
        let batch = &job.batch;
        let seconds = |row: usize| batch.stamp(row).as_secs_f64();
        let gap = |gap: super::Gap| json!({ "body": gap.body, "from": gap.from, "to": gap.to });
        let imposed = |one: super::Imposed| json!({ "column": one.column, "value": one.value, "from": one.from, "to": one.to });
        let unit = |column: &Column| json!({ "name": column.name, "unit": column.unit });
        let mut facts = json!({
            "schema": SCHEMA,
            "software_version": env!("CARGO_PKG_VERSION"),
            "complete": batch.complete,
            "ended_by": batch.ended_by,
            "recovered": job.recovered,
            "frame": batch.frame,
            "dt": batch.dt_ns as f64 * 1e-9,
            "n_rows": batch.n_rows(),
            "start": seconds(0),
            "end": seconds(batch.n_rows().saturating_sub(1)),
            "time_unit": "s",
            "ids": batch.people.keys().collect::<Vec<_>>(),
            "gaps": batch.gaps().into_iter().map(gap).collect::<Vec<_>>(),
            "context": batch.context.keys().collect::<Vec<_>>(),
            "interventions": batch.interventions().into_iter().map(imposed).collect::<Vec<_>>(),
            "parameters": self.parameters,
        });
        if !columns.is_empty() {
            facts["columns"] = columns.iter().map(unit).collect();
        }
        if let Some(source) = source {
            facts["source"] = json!(source);
        }
        let mut bytes = serde_json::to_vec_pretty(&facts).unwrap_or_default();
        bytes.push(b'\n');
        bytes
    }
}

impl Writer {
    /// Starts the thread.
    ///
    /// # Errors
    /// A bad format of ids, or a system that gives no thread.
    pub fn start(config: WriterConfig) -> Result<Self> {
        config.check()?;
        let lock = config.raw.lock_for_recording()?;
        let left = config.recover()?;
        let number = |name: String| {
            name.rsplit(|c: char| !c.is_ascii_digit()).next().and_then(|n| n.parse::<u64>().ok())
        };
        let newest = config.raw.hidden(".journal")?.into_iter().filter_map(number).max().unwrap_or(0);
        let journal = config.journal.then(|| Journal::start(config.raw.clone())).transpose()?.map(Arc::new);
        let (sender, receiver) = sync_channel(WAITING);
        let (ending, status) =
            (Arc::new(AtomicBool::new(false)), Arc::new(Mutex::new(WriterStatus::default())));
        let work = Work { config, journal: journal.clone(), ending: ending.clone(), status: status.clone() };
        let thread = thread::Builder::new()
            .name("batch-writer".into())
            .spawn(move || work.run(left, &receiver))
            .map_err(|e| Error::Data(format!("no thread to write batches: {e}")))?;
        let batches = Some(sender);
        let first_journal = newest + 1;
        Ok(Self { batches, journal, first_journal, _lock: lock, thread: Some(thread), ending, status })
    }

    /// Number of the first journal, for [`super::recorder::Recorder::with_journal`]; `None` if no journal is kept.
    pub fn first_journal(&self) -> Option<u64> {
        self.journal.as_ref().map(|_| self.first_journal)
    }

    /// Journals what the recorder has reported; returns at once.
    pub fn note(&self, entries: Vec<journal::Entry>) {
        if let Some(journal) = &self.journal {
            journal.append(entries);
        }
    }

    /// State of the journal.
    pub fn journal_status(&self) -> JournalStatus {
        self.journal.as_ref().map_or_else(JournalStatus::default, |journal| journal.status())
    }

    /// Hands over a batch, with the number of its journal if it has one; returns at once.
    pub fn write(&self, batch: Recording, journal: Option<u64>) {
        let Some(batches) = &self.batches else { return };
        let origin = journal.map_or(Origin::None, Origin::Open);
        if let Err(TrySendError::Full(job) | TrySendError::Disconnected(job)) =
            batches.try_send(Job::new(batch, origin))
        {
            let mut status = self.lock();
            status.lost += 1;
            tracing::error!(
                "lost a batch of {} rows: {WAITING} others wait to be written",
                job.batch.n_rows()
            );
        }
    }

    /// State of the writer so far.
    pub fn status(&self) -> WriterStatus {
        self.lock().clone()
    }

    /// Whether the pool is full, so that recording has to stop.
    pub fn is_full(&self) -> bool {
        self.lock().full
    }

    fn lock(&self) -> MutexGuard<'_, WriterStatus> {
        lock(&self.status)
    }
}

impl Drop for Writer {
    fn drop(&mut self) {
        self.ending.store(true, Ordering::Relaxed);
        self.batches = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// What the thread works with.
struct Work {
    config: WriterConfig,
    journal: Option<Arc<Journal>>,
    ending: Arc<AtomicBool>,
    status: Arc<Mutex<WriterStatus>>,
}

impl Work {
    /// Writes the batches that were left behind and all new ones, in order. A batch that cannot be written is tried
    /// again until the node ends.
    fn run(&self, left: Vec<Job>, batches: &Receiver<Job>) {
        for job in left {
            tracing::warn!("going on with a batch that was left unfinished {}", job.name);
            lock(&self.status).recovered += u64::from(job.step == Step::Recorded);
            self.finish(job);
        }
        while let Ok(job) = batches.recv() {
            self.finish(job);
        }
    }

    fn finish(&self, mut job: Job) {
        loop {
            let last_try = self.ending.load(Ordering::Relaxed);
            let Err(error) = self.config.write(&mut job, self.journal.as_deref(), &self.status) else {
                break;
            };
            let mut status = lock(&self.status);
            let trouble = error.to_string();
            if status.trouble.as_ref() != Some(&trouble) {
                tracing::error!("{trouble}");
            }
            status.trouble = Some(trouble);
            if last_try {
                status.lost += u64::from(job.step == Step::Recorded);
                return;
            }
            drop(status);
            let looks = TRY_AGAIN.as_millis() / LOOK_AGAIN.as_millis();
            (0..looks)
                .take_while(|_| !self.ending.load(Ordering::Relaxed))
                .for_each(|_| thread::sleep(LOOK_AGAIN));
        }
        let mut status = lock(&self.status);
        (status.trouble, status.full) = (None, false);
    }
}

/// Name of the marker of a batch that is between two steps.
fn marker(name: &str, kind: &str) -> String {
    format!(".{name}{kind}")
}

fn remove(path: &Path) -> Result<()> {
    match fs::remove_file(path) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(Error::file(path, e)),
        _ => Ok(()),
    }
}

fn lock(status: &Mutex<WriterStatus>) -> MutexGuard<'_, WriterStatus> {
    status.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A name that exists in neither folder.
fn free_name(raw: &Pool, processed: &Pool, id: &str) -> String {
    let mut id_and_count = id.to_owned();
    for count in 2.. {
        let name = raw.new_name(&id_and_count);
        if !processed.path(&name).exists() {
            return name;
        }
        id_and_count = format!("{id}_{count}");
    }
    raw.new_name(id)
}

/// `time` and the columns. Missing values are empty cells. Numbers are as short as possible, yet exact.
fn csv(batch: &Recording, columns: &[Column]) -> Vec<u8> {
    use std::fmt::Write;
    let mut text = String::from("time");
    for column in columns {
        text.push(',');
        text.push_str(&column.name);
    }
    text.push('\n');
    for row in 0..batch.n_rows() {
        text.push_str(&seconds(batch.stamp(row).as_nanos()));
        for column in columns {
            text.push(',');
            let value = column.values.get(row).copied().unwrap_or(f64::NAN);
            if value.is_finite() {
                let _ = write!(text, "{value}");
            }
        }
        text.push('\n');
    }
    text.into_bytes()
}

/// Nanoseconds as exact decimal seconds.
fn seconds(nanos: i64) -> String {
    let (sign, nanos) = (if nanos < 0 { "-" } else { "" }, nanos.unsigned_abs());
    let text = format!("{sign}{}.{:09}", nanos / 1_000_000_000, nanos % 1_000_000_000);
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

#[cfg(test)]
#[path = "crash_tests.rs"]
mod crash_tests;
#[cfg(test)]
#[path = "writer_tests.rs"]
mod tests;
