//! Runs a method on each resample.

use std::sync::{
    Mutex, PoisonError,
    atomic::{AtomicUsize, Ordering},
};

use super::{draws, scheme::Resampling};
use crate::{
    analysis::{Found, Outcome, Settings},
    ground::{CondIndTest, Control, DataFrame, Result, Stop, lock},
    independence_tests,
    methods::Method,
};

/// The resamples of one analysis, not yet run.
pub(super) struct Resamples<'a> {
    data: &'a DataFrame,
    settings: &'a Settings,
    resampling: &'a Resampling,
    test: Box<dyn CondIndTest>,
    /// First time that may be drawn.
    first: usize,
    /// Number of times that may be drawn, by recording.
    n_rows: Vec<usize>,
}

impl<'a> Resamples<'a> {
    pub(super) fn new(
        data: &'a DataFrame,
        settings: &'a Settings,
        resampling: &'a Resampling,
    ) -> Result<Self> {
        // The filter of F-PCMCI sees rows that the tests behind it do not.
        let first = if settings.method == Method::Fpcmci { settings.tau_max } else { 2 * settings.tau_max };
        let n_rows: Vec<usize> = data.recordings().iter().map(|r| r.nrows().saturating_sub(first)).collect();
        draws::check(resampling, &n_rows)?;
        let test = independence_tests::by_name(&settings.cond_ind_test, &settings.test_settings())?;
        Ok(Self { data, settings, resampling, test, first, n_rows })
    }

    pub(super) fn block_lengths(&self) -> Vec<usize> {
        self.n_rows.iter().map(|&n| self.resampling.block.length(n)).collect()
    }

    /// What each resample finds, by its number. If the time budget ends: those before the first that is not done.
    pub(super) fn run(&self, control: &Control) -> Result<Vec<Found>> {
        let next = AtomicUsize::new(0);
        let done = Mutex::new(Vec::new());
        let per_run = control.done().max(1);
        control.expect_tests(per_run * self.resampling.resamples);
        // Each thread takes the next resample; within a resample the tests share what threads are idle.
        rayon::broadcast(|_| {
            loop {
                let b = next.fetch_add(1, Ordering::Relaxed);
                if b >= self.resampling.resamples || control.stop().is_some() {
                    break;
                }
                let found = self.one(b, control);
                let stops = !matches!(found, Ok(Some(_)));
                lock(&done).push((b, found));
                control.count(per_run);
                if stops {
                    next.store(self.resampling.resamples, Ordering::Relaxed);
                }
            }
        });
        if control.stop() == Some(Stop::Cancelled) {
            control.check()?;
        }
        let mut done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
        done.sort_by_key(|(b, _)| *b);
        let mut all = Vec::with_capacity(done.len());
        for (place, (b, found)) in done.into_iter().enumerate() {
            match found? {
                Some(found) if place == b => all.push(found),
                _ => break,
            }
        }
        Ok(all)
    }

    /// Resample `b`; `None` if the time budget ends.
    fn one(&self, b: usize, control: &Control) -> Result<Option<Found>> {
        let seed = self.settings.seed;
        let of = |(k, &n)| {
            let rows = draws::rows(self.resampling, seed, b, k, n);
            rows.into_iter().map(|row| row + self.first).collect()
        };
        let times = self.n_rows.iter().enumerate().map(of).collect();
        let data = self.data.at_times(times)?.drawn(b as u64 + 1);
        match Outcome::of(&data, self.test.as_ref(), self.settings, &control.silent()) {
            Ok(outcome) if outcome.is_complete() => {
                Ok(Some(outcome.found(data.n_vars(), self.settings.tau_max)))
            }
            Ok(_) => Ok(None),
            Err(_) if control.stop() == Some(Stop::OutOfTime) => Ok(None),
            Err(error) => Err(error),
        }
    }
}
