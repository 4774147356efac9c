//! Steps of a clock: which stamps of a stream are single mistakes, and where the clock went back for good.

use roscausal_core::Time;

/// A message: its number in the stream, its stamp, and when it came by another clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tick {
    /// Its number.
    pub number: u64,
    /// Its stamp.
    pub stamp: Time,
    /// When it came.
    pub came: Time,
}

/// The stamps of one stream, in the order in which they came.
#[derive(Debug)]
pub struct Steps {
    follows: fn(Tick, Tick) -> bool,
    /// How many stamps must agree with each other after a jump of the clock; fewer are mistakes.
    confirmed: usize,
    last: Option<Tick>,
    /// The first messages, while they are few.
    first: Vec<u64>,
    /// Messages that do not follow the last one, but each other.
    waiting: Vec<Tick>,
    found: Stepped,
}

/// What became of the stamps of a stream.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Stepped {
    /// Numbers of the messages that are stamped far from those around them, in order.
    pub mistakes: Vec<u64>,
    /// Numbers of the first messages after the clock went back.
    pub back: Vec<u64>,
    /// How often it went ahead by more than can be.
    pub ahead: u64,
}

impl Steps {
    /// A stream in which `follows` says of two messages whether the second may come after the first. After a jump of the clock
    /// `confirmed` stamps must follow each other; fewer are mistakes.
    pub fn new(confirmed: usize, follows: fn(Tick, Tick) -> bool) -> Self {
        let (last, first, waiting, found) = Default::default();
        Self { follows, confirmed, last, first, waiting, found }
    }

    /// Adds the next message.
    pub fn add(&mut self, tick: Tick) {
        let Some(last) = self.last.filter(|last| !(self.follows)(*last, tick)) else {
            self.drop_waiting();
            if self.first.len() < self.confirmed {
                self.first.push(tick.number);
            }
            self.last = Some(tick);
            return;
        };
        if self.waiting.last().is_some_and(|before| !(self.follows)(*before, tick)) {
            self.drop_waiting();
        }
        self.waiting.push(tick);
        if self.waiting.len() < self.confirmed {
            return;
        }
        if self.first.len() < self.confirmed {
            // The beginning was the mistake.
            self.found.mistakes.append(&mut self.first);
            self.first.extend(self.waiting.iter().map(|tick| tick.number));
        } else if let Some(begin) = self.waiting.first() {
            let found = &mut self.found;
            if begin.stamp < last.stamp { found.back.push(begin.number) } else { found.ahead += 1 }
        }
        self.waiting.clear();
        self.last = Some(tick);
    }

    fn drop_waiting(&mut self) {
        self.found.mistakes.extend(self.waiting.drain(..).map(|tick| tick.number));
    }

    /// The result, after the last message.
    pub fn finish(mut self) -> Stepped {
        self.drop_waiting();
        self.found.mistakes.sort_unstable();
        self.found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stepped(stamps: &[i64]) -> Stepped {
        let mut steps = Steps::new(5, |a, b| (-1.0..=1.0).contains(&b.stamp.secs_since(a.stamp)));
        for (number, stamp) in (0..).zip(stamps) {
            let stamp = Time::from_nanos(stamp * 100_000_000);
            steps.add(Tick { number, stamp, came: stamp });
        }
        steps.finish()
    }

    #[test]
    fn single_stamps_are_mistakes_and_what_goes_on_is_a_jump() {
        let even: Vec<i64> = (0..20).collect();
        assert_eq!(stepped(&even), Stepped::default());
        let with = |changes: &[(usize, i64)]| {
            let mut stamps = even.clone();
            changes.iter().for_each(|(place, stamp)| stamps[*place] = *stamp);
            stepped(&stamps)
        };
        assert_eq!(with(&[(3, 3000), (8, -500), (9, 4000)]).mistakes, [3, 8, 9]);
        assert_eq!(with(&[(0, 3000)]).mistakes, [0], "the first");
        assert_eq!(with(&[(19, 3000)]).mistakes, [19], "the last");
        let twice: Vec<i64> = (0..20).chain(0..20).chain(500..510).collect();
        assert_eq!(stepped(&twice), Stepped { mistakes: vec![], back: vec![20], ahead: 1 });
        // A little out of order is neither.
        assert_eq!(stepped(&[0, 2, 1, 3, 5, 4]), Stepped::default());
    }
}
