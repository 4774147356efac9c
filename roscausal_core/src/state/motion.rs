//! How fast somebody walks, from places alone: a Kalman filter whose state is place and velocity.
//!
//! The difference of two places divides their noise by the step: with 5 cm and 10 Hz it is off by 0.7 m/s. The filter knows
//! how noisy places are and how fast people change their velocity (Bar-Shalom, Li, Kirubarajan: Estimation with Applications to
//! Tracking and Navigation, 2001, section 6.2: white noise acceleration). Its velocity is late: by 0.3 s there.
//! So [`Motion`] is for what is to be known at once, and `Walk`, which also knows the places after, for what is recorded.
//!
//! Steps of the filter:
//! 1. The first place starts it; nothing is known of the velocity.
//! 2. Predict: the place moves with the velocity, and both become less certain by the acceleration.
//! 3. Correct: place and velocity move towards the new place, the more the less certain they were.
//!
//! A walk: one filter comes from the past and one, backwards, from the future; where they meet, each counts as much as it is certain
//! (Fraser and Potter 1969: The optimum linear smoother as a combination of two optimum linear filters). So its velocity is not late. The
//! noise of places alone makes speed of somebody who stands; its mean square is taken off.
//!
//! Why not a library: it is two by two, and a filter crate brings matrices on the heap for each person and step.

use nalgebra::{Matrix2, Vector2};
use roscausal_msgs::Time;

/// How people change their velocity: white noise with the effect of 1 m/s2 that changes each 0.1 s. Square metres per cubic second.
const ACCELERATION: f64 = 0.1;
/// What is not known of a velocity, square metres per square second, ...
const ANY_VELOCITY: f64 = 1e6;
/// ... and less than that if it is.
const KNOWN_VELOCITY: f64 = 1e3;
/// Who is slower than this, metres per second, need not look where the velocity points.
pub(crate) const SLOWEST_HEADING: f64 = 0.05;

/// What is known of somebody at a time.
#[derive(Clone, Copy, Debug)]
struct Belief {
    /// Seconds after any moment.
    at: f64,
    /// Place and velocity (rows) along x and y (columns).
    state: Matrix2<f64>,
    /// Uncertainty of place and velocity along either axis: variances and covariance.
    off: Matrix2<f64>,
    /// The part of it that is noise of places.
    noise: Matrix2<f64>,
}

impl Belief {
    fn new(at: f64, [x, y]: [f64; 2], variance: f64) -> Self {
        let noise = Matrix2::new(variance, 0.0, 0.0, 0.0);
        let off = Matrix2::new(variance, 0.0, 0.0, ANY_VELOCITY);
        Self { at, state: Matrix2::new(x, y, 0.0, 0.0), off, noise }
    }

    /// The same at another time, later or earlier.
    fn moved(self, at: f64) -> Self {
        let dt = at - self.at;
        let way = Matrix2::new(1.0, dt, 0.0, 1.0);
        let (long, short) = (dt.abs() * dt * dt / 3.0, dt.abs() * dt / 2.0);
        let unsure = Matrix2::new(long, short, short, dt.abs()) * ACCELERATION;
        let of = |off: Matrix2<f64>| way * off * way.transpose();
        Self { at, state: way * self.state, off: of(self.off) + unsure, noise: of(self.noise) }
    }

    /// What is known after a place was seen.
    fn corrected(self, place: [f64; 2], variance: f64) -> Self {
        let gain = self.off.column(0) / (self.off[(0, 0)] + variance);
        let rest = Matrix2::new(1.0 - gain[0], 0.0, -gain[1], 1.0);
        let noise = rest * self.noise * rest.transpose() + gain * gain.transpose() * variance;
        let surprise = Vector2::from(place).transpose() - self.state.row(0);
        Self { state: self.state + gain * surprise, off: rest * self.off, noise, ..self }
    }

    /// What places say, one after another, of time 0.
    fn of(places: impl Iterator<Item = (f64, [f64; 2])>, variance: f64) -> Option<Self> {
        let seen = |known: Option<Self>, (at, place)| {
            Some(match known {
                Some(known) => known.moved(at).corrected(place, variance),
                None => Self::new(at, place, variance),
            })
        };
        Some(places.fold(None, seen)?.moved(0.0))
    }
}

/// Where somebody was and how they walked at a moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Walk {
    /// Metres.
    pub(crate) place: [f64; 2],
    /// Along x and y, metres per second.
    pub(crate) velocity: [f64; 2],
    /// The variance that noise of places gives either of them.
    noise: f64,
}

impl Walk {
    /// At time 0 of `places`, in order (seconds before and after it, metres), that are off by `noise_m` (standard deviation); `None` where
    /// they do not determine the velocity.
    pub(crate) fn at(places: &[(f64, [f64; 2])], noise_m: f64) -> Option<Self> {
        let (before, after) = places.split_at(places.partition_point(|(at, _)| *at <= 0.0));
        let variance = noise_m * noise_m;
        let sides =
            [Belief::of(before.iter().copied(), variance), Belief::of(after.iter().rev().copied(), variance)];
        let sure = |side: &Option<Belief>| side.and_then(|side| Some((side, side.off.try_inverse()?)));
        let sides: Vec<(Belief, Matrix2<f64>)> = sides.iter().filter_map(sure).collect();
        let off = sides.iter().map(|(_, sure)| sure).sum::<Matrix2<f64>>().try_inverse()?;
        let (mut state, mut noise) = (Matrix2::zeros(), Matrix2::zeros());
        for (side, sure) in sides {
            let share = off * sure;
            state += share * side.state;
            noise += share * side.noise * share.transpose();
        }
        let [place, velocity] = [0, 1].map(|row| [state[(row, 0)], state[(row, 1)]]);
        (off[(1, 1)] < KNOWN_VELOCITY).then_some(Self { place, velocity, noise: noise[(1, 1)] })
    }

    /// The speed, metres per second.
    pub(crate) fn speed(&self) -> f64 {
        let [x, y] = self.velocity;
        let square = x * x + y * y - 2.0 * self.noise;
        if square < 0.0 { 0.0 } else { square.sqrt() }
    }
}

/// The filter of one person.
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    /// Standard deviation of a place; 0: places are exact, and velocities are differences.
    noise_m: f64,
    /// When the person was first seen.
    start: Time,
    known: Belief,
}

impl Motion {
    /// Somebody who is seen for the first time.
    pub fn new(stamp: Time, place: [f64; 2], noise_m: f64) -> Self {
        Self { noise_m, start: stamp, known: Belief::new(0.0, place, noise_m * noise_m) }
    }

    /// The velocity after a later place; `None` if it is not later.
    pub fn seen(&mut self, stamp: Time, place: [f64; 2]) -> Option<[f64; 2]> {
        let (at, before) = (stamp.secs_since(self.start), self.known);
        if at <= before.at {
            return None;
        }
        if self.noise_m == 0.0 {
            self.known = Belief::new(at, place, 0.0);
            let difference = (self.known.state.row(0) - before.state.row(0)) / (at - before.at);
            return Some([difference[0], difference[1]]);
        }
        self.known = before.moved(at).corrected(place, self.noise_m * self.noise_m);
        Some([self.known.state[(1, 0)], self.known.state[(1, 1)]])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn walk(noise_m: f64, places: impl Iterator<Item = f64>) -> Vec<f64> {
        let mut motion = Motion::new(Time::from_secs_f64(10.0), [0.0, 0.0], noise_m);
        let step = |(i, x): (usize, f64)| {
            motion.seen(Time::from_secs_f64(10.1 + 0.1 * i as f64), [x, -x]).map(|[vx, _]| vx)
        };
        places.enumerate().filter_map(step).collect()
    }

    #[test]
    fn somebody_who_walks_straight_has_her_speed_at_once() {
        let speeds = walk(0.05, (1..50).map(|i| 0.12 * f64::from(i)));
        assert!(speeds.iter().all(|speed| (speed - 1.2).abs() < 1e-5), "{speeds:?}");
    }

    #[test]
    fn noise_of_places_is_filtered_and_a_stop_is_followed_within_a_second() {
        let mut random = roscausal_discovery::mix(1);
        let mut noise = move || {
            random = roscausal_discovery::mix(random);
            ((random >> 11) as f64 / (1_u64 << 53) as f64 - 0.5) * 0.05 * 12_f64.sqrt()
        };
        let places: Vec<f64> = (1..400).map(|i| 0.1 * f64::from(i.min(200)) + noise()).collect();
        let wrong = |speeds: &[f64], from: usize, to: usize, truth: f64| {
            let squares = speeds[from..to].iter().map(|speed| (speed - truth) * (speed - truth));
            (squares.sum::<f64>() / (to - from) as f64).sqrt()
        };
        let (plain, filtered) = (walk(0.0, places.iter().copied()), walk(0.05, places.iter().copied()));
        assert!(wrong(&plain, 50, 199, 1.0) > 0.5, "{}", wrong(&plain, 50, 199, 1.0));
        assert!(wrong(&filtered, 50, 199, 1.0) < 0.2, "{}", wrong(&filtered, 50, 199, 1.0));
        assert!(wrong(&filtered, 212, 399, 0.0) < 0.25, "{}", wrong(&filtered, 212, 399, 0.0));
    }

    /// Mean speed, and the root of the mean squared error, of what places half a second ahead and a second before say at 10 Hz.
    fn walked(noise_m: f64, place: impl Fn(f64) -> [f64; 2], speed: impl Fn(f64) -> f64) -> [f64; 2] {
        let mut random = roscausal_discovery::mix(3);
        let mut noise = move || {
            random = roscausal_discovery::mix(random);
            ((random >> 11) as f64 / (1_u64 << 53) as f64 - 0.5) * noise_m * 12_f64.sqrt()
        };
        let places: Vec<(f64, [f64; 2])> = (0..600)
            .map(|k| (0.1 * f64::from(k), place(0.1 * f64::from(k)).map(|at| at + noise())))
            .collect();
        let at = |k: usize| {
            let near: Vec<(f64, [f64; 2])> =
                places[k - 10..=k + 5].iter().map(|(t, at)| (t - places[k].0, *at)).collect();
            let found = Walk::at(&near, noise_m).expect("places tell it").speed();
            [found, (found - speed(places[k].0)).powi(2)]
        };
        let all: Vec<[f64; 2]> = (10..590).map(at).collect();
        let mean = |which: usize| all.iter().map(|one| one[which]).sum::<f64>() / all.len() as f64;
        [mean(0), mean(1).sqrt()]
    }

    #[test]
    fn a_walk_has_no_delay_and_a_standing_person_no_speed() {
        // The speed swings in six seconds.
        let place = |t: f64| [1.2 * t - 0.3 * t.cos(), 0.5 * t];
        let speed = |t: f64| libm::hypot(1.2 + 0.3 * t.sin(), 0.5);
        let [_, exact] = walked(0.002, place, speed);
        assert!(exact < 0.03, "{exact}");
        let [_, now] = walked(0.05, place, speed);
        let [_, before] = walked(0.05, place, |t| speed(t - 0.3));
        let [_, after] = walked(0.05, place, |t| speed(t + 0.3));
        assert!(now < 0.08 && now < before && now < after, "{now} {before} {after}");
        let [stands, _] = walked(0.05, |_| [3.0, 4.0], |_| 0.0);
        assert!(stands < 0.03, "{stands}");
    }

    #[test]
    fn one_place_tells_no_velocity() {
        assert!(Walk::at(&[(0.0, [1.0, 2.0])], 0.05).is_none() && Walk::at(&[], 0.05).is_none());
        let two = Walk::at(&[(-0.1, [1.0, 2.0]), (0.1, [1.2, 2.0])], 0.002).expect("two");
        assert!((two.velocity[0] - 1.0).abs() < 1e-3 && (two.place[0] - 1.1).abs() < 1e-6);
    }

    #[test]
    fn the_same_moment_again_tells_nothing() {
        let mut motion = Motion::new(Time::from_secs_f64(1.0), [0.0, 0.0], 0.05);
        assert!(motion.seen(Time::from_secs_f64(1.0), [9.0, 9.0]).is_none());
        let [vx, vy] = motion.seen(Time::from_secs_f64(2.0), [1.0, 0.0]).expect("later");
        assert!((vx - 1.0).abs() < 1e-6 && vy == 0.0, "{vx} {vy}");
    }
}
