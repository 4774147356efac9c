//! What a localiser and a people tracker measure: the truth with seeded noise.

use crate::{
    geometry::{Vec2, wrap},
    pedestrian::Pedestrian,
    person::Person,
    rng::Rng,
    robot::Robot,
    scenario::Noise,
};

/// A measured position, heading and speed in the map frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// Position, metres.
    pub position: Vec2,
    /// Heading, radians.
    pub theta: f64,
    /// Forward speed, m/s.
    pub v: f64,
    /// Turning rate, rad/s.
    pub omega: f64,
}

/// Measures with the noise of a scenario.
#[derive(Clone, Debug)]
pub struct Sensors {
    noise: Noise,
    rng: Rng,
}

const STREAM: u64 = 6 << 32;

impl Sensors {
    /// Sensors with this noise. They have a random stream of their own, so noise never changes the truth.
    pub fn new(noise: Noise, seed: u64) -> Self {
        Self { noise, rng: Rng::new(seed, STREAM) }
    }

    /// A robot, as its odometry and localisation measure it.
    pub fn robot(&mut self, robot: &Robot) -> Measured {
        Measured {
            position: robot.position + self.rng.normal2(self.noise.robot_position),
            theta: wrap(robot.theta + self.noise.robot_heading * self.rng.normal()),
            v: robot.v + self.noise.robot_speed * self.rng.normal(),
            omega: robot.omega + self.noise.robot_turn * self.rng.normal(),
        }
    }

    /// A person, as a tracker measures them.
    pub fn person(&mut self, person: &Person) -> Measured {
        self.walker(person.position, person.theta, person.v, person.omega)
    }

    /// A pedestrian, as a tracker measures them.
    pub fn pedestrian(&mut self, walker: &Pedestrian) -> Measured {
        self.walker(walker.position, walker.theta, walker.velocity.norm(), walker.omega)
    }

    fn walker(&mut self, position: Vec2, theta: f64, v: f64, omega: f64) -> Measured {
        Measured {
            position: position + self.rng.normal2(self.noise.person_position),
            theta: wrap(theta + self.noise.person_heading * self.rng.normal()),
            v: v + self.noise.person_speed * self.rng.normal(),
            omega: omega + self.noise.person_turn * self.rng.normal(),
        }
    }
}
