//! A gate in front of a subscription's callback, so that any thread can end the subscription for good.

use std::{
    sync::{
        Condvar, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, ThreadId},
    time::Duration,
};

#[doc(hidden)]
pub use roscausal_discovery::lock;

/// Lets through one call at a time, until it is closed.
#[derive(Debug, Default)]
pub struct Gate {
    closed: AtomicBool,
    /// Held during a call.
    running: Mutex<()>,
    /// The thread that is inside a call.
    runs_on: Mutex<Option<ThreadId>>,
}

/// Marks the gate as free when a call returns or panics.
struct Running<'a>(&'a Gate, #[allow(dead_code, reason = "held")] MutexGuard<'a, ()>);

impl Drop for Running<'_> {
    fn drop(&mut self) {
        *lock(&self.0.runs_on) = None;
    }
}

/// Waits until it is notified, `at_most` so long; what a panic left behind is taken as it is.
pub(crate) fn wait<'a, T>(
    changed: &Condvar,
    locked: MutexGuard<'a, T>,
    at_most: Duration,
) -> MutexGuard<'a, T> {
    changed.wait_timeout(locked, at_most).unwrap_or_else(PoisonError::into_inner).0
}

impl Gate {
    /// Makes the call after any current one has ended, unless the gate is closed. A call from inside a call is not
    /// made.
    pub fn pass(&self, call: impl FnOnce()) {
        if self.is_mine() {
            return;
        }
        let running = lock(&self.running);
        *lock(&self.runs_on) = Some(thread::current().id());
        let _running = Running(self, running);
        if self.is_open() {
            call();
        }
    }

    /// Whether the gate is open.
    pub fn is_open(&self) -> bool {
        !self.closed.load(Ordering::SeqCst)
    }

    /// Closes the gate and waits for the current call, unless that call is the one that closes. No call is made
    /// afterwards.
    pub fn close(&self) {
        self.closed.store(true, Ordering::SeqCst);
        if !self.is_mine() {
            drop(lock(&self.running));
        }
    }

    fn is_mine(&self) -> bool {
        *lock(&self.runs_on) == Some(thread::current().id())
    }
}

#[cfg(test)]
mod tests {
    use std::{
        panic::{AssertUnwindSafe, catch_unwind},
        sync::{Arc, mpsc::channel},
    };

    use super::*;

    #[test]
    fn closing_waits_for_the_call_under_way() {
        let gate = Arc::new(Gate::default());
        let (began, begins) = channel();
        let (own, done) = (gate.clone(), Arc::new(AtomicBool::new(false)));
        let its_done = done.clone();
        let caller = thread::spawn(move || {
            own.pass(|| {
                began.send(()).unwrap();
                thread::sleep(Duration::from_millis(50));
                its_done.store(true, Ordering::SeqCst);
            });
        });
        begins.recv().unwrap();
        gate.close();
        assert!(done.load(Ordering::SeqCst));
        gate.pass(|| panic!("it is closed"));
        caller.join().unwrap();
    }

    #[test]
    fn a_call_may_close_its_own_gate_and_a_panic_leaves_it_open() {
        let gate = Gate::default();
        assert!(catch_unwind(AssertUnwindSafe(|| gate.pass(|| panic!("on purpose")))).is_err());
        let mut calls = 0;
        gate.pass(|| {
            gate.pass(|| panic!("from within a call"));
            gate.close();
            calls += 1;
        });
        assert!(calls == 1 && !gate.is_open());
    }
}
