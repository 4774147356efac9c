//! `metadata.yaml`, in which rosbag2 lists the files of a recording and counts its messages. It is a checklist: what is there is read
//! with it or without.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use roscausal_core::bounded;
use serde_norway::Value;

use crate::{
    packed::{ENDINGS, unpacked_name},
    topic::{Topic, type_name},
};

/// Most bytes of it that are read. Each topic takes about 1 kB.
const LARGEST: u64 = 16 << 20;

/// What the file says of the folder that it is in; nothing if there is no such file.
#[derive(Default)]
pub(crate) struct Metadata {
    path: PathBuf,
    /// Whether it is there and says nothing that is known.
    unreadable: bool,
    /// Names of files.
    files: Vec<String>,
    /// Messages by name and type of the topic.
    counts: BTreeMap<(String, String), u64>,
    /// Messages of all topics.
    total: Option<u64>,
}

impl Metadata {
    pub(crate) fn of(folder: &Path) -> Self {
        let path = folder.join("metadata.yaml");
        if !path.is_file() {
            return Self::default();
        }
        let text = bounded::read_text(&path, LARGEST).unwrap_or_default();
        let value = serde_norway::from_str::<Value>(&text).unwrap_or_default();
        let Some(value) = value.get("rosbag2_bagfile_information").filter(|value| value.is_mapping()) else {
            return Self { path, unreadable: true, ..Self::default() };
        };
        let list = |key: &str| value.get(key).and_then(Value::as_sequence).into_iter().flatten();
        // Versions of rosbag2 differ in whether the folder is a part of a name.
        let last = |name: &Value| Some(Path::new(name.as_str()?).file_name()?.to_string_lossy().into_owned());
        let count = |topic: &Value| {
            let what = topic.get("topic_metadata")?;
            let name = what.get("name")?.as_str()?.to_owned();
            let kind = type_name(what.get("type")?.as_str()?);
            Some(((name, kind), topic.get("message_count")?.as_u64()?))
        };
        Self {
            files: list("relative_file_paths").filter_map(last).collect(),
            counts: list("topics_with_message_count").filter_map(count).collect(),
            total: value.get("message_count").and_then(Value::as_u64),
            path,
            unreadable: false,
        }
    }

    /// A sentence about each file that is listed but not there, packed or unpacked, and about a list that cannot be read.
    pub(crate) fn missing(&self) -> Vec<String> {
        let there = |name: &String| {
            let file = self.path.with_file_name(name);
            file.exists()
                || unpacked_name(&file).is_some_and(|plain| plain.exists())
                || ENDINGS.iter().any(|ending| file.with_file_name(format!("{name}.{ending}")).exists())
        };
        let path = self.path.display();
        let is_missing = "a part of the recording, is missing; its messages are left out";
        let sentence = |name: &String| format!("{path}: {name}, {is_missing}");
        let unreadable =
            format!("{path}: it is no list of rosbag2, so whether a part is missing is not known");
        let missing = self.files.iter().filter(|name| !there(name)).map(sentence);
        self.unreadable.then_some(unreadable).into_iter().chain(missing).collect()
    }

    /// A sentence about messages that are not there, of `held` ones, where it counts all of them together only.
    pub(crate) fn lost(&self, held: Option<u64>) -> Option<String> {
        let (total, held) = self.total.filter(|_| self.counts.is_empty()).zip(held)?;
        let lost = total.checked_sub(held).filter(|lost| *lost > 0)?;
        Some(format!("{}: {lost} of the {total} messages that it counts are not there", self.path.display()))
    }

    /// How many messages of each topic there should be, if it tells.
    pub(crate) fn counts(&self, topics: &[Topic]) -> Vec<Option<u64>> {
        let count = |topic: &Topic| {
            self.counts.get(&(topic.name.clone(), topic.type_name.clone())).copied().max(topic.messages)
        };
        topics.iter().map(count).collect()
    }
}
