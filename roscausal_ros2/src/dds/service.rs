//! Services: those that a node offers.

use std::sync::{Arc, Weak};

use futures::{
    FutureExt, StreamExt, channel::oneshot, future::AbortHandle, select, stream::FuturesUnordered,
};
use ros2_client::{Message as Carry, Name, QosProfile, ServiceMapping, ServiceTypeName, qos::History};
use roscausal_core::gate::{Gate, lock};
use roscausal_core::middleware::{Answers, Reply};
use roscausal_core::{Error, Result};
use roscausal_msgs::{Message, Service};
use serde::{Deserialize, Serialize};
use tracing::warn;

use super::Participant;

/// Requests that wait to be read: as many callers may ask at once.
const REQUESTS: usize = 100;
/// Answers that are kept for who has not got them; they may be large.
const ANSWERS: usize = 10;

/// A message of ours as the library wants it for services.
#[derive(Clone, Serialize, Deserialize)]
#[serde(transparent)]
pub(super) struct Carried<M>(pub(super) M);

impl<M: Message> Carry for Carried<M> {}

/// What a question or an answer is made of.
pub(crate) trait Content: Carry + Clone + Send + 'static {}

impl<T: Carry + Clone + Send + 'static> Content for T {}

/// A service of a [`crate::Ros2`]. Dropping it ends the service.
pub struct Server {
    participant: Weak<Participant>,
    service: String,
    gate: Arc<Gate>,
    task: AbortHandle,
}

impl Participant {
    /// Offers a service for as long as the result lives. Relative names are resolved.
    ///
    /// # Errors
    /// An illegal name, one that this node offers already, or a node that has left.
    pub(crate) fn serve<S: Service>(
        self: &Arc<Self>,
        name: &str,
        mut callback: impl Answers<S>,
    ) -> Result<Server> {
        let service = self.service_name(name)?;
        let fail = |reason: String| Error::Service { service: service.clone(), reason };
        let full = Name::parse(&service).map_err(|error| fail(error.to_string()))?;
        if !lock(&self.services).insert(service.clone()) {
            return Err(fail("this node offers it already".to_owned()));
        }
        let gate = Arc::new(Gate::default());
        let own = gate.clone();
        let ask = move |request: Carried<S::Request>, reply: Reply<Carried<S::Response>>| {
            let reply = Reply::new(move |answer| {
                if let Ok(answer) = answer {
                    reply.send(Carried(answer));
                }
            });
            own.pass(|| callback(request.0, reply));
        };
        let kind = ServiceTypeName::new(S::PACKAGE, S::NAME);
        let task = self.offer(&full, &service, &kind, ask).inspect_err(|_| {
            lock(&self.services).remove(&service);
        })?;
        self.announce();
        Ok(Server { participant: Arc::downgrade(self), service, gate, task })
    }

    /// Offers the service `name` of this node, of the type `rcl_interfaces/kind`, as long as the node lives. Each
    /// request is answered with what `handle` makes of it, on the thread on which all that comes is read.
    ///
    /// # Errors
    /// If the library refuses, or the node has left.
    pub(crate) fn serve_at_once<Req: Content, Resp: Content>(
        &self,
        name: &str,
        kind: &str,
        handle: impl Fn(Req) -> Option<Resp> + Send + 'static,
    ) -> Result<()> {
        let failed = |reason: String| Error::Middleware(format!("service {name}: {reason}"));
        let full = Name::new(&self.names.full_name(), name).map_err(|error| failed(error.to_string()))?;
        let kind = ServiceTypeName::new("rcl_interfaces", kind);
        let answer = move |request, reply: Reply<Resp>| {
            if let Some(response) = handle(request) {
                reply.send(response);
            }
        };
        self.offer::<Req, Resp>(&full, name, &kind, answer).map(drop)
    }

    /// Reads requests until the task is aborted. Any number of them may wait for their answer.
    fn offer<Req: Content, Resp: Content>(
        &self,
        full: &Name,
        name: &str,
        kind: &ServiceTypeName,
        mut ask: impl FnMut(Req, Reply<Resp>) + Send + 'static,
    ) -> Result<AbortHandle> {
        let server = self.session(|session| {
            session.node.create_server::<Req, Resp>(mapping(), full, kind, requests(), answers())
        })?;
        let server =
            server.map_err(|error| Error::Service { service: name.to_owned(), reason: error.to_string() })?;
        let name = name.to_owned();
        Ok(self.spinner.spawn(format!("service {name}"), move || async move {
            let mut requests = server.receive_request_stream();
            let mut open = FuturesUnordered::new();
            loop {
                select! {
                    request = requests.next() => match request {
                        Some(Ok((id, request))) => {
                            let (sender, answer) = oneshot::channel();
                            ask(request, Reply::new(move |answer| drop(sender.send(answer))));
                            open.push(answer.map(move |answer| (id, answer)));
                        }
                        Some(Err(error)) => warn!("service {name}: a request was not understood: {error}"),
                        None => return,
                    },
                    // ROS 2 has no way to say that there is no answer.
                    (id, answer) = open.select_next_some() => if let Ok(Ok(answer)) = answer
                        && let Err(error) = server.async_send_response(id, answer).await
                    {
                        warn!("service {name}: an answer was not sent: {error}");
                    },
                }
            }
        }))
    }

    /// The full name of a service.
    ///
    /// # Errors
    /// An illegal name.
    pub(super) fn service_name(&self, name: &str) -> Result<String> {
        self.names.resolve(name).map_err(|error| match error {
            Error::Topic { topic, reason } => Error::Service { service: topic, reason },
            other => other,
        })
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.gate.close();
        self.task.abort();
        if let Some(participant) = self.participant.upgrade() {
            lock(&participant.services).remove(&self.service);
        }
    }
}

/// Reliable, with a history for questions that come at once.
pub(super) fn requests() -> QosProfile {
    QosProfile::publisher_default().history(History::KeepLast { depth: REQUESTS })
}

/// The same for answers.
pub(super) fn answers() -> QosProfile {
    QosProfile::publisher_default().history(History::KeepLast { depth: ANSWERS })
}

/// Fast DDS and Cyclone DDS carry the identity of a request in different places.
pub(super) fn mapping() -> ServiceMapping {
    match std::env::var("RMW_IMPLEMENTATION").as_deref() {
        Ok("rmw_cyclonedds_cpp") => ServiceMapping::Cyclone,
        _ => ServiceMapping::Enhanced,
    }
}
