//! A node's one inbox: every subscription sends into it, one thread owns the state and takes from it.

use std::{
    collections::VecDeque,
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, Weak},
    time::Duration,
};

use crate::{Time, middleware::Middleware};

/// The longest a wait sleeps before it looks at the clock again (a simulated one moves without notice).
const LOOK_AGAIN: Duration = Duration::from_millis(20);

/// What a middleware sees of an inbox.
pub trait Consumer: Send + Sync {
    /// Makes a waiting node look at the clock and at the shutdown flag again.
    fn wake(&self);

    /// Blocks until the node has dealt with all it was given and waits for something after `now`.
    /// Returns at once when the inbox is gone.
    fn wait_idle(&self, now: Time);
}

/// What [`Inbox::next`] gives.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Next<E> {
    /// The oldest waiting event.
    Event(E),
    /// The deadline has come.
    Deadline,
    /// The node is to end; what is still queued has been given out before.
    Shutdown,
}

/// A bounded queue with one reader. When full, the oldest event is dropped and counted.
pub struct Inbox<E> {
    shared: Arc<Shared<E>>,
}

/// The sending side of an [`Inbox`]; any number of them.
pub struct Sender<E> {
    shared: Weak<Shared<E>>,
}

struct Shared<E> {
    state: Mutex<State<E>>,
    changed: Condvar,
    capacity: usize,
}

struct State<E> {
    queue: VecDeque<E>,
    dropped: u64,
    /// The deadline the reader waits for, while it waits and has seen all that happened.
    waiting_for: Option<Time>,
    open: bool,
}

impl<E> Shared<E> {
    fn lock(&self) -> MutexGuard<'_, State<E>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<E: Send + 'static> Inbox<E> {
    /// An inbox for the node behind `mw`, which wakes it when a simulated clock moves and, on a lockstep
    /// middleware, waits for it.
    pub fn new<M: Middleware>(mw: &M, capacity: usize) -> Self {
        let inbox = Self::detached(capacity);
        mw.attach(inbox.shared.clone());
        inbox
    }

    /// An inbox that no middleware waits for: for a node that computes for long beside the others.
    pub fn detached(capacity: usize) -> Self {
        let state = State { queue: VecDeque::new(), dropped: 0, waiting_for: None, open: true };
        let shared = Shared { state: Mutex::new(state), changed: Condvar::new(), capacity: capacity.max(1) };
        Self { shared: Arc::new(shared) }
    }

    /// A handle that sends into this inbox.
    pub fn sender(&self) -> Sender<E> {
        Sender { shared: Arc::downgrade(&self.shared) }
    }

    /// Waits for the next event, for `deadline` on the middleware's clock, or for the end.
    pub fn next<M: Middleware>(&self, mw: &M, deadline: Option<Time>) -> Next<E> {
        let mut state = self.shared.lock();
        loop {
            if let Some(event) = state.queue.pop_front() {
                state.waiting_for = None;
                return Next::Event(event);
            }
            if !mw.is_ok() {
                state.waiting_for = None;
                return Next::Shutdown;
            }
            if deadline.is_some_and(|deadline| mw.now() >= deadline) {
                state.waiting_for = None;
                return Next::Deadline;
            }
            state.waiting_for = Some(deadline.unwrap_or(Time::MAX));
            self.shared.changed.notify_all();
            state = match self.shared.changed.wait_timeout(state, LOOK_AGAIN) {
                Ok((state, _)) => state,
                Err(poisoned) => poisoned.into_inner().0,
            };
        }
    }

    /// Events dropped so far because the inbox was full.
    pub fn dropped(&self) -> u64 {
        self.shared.lock().dropped
    }
}

impl<E> Sender<E> {
    /// Puts an event in; the oldest goes when there is no room. Nothing happens when the inbox is gone.
    pub fn send(&self, event: E) {
        let Some(shared) = self.shared.upgrade() else { return };
        let mut state = shared.lock();
        if state.queue.len() >= shared.capacity {
            state.queue.pop_front();
            state.dropped += 1;
        }
        state.queue.push_back(event);
        state.waiting_for = None;
        shared.changed.notify_all();
    }
}

impl<E> Clone for Sender<E> {
    fn clone(&self) -> Self {
        Self { shared: self.shared.clone() }
    }
}

impl<E> Drop for Inbox<E> {
    fn drop(&mut self) {
        self.shared.lock().open = false;
        self.shared.changed.notify_all();
    }
}

impl<E: Send> Consumer for Shared<E> {
    fn wake(&self) {
        let _state = self.lock();
        self.changed.notify_all();
    }

    fn wait_idle(&self, now: Time) {
        let mut state = self.lock();
        while state.open && state.waiting_for.is_none_or(|deadline| deadline <= now) {
            self.changed.notify_all();
            state = match self.changed.wait_timeout(state, LOOK_AGAIN) {
                Ok((state, _)) => state,
                Err(poisoned) => poisoned.into_inner().0,
            };
        }
    }
}
