//! Pairs messages of two topics whose stamps are close.

use std::collections::VecDeque;

use crate::Time;

/// A stamp that is older than the last one by more than this is not late: the clock jumped back. Seconds.
const JUMP_S: f64 = 1.0;
/// Messages of B younger than this are kept whatever the size of the queue. Seconds.
const KEEP_S: f64 = 0.5;
/// Most messages that wait.
const MOST: usize = 4096;

/// Pairs each message of topic A with the nearest one of topic B.
///
/// A pair is made once its B is known to be the nearest, that is, when a B at or after A's stamp has arrived. So
/// the pairs depend on the stamps only, not on the order in which the two topics arrive.
#[derive(Debug, Default)]
pub struct Pairing<A, B> {
    a: VecDeque<(Time, A)>,
    b: VecDeque<(Time, B)>,
    /// Stamp of the newest A, even if it no longer waits.
    newest_a: Option<Time>,
    queue_size: usize,
    slop_s: f64,
    /// Messages of A without a partner.
    pub unpaired: u64,
    /// Messages that are out of order; they are left out.
    pub late: u64,
    /// Messages that repeat a stamp; the first one counts.
    pub repeated: u64,
}

impl<A, B: Clone> Pairing<A, B> {
    /// Pairs that are at most `slop_s` seconds apart. At most `queue_size` messages of each topic wait.
    pub fn new(queue_size: usize, slop_s: f64) -> Self {
        Self {
            a: VecDeque::new(),
            b: VecDeque::new(),
            newest_a: None,
            queue_size: queue_size.max(1),
            slop_s,
            unpaired: 0,
            late: 0,
            repeated: 0,
        }
    }

    /// Adds a message of topic A and returns the pairs that it completes.
    pub fn push_a(&mut self, stamp: Time, message: A) -> Vec<(A, B)> {
        match self.newest_a {
            Some(last) if last.secs_since(stamp) > JUMP_S => self.clear(),
            Some(last) if last >= stamp => return self.leave_out(last > stamp),
            _ => {}
        }
        self.newest_a = Some(stamp);
        self.a.push_back((stamp, message));
        if self.a.len() > self.queue_size {
            self.a.pop_front();
            self.unpaired += 1;
        }
        self.pairs()
    }

    /// Adds a message of topic B and returns the pairs that it completes.
    pub fn push_b(&mut self, stamp: Time, message: B) -> Vec<(A, B)> {
        match self.b.back() {
            Some((last, _)) if last.secs_since(stamp) > JUMP_S => self.clear(),
            Some((last, _)) if *last >= stamp => return self.leave_out(*last > stamp),
            _ => {}
        }
        self.b.push_back((stamp, message));
        // However fast B is, the waiting messages reach back far enough for a late A.
        while self.b.len() > self.queue_size.max(2)
            && (self.b.len() > MOST || self.b.front().is_some_and(|(t, _)| stamp.secs_since(*t) > KEEP_S))
        {
            self.b.pop_front();
        }
        self.pairs()
    }

    /// Takes a message of each topic, both of the same stamp; the pairs that they complete.
    pub fn push_both(&mut self, stamp: Time, a: A, b: B) -> Vec<(A, B)> {
        let left_out = self.late + self.repeated;
        let mut pairs = self.push_a(stamp, a);
        if self.late + self.repeated == left_out {
            pairs.extend(self.push_b(stamp, b));
        }
        pairs
    }

    /// Counts a message that makes no pair, as one out of order or with the stamp of another.
    pub(super) fn leave_out<P>(&mut self, is_late: bool) -> Vec<P> {
        let count = if is_late { &mut self.late } else { &mut self.repeated };
        *count += 1;
        Vec::new()
    }

    /// Drops all waiting messages: time jumped back.
    pub fn clear(&mut self) {
        self.unpaired += self.a.len() as u64;
        self.a.clear();
        self.b.clear();
        self.newest_a = None;
    }

    fn pairs(&mut self) -> Vec<(A, B)> {
        let mut pairs = Vec::new();
        while let (Some((stamp, _)), Some((newest, _))) = (self.a.front(), self.b.back()) {
            let stamp = *stamp;
            if *newest < stamp {
                break;
            }
            // Of two at the same distance, the earlier one.
            let distance = |(other, _): &(Time, B)| other.secs_since(stamp).abs();
            let nearest = self.b.iter().min_by(|one, two| distance(one).total_cmp(&distance(two)));
            let partner =
                nearest.filter(|b| distance(b) <= self.slop_s + 1e-9).map(|(_, message)| message.clone());
            match (self.a.pop_front(), partner) {
                (Some((_, message)), Some(partner)) => pairs.push((message, partner)),
                _ => self.unpaired += 1,
            }
            // Nothing older than this A's partner can be a partner any more.
            while self.b.len() > 1 && self.b[1].0 <= stamp {
                self.b.pop_front();
            }
        }
        pairs
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn at(millis: i64) -> Time {
        Time::from_nanos(millis * 1_000_000)
    }

    proptest! {
        #[test]
        fn pairs_are_within_slop_and_do_not_depend_on_the_order_of_the_topics(
            mut a in prop::collection::vec(0_i64..2000, 1..30),
            mut b in prop::collection::vec(0_i64..2000, 1..30),
        ) {
            a.sort_unstable();
            b.sort_unstable();
            a.dedup();
            b.dedup();
            let mut a_first = Pairing::new(100, 0.1);
            let mut found: Vec<(i64, i64)> = a.iter().flat_map(|&t| a_first.push_a(at(t), t)).collect();
            found.extend(b.iter().flat_map(|&t| a_first.push_b(at(t), t)));
            let mut b_first = Pairing::new(100, 0.1);
            let mut other: Vec<(i64, i64)> = b.iter().flat_map(|&t| b_first.push_b(at(t), t)).collect();
            other.extend(a.iter().flat_map(|&t| b_first.push_a(at(t), t)));
            for (one, two) in &found {
                prop_assert!((one - two).abs() <= 100);
            }
            prop_assert_eq!(found, other);
        }
    }

    #[test]
    fn a_clock_that_jumps_back_starts_anew() {
        let mut pairing = Pairing::new(10, 0.1);
        pairing.push_a(at(5000), 1);
        pairing.push_a(at(100), 2);
        assert_eq!(pairing.push_b(at(100), 3), [(2, 3)]);
        assert_eq!(pairing.unpaired, 1);
    }

    #[test]
    fn a_late_message_is_left_out_and_costs_nothing_else() {
        let mut pairing = Pairing::new(10, 0.1);
        pairing.push_b(at(1000), 1);
        pairing.push_b(at(980), 2);
        pairing.push_b(at(1000), 3);
        assert_eq!(pairing.push_a(at(1000), 0), [(0, 1)]);
        assert_eq!((pairing.late, pairing.repeated), (1, 1));
    }

    #[test]
    fn messages_of_one_stamp_are_a_pair_at_once_and_late_ones_are_counted_once() {
        let mut pairing = Pairing::new(10, 0.1);
        assert_eq!(pairing.push_both(at(1000), 1, 2), [(1, 2)]);
        assert_eq!(pairing.push_both(at(1000), 3, 4), []);
        assert_eq!((pairing.push_both(at(1100), 5, 6), pairing.repeated), (vec![(5, 6)], 1));
        assert_eq!((pairing.push_both(at(1050), 7, 8), pairing.late), (vec![], 1));
    }

    #[test]
    fn a_fast_topic_does_not_push_out_the_partner_of_a_slow_one() {
        let mut pairing = Pairing::new(10, 0.1);
        (0..1000).for_each(|t| drop(pairing.push_b(at(t), t)));
        assert_eq!(pairing.push_a(at(800), 0), [(0, 800)]);
        assert!(pairing.b.len() < 600);
    }
}
