//! A node's life: whether it continues, who waits for it, and calls with a deadline.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, Weak, mpsc};
use std::{thread, time::Duration};

use roscausal_core::inbox::Consumer;

use crate::lock;

/// A node's life, from its start until it is asked to end.
#[derive(Default)]
pub struct Life {
    ended: AtomicBool,
    consumers: Mutex<Vec<Weak<dyn Consumer>>>,
}

impl Life {
    /// False once the node has to end.
    pub fn goes_on(&self) -> bool {
        !self.ended.load(Ordering::SeqCst)
    }

    /// Asks the node to end.
    pub fn end(&self) {
        self.ended.store(true, Ordering::SeqCst);
        self.wake();
    }

    /// Registers a consumer to wake when the clock moves or the node has to end.
    pub fn attach(&self, consumer: &Arc<dyn Consumer>) {
        let mut consumers = lock(&self.consumers);
        consumers.retain(|consumer| consumer.strong_count() > 0);
        consumers.push(Arc::downgrade(consumer));
    }

    /// Makes everything that waits check the clock again.
    pub fn wake(&self) {
        let consumers: Vec<_> = lock(&self.consumers).iter().filter_map(Weak::upgrade).collect();
        consumers.iter().for_each(|consumer| consumer.wake());
    }
}

/// Runs work that may block for ever on another thread. (ROS 1's library calls masters and nodes without a
/// deadline; ROS 2's may deadlock.) Returns `None` if the work is not done in time; its result is then dropped
/// whenever it arrives.
pub fn in_time<T: Send + 'static>(
    patience: Duration,
    work: impl FnOnce() -> T + Send + 'static,
) -> Option<T> {
    let (sender, receiver) = mpsc::channel();
    let work = move || {
        // a panic inside drops the sender, which the receiver reads as "not done"
        let _ = catch_unwind(AssertUnwindSafe(|| sender.send(work())));
    };
    thread::Builder::new().name("in time".to_owned()).spawn(work).ok()?;
    receiver.recv_timeout(patience).ok()
}
