//! Whether a node goes on, who waits meanwhile, and for how long.

use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{
        Arc, Mutex, Weak,
        atomic::{AtomicBool, Ordering},
        mpsc,
    },
    thread,
    time::Duration,
};

use roscausal_core::inbox::Consumer;

use crate::lock;

/// A node's life, from its start until it is asked to end.
#[derive(Default)]
pub struct Life {
    ended: AtomicBool,
    consumers: Mutex<Vec<Weak<dyn Consumer>>>,
}

impl Life {
    /// False once the node is to end.
    pub fn goes_on(&self) -> bool {
        !self.ended.load(Ordering::SeqCst)
    }

    /// Asks the node to end.
    pub fn end(&self) {
        self.ended.store(true, Ordering::SeqCst);
        self.wake();
    }

    /// Names one to be woken when the clock moves or the node is to end.
    pub fn attach(&self, consumer: &Arc<dyn Consumer>) {
        let mut consumers = lock(&self.consumers);
        consumers.retain(|consumer| consumer.strong_count() > 0);
        consumers.push(Arc::downgrade(consumer));
    }

    /// Makes all that wait look at the clock again.
    pub fn wake(&self) {
        let consumers: Vec<_> = lock(&self.consumers).iter().filter_map(Weak::upgrade).collect();
        consumers.iter().for_each(|consumer| consumer.wake());
    }
}

/// Runs what may block for ever (ROS 1's library asks masters and nodes without deadline, ROS 2's may lock itself up)
/// beside this thread. `None` when it is not done in time; its result is then dropped whenever it comes.
pub fn in_time<T: Send + 'static>(
    patience: Duration,
    work: impl FnOnce() -> T + Send + 'static,
) -> Option<T> {
    let (sender, receiver) = mpsc::channel();
    let work = move || {
        // a panic within drops the sender, which reads as "not done"
        let _ = catch_unwind(AssertUnwindSafe(|| sender.send(work())));
    };
    thread::Builder::new().name("in time".to_owned()).spawn(work).ok()?;
    receiver.recv_timeout(patience).ok()
}
