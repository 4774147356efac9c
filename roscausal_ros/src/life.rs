//! Whether a node goes on, and who waits meanwhile.

use std::sync::{
    Arc, Mutex, Weak,
    atomic::{AtomicBool, Ordering},
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
