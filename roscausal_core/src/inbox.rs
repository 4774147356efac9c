//! A node's only queue. Every subscription sends into it; one thread owns the state and takes events from it.

use std::{
    collections::VecDeque,
    future::poll_fn,
    sync::{Arc, Condvar, Mutex, MutexGuard, Weak},
    task::Poll,
    thread::{self, ThreadId},
    time::Duration,
};

use crate::{
    Message, Result, Time,
    gate::{lock, wait},
    middleware::{Middleware, Qos},
};

pub use crate::middleware::Consumer;

/// The longest sleep before a wait checks the clock again. A simulated clock moves without notice.
const LOOK_AGAIN: Duration = Duration::from_millis(20);
/// The shortest sleep, so that a clock that stops just before a deadline costs no CPU.
const LOOK_SOON: Duration = Duration::from_micros(200);

/// The result of [`Inbox::next`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Next<E> {
    /// The oldest waiting event.
    Event(E),
    /// The deadline is reached.
    Deadline,
    /// The node has to end. Everything that was queued has been handed out before.
    Shutdown,
}

/// A bounded queue with one reader. If it is full, the oldest event is dropped and counted.
pub struct Inbox<E> {
    shared: Arc<Shared<E>>,
}

/// The sending side of an [`Inbox`]. There may be any number of them.
pub struct Sender<E> {
    shared: Weak<Shared<E>>,
}

struct Shared<E> {
    state: Mutex<State<E>>,
    changed: Condvar,
    capacity: usize,
    /// Nobody waits for this inbox.
    detached: bool,
    /// Its node is polled, and must not block.
    task: bool,
    /// The node looks into it from time to time, and no event wakes it.
    gathers: bool,
}

/// What the inbox holds at the moment.
enum Look<'a, E> {
    Next(Next<E>),
    /// Nothing at this time.
    Nothing(MutexGuard<'a, State<E>>, Time),
}

struct State<E> {
    queue: VecDeque<E>,
    dropped: u64,
    /// The deadline that the reader waits for, once it waits and has seen everything.
    waiting_for: Option<Time>,
    /// On a lockstep middleware: the time that the reader may act on. Only [`Consumer::wait_idle`] advances it, so
    /// that nodes act on a new time one after the other. `None`: the clock itself.
    granted: Option<Time>,
    /// A request to check the clock and the shutdown flag again.
    woken: bool,
    reader: ThreadId,
    open: bool,
}

impl<E> Shared<E> {
    fn lock(&self) -> MutexGuard<'_, State<E>> {
        lock(&self.state)
    }
}

impl<E: Send + 'static> Inbox<E> {
    /// An inbox for the node behind `mw`. The middleware wakes it when a simulated clock moves and, in lockstep,
    /// waits for it. The thread that creates the inbox has to read it.
    pub fn new<M: Middleware>(mw: &M, capacity: usize) -> Self {
        Self::attached(mw, capacity, false, false)
    }

    /// As [`Inbox::new`], for a node that may act a little later: where time is not simulated in lockstep, its reader looks every
    /// 20 ms instead of being woken by each event. A thousand messages a second then cost fifty awakenings, not a thousand.
    pub fn gathering<M: Middleware>(mw: &M, capacity: usize) -> Self {
        Self::attached(mw, capacity, false, !mw.is_lockstep())
    }

    /// An inbox that no middleware waits for. For a node that computes for a long time alongside the others.
    pub fn detached<M: Middleware>(mw: &M, capacity: usize) -> Self {
        Self::attached(mw, capacity, true, false)
    }

    fn attached<M: Middleware>(mw: &M, capacity: usize, detached: bool, gathers: bool) -> Self {
        let state = State {
            queue: VecDeque::new(),
            dropped: 0,
            waiting_for: None,
            granted: (mw.is_lockstep() && !detached).then(|| mw.now()),
            woken: false,
            reader: thread::current().id(),
            open: true,
        };
        let (state, changed) = (Mutex::new(state), Condvar::new());
        let (capacity, task) = (capacity.max(1), mw.is_task());
        let shared = Arc::new(Shared { state, changed, capacity, detached, task, gathers });
        mw.attach(shared.clone());
        Self { shared }
    }

    /// A handle that sends into this inbox.
    pub fn sender(&self) -> Sender<E> {
        Sender { shared: Arc::downgrade(&self.shared) }
    }

    /// Subscribes to a topic: `event` makes an event of each message.
    ///
    /// # Errors
    /// A topic that cannot be used.
    pub fn subscribe<M: Middleware, T: Message>(
        &self,
        mw: &M,
        topic: &str,
        qos: Qos,
        mut event: impl FnMut(T) -> E + Send + 'static,
    ) -> Result<M::Subscription> {
        let sender = self.sender();
        mw.subscribe(topic, qos, move |message| sender.send(event(message)))
    }

    /// Waits for the next event, for `deadline` on the middleware's clock, or for the end of the node. Blocks the
    /// thread, which is the node's own. Nodes that may run as tasks use [`Inbox::awaited`].
    pub fn next<M: Middleware>(&self, mw: &M, deadline: Option<Time>) -> Next<E> {
        loop {
            match self.look(mw, deadline) {
                Look::Next(next) => return next,
                Look::Nothing(state, now) => {
                    self.shared.changed.notify_all();
                    let left = deadline.map_or(LOOK_AGAIN, |deadline| {
                        Duration::from_secs_f64(deadline.secs_since(now).clamp(0.0, LOOK_AGAIN.as_secs_f64()))
                    });
                    drop(wait(&self.shared.changed, state, left.max(LOOK_SOON)));
                }
            }
        }
    }

    /// Like [`Inbox::next`]. On a middleware that polls its nodes ([`Middleware::is_task`]) the node is suspended
    /// meanwhile. On all others this blocks, so it is never pending.
    pub async fn awaited<M: Middleware>(&self, mw: &M, deadline: Option<Time>) -> Next<E> {
        if !self.shared.task {
            return self.next(mw, deadline);
        }
        poll_fn(|_| match self.look(mw, deadline) {
            Look::Next(next) => Poll::Ready(next),
            Look::Nothing(..) => Poll::Pending,
        })
        .await
    }

    /// What the inbox holds now. If it holds nothing, it is marked as waiting.
    fn look<M: Middleware>(&self, mw: &M, deadline: Option<Time>) -> Look<'_, E> {
        loop {
            // Asked outside the lock, because a middleware may hold a lock of its own while it wakes this inbox.
            let (ok, clock) = (mw.is_ok(), mw.now());
            let mut state = self.shared.lock();
            state.reader = thread::current().id();
            let now = state.granted.unwrap_or(clock);
            let next = if let Some(event) = state.queue.pop_front() {
                Next::Event(event)
            } else if !ok {
                Next::Shutdown
            } else if deadline.is_some_and(|deadline| now >= deadline) {
                Next::Deadline
            } else if std::mem::take(&mut state.woken) {
                continue;
            } else {
                state.waiting_for = Some(deadline.unwrap_or(Time::MAX));
                return Look::Nothing(state, now);
            };
            state.waiting_for = None;
            return Look::Next(next);
        }
    }

    /// Events dropped so far because the inbox was full.
    pub fn dropped(&self) -> u64 {
        self.shared.lock().dropped
    }
}

impl<E> Sender<E> {
    /// Adds an event. If there is no room, the oldest one is dropped. Does nothing if the inbox is gone.
    pub fn send(&self, event: E) {
        let Some(shared) = self.shared.upgrade() else { return };
        let mut state = shared.lock();
        if !state.open {
            return;
        }
        let oldest = (state.queue.len() >= shared.capacity).then(|| state.queue.pop_front());
        state.dropped += u64::from(oldest.is_some());
        state.queue.push_back(event);
        state.waiting_for = None;
        if !shared.gathers {
            shared.changed.notify_all();
        }
        // Not under the lock: dropping the event may run any code.
        drop(state);
        drop(oldest);
    }
}

impl<E> Clone for Sender<E> {
    fn clone(&self) -> Self {
        Self { shared: self.shared.clone() }
    }
}

impl<E> Drop for Inbox<E> {
    fn drop(&mut self) {
        let unread = {
            let mut state = self.shared.lock();
            state.open = false;
            std::mem::take(&mut state.queue)
        };
        self.shared.changed.notify_all();
        drop(unread);
    }
}

impl<E: Send> Consumer for Shared<E> {
    fn wake(&self) {
        let mut state = self.lock();
        state.woken = true;
        state.waiting_for = None;
        self.changed.notify_all();
    }

    fn wait_idle(&self, now: Time) {
        if self.detached {
            return;
        }
        let mut state = self.lock();
        state.granted = state.granted.and(Some(now));
        if state.reader == thread::current().id() {
            return;
        }
        while state.open && state.waiting_for.is_none_or(|deadline| deadline <= now) {
            self.changed.notify_all();
            state = wait(&self.changed, state, LOOK_AGAIN);
        }
    }

    fn is_idle(&self, now: Time) -> bool {
        if self.detached {
            return true;
        }
        let mut state = self.lock();
        state.granted = state.granted.and(Some(now));
        !state.open || state.waiting_for.is_some_and(|deadline| deadline > now)
    }

    fn deadline(&self) -> Option<Time> {
        let state = self.lock();
        if self.detached || !state.open { None } else { state.waiting_for }
    }
}
