//! The waiting samples of a robot or person (a body), and the values between two of them.

use std::{
    collections::VecDeque,
    f64::consts::{PI, TAU},
};

/// Most samples of one body that wait to become rows.
const MOST: usize = 100_000;

/// The recorded quantities of a body, in the order of its columns.
pub const FIELDS: [Field; 7] = [
    Field { name: "gx", unit: "m", kind: Kind::Held },
    Field { name: "gy", unit: "m", kind: Kind::Held },
    Field { name: "x", unit: "m", kind: Kind::Linear },
    Field { name: "y", unit: "m", kind: Kind::Linear },
    Field { name: "theta", unit: "rad", kind: Kind::Angle },
    Field { name: "v", unit: "m/s", kind: Kind::Linear },
    Field { name: "omega", unit: "rad/s", kind: Kind::Linear },
];

/// One recorded quantity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Field {
    /// End of the column's name.
    pub name: &'static str,
    /// SI unit.
    pub unit: &'static str,
    /// How values between two samples are computed.
    pub kind: Kind,
}

/// How a quantity behaves between two samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Changes linearly.
    Linear,
    /// Turns evenly, the shorter way round.
    Angle,
    /// Keeps its last value.
    Held,
}

/// The values of all [`FIELDS`] at one moment; NaN if unknown.
pub type Values = [f64; FIELDS.len()];

/// The samples of one body, in order of time.
#[derive(Debug, Default)]
pub(super) struct Track {
    samples: VecDeque<(i64, Values)>,
}

/// What happened to a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Taken {
    Yes,
    /// There is already one with that stamp; the first one counts.
    Duplicate,
    /// Too many samples wait; the oldest was dropped.
    Crowded,
}

impl Track {
    /// Adds a sample (stamp in nanoseconds), in order or not.
    pub(super) fn insert(&mut self, stamp: i64, values: Values) -> Taken {
        let at = self.samples.partition_point(|(earlier, _)| *earlier < stamp);
        if self.samples.get(at).is_some_and(|(same, _)| *same == stamp) {
            return Taken::Duplicate;
        }
        self.samples.insert(at, (stamp, values));
        if self.samples.len() > MOST {
            self.samples.pop_front();
            return Taken::Crowded;
        }
        Taken::Yes
    }

    /// Whether there is no sample.
    pub(super) fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }

    /// The samples that rows may need, in order of time.
    pub(super) fn samples(&self) -> impl Iterator<Item = &(i64, Values)> {
        self.samples.iter()
    }

    /// The values at `t`: those of a sample at `t`, or interpolated between two samples at most `max_gap` apart.
    /// With `hold`, those of the last sample instead of interpolated ones.
    pub(super) fn at(&self, t: i64, max_gap: i64, hold: bool) -> Option<Values> {
        let after = self.samples.partition_point(|(stamp, _)| *stamp < t);
        let next = self.samples.get(after);
        if let Some((stamp, values)) = next
            && *stamp == t
        {
            return Some(*values);
        }
        let (t0, before) = self.samples.get(after.checked_sub(1)?)?;
        let (t1, next) = next?;
        if t1 - t0 > max_gap {
            return None;
        }
        let share = if hold { 0.0 } else { (t - t0) as f64 / (t1 - t0) as f64 };
        let mut values = *before;
        for (i, field) in FIELDS.iter().enumerate() {
            values[i] = match field.kind {
                Kind::Held => before[i],
                Kind::Linear => before[i] + share * (next[i] - before[i]),
                Kind::Angle => wrapped(before[i] + share * wrapped(next[i] - before[i])),
            };
        }
        Some(values)
    }

    /// Drops what no row at `t` or later needs. Returns whether any sample is left that such a row may need.
    pub(super) fn forget_before(&mut self, t: i64, max_gap: i64) -> bool {
        while self.samples.get(1).is_some_and(|(second, _)| *second <= t) {
            self.samples.pop_front();
        }
        self.samples.back().is_some_and(|(last, _)| *last >= t - max_gap)
    }
}

/// The angle in `(-pi, pi]`.
fn wrapped(angle: f64) -> f64 {
    let turned = angle.rem_euclid(TAU);
    if turned > PI { turned - TAU } else { turned }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(x: f64, theta: f64, goal: f64) -> Values {
        [goal, goal, x, 0.0, theta, 1.0, 0.0]
    }

    fn track(samples: &[(i64, Values)]) -> Track {
        let mut track = Track::default();
        for (stamp, values) in samples {
            assert_eq!(track.insert(*stamp, *values), Taken::Yes);
        }
        track
    }

    #[test]
    fn places_change_evenly_headings_turn_the_shorter_way_and_goals_hold() {
        let track = track(&[(100, values(1.0, 3.0, 5.0)), (200, values(2.0, -3.0, 6.0))]);
        let at = track.at(150, 100, false).expect("between");
        assert_eq!((at[0], at[2]), (5.0, 1.5));
        assert!((at[4].abs() - PI).abs() < 1e-12, "{}", at[4]);
        let near_end = track.at(199, 100, false).expect("between");
        assert!((near_end[4] + 3.0).abs() < 0.01);
        assert_eq!(track.at(200, 100, false).expect("a sample")[0], 6.0);
        assert_eq!(track.at(150, 100, true).expect("held")[2], 1.0);
    }

    #[test]
    fn nothing_is_told_outside_the_samples_or_within_a_gap() {
        let track = track(&[(100, values(1.0, 0.0, 0.0)), (300, values(2.0, 0.0, 0.0))]);
        assert!(track.at(99, 500, false).is_none() && track.at(301, 500, false).is_none());
        assert!(track.at(200, 199, false).is_none() && track.at(200, 200, false).is_some());
    }

    #[test]
    fn samples_out_of_order_find_their_place_and_the_first_of_a_stamp_counts() {
        let mut track = track(&[
            (100, values(1.0, 0.0, 0.0)),
            (300, values(3.0, 0.0, 0.0)),
            (200, values(9.0, 0.0, 0.0)),
        ]);
        assert_eq!(track.insert(200, values(5.0, 0.0, 0.0)), Taken::Duplicate);
        assert_eq!(track.at(200, 100, false).expect("a sample")[2], 9.0);
        assert!(track.forget_before(250, 100));
        assert_eq!(track.samples.len(), 2);
        assert!(!track.forget_before(401, 100));
    }

    #[test]
    fn angles_stay_within_a_half_turn() {
        assert_eq!(wrapped(PI), PI);
        assert_eq!(wrapped(-PI), PI);
        assert!((wrapped(7.0) - (7.0 - TAU)).abs() < 1e-12);
        assert!(wrapped(f64::NAN).is_nan());
    }
}
