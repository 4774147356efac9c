//! Time: the system's, or `/clock` where `/use_sim_time` is true.

use std::{
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicI64, Ordering},
    },
    time::{Duration, Instant, SystemTime, UNIX_EPOCH},
};

use roscausal_core::Time;

/// `/clock` silent for so long is worth a line.
const SILENCE: Duration = Duration::from_secs(5);

/// The clock in use.
pub(crate) enum Clock {
    System,
    Simulated(Simulated),
}

/// What `/clock` last said.
pub(crate) struct Simulated {
    nanos: AtomicI64,
    heard: Mutex<Heard>,
}

struct Heard {
    last: Instant,
    silent: bool,
}

impl Clock {
    pub(crate) fn simulated() -> Self {
        let heard = Mutex::new(Heard { last: Instant::now(), silent: false });
        Self::Simulated(Simulated { nanos: AtomicI64::new(0), heard })
    }

    /// Time of now; 0 until the first `/clock`.
    pub(crate) fn now(&self) -> Time {
        match self {
            Self::System => {
                let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
                Time::from_nanos(i64::try_from(since.as_nanos()).unwrap_or(i64::MAX))
            }
            Self::Simulated(clock) => Time::from_nanos(clock.nanos.load(Ordering::SeqCst)),
        }
    }
}

impl Simulated {
    /// Takes a `/clock` message. A clock that jumps back (a bag that starts anew, a simulation that is reset) is
    /// followed, and told.
    pub(crate) fn set(&self, now: Time) {
        let before = Time::from_nanos(self.nanos.swap(now.as_nanos(), Ordering::SeqCst));
        let mut heard = self.heard.lock().unwrap_or_else(PoisonError::into_inner);
        heard.last = Instant::now();
        if std::mem::take(&mut heard.silent) {
            tracing::info!("/clock runs again, at {:.3} s", now.as_secs_f64());
        }
        if now < before {
            tracing::warn!(
                "/clock jumped back from {:.3} s to {:.3} s",
                before.as_secs_f64(),
                now.as_secs_f64()
            );
        }
    }

    /// Says once when `/clock` is silent: everything then waits.
    pub(crate) fn watch(&self) {
        let mut heard = self.heard.lock().unwrap_or_else(PoisonError::into_inner);
        if heard.last.elapsed() >= SILENCE && !heard.silent {
            heard.silent = true;
            let at = Time::from_nanos(self.nanos.load(Ordering::SeqCst)).as_secs_f64();
            tracing::warn!(
                "/use_sim_time is true, but /clock has been silent for {} s: time stands at {at:.3} s until a \
                 simulator or a bag (rosbag play --clock) publishes it, or /use_sim_time is set to false before the start",
                SILENCE.as_secs()
            );
        }
    }
}
