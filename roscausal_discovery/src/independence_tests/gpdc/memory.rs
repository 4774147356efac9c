//! A bound on the memory that threads take for large matrices at the same time.

use std::sync::{Arc, Condvar, Mutex, PoisonError};

use crate::ground::lock;

/// Samples above which matrices are large: then they are counted, and that of the start is not kept.
pub(super) const LARGE: usize = 2000;

/// Memory for large matrices; who would exceed the limit waits until others have finished.
#[derive(Debug)]
pub(super) struct Memory {
    limit: usize,
    used: Mutex<usize>,
    freed: Condvar,
}

/// Memory in use; given back on drop.
#[derive(Debug)]
pub(super) struct Held {
    memory: Arc<Memory>,
    bytes: usize,
}

impl Memory {
    /// Memory of `limit` bytes.
    pub(super) fn new(limit: usize) -> Arc<Self> {
        Arc::new(Self { limit, used: Mutex::new(0), freed: Condvar::new() })
    }

    /// Takes `bytes`, or waits for them. One who asks for more than the limit gets it when nobody else holds any, so
    /// nobody waits for ever as long as nobody asks twice.
    pub(super) fn hold(self: &Arc<Self>, bytes: usize) -> Held {
        let mut used = lock(&self.used);
        while *used > 0 && *used + bytes > self.limit {
            used = self.freed.wait(used).unwrap_or_else(PoisonError::into_inner);
        }
        *used += bytes;
        Held { memory: self.clone(), bytes }
    }
}

impl Drop for Held {
    fn drop(&mut self) {
        *lock(&self.memory.used) -= self.bytes;
        self.memory.freed.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

    #[test]
    fn the_limit_holds_among_threads() {
        let memory = Memory::new(100);
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
        drop(Memory::new(10).hold(1000));
    }
}
