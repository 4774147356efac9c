//! Subscriptions to messages of any type, as bytes.
//!
//! A DDS reader has a type from the beginning, so the topic's first publisher is waited for: the type is the one that it
//! announces. Definitions do not travel with the messages; they come from `.msg` files (`msg_path`, `AMENT_PREFIX_PATH`).

use std::sync::{Arc, Weak};
use std::{convert::Infallible, pin::pin, thread, time::Duration};

use futures::StreamExt;
use ros2_client::Gid;
use roscausal_core::middleware::{On, Raw, RawType};
use roscausal_core::{Error, Result, gate::Gate};
use roscausal_msgs::dynamic::Wire;
use rustdds::no_key::{Decode, DefaultDecoder, DeserializerAdapter, SimpleDataReader};
use rustdds::policy::{Durability, History, Reliability};
use rustdds::{QosPolicies, QosPolicyBuilder, RepresentationIdentifier, TopicKind};

use super::Participant;
use super::subscription::{Senders, Subscription};

/// Time between two looks for a publisher.
const LOOK_EVERY: Duration = Duration::from_millis(200);
/// Messages that may wait. The library keeps as many of each topic, read or not, and one of a hundred people has 30 kB.
const DEPTH: i32 = 100;

impl Participant {
    /// Calls back with each message of a topic, of the type that its first publisher has.
    ///
    /// # Errors
    /// An illegal name, or a system without threads.
    pub(crate) fn listen(self: &Arc<Self>, topic: &str, callback: impl On<Raw>) -> Result<Subscription> {
        let topic = self.names.resolve(topic)?;
        let subscription = Subscription::waiting();
        let (gate, task) = (subscription.gate.clone(), subscription.task.clone());
        let (node, name) = (Arc::downgrade(self), topic.clone());
        let look = move || {
            let Some((node, kind)) = publisher_of(&name, &node, &gate) else { return };
            match node.attach(&name, &kind, gate.clone(), callback) {
                Ok(handle) => {
                    let handle = task.get_or_init(|| handle);
                    if !gate.is_open() {
                        handle.abort();
                    }
                }
                Err(error) => tracing::error!("{error}"),
            }
        };
        let started = thread::Builder::new().name("ros2 listen".into()).spawn(look);
        started.map_err(|error| Error::Topic { topic, reason: error.to_string() })?;
        Ok(subscription)
    }

    fn attach(
        self: &Arc<Self>,
        name: &str,
        kind: &str,
        gate: Arc<Gate>,
        mut callback: impl On<Raw>,
    ) -> Result<futures::future::AbortHandle> {
        let fail = |reason: String| Error::Topic { topic: name.to_owned(), reason };
        let (package, short) =
            kind.split_once('/').ok_or_else(|| fail(format!("'{kind}' is not a message type")))?;
        let (folder, short) = short.split_once('/').unwrap_or(("msg", short));
        let dds_type = format!("{package}::{folder}::dds_::{short}_");
        let made = self.session(|session| {
            let (participant, qos) = (session.context.domain_participant(), qos());
            let topic =
                participant.create_topic(format!("rt{name}"), dds_type.clone(), &qos, TopicKind::NoKey)?;
            let subscriber = participant.create_subscriber(&qos)?;
            subscriber.create_simple_datareader_no_key::<Vec<u8>, Bytes>(&topic, Some(qos))
        })?;
        let reader = made.map_err(|error| fail(error.to_string()))?;
        let raw =
            Arc::new(RawType { type_name: kind.to_owned(), definition: String::new(), wire: Wire::Cdr });
        let senders = Senders::new(Arc::downgrade(self), dds_type);
        let deliver = move |bytes: Vec<u8>| gate.pass(|| callback(Raw { kind: raw.clone(), bytes }));
        self.spinner.rest();
        Ok(self.spinner.spawn(format!("topic '{name}'"), move || read(reader, senders, deliver)))
    }
}

/// Waits for a publisher of a topic; `None` once nobody listens any more.
fn publisher_of(name: &str, node: &Weak<Participant>, gate: &Gate) -> Option<(Arc<Participant>, String)> {
    while gate.is_open() {
        let node = node.upgrade()?;
        if let Some((_, kind)) = node.topics().into_iter().find(|(topic, _)| topic == name) {
            return Some((node, kind));
        }
        drop(node);
        thread::sleep(LOOK_EVERY);
    }
    None
}

async fn read(
    reader: SimpleDataReader<Vec<u8>, Bytes>,
    mut senders: Senders,
    mut deliver: impl FnMut(Vec<u8>),
) {
    let mut messages = pin!(reader.as_async_stream());
    while let Some(message) = messages.next().await {
        match message {
            Ok(message) if senders.fits(Gid::from(message.writer_guid())) => deliver(message.into_value()),
            Ok(_) => {}
            Err(error) => tracing::warn!("a message was not read: {error}"),
        }
    }
}

/// It matches every publisher: best effort, volatile.
fn qos() -> QosPolicies {
    QosPolicyBuilder::new()
        .reliability(Reliability::BestEffort)
        .durability(Durability::Volatile)
        .history(History::KeepLast { depth: DEPTH })
        .build()
}

/// Messages as they came: the four bytes that name the representation, then the content.
struct Bytes;

#[derive(Clone)]
struct Whole;

impl DeserializerAdapter<Vec<u8>> for Bytes {
    type Error = Infallible;
    type Decoded = Vec<u8>;

    fn supported_encodings() -> &'static [RepresentationIdentifier] {
        &[RepresentationIdentifier::CDR_BE, RepresentationIdentifier::CDR_LE]
    }

    fn transform_decoded(decoded: Vec<u8>) -> Vec<u8> {
        decoded
    }
}

impl DefaultDecoder<Vec<u8>> for Bytes {
    type Decoder = Whole;
    const DECODER: Whole = Whole;
}

impl Decode<'_, Vec<u8>> for Whole {
    type Error = Infallible;

    fn decode_bytes(
        self,
        input: &[u8],
        encoding: RepresentationIdentifier,
    ) -> std::result::Result<Vec<u8>, Infallible> {
        let mut bytes = vec![0, u8::from(encoding == RepresentationIdentifier::CDR_LE), 0, 0];
        bytes.extend_from_slice(input);
        Ok(bytes)
    }
}
