//! Publishers and subscriptions.

use std::{
    collections::HashMap,
    pin::pin,
    sync::{
        Arc, Mutex, Weak,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
};

use futures::{StreamExt, future::AbortHandle};
use ros2_client::{
    Gid, QosProfile, ReadError, WriteError,
    qos::{Durability, History, WhenFull},
};
use roscausal_core::{
    Error, Message, Result,
    gate::Gate,
    middleware::{Publish, Qos},
};
use roscausal_ros::lock;
use rustdds::{
    GUID, Topic, TopicDescription, no_key::SerializerAdapter, serialization::CDRSerializerAdapter,
};
use serde::{Serialize, Serializer, ser::SerializeTuple};
use tracing::{error, warn};

use crate::{
    graph::{Graph, sent_type},
    node::Inner,
};

/// Above this, Fast DDS with its default socket buffers repairs lost fragments slowly.
const LARGE_MESSAGE: usize = 200_000;

#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Side {
    Publisher,
    Subscriber,
}

/// Volatile topics: reliable publishers that never wait, best-effort subscribers, so that either matches
/// anything. Latched topics: reliable and transient local, depth 1.
pub(crate) fn profile(qos: Qos, side: Side) -> QosProfile {
    let reliable = QosProfile::publisher_default().reliability_reliable(WhenFull::Fail);
    match (qos, side) {
        (Qos::Latched, _) => {
            reliable.durability(Durability::TransientLocal).history(History::KeepLast { depth: 1 })
        }
        (Qos::Volatile(depth), Side::Publisher) => {
            reliable.history(History::KeepLast { depth: depth.max(1) })
        }
        (Qos::Volatile(depth), Side::Subscriber) => {
            QosProfile::subscription_default().history(History::KeepLast { depth: depth.max(1) })
        }
    }
}

/// A publisher of the library that is made anew after a number of messages: the history of a transient local
/// one is never trimmed, and a late joiner gets all of it.
pub(crate) struct Writer<M: Serialize> {
    topic: Topic,
    profile: QosProfile,
    renew_after: usize,
    sent: usize,
    publisher: ros2_client::Publisher<Padded<M>>,
}

impl<M: Serialize> Writer<M> {
    pub(crate) fn new(inner: &Inner, topic: Topic, profile: QosProfile, renew_after: usize) -> Result<Self> {
        let publisher = Self::publisher(inner, &topic, &profile)?;
        Ok(Self { topic, profile, renew_after, sent: 0, publisher })
    }

    fn publisher(
        inner: &Inner,
        topic: &Topic,
        profile: &QosProfile,
    ) -> Result<ros2_client::Publisher<Padded<M>>> {
        let made = inner.session(|session| session.node.create_publisher(topic, Some(profile.clone())))?;
        let publisher =
            made.map_err(|error| Error::Topic { topic: topic.name(), reason: error.to_string() })?;
        inner.graph.add(publisher.guid(), &topic.name(), topic.get_type().name());
        inner.announce();
        Ok(publisher)
    }

    /// Sends; `false` when a reliable subscriber is too far behind to take it.
    pub(crate) fn write(&mut self, inner: &Inner, message: M) -> Result<bool> {
        if self.sent >= self.renew_after {
            let old = self.guid();
            self.publisher = Self::publisher(inner, &self.topic, &self.profile)?;
            inner.graph.remove(old);
            self.sent = 0;
        }
        self.sent += 1;
        match self.publisher.publish(Padded::new(message, inner.secured)) {
            Ok(()) => Ok(true),
            Err(WriteError::WouldBlock { .. }) => Ok(false),
            Err(error) => Err(Error::Topic { topic: self.topic.name(), reason: error.to_string() }),
        }
    }

    fn guid(&self) -> GUID {
        self.publisher.guid()
    }
}

/// A message with up to three zeros behind it, which a reader leaves unread. The library pads what it sends to a multiple of
/// four bytes *after* it encrypted the content, and looks for the signature from the padded end: only content that needs
/// no padding can be decrypted.
struct Padded<M> {
    message: M,
    zeros: usize,
}

impl<M: Serialize> Padded<M> {
    fn new(message: M, secured: bool) -> Self {
        let length =
            if secured { CDRSerializerAdapter::<M>::to_bytes(&message).map_or(0, |b| b.len()) } else { 0 };
        Self { message, zeros: length.wrapping_neg() % 4 }
    }
}

impl<M: Serialize> Serialize for Padded<M> {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        let mut parts = serializer.serialize_tuple(1 + self.zeros)?;
        parts.serialize_element(&self.message)?;
        (0..self.zeros).try_for_each(|_| parts.serialize_element(&0_u8))?;
        parts.end()
    }
}

/// A topic's publisher.
pub struct Ros2Publisher<M: Message> {
    inner: Arc<Inner>,
    topic: String,
    qos: Qos,
    writer: Mutex<Writer<M>>,
    refused: AtomicU64,
    said_large: AtomicBool,
}

impl<M: Message> Ros2Publisher<M> {
    pub(crate) fn new(inner: &Arc<Inner>, topic: &str, qos: Qos) -> Result<Self> {
        let topic = inner.names.resolve(topic)?;
        let dds_topic = inner.topic::<M>(&topic, qos)?;
        // The library's security knows one publisher of each topic and node, so there it stays: who comes late gets all
        // that it sent, the last one last.
        let renew_after = if qos == Qos::Latched && !inner.secured { 1 } else { usize::MAX };
        let writer = Writer::new(inner, dds_topic, profile(qos, Side::Publisher), renew_after)?;
        let (inner, writer) = (inner.clone(), Mutex::new(writer));
        Ok(Self { inner, topic, qos, writer, refused: AtomicU64::new(0), said_large: AtomicBool::new(false) })
    }

    /// Messages not sent so far, because a reliable subscriber did not acknowledge the ones before.
    pub fn refused(&self) -> u64 {
        self.refused.load(Ordering::Relaxed)
    }

    fn warn_if_large(&self, message: &M) {
        if self.qos != Qos::Latched || self.said_large.load(Ordering::Relaxed) {
            return;
        }
        let Ok(bytes) = CDRSerializerAdapter::<M>::to_bytes(message) else { return };
        if bytes.len() > LARGE_MESSAGE && !self.said_large.swap(true, Ordering::Relaxed) {
            warn!(
                "topic '{}': a message has {} kB; above {} kB a subscriber on Fast DDS with default socket buffers \
                 may get it only after seconds (set its listenSocketBufferSize, see docs/ros2.md)",
                self.topic,
                bytes.len() / 1000,
                LARGE_MESSAGE / 1000
            );
        }
    }
}

impl<M: Message> Publish<M> for Ros2Publisher<M> {
    fn publish(&self, message: &M) -> Result<()> {
        self.warn_if_large(message);
        let sent = lock(&self.writer).write(&self.inner, message.clone())?;
        if !sent {
            let refused = self.refused.fetch_add(1, Ordering::Relaxed) + 1;
            // The 1st, 10th, 100th ...: enough to be seen, too few to flood.
            if 10u64.pow(refused.ilog10()) == refused {
                warn!(
                    "topic '{}': {refused} messages not sent so far, a reliable subscriber does not acknowledge",
                    self.topic
                );
            }
        }
        Ok(())
    }

    fn subscriber_count(&self) -> usize {
        match self.qos {
            // Its writer is made anew with each message, and for a moment matched with nobody.
            Qos::Latched => {
                self.inner.session(|session| session.node.subscription_count(&self.topic)).unwrap_or(0)
            }
            Qos::Volatile(_) => self.inner.graph.matched(lock(&self.writer).guid()),
        }
    }
}

impl<M: Message> Drop for Ros2Publisher<M> {
    fn drop(&mut self) {
        self.inner.graph.remove(lock(&self.writer).guid());
    }
}

/// A subscription; dropping it ends it, and no callback runs afterwards.
pub struct Ros2Subscription {
    gate: Arc<Gate>,
    task: AbortHandle,
}

impl Drop for Ros2Subscription {
    fn drop(&mut self) {
        self.task.abort();
        self.gate.close();
    }
}

pub(crate) fn subscribe<M: Message>(
    inner: &Arc<Inner>,
    topic: &str,
    qos: Qos,
    mut callback: impl FnMut(M) + Send + 'static,
) -> Result<Ros2Subscription> {
    let topic = inner.names.resolve(topic)?;
    let dds_topic = inner.topic::<M>(&topic, qos)?;
    let profile = profile(qos, Side::Subscriber);
    let made = inner.session(|session| session.node.create_subscription::<M>(&dds_topic, Some(profile)))?;
    let fail =
        |error: ros2_client::CreateError| Error::Topic { topic: topic.clone(), reason: error.to_string() };
    let reader = made.map_err(fail)?;
    inner.graph.add(reader.guid(), &dds_topic.name(), dds_topic.get_type().name());
    inner.announce();
    let gate = Arc::new(Gate::default());
    let its_gate = gate.clone();
    let deliver = move |message: M| its_gate.pass(|| callback(message));
    let registered = Registered { graph: inner.graph.clone(), guid: reader.guid() };
    let (node, kind) = (Arc::downgrade(inner), dds_topic.get_type().name().to_owned());
    let task = inner.spinner.spawn(format!("topic '{topic}'"), move || async move {
        let _registered = registered;
        read(reader, topic, Senders { node, kind, known: HashMap::new() }, deliver).await;
    });
    Ok(Ros2Subscription { gate, task })
}

/// Forgets a subscription's endpoint when its task is dropped.
struct Registered {
    graph: Arc<Graph>,
    guid: GUID,
}

impl Drop for Registered {
    fn drop(&mut self) {
        self.graph.remove(self.guid);
    }
}

/// Who sends on a topic. The library delivers what is sent under the topic's name, whatever its type, and some
/// types' bytes can be read as others.
struct Senders {
    node: Weak<Inner>,
    /// DDS name of the subscription's type.
    kind: String,
    known: HashMap<Gid, bool>,
}

impl Senders {
    /// Whether this publisher's messages are of the subscription's type.
    fn fits(&mut self, publisher: Gid) -> bool {
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
            // The graph has said so already.
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
