//! Subscriptions.

use std::sync::{Arc, OnceLock, Weak};
use std::{collections::HashMap, pin::pin};

use futures::{StreamExt, future::AbortHandle};
use ros2_client::{Gid, ReadError};
use roscausal_core::{Error, Message, Result, gate::Gate, middleware::Qos};
use rustdds::{GUID, TopicDescription};
use tracing::{error, warn};

use super::Participant;
use super::graph::{Graph, sent_type};
use super::qos::{self, Side};

/// A subscription. Dropping it ends it, and no callback runs afterwards.
pub struct Subscription {
    pub(super) gate: Arc<Gate>,
    /// What reads it; not there yet while a topic of any type has no publisher.
    pub(super) task: Arc<OnceLock<AbortHandle>>,
}

impl Subscription {
    /// A subscription that is not read yet.
    pub(super) fn waiting() -> Self {
        Self { gate: Arc::default(), task: Arc::default() }
    }
}

impl Drop for Subscription {
    fn drop(&mut self) {
        if let Some(task) = self.task.get() {
            task.abort();
        }
        self.gate.close();
    }
}

impl Participant {
    /// Calls back with each message of a topic, on the thread that reads all input.
    ///
    /// # Errors
    /// An illegal name, a type other than the topic's, or a node that has left.
    pub(crate) fn subscribe<M: Message>(
        self: &Arc<Self>,
        topic: &str,
        qos: Qos,
        mut callback: impl FnMut(M) + Send + 'static,
    ) -> Result<Subscription> {
        let topic = self.names.resolve(topic)?;
        let dds_topic = self.topic::<M>(&topic, qos)?;
        let profile = qos::profile(qos, Side::Subscriber);
        let made =
            self.session(|session| session.node.create_subscription::<M>(&dds_topic, Some(profile)))?;
        let reader =
            made.map_err(|error| Error::Topic { topic: topic.clone(), reason: error.to_string() })?;
        self.graph.add(reader.guid(), &dds_topic.name(), dds_topic.get_type().name());
        self.announce();
        let subscription = Subscription::waiting();
        let its_gate = subscription.gate.clone();
        let deliver = move |message: M| its_gate.pass(|| callback(message));
        let registered = Registered { graph: self.graph.clone(), guid: reader.guid() };
        let (node, kind) = (Arc::downgrade(self), dds_topic.get_type().name().to_owned());
        let task = self.spinner.spawn(format!("topic '{topic}'"), move || async move {
            let _registered = registered;
            read(reader, topic, Senders::new(node, kind), deliver).await;
        });
        subscription.task.get_or_init(|| task);
        Ok(subscription)
    }
}

/// Removes the endpoint of a subscription when its task is dropped.
struct Registered {
    graph: Arc<Graph>,
    guid: GUID,
}

impl Drop for Registered {
    fn drop(&mut self) {
        self.graph.remove(self.guid);
    }
}

/// The publishers of a topic. The library delivers whatever is sent under the name of the topic, of any type, and
/// the bytes of some types decode as others.
pub(super) struct Senders {
    node: Weak<Participant>,
    /// DDS name of the subscription's type.
    kind: String,
    known: HashMap<Gid, bool>,
}

impl Senders {
    pub(super) fn new(node: Weak<Participant>, kind: String) -> Self {
        Self { node, kind, known: HashMap::new() }
    }

    /// Whether the messages of this publisher have the type of the subscription.
    pub(super) fn fits(&mut self, publisher: Gid) -> bool {
        let (node, kind) = (&self.node, &self.kind);
        *self.known.entry(publisher).or_insert_with(|| {
            let sent =
                node.upgrade().and_then(|node| node.session(|s| sent_type(&s.context, publisher)).ok()?);
            sent.is_none_or(|sent| sent == *kind)
        })
    }
}

async fn read<M: Message>(
    reader: ros2_client::Subscription<M>,
    topic: String,
    mut senders: Senders,
    mut deliver: impl FnMut(M),
) {
    let mut messages = pin!(reader.async_stream());
    let mut illegible = 0u64;
    while let Some(message) = messages.next().await {
        match message {
            Ok((message, info)) if senders.fits(info.publisher_gid()) => deliver(message),
            // The graph has logged it already.
            Ok(_) => {}
            Err(ReadError::Deserialization { reason }) => {
                illegible += 1;
                if 10u64.pow(illegible.ilog10()) == illegible {
                    let kind = M::type_name();
                    warn!(
                        "topic '{topic}': {illegible} messages so far are no {kind} and were dropped ({reason})"
                    );
                }
            }
            Err(error) => {
                error!("topic '{topic}': no longer read: {error}");
                return;
            }
        }
    }
}
