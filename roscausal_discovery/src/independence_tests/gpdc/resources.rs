//! What the threads of an analysis share: a bound on the memory that they take for large matrices at the same time, and cores.

use std::sync::{Arc, Condvar, Mutex, PoisonError};

use super::cores::{Cores, ONE, Work};
use crate::types::lock;

/// Samples above which matrices are large: then they are counted, and that of the start is not kept.
pub(super) const LARGE: usize = 2000;

/// Memory for large matrices, where who would exceed the limit waits until others have finished; and idle cores.
#[derive(Debug)]
pub(super) struct Resources {
    limit: usize,
    used: Mutex<usize>,
    freed: Condvar,
    cores: Cores,
}

/// Memory in use; given back on drop.
#[derive(Debug)]
pub(super) struct Held {
    of: Arc<Resources>,
    bytes: usize,
}

impl Resources {
    /// Memory of `limit` bytes, and the cores of this thread's pool.
    pub(super) fn new(limit: usize) -> Arc<Self> {
        Arc::new(Self { limit, used: Mutex::new(0), freed: Condvar::new(), cores: Cores::of_pool() })
    }

    /// This thread works on a core of its own until what is given is dropped.
    pub(super) fn work(&self) -> Work<'_> {
        self.cores.work()
    }

    /// Cores for a matrix of `n` samples. One that holds memory is not shared: who waits for a half may be given a test that waits
    /// for that memory.
    pub(super) fn cores(&self, n: usize) -> &Cores {
        if n > LARGE { &ONE } else { &self.cores }
    }

    /// Takes `bytes`, or waits for them. One who asks for more than the limit gets it when nobody else holds any, so
    /// nobody waits for ever as long as nobody asks twice.
    pub(super) fn hold(self: &Arc<Self>, bytes: usize) -> Held {
        let mut used = lock(&self.used);
        while *used > 0 && *used + bytes > self.limit {
            used = self.freed.wait(used).unwrap_or_else(PoisonError::into_inner);
        }
        *used += bytes;
        Held { of: self.clone(), bytes }
    }
}

impl Drop for Held {
    fn drop(&mut self) {
        *lock(&self.of.used) -= self.bytes;
        self.of.freed.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

    #[test]
    fn the_limit_holds_among_threads() {
        let memory = Resources::new(100);
        let (now, most) = (AtomicUsize::new(0), AtomicUsize::new(0));
        std::thread::scope(|scope| {
            for bytes in [40, 50, 60, 70, 30, 20, 90, 10] {
                let (memory, now, most) = (&memory, &now, &most);
                scope.spawn(move || {
                    for _ in 0..50 {
                        let held = memory.hold(bytes);
                        most.fetch_max(now.fetch_add(bytes, Ordering::SeqCst) + bytes, Ordering::SeqCst);
                        std::thread::yield_now();
                        now.fetch_sub(bytes, Ordering::SeqCst);
                        drop(held);
                    }
                });
            }
        });
        assert!(most.load(Ordering::SeqCst) <= 100);
    }

    #[test]
    fn one_alone_may_exceed_the_limit() {
        drop(Resources::new(10).hold(1000));
    }
}
