//! Publishers, and what a latched publisher still has to send.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use roscausal_core::middleware::{Publish, Qos};
use roscausal_core::{Message, Result, gate::lock};
use rustdds::{TopicDescription, no_key::SerializerAdapter, serialization::CDRSerializerAdapter};
use tracing::warn;

use super::qos::{self, Side};
use super::{Participant, Writer, graph::Latched};

/// After this time the library has reduced a history to what its readers have not acknowledged. It does so every 6
/// s.
const TRIMMED: Duration = Duration::from_secs(7);
/// Most messages in the history of a latched topic if a subscriber acknowledges none.
const MOST_KEPT: usize = 20;
/// Above this size, Fast DDS with its default socket buffers is slow to repair lost fragments.
const LARGE_MESSAGE: usize = 200_000;

/// A topic's publisher.
pub struct Publisher<M: Message> {
    shared: Arc<Shared<M>>,
    /// Messages that were not sent because a reliable subscriber had not acknowledged earlier ones.
    refused: AtomicU64,
    said_large: AtomicBool,
}

struct Shared<M: Message> {
    participant: Arc<Participant>,
    topic: String,
    qos: Qos,
    latch: Mutex<Latch<M>>,
}

/// The library's publisher and, on a latched topic, what it still has to send.
struct Latch<M: Message> {
    writer: Writer<M>,
    /// The last message, as long as nobody has received it.
    unsent: Option<M>,
    last_sent: Option<Instant>,
}

impl Participant {
    /// A publisher on a topic. Relative names are resolved.
    ///
    /// # Errors
    /// An illegal name, a type other than the topic's, or a node that has left.
    pub(crate) fn advertise<M: Message>(self: &Arc<Self>, topic: &str, qos: Qos) -> Result<Publisher<M>> {
        let topic = self.names.resolve(topic)?;
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
            let (topic, size, large) = (&self.shared.topic, bytes.len() / 1000, LARGE_MESSAGE / 1000);
            warn!(
                "topic '{topic}': a message has {size} kB; above {large} kB a subscriber on Fast DDS with default socket \
                 buffers may get it only after seconds (set its listenSocketBufferSize, see docs/ros2.md)"
            );
        }
    }
}

impl<M: Message> Shared<M> {
    /// Sends to the current subscribers. On a latched topic without subscribers the message waits for the first
    /// one. A new writer for each message would add a publisher to the lists of all processes on Fast DDS.
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
        // A subscriber that comes from now on gets it through `hand_over`.
        if was_heard || latch.writer.sent > 0 || heard(&latch) {
            latch.hand_over(&self.participant)
        } else {
            Ok(true)
        }
    }
}

impl<M: Message> Latch<M> {
    /// Sends the waiting message.
    fn hand_over(&mut self, participant: &Participant) -> Result<bool> {
        let Some(message) = self.unsent.take() else { return Ok(true) };
        self.last_sent = Some(Instant::now());
        self.writer.write(participant, message)
    }
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
            // Logs the 1st, 10th, 100th, ...: often enough to be noticed, too rarely to flood the log.
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
            // Its writer may just be in replacement, and not matched with anybody for a moment.
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
