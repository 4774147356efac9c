//! Publishers, and what a latched one has yet to send.

use std::{
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    time::{Duration, Instant},
};

use roscausal_core::{
    Message, Result,
    gate::lock,
    middleware::{Publish, Qos},
};
use rustdds::{TopicDescription, no_key::SerializerAdapter, serialization::CDRSerializerAdapter};
use tracing::warn;

use super::{
    Participant, Writer,
    qos::{self, Side},
};

/// After so long the library has trimmed a history to what its readers have not acknowledged; it does so every 6 s.
const TRIMMED: Duration = Duration::from_secs(7);
/// The most messages in the history of a latched topic, when a subscriber acknowledges none.
const MOST_KEPT: usize = 20;
/// Above this, Fast DDS with its default socket buffers repairs lost fragments slowly.
const LARGE_MESSAGE: usize = 200_000;

/// A topic's publisher.
pub struct Publisher<M: Message> {
    shared: Arc<Shared<M>>,
    /// Messages not sent so far, because a reliable subscriber did not acknowledge the ones before.
    refused: AtomicU64,
    said_large: AtomicBool,
}

struct Shared<M: Message> {
    participant: Arc<Participant>,
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

impl Participant {
    /// A publisher on a topic; relative names are resolved.
    ///
    /// # Errors
    /// An illegal name, another type than the topic's, a node that has left.
    pub(crate) fn advertise<M: Message>(self: &Arc<Self>, topic: &str, qos: Qos) -> Result<Publisher<M>> {
        let topic = self.names().resolve(topic)?;
        let dds_topic = self.topic::<M>(&topic, qos)?;
        let dds_name = dds_topic.name();
        let renew_after = if qos == Qos::Latched && self.renews() { MOST_KEPT } else { usize::MAX };
        let writer = Writer::new(self, dds_topic, qos::profile(qos, Side::Publisher), renew_after)?;
        let latch = Mutex::new(Latch { writer, unsent: None, last_sent: None });
        let shared = Arc::new(Shared { participant: self.clone(), topic, qos, latch });
        if qos == Qos::Latched {
            let shared: Arc<dyn Latched> = shared.clone();
            self.graph.add_latched(dds_name, Arc::downgrade(&shared));
        }
        Ok(Publisher { shared, refused: AtomicU64::new(0), said_large: AtomicBool::new(false) })
    }
}

impl<M: Message> Publisher<M> {
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
            return latch.writer.write(&self.participant, message);
        }
        let heard = |latch: &Latch<M>| self.participant.graph.matched(latch.writer.guid()) > 0;
        let (was_heard, untrimmed) =
            (heard(&latch), latch.last_sent.is_some_and(|last| last.elapsed() < TRIMMED));
        if latch.writer.sent > 0 && self.participant.renews() && (!was_heard || untrimmed) {
            latch.writer.renew(&self.participant)?;
        }
        latch.unsent = Some(message);
        // Who comes from here on is handed it.
        if was_heard || latch.writer.sent > 0 || heard(&latch) {
            latch.hand_over(&self.participant)
        } else {
            Ok(true)
        }
    }
}

impl<M: Message> Latch<M> {
    /// Sends what waits.
    fn hand_over(&mut self, participant: &Participant) -> Result<bool> {
        let Some(message) = self.unsent.take() else { return Ok(true) };
        self.last_sent = Some(Instant::now());
        self.writer.write(participant, message)
    }
}

/// A latched publisher whose last message may wait for a subscriber.
pub(crate) trait Latched: Send + Sync {
    /// A subscriber has come.
    fn hand_over(&self);
}

impl<M: Message> Latched for Shared<M> {
    fn hand_over(&self) {
        if let Err(error) = lock(&self.latch).hand_over(&self.participant) {
            warn!("topic '{}': its last message could not be sent: {error}", self.topic);
        }
    }
}

impl<M: Message> Publish<M> for Publisher<M> {
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
        let Shared { participant, topic, qos, latch } = &*self.shared;
        match qos {
            // Its writer may just be made anew, and for a moment matched with nobody.
            Qos::Latched => {
                participant.session(|session| session.node.subscription_count(topic)).unwrap_or(0)
            }
            Qos::Volatile(_) => participant.graph.matched(lock(latch).writer.guid()),
        }
    }
}

impl<M: Message> Drop for Shared<M> {
    fn drop(&mut self) {
        self.participant.graph.remove(lock(&self.latch).writer.guid());
    }
}
