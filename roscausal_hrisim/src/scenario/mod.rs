//! What is simulated: map, plan, people, robots, noise, interventions. Plain data, checked once.

mod builtin;
mod check;
mod file;

use serde::{Deserialize, Serialize};

use crate::{
    day::DaySpec,
    geometry::{Area, Vec2},
    intervention::Intervention,
    person::PersonParams,
    robot::RobotParams,
};

pub use builtin::SCENARIOS;

/// Who goes where and when.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Plan {
    /// The robot loops through its waypoints. A person's goal is uniform in one of their areas, never twice in a row
    /// in the same one. It is the plan of the published data.
    #[default]
    Thor,
    /// The robot drives from corner to corner. A person's goals alternate between areas on both sides of its path,
    /// so that the paths cross.
    PassByTheCentre,
    /// The robot is parked. A person's goals alternate between their areas.
    RobotOff,
    /// Pedestrians, people and robots go to random positions.
    Crowd,
}

roscausal_core::with_defaults! {
    /// A scenario; `Scenario::default()` is `thor`.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct Scenario {
        /// Name, for files and reports.
        #[serde(default)]
        pub name: String = "thor".to_owned(),
        /// Who goes where.
        pub plan: Plan = Plan::Thor,
        /// Name of a built-in map.
        pub map: String = "hall".to_owned(),
        /// Walls `[x1, y1, x2, y2]` instead of a built-in map, metres.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        pub walls: Vec<[f64; 4]> = Vec::new(),
        /// Simulated time, seconds.
        pub duration: f64 = 300.0,
        /// Scripted (or teleoperated) people.
        pub people: Vec<PersonSpec> = vec![PersonSpec::default()],
        /// Robots.
        pub robots: Vec<RobotSpec> = vec![RobotSpec::default()],
        /// Social-force pedestrians.
        pub pedestrians: PedestrianSpec = PedestrianSpec::default(),
        /// Noise of the sensors.
        pub noise: Noise = Noise::default(),
        /// A working day: places, shifts, and a robot with tasks. Its people are the pedestrians.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub day: Option<DaySpec> = None,
        /// Interventions, such as `robot.speed=0.2@60..90`.
        pub interventions: Vec<Intervention> = Vec::new(),
    }
}

/// One scripted person.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PersonSpec {
    /// Track id; 0 means 1000 plus the position in the list.
    pub id: u32,
    /// Where the person starts; by default somewhere in their goal areas.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start: Option<Vec2>,
    /// Convex areas from which their goals are drawn; by default those of the plan.
    pub areas: Vec<Area>,
    /// How the person walks.
    pub walk: PersonParams,
}

/// One robot.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RobotSpec {
    /// Namespace of its topics; may be empty.
    pub name: String,
    /// Where it starts; by default its first waypoint.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start: Option<Vec2>,
    /// Waypoints of its loop; by default those of the plan.
    pub waypoints: Vec<Vec2>,
    /// How it drives.
    pub drive: RobotParams,
}

roscausal_core::with_defaults! {
    /// The pedestrians.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct PedestrianSpec {
        /// Their number.
        pub count: usize = 0,
        /// Whether they walk in groups of 1 + Poisson(1.1).
        pub groups: bool = true,
        /// Mean of their top speeds, m/s.
        pub speed_mean: f64 = 1.34,
        /// Standard deviation of their top speeds, m/s.
        pub speed_sd: f64 = 0.26,
    }
}

roscausal_core::with_defaults! {
    /// Standard deviations of the noise that a localiser and a people tracker add; it is white and normal.
    ///
    /// The defaults are the noise of the published data for people (0.05 m, 0.028 m/s), and a little for the robot.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct Noise {
        /// A person's position, per axis, metres.
        pub person_position: f64 = 0.05,
        /// A person's heading, radians.
        pub person_heading: f64 = 0.02,
        /// A person's speed, m/s.
        pub person_speed: f64 = 0.028,
        /// A person's turning rate, rad/s.
        pub person_turn: f64 = 0.02,
        /// The robot's position, per axis, metres.
        pub robot_position: f64 = 0.01,
        /// The robot's heading, radians.
        pub robot_heading: f64 = 0.005,
        /// The robot's speed, m/s.
        pub robot_speed: f64 = 0.005,
        /// The robot's turning rate, rad/s.
        pub robot_turn: f64 = 0.005,
    }
}

impl Scenario {
    /// Adds interventions, written such as `robot.speed=0.2@60..90`.
    ///
    /// # Errors
    /// A malformed text, as an error of the parameter `do`. Whether interventions match the scenario is checked by
    /// [`Scenario::check`].
    pub fn add_interventions(&mut self, texts: &[String]) -> roscausal_core::Result<()> {
        let mut whole: Vec<String> = Vec::new();
        for text in texts {
            match whole.last_mut() {
                // A list that was split at the comma of a goal.
                Some(open)
                    if text.trim().starts_with(|c: char| c == '-' || c == '.' || c.is_ascii_digit()) =>
                {
                    open.push(',');
                    open.push_str(text.trim());
                }
                _ => whole.push(text.trim().to_owned()),
            }
        }
        for text in whole {
            let one = text.parse().map_err(|reason: String| roscausal_core::Error::param("do", reason))?;
            self.interventions.push(one);
        }
        Ok(())
    }
}

impl Noise {
    /// No noise.
    pub const NONE: Self = Self {
        person_position: 0.0,
        person_heading: 0.0,
        person_speed: 0.0,
        person_turn: 0.0,
        robot_position: 0.0,
        robot_heading: 0.0,
        robot_speed: 0.0,
        robot_turn: 0.0,
    };
}
