//! Asking services of other nodes.

use std::any::{Any, TypeId};
use std::time::{Duration, Instant};
use std::{sync::Arc, thread};

use ros2_client::{Client, Name, ServiceTypeName};
use roscausal_core::{Error, Result, gate::lock};
use roscausal_msgs::Service;

use super::Participant;
use super::service::{Carried, answers, mapping, requests};

/// Time between two looks for a service, or for an answer.
const LOOK_AGAIN: Duration = Duration::from_millis(1);
/// How long the two ends of a service take to find each other once one sees the other. An answer that is sent before
/// is lost.
const ACQUAINTED: Duration = Duration::from_millis(200);

/// A question or its answer may be lost while the ends still find each other, also after the service has started anew.
/// So it is asked again after this time, then after twice as long, and so on.
const ASK_AGAIN: Duration = Duration::from_secs(1);

/// What was found, or what is in the way in words.
type Told<T> = std::result::Result<T, String>;

type Ends<S> = Client<Carried<<S as Service>::Request>, Carried<<S as Service>::Response>>;

/// A client of a service, for one question at a time.
struct Asker<S: Service> {
    client: Ends<S>,
    since: Instant,
}

impl Participant {
    /// Asks a service and waits for its answer, no longer than `patience`. Relative names are resolved.
    ///
    /// # Errors
    /// No such service in time, one of another type, one that gives no answer, or a node that has left.
    pub(crate) fn call<S: Service>(
        self: &Arc<Self>,
        name: &str,
        request: &S::Request,
        patience: Duration,
    ) -> Result<S::Response> {
        let until = Instant::now() + patience;
        let service = self.service_name(name)?;
        let asker = self.asker::<S>(&service)?;
        let answer = self.converse(&asker, &service, request, until);
        let answer = answer.map_err(|reason| Error::Service { service: service.clone(), reason });
        let key = (service, TypeId::of::<S>());
        lock(&self.askers.idle).entry(key).or_default().push(Box::new(asker));
        answer
    }

    /// A client that is idle, or a new one.
    fn asker<S: Service>(&self, service: &str) -> Result<Asker<S>> {
        let key = (service.to_owned(), TypeId::of::<S>());
        let idle = lock(&self.askers.idle).get_mut(&key).and_then(Vec::pop);
        if let Some(Ok(asker)) = idle.map(Box::<dyn Any + Send>::downcast::<Asker<S>>) {
            return Ok(*asker);
        }
        let fail = |reason: String| Error::Service { service: service.to_owned(), reason };
        let full = Name::parse(service).map_err(|error| fail(error.to_string()))?;
        let kind = ServiceTypeName::new(S::PACKAGE, S::NAME);
        let client = self
            .session(|session| session.node.create_client(mapping(), &full, &kind, requests(), answers()))?;
        let client = client.map_err(|error| fail(error.to_string()))?;
        self.announce();
        Ok(Asker { client, since: Instant::now() })
    }

    fn converse<S: Service>(
        &self,
        asker: &Asker<S>,
        service: &str,
        request: &S::Request,
        until: Instant,
    ) -> Told<S::Response> {
        while !self.is_acquainted(asker, service)? {
            pause(until).ok_or("nobody offers it")?;
        }
        let mut asked = Vec::new();
        let (mut again, mut pause_between) = (Instant::now(), ASK_AGAIN);
        loop {
            if Instant::now() >= again {
                asked.push(
                    asker.client.send_request(Carried(request.clone())).map_err(|error| error.to_string())?,
                );
                again += pause_between;
                pause_between *= 2;
            }
            match asker.client.receive_response().map_err(|error| error.to_string())? {
                Some((of, answer)) if asked.contains(&of) => return Ok(answer.0),
                // Late, to an earlier question of this client.
                Some(_) => {}
                None => pause(until).ok_or("no answer in time")?,
            }
        }
    }

    /// Whether the service is there, and both ends have had the time to find each other.
    fn is_acquainted<S: Service>(&self, asker: &Asker<S>, service: &str) -> Told<bool> {
        let readers = self.session(|session| session.context.domain_participant().discovered_readers());
        let readers = readers.map_err(|error| error.to_string())?;
        let (topic, now) = (format!("rq{service}Request"), Instant::now());
        let kind = format!("{}::srv::dds_::{}_Request_", S::PACKAGE, S::NAME);
        let mut seen = lock(&self.askers.seen);
        let mut old = false;
        for reader in &readers {
            let data = &reader.subscription_topic_data;
            if *data.topic_name() == topic && *data.type_name() == kind {
                let since = *seen.entry(reader.reader_proxy.remote_reader_guid).or_insert(now);
                old |= now - since.max(asker.since) >= ACQUAINTED;
            }
        }
        Ok(old)
    }
}

/// Sleeps for a moment; `None` if it is too late.
fn pause(until: Instant) -> Option<()> {
    (Instant::now() < until).then(|| thread::sleep(LOOK_AGAIN))
}
