//! Cores that have nothing to do: who works on a large matrix gives one of them half of it.
//!
//! The half goes to the pool, where an idle thread takes it. Only while a core is idle: who waits for a half may be given other work of
//! the pool meanwhile, and that could take longer than the half.

use std::sync::atomic::{AtomicUsize, Ordering};

/// As many cores as there are threads in the pool of the analysis.
#[derive(Debug)]
pub(super) struct Cores {
    all: usize,
    busy: AtomicUsize,
}

/// A core at work, until it is dropped.
#[derive(Debug)]
pub(super) struct Work<'a>(&'a AtomicUsize);

impl Drop for Work<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

/// One core, so that nothing is shared.
pub(super) static ONE: Cores = Cores::new(1);

impl Cores {
    /// Those of the pool that this thread belongs to; one, if to none.
    pub(super) fn of_pool() -> Self {
        Self::new(rayon::current_thread_index().map_or(1, |_| rayon::current_num_threads()))
    }

    const fn new(all: usize) -> Self {
        Self { all, busy: AtomicUsize::new(0) }
    }

    /// This thread works on a core of its own.
    pub(super) fn work(&self) -> Work<'_> {
        self.busy.fetch_add(1, Ordering::Relaxed);
        Work(&self.busy)
    }

    fn idle(&self) -> Option<Work<'_>> {
        // This thread works too, whether it said so or not.
        let one_more = |busy: usize| (busy.max(1) < self.all).then_some(busy + 1);
        self.busy.fetch_update(Ordering::Relaxed, Ordering::Relaxed, one_more).ok()?;
        Some(Work(&self.busy))
    }

    /// Does both, at the same time if a core is idle. What they do must not depend on that.
    pub(super) fn both(&self, one: impl FnOnce() + Send, other: impl FnOnce() + Send) {
        if let Some(_work) = self.idle() {
            rayon::join(one, other);
        } else {
            one();
            other();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_core_is_idle_only_while_fewer_work_than_there_are() {
        let cores = Cores::new(2);
        let first = cores.work();
        let second = cores.idle();
        assert!(second.is_some() && cores.idle().is_none());
        drop(second);
        assert!(cores.idle().is_some());
        drop(first);
        assert_eq!(cores.busy.into_inner(), 0);
    }

    #[test]
    fn outside_of_a_pool_there_is_one_core() {
        assert!(Cores::of_pool().idle().is_none());
        let (mut one, mut other) = (0, 0);
        ONE.both(|| one = 1, || other = 2);
        assert_eq!((one, other), (1, 2));
    }
}
