//! What a process left that was ended by force: batches between two steps, and journals of batches that were never written.

use std::{fs, path::Path};

use super::{
    Processing, WriterConfig,
    job::{COMMIT, DONE, Job, Origin, Step, marker},
};
use crate::{
    Error, Result,
    batch::{
        Recording, journal,
        pool::{Pool, remove},
    },
};

/// Continues where a process that is gone stopped: completes what was being written, and makes batches from
/// journals. Returns what remains to be done.
pub(super) fn recover(config: &WriterConfig) -> Result<Vec<Job>> {
    let mut jobs = Vec::new();
    jobs.extend(config.raw.hidden(DONE)?.into_iter().map(|name| Job::left_at(name, Step::Processed)));
    for name in config.raw.hidden(COMMIT)? {
        let path = config.raw.path(&marker(&name, COMMIT));
        if let Some(staged) = config.raw.staged(&name) {
            staged.publish()?;
        }
        let mut job = Job::left_at(name, Step::Staged);
        if !matches!(config.processing, Processing::None)
            && let Some(batch) = replayed(&config.raw, &path)?.into_iter().next()
        {
            job.batch = batch;
        }
        jobs.push(job);
    }
    // A staged file that belongs to none of these was incomplete.
    for pool in [&config.raw, &config.processed] {
        for name in pool.hidden(".tmp")? {
            if !jobs.iter().any(|job| job.name == name) {
                remove(&pool.path(&format!(".{name}.tmp")))?;
            }
        }
    }
    let journals = config.raw.hidden(".journal")?;
    for (i, name) in journals.iter().enumerate() {
        let path = config.raw.path(&format!(".{name}.journal"));
        let mut batches = replayed(&config.raw, &path)?.into_iter();
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
fn replayed(raw: &Pool, path: &Path) -> Result<Vec<Recording>> {
    let bytes = fs::read(path).map_err(|e| Error::file(path, e))?;
    match journal::replay(&bytes) {
        Ok(batches) => Ok(batches),
        // Killed before the journal had any content.
        Err(_) if bytes.len() < 4096 => remove(path).map(|()| Vec::new()),
        Err(reason) => {
            let folder = raw.path("rejected");
            fs::create_dir_all(&folder).map_err(|e| Error::file(&folder, e))?;
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let to = folder.join(name.trim_start_matches('.'));
            fs::rename(path, &to).map_err(|e| Error::file(path, e))?;
            tracing::error!("{} is not a journal ({reason}); moved to {}", path.display(), to.display());
            Ok(Vec::new())
        }
    }
}
