//! Residuals of nodes on condition sets, computed once per run.

use std::{
    cell::Cell,
    collections::HashMap,
    sync::{Arc, Mutex, TryLockError},
    thread,
    time::Duration,
};

use super::{
    distance_correlation::ranks,
    regression::{Fit, GaussianProcess, SearchSettings},
    theta::Theta,
};
use crate::{
    numeric::rows::standardized,
    types::{Node, Result, lock},
};

/// What a test needs of one node given a condition set.
#[derive(Debug, Default)]
pub(super) struct Residuals {
    /// Ranks of the residuals; ties take the largest.
    pub(super) ranks: Vec<u32>,
    /// The residuals themselves, where a shuffle test needs their autocorrelation.
    pub(super) values: Vec<f64>,
    /// Log marginal likelihood of the regression; minus infinity without conditions, so that any
    /// regression scores better.
    pub(super) log_likelihood: f64,
    /// The optimum of the regression, if there was one.
    pub(super) theta: Option<Theta>,
    /// Whether its search was repeated with tight likelihoods.
    pub(super) repeated: bool,
    /// Whether the optimum is that of some of the samples.
    pub(super) by_few: bool,
}

/// How long a thread waits before it looks again whether there is work.
const NAP: Duration = Duration::from_micros(50);

thread_local! {
    /// How many residuals this thread is about to compute, one above the other on its stack.
    static COMPUTES: Cell<usize> = const { Cell::new(0) };
}

/// A node and its conditions, sorted.
type Key = (Node, Vec<Node>);
type Slot = Arc<Mutex<Option<Arc<Residuals>>>>;

/// Residuals by node and condition set, for the samples that every test of a run shares.
#[derive(Default)]
pub(super) struct ResidualCache(Mutex<HashMap<Key, Slot>>);

impl ResidualCache {
    /// How many regressions are kept, how many of them were searched twice, and of how many the optimum is that of some of the samples.
    pub(super) fn counts(&self) -> [usize; 3] {
        let slots: Vec<Slot> = lock(&self.0).values().cloned().collect();
        slots.iter().fold([0; 3], |[all, twice, by_few], slot| {
            let slot = lock(slot);
            let regressed = slot.as_ref().filter(|residuals| residuals.theta.is_some());
            regressed.map_or([all, twice, by_few], |of| {
                [all + 1, twice + usize::from(of.repeated), by_few + usize::from(of.by_few)]
            })
        })
    }

    /// The residuals of `node` given `conditions`, computed by `make` if they are not there yet. Who asks while another
    /// thread computes them does other work of the pool, and waits for that one if there is none. But who computes some already, and
    /// was given this test while it waits for half a matrix, computes these too: the other thread could wait for the first ones.
    ///
    /// # Errors
    /// Those of `make`; nothing is kept then.
    pub(super) fn get(
        &self,
        node: Node,
        conditions: &[Node],
        make: impl FnOnce() -> Result<Residuals>,
    ) -> Result<Arc<Residuals>> {
        let slot = {
            let mut slots = lock(&self.0);
            slots.entry((node, conditions.to_vec())).or_default().clone()
        };
        let mut slot = loop {
            match slot.try_lock() {
                Ok(free) => break free,
                Err(TryLockError::WouldBlock) if COMPUTES.get() > 0 => return make().map(Arc::new),
                Err(TryLockError::WouldBlock) if rayon::yield_now() == Some(rayon::Yield::Executed) => {}
                // Asleep it would not be there for half a matrix.
                Err(TryLockError::WouldBlock) if rayon::current_thread_index().is_some() => {
                    thread::sleep(NAP)
                }
                Err(_) => break lock(&slot),
            }
        };
        if let Some(residuals) = &*slot {
            return Ok(residuals.clone());
        }
        COMPUTES.set(COMPUTES.get() + 1);
        let made = make();
        COMPUTES.set(COMPUTES.get() - 1);
        let residuals = Arc::new(made?);
        *slot = Some(residuals.clone());
        Ok(residuals)
    }
}

impl Residuals {
    /// Residuals of `target` by `process`, or of `target` itself without one.
    ///
    /// # Errors
    /// Those of `check`.
    pub(super) fn new(
        target: &[f64],
        process: Option<&GaussianProcess>,
        how: &SearchSettings,
        keep_values: bool,
        check: &dyn Fn() -> Result<()>,
    ) -> Result<Self> {
        let Some(process) = process else {
            let (ranks, values) = (ranks(target), if keep_values { target.to_vec() } else { Vec::new() });
            return Ok(Self { ranks, values, log_likelihood: f64::NEG_INFINITY, ..Self::default() });
        };
        let Fit { theta, log_likelihood, repeated, by_few, mut residuals } =
            process.fit(&standardized(target), how, check)?;
        process.make_equal(target, &mut residuals);
        let ranks = ranks(&residuals);
        let values = if keep_values { residuals } else { Vec::new() };
        Ok(Self { ranks, values, log_likelihood, theta: Some(theta), repeated, by_few })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A thread that waits for half a matrix may be given a test that asks for what it is about to compute.
    #[test]
    fn who_computes_residuals_does_not_wait_for_them() {
        let cache = ResidualCache::default();
        let how = SearchSettings { search: Default::default(), restarts: 0, seed: 1 };
        let make = || Residuals::new(&[1.0, 2.0, 4.0], None, &how, false, &|| Ok(()));
        let node = Node::new(0, 0);
        let outer = cache.get(node, &[], || {
            assert_eq!(cache.get(node, &[], make).unwrap().ranks, make()?.ranks);
            make()
        });
        assert_eq!(outer.unwrap().ranks, cache.get(node, &[], || unreachable!()).unwrap().ranks);
    }
}
