//! The one thread that reads everything that a node receives.

use std::{
    future::Future,
    io,
    panic::AssertUnwindSafe,
    sync::Mutex,
    thread::{self, JoinHandle},
};

use futures::{
    FutureExt, StreamExt,
    channel::mpsc::{self, UnboundedReceiver, UnboundedSender},
    executor::block_on,
    future::{AbortHandle, Abortable, LocalBoxFuture},
    select_biased,
    stream::FuturesUnordered,
};
use roscausal_core::gate::lock;

/// Creates the future of a task on the spinner's thread, so the future itself need not be `Send`. Its output is the
/// name of the task if the task panicked.
type Start = Box<dyn FnOnce() -> LocalBoxFuture<'static, Option<String>> + Send>;

/// Drives the tasks of a node: subscriptions, parameter services, discovery. No task may block.
pub(crate) struct Spinner {
    tasks: UnboundedSender<Start>,
    thread: Mutex<Option<JoinHandle<()>>>,
}

impl Spinner {
    /// Starts the thread. If a task panics, only that task ends, and `on_panic` gets its name.
    ///
    /// # Errors
    /// If the system cannot start a thread.
    pub(crate) fn start(on_panic: impl Fn(String) + Send + 'static) -> io::Result<Self> {
        let (tasks, incoming) = mpsc::unbounded();
        let thread = thread::Builder::new()
            .name("ros2 spinner".into())
            .spawn(move || block_on(run(incoming, on_panic)))?;
        Ok(Self { tasks, thread: Mutex::new(Some(thread)) })
    }

    /// Runs a task until it ends or the handle aborts it. Then everything that it owns is dropped.
    pub(crate) fn spawn<F>(&self, name: String, task: impl FnOnce() -> F + Send + 'static) -> AbortHandle
    where
        F: Future<Output = ()> + 'static,
    {
        let (handle, registration) = AbortHandle::new_pair();
        let start: Start = Box::new(move || {
            let task = Abortable::new(task(), registration);
            let guarded = AssertUnwindSafe(task).catch_unwind();
            guarded.map(move |outcome| outcome.is_err().then_some(name)).boxed_local()
        });
        // A spinner that has stopped runs nothing.
        let _ = self.tasks.unbounded_send(start);
        handle
    }

    /// Drops all tasks and waits for the thread, unless the caller is that thread.
    pub(crate) fn stop(&self) {
        self.tasks.close_channel();
        let thread = lock(&self.thread).take();
        if let Some(thread) = thread
            && thread.thread().id() != thread::current().id()
        {
            let _ = thread.join();
        }
    }
}

async fn run(mut incoming: UnboundedReceiver<Start>, on_panic: impl Fn(String)) {
    let mut running = FuturesUnordered::new();
    loop {
        select_biased! {
            start = incoming.next() => match start {
                Some(start) => running.push(start()),
                None => return,
            },
            ended = running.select_next_some() => if let Some(name) = ended { on_panic(name) },
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use super::*;

    #[test]
    fn a_task_that_panics_ends_alone() {
        let (panicked, panics) = channel();
        let spinner = Spinner::start(move |name| panicked.send(name).unwrap()).unwrap();
        spinner.spawn("bad".into(), || async { panic!("on purpose") });
        assert_eq!(panics.recv().unwrap(), "bad");
        let (done, after) = channel();
        spinner.spawn("good".into(), move || async move { done.send(()).unwrap() });
        after.recv().unwrap();
        spinner.stop();
    }

    #[test]
    fn an_aborted_task_drops_what_it_owns() {
        let spinner = Spinner::start(|_| {}).unwrap();
        let (owned, watch) = channel::<()>();
        let handle = spinner.spawn("idle".into(), move || async move {
            let _owned = owned;
            futures::future::pending::<()>().await;
        });
        handle.abort();
        assert!(watch.recv().is_err());
        spinner.stop();
    }
}
