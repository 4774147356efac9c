//! A recording whose recording time goes back, such as that of a simulation that was reset or played in a loop: each run is a lap, and
//! messages of one lap all come before those of the next.

use std::collections::BTreeMap;

use roscausal_core::Time;

use crate::steps::{Steps, Tick};

/// A recording time this much before the last one of its topic is of another lap. Messages come a little out of order. Seconds.
pub(crate) const BACK_S: f64 = 1.0;
/// A recording time this much later must be confirmed by others. Seconds.
const AHEAD_S: f64 = 60.0;
/// So many messages of a topic must follow each other after its time went back.
const CONFIRMED: usize = 20;
/// More laps than anybody records; then times are in no order at all.
const MOST: usize = 1000;

/// Finds laps in messages that are added in the order of the file.
#[derive(Default)]
pub(crate) struct LapFinder {
    topics: BTreeMap<usize, Steps>,
    pub(crate) count: u64,
}

impl LapFinder {
    pub(crate) fn add(&mut self, topic: usize, stamp: Time) {
        let follows = |a: Tick, b: Tick| (-BACK_S..=AHEAD_S).contains(&b.stamp.secs_since(a.stamp));
        let steps = self.topics.entry(topic).or_insert_with(|| Steps::new(CONFIRMED, follows));
        steps.add(Tick { number: self.count, stamp, came: stamp });
        self.count += 1;
    }

    /// The laps; none where times do not go back.
    pub(crate) fn finish(self) -> Laps {
        let topics: BTreeMap<usize, Vec<u64>> =
            self.topics.into_iter().map(|(topic, steps)| (topic, steps.finish().back)).collect();
        let mut all: Vec<(u64, usize)> =
            topics.iter().flat_map(|(topic, back)| back.iter().map(|number| (*number, *topic))).collect();
        all.sort_unstable();
        // A lap begins where the first topic goes back, and it goes back once in a lap.
        let (mut begins, mut gone) = (Vec::<u64>::new(), Vec::new());
        for (number, topic) in all {
            if begins.is_empty() || gone.contains(&topic) {
                begins.push(number);
                gone.clear();
            }
            gone.push(topic);
        }
        if begins.len() > MOST { Laps::default() } else { Laps { topics, begins } }
    }
}

/// Where laps begin, by the number of a message in the file.
#[derive(Debug, Default)]
pub(crate) struct Laps {
    /// For each topic, its first messages of all laps but the first.
    topics: BTreeMap<usize, Vec<u64>>,
    /// The first messages of all laps but the first.
    pub(crate) begins: Vec<u64>,
}

impl Laps {
    /// The lap of a message.
    pub(crate) fn of(&self, topic: usize, number: u64) -> u32 {
        let own = self.topics.get(&topic).filter(|back| back.len() == self.begins.len());
        Self::before(own.unwrap_or(&self.begins), number)
    }

    /// The earliest lap of a message from this number on.
    pub(crate) fn first(&self, number: u64) -> u32 {
        let all = self.topics.values().filter(|back| back.len() == self.begins.len()).chain([&self.begins]);
        all.map(|back| Self::before(back, number)).min().unwrap_or(0)
    }

    pub(crate) fn count(&self) -> u32 {
        u32::try_from(self.begins.len()).unwrap_or(0).saturating_add(1)
    }

    fn before(back: &[u64], number: u64) -> u32 {
        u32::try_from(back.partition_point(|begin| *begin <= number)).unwrap_or(u32::MAX)
    }
}
