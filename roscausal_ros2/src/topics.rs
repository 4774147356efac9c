//! Publishers and subscriptions.

use std::{
    collections::HashMap,
    pin::pin,
    sync::{
        Arc, Mutex, Weak,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    time::{Duration, Instant},
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

/// After so long the library has trimmed a history to what its readers have not acknowledged; it does so every 6 s.
const TRIMMED: Duration = Duration::from_secs(7);
/// The most messages in the history of a latched topic, when a subscriber acknowledges none.
const MOST_KEPT: usize = 20;
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
/// one is trimmed only to what all its readers have acknowledged, and a late joiner gets all of it.
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
            self.renew(inner)?;
        }
        self.sent += 1;
        match self.publisher.publish(Padded::new(message, inner.secured)) {
            Ok(()) => Ok(true),
            Err(WriteError::WouldBlock { .. }) => Ok(false),
            Err(error) => Err(Error::Topic { topic: self.topic.name(), reason: error.to_string() }),
        }
    }

    /// Begins a history anew. Fast DDS goes on counting the publisher that was.
    fn renew(&mut self, inner: &Inner) -> Result<()> {
        let old = self.guid();
        self.publisher = Self::publisher(inner, &self.topic, &self.profile)?;
        inner.graph.remove(old);
        self.sent = 0;
        Ok(())
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
    shared: Arc<Shared<M>>,
    refused: AtomicU64,
    said_large: AtomicBool,
}

struct Shared<M: Message> {
    inner: Arc<Inner>,
    topic: String,
    qos: Qos,
    latch: Mutex<Latch<M>>,
}

/// The library's publisher and, on a latched topic, what it has yet to send.
struct Latch<M: Message> {
    writer: Writer<M>,
    /// The last message, for as long as nobody has asked for it.
    unsent: Option<M>,
    last_sent: Option<Instant>,
}

impl<M: Message> Ros2Publisher<M> {
    pub(crate) fn new(inner: &Arc<Inner>, topic: &str, qos: Qos) -> Result<Self> {
        let topic = inner.names.resolve(topic)?;
        let dds_topic = inner.topic::<M>(&topic, qos)?;
        let dds_name = dds_topic.name();
        let renew_after = if qos == Qos::Latched && inner.renews() { MOST_KEPT } else { usize::MAX };
        let writer = Writer::new(inner, dds_topic, profile(qos, Side::Publisher), renew_after)?;
        let latch = Mutex::new(Latch { writer, unsent: None, last_sent: None });
        let shared = Arc::new(Shared { inner: inner.clone(), topic, qos, latch });
        if qos == Qos::Latched {
            let shared: Arc<dyn Latched> = shared.clone();
            inner.graph.add_latched(dds_name, Arc::downgrade(&shared));
        }
        Ok(Self { shared, refused: AtomicU64::new(0), said_large: AtomicBool::new(false) })
    }

    /// Messages not sent so far, because a reliable subscriber did not acknowledge the ones before.
    pub fn refused(&self) -> u64 {
        self.refused.load(Ordering::Relaxed)
    }

    fn warn_if_large(&self, message: &M) {
        if self.shared.qos != Qos::Latched || self.said_large.load(Ordering::Relaxed) {
            return;
        }
        let Ok(bytes) = CDRSerializerAdapter::<M>::to_bytes(message) else { return };
        if bytes.len() > LARGE_MESSAGE && !self.said_large.swap(true, Ordering::Relaxed) {
            warn!(
                "topic '{}': a message has {} kB; above {} kB a subscriber on Fast DDS with default socket buffers \
                 may get it only after seconds (set its listenSocketBufferSize, see docs/ros2.md)",
                self.shared.topic,
                bytes.len() / 1000,
                LARGE_MESSAGE / 1000
            );
        }
    }
}

impl<M: Message> Shared<M> {
    /// Sends to whoever listens. On a latched topic to which nobody listens the message waits for who comes: a writer
    /// made anew for each would be one more publisher in the lists of all that run on Fast DDS.
    fn send(&self, message: M) -> Result<bool> {
        let mut latch = lock(&self.latch);
        if self.qos != Qos::Latched {
            return latch.writer.write(&self.inner, message);
        }
        let heard = |latch: &Latch<M>| self.inner.graph.matched(latch.writer.guid()) > 0;
        let (was_heard, untrimmed) =
            (heard(&latch), latch.last_sent.is_some_and(|last| last.elapsed() < TRIMMED));
        if latch.writer.sent > 0 && self.inner.renews() && (!was_heard || untrimmed) {
            latch.writer.renew(&self.inner)?;
        }
        latch.unsent = Some(message);
        // Who comes from here on is handed it.
        if was_heard || latch.writer.sent > 0 || heard(&latch) {
            latch.hand_over(&self.inner)
        } else {
            Ok(true)
        }
    }
}

impl<M: Message> Latch<M> {
    /// Sends what waits.
    fn hand_over(&mut self, inner: &Inner) -> Result<bool> {
        let Some(message) = self.unsent.take() else { return Ok(true) };
        self.last_sent = Some(Instant::now());
        self.writer.write(inner, message)
    }
}

/// A latched publisher whose last message may wait for a subscriber.
pub(crate) trait Latched: Send + Sync {
    /// A subscriber has come.
    fn hand_over(&self);
}

impl<M: Message> Latched for Shared<M> {
    fn hand_over(&self) {
        if let Err(error) = lock(&self.latch).hand_over(&self.inner) {
            warn!("topic '{}': its last message could not be sent: {error}", self.topic);
        }
    }
}

impl<M: Message> Publish<M> for Ros2Publisher<M> {
    fn publish(&self, message: &M) -> Result<()> {
        self.warn_if_large(message);
        if !self.shared.send(message.clone())? {
            let refused = self.refused.fetch_add(1, Ordering::Relaxed) + 1;
            // The 1st, 10th, 100th ...: enough to be seen, too few to flood.
            if 10u64.pow(refused.ilog10()) == refused {
                warn!(
                    "topic '{}': {refused} messages not sent so far, a reliable subscriber does not acknowledge",
                    self.shared.topic
                );
            }
        }
        Ok(())
    }

    fn subscriber_count(&self) -> usize {
        let Shared { inner, topic, qos, latch } = &*self.shared;
        match qos {
            // Its writer may just be made anew, and for a moment matched with nobody.
            Qos::Latched => inner.session(|session| session.node.subscription_count(topic)).unwrap_or(0),
            Qos::Volatile(_) => inner.graph.matched(lock(latch).writer.guid()),
        }
    }
}

impl<M: Message> Drop for Shared<M> {
    fn drop(&mut self) {
        self.inner.graph.remove(lock(&self.latch).writer.guid());
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
