//! A recording of any format, as an iterator over its messages.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use roscausal_core::{
    Error, Result, Time,
    memory::{Growth, Memory},
};

use crate::{
    packed,
    source::Source,
    topic::{Encoding, Record, Topic},
};

/// A recording, read from its first message to its last: an iterator over [`Record`]s in the order of their
/// recording times (with equal times, in the order of the file). Memory holds one piece of the file (about 1 MB)
/// and the pieces that overlap it in time. What rosbag2 compressed, file or message, is unpacked.
pub struct Recording {
    path: PathBuf,
    source: Box<dyn Source>,
    wanted: Vec<bool>,
    /// Whether it ends after each lap, and the present one.
    by_lap: bool,
    lap: u32,
    /// How many messages of each topic were found.
    found: Vec<u64>,
    /// Messages that were read but not returned yet, by lap, recording time, and how many were read before them.
    waiting: BTreeMap<(u32, Time, u64), Record>,
    count: u64,
    losses: Vec<String>,
    /// Whether a message that cannot be unpacked was told.
    told_packed: bool,
    /// How far messages that were compressed by themselves have grown.
    growth: Growth,
    /// What the waiting messages may take, and take.
    memory: Memory,
    held: u64,
    /// Whether messages that do not fit were told.
    told_full: bool,
}

impl Recording {
    /// The recording of this source; `losses` are what could not be read of it so far.
    pub(crate) fn of(path: &Path, source: Box<dyn Source>, losses: Vec<String>) -> Self {
        let wanted = vec![true; source.topics().len()];
        Self {
            path: path.to_owned(),
            source,
            by_lap: false,
            lap: 0,
            found: vec![0; wanted.len()],
            wanted,
            waiting: BTreeMap::new(),
            count: 0,
            losses,
            told_packed: false,
            growth: Growth::default(),
            memory: Memory::of(None),
            held: 0,
            told_full: false,
        }
    }

    /// Limits the memory of messages that wait for earlier ones; usually what the machine has free.
    #[must_use]
    pub fn within(mut self, memory: Memory) -> Self {
        self.memory = memory;
        self
    }

    /// The topics, in the order of the recording.
    pub fn topics(&self) -> &[Topic] {
        self.source.topics()
    }

    /// The topic with this name and, if `type_name` is given, this type (`package/Name`).
    ///
    /// # Errors
    /// No such topic. The message lists the topics, those of the type first.
    pub fn topic(&self, name: &str, type_name: Option<&str>) -> Result<usize> {
        let fits = |topic: &&Topic| type_name.is_none_or(|wanted| wanted == topic.type_name);
        let named = |topic: &&Topic| topic.name.trim_start_matches('/') == name.trim_start_matches('/');
        if let Some(index) = self.topics().iter().position(|topic| named(&topic) && fits(&topic)) {
            return Ok(index);
        }
        let describe = |topic: &Topic| format!("{} ({})", topic.name, topic.type_name);
        let mut there: Vec<_> = self.topics().iter().filter(fits).map(describe).collect();
        let mut of_type = type_name.map_or(String::new(), |wanted| format!(" of type {wanted}"));
        if there.is_empty() {
            there = self.topics().iter().map(describe).collect();
            of_type.clear();
        }
        let there = if there.is_empty() { "none".to_owned() } else { there.join(", ") };
        let wanted = type_name.map_or(String::new(), |wanted| format!(" of type {wanted}"));
        Err(Error::file(&self.path, format!("no topic {name}{wanted}; topics{of_type} in it: {there}")))
    }

    /// Returns only topics for which `wanted` returns true. Others are not even copied.
    pub fn select(&mut self, wanted: impl Fn(&Topic) -> bool) {
        self.wanted = self.source.topics().iter().map(wanted).collect();
    }

    /// Recording times of the first and the last message, if the file tells; `None` for an empty file.
    pub fn span(&self) -> Option<(Time, Time)> {
        self.source.span()
    }

    /// How many runs it holds: 1 plus how often its recording time goes back, as where a simulation was reset. The messages of a run
    /// come before those of the next.
    pub fn laps(&self) -> u32 {
        self.source.laps()
    }

    /// Ends after each run; [`next_lap`](Self::next_lap) goes on.
    #[must_use]
    pub fn by_lap(mut self) -> Self {
        self.by_lap = true;
        self
    }

    /// Goes on to the next run, if there is one.
    pub fn next_lap(&mut self) -> bool {
        self.lap = self.lap.saturating_add(1);
        self.lap < self.laps()
    }

    /// The fraction that has been read, from 0 to 1.
    pub fn progress(&self) -> f64 {
        self.source.progress()
    }

    /// Unpacks a message that was compressed by itself. A message of ROS 2 never begins as compressed data does.
    fn unpack(&mut self, mut record: Record) -> Option<Record> {
        let is_packed = record.bytes.starts_with(packed::MAGIC)
            && self.source.topics().get(record.topic).is_some_and(|topic| topic.encoding == Encoding::Cdr);
        if !is_packed {
            return Some(record);
        }
        match packed::message(&record.bytes, &mut self.growth) {
            Ok(bytes) => {
                record.bytes = bytes;
                Some(record)
            }
            Err(reason) => {
                if !std::mem::replace(&mut self.told_packed, true) {
                    let path = self.path.display();
                    self.losses.push(format!(
                        "{path}: messages that cannot be unpacked are left out, the first: {reason}"
                    ));
                }
                None
            }
        }
    }

    /// Compares what was found with what the recording says that it holds; once, at its end.
    fn compare_counts(&mut self) {
        let counts = self.source.counts().into_iter().zip(std::mem::take(&mut self.found)).zip(&self.wanted);
        let lost = self.source.topics().iter().zip(counts).filter_map(|(topic, ((count, found), wanted))| {
            let count = count.filter(|count| *wanted && *count > found)?;
            Some(format!("{} of {count} of {}", count - found, topic.name))
        });
        let lost: Vec<String> = lost.collect();
        if !lost.is_empty() {
            let path = self.path.display();
            self.losses
                .push(format!("{path}: messages that it should hold are not there: {}", lost.join(", ")));
        }
    }

    /// What could not be read so far, one sentence each. Complete after the last message.
    pub fn losses(&self) -> &[String] {
        &self.losses
    }
}

impl Iterator for Recording {
    type Item = Record;

    fn next(&mut self) -> Option<Record> {
        loop {
            let next_start = self.source.next_start();
            let here = self.waiting.first_key_value().map(|((lap, stamp, _), _)| (*lap, *stamp));
            let lap = here.into_iter().chain(next_start).map(|(lap, _)| lap).min();
            if self.by_lap && lap.is_some_and(|lap| lap > self.lap) {
                return None;
            }
            if here.is_some_and(|here| next_start.is_none_or(|start| here <= start)) {
                let (_, record) = self.waiting.pop_first()?;
                self.held -= record.size();
                let Some(record) = self.unpack(record) else { continue };
                return Some(record);
            }
            if next_start.is_none() {
                self.compare_counts();
                return None;
            }
            let mut records = Vec::new();
            if let Err(loss) = self.source.load(&self.wanted, &mut records) {
                self.losses.push(loss);
            }
            for record in records {
                if let Some(found) = self.found.get_mut(record.topic) {
                    *found += 1;
                }
                if let Err(reason) = self.memory.check(self.held + record.size()) {
                    if !std::mem::replace(&mut self.told_full, true) {
                        let path = self.path.display();
                        self.losses.push(format!(
                            "{path}: messages that overlap in time do not fit into memory and are left out: {reason}"
                        ));
                    }
                    continue;
                }
                self.held += record.size();
                self.count += 1;
                self.waiting.insert((record.lap, record.stamp, self.count), record);
            }
        }
    }
}
