//! Goals over time: which goal applies at a stamp.

use std::collections::VecDeque;

use roscausal_msgs::geometry_msgs::Point;

use crate::Time;

/// Number of goals that are remembered. A state older than all of them has none.
const KEPT: usize = 16;

/// A point in a frame.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Goal {
    /// Frame; empty for the target frame.
    pub(super) frame: String,
    /// Metres.
    pub(super) point: Point,
}

/// The goals given so far. A state gets the goal that applied at its stamp, whichever of the two arrived first.
#[derive(Debug, Default)]
pub(super) struct Goals {
    given: VecDeque<(Time, Goal)>,
}

impl Goals {
    /// Adds a goal from `stamp` on, but no later than `now` (a sender's clock may be ahead). A goal that is not
    /// finite means "no goal from here on".
    pub(super) fn give(&mut self, stamp: Time, now: Time, goal: Goal) {
        let stamp = if stamp == Time::ZERO { now } else { stamp.min(now) };
        // The same goal again is not a change. A parameter that is read every second repeats it.
        if self.given.back().is_some_and(|(earlier, last)| *earlier <= stamp && *last == goal) {
            return;
        }
        let at = self.given.partition_point(|(earlier, _)| *earlier <= stamp);
        self.given.insert(at, (stamp, goal));
        if self.given.len() > KEPT {
            self.given.pop_front();
        }
    }

    /// The goal that applies at `stamp`.
    pub(super) fn at(&self, stamp: Time) -> Option<&Goal> {
        let after = self.given.partition_point(|(earlier, _)| *earlier <= stamp);
        let (_, goal) = self.given.get(after.checked_sub(1)?)?;
        (goal.point.x.is_finite() && goal.point.y.is_finite()).then_some(goal)
    }

    /// After the clock jumped back: the last goal applies from the beginning.
    pub(super) fn restart(&mut self) {
        if let Some((_, goal)) = self.given.pop_back() {
            self.given.clear();
            self.given.push_back((Time::from_nanos(i64::MIN), goal));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn goal(x: f64) -> Goal {
        Goal { frame: String::new(), point: Point { x, ..Point::default() } }
    }

    #[test]
    fn a_goal_told_again_and_again_is_one_goal() {
        let at = Time::from_secs_f64;
        let mut goals = Goals::default();
        goals.give(at(1.0), at(1.0), goal(1.0));
        (2..100).for_each(|t| goals.give(Time::ZERO, at(f64::from(t)), goal(2.0)));
        assert_eq!(goals.at(at(1.5)).map(|g| g.point.x), Some(1.0));
    }

    #[test]
    fn a_state_has_the_goal_in_force_at_its_stamp() {
        let at = Time::from_secs_f64;
        let mut goals = Goals::default();
        goals.give(at(5.0), at(5.0), goal(1.0));
        goals.give(at(3.0), at(5.0), goal(0.0));
        assert_eq!(goals.at(at(2.9)), None);
        assert_eq!(goals.at(at(4.0)).map(|g| g.point.x), Some(0.0));
        assert_eq!(goals.at(at(5.0)).map(|g| g.point.x), Some(1.0));
        goals.give(at(99.0), at(6.0), goal(f64::NAN));
        assert_eq!(goals.at(at(6.0)), None);
        goals.give(at(7.0), at(7.0), goal(7.0));
        goals.restart();
        assert_eq!(goals.at(at(0.0)).map(|g| g.point.x), Some(7.0));
    }
}
