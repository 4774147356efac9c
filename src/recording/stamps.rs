//! The stamps of messages: where they are, and the number of a message among those of its topic.

use roscausal_core::{Time, signal::Definitions};
use roscausal_msgs::dynamic::{Schema, Wire};
use roscausal_recording::{Record, Topic};

/// Clocks that differ by more than this are two clocks: no tracker takes so long. Seconds.
pub(super) const ONE_CLOCK_S: f64 = 5.0;

/// Where stamps are in the messages of a topic.
#[derive(Debug)]
pub(crate) struct Stamps {
    schema: Schema,
    wire: Wire,
}

impl Stamps {
    /// Those of a topic whose type is known.
    pub(crate) fn of(topic: &Topic, definitions: &Definitions) -> Option<Self> {
        let kind = topic.raw_type()?;
        Some(Self { schema: definitions.schema(&kind).ok()?, wire: kind.wire })
    }

    /// The stamp of a message, if it has one.
    pub(crate) fn first(&self, bytes: &[u8]) -> Option<Time> {
        self.schema.stamp(self.wire, bytes).ok().flatten().filter(|stamp| *stamp != Time::ZERO)
    }

    /// Replaces all stamps of a message.
    pub(super) fn set(&self, bytes: &mut [u8], stamp: Time) {
        // What is not a message of its type is reported by whoever reads it.
        let _ = self.schema.restamp(self.wire, bytes, stamp);
    }
}

/// Counts a message: its number among those of its topic.
pub(super) fn number(numbers: &mut [u64], record: &Record) -> u64 {
    let Some(next) = numbers.get_mut(record.topic) else { return 0 };
    *next += 1;
    *next - 1
}
