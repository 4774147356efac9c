//! What polls a node that runs as a task of whoever drives the bus.

use std::{
    any::Any,
    panic::{AssertUnwindSafe, catch_unwind},
    pin::Pin,
    sync::Mutex,
    task::{Context, Waker},
};

use crate::gate::lock;

/// A node's future; `None` once the node has ended.
#[derive(Default)]
pub(super) struct Task {
    pub(super) future: Mutex<Option<Pin<Box<dyn Future<Output = ()> + Send>>>>,
    /// The panic that ended it.
    pub(super) panic: Mutex<Option<Box<dyn Any + Send>>>,
}

impl Task {
    /// Runs the node until it waits for something later, or has ended.
    pub(super) fn poll(&self) {
        let mut slot = lock(&self.future);
        let Some(future) = slot.as_mut() else { return };
        // The driver asks each time, so no wake-up is needed.
        let mut context = Context::from_waker(Waker::noop());
        match catch_unwind(AssertUnwindSafe(|| future.as_mut().poll(&mut context).is_ready())) {
            Ok(false) => return,
            Ok(true) => {}
            Err(panic) => *lock(&self.panic) = Some(panic),
        }
        *slot = None;
    }
}
