//! The middleware within one process: several nodes, latched topics, parameters, simulated time.
//!
//! There are two ways to run it:
//! - [`Loopback::lockstep`]: time is simulated, and the owner of the [`Loopback`] advances it
//!   ([`Loopback::advance_to`]). Messages are delivered one at a time, in the order of publication, each after
//!   every node has finished with the previous one. So a run is the same whatever the threads do. Nodes are threads
//!   ([`Loopback::start`]) or, at a tenth of the cost, tasks on the driver's own thread ([`Loopback::start_task`]).
//! - [`Loopback::live`]: `publish` itself delivers the message, and time comes from a given clock.

mod node;
mod services;
mod task;
#[cfg(test)]
mod tests;
mod topics;

pub use node::{LoopbackNode, LoopbackTask};
pub use services::LoopbackServer;
pub use topics::{LoopbackPublisher, LoopbackSubscription};

use std::{
    collections::{BTreeMap, VecDeque},
    sync::{
        Arc, Mutex, MutexGuard, Weak,
        atomic::{AtomicBool, AtomicI64, AtomicU64, Ordering},
    },
    thread::{self, JoinHandle, ThreadId},
    time::Duration,
};

use crate::{
    Error, Result, Time,
    gate::lock,
    middleware::Consumer,
    params::{Params, Value},
};

use services::Offer;
use task::Task;
use topics::{Payload, Slot, Topic};

/// How often [`Loopback::start`] checks whether the node is up.
const LOOK_AGAIN: Duration = Duration::from_micros(200);

/// The bus that the nodes of one process share. Cheap to clone.
///
/// One thread at a time drives a lockstep bus ([`Loopback::advance_to`], [`Loopback::settle`]); others wait for
/// their turn. A node must not drive it, because it would wait for itself.
#[derive(Clone)]
pub struct Loopback {
    bus: Arc<Bus>,
}

struct Bus {
    clock: Clock,
    /// Deliveries wait for [`Loopback::settle`].
    lockstep: bool,
    next_id: AtomicU64,
    state: Mutex<BusState>,
    /// Held by the thread that delivers.
    driving: Mutex<()>,
    driver: Mutex<Option<ThreadId>>,
}

enum Clock {
    Simulated(AtomicI64),
    Given(Box<dyn Fn() -> Time + Send + Sync>),
}

type Take = dyn Fn(&Params) -> Result<()> + Send + Sync;

#[derive(Default)]
struct BusState {
    topics: BTreeMap<String, Topic>,
    /// By topic: who takes its messages as bytes, whatever their type.
    listeners: BTreeMap<String, Vec<(u64, Arc<Slot>)>>,
    services: BTreeMap<String, Offer>,
    params: BTreeMap<String, Value>,
    /// By node: its parameters, and what decides on changes of them.
    watched: BTreeMap<String, (Params, Arc<Take>)>,
    /// The "keep running" flag of each node, in the order in which they joined.
    nodes: Vec<Weak<AtomicBool>>,
    members: Arc<Vec<Member>>,
    deliveries: VecDeque<(Arc<Slot>, Payload)>,
}

/// A node that waits in an inbox.
#[derive(Clone)]
struct Member {
    alive: Arc<AtomicBool>,
    consumer: Weak<dyn Consumer>,
    /// The task that polls it; `None`: the node has a thread of its own.
    task: Option<Weak<Task>>,
}

impl Member {
    fn wait_idle(&self, now: Time) {
        let Some(consumer) = self.consumer.upgrade() else { return };
        match &self.task {
            None => consumer.wait_idle(now),
            Some(task) => {
                if !consumer.is_idle(now) {
                    drop(consumer);
                    task.upgrade().inspect(|task| task.poll());
                }
            }
        }
    }
}

impl Loopback {
    /// A bus with simulated time. It starts at 0 and advances only through [`Loopback::advance_to`].
    pub fn lockstep() -> Self {
        Self::new(Clock::Simulated(AtomicI64::new(0)), true)
    }

    /// A bus that delivers at once and reads its time from `clock`.
    pub fn live(clock: impl Fn() -> Time + Send + Sync + 'static) -> Self {
        Self::new(Clock::Given(Box::new(clock)), false)
    }

    fn new(clock: Clock, lockstep: bool) -> Self {
        let (next_id, state, driving, driver) = Default::default();
        Self { bus: Arc::new(Bus { clock, lockstep, next_id, state, driving, driver }) }
    }

    /// Joins as a node. `name` has no leading `/`. Parameters of the node are `/name/parameter`.
    pub fn node(&self, name: &str) -> LoopbackNode {
        let node = LoopbackNode::new(self.bus.clone(), name);
        let mut state = self.bus.lock();
        state.nodes.retain(|alive| alive.strong_count() > 0);
        state.nodes.push(node.alive());
        node
    }

    /// Runs a node on a thread of its own. Returns once the node has an inbox and waits in it, or has ended. So
    /// nodes that are started one after the other take part in the same order in every run.
    ///
    /// # Errors
    /// If the system cannot start a thread.
    pub fn start<T: Send + 'static>(
        &self,
        name: &str,
        run: impl FnOnce(LoopbackNode) -> T + Send + 'static,
    ) -> Result<JoinHandle<T>> {
        let node = self.node(name);
        let alive = node.alive();
        let thread = thread::Builder::new()
            .name(name.to_owned())
            .spawn(move || run(node))
            .map_err(|error| Error::Middleware(format!("no thread for node {name}: {error}")))?;
        let is_up = |state: &BusState| {
            state.members.iter().any(|member| std::ptr::eq(Arc::as_ptr(&member.alive), alive.as_ptr()))
        };
        while !thread.is_finished() && !is_up(&self.bus.lock()) {
            thread::sleep(LOOK_AGAIN);
        }
        if self.bus.lockstep
            && let Some(_driving) = self.bus.drive()
        {
            self.bus.wait_idle();
        }
        Ok(thread)
    }

    /// Runs a node as a task (lockstep only). Whoever drives the bus polls it, so a message needs no change of
    /// threads. The run is the same as with [`Loopback::start`]. The node may wait only in
    /// [`crate::inbox::Inbox::awaited`], and runs up to its inbox before this returns. Dropping the handle drops
    /// the node.
    pub fn start_task<T, F>(&self, name: &str, run: impl FnOnce(LoopbackNode) -> F) -> LoopbackTask<T>
    where
        T: Send + 'static,
        F: Future<Output = T> + Send + 'static,
    {
        let (node, task) = (self.node(name), Arc::new(Task::default()));
        let node = node.run_by(&task);
        let handle = LoopbackTask::new(node.clone(), task, run(node));
        let _driving = self.bus.drive();
        handle.poll();
        handle
    }

    /// Sets a private parameter of a node before the node starts.
    pub fn set_node_param(&self, node: &str, name: &str, value: Value) {
        self.bus.lock().params.insert(format!("/{}/{name}", node.trim_matches('/')), value);
    }

    /// Sets parameters of a node that runs, all or none, as a parameter service does with checked values.
    ///
    /// # Errors
    /// What the node says against them; a node that takes none.
    pub fn change_node_params(&self, node: &str, changes: &[(&str, Value)]) -> Result<()> {
        let name = format!("/{}", node.trim_matches('/'));
        let watched = self.bus.lock().watched.get(&name).cloned();
        let (now, take) = watched.ok_or_else(|| Error::param(node, "the node takes no changes"))?;
        let changed = now.with(changes.iter().map(|(name, value)| (*name, value)));
        take(&changed)?;
        self.bus.lock().watched.insert(name, (changed, take));
        Ok(())
    }

    /// Delivers everything that has been published, in order, and waits for the nodes after each message. Does
    /// nothing if called from inside a delivery: that delivery continues to the end of the queue.
    pub fn settle(&self) {
        if let Some(_driving) = self.bus.drive() {
            self.bus.settle();
        }
    }

    /// Advances simulated time (lockstep only), lets every node do what is due, then settles. A deadline on the way
    /// is met at its own time, before later ones.
    pub fn advance_to(&self, now: Time) {
        let Some(_driving) = self.bus.drive() else { return };
        self.bus.settle();
        if let Clock::Simulated(nanos) = &self.bus.clock {
            while let Some(due) = self.bus.next_deadline().filter(|due| *due < now) {
                nanos.store(due.as_nanos(), Ordering::SeqCst);
                self.bus.settle();
            }
            nanos.store(now.as_nanos(), Ordering::SeqCst);
        }
        self.bus.settle();
    }

    /// Advances simulated time (lockstep only) over a time in which nothing happens: what is due by then is done once, at its end.
    pub fn skip_to(&self, now: Time) {
        let Some(_driving) = self.bus.drive() else { return };
        self.bus.settle();
        if let Clock::Simulated(nanos) = &self.bus.clock {
            nanos.store(now.as_nanos(), Ordering::SeqCst);
        }
        self.bus.settle();
    }

    /// Asks all nodes to end, in the order in which they joined. In lockstep, each node is asked only after the
    /// previous one has left its inbox and its last messages have been delivered.
    pub fn shutdown(&self) {
        let _driving = self.bus.lockstep.then(|| self.bus.drive());
        let nodes: Vec<_> = self.bus.lock().nodes.iter().filter_map(Weak::upgrade).collect();
        for alive in nodes {
            self.bus.end(&alive);
            self.bus.settle();
        }
    }

    /// Time of the bus.
    pub fn now(&self) -> Time {
        self.bus.now()
    }
}

impl Bus {
    fn lock(&self) -> MutexGuard<'_, BusState> {
        lock(&self.state)
    }

    fn now(&self) -> Time {
        match &self.clock {
            Clock::Simulated(nanos) => Time::from_nanos(nanos.load(Ordering::SeqCst)),
            Clock::Given(clock) => clock(),
        }
    }

    fn id(&self) -> u64 {
        self.next_id.fetch_add(1, Ordering::Relaxed)
    }

    /// Starts to drive the bus; `None` if this thread already drives it.
    fn drive(&self) -> Option<Driving<'_>> {
        let me = Some(thread::current().id());
        if *lock(&self.driver) == me {
            return None;
        }
        let turn = lock(&self.driving);
        *lock(&self.driver) = me;
        Some(Driving { bus: self, _turn: turn })
    }

    /// As [`Bus::drive`], but `None` also while another thread drives.
    fn try_drive(&self) -> Option<Driving<'_>> {
        let turn = self.driving.try_lock().ok()?;
        *lock(&self.driver) = Some(thread::current().id());
        Some(Driving { bus: self, _turn: turn })
    }

    fn settle(&self) {
        if !self.lockstep {
            return;
        }
        self.wait_idle();
        loop {
            let Some((slot, payload)) = self.lock().deliveries.pop_front() else { return };
            slot.push(payload);
            slot.run();
            self.wait_idle();
        }
    }

    /// Tells the nodes the time, one after the other in the order of their start, and waits for each.
    fn wait_idle(&self) {
        let now = self.now();
        self.members().iter().for_each(|member| member.wait_idle(now));
    }

    fn next_deadline(&self) -> Option<Time> {
        let (now, members) = (self.now(), self.members());
        let deadlines = members.iter().filter_map(|member| member.consumer.upgrade()?.deadline());
        deadlines.filter(|deadline| *deadline > now).min()
    }

    /// The nodes that wait in an inbox now.
    fn members(&self) -> Arc<Vec<Member>> {
        let mut state = self.lock();
        let is_gone = |member: &Member| member.consumer.strong_count() == 0;
        if state.members.iter().any(is_gone) {
            Arc::make_mut(&mut state.members).retain(|member| !is_gone(member));
        }
        state.members.clone()
    }

    fn end(&self, alive: &Arc<AtomicBool>) {
        alive.store(false, Ordering::SeqCst);
        for member in self.members().iter().filter(|member| Arc::ptr_eq(&member.alive, alive)) {
            member.consumer.upgrade().inspect(|consumer| consumer.wake());
        }
    }
}

/// The right to drive the bus, while it is held.
struct Driving<'a> {
    bus: &'a Bus,
    _turn: MutexGuard<'a, ()>,
}

impl Drop for Driving<'_> {
    fn drop(&mut self) {
        *lock(&self.bus.driver) = None;
    }
}
