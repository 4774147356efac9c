//! Runs a method on each resample.

use std::sync::{
    Mutex, PoisonError,
    atomic::{AtomicUsize, Ordering},
};

use super::draws;
use crate::{
    analysis::{Found, MethodResult},
    methods::Method,
    settings::{Resampling, Settings},
    types::{CondIndTest, Control, DataFrame, Result, Stop, lock},
};

/// The data at the times of resample `b`, drawn from time `first` on, for methods that are run by hand.
///
/// A run with `tau_max` uses the times from `2 tau_max` on.
///
/// ```
/// use roscausal_discovery::{DataFrame, confidence::{Resampling, data_of_resample}};
///
/// let data = DataFrame::new(vec![ndarray::Array2::zeros((100, 2))], vec!["a".into(), "b".into()])?;
/// let first = data_of_resample(&data, &Resampling::default(), 42, 0, 2)?;
/// assert_eq!(first.var_names(), data.var_names());
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
///
/// # Errors
/// Data that are too few to draw from.
pub fn data_of_resample(
    data: &DataFrame,
    resampling: &Resampling,
    seed: u64,
    b: usize,
    first: usize,
) -> Result<DataFrame> {
    draws::check(resampling, &rows_from(data, first))?;
    drawn(data, resampling, seed, b, first)
}

/// Number of times from `first` on, by recording.
fn rows_from(data: &DataFrame, first: usize) -> Vec<usize> {
    data.recordings().iter().map(|rows| rows.nrows().saturating_sub(first)).collect()
}

fn drawn(data: &DataFrame, resampling: &Resampling, seed: u64, b: usize, first: usize) -> Result<DataFrame> {
    let of = |(k, n)| draws::rows(resampling, seed, b, k, n).into_iter().map(|row| row + first).collect();
    let times = rows_from(data, first).into_iter().enumerate().map(of).collect();
    Ok(data.at_times(times)?.drawn(b as u64 + 1))
}

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
        let n_rows = rows_from(data, first);
        draws::check(resampling, &n_rows)?;
        Ok(Self { data, settings, resampling, test: settings.test()?, first, n_rows })
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
        let data = drawn(self.data, self.resampling, self.settings.seed, b, self.first)?;
        match MethodResult::of(&data, self.test.as_ref(), self.settings, &control.silent()) {
            Ok(outcome) if outcome.is_complete() => {
                Ok(Some(outcome.found(data.n_vars(), self.settings.tau_max)))
            }
            Ok(_) => Ok(None),
            Err(_) if control.stop() == Some(Stop::OutOfTime) => Ok(None),
            Err(error) => Err(error),
        }
    }
}
