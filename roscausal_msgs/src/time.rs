//! Times and durations of ROS.

use serde::{Deserialize, Serialize};

/// A ROS time: seconds and nanoseconds since the epoch of the clock in use.
///
/// It has the bytes of ROS 1's `time` and of ROS 2's `builtin_interfaces/Time`. It is ordered by time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Time {
    /// Whole seconds.
    pub sec: i32,
    /// Nanoseconds within the second, below 1e9.
    pub nanosec: u32,
}

/// A ROS duration: seconds and nanoseconds, where the nanoseconds always count forwards.
///
/// It has the bytes of ROS 1's `duration` and of ROS 2's `builtin_interfaces/Duration`. It is ordered by length.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Duration {
    /// Whole seconds, rounded down.
    pub sec: i32,
    /// Nanoseconds above `sec`, below 1e9.
    pub nanosec: u32,
}

impl Duration {
    /// A duration from seconds, rounded to the nanosecond.
    pub fn from_secs_f64(secs: f64) -> Self {
        let Time { sec, nanosec } = Time::from_secs_f64(secs);
        Self { sec, nanosec }
    }

    /// Seconds.
    pub fn as_secs_f64(self) -> f64 {
        f64::from(self.sec) + f64::from(self.nanosec) * 1e-9
    }
}

const NANOS: i64 = 1_000_000_000;

impl Time {
    /// The stamp 0, which ROS reads as "no stamp".
    pub const ZERO: Self = Self { sec: 0, nanosec: 0 };
    /// Later than any other stamp.
    pub const MAX: Self = Self { sec: i32::MAX, nanosec: 999_999_999 };

    /// A stamp from nanoseconds, limited to the range of the wire format.
    pub fn from_nanos(nanos: i64) -> Self {
        match i32::try_from(nanos.div_euclid(NANOS)) {
            Ok(sec) => Self { sec, nanosec: nanos.rem_euclid(NANOS) as u32 },
            Err(_) if nanos < 0 => Self { sec: i32::MIN, nanosec: 0 },
            Err(_) => Self::MAX,
        }
    }

    /// Nanoseconds since the clock's epoch.
    pub fn as_nanos(self) -> i64 {
        i64::from(self.sec) * NANOS + i64::from(self.nanosec)
    }

    /// A stamp from seconds, rounded to the nanosecond.
    pub fn from_secs_f64(secs: f64) -> Self {
        Self::from_nanos((secs * 1e9).round() as i64)
    }

    /// Seconds since the clock's epoch.
    pub fn as_secs_f64(self) -> f64 {
        f64::from(self.sec) + f64::from(self.nanosec) * 1e-9
    }

    /// The stamp `secs` later (earlier if negative).
    pub fn plus_secs(self, secs: f64) -> Self {
        Self::from_nanos(self.as_nanos().saturating_add((secs * 1e9).round() as i64))
    }

    /// Seconds from `earlier` to this stamp; negative if this one is earlier.
    pub fn secs_since(self, earlier: Self) -> f64 {
        (self.as_nanos() - earlier.as_nanos()) as f64 * 1e-9
    }
}

#[cfg(test)]
mod tests {
    use super::Time;

    #[test]
    fn nanoseconds_round_trip_on_both_sides_of_zero() {
        for nanos in [-1_500_000_001, -1, 0, 1, 999_999_999, 1_000_000_000, 1_700_000_000_123_456_789] {
            assert_eq!(Time::from_nanos(nanos).as_nanos(), nanos);
        }
        assert_eq!(Time::from_nanos(i64::MAX), Time::MAX);
    }
}
