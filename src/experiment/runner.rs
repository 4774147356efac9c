//! What every experiment does: it works off its seeds on several threads, and writes what it found into a folder.

use std::{
    path::{Path, PathBuf},
    sync::{
        Mutex,
        atomic::{AtomicUsize, Ordering},
    },
    thread,
};

use clap::Args as ClapArgs;
use roscausal_core::{Error, Result, gate::lock};
use roscausal_discovery::Model;

use super::grid;
use crate::{chart, interrupt::Interrupt, output, results::Results, terminal::print_text};

/// Arguments of every experiment.
#[derive(ClapArgs)]
pub(super) struct Runner {
    /// Seeds of the runs, including both ends.
    #[arg(long, default_value = "1..20", value_name = "A..B")]
    pub(super) seeds: String,
    /// Runs at a time; default: one per core. They do not change the results.
    #[arg(long)]
    threads: Option<usize>,
    /// Folder for the results.
    #[arg(short, long, value_name = "DIR", default_value = "roscausal_experiment")]
    pub(super) out: PathBuf,
}

impl Runner {
    pub(super) fn seeds(&self) -> Result<Vec<u64>> {
        grid::seeds(&self.seeds)
    }

    /// How many runs at a time.
    pub(super) fn workers(&self) -> Result<usize> {
        match self.threads {
            Some(0) => Err(Error::param("threads", "0 does nothing; give 1 or more")),
            Some(threads) => Ok(threads.min(1024)),
            None => Ok(thread::available_parallelism().map_or(1, usize::from)),
        }
    }

    /// Takes the folder of an experiment that writes nothing before its end.
    pub(super) fn begin(&self, interrupt: &Interrupt) -> Result<Results> {
        interrupt.nothing_at_stake("nothing is written before the end");
        self.workers()?;
        Results::begin(&self.out, None, &[])
    }

    /// Does the work for each seed, several at a time; results in the order of the seeds.
    pub(super) fn each<T: Send>(
        &self,
        seeds: &[u64],
        what: &str,
        work: impl Fn(u64) -> Result<T> + Sync,
    ) -> Result<Vec<T>> {
        let bar = chart::bar(what, seeds.len() as u64, false);
        let done = Mutex::new(Vec::new());
        self.work_off(seeds, |seed| {
            let result = work(*seed)?;
            lock(&done).push((*seed, result));
            bar.inc(1);
            Ok(())
        })?;
        bar.finish_and_clear();
        let mut done = std::mem::take(&mut *lock(&done));
        done.sort_by_key(|(seed, _)| *seed);
        Ok(done.into_iter().map(|(_, result)| result).collect())
    }

    /// Passes the jobs in order to the threads. The first error ends all.
    pub(super) fn work_off<J: Sync>(&self, jobs: &[J], work: impl Fn(&J) -> Result<()> + Sync) -> Result<()> {
        let workers = self.workers()?;
        let next = AtomicUsize::new(0);
        let first_error = Mutex::new(None);
        thread::scope(|scope| {
            for _ in 0..workers.min(jobs.len()) {
                scope.spawn(|| {
                    while let Some(job) = jobs.get(next.fetch_add(1, Ordering::Relaxed)) {
                        if let Err(error) = work(job) {
                            next.store(jobs.len(), Ordering::Relaxed);
                            lock(&first_error).get_or_insert(error);
                        }
                    }
                });
            }
        });
        match lock(&first_error).take() {
            Some(Error::Cancelled(_)) => {
                Err(Error::Cancelled("by the user; the same command goes on where this one ended".into()))
            }
            Some(error) => Err(error),
            None => Ok(()),
        }
    }
}

/// Ends an experiment: writes its files and its `model`, prints what it found, and says where the files are.
pub(super) fn end(
    out: &Path,
    results: Results,
    model: Option<&Model>,
    files: &[(&str, String)],
    text: &str,
) -> Result<()> {
    results.write(|dir| {
        model.map(|model| output::write_model(dir, model)).transpose()?;
        files.iter().try_for_each(|(name, text)| output::write_file(dir, name, text.as_bytes()))
    })?;
    print_text(text);
    let names: Vec<&str> =
        model.map(|_| "model.json").into_iter().chain(files.iter().map(|(name, _)| *name)).collect();
    say!("{}: {}", out.display(), names.join(", "));
    Ok(())
}
