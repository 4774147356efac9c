//! The recorded quantities of a robot or person (a body), its waiting samples, and the values between two of them.

use std::{
    collections::VecDeque,
    f64::consts::{PI, TAU},
};

use serde::{Deserialize, Serialize};

use super::{risk::Body, table::median};
use crate::state::{
    identity::is_leap,
    motion::{SLOWEST_HEADING, Walk},
};

/// Most samples of one body that wait to become rows.
const MOST: usize = 100_000;
/// The usual interval is that below which a third of so many lie, since lost samples make intervals longer. Each is a mean of a few
/// neighbours, which evens out jitter. At first fewer are enough.
const INTERVALS: usize = 15;
const TOGETHER: usize = 3;
const ENOUGH: usize = INTERVALS + TOGETHER;
/// Where a tracker tells places only, a row uses those from 1 s before it to 0.5 s after it, which are there when it is made. What lies
/// beyond a leap is not used; so many metres are none.
const BEHIND_NS: i64 = 1_000_000_000;
pub(super) const AHEAD_NS: i64 = 500_000_000;
const LEAP_M: f64 = 0.8;
/// Their noise, metres, is measured on the last 66 of them, once there are 10, and is at least the third number; before, it is the last.
const PLACES: usize = 66;
const FEWEST_PLACES: usize = 10;
const LEAST_NOISE_M: f64 = 0.002;
const USUAL_NOISE_M: f64 = 0.05;
/// Where samples come at least as often as rows, give or take this share of a step, ...
const OFTEN: f64 = 1.2;
/// ... a row whose value would reach farther ahead has lost its sample. Steps.
const FARTHEST_AHEAD: f64 = 0.3;
/// Where samples come about as often as rows (so that a third more would be lost), and not so often that they are held, rows are made at samples. Steps.
const A_ROW: f64 = 1.35;
/// Where samples usually come so often, in steps, or more often, held ones are young enough.
pub const OFTEN_TO_HOLD: f64 = 0.42;

/// A slower body stands, m/s, and the cosine of a smaller angle is the same way.
const MOVES: f64 = 0.1;
const SAME_WAY: f64 = 0.8;

/// What a row holds of the samples around it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Sampling {
    /// [`Self::Hold`] where samples usually come about two and a half times a row or more often; where they come about once a row or more
    /// often, the nearest one, and all else at its moment; else [`Self::Linear`].
    #[default]
    Auto,
    /// What lies between the samples before and after it.
    Linear,
    /// The newest sample that is not later.
    Hold,
}

roscausal_discovery::words!(Sampling, "sampling": Auto "auto", Linear "linear", Hold "hold");

/// A recorded quantity; in the order of a robot's columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Field {
    /// Where the goal is.
    Gx,
    /// Where the goal is.
    Gy,
    /// Where the body is.
    X,
    /// Where the body is.
    Y,
    /// Its heading.
    Theta,
    /// Its speed.
    V,
    /// Its turning rate.
    Omega,
}

impl Field {
    /// All of them, in the order of a robot's columns.
    pub const ALL: [Self; 7] = [Self::Gx, Self::Gy, Self::X, Self::Y, Self::Theta, Self::V, Self::Omega];

    /// End of the column's name.
    pub fn name(self) -> &'static str {
        ["gx", "gy", "x", "y", "theta", "v", "omega"][self as usize]
    }

    /// End of its column's name as ROS-Causal 1.1 spells it; the TAB is the `\t` of its `\theta`.
    pub fn legacy_name(self) -> &'static str {
        match self {
            Self::Gx => "{gx}",
            Self::Gy => "{gy}",
            Self::Theta => "{\theta}",
            Self::Omega => "{\\omega}",
            other => other.name(),
        }
    }

    /// SI unit.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Gx | Self::Gy | Self::X | Self::Y => "m",
            Self::Theta => "rad",
            Self::V => "m/s",
            Self::Omega => "rad/s",
        }
    }
}

/// What is recorded of a body at one instant; NaN where unknown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Values {
    /// Where the goal is, metres.
    pub gx: f64,
    /// Where the goal is, metres.
    pub gy: f64,
    /// Where the body is, metres.
    pub x: f64,
    /// Where the body is, metres.
    pub y: f64,
    /// Heading, radians.
    pub theta: f64,
    /// Speed, metres per second.
    pub v: f64,
    /// Turning rate, radians per second.
    pub omega: f64,
}

impl Values {
    /// Nothing is known.
    pub const UNKNOWN: Self = Self::from_array([f64::NAN; Field::ALL.len()]);

    /// The values in the order of [`Field::ALL`].
    pub const fn from_array([gx, gy, x, y, theta, v, omega]: [f64; Field::ALL.len()]) -> Self {
        Self { gx, gy, x, y, theta, v, omega }
    }

    /// The values in the order of [`Field::ALL`].
    pub fn to_array(self) -> [f64; Field::ALL.len()] {
        let Self { gx, gy, x, y, theta, v, omega } = self;
        [gx, gy, x, y, theta, v, omega]
    }

    /// One value.
    pub fn get(&self, field: Field) -> f64 {
        self.to_array()[field as usize]
    }

    /// Replaces one value.
    pub(super) fn set(&mut self, field: Field, value: f64) {
        let mut values = self.to_array();
        values[field as usize] = value;
        *self = Self::from_array(values);
    }

    /// Place and velocity, from speed and heading.
    pub fn body(&self) -> Body {
        Body::heading(self.x, self.y, self.theta, self.v)
    }

    /// Whether this body goes towards `other`, who goes the same way; `None` where one of them stands, or is not known.
    pub(super) fn follows(&self, other: &Self) -> Option<bool> {
        let moves = |body: &Self| body.v > MOVES;
        let (dx, dy) = (other.x - self.x, other.y - self.y);
        let ahead = (dx * libm::cos(self.theta) + dy * libm::sin(self.theta)) / (dx * dx + dy * dy).sqrt();
        let together = libm::cos(other.theta - self.theta);
        (moves(self) && moves(other) && !(ahead * together).is_nan())
            .then_some(ahead > SAME_WAY && together > SAME_WAY)
    }

    /// What is at a share of the way to `next`: places and speeds change evenly, a heading turns evenly the shorter way
    /// round, a goal holds.
    fn towards(&self, next: &Self, share: f64) -> Self {
        let even = |from: f64, to: f64| from + share * (to - from);
        Self {
            gx: self.gx,
            gy: self.gy,
            x: even(self.x, next.x),
            y: even(self.y, next.y),
            theta: wrapped(self.theta + share * wrapped(next.theta - self.theta)),
            v: even(self.v, next.v),
            omega: even(self.omega, next.omega),
        }
    }
}

/// The samples of one body, in order of time.
#[derive(Debug, Default)]
pub(super) struct Track {
    samples: VecDeque<(i64, Values)>,
    /// Stamps and places of the last samples that no row needs any more.
    past: VecDeque<(i64, [f64; 2])>,
    /// The usual one of the last intervals, known once there is one: each row asks for it several times.
    usual: Option<i64>,
    /// Whether all samples are there from the beginning, so that none waits for others.
    unlimited: bool,
    /// Whether velocities that the tracker does not tell are made of places before and after.
    smooths: bool,
    /// The noise of places, metres, where they are smoothed.
    noise_m: f64,
    /// Whether the tracker has told a place without a velocity.
    tells_places: bool,
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
    /// A track that keeps any number of samples.
    pub(super) fn without_limit() -> Self {
        Self { unlimited: true, ..Self::default() }
    }

    /// A track of a person, whose velocity may have to follow from places.
    pub(super) fn of_person() -> Self {
        Self { smooths: true, ..Self::default() }
    }

    /// Adds a sample (stamp in nanoseconds), in order or not.
    pub(super) fn insert(&mut self, stamp: i64, values: Values) -> Taken {
        let at = self.samples.partition_point(|(earlier, _)| *earlier < stamp);
        if self.samples.get(at).is_some_and(|(same, _)| *same == stamp) {
            return Taken::Duplicate;
        }
        self.tells_places |= values.omega.is_nan();
        self.samples.insert(at, (stamp, values));
        if self.samples.len() > MOST && !self.unlimited {
            self.samples.pop_front();
            return Taken::Crowded;
        }
        Taken::Yes
    }

    /// Whether there is no sample.
    pub(super) fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }

    /// All that rows depend on, in order of time; of what is past, stamp and place.
    pub(super) fn remembered(&self) -> impl Iterator<Item = (i64, Values)> {
        let past = self.past.iter().map(|&(stamp, [x, y])| (stamp, Values { x, y, ..Values::UNKNOWN }));
        past.chain(self.samples.iter().copied())
    }

    /// The values at `t`: those of a sample at `t`, or interpolated between two samples at most `max_gap` apart.
    /// With `hold`, those of the last sample that is not later, if it is at most `max_gap` old.
    pub(super) fn at(&self, t: i64, max_gap: i64, hold: bool) -> Option<Values> {
        let [before, after] = self.around(t);
        let (t0, before) = before?;
        if *t0 == t || hold {
            return (t - t0 <= max_gap).then_some(*before);
        }
        let (t1, next) = after?;
        (t1 - t0 <= max_gap).then(|| before.towards(next, (t - t0) as f64 / (t1 - t0) as f64))
    }

    /// The values at a moment: place, heading and speed are smoothed over the places around it where the tracker tells places only, so that
    /// all are of one age. Where places are rare, two before and one after it count, unless there is a gap.
    fn walked(&self, moment: i64, values: Values, ahead_ns: i64, max_gap: i64) -> Values {
        if !(self.smooths && values.omega.is_nan()) {
            return values;
        }
        let until = |end: i64| self.samples.partition_point(|(stamp, _)| *stamp <= end);
        let leaps = |i: usize| {
            let [(t0, a), (t1, b)] = [self.samples[i - 1], self.samples[i]];
            is_leap([b.x - a.x, b.y - a.y], (t1 - t0) as f64 / 1e9, LEAP_M)
        };
        let now = until(moment);
        let second = now.saturating_sub(2).max(until(moment - max_gap.saturating_mul(2) - 1));
        let start = until(moment - BEHIND_NS - 1).min(second);
        let start = (start + 1..now).rev().find(|&i| leaps(i)).unwrap_or(start);
        let end = match ahead_ns {
            0 => now,
            ahead => until(moment + ahead).max((now + 1).min(until(moment.saturating_add(max_gap)))),
        };
        let end = (now.max(1)..end).find(|&i| leaps(i)).unwrap_or(end);
        let near = self.samples.range(start..end).filter(|(_, at)| at.x.is_finite() && at.y.is_finite());
        let places: Vec<(f64, [f64; 2])> =
            near.map(|(stamp, at)| ((stamp - moment) as f64 / 1e9, [at.x, at.y])).collect();
        let Some(walk) = Walk::at(&places, self.noise_m) else {
            return Values { v: f64::NAN, ..values };
        };
        let ([x, y], v) = (walk.place, walk.speed());
        let theta =
            if v > SLOWEST_HEADING { libm::atan2(walk.velocity[1], walk.velocity[0]) } else { values.theta };
        Values { x, y, theta, v, ..values }
    }

    /// Whether rows in steps of `dt` are best made at samples. A line between two would mix each row with the next one, as much as its
    /// sample is early.
    pub(super) fn makes_rows(&self, dt: i64, sampling: Sampling) -> bool {
        sampling == Sampling::Auto
            && self.steps(dt).is_some_and(|steps| (OFTEN_TO_HOLD..=A_ROW).contains(&steps))
    }

    /// The stamp of the sample nearest to the row at `t`, if it is within half a step.
    pub(super) fn nearest(&self, t: i64, dt: i64) -> Option<i64> {
        let stamps = self.around(t).into_iter().flatten().map(|(stamp, _)| *stamp);
        stamps
            .min_by_key(|stamp| stamp.abs_diff(t))
            .filter(|stamp| 2 * stamp.abs_diff(t) <= dt.unsigned_abs())
    }

    /// What a row holds that is made at `t`, `dt` after the row before: the values at `t`, as in [`Self::at`]. Where samples come as
    /// often as rows or more often, it is empty if its value would reach far ahead: its sample was lost.
    pub(super) fn row(&self, t: i64, dt: i64, max_gap: i64, sampling: Sampling) -> Option<Values> {
        let held = |ahead_ns| {
            let [before, _] = self.around(t);
            Some(self.walked(before?.0, self.at(t, max_gap, true)?, ahead_ns, max_gap))
        };
        if sampling == Sampling::Hold {
            return held(0);
        }
        let on_line = self.at(t, max_gap, false);
        if self.holds(dt, sampling) {
            // Chosen by the program, it reaches no farther than a line does.
            return on_line.and(held(AHEAD_NS));
        }
        let is_rare = self.steps(dt).is_none_or(|steps| steps > OFTEN);
        let ahead = self.spacing(t).map_or(0.0, |[_, ahead]| ahead / dt as f64);
        on_line
            .filter(|_| is_rare || ahead <= FARTHEST_AHEAD)
            .map(|values| self.walked(t, values, AHEAD_NS, max_gap))
    }

    /// Whether rows in steps of `dt` hold the newest sample.
    pub(super) fn holds(&self, dt: i64, sampling: Sampling) -> bool {
        let is_often = || self.steps(dt).is_some_and(|steps| steps <= OFTEN_TO_HOLD);
        sampling == Sampling::Hold || (sampling == Sampling::Auto && is_often())
    }

    /// Whether samples are known to come too seldom to be held.
    pub(super) fn is_seldom(&self, dt: i64) -> bool {
        self.steps(dt).is_some_and(|steps| steps > OFTEN_TO_HOLD)
    }

    /// The usual interval in steps of `dt`.
    fn steps(&self, dt: i64) -> Option<f64> {
        Some(self.usual? as f64 / dt as f64)
    }

    /// Finds the usual one of the last intervals, and how noisy places are, before the row at `t` is made. While they are few, those until
    /// `max_gap` later count, too: what is stamped so is there by then. How many samples came at once changes nothing.
    pub(super) fn settle(&mut self, t: i64, max_gap: i64) {
        let [now, end] = [t, t.saturating_add(max_gap)]
            .map(|end| self.samples.partition_point(|(stamp, _)| *stamp <= end));
        let last = |most: usize| {
            let older = (self.past.len() + now).saturating_sub(most);
            let coming = self.samples.range(..end).map(|(stamp, at)| (*stamp, [at.x, at.y]));
            self.past.iter().copied().chain(coming).skip(older).take(most).collect::<Vec<_>>()
        };
        let stamps = last(ENOUGH);
        let over = |run: &[(i64, [f64; 2])]| (run[TOGETHER].0 - run[0].0) / TOGETHER as i64;
        let mut intervals: Vec<i64> = stamps.windows(TOGETHER + 1).map(over).collect();
        intervals.sort_unstable();
        self.usual = intervals.get(intervals.len() / 3).copied();
        if self.smooths && self.tells_places {
            self.noise_m = noise(&last((self.past.len() + now).clamp(ENOUGH, PLACES)));
        }
    }

    /// The last sample that is not later than `t`, and the one after it.
    fn around(&self, t: i64) -> [Option<&(i64, Values)>; 2] {
        let after = self.samples.partition_point(|(stamp, _)| *stamp <= t);
        [after.checked_sub(1).and_then(|before| self.samples.get(before)), self.samples.get(after)]
    }

    /// How far apart the samples are between which a value at `t` lies, and how far it reaches ahead of `t`: the share of the later one
    /// times how much later that is. Nanoseconds.
    pub(super) fn spacing(&self, t: i64) -> Option<[f64; 2]> {
        let [before, after] = self.around(t);
        let (t0, _) = before?;
        // The next one of those that come seldom is not waited for.
        let Some((t1, _)) = after else { return self.usual.map(|usual| [usual as f64, 0.0]) };
        let [past, ahead] = [t - t0, t1 - t].map(|nanos| nanos as f64);
        Some([past + ahead, past * ahead / (past + ahead)])
    }

    /// Drops what no row at `t` or later needs. Returns whether any sample is left that such a row may need.
    pub(super) fn forget_before(&mut self, t: i64, max_gap: i64) -> bool {
        let (reach, most) =
            if self.smooths { (BEHIND_NS.saturating_add(max_gap), PLACES) } else { (0, ENOUGH) };
        while self.samples.get(1).is_some_and(|(second, _)| *second <= t.saturating_sub(reach)) {
            self.past.extend(self.samples.pop_front().map(|(stamp, at)| (stamp, [at.x, at.y])));
            if self.past.len() > most {
                self.past.pop_front();
            }
        }
        self.samples.back().is_some_and(|(last, _)| *last >= t - max_gap)
    }
}

/// The noise of places along either axis, metres, standard deviation: from how far each lies beside the line between its neighbours. A
/// repeated place says nothing of it, nor does an axis that does not change.
fn noise(places: &[(i64, [f64; 2])]) -> f64 {
    let mut different = places.to_vec();
    different.dedup_by_key(|(_, at)| *at);
    let beside = |run: &[(i64, [f64; 2])]| {
        let [(t0, p0), (t1, p1), (t2, p2)] = [run[0], run[1], run[2]];
        let share = (t1 - t0) as f64 / (t2 - t0) as f64;
        let spread = (1.0 + share * share + (1.0 - share) * (1.0 - share)).sqrt();
        [0, 1].map(|axis| {
            let off = (p1[axis] - p0[axis] - share * (p2[axis] - p0[axis])).abs() / spread;
            if p0[axis] == p1[axis] && p1[axis] == p2[axis] { f64::NAN } else { off }
        })
    };
    let middle = median(different.windows(3).flat_map(beside)).filter(|_| places.len() >= FEWEST_PLACES);
    // The middle of the absolute values of a normal distribution.
    middle.map_or(USUAL_NOISE_M, |middle| (middle / 0.6745).max(LEAST_NOISE_M))
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
        Values::from_array([goal, goal, x, 0.0, theta, 1.0, 0.0])
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
        assert_eq!((at.gx, at.x), (5.0, 1.5));
        assert!((at.theta.abs() - PI).abs() < 1e-12, "{}", at.theta);
        let near_end = track.at(199, 100, false).expect("between");
        assert!((near_end.theta + 3.0).abs() < 0.01);
        assert_eq!(track.at(200, 100, false).expect("a sample").gx, 6.0);
        assert_eq!((track.spacing(150), track.spacing(100)), (Some([100.0, 25.0]), Some([100.0, 0.0])));
        assert_eq!(track.at(150, 100, true).expect("held").x, 1.0);
        assert_eq!(track.at(300, 100, true).expect("the last one").x, 2.0);
        assert!(track.at(301, 100, true).is_none() && track.at(99, 100, true).is_none());
    }

    #[test]
    fn a_sample_near_its_row_is_the_row_and_a_row_that_lost_its_sample_is_empty() {
        let mut seen = Track::default();
        for number in (0..30).filter(|number| *number != 25) {
            // Up to an eighth of a step early or late.
            seen.insert(100 * number + 12 * (number % 3 - 1), values(number as f64, 0.0, 0.0));
        }
        let row = |seen: &Track, t, dt| {
            let moment = if seen.makes_rows(dt, Sampling::Auto) { seen.nearest(t, dt)? } else { t };
            seen.row(moment, dt, 500, Sampling::Linear).map(|values| values.x)
        };
        assert_ne!(row(&seen, 200, 100), Some(2.0), "nothing is usual yet");
        seen.settle(0, 250);
        assert_ne!(row(&seen, 200, 100), Some(2.0), "three samples are too few");
        seen.settle(0, 500);
        assert_eq!(row(&seen, 200, 100), Some(2.0), "the first rows are made as all others");
        seen.forget_before(2300, 500);
        seen.settle(2300, 500);
        let rows: Vec<Option<f64>> = (23..28).map(|number| row(&seen, 100 * number, 100)).collect();
        assert_eq!(rows, [Some(23.0), Some(24.0), None, Some(26.0), Some(27.0)]);
        for (dt, why) in [(50, "rows are closer than samples"), (500, "here there are enough")] {
            assert!(row(&seen, 2500, dt).is_some_and(|x| x > 24.5 && x < 25.5), "{why}");
        }
        assert_eq!(seen.row(2500, 100, 500, Sampling::Hold).map(|values| values.x), Some(24.0));
    }

    #[test]
    fn the_usual_interval_does_not_depend_on_how_many_samples_came_at_once() {
        let stamp = |number: i64| 100 * number + if number > 40 { 60 * (number - 40) } else { 0 };
        let usual = |bundle: i64| {
            let (mut seen, mut told) = (Track::default(), Vec::new());
            for (number, t) in (0..80).map(|number| (number, stamp(number))) {
                seen.insert(t, values(0.0, 0.0, 0.0));
                if (number + 1) % bundle != 0 {
                    continue;
                }
                for row in number + 1 - bundle..=number {
                    seen.settle(stamp(row), 0);
                    told.push(seen.usual);
                }
                seen.forget_before(t, 500);
            }
            told
        };
        let one_by_one = usual(1);
        assert_eq!((one_by_one[30], one_by_one[79]), (Some(100), Some(160)));
        for bundle in [2, 20, 80] {
            assert!(usual(bundle) == one_by_one, "{bundle} at once");
        }
    }

    #[test]
    fn noise_of_places_is_measured_and_repeated_places_do_not_hide_it() {
        let mut random = 7_u64;
        let mut normal = move || {
            let share = || {
                random = roscausal_discovery::mix(random);
                (random >> 11) as f64 / (1_u64 << 53) as f64
            };
            std::iter::repeat_with(share).take(12).sum::<f64>() - 6.0
        };
        for noise_m in [0.005, 0.05] {
            let places: Vec<(i64, [f64; 2])> = (0..600)
                .map(|k| (100_000_000 * k, [0.12 * k as f64 + noise_m * normal(), noise_m * normal()]))
                .collect();
            let found = noise(&places);
            assert!((found / noise_m - 1.0).abs() < 0.15, "{found} for {noise_m}");
            let twice: Vec<(i64, [f64; 2])> =
                places.iter().flat_map(|&(stamp, at)| [(stamp, at), (stamp + 50_000_000, at)]).collect();
            let found_twice = noise(&twice);
            assert!((found_twice / noise_m - 1.0).abs() < 0.15, "{found_twice} for {noise_m}");
            assert_eq!(noise(&places[..5]), USUAL_NOISE_M, "too few");
        }
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
        assert_eq!(track.at(200, 100, false).expect("a sample").x, 9.0);
        assert!(track.forget_before(250, 100));
        assert_eq!(track.samples.len(), 2);
        assert!(!track.forget_before(401, 100));
    }

    #[test]
    fn who_goes_behind_another_follows() {
        let at = |x: f64, theta: f64, v: f64| Values::from_array([0.0, 0.0, x, 0.0, theta, v, 0.0]);
        let robot = at(0.0, 0.1, 0.5);
        assert_eq!(robot.follows(&at(2.0, -0.1, 1.0)), Some(true));
        assert_eq!(robot.follows(&at(2.0, PI, 1.0)), Some(false), "they meet");
        assert_eq!(robot.follows(&at(-2.0, 0.0, 1.0)), Some(false), "it leads");
        for other in [at(2.0, 0.0, 0.0), at(f64::NAN, 0.0, 1.0), at(0.0, 0.0, 1.0)] {
            assert_eq!(robot.follows(&other), None);
        }
    }

    #[test]
    fn angles_stay_within_a_half_turn() {
        assert_eq!(wrapped(PI), PI);
        assert_eq!(wrapped(-PI), PI);
        assert!((wrapped(7.0) - (7.0 - TAU)).abs() < 1e-12);
        assert!(wrapped(f64::NAN).is_nan());
    }
}
