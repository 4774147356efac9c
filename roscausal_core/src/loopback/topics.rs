//! Topics of a bus: publishers, subscribers, and the last latched message.

use std::{
    any::{Any, TypeId},
    collections::VecDeque,
    marker::PhantomData,
    sync::{Arc, Mutex, MutexGuard},
};

use roscausal_msgs::{Wires, cdr, dynamic::Wire, ros1};

use super::{Bus, BusState};
use crate::{
    Error, Message, Result,
    gate::{Gate, lock},
    middleware::{On, Publish, Qos, Raw, RawType},
};

pub(super) type Payload = Arc<dyn Any + Send + Sync>;
type Callback = Box<dyn FnMut(Payload) + Send>;

pub(super) struct Topic {
    type_id: TypeId,
    pub(super) type_name: String,
    md5: &'static str,
    latched: Option<(u64, Payload)>,
    /// A message of it as bytes.
    as_raw: fn(&Payload) -> Option<Raw>,
    pub(super) publishers: usize,
    subscribers: Vec<(u64, Arc<Slot>)>,
}

/// A subscription's callback and the messages that wait for it. Calls never overlap, and keep the order in which
/// the messages were pushed.
pub(super) struct Slot {
    gate: Gate,
    waiting: Mutex<VecDeque<Payload>>,
    callback: Mutex<Callback>,
}

impl Slot {
    fn new<M: Any + Clone + Send + Sync>(mut callback: impl On<M>) -> Self {
        Self::of(move |payload| {
            if let Ok(message) = payload.downcast::<M>() {
                callback(Arc::unwrap_or_clone(message));
            }
        })
    }

    /// A slot for whatever is pushed.
    pub(super) fn of(callback: impl On<Payload>) -> Self {
        Self { gate: Gate::default(), waiting: Mutex::default(), callback: Mutex::new(Box::new(callback)) }
    }

    pub(super) fn push(&self, payload: Payload) {
        lock(&self.waiting).push_back(payload);
    }

    /// Calls back for every waiting message. What a callback publishes to its own topic comes after the current
    /// call.
    pub(super) fn run(&self) {
        self.gate.pass(|| {
            let mut callback = lock(&self.callback);
            while self.gate.is_open() {
                let Some(payload) = lock(&self.waiting).pop_front() else { return };
                callback(payload);
            }
        });
    }

    /// Ends the subscription. No call is made afterwards, except the one that is running if it ends the
    /// subscription itself.
    pub(super) fn end(&self) {
        self.gate.close();
        lock(&self.waiting).clear();
    }
}

/// A message as bytes: in ROS 1's format, unless only ROS 2 has its type.
fn as_raw<M: Message>(payload: &Payload) -> Option<Raw> {
    let (message, definition) = (payload.downcast_ref::<M>()?, M::definition());
    let (wire, text, bytes) = match definition.wires {
        Wires::Ros2 => (Wire::Cdr, definition.ros2_definition(), cdr::to_bytes(message).ok()?),
        _ => (Wire::Ros1, definition.ros1_definition(), ros1::to_bytes(message, 0).ok()?),
    };
    let kind = RawType { type_name: M::type_name(), definition: text.to_owned(), wire };
    Some(Raw { kind: Arc::new(kind), bytes })
}

impl BusState {
    /// Who takes this message as bytes, and those.
    fn raw_deliveries(&self, topic: &str, raw: impl FnOnce() -> Option<Raw>) -> Vec<(Arc<Slot>, Payload)> {
        let Some(listeners) = self.listeners.get(topic).filter(|listeners| !listeners.is_empty()) else {
            return Vec::new();
        };
        let Some(raw) = raw() else { return Vec::new() };
        let payload: Payload = Arc::new(raw);
        listeners.iter().map(|(_, slot)| (slot.clone(), payload.clone())).collect()
    }

    fn topic<M: Message>(&mut self, name: &str) -> Result<&mut Topic> {
        let topic = self.topics.entry(name.to_owned()).or_insert_with(|| Topic {
            type_id: TypeId::of::<M>(),
            type_name: M::type_name(),
            md5: M::ros1_md5(),
            latched: None,
            as_raw: as_raw::<M>,
            publishers: 0,
            subscribers: Vec::new(),
        });
        if topic.type_id == TypeId::of::<M>() {
            return Ok(topic);
        }
        let (carries, wanted) = (&topic.type_name, M::type_name());
        let reason = if *carries == wanted {
            format!("it carries {wanted} with other fields (md5 {}, not {})", topic.md5, M::ros1_md5())
        } else {
            format!("it carries {carries}, not {wanted}; check the topic's name")
        };
        Err(Error::Topic { topic: name.to_owned(), reason })
    }

    /// Removes a topic that nobody uses.
    fn prune(&mut self, name: &str) {
        if self.topics.get(name).is_some_and(|topic| topic.publishers == 0 && topic.subscribers.is_empty()) {
            self.topics.remove(name);
        }
    }
}

/// A publisher on a [`super::Loopback`].
pub struct LoopbackPublisher<M> {
    bus: Arc<Bus>,
    topic: String,
    qos: Qos,
    id: u64,
    message: PhantomData<fn(M)>,
}

impl<M: Message> LoopbackPublisher<M> {
    pub(super) fn new(bus: &Arc<Bus>, topic: String, qos: Qos) -> Result<Self> {
        bus.lock().topic::<M>(&topic)?.publishers += 1;
        Ok(Self { id: bus.id(), bus: bus.clone(), topic, qos, message: PhantomData })
    }
}

/// Hands messages over: later, in lockstep, otherwise now.
fn deliver(bus: &Bus, mut state: MutexGuard<'_, BusState>, deliveries: Vec<(Arc<Slot>, Payload)>) {
    if bus.lockstep {
        state.deliveries.extend(deliveries);
        return;
    }
    // Queued under the lock of the bus, so all subscribers see the same order.
    deliveries.iter().for_each(|(slot, payload)| slot.push(payload.clone()));
    drop(state);
    deliveries.iter().for_each(|(slot, _)| slot.run());
}

/// Sends a message of any type to those who listen to a topic for bytes.
pub(super) fn publish_raw(bus: &Bus, topic: &str, message: Raw) {
    let state = bus.lock();
    let deliveries = state.raw_deliveries(topic, || Some(message));
    deliver(bus, state, deliveries);
}

impl<M: Message> Publish<M> for LoopbackPublisher<M> {
    fn publish(&self, message: &M) -> Result<()> {
        let mut state = self.bus.lock();
        let is_heard = state.listeners.contains_key(&self.topic);
        let topic = state.topic::<M>(&self.topic)?;
        if topic.subscribers.is_empty() && self.qos != Qos::Latched && !is_heard {
            return Ok(());
        }
        let payload: Payload = Arc::new(message.clone());
        if self.qos == Qos::Latched {
            topic.latched = Some((self.id, payload.clone()));
        }
        let mut deliveries: Vec<_> =
            topic.subscribers.iter().map(|(_, slot)| (slot.clone(), payload.clone())).collect();
        deliveries.extend(state.raw_deliveries(&self.topic, || as_raw::<M>(&payload)));
        deliver(&self.bus, state, deliveries);
        Ok(())
    }

    fn subscriber_count(&self) -> usize {
        self.bus.lock().topics.get(&self.topic).map_or(0, |topic| topic.subscribers.len())
    }
}

impl<M> Drop for LoopbackPublisher<M> {
    fn drop(&mut self) {
        let mut state = self.bus.lock();
        if let Some(topic) = state.topics.get_mut(&self.topic) {
            topic.publishers -= 1;
            if topic.latched.as_ref().is_some_and(|(id, _)| *id == self.id) {
                topic.latched = None;
            }
        }
        state.prune(&self.topic);
    }
}

/// A subscription on a [`super::Loopback`].
pub struct LoopbackSubscription {
    bus: Arc<Bus>,
    topic: String,
    id: u64,
    slot: Arc<Slot>,
}

impl LoopbackSubscription {
    pub(super) fn new<M: Message>(bus: &Arc<Bus>, topic: String, callback: impl On<M>) -> Result<Self> {
        let (id, slot) = (bus.id(), Arc::new(Slot::new(callback)));
        let mut state = bus.lock();
        let entry = state.topic::<M>(&topic)?;
        entry.subscribers.push((id, slot.clone()));
        let latched = entry.latched.iter().map(|(_, payload)| (slot.clone(), payload.clone())).collect();
        deliver(bus, state, latched);
        Ok(Self { bus: bus.clone(), topic, id, slot })
    }

    /// A subscription to messages of any type.
    pub(super) fn listen(bus: &Arc<Bus>, topic: String, callback: impl On<Raw>) -> Self {
        let (id, slot) = (bus.id(), Arc::new(Slot::new(callback)));
        let mut state = bus.lock();
        state.listeners.entry(topic.clone()).or_default().push((id, slot.clone()));
        let latched = state.topics.get(&topic).and_then(|entry| (entry.as_raw)(&entry.latched.as_ref()?.1));
        let latched = latched.map(|raw| (slot.clone(), Arc::new(raw) as Payload));
        deliver(bus, state, latched.into_iter().collect());
        Self { bus: bus.clone(), topic, id, slot }
    }
}

impl Drop for LoopbackSubscription {
    fn drop(&mut self) {
        let mut state = self.bus.lock();
        if let Some(topic) = state.topics.get_mut(&self.topic) {
            topic.subscribers.retain(|(id, _)| *id != self.id);
        }
        state.prune(&self.topic);
        if let Some(listeners) = state.listeners.get_mut(&self.topic) {
            listeners.retain(|(id, _)| *id != self.id);
            if listeners.is_empty() {
                state.listeners.remove(&self.topic);
            }
        }
        drop(state);
        self.slot.end();
    }
}
