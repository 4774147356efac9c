//! A differential-drive robot that follows waypoints.

use serde::{Deserialize, Serialize};

use crate::{
    geometry::{Vec2, wrap},
    navigator::Navigator,
    rng::Rng,
    world::World,
};

/// Below this speed it stands, m/s.
const STANDING: f64 = 1e-3;

roscausal_core::with_defaults! {
    /// How a robot drives.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct RobotParams {
        /// Top speed, m/s.
        pub speed: f64 = 0.5,
        /// Top turning rate, rad/s.
        pub turn_rate: f64 = 0.6,
        /// Acceleration and braking, m/s2.
        pub acceleration: f64 = 0.5,
        /// Shortest and longest stop at a waypoint, seconds.
        pub pause: [f64; 2] = [0.5, 1.0],
        /// Heading error at which it stops to turn, radians.
        pub turn_in_place: f64 = 1.7,
        /// A waypoint is reached within this distance, metres.
        pub arrival: f64 = 0.15,
        /// It stops for anybody within this distance ahead, metres; 0: never.
        pub stop_distance: f64 = 0.8,
    }
}

/// One driving robot.
#[derive(Clone, Debug)]
pub struct Robot {
    /// Name, which is the namespace of its topics; may be empty.
    pub name: String,
    /// How it drives.
    pub params: RobotParams,
    /// Position in the map frame, metres.
    pub position: Vec2,
    /// Heading in the map frame, radians.
    pub theta: f64,
    /// Forward speed, m/s.
    pub v: f64,
    /// Turning rate, rad/s.
    pub omega: f64,
    /// Where it started: the origin of its odometry frame.
    pub start: (Vec2, f64),
    /// Waypoints in order; after the last comes the first.
    pub waypoints: Vec<Vec2>,
    /// Index of the waypoint it drives to.
    pub leg: usize,
    /// Waypoints reached so far.
    pub legs_done: u64,
    pause_left: f64,
    navigator: Option<Navigator>,
    rng: Rng,
}

/// What an intervention imposes on a robot.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct RobotOrders {
    /// Top speed that replaces its own, m/s.
    pub(crate) speed: Option<f64>,
    /// The robot stands still.
    pub(crate) off: bool,
}

impl Robot {
    /// A robot at its first waypoint, facing the second. Without waypoints it stands at `start`.
    pub(crate) fn new(
        name: String,
        params: RobotParams,
        start: Vec2,
        waypoints: Vec<Vec2>,
        rng: Rng,
    ) -> Self {
        let first = waypoints.iter().position(|w| w.distance(start) > params.arrival).unwrap_or(0);
        let theta = waypoints.get(first).map_or(0.0, |w| (*w - start).angle());
        Self {
            name,
            params,
            position: start,
            theta,
            v: 0.0,
            omega: 0.0,
            start: (start, theta),
            waypoints,
            leg: first,
            legs_done: 0,
            pause_left: 0.0,
            navigator: None,
            rng,
        }
    }

    /// Velocity in the map frame.
    pub fn velocity(&self) -> Vec2 {
        Vec2::polar(self.v, self.theta)
    }

    /// The waypoint it drives to; its own position if it has none.
    pub fn goal(&self) -> Vec2 {
        self.waypoints.get(self.leg).copied().unwrap_or(self.position)
    }

    /// Drives for `dt` seconds. `people` are the positions of everybody who walks.
    pub(crate) fn step(&mut self, dt: f64, step: u64, world: &World, people: &[Vec2], orders: RobotOrders) {
        let (v, omega) = self.command(dt, step, world, people, orders);
        let change = self.params.acceleration * dt;
        self.v += (v - self.v).clamp(-change, change);
        self.omega = omega.clamp(-self.params.turn_rate, self.params.turn_rate);
        self.theta = wrap(self.theta + self.omega * dt);
        let wanted = self.position + Vec2::polar(self.v * dt, self.theta);
        self.position = world.moved(self.position, wanted, 0.25);
    }

    /// Intended speed and turning rate.
    fn command(
        &mut self,
        dt: f64,
        step: u64,
        world: &World,
        people: &[Vec2],
        orders: RobotOrders,
    ) -> (f64, f64) {
        if self.waypoints.is_empty() || orders.off {
            return (0.0, 0.0);
        }
        self.pass_waypoint();
        let goal = self.goal();
        let target = Navigator::next(&mut self.navigator, world, self.position, goal, step);
        let error = wrap((target - self.position).angle() - self.theta);
        let omega = error / (2.0 * dt).max(0.2);
        let blocked = people.iter().any(|person| self.is_ahead(*person));
        let pauses = self.pause_left > 0.0;
        if pauses && self.v.abs() < STANDING {
            self.pause_left -= dt;
        }
        if pauses || blocked {
            return (0.0, omega);
        }
        let aligned = (1.0 - error.abs() / self.params.turn_in_place).clamp(0.0, 1.0);
        let top = orders.speed.unwrap_or(self.params.speed);
        let stopping = (2.0 * self.params.acceleration * goal.distance(self.position)).sqrt();
        ((top * aligned).min(stopping), omega)
    }

    /// Moves on to the next waypoint when this one is reached.
    fn pass_waypoint(&mut self) {
        if self.goal().distance(self.position) > self.params.arrival || self.waypoints.len() < 2 {
            return;
        }
        self.leg = (self.leg + 1) % self.waypoints.len();
        self.legs_done += 1;
        self.pause_left = self.rng.uniform(self.params.pause[0], self.params.pause[1]);
    }

    fn is_ahead(&self, person: Vec2) -> bool {
        let offset = person - self.position;
        offset.norm() < self.params.stop_distance && offset.dot(Vec2::polar(1.0, self.theta)) > 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drive(seconds: f64, orders: RobotOrders, mut seen: impl FnMut(&Robot, f64)) -> Robot {
        let world = World::named("hall").unwrap();
        let waypoints =
            vec![Vec2::new(2.0, -5.0), Vec2::new(2.0, 5.0), Vec2::new(-2.0, 5.0), Vec2::new(-2.0, -5.0)];
        let mut robot =
            Robot::new(String::new(), RobotParams::default(), waypoints[0], waypoints, Rng::new(1, 1));
        for step in 0..(seconds * 25.0) as u64 {
            robot.step(0.04, step, &world, &[], orders);
            seen(&robot, step as f64 * 0.04);
        }
        robot
    }

    #[test]
    fn speed_turning_and_acceleration_keep_their_limits() {
        let mut last = 0.0;
        let robot = drive(120.0, RobotOrders::default(), |robot, _| {
            assert!(robot.v <= 0.5 + 1e-12 && robot.v >= 0.0 && robot.omega.abs() <= 0.6 + 1e-12);
            assert!((robot.v - last).abs() <= 0.5 * 0.04 + 1e-12);
            last = robot.v;
        });
        assert!((5..=9).contains(&robot.legs_done), "{}", robot.legs_done);
    }

    #[test]
    fn orders_are_obeyed() {
        let off = drive(10.0, RobotOrders { speed: None, off: true }, |_, _| ());
        assert_eq!(off.position, Vec2::new(2.0, -5.0));
        let mut top: f64 = 0.0;
        drive(30.0, RobotOrders { speed: Some(0.2), off: false }, |robot, _| top = top.max(robot.v));
        assert!((top - 0.2).abs() < 1e-9);
    }

    #[test]
    fn it_stops_for_people_ahead_when_told_to() {
        let world = World::named("hall").unwrap();
        let params = RobotParams { stop_distance: 0.8, ..RobotParams::default() };
        let waypoints = vec![Vec2::ZERO, Vec2::new(8.0, 0.0)];
        let mut robot = Robot::new("a".into(), params, Vec2::ZERO, waypoints, Rng::new(1, 1));
        let person = Vec2::new(4.0, 0.0);
        (0..1000).for_each(|step| robot.step(0.04, step, &world, &[person], RobotOrders::default()));
        assert_eq!(robot.v, 0.0);
        assert!(robot.position.distance(person) > 0.3);
    }
}
