//! The places of the plans, and the order of everybody's goals.

use crate::{
    geometry::{Area, Vec2},
    rng::Rng,
    scenario::{Plan, Scenario},
    world::World,
};

const fn p(x: f64, y: f64) -> Vec2 {
    Vec2::new(x, y)
}

const THOR_AREAS: [[Vec2; 4]; 4] = [
    [p(5.0, -5.0), p(5.0, -9.0), p(9.0, -5.0), p(7.5, -8.0)],
    [p(7.5, 4.5), p(6.0, 4.5), p(6.0, 3.0), p(7.5, 3.0)],
    [p(-7.5, 7.0), p(-5.5, 7.0), p(-5.5, 9.0), p(-7.5, 9.0)],
    [p(-8.0, -5.5), p(-10.0, -5.5), p(-10.0, -2.5), p(-8.0, -2.5)],
];
const THOR_WAYPOINTS: [Vec2; 4] = [p(2.0, -5.0), p(2.0, 5.0), p(-2.0, 5.0), p(-2.0, -5.0)];

const CENTRE_AREAS: [[Vec2; 3]; 2] =
    [[p(3.5, -5.0), p(-5.0, 3.5), p(-6.5, -6.5)], [p(5.0, -3.5), p(-3.5, 5.0), p(6.5, 6.5)]];
const CENTRE_WAYPOINTS: [Vec2; 2] = [p(-5.0, 5.0), p(5.0, -5.0)];

/// The areas of a person's goals: their own, or those of the plan. Empty in a crowd: anywhere.
pub(crate) fn person_areas(scenario: &Scenario, person: usize) -> Vec<Area> {
    if let Some(own) = scenario.people.get(person).filter(|own| !own.areas.is_empty()) {
        return own.areas.clone();
    }
    match scenario.plan {
        Plan::Thor => THOR_AREAS.iter().map(|corners| Area(sorted_around(corners))).collect(),
        Plan::PassByTheCentre | Plan::RobotOff => {
            CENTRE_AREAS.iter().map(|corners| Area(corners.to_vec())).collect()
        }
        Plan::Crowd => Vec::new(),
    }
}

/// The waypoints of a robot: its own, or those of the plan. Empty in a crowd: drawn at random. `robot_off` has one.
pub(crate) fn robot_waypoints(scenario: &Scenario, robot: usize) -> Vec<Vec2> {
    if let Some(own) = scenario.robots.get(robot).filter(|own| !own.waypoints.is_empty()) {
        return own.waypoints.clone();
    }
    match scenario.plan {
        Plan::Thor => THOR_WAYPOINTS.to_vec(),
        Plan::PassByTheCentre => CENTRE_WAYPOINTS.to_vec(),
        Plan::RobotOff => vec![CENTRE_WAYPOINTS[0]],
        Plan::Crowd => Vec::new(),
    }
}

/// The corners ordered around the centre, so that the fan of triangles covers the polygon once.
fn sorted_around(corners: &[Vec2]) -> Vec<Vec2> {
    let centre = Area(corners.to_vec()).centre();
    let mut sorted = corners.to_vec();
    sorted.sort_by(|a, b| (*a - centre).angle().total_cmp(&(*b - centre).angle()));
    sorted
}

/// The goals of one person.
#[derive(Clone, Debug)]
pub(crate) struct Goals {
    areas: Vec<Area>,
    plan: Plan,
    last: Option<usize>,
    rng: Rng,
}

impl Goals {
    pub(crate) fn new(scenario: &Scenario, person: usize, rng: Rng) -> Self {
        Self { areas: person_areas(scenario, person), plan: scenario.plan, last: None, rng }
    }

    /// The next goal.
    pub(crate) fn next(&mut self, world: &World, from: Vec2) -> Vec2 {
        if self.areas.is_empty() {
            return world.random_free(&mut self.rng, from, 0.6).unwrap_or(from);
        }
        let n = self.areas.len();
        let chosen = match (self.last, self.plan) {
            (None, Plan::Thor | Plan::Crowd) => self.rng.below(n),
            (None, Plan::PassByTheCentre | Plan::RobotOff) => 0,
            (Some(last), Plan::PassByTheCentre | Plan::RobotOff) => (last + 1) % n,
            (Some(last), Plan::Thor | Plan::Crowd) => (last + 1 + self.rng.below(n - 1)) % n,
        };
        self.last = Some(chosen);
        self.areas[chosen].sample(&mut self.rng)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn goals_of(plan: Plan, count: usize) -> Vec<usize> {
        let scenario = Scenario { plan, ..Scenario::default() };
        let world = scenario.world().unwrap();
        let mut goals = Goals::new(&scenario, 0, Rng::new(1, 0));
        (0..count)
            .map(|_| {
                goals.next(&world, Vec2::ZERO);
                goals.last.unwrap()
            })
            .collect()
    }

    #[test]
    fn thor_visits_all_areas_and_none_twice_running() {
        let visited = goals_of(Plan::Thor, 400);
        assert!(visited.windows(2).all(|pair| pair[0] != pair[1]));
        for area in 0..4 {
            let count = visited.iter().filter(|&&visit| visit == area).count();
            assert!((75..125).contains(&count), "{area}: {count}");
        }
    }

    #[test]
    fn crossing_goals_alternate() {
        assert_eq!(goals_of(Plan::RobotOff, 4), [0, 1, 0, 1]);
        assert_eq!(goals_of(Plan::PassByTheCentre, 4), [0, 1, 0, 1]);
    }
}
