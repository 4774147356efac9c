//! The person of the paper, who walks from goal to goal, slows down near them, brakes for a robot and goes around
//! it.
//!
//! The person is a unicycle. It decides on what it saw `reaction` seconds ago. The body follows with limited
//! acceleration and turning rate.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use crate::{
    collision::Approach,
    geometry::{Segment, Vec2, wrap},
    navigator::Navigator,
    rng::Rng,
    world::World,
};

roscausal_core::with_defaults! {
    /// How a person walks.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct PersonParams {
        /// Speed far from the goal, m/s.
        pub speed: f64 = 1.5,
        /// Maximum acceleration, m/s2.
        pub acceleration: f64 = 0.7,
        /// Maximum deceleration, m/s2.
        pub braking: f64 = 0.7,
        /// Maximum turning rate, rad/s.
        pub turn_rate: f64 = 0.45,
        /// Heading error at which the person stops to turn, radians.
        pub turn_in_place: f64 = 0.8,
        /// Whether turning slows them down. If not, the person turns as fast as their speed requires.
        pub slows_in_turns: bool = true,
        /// The person slows down when the goal is nearer than this, metres; 0: never.
        pub slow_distance: f64 = 4.0,
        /// Fraction of `speed` that remains at the goal. In between, speed is linear in the distance.
        pub slow_floor: f64 = 0.43,
        /// Their goal is reached within this distance, metres.
        pub arrival: f64 = 0.5,
        /// Delay between seeing and acting, seconds.
        pub reaction: f64 = 0.4,
        /// Whether the person gives way to robots and people.
        pub avoids: bool = true,
        /// Half-width of the triangle within which the person brakes for a robot, and distance that the person keeps from it, metres.
        pub robot_radius: f64 = 2.0,
        /// The person brakes for robots nearer than this, metres.
        pub brake_within: f64 = 5.0,
        /// Fraction of `speed` that remains when braking.
        pub brake_to: f64 = 0.3,
        /// The person steers around robots nearer than this, metres.
        pub steer_within: f64 = 3.5,
        /// How irregular their pace is. The person walks slower than intended by this fraction times the absolute value of a
        /// standard normal, which changes over `pace_time`.
        pub pace_sd: f64 = 0.04,
        /// Correlation time of their pace, seconds.
        pub pace_time: f64 = 2.0,
    }
}

/// Distance kept from other people, metres.
const PERSON_RADIUS: f64 = 0.7;
/// Other people are noticed within this distance, metres.
const PERSON_RANGE: f64 = 2.5;
/// Radius of the body against walls, metres.
const BODY_RADIUS: f64 = 0.25;
/// Radius of the turning circle of a person who does not slow down in turns, metres: the person always reaches their goal.
const TURNING_CIRCLE: f64 = 0.3;

/// A moving body, as a person sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Body {
    pub(crate) position: Vec2,
    pub(crate) velocity: Vec2,
    pub(crate) is_robot: bool,
}

/// What the person intends: a speed and a heading.
#[derive(Clone, Copy, Debug)]
struct Wish {
    v: f64,
    heading: f64,
}

/// A command from outside that replaces their own decisions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Teleop {
    /// Forward speed, m/s.
    pub v: f64,
    /// Turning rate, rad/s.
    pub omega: f64,
}

/// One walking person.
#[derive(Clone, Debug)]
pub struct Person {
    /// Track id.
    pub id: u32,
    /// How the person walks.
    pub params: PersonParams,
    /// Position in the map frame, metres.
    pub position: Vec2,
    /// Heading in the map frame, radians.
    pub theta: f64,
    /// Forward speed, m/s.
    pub v: f64,
    /// Turning rate, rad/s.
    pub omega: f64,
    /// Their goal in the map frame.
    pub goal: Vec2,
    /// Goals reached so far.
    pub goals_reached: u64,
    /// If set, it replaces their own decisions.
    pub teleop: Option<Teleop>,
    wishes: VecDeque<Wish>,
    pace: f64,
    /// The side on which the person passes an obstacle: 1 left, -1 right. It stays the same during one encounter.
    side: Option<f64>,
    navigator: Option<Navigator>,
    rng: Rng,
}

impl Person {
    /// A person standing at `position` and facing the goal.
    pub(crate) fn new(id: u32, params: PersonParams, position: Vec2, goal: Vec2, mut rng: Rng) -> Self {
        let pace = rng.normal();
        Self {
            id,
            params,
            position,
            theta: (goal - position).angle(),
            v: 0.0,
            omega: 0.0,
            goal,
            goals_reached: 0,
            teleop: None,
            wishes: VecDeque::new(),
            pace,
            side: None,
            navigator: None,
            rng,
        }
    }

    /// Velocity in the map frame.
    pub fn velocity(&self) -> Vec2 {
        Vec2::polar(self.v, self.theta)
    }

    /// The person and what they may collide with.
    pub fn approach(&self, other_position: Vec2, other_velocity: Vec2) -> Approach {
        Approach { position: self.position, velocity: self.velocity(), other_position, other_velocity }
    }

    /// Whether the person is within `arrival` of the goal.
    pub fn has_arrived(&self) -> bool {
        self.position.distance(self.goal) <= self.params.arrival
    }

    /// Walks for `dt` seconds among `others`. `imposed` is a speed set by an intervention, m/s.
    pub(crate) fn step(&mut self, dt: f64, step: u64, world: &World, others: &[Body], imposed: Option<f64>) {
        let wish = self.delayed_wish(dt, step, world, others);
        let error = wrap(wish.heading - self.theta);
        let (v, omega) = match (self.teleop, imposed) {
            (Some(teleop), imposed) => (imposed.unwrap_or(teleop.v), teleop.omega),
            (None, Some(v)) => (v, error / (2.0 * dt)),
            (None, None) if !self.params.slows_in_turns => (wish.v, error / (2.0 * dt)),
            (None, None) if error.abs() > self.params.turn_in_place => (0.0, error / (2.0 * dt)),
            (None, None) => (wish.v * libm::cos(error).max(0.0), error / (2.0 * dt)),
        };
        self.v += (v - self.v).clamp(-self.params.braking * dt, self.params.acceleration * dt);
        let keeps_speed = imposed.is_some() || !self.params.slows_in_turns;
        let needed = if keeps_speed { self.v.abs() / TURNING_CIRCLE } else { 0.0 };
        let fastest = self.params.turn_rate.max(needed);
        self.omega = omega.clamp(-fastest, fastest);
        self.theta = wrap(self.theta + self.omega * dt);
        let wanted = self.position + Vec2::polar(self.v * dt, self.theta);
        self.position = world.moved(self.position, wanted, BODY_RADIUS);
    }

    /// What the person intended `reaction` seconds ago.
    fn delayed_wish(&mut self, dt: f64, step: u64, world: &World, others: &[Body]) -> Wish {
        let wish = self.wish(dt, step, world, others);
        let delay = (self.params.reaction / dt).round() as usize;
        self.wishes.push_back(wish);
        while self.wishes.len() > delay + 1 {
            self.wishes.pop_front();
        }
        self.wishes.front().copied().unwrap_or(wish)
    }

    fn wish(&mut self, dt: f64, step: u64, world: &World, others: &[Body]) -> Wish {
        let p = &self.params;
        let keep = libm::exp(-dt / p.pace_time);
        self.pace = keep * self.pace + (1.0 - keep * keep).sqrt() * self.rng.normal();
        let target = Navigator::next(&mut self.navigator, world, self.position, self.goal, step);
        let mut heading = (target - self.position).angle();
        if self.has_arrived() {
            return Wish { v: 0.0, heading: self.theta };
        }
        let to_goal = self.goal.distance(self.position);
        let near = if p.slow_distance > 0.0 { (to_goal / p.slow_distance).min(1.0) } else { 1.0 };
        let slowed = p.slow_floor + (1.0 - p.slow_floor) * near;
        let mut v = p.speed * slowed * (1.0 - p.pace_sd * self.pace.abs()).max(0.0);
        if p.avoids {
            if others.iter().any(|other| self.brakes_for(other)) {
                v = v.min(p.speed * p.brake_to);
            }
            heading = self.heading_around(others, target, heading);
        }
        Wish { v, heading }
    }

    fn brakes_for(&self, other: &Body) -> bool {
        let (radius, range) = self.reach(other, self.params.brake_within);
        self.approach(other.position, other.velocity).is_collision_course(radius, range)
    }

    /// The distance to keep from a body, and the distance at which it matters.
    fn reach(&self, other: &Body, robot_range: f64) -> (f64, f64) {
        if other.is_robot { (self.params.robot_radius, robot_range) } else { (PERSON_RADIUS, PERSON_RANGE) }
    }

    /// The heading that passes the nearest body which blocks the straight way to `target`.
    fn heading_around(&mut self, others: &[Body], target: Vec2, straight: f64) -> f64 {
        let blocking = others.iter().filter_map(|other| {
            let (radius, range) = self.reach(other, self.params.steer_within);
            let distance = other.position.distance(self.position);
            // A goal beside a robot must stay reachable, so the circle never covers it.
            let radius = radius.min(other.position.distance(self.goal) - 0.05).max(0.4);
            let way = Segment { a: self.position, b: target };
            let ahead = (other.position - self.position).dot(target - self.position) > 0.0;
            let blocks = ahead
                && distance < range
                && distance > 0.0
                && way.nearest(other.position).distance(other.position) < radius;
            blocks.then_some((distance, radius, other.position))
        });
        let Some((distance, radius, centre)) = blocking.min_by(|a, b| a.0.total_cmp(&b.0)) else {
            self.side = None;
            return straight;
        };
        let bearing = (centre - self.position).angle();
        let off_straight = wrap(straight - bearing);
        let side = *self.side.get_or_insert(if off_straight < 0.0 { -1.0 } else { 1.0 });
        bearing + side * libm::asin((1.02 * radius / distance).min(1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT: f64 = 0.04;

    fn walk(
        person: &mut Person,
        seconds: f64,
        others: &[Body],
        imposed: Option<f64>,
        mut seen: impl FnMut(&Person),
    ) {
        let world = World::named("hall").unwrap();
        for step in 0..(seconds / DT) as u64 {
            person.step(DT, step, &world, others, imposed);
            seen(person);
        }
    }

    fn person(params: PersonParams) -> Person {
        Person::new(1000, params, Vec2::new(-8.0, 0.0), Vec2::new(8.0, 0.0), Rng::new(1, 1))
    }

    fn robot() -> Body {
        Body { position: Vec2::new(0.0, 0.1), velocity: Vec2::ZERO, is_robot: true }
    }

    #[test]
    fn she_reaches_her_goal_at_her_speed_and_slows_before_it() {
        let mut walker = person(PersonParams { pace_sd: 0.0, ..PersonParams::default() });
        let (mut top, mut near) = (0.0f64, Vec::new());
        walk(&mut walker, 16.0, &[], None, |walker| {
            top = top.max(walker.v);
            let left = walker.goal.distance(walker.position);
            if (1.0..1.5).contains(&left) {
                near.push(walker.v);
            }
        });
        assert!(walker.has_arrived());
        assert!((top - 1.5).abs() < 1e-9);
        assert!(near.iter().all(|v| (0.6..1.2).contains(v)), "{near:?}");
    }

    #[test]
    fn she_brakes_for_a_robot_and_passes_it_at_a_distance() {
        let mut walker = person(PersonParams::default());
        let (mut least, mut dip) = (f64::MAX, f64::MAX);
        walk(&mut walker, 25.0, &[robot()], None, |walker| {
            least = least.min(walker.position.distance(robot().position));
            if walker.position.x > -6.0 && walker.position.x < 3.0 {
                dip = dip.min(walker.v);
            }
        });
        assert!(least > 1.5, "{least}");
        assert!((0.2..0.9).contains(&dip), "{dip}");
        assert!(walker.has_arrived());
    }

    #[test]
    fn a_person_who_ignores_robots_walks_straight_on() {
        let mut walker = person(PersonParams { avoids: false, pace_sd: 0.0, ..PersonParams::default() });
        walk(&mut walker, 6.0, &[robot()], None, |walker| assert!(walker.position.y.abs() < 1e-9));
        assert!((walker.v - 1.5).abs() < 1e-9);
    }

    #[test]
    fn an_imposed_speed_is_kept_near_the_goal_and_near_a_robot() {
        let mut walker = person(PersonParams::default());
        let mut speeds = Vec::new();
        walk(&mut walker, 20.0, &[robot()], Some(0.6), |walker| speeds.push(walker.v));
        assert!(speeds[40..].iter().all(|v| (v - 0.6).abs() < 1e-12));
    }

    #[test]
    fn nothing_changes_before_the_reaction_time() {
        let params = PersonParams { pace_sd: 0.0, ..PersonParams::default() };
        let mut calm = person(params.clone());
        calm.position = Vec2::new(-4.0, 0.0);
        walk(&mut calm, 2.0, &[], None, |_| ());
        calm.position = Vec2::new(-4.0, 0.0);
        let mut startled = calm.clone();
        walk(&mut calm, 0.36, &[], None, |_| ());
        walk(&mut startled, 0.36, &[robot()], None, |_| ());
        assert_eq!(calm.v, startled.v);
        walk(&mut startled, 0.2, &[robot()], None, |_| ());
        assert!(startled.v < calm.v);
    }
}
