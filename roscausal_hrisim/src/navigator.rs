//! The route of one body to its goal, corner by corner.

use crate::{geometry::Vec2, world::World};

/// Steps between two checks of the way ahead.
const LOOK_EVERY: u64 = 5;
/// A corner counts as passed within this distance, metres.
const PASSED: f64 = 0.3;
/// Space kept from walls when looking ahead, metres.
const SIGHT: f64 = 0.3;

/// A route, and how much of it is left.
#[derive(Clone, Debug)]
pub(crate) struct Navigator {
    goal: Vec2,
    /// Corners still to pass: the goal first, the next corner last.
    corners: Vec<Vec2>,
}

impl Navigator {
    /// The route from `from` to `goal`; a straight line if there is no route.
    fn new(world: &World, from: Vec2, goal: Vec2) -> Self {
        let mut corners = world.route(from, goal).unwrap_or_else(|| vec![goal]);
        corners.reverse();
        Self { goal, corners }
    }

    /// The next place on the way from `position` to `goal`: on the way that is known, or a new one.
    pub(crate) fn next(way: &mut Option<Self>, world: &World, position: Vec2, goal: Vec2, step: u64) -> Vec2 {
        let known = way.take().filter(|way| way.goal == goal);
        way.insert(known.unwrap_or_else(|| Self::new(world, position, goal))).target(world, position, step)
    }

    /// The point to walk to now: the farthest corner in sight.
    fn target(&mut self, world: &World, position: Vec2, step: u64) -> Vec2 {
        while self.corners.len() > 1 {
            let passed = self.corners[self.corners.len() - 1].distance(position) < PASSED;
            let looks = step.is_multiple_of(LOOK_EVERY);
            let in_sight = || world.is_clear(position, self.corners[self.corners.len() - 2], SIGHT);
            if !(passed || looks && in_sight()) {
                break;
            }
            self.corners.pop();
        }
        let next = self.corners.last().copied().unwrap_or(self.goal);
        let lost =
            step.is_multiple_of(LOOK_EVERY * 5) && next != self.goal && !world.is_clear(position, next, 0.05);
        if lost {
            *self = Self::new(world, position, self.goal);
        }
        self.corners.last().copied().unwrap_or(self.goal)
    }
}
