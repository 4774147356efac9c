//! The one thread that reads everything that a node receives.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};
use std::{future::Future, io, panic::AssertUnwindSafe};

use futures::channel::mpsc::{self, UnboundedReceiver, UnboundedSender};
use futures::future::{AbortHandle, Abortable, LocalBoxFuture, poll_fn};
use futures::{FutureExt, StreamExt, executor::block_on, select_biased, stream::FuturesUnordered};
use roscausal_core::gate::lock;

/// Creates the future of a task on the spinner's thread, so the future itself need not be `Send`. Its output is the
/// name of the task if the task panicked.
type Start = Box<dyn FnOnce() -> LocalBoxFuture<'static, Option<String>> + Send>;

/// From one look at what has come to the next, once the node rests. At 1 kHz four messages wait, of the hundred that a
/// subscription to signals holds. The thread behind it was woken for each, which was a third of the data node's CPU time.
const REST: Duration = Duration::from_millis(4);

/// Drives the tasks of a node: subscriptions, parameter services, discovery. No task may block.
pub(crate) struct Spinner {
    tasks: UnboundedSender<Start>,
    thread: Mutex<Option<JoinHandle<()>>>,
    rests: Arc<AtomicBool>,
}

impl Spinner {
    /// Starts the thread. If a task panics, only that task ends, and `on_panic` gets its name.
    ///
    /// # Errors
    /// If the system cannot start a thread.
    pub(crate) fn start(on_panic: impl Fn(String) + Send + 'static) -> io::Result<Self> {
        let (tasks, incoming) = mpsc::unbounded();
        let rests = Arc::new(AtomicBool::new(false));
        let reported = rests.clone();
        let thread = thread::Builder::new()
            .name("ros2 spinner".into())
            .spawn(move || block_on(rested(run(incoming, on_panic), &reported)))?;
        Ok(Self { tasks, thread: Mutex::new(Some(thread)), rests })
    }

    /// From now on several messages are taken at a time, each at most [`REST`] later. For a node that listens to fast
    /// topics and answers nobody.
    pub(crate) fn rest(&self) {
        self.rests.store(true, Ordering::Relaxed);
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

/// A future that is polled at most once in [`REST`], as long as `rests` is true. What wakes it meanwhile, it finds together.
fn rested<T>(future: impl Future<Output = T>, rests: &AtomicBool) -> impl Future<Output = T> {
    let (mut future, mut polled) = (Box::pin(future), Instant::now());
    poll_fn(move |context| {
        if rests.load(Ordering::Relaxed) {
            thread::sleep(REST.saturating_sub(polled.elapsed()));
            polled = Instant::now();
        }
        future.poll_unpin(context)
    })
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
    use std::{sync::mpsc::channel, task::Poll};

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
    fn a_spinner_that_rests_looks_once_in_a_while_and_misses_nothing() {
        let (sender, mut messages) = mpsc::unbounded();
        let sending = thread::spawn(move || {
            for number in 0..50 {
                sender.unbounded_send(number).unwrap();
                thread::sleep(REST / 4);
            }
        });
        let (mut looks, mut got, begun) = (0, Vec::new(), Instant::now());
        let all = poll_fn(|context| {
            looks += 1;
            while let Poll::Ready(message) = messages.poll_next_unpin(context) {
                let Some(message) = message else { return Poll::Ready(()) };
                got.push(message);
            }
            Poll::Pending
        });
        block_on(rested(all, &AtomicBool::new(true)));
        assert_eq!(got, (0..50).collect::<Vec<i32>>());
        assert!(REST * (looks - 1) <= begun.elapsed(), "{looks} looks in {:?}", begun.elapsed());
        sending.join().unwrap();
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
