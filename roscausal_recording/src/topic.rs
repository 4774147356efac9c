//! Topics and messages of a recording.

use std::{
    collections::HashMap,
    ops::{Deref, DerefMut},
    sync::Arc,
};

use roscausal_core::{Error, Message, Result, Time, middleware::RawType};
use roscausal_msgs::{Definition, Wires, cdr, dynamic::Wire, ros1, types};

/// How the messages of a topic are encoded.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Encoding {
    /// As ROS 1 sends them.
    Ros1,
    /// As ROS 2 sends them.
    Cdr,
    /// Another encoding, such as `json`. Its messages are read but not decoded.
    Other(String),
}

/// A topic of a recording. All publishers of one name and type are one topic. A name that was recorded with two
/// types is two topics.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Topic {
    /// Its name, such as `/odom`.
    pub name: String,
    /// Its type as `package/Name`.
    pub type_name: String,
    /// How its messages are encoded.
    pub encoding: Encoding,
    /// md5 of the type, if the recording has it (ROS 1).
    pub md5: Option<String>,
    /// Full text of the type as recorded, which topics of one type share; empty if the recording has none.
    pub definition: Arc<str>,
    /// Whether the last message was kept for late joiners (latched, transient local).
    pub latched: bool,
    /// Number of its messages, if the recording has it.
    pub messages: Option<u64>,
}

/// One message of a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Record {
    /// Index in [`crate::Recording::topics`].
    pub topic: usize,
    /// When it was recorded; not the stamp of its header.
    pub stamp: Time,
    /// The message in the encoding of its topic.
    pub bytes: Vec<u8>,
}

impl Record {
    /// Memory that it takes, bytes.
    pub(crate) fn size(&self) -> u64 {
        (size_of::<Self>() + self.bytes.len()) as u64
    }
}

/// `package/Name` from either ROS version's spelling. The older `tf/tfMessage` has the fields and the md5 of its successor.
pub(crate) fn type_name(recorded: &str) -> String {
    match recorded {
        "tf/tfMessage" => "tf2_msgs/TFMessage".to_owned(),
        recorded => recorded.replace("/msg/", "/"),
    }
}

impl Topic {
    /// The message type of `roscausal_msgs` that the topic carries; `None` for unknown types, and for known names
    /// with other fields (another md5).
    pub fn known_type(&self) -> Option<&'static Definition> {
        let here = match self.encoding {
            Encoding::Ros1 => Wires::Ros1,
            Encoding::Cdr => Wires::Ros2,
            Encoding::Other(_) => return None,
        };
        let named = |known: &&'static Definition| {
            self.is_a(known) && self.md5.as_ref().is_none_or(|md5| md5 == known.ros1_md5())
        };
        let all = types();
        let of_this_wire = |known: &&Definition| known.wires == Wires::Both || known.wires == here;
        let found = all.iter().copied().filter(named).find(of_this_wire);
        // Our own recordings, in CDR, also contain the ROS 1 types of a run.
        let foreign = || all.iter().copied().filter(named).find(|_| self.encoding == Encoding::Cdr);
        found.or_else(foreign)
    }

    /// The type as bytes are read by it, with the definition that was recorded; `None` for an encoding of neither ROS version.
    pub fn raw_type(&self) -> Option<RawType> {
        let wire = match self.encoding {
            Encoding::Ros1 => Wire::Ros1,
            Encoding::Cdr => Wire::Cdr,
            Encoding::Other(_) => return None,
        };
        Some(RawType { type_name: self.type_name.clone(), definition: self.definition.to_string(), wire })
    }

    /// The message in `bytes`.
    ///
    /// # Errors
    /// Another type than the topic's, another md5, an encoding of neither ROS version, or bytes that are not such a
    /// message. The error names the topic.
    pub fn decode<M: Message>(&self, bytes: &[u8]) -> Result<M> {
        let fail = |reason: String| Error::Topic { topic: self.name.clone(), reason };
        if !self.is_a(M::definition()) {
            return Err(fail(format!("the recording has {}, not {}", self.type_name, M::type_name())));
        }
        if let Some(md5) = self.md5.as_ref().filter(|md5| *md5 != M::ros1_md5()) {
            return Err(fail(format!(
                "the recording's {} has other fields (md5 {md5}, not {})",
                self.type_name,
                M::ros1_md5()
            )));
        }
        let decoded = match &self.encoding {
            Encoding::Ros1 => ros1::from_bytes(bytes).map(|(message, _)| message),
            Encoding::Cdr => cdr::from_bytes(bytes),
            Encoding::Other(name) => {
                return Err(fail(format!("its messages are written as '{name}'; only ROS's own are read")));
            }
        };
        decoded.map_err(|error| fail(error.to_string()))
    }

    /// Whether this is the name of its type.
    fn is_a(&self, definition: &Definition) -> bool {
        let name = self.type_name.strip_prefix(definition.package).and_then(|rest| rest.strip_prefix('/'));
        name == Some(definition.name)
    }
}

/// What makes two entries the same topic: name, type, encoding and md5.
type Key = (String, String, Encoding, Option<String>);

/// The topics of a file or a folder, each once.
#[derive(Default)]
pub(crate) struct Topics {
    all: Vec<Topic>,
    /// Where each is. A file of strangers may name very many.
    index: HashMap<Key, usize>,
}

impl Topics {
    /// Adds a topic, or finds it. Returns its index.
    pub(crate) fn add(&mut self, topic: Topic) -> usize {
        let key = (topic.name.clone(), topic.type_name.clone(), topic.encoding.clone(), topic.md5.clone());
        let index = *self.index.entry(key).or_insert(self.all.len());
        match self.all.get_mut(index) {
            Some(known) => {
                known.latched |= topic.latched;
                known.messages = known.messages.zip(topic.messages).map(|(a, b)| a.saturating_add(b));
                if known.definition.is_empty() {
                    known.definition = topic.definition;
                }
            }
            None => self.all.push(topic),
        }
        index
    }
}

impl Deref for Topics {
    type Target = [Topic];

    fn deref(&self) -> &[Topic] {
        &self.all
    }
}

impl DerefMut for Topics {
    fn deref_mut(&mut self) -> &mut [Topic] {
        &mut self.all
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use roscausal_msgs::{pedsim_msgs::AgentStatesWithGoal, rosgraph_msgs::Clock, std_msgs::Bool};

    fn topic(name: &str, encoding: Encoding, md5: Option<&str>) -> Topic {
        Topic {
            name: "/x".into(),
            type_name: name.into(),
            encoding,
            md5: md5.map(str::to_owned),
            definition: "".into(),
            latched: false,
            messages: None,
        }
    }

    #[test]
    fn the_md5_tells_which_form_of_a_type_it_is() {
        let stock =
            topic("pedsim_msgs/AgentStates", Encoding::Ros1, Some("aa81ea94344df8d81e135b65d4d499b1"));
        assert_eq!(stock.known_type().unwrap().ros1_md5(), "aa81ea94344df8d81e135b65d4d499b1");
        let md5 = AgentStatesWithGoal::ros1_md5();
        let changed = topic("pedsim_msgs/AgentStates", Encoding::Ros1, Some(md5));
        assert!(std::ptr::eq(changed.known_type().unwrap(), AgentStatesWithGoal::definition()));
        assert!(topic("pedsim_msgs/AgentStates", Encoding::Ros1, Some("00")).known_type().is_none());
        assert!(topic("visualization_msgs/MeshFile", Encoding::Ros1, None).known_type().is_none());
        assert!(topic("visualization_msgs/MeshFile", Encoding::Cdr, None).known_type().is_some());
    }

    #[test]
    fn transforms_under_their_old_name_are_transforms() {
        let md5 = roscausal_msgs::tf2_msgs::TFMessage::ros1_md5();
        let tf = topic(&type_name("tf/tfMessage"), Encoding::Ros1, Some(md5));
        assert!(
            tf.decode::<roscausal_msgs::tf2_msgs::TFMessage>(&[0; 4]).is_ok() && tf.known_type().is_some()
        );
    }

    #[test]
    fn errors_of_decoding_name_the_topic() {
        let clock = topic("rosgraph_msgs/Clock", Encoding::Ros1, None);
        assert_eq!(clock.decode::<Clock>(&[0; 8]).unwrap(), Clock::default());
        for error in [clock.decode::<Bool>(&[0]).unwrap_err(), clock.decode::<Clock>(&[0]).unwrap_err()] {
            assert!(error.to_string().starts_with("topic '/x': "), "{error}");
        }
    }
}
