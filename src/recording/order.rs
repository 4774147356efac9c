//! The messages of a recording in the order of their stamps. A file has no waits: what came late, or is needed early, is played when it
//! is due.

use std::collections::BTreeMap;

use roscausal_core::Time;
use roscausal_msgs::tf2_msgs::TFMessage;
use roscausal_recording::{Record, Recording};

/// How far each topic is played before the time at which it was recorded, by topic. Seconds.
#[derive(Clone, Debug, Default)]
pub(crate) struct Lead(pub(super) Vec<f64>);

/// Messages whose stamps are less than this behind the time of recording came in time. Seconds.
const IN_TIME_S: f64 = 0.05;
/// Transforms at longer intervals are played ahead, so that each sighting lies between two of them; by how many intervals, and by how
/// much at the most: the nodes keep transforms for 10 s. Seconds.
const OFTEN_S: f64 = 0.3;
const INTERVALS: f64 = 2.0;
const LONGEST_S: f64 = 6.0;

impl Lead {
    /// From a topic's offset, its stamps minus the times of recording.
    pub(super) fn of_offset(median_s: f64) -> f64 {
        if median_s < -IN_TIME_S { -median_s } else { 0.0 }
    }

    /// The longest, seconds.
    fn most(&self) -> f64 {
        self.0.iter().copied().fold(0.0, f64::max)
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
    lead: Lead,
    /// The longest lead, seconds.
    most: f64,
    /// Messages that wait for earlier ones: by their time, then in the order of the file.
    waiting: BTreeMap<(Time, u64), Record>,
    count: u64,
    first: Option<Time>,
    newest: Option<Time>,
    at_end: bool,
}

impl<'a> InOrder<'a> {
    /// With no `lead` in the order of recording.
    pub(super) fn new(recording: &'a mut Recording, lead: Lead) -> Self {
        let (most, waiting, first, newest) = (lead.most(), BTreeMap::new(), None, None);
        Self { recording, lead, most, waiting, count: 0, first, newest, at_end: false }
    }

    /// The same, before the first message is read.
    pub(super) fn with(self, lead: Lead) -> Self {
        Self { most: lead.most(), lead, ..self }
    }

    /// Whether all that could be earlier than the next one is known.
    fn is_ready(&self) -> bool {
        let Some(((due, _), _)) = self.waiting.first_key_value() else { return false };
        self.newest.is_some_and(|newest| newest.secs_since(*due) >= self.most)
    }

    pub(super) fn next(&mut self) -> Option<Record> {
        while !self.is_ready() && !self.at_end {
            let Some(mut record) = self.recording.next() else {
                self.at_end = true;
                break;
            };
            let came = record.stamp;
            self.newest = Some(self.newest.map_or(came, |newest| newest.max(came)));
            let first = *self.first.get_or_insert(came);
            let lead = self.lead.0.get(record.topic).copied().unwrap_or(0.0);
            if lead > 0.0 {
                record.stamp = came.plus_secs(-lead).max(first);
            }
            self.count += 1;
            self.waiting.insert((record.stamp, self.count), record);
        }
        self.waiting.pop_first().map(|(_, record)| record)
    }
}
