//! How fast somebody walks, from places alone: a Kalman filter whose state is place and velocity.
//!
//! The difference of two places divides their noise by the step: with 5 cm and 10 Hz it is off by 0.7 m/s. The filter knows
//! how noisy places are and how fast people change their velocity (Bar-Shalom, Li, Kirubarajan: Estimation with Applications to
//! Tracking and Navigation, 2001, section 6.2: discrete white noise acceleration).
//!
//! Steps, for x and y alike:
//! 1. The first place starts it; nothing is known of the velocity. The second one gives the velocity as a difference.
//! 2. Predict: the place moves with the velocity, and both become less certain by the acceleration.
//! 3. Correct: place and velocity move towards the new place, the more the less certain they were.
//!
//! Why not a library: it is two by two, and a filter crate brings matrices on the heap for each person and step.

use roscausal_msgs::Time;

/// How people change their velocity, standard deviation. Metres per second squared.
const ACCELERATION: f64 = 1.0;

/// The filter of one person.
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    /// Standard deviation of a place; 0: places are exact, and velocities are differences.
    noise_m: f64,
    stamp: Time,
    axes: [Axis; 2],
    started: bool,
}

#[derive(Clone, Copy, Debug, Default)]
struct Axis {
    place: f64,
    velocity: f64,
    /// Variances of place and velocity, and what they share.
    place_var: f64,
    both_var: f64,
    velocity_var: f64,
}

impl Motion {
    /// Somebody who is seen for the first time.
    pub fn new(stamp: Time, place: [f64; 2], noise_m: f64) -> Self {
        let axes = place.map(|place| Axis { place, ..Axis::default() });
        Self { noise_m, stamp, axes, started: false }
    }

    /// The velocity after a later place; `None` if it is not later.
    pub fn seen(&mut self, stamp: Time, place: [f64; 2]) -> Option<[f64; 2]> {
        let dt = stamp.secs_since(self.stamp);
        if dt <= 0.0 {
            return None;
        }
        let variance = self.noise_m * self.noise_m;
        let starts = !std::mem::replace(&mut self.started, true) || variance == 0.0;
        for (axis, place) in self.axes.iter_mut().zip(place) {
            if starts { axis.start(dt, place, variance) } else { axis.step(dt, place, variance) }
        }
        self.stamp = stamp;
        Some(self.axes.map(|axis| axis.velocity))
    }
}

impl Axis {
    fn start(&mut self, dt: f64, place: f64, variance: f64) {
        self.velocity = (place - self.place) / dt;
        self.place = place;
        self.place_var = variance;
        self.both_var = variance / dt;
        self.velocity_var = 2.0 * variance / (dt * dt) + ACCELERATION * ACCELERATION * dt * dt / 4.0;
    }

    fn step(&mut self, dt: f64, place: f64, variance: f64) {
        let q = ACCELERATION * ACCELERATION;
        self.place += self.velocity * dt;
        self.place_var += dt * (2.0 * self.both_var + dt * self.velocity_var) + q * dt.powi(4) / 4.0;
        self.both_var += dt * self.velocity_var + q * dt.powi(3) / 2.0;
        self.velocity_var += q * dt * dt;
        let total = self.place_var + variance;
        let (gain, gain_velocity) = (self.place_var / total, self.both_var / total);
        let surprise = place - self.place;
        self.place += gain * surprise;
        self.velocity += gain_velocity * surprise;
        self.velocity_var -= gain_velocity * self.both_var;
        self.both_var *= 1.0 - gain;
        self.place_var *= 1.0 - gain;
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
        assert!(speeds.iter().all(|speed| (speed - 1.2).abs() < 1e-9), "{speeds:?}");
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

    #[test]
    fn the_same_moment_again_tells_nothing() {
        let mut motion = Motion::new(Time::from_secs_f64(1.0), [0.0, 0.0], 0.05);
        assert!(motion.seen(Time::from_secs_f64(1.0), [9.0, 9.0]).is_none());
        assert_eq!(motion.seen(Time::from_secs_f64(2.0), [1.0, 0.0]), Some([1.0, 0.0]));
    }
}
