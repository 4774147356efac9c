//! Playing a recording onto a middleware.

use roscausal_core::{
    Error, Message, Result,
    middleware::{Middleware, Publish, Qos},
};
use roscausal_msgs::{TypeVisitor, visit};

use crate::{Record, Recording, Topic};

/// Publishes the messages of a recording on a middleware, under their own types and names ([`Topic::playable`]).
pub struct Player {
    publish: Vec<Option<Box<PublishBytes>>>,
}

type PublishBytes = dyn FnMut(&Topic, &[u8]) -> Result<()> + Send;

/// Messages of a topic that may wait.
const QUEUE: usize = 100;

impl Player {
    /// Advertises the topics that `name` gives a name, mostly [`Topic::playable`], and whose types are known.
    ///
    /// # Errors
    /// A topic that the middleware refuses.
    pub fn new<M: Middleware>(
        mw: &M,
        recording: &Recording,
        name: impl Fn(&Topic) -> Option<String>,
    ) -> Result<Self> {
        let advertised = |topic: &Topic| {
            let name = name(topic);
            let known = name.as_deref().zip(topic.known_type());
            known.and_then(|(name, known)| visit(known, Advertise { mw, topic, name })).transpose()
        };
        Ok(Self { publish: recording.topics().iter().map(advertised).collect::<Result<_>>()? })
    }

    /// Publishes one message, unless its topic is not played.
    ///
    /// # Errors
    /// Bytes that are not a message of the topic's type, or a middleware that refuses it.
    pub fn publish(&mut self, topic: &Topic, record: &Record) -> Result<()> {
        match self.publish.get_mut(record.topic) {
            Some(Some(publish)) => publish(topic, &record.bytes),
            _ => Ok(()),
        }
    }
}

struct Advertise<'a, M> {
    mw: &'a M,
    topic: &'a Topic,
    name: &'a str,
}

impl<M: Middleware> TypeVisitor for Advertise<'_, M> {
    type Output = Result<Box<PublishBytes>>;

    fn visit<T: Message>(self) -> Self::Output {
        let static_transforms = self.topic.name.trim_start_matches('/') == "tf_static";
        let qos = if self.topic.latched || static_transforms { Qos::Latched } else { Qos::Volatile(QUEUE) };
        let publisher = self.mw.advertise::<T>(self.name, qos).map_err(|error| match error {
            Error::Topic { topic, reason } => {
                Error::Topic { topic, reason: format!("cannot be played: {reason}") }
            }
            other => other,
        })?;
        Ok(Box::new(move |topic, bytes| publisher.publish(&topic.decode::<T>(bytes)?)))
    }
}
