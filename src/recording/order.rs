//! The messages of a recording in the order of their stamps. A file has no waits: what came late, or is needed early, is played when it
//! is due.

use std::collections::BTreeMap;

use roscausal_core::Time;
use roscausal_msgs::{rosgraph_msgs::Clock, tf2_msgs::TFMessage};
use roscausal_recording::{Record, Recording};

use super::stamps::{ONE_CLOCK_S, Stamps, number};

/// How far messages are played before the time at which they were recorded.
#[derive(Debug, Default)]
pub(crate) struct Lead {
    /// The recording's own clock, whose time counts if there is one.
    pub(super) clock: Option<usize>,
    /// The stamps of the topic that came earliest, minus the times of recording: all may be off by the same. Seconds.
    pub(super) base_s: f64,
    pub(super) topics: Vec<TopicLead>,
}

/// How far those of one topic are.
#[derive(Debug, Default)]
pub(super) struct TopicLead {
    /// Stamps minus times of recording: the usual one, and the least one. Seconds.
    pub(super) offsets_s: [f64; 2],
    /// How far transforms are played ahead. Seconds.
    pub(super) ahead_s: f64,
    /// Where the stamp of a message is; without one, its offset is the usual one.
    pub(super) stamps: Option<Stamps>,
}

/// Messages whose stamps are less than this behind the time of recording came in time. Seconds.
const IN_TIME_S: f64 = 0.05;
/// Transforms at longer intervals are played ahead, so that each sighting lies between two of them; by how many intervals, and by how
/// much at the most: the nodes keep transforms for 10 s. Seconds.
const OFTEN_S: f64 = 0.3;
const INTERVALS: f64 = 2.0;
const LONGEST_S: f64 = 6.0;
/// So many messages wait at most: a clock that stands still would hold all that come.
const MOST_WAITING: usize = 50_000;

impl Lead {
    /// How late a message with this offset came, as far as that is made up for. Seconds.
    fn late(&self, offset_s: f64) -> f64 {
        Some(self.base_s - offset_s)
            .filter(|late| *late > IN_TIME_S)
            .map_or(0.0, |late| late.min(ONE_CLOCK_S))
    }

    /// That of a message, seconds, and its stamp. `now`: the time at which it came.
    fn of(&self, record: &Record, now: Time) -> (f64, Option<Time>) {
        let Some(topic) = self.topics.get(record.topic) else { return (0.0, None) };
        let stamp = topic.stamps.as_ref().and_then(|stamps| stamps.first(&record.bytes));
        let offset_s = stamp.map_or(topic.offsets_s[0], |stamp| stamp.secs_since(now));
        (topic.ahead_s + self.late(offset_s), stamp)
    }

    /// The longest, seconds.
    fn most(&self) -> f64 {
        self.topics.iter().map(|topic| topic.ahead_s + self.late(topic.offsets_s[1])).fold(0.0, f64::max)
    }
}

/// The intervals at which each frame of a topic of transforms comes.
#[derive(Default)]
pub(super) struct Intervals {
    last: BTreeMap<String, Time>,
    /// Longest so far, by frame, of those that came often enough.
    longest: f64,
}

impl Intervals {
    pub(super) fn add(&mut self, message: &TFMessage) {
        for transform in &message.transforms {
            let stamp = transform.header.stamp;
            if let Some(last) = self.last.insert(transform.child_frame_id.clone(), stamp) {
                let interval = stamp.secs_since(last);
                // A longer one is a hole.
                if interval <= LONGEST_S / INTERVALS {
                    self.longest = self.longest.max(interval);
                }
            }
        }
    }

    /// How far the transforms are to be played ahead, seconds.
    pub(super) fn lead(&self) -> f64 {
        if self.longest > OFTEN_S { INTERVALS * self.longest } else { 0.0 }
    }
}

/// The messages of a run in order.
pub(super) struct InOrder<'a> {
    pub(super) recording: &'a mut Recording,
    lead: Option<&'a Lead>,
    /// The longest lead, seconds.
    most: f64,
    /// Messages that wait for earlier ones, each with its number among those of its topic: by their time, then in the order of the file.
    waiting: BTreeMap<(Time, u64), (Record, u64)>,
    count: u64,
    /// By topic: stamp and time of the last message.
    last: BTreeMap<usize, (Time, Time)>,
    first: Option<Time>,
    newest: Option<Time>,
    /// The time of the recording's own clock, and how far it went in all: it may go back.
    clock: Option<(Time, Time)>,
    at_end: bool,
}

impl<'a> InOrder<'a> {
    /// In the order of recording.
    pub(super) fn new(recording: &'a mut Recording) -> Self {
        let (most, waiting, count, last, first, newest, clock, at_end) = Default::default();
        Self { recording, lead: None, most, waiting, count, last, first, newest, clock, at_end }
    }

    /// In that of the stamps, before the first message is read.
    pub(super) fn with(self, lead: &'a Lead) -> Self {
        Self { most: lead.most(), lead: Some(lead), ..self }
    }

    /// Whether all that could be earlier than the next one is known.
    fn is_ready(&self) -> bool {
        let Some(((due, _), _)) = self.waiting.first_key_value() else { return false };
        let is_due = self.newest.is_some_and(|newest| newest.secs_since(*due) >= self.most);
        is_due || self.waiting.len() > MOST_WAITING
    }

    /// When a message came, by the clock of the stamps and by one that never goes back.
    fn times(&mut self, record: &Record) -> (Time, Time) {
        let Some(clock) = self.lead.and_then(|lead| lead.clock) else { return (record.stamp, record.stamp) };
        if record.topic == clock
            && let Ok(message) = self.recording.topics()[clock].decode::<Clock>(&record.bytes)
        {
            let (before, gone) = self.clock.unwrap_or((message.clock, message.clock));
            let step = message.clock.secs_since(before).max(0.0);
            self.clock = Some((message.clock, gone.plus_secs(step)));
        }
        // Before the first message of a clock its time is not known.
        self.clock.unwrap_or_default()
    }

    /// The next message and its number. `numbers`: how many messages of each topic were read.
    pub(super) fn next(&mut self, numbers: &mut [u64]) -> Option<(Record, u64)> {
        while !self.is_ready() && !self.at_end {
            let Some(mut record) = self.recording.next() else {
                self.at_end = true;
                break;
            };
            let (now, came) = self.times(&record);
            self.newest = Some(self.newest.map_or(came, |newest| newest.max(came)));
            let first = *self.first.get_or_insert(came);
            let (lead, stamp) = self.lead.map_or((0.0, None), |lead| lead.of(&record, now));
            record.stamp = if lead > 0.0 { came.plus_secs(-lead).max(first) } else { came };
            if let Some(stamp) = stamp {
                // What is not stamped before the last message of its topic stays behind it.
                let last = self.last.entry(record.topic).or_insert((stamp, record.stamp));
                if last.0 <= stamp {
                    record.stamp = record.stamp.max(last.1);
                }
                *last = (stamp, record.stamp);
            }
            self.count += 1;
            let number = number(numbers, &record);
            self.waiting.insert((record.stamp, self.count), (record, number));
        }
        self.waiting.pop_first().map(|(_, numbered)| numbered)
    }
}
