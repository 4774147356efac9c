//! The built-in scenarios, by name.

use super::{PedestrianSpec, PersonSpec, Plan, RobotSpec, Scenario};

/// Names of the built-in scenarios.
pub const SCENARIOS: [&str; 4] = ["thor", "pass_by_the_centre", "robot_off", "crowd"];

impl Scenario {
    /// The built-in scenario of that name; see [`SCENARIOS`].
    pub fn named(name: &str) -> Option<Self> {
        let plan = match name {
            "thor" => Plan::Thor,
            "pass_by_the_centre" => Plan::PassByTheCentre,
            "robot_off" => Plan::RobotOff,
            "crowd" => return Some(Self::crowd(20, 2)),
            _ => return None,
        };
        Some(Self { name: name.to_owned(), plan, ..Self::default() })
    }

    /// One scripted person, `pedestrians` and `robots` in the hall.
    pub fn crowd(pedestrians: usize, robots: usize) -> Self {
        let robot = |index| RobotSpec { name: robot_name(index, robots), ..RobotSpec::default() };
        Self {
            name: "crowd".to_owned(),
            plan: Plan::Crowd,
            people: vec![PersonSpec::default()],
            robots: (0..robots).map(robot).collect(),
            pedestrians: PedestrianSpec { count: pedestrians, ..PedestrianSpec::default() },
            ..Self::default()
        }
    }
}

/// No namespace for a single robot, else `robot1`, `robot2`, ...
fn robot_name(index: usize, robots: usize) -> String {
    if robots == 1 { String::new() } else { format!("robot{}", index + 1) }
}
