//! Topics of a bus: publishers, subscribers, and the last latched message.

use std::{
    any::{Any, TypeId},
    collections::VecDeque,
    marker::PhantomData,
    sync::{Arc, Mutex},
};

use super::{Bus, BusState};
use crate::{
    Error, Message, Result,
    gate::{Gate, lock},
    middleware::{Publish, Qos},
};

pub(super) type Payload = Arc<dyn Any + Send + Sync>;
type Callback = Box<dyn FnMut(Payload) + Send>;

pub(super) struct Topic {
    type_id: TypeId,
    pub(super) type_name: String,
    md5: &'static str,
    latched: Option<(u64, Payload)>,
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
    fn new<M: Message>(mut callback: impl FnMut(M) + Send + 'static) -> Self {
        Self::of(move |payload| {
            if let Ok(message) = payload.downcast::<M>() {
                callback(Arc::unwrap_or_clone(message));
            }
        })
    }

    /// A slot for whatever is pushed.
    pub(super) fn of(callback: impl FnMut(Payload) + Send + 'static) -> Self {
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

impl BusState {
    fn topic<M: Message>(&mut self, name: &str) -> Result<&mut Topic> {
        let topic = self.topics.entry(name.to_owned()).or_insert_with(|| Topic {
            type_id: TypeId::of::<M>(),
            type_name: M::type_name(),
            md5: M::ros1_md5(),
            latched: None,
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

impl<M: Message> Publish<M> for LoopbackPublisher<M> {
    fn publish(&self, message: &M) -> Result<()> {
        let slots: Vec<Arc<Slot>> = {
            let mut state = self.bus.lock();
            let topic = state.topic::<M>(&self.topic)?;
            if topic.subscribers.is_empty() && self.qos != Qos::Latched {
                return Ok(());
            }
            let payload: Payload = Arc::new(message.clone());
            if self.qos == Qos::Latched {
                topic.latched = Some((self.id, payload.clone()));
            }
            let slots: Vec<_> = topic.subscribers.iter().map(|(_, slot)| slot.clone()).collect();
            if self.bus.lockstep {
                state.deliveries.extend(slots.into_iter().map(|slot| (slot, payload.clone())));
                return Ok(());
            }
            // Queued under the lock of the bus, so all subscribers see the same order.
            slots.iter().for_each(|slot| slot.push(payload.clone()));
            slots
        };
        slots.iter().for_each(|slot| slot.run());
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
    pub(super) fn new<M: Message>(
        bus: &Arc<Bus>,
        topic: String,
        callback: impl FnMut(M) + Send + 'static,
    ) -> Result<Self> {
        let (id, slot) = (bus.id(), Arc::new(Slot::new(callback)));
        {
            let mut state = bus.lock();
            let entry = state.topic::<M>(&topic)?;
            entry.subscribers.push((id, slot.clone()));
            match entry.latched.as_ref().map(|(_, payload)| payload.clone()) {
                Some(payload) if bus.lockstep => state.deliveries.push_back((slot.clone(), payload)),
                Some(payload) => slot.push(payload),
                None => (),
            }
        }
        slot.run();
        Ok(Self { bus: bus.clone(), topic, id, slot })
    }
}

impl Drop for LoopbackSubscription {
    fn drop(&mut self) {
        {
            let mut state = self.bus.lock();
            if let Some(topic) = state.topics.get_mut(&self.topic) {
                topic.subscribers.retain(|(id, _)| *id != self.id);
            }
            state.prune(&self.topic);
        }
        self.slot.end();
    }
}
