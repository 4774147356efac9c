//! The work of the writer's thread: each batch through its steps, again and again until the disk takes it.

use std::{
    fs,
    path::Path,
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, Ordering},
        mpsc::Receiver,
    },
    thread,
    time::Duration,
};

use super::{
    Processing, WriterConfig, WriterStatus,
    files::{csv, metadata},
    job::{COMMIT, DONE, Job, Origin, Step, marker},
};
use crate::{
    Error, Result,
    batch::{
        Column,
        journal::Journal,
        pool::{Pool, remove, sidecar, sync_dir},
    },
    gate::lock,
};

/// Time before a batch that could not be written is tried again.
const TRY_AGAIN: Duration = Duration::from_secs(1);
/// How often a request to end is checked meanwhile.
pub(super) const LOOK_AGAIN: Duration = Duration::from_millis(50);

/// What the thread has.
pub(super) struct Work {
    pub(super) config: WriterConfig,
    pub(super) journal: Option<Arc<Journal>>,
    pub(super) ending: Arc<AtomicBool>,
    pub(super) status: Arc<Mutex<WriterStatus>>,
}

impl Work {
    /// Writes the batches that were left behind and all new ones, in order. A batch that cannot be written is tried
    /// again until the node ends.
    pub(super) fn run(&self, left: Vec<Job>, batches: &Receiver<Job>) {
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
            let Err(error) = self.write(&mut job) else { break };
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
            (0..TRY_AGAIN.as_millis() / LOOK_AGAIN.as_millis())
                .take_while(|_| !self.ending.load(Ordering::Relaxed))
                .for_each(|_| thread::sleep(LOOK_AGAIN));
        }
        let mut status = lock(&self.status);
        (status.trouble, status.full) = (None, false);
    }

    /// Writes a batch and post-processes it, in step with its journal (see [`Step`]).
    fn write(&self, job: &mut Job) -> Result<()> {
        if job.step == Step::Recorded {
            let name =
                free_name(&self.config.raw, &self.config.processed, &self.config.raw.id(job.batch.start));
            let raw = job.batch.columns(self.config.legacy_columns);
            let (facts, text) = (self.metadata(job, &raw, None), csv(&job.batch, &raw));
            self.make_room(&self.config.raw, facts.len() + text.len())?;
            // The metadata comes first, so whoever sees the batch finds it.
            self.config.raw.write(&sidecar(&name), &facts)?;
            let staged = self.config.raw.stage(&name, &text)?;
            job.name.clone_from(&name);
            let commit = marker(&name, COMMIT);
            job.protected = match (&job.journal, &self.journal) {
                (Origin::Open(number), Some(journal)) => journal.retire(*number, &commit)?,
                (Origin::Left(path), _) => {
                    self.rename(path, &self.config.raw.path(&commit)).map(|()| true)?
                }
                (Origin::None | Origin::Open(_), _) => false,
            };
            job.step = Step::Staged;
            staged.publish()?;
            self.has_written(job);
        }
        if job.step == Step::Staged {
            if let Some(staged) = self.config.raw.staged(&job.name) {
                staged.publish()?;
                self.has_written(job);
            }
            job.step = Step::Written;
        }
        if job.step == Step::Written && !self.postprocess(job)? {
            return self.forget_marker(job, COMMIT);
        }
        if job.step == Step::Processed {
            if let Some(staged) = self.config.processed.staged(&job.name) {
                staged.publish()?;
            }
            if self.config.delete_raw {
                for file in [job.name.clone(), sidecar(&job.name)] {
                    remove(&self.config.raw.path(&file))?;
                }
            }
            self.forget_marker(job, DONE)?;
        }
        Ok(())
    }

    fn has_written(&self, job: &Job) {
        tracing::info!("wrote {} ({} rows)", self.config.raw.path(&job.name).display(), job.batch.n_rows());
        let mut status = lock(&self.status);
        status.written += 1;
        status.last = Some(job.name.clone());
    }

    /// Post-processes a batch. Returns whether there is a result.
    fn postprocess(&self, job: &mut Job) -> Result<bool> {
        let name = &job.name;
        let done = match &self.config.processing {
            Processing::None => return Ok(false),
            Processing::BuiltIn(postprocess) => postprocess.run(&job.batch).map(|features| {
                for (column, count) in &features.emptied {
                    tracing::warn!("{name}: {count} cells of {column} are empty: they held what cannot be");
                }
                (self.metadata(job, &features.columns, Some(name)), csv(&job.batch, &features.columns))
            }),
            Processing::Script(script) => script
                .run(name, self.config.raw.dir(), self.config.processed.dir())
                .map(|bytes| (self.metadata(job, &[], Some(name)), bytes)),
        };
        match done {
            Ok((facts, text)) => {
                self.make_room(&self.config.processed, facts.len() + text.len())?;
                self.config.processed.write(&sidecar(name), &facts)?;
                let staged = self.config.processed.stage(name, &text)?;
                if job.protected {
                    let path = |kind| self.config.raw.path(&marker(name, kind));
                    self.rename(&path(COMMIT), &path(DONE))?;
                }
                job.step = Step::Processed;
                let mut status = lock(&self.status);
                (status.processed, status.last_failure) = (status.processed + 1, None);
                drop(status);
                staged.publish().map(|()| true)
            }
            Err(error) => {
                let dir = self.config.raw.dir().display();
                tracing::error!("{name} is not post-processed and stays in {dir}: {error}");
                let mut status = lock(&self.status);
                status.failed += 1;
                status.last_failure = Some(error.to_string());
                Ok(false)
            }
        }
    }

    fn make_room(&self, pool: &Pool, bytes: usize) -> Result<()> {
        let Some(dropped) = pool.make_room(self.config.limits, bytes as u64)? else {
            lock(&self.status).full = true;
            return Err(Error::file(
                pool.dir(),
                "the pool holds as much as max_pool_size and max_pool_bytes allow and recording has stopped; move batches \
                 away, or set pool_policy to drop_oldest",
            ));
        };
        for name in &dropped {
            tracing::warn!("dropped {}: no room in the pool for a new batch", pool.path(name).display());
        }
        lock(&self.status).dropped += dropped.len() as u64;
        Ok(())
    }

    fn forget_marker(&self, job: &Job, kind: &str) -> Result<()> {
        if job.protected { remove(&self.config.raw.path(&marker(&job.name, kind))) } else { Ok(()) }
    }

    fn rename(&self, from: &Path, to: &Path) -> Result<()> {
        match fs::rename(from, to) {
            // It was renamed before something else failed.
            Err(e) if e.kind() == std::io::ErrorKind::NotFound && to.exists() => {}
            done => done.map_err(|e| Error::file(from, e))?,
        }
        sync_dir(self.config.raw.dir())
    }

    fn metadata(&self, job: &Job, columns: &[Column], source: Option<&str>) -> Vec<u8> {
        metadata(&job.batch, job.recovered, &self.config.parameters, columns, source)
    }
}

/// A name that exists in neither folder.
fn free_name(raw: &Pool, processed: &Pool, id: &str) -> String {
    let ids = std::iter::once(id.to_owned()).chain((2..).map(|count| format!("{id}_{count}")));
    ids.map(|id| raw.new_name(&id)).find(|name| !processed.path(name).exists()).unwrap_or_default()
}
