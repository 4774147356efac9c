//! The middleware within one process: several nodes as threads, latched topics, parameters, simulated time.
//!
//! Two ways to run:
//! - [`Loopback::lockstep`]: time is simulated, and whoever holds the [`Loopback`] moves it
//!   ([`Loopback::advance_to`]). Messages are delivered one at a time, in the order of publication, each
//!   after every node has finished with the one before. So a run is the same run whatever the threads do.
//! - [`Loopback::live`]: a message is delivered in `publish` itself; time is whatever clock was given.

use std::{
    any::{Any, TypeId},
    collections::{BTreeMap, VecDeque},
    marker::PhantomData,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, AtomicI64, AtomicU64, Ordering},
    },
};

use crate::{
    Error, Message, Result, Time,
    inbox::Consumer,
    middleware::{Middleware, Publish, Qos},
    params::{ParamSpec, Value},
};

type Payload = Arc<dyn Any + Send + Sync>;
type Callback = Arc<Mutex<dyn FnMut(&Payload) + Send>>;

/// The bus that the nodes of one process share. Cheap to clone.
#[derive(Clone)]
pub struct Loopback {
    bus: Arc<Bus>,
}

/// One node's connection to a [`Loopback`].
#[derive(Clone)]
pub struct LoopbackNode {
    bus: Arc<Bus>,
    name: Arc<str>,
    alive: Arc<AtomicBool>,
}

struct Bus {
    clock: Clock,
    /// Deliveries wait for [`Loopback::settle`].
    lockstep: bool,
    next_id: AtomicU64,
    state: Mutex<BusState>,
}

enum Clock {
    Simulated(AtomicI64),
    Given(Box<dyn Fn() -> Time + Send + Sync>),
}

#[derive(Default)]
struct BusState {
    topics: BTreeMap<String, Topic>,
    params: BTreeMap<String, Value>,
    consumers: Vec<(Arc<AtomicBool>, Arc<dyn Consumer>)>,
    deliveries: VecDeque<(Callback, Payload)>,
}

struct Topic {
    type_id: TypeId,
    type_name: String,
    latched: Option<(u64, Payload)>,
    publishers: usize,
    subscribers: Vec<(u64, Callback)>,
}

impl Loopback {
    /// A bus whose time is simulated, starts at 0 and moves only by [`Loopback::advance_to`].
    pub fn lockstep() -> Self {
        Self::new(Clock::Simulated(AtomicI64::new(0)), true)
    }

    /// A bus that delivers at once and reads its time from `clock`.
    pub fn live(clock: impl Fn() -> Time + Send + Sync + 'static) -> Self {
        Self::new(Clock::Given(Box::new(clock)), false)
    }

    fn new(clock: Clock, lockstep: bool) -> Self {
        let state = Mutex::new(BusState::default());
        Self { bus: Arc::new(Bus { clock, lockstep, next_id: AtomicU64::new(0), state }) }
    }

    /// Joins as a node; `name` without a leading `/`. Its parameters are `/name/parameter`.
    pub fn node(&self, name: &str) -> LoopbackNode {
        let name = format!("/{}", name.trim_matches('/')).into();
        LoopbackNode { bus: self.bus.clone(), name, alive: Arc::new(AtomicBool::new(true)) }
    }

    /// Sets a node's private parameter before the node starts.
    pub fn set_node_param(&self, node: &str, name: &str, value: Value) {
        self.bus.lock().params.insert(format!("/{}/{name}", node.trim_matches('/')), value);
    }

    /// Delivers all that has been published, in order, waiting for the nodes after each message.
    pub fn settle(&self) {
        self.bus.wait_idle();
        loop {
            let Some((callback, payload)) = self.bus.lock().deliveries.pop_front() else { return };
            call(&callback, &payload);
            self.bus.wait_idle();
        }
    }

    /// Moves simulated time (lockstep only) and lets every node do what is due, then settles.
    pub fn advance_to(&self, now: Time) {
        self.settle();
        if let Clock::Simulated(nanos) = &self.bus.clock {
            nanos.store(now.as_nanos(), Ordering::SeqCst);
        }
        self.settle();
    }

    /// Time of the bus.
    pub fn now(&self) -> Time {
        self.bus.now()
    }
}

fn call(callback: &Callback, payload: &Payload) {
    let mut callback = callback.lock().unwrap_or_else(PoisonError::into_inner);
    callback(payload);
}

impl Bus {
    fn lock(&self) -> MutexGuard<'_, BusState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
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

    /// Wakes the nodes one after the other, in the order of their start, and waits for each.
    fn wait_idle(&self) {
        let consumers: Vec<_> = self.lock().consumers.iter().map(|(_, consumer)| consumer.clone()).collect();
        for consumer in consumers {
            consumer.wake();
            consumer.wait_idle(self.now());
        }
    }

    fn topic<'a, M: Message>(state: &'a mut BusState, name: &str) -> Result<&'a mut Topic> {
        let topic = state.topics.entry(name.to_owned()).or_insert_with(|| Topic {
            type_id: TypeId::of::<M>(),
            type_name: M::type_name(),
            latched: None,
            publishers: 0,
            subscribers: Vec::new(),
        });
        if topic.type_id == TypeId::of::<M>() {
            return Ok(topic);
        }
        let reason =
            format!("it carries {}, not {}; check the topic's name", topic.type_name, M::type_name());
        Err(Error::Topic { topic: name.to_owned(), reason })
    }
}

impl LoopbackNode {
    /// The bus this node is on.
    pub fn bus(&self) -> Loopback {
        Loopback { bus: self.bus.clone() }
    }

    fn resolve(&self, name: &str) -> Result<String> {
        let legal = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '/' | '~');
        if name.is_empty() || !name.chars().all(legal) || name.contains("//") || name.ends_with('/') {
            let reason = "not a legal name: use letters, digits, '_' and single '/'".to_owned();
            return Err(Error::Topic { topic: name.to_owned(), reason });
        }
        Ok(match name.strip_prefix('~') {
            Some(private) => format!("{}/{}", self.name, private.trim_start_matches('/')),
            None if name.starts_with('/') => name.to_owned(),
            None => format!("/{name}"),
        })
    }

    fn param_key(&self, name: &str) -> String {
        if name.starts_with('/') { name.to_owned() } else { format!("{}/{name}", self.name) }
    }
}

impl Middleware for LoopbackNode {
    type Publisher<M: Message> = LoopbackPublisher<M>;
    type Subscription = LoopbackSubscription;

    fn node_name(&self) -> String {
        self.name.to_string()
    }

    fn advertise<M: Message>(&self, topic: &str, qos: Qos) -> Result<Self::Publisher<M>> {
        let topic = self.resolve(topic)?;
        Bus::topic::<M>(&mut self.bus.lock(), &topic)?.publishers += 1;
        let id = self.bus.id();
        Ok(LoopbackPublisher { bus: self.bus.clone(), topic, qos, id, message: PhantomData })
    }

    fn subscribe<M: Message>(
        &self,
        topic: &str,
        _qos: Qos,
        mut callback: impl FnMut(M) + Send + 'static,
    ) -> Result<Self::Subscription> {
        let topic = self.resolve(topic)?;
        let active = Arc::new(AtomicBool::new(true));
        let still_active = active.clone();
        let callback: Callback = Arc::new(Mutex::new(move |payload: &Payload| {
            if let Some(message) = payload.downcast_ref::<M>()
                && still_active.load(Ordering::SeqCst)
            {
                callback(message.clone());
            }
        }));
        let id = self.bus.id();
        let latched = {
            let mut state = self.bus.lock();
            let entry = Bus::topic::<M>(&mut state, &topic)?;
            entry.subscribers.push((id, callback.clone()));
            let latched = entry.latched.as_ref().map(|(_, payload)| payload.clone());
            match latched {
                Some(payload) if self.bus.lockstep => {
                    state.deliveries.push_back((callback.clone(), payload));
                    None
                }
                latched => latched,
            }
        };
        if let Some(payload) = latched {
            call(&callback, &payload);
        }
        Ok(LoopbackSubscription { bus: self.bus.clone(), topic, id, active, callback })
    }

    fn param(&self, spec: &ParamSpec) -> Result<Option<Value>> {
        Ok(self.bus.lock().params.get(&self.param_key(spec.name)).cloned())
    }

    fn set_param(&self, name: &str, value: Value) -> Result<()> {
        self.bus.lock().params.insert(self.param_key(name), value);
        Ok(())
    }

    fn now(&self) -> Time {
        self.bus.now()
    }

    fn is_ok(&self) -> bool {
        self.alive.load(Ordering::SeqCst)
    }

    fn shutdown(&self) {
        self.alive.store(false, Ordering::SeqCst);
        let consumers = self.bus.lock().consumers.clone();
        for (_, consumer) in consumers.iter().filter(|(alive, _)| Arc::ptr_eq(alive, &self.alive)) {
            consumer.wake();
        }
    }

    fn attach(&self, consumer: Arc<dyn Consumer>) {
        self.bus.lock().consumers.push((self.alive.clone(), consumer));
    }

    fn topics(&self) -> Vec<(String, String)> {
        let state = self.bus.lock();
        let published = state.topics.iter().filter(|(_, topic)| topic.publishers > 0);
        published.map(|(name, topic)| (name.clone(), topic.type_name.clone())).collect()
    }
}

/// A publisher on a [`Loopback`].
pub struct LoopbackPublisher<M> {
    bus: Arc<Bus>,
    topic: String,
    qos: Qos,
    id: u64,
    message: PhantomData<fn(M)>,
}

impl<M: Message> Publish<M> for LoopbackPublisher<M> {
    fn publish(&self, message: &M) -> Result<()> {
        let payload: Payload = Arc::new(message.clone());
        let callbacks: Vec<Callback> = {
            let mut state = self.bus.lock();
            let topic = Bus::topic::<M>(&mut state, &self.topic)?;
            if self.qos == Qos::Latched {
                topic.latched = Some((self.id, payload.clone()));
            }
            let callbacks: Vec<_> = topic.subscribers.iter().map(|(_, callback)| callback.clone()).collect();
            if self.bus.lockstep {
                state.deliveries.extend(callbacks.into_iter().map(|callback| (callback, payload.clone())));
                return Ok(());
            }
            callbacks
        };
        callbacks.iter().for_each(|callback| call(callback, &payload));
        Ok(())
    }

    fn subscriber_count(&self) -> usize {
        self.bus.lock().topics.get(&self.topic).map_or(0, |topic| topic.subscribers.len())
    }
}

impl<M> Drop for LoopbackPublisher<M> {
    fn drop(&mut self) {
        if let Some(topic) = self.bus.lock().topics.get_mut(&self.topic) {
            topic.publishers -= 1;
            if topic.latched.as_ref().is_some_and(|(id, _)| *id == self.id) {
                topic.latched = None;
            }
        }
    }
}

/// A subscription on a [`Loopback`].
pub struct LoopbackSubscription {
    bus: Arc<Bus>,
    topic: String,
    id: u64,
    active: Arc<AtomicBool>,
    callback: Callback,
}

impl Drop for LoopbackSubscription {
    fn drop(&mut self) {
        self.active.store(false, Ordering::SeqCst);
        if let Some(topic) = self.bus.lock().topics.get_mut(&self.topic) {
            topic.subscribers.retain(|(id, _)| *id != self.id);
        }
        // A call under way ends before the drop does; one that drops itself from within its own callback
        // holds the lock already, and `try_lock` lets it pass.
        drop(self.callback.try_lock());
    }
}
