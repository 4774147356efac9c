//! Topics and messages of a recording.

use std::{
    collections::HashMap,
    ops::{Deref, DerefMut},
    sync::Arc,
};

use roscausal_core::{Error, Message, Result, Time, middleware::RawType};
use roscausal_msgs::{
    Definition, Wires, cdr,
    dynamic::{Schema, Wire},
    ros1, types,
};

/// How the messages of a topic are encoded.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
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
    /// How often the recording time went back before it.
    pub lap: u32,
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

    /// The name under which it is played: its own, as far as ROS's rules of names allow.
    ///
    /// # Example
    /// `/people-tracker/3d` is played as `/people_tracker/_3d`.
    pub fn playable(&self) -> String {
        let legal = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
        let token = |text: &str| {
            let digit = if text.starts_with(|c: char| c.is_ascii_digit()) { "_" } else { "" };
            format!("/{digit}{}", text.chars().map(legal).collect::<String>())
        };
        self.name.split('/').filter(|text| !text.is_empty()).map(token).collect()
    }

    /// Whether this is its name, as recorded or as it is played, with or without the first slash.
    pub fn is_named(&self, name: &str) -> bool {
        let name = name.trim_start_matches('/');
        self.name.trim_start_matches('/') == name || self.playable().trim_start_matches('/') == name
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
            let (name, own) = (&self.type_name, M::ros1_md5());
            return Err(fail(format!("the recording's {name} has other fields (md5 {md5}, not {own})")));
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

    /// Some generators make another md5 of a type with equal fields. The fields count.
    fn use_known_md5(&mut self) {
        let Some(md5) = &self.md5 else { return };
        let all = types();
        let mut named = all.iter().filter(|known| self.is_a(known));
        if named.clone().any(|known| known.ros1_md5() == md5) || self.definition.is_empty() {
            return;
        }
        let Ok(schema) = Schema::parse(&self.type_name, &self.definition) else { return };
        let same = |known: &&&Definition| known.ros1_schema().is_some_and(|own| own.has_fields_of(&schema));
        if let Some(known) = named.find(same) {
            self.md5 = Some(known.ros1_md5().to_owned());
        }
    }

    /// Whether both were recorded with definitions of equal fields.
    fn has_fields_of(&self, other: &Self) -> bool {
        let schema = |topic: &Self| Schema::parse(&topic.type_name, &topic.definition).ok();
        schema(self).zip(schema(other)).is_some_and(|(a, b)| a.has_fields_of(&b))
    }

    /// Whether this is the name of its type.
    fn is_a(&self, definition: &Definition) -> bool {
        let name = self.type_name.strip_prefix(definition.package).and_then(|rest| rest.strip_prefix('/'));
        name == Some(definition.name)
    }
}

/// What makes two entries the same topic, if their fields are equal too: name, type and encoding.
type Key = (String, String, Encoding);

/// Most forms of one topic whose fields are compared.
const MOST_FORMS: usize = 8;

/// The topics of a file or a folder, each once.
#[derive(Default)]
pub(crate) struct Topics {
    all: Vec<Topic>,
    /// Where each is, in all its forms. A file of strangers may name very many.
    index: HashMap<Key, Vec<usize>>,
}

impl Topics {
    /// Adds a topic, or finds it. Returns its index.
    pub(crate) fn add(&mut self, mut topic: Topic) -> usize {
        topic.use_known_md5();
        let key = (topic.name.clone(), topic.type_name.clone(), topic.encoding.clone());
        let forms = self.index.entry(key).or_default();
        let same = |known: &Topic| known.md5 == topic.md5;
        let found = forms.iter().copied().find(|index| same(&self.all[*index]));
        let equal = |index: &usize| self.all[*index].has_fields_of(&topic);
        let found = found.or_else(|| forms.iter().copied().take(MOST_FORMS).find(equal));
        let index = found.unwrap_or(self.all.len());
        match self.all.get_mut(index) {
            Some(known) => {
                known.latched |= topic.latched;
                known.messages = known.messages.zip(topic.messages).map(|(a, b)| a.saturating_add(b));
                if known.definition.is_empty() {
                    known.definition = topic.definition;
                }
            }
            None => {
                forms.push(index);
                self.all.push(topic);
            }
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
    fn names_that_ros_does_not_allow_are_played_under_names_that_it_does() {
        for (recorded, played) in
            [("/odom", "/odom"), ("odom", "/odom"), ("/a-b//3d", "/a_b/_3d"), ("/a b/\u{e4}", "/a_b/_")]
        {
            let topic = Topic { name: recorded.into(), ..topic("std_msgs/Bool", Encoding::Cdr, None) };
            assert_eq!(topic.playable(), played);
            assert!(topic.is_named(recorded) && topic.is_named(played));
        }
    }

    #[test]
    fn another_md5_of_equal_fields_is_the_same_topic() {
        let definition = |text: &str| Topic {
            definition: text.into(),
            md5: Some(format!("{:032x}", text.len())),
            ..topic("std_msgs/Bool", Encoding::Ros1, None)
        };
        let mut topics = Topics::default();
        let first = topics.add(definition("bool data"));
        assert_eq!(topics[first].md5.as_deref(), Some(Bool::ros1_md5()));
        assert_eq!(topics.add(definition("# of another generator\nbool  data\n")), first);
        assert_eq!(topics.add(topic("std_msgs/Bool", Encoding::Ros1, Some(Bool::ros1_md5()))), first);
        let other = topics.add(definition("uint16 data"));
        assert!(other != first && topics[other].known_type().is_none());
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
