//! Writes recorded batches to files, on a thread of its own, so that recording never waits for a disk or a script.

mod files;
mod job;
mod recovery;
mod work;

use std::{
    fs::File,
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, Ordering},
        mpsc::{SyncSender, TrySendError, sync_channel},
    },
    thread::{self, JoinHandle},
};

use serde_json::{Map, Value as Json};

use self::{
    job::{Job, Origin},
    recovery::recover,
    work::Work,
};
use super::{
    Recording,
    journal::{self, Journal, JournalStatus},
    pool::{Limits, Pool},
    postprocess::Postprocess,
    script::Script,
};
use crate::{Error, Result, gate::lock};

/// Most batches that wait to be written.
const WAITING: usize = 64;

/// What happens to a raw batch.
#[derive(Clone, Debug)]
pub enum Processing {
    /// It is the result.
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
    waits: bool,
    _lock: File,
    thread: Option<JoinHandle<()>>,
    ending: Arc<AtomicBool>,
    status: Arc<Mutex<WriterStatus>>,
}

impl Writer {
    /// Starts the thread.
    ///
    /// # Errors
    /// A folder that another node records into, or that cannot be read; a system that gives no thread.
    pub fn start(config: WriterConfig) -> Result<Self> {
        let lock = config.raw.lock_for_recording()?;
        let left = recover(&config)?;
        let number = |name: String| {
            name.rsplit(|c: char| !c.is_ascii_digit()).next().and_then(|n| n.parse::<u64>().ok())
        };
        let newest = config.raw.hidden(".journal")?.into_iter().filter_map(number).max().unwrap_or(0);
        let journal = config.journal.then(|| Journal::start(config.raw.clone())).transpose()?.map(Arc::new);
        let (sender, receiver) = sync_channel(WAITING);
        let (ending, status): (Arc<AtomicBool>, Arc<Mutex<WriterStatus>>) = Default::default();
        let work = Work { config, journal: journal.clone(), ending: ending.clone(), status: status.clone() };
        let thread = thread::Builder::new()
            .name("batch-writer".into())
            .spawn(move || work.run(left, &receiver))
            .map_err(|e| Error::Data(format!("no thread to write batches: {e}")))?;
        let (batches, thread, first_journal) = (Some(sender), Some(thread), newest + 1);
        Ok(Self { batches, journal, first_journal, waits: false, _lock: lock, thread, ending, status })
    }

    /// Whether [`Self::write`] waits for room instead of losing a batch: where time waits, too.
    #[must_use]
    pub fn that_waits(mut self, waits: bool) -> Self {
        self.waits = waits;
        self
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

    /// Hands over a batch, with the number of its journal if it has one; returns at once, unless it [waits](Self::that_waits).
    pub fn write(&self, batch: Recording, journal: Option<u64>) {
        let Some(batches) = &self.batches else { return };
        let job = Job::new(batch, journal.map_or(Origin::None, Origin::Open));
        let sent = match self.waits {
            true => batches.send(job).map_err(|unsent| unsent.0),
            false => batches
                .try_send(job)
                .map_err(|(TrySendError::Full(job) | TrySendError::Disconnected(job))| job),
        };
        if let Err(job) = sent {
            lock(&self.status).lost += 1;
            let rows = job.batch.n_rows();
            tracing::error!("lost a batch of {rows} rows: {WAITING} others wait to be written");
        }
    }

    /// State of the writer so far.
    pub fn status(&self) -> WriterStatus {
        lock(&self.status).clone()
    }

    /// Whether the pool is full, so that recording has to stop.
    pub fn is_full(&self) -> bool {
        lock(&self.status).full
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

#[cfg(test)]
mod crash_tests;
#[cfg(test)]
mod tests;
