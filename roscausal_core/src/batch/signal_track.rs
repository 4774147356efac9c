//! The waiting values of one signal, and what a row holds of them.

use std::collections::VecDeque;

use crate::signal::How;

/// Most values of one signal that wait to become rows.
const MOST: usize = 100_000;

/// The values of one signal, in order of time; NaN: the signal is known to have none.
#[derive(Debug)]
pub(super) struct SignalTrack {
    pub(super) name: String,
    pub(super) how: How,
    values: VecDeque<(i64, f64)>,
}

impl SignalTrack {
    pub(super) fn new(name: &str, how: How) -> Self {
        Self { name: name.to_owned(), how, values: VecDeque::new() }
    }

    /// Adds a value (stamp in nanoseconds), in order or not. Returns whether the oldest had to go for it. Of several with
    /// one stamp the last counts.
    pub(super) fn insert(&mut self, stamp: i64, value: f64) -> bool {
        let at = self.values.partition_point(|(earlier, _)| *earlier < stamp);
        match self.values.get_mut(at) {
            Some((same, old)) if *same == stamp => *old = value,
            _ => self.values.insert(at, (stamp, value)),
        }
        self.values.len() > MOST && self.values.pop_front().is_some()
    }

    /// The values that rows may need.
    pub(super) fn values(&self) -> impl Iterator<Item = &(i64, f64)> {
        self.values.iter()
    }

    pub(super) fn clear(&mut self) {
        self.values.clear();
    }

    /// What a row at `t` holds, `dt` after the row before; NaN: nothing.
    pub(super) fn at(&self, t: i64, dt: i64, max_gap: i64) -> f64 {
        let after = self.values.partition_point(|(stamp, _)| *stamp <= t);
        let Some((stamp, last)) = after.checked_sub(1).and_then(|place| self.values.get(place)) else {
            return f64::NAN;
        };
        let held =
            |max_age: f64| if t.saturating_sub(*stamp) as f64 / 1e9 <= max_age { *last } else { f64::NAN };
        match self.how {
            How::Hold(max_age) => held(max_age),
            How::Linear if *stamp == t => *last,
            How::Linear => match self.values.get(after) {
                Some((next_stamp, next)) if next_stamp.saturating_sub(*stamp) <= max_gap => {
                    last + (next - last) * (t - stamp) as f64 / (next_stamp - stamp) as f64
                }
                _ => f64::NAN,
            },
            How::Average(max_age) => {
                let is_since = |(stamp, _): &&(i64, f64)| *stamp > t.saturating_sub(dt);
                let since = self.values.iter().take(after).rev().take_while(is_since);
                let known: Vec<_> = since.map(|(_, value)| *value).filter(|value| !value.is_nan()).collect();
                if known.is_empty() {
                    held(max_age)
                } else {
                    known.iter().rev().sum::<f64>() / known.len() as f64
                }
            }
        }
    }

    /// Drops what no row at `t` or later needs.
    pub(super) fn forget_before(&mut self, t: i64, dt: i64) {
        while self.values.get(1).is_some_and(|(second, _)| *second <= t.saturating_sub(dt)) {
            self.values.pop_front();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: i64 = 1_000_000_000;

    fn track(how: How) -> SignalTrack {
        let mut track = SignalTrack::new("x", how);
        for (stamp, value) in [(2 * S, 2.0), (S, 1.0), (4 * S, 4.0), (4 * S, 6.0)] {
            track.insert(stamp, value);
        }
        track
    }

    #[test]
    fn a_value_is_held_until_it_is_too_old() {
        let track = track(How::Hold(1.5));
        let at = |t: i64| track.at(t, S / 10, S);
        assert!(at(S - 1).is_nan() && at(7 * S).is_nan());
        assert_eq!((at(S), at(2 * S - 1), at(2 * S), at(35 * S / 10), at(4 * S)), (1.0, 1.0, 2.0, 2.0, 6.0));
        assert!(at(36 * S / 10).is_nan());
    }

    #[test]
    fn between_two_values_lies_a_line_unless_they_are_far_apart() {
        let track = track(How::Linear);
        let at = |t: i64| track.at(t, S / 10, S);
        assert_eq!((at(S), at(15 * S / 10), at(4 * S)), (1.0, 1.5, 6.0));
        assert!(at(3 * S).is_nan() && at(5 * S).is_nan() && at(0).is_nan());
    }

    #[test]
    fn an_average_is_of_the_values_since_the_row_before() {
        let track = track(How::Average(1.0));
        assert_eq!(track.at(2 * S, 2 * S, S), 1.5);
        assert_eq!(track.at(2 * S, S, S), 2.0);
        assert_eq!(track.at(25 * S / 10, S / 10, S), 2.0, "held while it is young");
        assert!(track.at(35 * S / 10, S / 10, S).is_nan());
    }

    #[test]
    fn what_later_rows_need_is_kept() {
        let mut track = track(How::Average(1.0));
        track.forget_before(3 * S, S);
        assert_eq!(track.at(3 * S, S, S), 2.0);
        assert_eq!(track.values().count(), 2);
    }
}
