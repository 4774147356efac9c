//! Services of a bus.

use std::{
    any::TypeId,
    sync::{Arc, Mutex, mpsc},
    thread,
    time::{Duration, Instant},
};

use roscausal_msgs::Service;

use super::{
    Bus,
    topics::{Payload, Slot},
};
use crate::{Error, Result, gate::lock, middleware::Reply};

/// How often a caller looks for a service that is not there yet, or for its turn to drive the bus.
const LOOK_AGAIN: Duration = Duration::from_millis(1);

/// A service on a bus.
pub(super) struct Offer {
    id: u64,
    type_id: TypeId,
    type_name: String,
    slot: Arc<Slot>,
}

/// A question on its way to its service.
struct Question<S: Service> {
    request: S::Request,
    reply: Mutex<Option<Reply<S::Response>>>,
}

/// A service of a [`super::LoopbackNode`].
pub struct LoopbackServer {
    bus: Arc<Bus>,
    service: String,
    id: u64,
    slot: Arc<Slot>,
}

impl LoopbackServer {
    pub(super) fn new<S: Service>(
        bus: &Arc<Bus>,
        service: String,
        mut callback: impl FnMut(S::Request, Reply<S::Response>) + Send + 'static,
    ) -> Result<Self> {
        let slot = Arc::new(Slot::of(move |payload| {
            let question = payload.downcast::<Question<S>>().ok();
            if let Some((question, reply)) =
                question.and_then(|q| lock(&q.reply).take().map(|r| (q.clone(), r)))
            {
                callback(question.request.clone(), reply);
            }
        }));
        let id = bus.id();
        let mut state = bus.lock();
        if state.services.contains_key(&service) {
            let reason = "a node of this bus offers it already".to_owned();
            return Err(Error::Service { service, reason });
        }
        let (type_id, type_name) = (TypeId::of::<S>(), S::type_name());
        state.services.insert(service.clone(), Offer { id, type_id, type_name, slot: slot.clone() });
        drop(state);
        Ok(Self { bus: bus.clone(), service, id, slot })
    }
}

impl Drop for LoopbackServer {
    fn drop(&mut self) {
        let mut state = self.bus.lock();
        if state.services.get(&self.service).is_some_and(|offer| offer.id == self.id) {
            state.services.remove(&self.service);
        }
        drop(state);
        self.slot.end();
    }
}

/// Asks a service. In lockstep the question is an event like a message, and the caller drives the bus.
pub(super) fn call<S: Service>(
    bus: &Arc<Bus>,
    service: String,
    request: &S::Request,
    patience: Duration,
) -> Result<S::Response> {
    let until = Instant::now() + patience;
    let fail = |reason: String| Error::Service { service: service.clone(), reason };
    let late = || fail(format!("no answer within {} s", patience.as_secs_f64()));
    let slot = find::<S>(bus, &service, until).map_err(fail)?;
    let (sender, receiver) = mpsc::channel();
    let reply = Reply::new(move |answer| drop(sender.send(answer)));
    let question = Question::<S> { request: request.clone(), reply: Mutex::new(Some(reply)) };
    let payload: Payload = Arc::new(question);
    if bus.lockstep {
        bus.lock().deliveries.push_back((slot, payload));
        loop {
            match bus.try_drive() {
                Some(_driving) => break bus.settle(),
                None if Instant::now() >= until => return Err(late()),
                None => thread::sleep(LOOK_AGAIN),
            }
        }
    } else {
        slot.push(payload);
        slot.run();
        drop(slot);
    }
    match receiver.recv_timeout(until.saturating_duration_since(Instant::now())) {
        Ok(answer) => answer.map_err(fail),
        Err(mpsc::RecvTimeoutError::Timeout) => Err(late()),
        // The service ended before it took the question.
        Err(mpsc::RecvTimeoutError::Disconnected) => Err(fail("the node ends".to_owned())),
    }
}

/// The slot of a service, once it is there.
fn find<S: Service>(bus: &Bus, service: &str, until: Instant) -> std::result::Result<Arc<Slot>, String> {
    loop {
        if let Some(offer) = bus.lock().services.get(service) {
            let (own, wanted) = (&offer.type_name, S::type_name());
            return match offer.type_id == TypeId::of::<S>() {
                true => Ok(offer.slot.clone()),
                false => Err(format!("it is a {own}, not a {wanted}; check the service's name")),
            };
        }
        if bus.lockstep || Instant::now() >= until {
            return Err("nobody offers it".to_owned());
        }
        thread::sleep(LOOK_AGAIN);
    }
}
