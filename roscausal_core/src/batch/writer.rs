//! Recorded batches to files, on a thread of its own, so that recording never waits for a disk or a script.

use std::{
    fs,
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
    pool::{Pool, sidecar},
    postprocess::Postprocess,
    recording::{Column, Recording},
    script::Script,
};
use crate::{Error, Result};

/// Batches that may wait to be written.
const WAITING: usize = 64;
/// Before a batch that could not be written is tried again.
const TRY_AGAIN: Duration = Duration::from_secs(1);
/// How often the wish to end is looked for meanwhile.
const LOOK_AGAIN: Duration = Duration::from_millis(50);
/// Version of the metadata beside a batch.
const SCHEMA: &str = "roscausal-batch/1";

/// What happens to a raw batch.
#[derive(Clone, Debug)]
pub enum Processing {
    /// It is the result.
    None,
    /// The built-in post-processing.
    BuiltIn(Postprocess),
    /// A program of the user's own.
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
    /// The raw batch goes once the post-processed one is written.
    pub delete_raw: bool,
    /// What happens to a raw batch.
    pub processing: Processing,
    /// Parameters to note beside each batch.
    pub parameters: Map<String, Json>,
}

/// What the writer has done.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct WriterStatus {
    /// Batches written.
    pub written: u64,
    /// Batches post-processed.
    pub processed: u64,
    /// Post-processings that failed; the raw batch stays.
    pub failed: u64,
    /// Batches lost because the disk took none of them for too long.
    pub lost: u64,
    /// Why the last step did not go through, until one does.
    pub trouble: Option<String>,
    /// Name of the last batch written.
    pub last: Option<String>,
}

/// The thread that writes; dropping it waits until all batches are written.
#[derive(Debug)]
pub struct Writer {
    batches: Option<SyncSender<Recording>>,
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

    /// Writes a batch and post-processes it. The name it got.
    fn write(
        &self,
        batch: &Recording,
        status: &Mutex<WriterStatus>,
        name: &mut Option<String>,
    ) -> Result<()> {
        if name.is_none() {
            let stamp =
                DateTime::from_timestamp(i64::from(batch.start.sec), batch.start.nanosec).unwrap_or_default();
            let id = stamp.format(&self.id_format).to_string();
            let new = free_name(&self.raw, &self.processed, &id);
            // The metadata first: whoever sees the batch finds them.
            let raw = batch.columns(self.legacy_columns);
            self.raw.write(&sidecar(&new), &self.metadata(batch, &raw, None))?;
            self.raw.write(&new, &csv(batch, &raw))?;
            tracing::info!("wrote {} ({} rows)", self.raw.path(&new).display(), batch.n_rows());
            let mut status = lock(status);
            status.written += 1;
            status.last = Some(new.clone());
            *name = Some(new);
        }
        let Some(name) = name else { return Ok(()) };
        let done = match &self.processing {
            Processing::None => return Ok(()),
            Processing::BuiltIn(postprocess) => postprocess.run(batch).and_then(|features| {
                let columns = features.columns;
                self.processed.write(&sidecar(name), &self.metadata(batch, &columns, Some(name)))?;
                self.processed.write(name, &csv(batch, &columns)).map(drop)
            }),
            Processing::Script(script) => self
                .processed
                .write(&sidecar(name), &self.metadata(batch, &[], Some(name)))
                .and_then(|_| script.run(name, self.raw.dir(), self.processed.dir())),
        };
        match done {
            Ok(()) => lock(status).processed += 1,
            Err(error @ Error::File { .. }) if matches!(self.processing, Processing::BuiltIn(_)) => {
                return Err(error);
            }
            Err(error) => {
                let _ = fs::remove_file(self.processed.path(&sidecar(name)));
                tracing::error!(
                    "{name} is not post-processed and stays in {}: {error}",
                    self.raw.dir().display()
                );
                let mut status = lock(status);
                status.failed += 1;
                status.trouble = Some(error.to_string());
                return Ok(());
            }
        }
        if self.delete_raw {
            for file in [name.clone(), sidecar(name)] {
                let path = self.raw.path(&file);
                match fs::remove_file(&path) {
                    Err(e) if e.kind() != std::io::ErrorKind::NotFound => return Err(Error::file(&path, e)),
                    _ => {}
                }
            }
        }
        lock(status).trouble = None;
        Ok(())
    }

    /// The JSON beside a batch.
    fn metadata(&self, batch: &Recording, columns: &[Column], source: Option<&str>) -> Vec<u8> {
        let seconds = |row: usize| batch.stamp(row).as_secs_f64();
        let gap = |gap: super::Gap| json!({ "body": gap.body, "from": gap.from, "to": gap.to });
        let imposed = |one: super::Imposed| json!({ "column": one.column, "value": one.value, "from": one.from, "to": one.to });
        let unit = |column: &Column| json!({ "name": column.name, "unit": column.unit });
        let mut facts = json!({
            "schema": SCHEMA,
            "software_version": env!("CARGO_PKG_VERSION"),
            "complete": batch.complete,
            "ended_by": batch.ended_by,
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
        let (sender, receiver) = sync_channel(WAITING);
        let (ending, status) =
            (Arc::new(AtomicBool::new(false)), Arc::new(Mutex::new(WriterStatus::default())));
        let (end, told) = (ending.clone(), status.clone());
        let thread = thread::Builder::new()
            .name("batch-writer".into())
            .spawn(move || work(&config, &receiver, &end, &told))
            .map_err(|e| Error::Data(format!("no thread to write batches: {e}")))?;
        Ok(Self { batches: Some(sender), thread: Some(thread), ending, status })
    }

    /// Hands a batch over; returns at once.
    pub fn write(&self, batch: Recording) {
        let Some(batches) = &self.batches else { return };
        if let Err(TrySendError::Full(batch) | TrySendError::Disconnected(batch)) = batches.try_send(batch) {
            let mut status = self.lock();
            status.lost += 1;
            tracing::error!("lost a batch of {} rows: {WAITING} others wait to be written", batch.n_rows());
        }
    }

    /// What has been done so far.
    pub fn status(&self) -> WriterStatus {
        self.lock().clone()
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

/// Writes all that comes, in order; a batch that cannot be written is tried again until the end.
fn work(
    config: &WriterConfig,
    batches: &Receiver<Recording>,
    ending: &AtomicBool,
    status: &Mutex<WriterStatus>,
) {
    while let Ok(batch) = batches.recv() {
        let mut name = None;
        loop {
            let last_try = ending.load(Ordering::Relaxed);
            let Err(error) = config.write(&batch, status, &mut name) else { break };
            tracing::error!("{error}");
            lock(status).trouble = Some(error.to_string());
            if last_try {
                lock(status).lost += u64::from(name.is_none());
                break;
            }
            let looks = TRY_AGAIN.as_millis() / LOOK_AGAIN.as_millis();
            (0..looks)
                .take_while(|_| !ending.load(Ordering::Relaxed))
                .for_each(|_| thread::sleep(LOOK_AGAIN));
        }
    }
}

fn lock(status: &Mutex<WriterStatus>) -> MutexGuard<'_, WriterStatus> {
    status.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A name that neither folder has.
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

/// `time` and the columns; missing values are empty cells, numbers are as short as they can be and still exact.
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

/// Nanoseconds as decimal seconds, exactly.
fn seconds(nanos: i64) -> String {
    let (sign, nanos) = (if nanos < 0 { "-" } else { "" }, nanos.unsigned_abs());
    let text = format!("{sign}{}.{:09}", nanos / 1_000_000_000, nanos % 1_000_000_000);
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

#[cfg(test)]
#[path = "writer_tests.rs"]
mod tests;
