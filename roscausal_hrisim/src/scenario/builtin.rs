//! The built-in scenarios, by name.

use std::path::Path;

use super::{PedestrianSpec, PersonSpec, Plan, RobotSpec, Scenario};
use crate::{
    day::DaySpec,
    geometry::{Area, Vec2},
    person::PersonParams,
    robot::RobotParams,
};

/// Names of the built-in scenarios.
pub const SCENARIOS: [&str; 9] = [
    "thor", "pass_by_the_centre", "robot_off", "crowd", "encounters", "encounters_ignored",
    "encounters_unslowed", "guide", "warehouse",
];

/// The one that is written as a file, as users write theirs.
const GUIDE: &str = include_str!("guide.toml");

impl Scenario {
    /// The built-in scenario with that name; see [`SCENARIOS`].
    pub fn named(name: &str) -> Option<Self> {
        let plan = match name {
            "thor" => Plan::Thor,
            "pass_by_the_centre" => Plan::PassByTheCentre,
            "robot_off" => Plan::RobotOff,
            "guide" => return Self::from_toml(GUIDE, Path::new("guide.toml")).ok(),
            "warehouse" => return Some(Self::of_day(name, DaySpec::warehouse(4, 7))),
            "crowd" => return Some(Self::crowd(20, 2)),
            "encounters" => return Some(Self::encounters(name, encounters_walk())),
            "encounters_ignored" => {
                return Some(Self::encounters(name, PersonParams { avoids: false, ..encounters_walk() }));
            }
            "encounters_unslowed" => {
                let steady = PersonParams { slow_distance: 0.0, slows_in_turns: false, ..encounters_walk() };
                return Some(Self::encounters(name, steady));
            }
            _ => return None,
        };
        Some(Self { name: name.to_owned(), plan, ..Self::default() })
    }

    /// The scenario that is recommended for finding the paper's four links, and its two controls (the person
    /// ignores the robot, or never slows down for a goal or a turn). Why it shows the links:
    ///
    /// - `v -> d_g`: their true pace is irregular (`pace_sd`), so the distance walked adds information about the
    ///   distance.
    /// - `d_g -> v`: goals come every few seconds, the person starts to slow down 6 m before each, and changes speed
    ///   promptly. Their pace is nearly uncorrelated from one step of 0.3 s to the next (`pace_time`), so the
    ///   distance still adds information to their last speed.
    /// - `risk -> v`: robot and goals share the middle of the hall, so they meet often. The person lets the robot pass
    ///   (`brake_to`). They brake hard, but not within one step: reaction and braking together take about two steps, so
    ///   a lag of one sees them.
    /// - `v -> risk`: the risk contains v (analyse with `risk_model` v1_1 and `risk_lag` 1).
    /// - No other link: goals are uniform in a square around the robot's loop, so the robot's position does not
    ///   tell how far away the goal is. A regression cannot follow leaps, and what it leaves of a condition looks like a
    ///   link: in a room of 8 m a new goal makes the distance leap less, and who walks at 1.2 m/s (`speed`), as people do
    ///   indoors, makes the risk leap less when they meet the robot. The paper's own noise on the exponent of the risk (`risk_noise` 0.02) keeps
    ///   the risk from being a function of v through which every small dependence would show.
    fn encounters(name: &str, walk: PersonParams) -> Self {
        let square = Area([[-4.0, -4.0], [4.0, -4.0], [4.0, 4.0], [-4.0, 4.0]].map(Vec2::from).to_vec());
        let waypoints = [[2.0, -3.0], [2.0, 3.0], [-2.0, 3.0], [-2.0, -3.0]].map(Vec2::from).to_vec();
        Self {
            name: name.to_owned(),
            people: vec![PersonSpec { areas: vec![square.clone(), square], walk, ..PersonSpec::default() }],
            robots: vec![RobotSpec { waypoints, ..RobotSpec::default() }],
            ..Self::default()
        }
    }

    /// A working day with one robot, and walls around its places and between its aisles.
    pub fn of_day(name: &str, day: DaySpec) -> Self {
        let at = |of: fn(f64, f64) -> f64, axis: usize, start: f64| {
            day.places.iter().map(|place| place.at[axis]).fold(start, of)
        };
        let (x0, x1) = (at(f64::min, 0, f64::MAX) - 15.0, at(f64::max, 0, f64::MIN) + 5.0);
        let (y0, y1) = (at(f64::min, 1, f64::MAX) - 5.0, at(f64::max, 1, f64::MIN) + 5.0);
        let walls = vec![[x0, y0, x1, y0], [x1, y0, x1, y1], [x1, y1, x0, y1], [x0, y1, x0, y0]];
        let charger = day.places.iter().find(|place| place.kind == "charger");
        let start = charger.map(|place| Vec2::new(place.at[0], place.at[1]));
        let drive = RobotParams { speed: 0.8, turn_rate: 1.5, pause: [0.0, 0.0], ..RobotParams::default() };
        Self {
            name: name.to_owned(),
            plan: Plan::Crowd,
            duration: day.hours * crate::day::HOUR,
            walls,
            people: Vec::new(),
            robots: vec![RobotSpec { start, drive, ..RobotSpec::default() }],
            day: Some(day),
            ..Self::default()
        }
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

/// A person who walks rather than drives by keyboard: prompt, quick to turn and to brake, all but standing while the robot is in
/// their way.
fn encounters_walk() -> PersonParams {
    PersonParams {
        speed: 1.2,
        acceleration: 2.0,
        braking: 2.5,
        turn_rate: 2.5,
        turn_in_place: 2.5,
        slow_distance: 6.0,
        slow_floor: 0.15,
        reaction: 0.4,
        pace_sd: 0.3,
        pace_time: 0.3,
        brake_to: 0.02,
        ..PersonParams::default()
    }
}

/// No namespace for a single robot, otherwise `robot1`, `robot2`, ...
fn robot_name(index: usize, robots: usize) -> String {
    if robots == 1 { String::new() } else { format!("robot{}", index + 1) }
}
