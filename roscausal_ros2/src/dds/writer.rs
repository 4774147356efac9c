//! The library's publisher, with a bounded history.

use ros2_client::{QosProfile, WriteError};
use roscausal_core::{Error, Result};
use rustdds::{
    GUID, Topic, TopicDescription, no_key::SerializerAdapter, serialization::CDRSerializerAdapter,
};
use serde::{Serialize, Serializer, ser::SerializeTuple};

use super::Participant;

/// A publisher of the library that is replaced by a new one after a number of messages. The history of a
/// transient-local publisher is trimmed only to what all its readers have acknowledged, and a late joiner gets all
/// of it.
pub(crate) struct Writer<M: Serialize> {
    topic: Topic,
    profile: QosProfile,
    renew_after: usize,
    pub(crate) sent: usize,
    publisher: Inner<M>,
}

/// The library's publisher of one history.
type Inner<M> = ros2_client::Publisher<Padded<M>>;

impl<M: Serialize> Writer<M> {
    /// A publisher with this profile whose history starts over after this many messages.
    ///
    /// # Errors
    /// If the library refuses, or the node has left.
    pub(super) fn new(
        participant: &Participant,
        topic: Topic,
        profile: QosProfile,
        renew_after: usize,
    ) -> Result<Self> {
        let publisher = Self::publisher(participant, &topic, &profile)?;
        Ok(Self { topic, profile, renew_after, sent: 0, publisher })
    }

    fn publisher(participant: &Participant, topic: &Topic, profile: &QosProfile) -> Result<Inner<M>> {
        let made =
            participant.session(|session| session.node.create_publisher(topic, Some(profile.clone())))?;
        let publisher =
            made.map_err(|error| Error::Topic { topic: topic.name(), reason: error.to_string() })?;
        participant.graph.add(publisher.guid(), &topic.name(), topic.get_type().name());
        participant.announce();
        Ok(publisher)
    }

    /// Sends a message. Returns `false` if a reliable subscriber is too far behind to accept it.
    ///
    /// # Errors
    /// If the library refuses, or the node has left.
    pub(crate) fn write(&mut self, participant: &Participant, message: M) -> Result<bool> {
        if self.sent >= self.renew_after {
            self.renew(participant)?;
        }
        self.sent += 1;
        match self.publisher.publish(Padded::new(message, participant.secured)) {
            Ok(()) => Ok(true),
            Err(WriteError::WouldBlock { .. }) => Ok(false),
            Err(error) => Err(Error::Topic { topic: self.topic.name(), reason: error.to_string() }),
        }
    }

    /// Starts the history over. Fast DDS keeps counting the old publisher.
    pub(crate) fn renew(&mut self, participant: &Participant) -> Result<()> {
        let old = self.guid();
        self.publisher = Self::publisher(participant, &self.topic, &self.profile)?;
        participant.graph.remove(old);
        self.sent = 0;
        Ok(())
    }

    pub(crate) fn guid(&self) -> GUID {
        self.publisher.guid()
    }
}

/// A message followed by up to three zeros, which a reader ignores. The library pads what it sends to a multiple of
/// four bytes *after* encrypting the content, and looks for the signature from the padded end. So only content that
/// needs no padding can be decrypted.
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
