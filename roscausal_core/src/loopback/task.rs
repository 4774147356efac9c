//! Nodes that run as tasks of whoever drives the bus.

use std::{
    any::Any,
    panic::{AssertUnwindSafe, catch_unwind},
    pin::Pin,
    sync::{Arc, Mutex},
    task::{Context, Waker},
    thread,
};

use super::LoopbackNode;
use crate::{gate::lock, middleware::Middleware};

/// A node's future; `None` once the node has ended.
#[derive(Default)]
pub(super) struct Task {
    future: Mutex<Option<Pin<Box<dyn Future<Output = ()> + Send>>>>,
    /// The panic that ended it.
    panic: Mutex<Option<Box<dyn Any + Send>>>,
}

impl Task {
    /// Runs the node until it waits for something later, or has ended.
    pub(super) fn poll(&self) {
        let mut slot = lock(&self.future);
        let Some(future) = slot.as_mut() else { return };
        // The driver asks each time, so no wake-up is needed.
        let mut context = Context::from_waker(Waker::noop());
        let polled = catch_unwind(AssertUnwindSafe(|| future.as_mut().poll(&mut context).is_ready()));
        match polled {
            Ok(false) => return,
            Ok(true) => {}
            Err(panic) => *lock(&self.panic) = Some(panic),
        }
        *slot = None;
    }
}

/// A node started by [`super::Loopback::start_task`].
pub struct LoopbackTask<T> {
    node: LoopbackNode,
    task: Arc<Task>,
    result: Arc<Mutex<Option<T>>>,
}

impl<T: Send + 'static> LoopbackTask<T> {
    pub(super) fn new(
        node: LoopbackNode,
        task: Arc<Task>,
        run: impl Future<Output = T> + Send + 'static,
    ) -> Self {
        let result = Arc::new(Mutex::new(None));
        let its_own = result.clone();
        *lock(&task.future) = Some(Box::pin(async move {
            let ended = run.await;
            *lock(&its_own) = Some(ended);
        }));
        Self { node, task, result }
    }

    pub(super) fn poll(&self) {
        self.task.poll();
    }

    /// Whether the node has ended.
    pub fn is_finished(&self) -> bool {
        lock(&self.task.future).is_none()
    }

    /// Asks the node to end, delivers its last messages, and returns its result.
    ///
    /// # Errors
    /// The panic of the node.
    pub fn end(self) -> thread::Result<T> {
        self.node.shutdown();
        self.node.bus().settle();
        if let Some(panic) = lock(&self.task.panic).take() {
            return Err(panic);
        }
        let result = lock(&self.result).take();
        result.ok_or_else(|| Box::new("the node did not end: it waits for more than its inbox") as _)
    }
}
