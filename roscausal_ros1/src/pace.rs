//! Rests for a thread that takes messages one by one, so that it wakes once for several where they come fast.
//!
//! Waking a thread costs the kernel more than a signal's message costs us: at 1 kHz it was a third of the data node's CPU time.
//! What comes during a rest waits in the subscription's queue. Each rest is as long as the last [`FEW`] messages took, so about as
//! many wait at its end: at 1 kHz a rest of 8 ms. (Under ROS 2 one thread reads all topics, and rests for all of them at once:
//! `roscausal_ros2/src/dds/spinner.rs`.)

use std::time::{Duration, Instant};

/// Messages between two rests. A subscription's queue must hold a few times as many.
const FEW: u32 = 8;
/// The longest rest: below 400 messages a second there is none. The data node looks for messages as often.
const LONGEST: Duration = Duration::from_millis(20);

/// When to rest. Call [`Pace::rest`] after each message.
pub(crate) struct Pace {
    taken: u32,
    since: Instant,
}

impl Pace {
    /// Nothing was taken yet, at the time `now`.
    pub(crate) fn new(now: Instant) -> Self {
        Self { taken: 0, since: now }
    }

    /// How long to rest after a message that was taken at the time `now`; `None` to take the next one.
    pub(crate) fn rest(&mut self, now: Instant) -> Option<Duration> {
        self.taken += 1;
        if self.taken < FEW {
            return None;
        }
        let took = now.duration_since(self.since);
        *self = Self::new(now);
        (took <= LONGEST).then_some(took)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Messages at this rate for ten seconds: how often the thread had to wait for one, and the longest delay.
    fn run(rate: u32) -> (u32, Duration) {
        let begin = Instant::now();
        let (mut pace, mut now) = (Pace::new(begin), begin);
        let (mut waits, mut late) = (0, Duration::ZERO);
        for i in 1..=10 * rate {
            let sent = begin + Duration::from_secs(1) * i / rate;
            if sent > now {
                waits += 1;
                now = sent;
            }
            late = late.max(now - sent);
            now += pace.rest(now).unwrap_or_default();
        }
        (waits, late)
    }

    #[test]
    fn fast_messages_wake_the_thread_for_one_in_four_or_less() {
        for rate in [500, 1000, 5000, 100_000] {
            assert!(run(rate).0 <= 10 * rate / 4, "{rate} Hz: {} waits", run(rate).0);
        }
    }

    #[test]
    fn slow_messages_never_wait() {
        for rate in [1, 30, 300] {
            assert_eq!(run(rate), (10 * rate, Duration::ZERO));
        }
    }

    #[test]
    fn no_message_waits_longer_than_the_longest_rest() {
        for rate in [500, 1000, 5000, 100_000] {
            assert!(run(rate).1 <= LONGEST, "{rate} Hz");
        }
    }
}
