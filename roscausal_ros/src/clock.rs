//! Time: that of the system, or that of `/clock` if `use_sim_time` is true.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicI64, Ordering};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use roscausal_core::Time;

use crate::lock;

/// If `/clock` is silent for this long, a warning is logged.
const SILENCE: Duration = Duration::from_secs(5);

/// The clock in use.
#[derive(Default)]
pub struct Clock {
    simulated: AtomicBool,
    /// The last time from `/clock`.
    nanos: AtomicI64,
    heard: Mutex<Heard>,
}

struct Heard {
    last: Instant,
    silent: bool,
}

impl Default for Heard {
    fn default() -> Self {
        Self { last: Instant::now(), silent: false }
    }
}

impl Clock {
    /// Switches between `/clock` and the system clock.
    pub fn simulate(&self, on: bool) {
        *lock(&self.heard) = Heard::default();
        self.simulated.store(on, Ordering::SeqCst);
    }

    /// Whether time comes from `/clock`.
    pub fn is_simulated(&self) -> bool {
        self.simulated.load(Ordering::SeqCst)
    }

    /// The current time; 0 until the first `/clock`.
    pub fn now(&self) -> Time {
        if self.is_simulated() {
            return Time::from_nanos(self.nanos.load(Ordering::SeqCst));
        }
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Time::from_nanos(i64::try_from(since.as_nanos()).unwrap_or(i64::MAX))
    }

    /// Sets the time from a `/clock` message. If the clock jumps back (a bag that restarts, a simulation that is
    /// reset), time follows it, and the jump is logged.
    pub fn tick(&self, now: Time) {
        let before = Time::from_nanos(self.nanos.swap(now.as_nanos(), Ordering::SeqCst));
        let runs_again = {
            let mut heard = lock(&self.heard);
            heard.last = Instant::now();
            std::mem::take(&mut heard.silent)
        };
        if runs_again {
            tracing::info!("/clock runs again, at {:.3} s", now.as_secs_f64());
        }
        if now < before {
            let (before, now) = (before.as_secs_f64(), now.as_secs_f64());
            tracing::warn!("/clock jumped back from {before:.3} s to {now:.3} s");
        }
    }

    /// Logs once when `/clock` is silent, because everything waits then. Call it about once a second.
    pub fn watch(&self) {
        let falls_silent = {
            let mut heard = lock(&self.heard);
            let silent = self.is_simulated() && heard.last.elapsed() >= SILENCE;
            silent && !std::mem::replace(&mut heard.silent, silent)
        };
        if falls_silent {
            tracing::warn!(
                "use_sim_time is true, but /clock has been silent for {} s: time stands at {:.3} s until a simulator \
                 or a bag that is played with its clock publishes it, or use_sim_time is set to false before the start",
                SILENCE.as_secs(),
                self.now().as_secs_f64()
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn simulated_time_is_what_the_clock_topic_last_said() {
        let clock = Clock::default();
        assert!(clock.now().as_secs_f64() > 1.7e9);
        clock.simulate(true);
        assert_eq!(clock.now(), Time::from_nanos(0));
        for nanos in [100, 50] {
            clock.tick(Time::from_nanos(nanos));
            assert_eq!(clock.now(), Time::from_nanos(nanos));
        }
    }

    #[test]
    fn a_silent_clock_is_told_once_until_it_runs_again() {
        let clock = Clock::default();
        clock.simulate(true);
        let is_silent = || lock(&clock.heard).silent;
        clock.watch();
        assert!(!is_silent());
        let Some(long_ago) = Instant::now().checked_sub(SILENCE) else { return };
        lock(&clock.heard).last = long_ago;
        clock.watch();
        assert!(is_silent());
        clock.tick(Time::from_nanos(1));
        assert!(!is_silent());
    }
}
