//! Checks of a scenario. Each error names the field, what is wrong and what is allowed.

use roscausal_core::{Error, Result};

use super::{Plan, Scenario};
use crate::{
    geometry::{Segment, Vec2},
    intervention::{Intervention, Target},
    plans::{person_areas, robot_waypoints},
    ranges::{number, numbers},
    world::{MAPS, World},
};

/// Most agents of one kind; guards against typing errors.
const MAX_AGENTS: usize = 10_000;
/// Most walls of a map, and their largest coordinate in metres: the map is cut into cells, and each asks for its nearest wall.
const MAX_WALLS: usize = 1000;
const FARTHEST: f64 = 10_000.0;

impl Scenario {
    /// The map of this scenario.
    ///
    /// # Errors
    /// An unknown map, too many walls, or one that is too far away.
    pub fn world(&self) -> Result<World> {
        if !self.walls.is_empty() {
            count("walls", self.walls.len(), MAX_WALLS)?;
            for (index, wall) in self.walls.iter().enumerate() {
                let name = format!("walls[{index}]");
                wall.iter().try_for_each(|&end| number(&name, end, -FARTHEST, FARTHEST))?;
            }
            let wall = |w: &[f64; 4]| Segment::new(w[0], w[1], w[2], w[3]);
            return Ok(World::new(self.walls.iter().map(wall).collect()));
        }
        let (map, maps) = (&self.map, MAPS.join(", "));
        let reason = || format!("no map '{map}'; allowed: {maps}, or `walls` of your own");
        World::named(map).ok_or_else(|| Error::param("map", reason()))
    }

    /// Checks every field.
    ///
    /// # Errors
    /// The first wrong field, as a path such as `people[0].walk.speed`, with what is allowed.
    pub fn check(&self) -> Result<()> {
        let world = self.world()?;
        number("duration", self.duration, 0.04, 1e7)?;
        if let Some(day) = &self.day {
            day.check()?;
            let reason = "a working day has one robot; give one of [[robots]]";
            Error::ensure(self.robots.len() == 1, "day", || reason)?;
        }
        self.check_people(&world)?;
        self.check_robots(&world)?;
        self.check_pedestrians()?;
        for (name, value) in self.noise.fields() {
            number(&format!("noise.{name}"), value, 0.0, 10.0)?;
        }
        self.check_interventions(&world)
    }

    fn check_people(&self, world: &World) -> Result<()> {
        let somebody = !self.people.is_empty() || self.pedestrians.count > 0 || self.day.is_some();
        let reason = "nobody to simulate; give at least one of [[people]], or pedestrians.count above 0";
        Error::ensure(somebody, "people", || reason)?;
        count("people", self.people.len(), MAX_AGENTS)?;
        let mut ids = std::collections::BTreeSet::new();
        for (index, person) in self.people.iter().enumerate() {
            let at = format!("people[{index}]");
            let id = self.person_id(index);
            Error::ensure(ids.insert(id), &format!("{at}.id"), || {
                format!("{id} is another person's already")
            })?;
            Error::ensure(id >= 1000 || id as usize > self.pedestrians.count, &format!("{at}.id"), || {
                format!("{id} is a pedestrian's; use 1000 or more")
            })?;
            let p = &person.walk;
            let fields = [
                ("speed", p.speed, 0.05, 5.0),
                ("acceleration", p.acceleration, 0.05, 20.0),
                ("braking", p.braking, 0.05, 20.0),
                ("turn_rate", p.turn_rate, 0.05, 20.0),
                ("turn_in_place", p.turn_in_place, 0.1, 4.0),
                ("slow_distance", p.slow_distance, 0.0, 100.0),
                ("slow_floor", p.slow_floor, 0.01, 1.0),
                ("arrival", p.arrival, 0.1, 5.0),
                ("reaction", p.reaction, 0.0, 5.0),
                ("robot_radius", p.robot_radius, 0.1, 10.0),
                ("brake_within", p.brake_within, 0.0, 100.0),
                ("brake_to", p.brake_to, 0.0, 1.0),
                ("steer_within", p.steer_within, 0.0, 100.0),
                ("pace_sd", p.pace_sd, 0.0, 1.0),
                ("pace_time", p.pace_time, 0.01, 100.0),
            ];
            numbers(&format!("{at}.walk"), &fields)?;
            let areas = person_areas(self, index);
            let reason = "one area only; give two or more, so that the goal changes";
            Error::ensure(areas.len() != 1 || self.plan == Plan::Crowd, &format!("{at}.areas"), || reason)?;
            let mut reach = person.start;
            if let Some(start) = person.start {
                place(world, &format!("{at}.start"), start, None, 0.0)?;
            }
            for (k, area) in areas.iter().enumerate() {
                let name = format!("{at}.areas[{k}]");
                Error::ensure(!area.0.is_empty(), &name, || "no corner; give one point or more")?;
                for corner in area.0.iter().chain([&area.centre()]) {
                    place(world, &name, *corner, reach, p.arrival)?;
                    reach = reach.or(Some(*corner));
                }
            }
        }
        Ok(())
    }

    fn check_robots(&self, world: &World) -> Result<()> {
        count("robots", self.robots.len(), MAX_AGENTS)?;
        let mut names = std::collections::BTreeSet::new();
        for (index, robot) in self.robots.iter().enumerate() {
            let at = format!("robots[{index}]");
            let legal = |c: char| c.is_ascii_alphanumeric() || c == '_';
            if !robot.name.chars().all(legal) || robot.name.starts_with(|c: char| c.is_ascii_digit()) {
                let reason = format!("'{}' is not a namespace; use letters, digits and '_'", robot.name);
                return Err(Error::param(format!("{at}.name"), reason));
            }
            Error::ensure(names.insert(&robot.name), &format!("{at}.name"), || {
                format!("'{}' is another robot's already; names tell their topics apart", robot.name)
            })?;
            let d = &robot.drive;
            let fields = [
                ("speed", d.speed, 0.0, 10.0),
                ("turn_rate", d.turn_rate, 0.05, 20.0),
                ("acceleration", d.acceleration, 0.05, 20.0),
                ("pause[0]", d.pause[0], 0.0, 1e4),
                ("pause[1]", d.pause[1], d.pause[0], 1e4),
                ("turn_in_place", d.turn_in_place, 0.1, 4.0),
                ("arrival", d.arrival, 0.1, 5.0),
                ("stop_distance", d.stop_distance, 0.0, 10.0),
            ];
            numbers(&format!("{at}.drive"), &fields)?;
            let mut reach = robot.start;
            if let Some(start) = robot.start {
                place(world, &format!("{at}.start"), start, None, 0.0)?;
            }
            for (k, waypoint) in robot_waypoints(self, index).iter().enumerate() {
                place(world, &format!("{at}.waypoints[{k}]"), *waypoint, reach, 0.0)?;
                reach = reach.or(Some(*waypoint));
            }
        }
        Ok(())
    }

    fn check_pedestrians(&self) -> Result<()> {
        count("pedestrians.count", self.pedestrians.count, MAX_AGENTS)?;
        number("pedestrians.speed_mean", self.pedestrians.speed_mean, 0.1, 5.0)?;
        number("pedestrians.speed_sd", self.pedestrians.speed_sd, 0.0, 2.0)
    }

    fn check_interventions(&self, world: &World) -> Result<()> {
        for (index, one) in self.interventions.iter().enumerate() {
            let at = format!("interventions[{index}]");
            self.check_subject(&at, one)?;
            if let Target::HumanGoal(goal) = one.target {
                let from = self.people.iter().enumerate().flat_map(|(k, _)| person_areas(self, k)).next();
                place(world, &at, goal, from.map(|area| area.centre()), 0.5)?;
            }
            for (earlier, other) in self.interventions[..index].iter().enumerate() {
                Error::ensure(!one.overlaps(other), &at, || {
                    format!(
                        "'{one}' overlaps interventions[{earlier}], '{other}'; let one end before the other starts"
                    )
                })?;
            }
        }
        Ok(())
    }

    /// An intervention must concern somebody.
    fn check_subject(&self, at: &str, one: &Intervention) -> Result<()> {
        let (kind, names): (&str, Vec<String>) = match one.target {
            Target::RobotSpeed(_) | Target::RobotOff => {
                ("robot", self.robots.iter().map(|robot| robot.name.clone()).collect())
            }
            Target::HumanV(_) | Target::HumanGoal(_) => {
                let ids = (0..self.people.len()).map(|index| self.person_id(index).to_string());
                ("scripted person", ids.collect())
            }
        };
        if names.iter().any(|name| one.concerns(name)) {
            return Ok(());
        }
        let known: Vec<&str> = names.iter().map(String::as_str).filter(|name| !name.is_empty()).collect();
        let known = match (names.is_empty(), known.is_empty()) {
            (true, _) => format!("the scenario has no {kind}"),
            (false, true) => format!("its one {kind} has no name: leave out the brackets"),
            (false, false) => format!("allowed: {}", known.join(", ")),
        };
        Err(Error::param(at, format!("'{one}' concerns no {kind}; {known}")))
    }

    /// Track id of the person at this position in the list.
    pub fn person_id(&self, index: usize) -> u32 {
        let given = self.people.get(index).map_or(0, |person| person.id);
        if given == 0 { 1000 + index as u32 } else { given }
    }
}

impl super::Noise {
    fn fields(&self) -> [(&'static str, f64); 8] {
        [
            ("person_position", self.person_position),
            ("person_heading", self.person_heading),
            ("person_speed", self.person_speed),
            ("person_turn", self.person_turn),
            ("robot_position", self.robot_position),
            ("robot_heading", self.robot_heading),
            ("robot_speed", self.robot_speed),
            ("robot_turn", self.robot_turn),
        ]
    }
}

fn count(name: &str, value: usize, most: usize) -> Result<()> {
    Error::ensure(value <= most, name, || format!("{value} are too many; use 0 to {most}"))
}

/// A position must be finite, free, and reachable from `from`. `arrival` is how close one has to come.
fn place(world: &World, name: &str, p: Vec2, from: Option<Vec2>, arrival: f64) -> Result<()> {
    let at = format!("({}, {})", p.x, p.y);
    let (min, max) = world.bounds();
    let outside = p.x < min.x || p.y < min.y || p.x > max.x || p.y > max.y;
    let reason = if !p.is_finite() {
        format!("{at} is not a finite place")
    } else if world.clearance(p) + arrival < 0.3 {
        format!("{at} is inside a wall or nearer than 0.3 m to one; move it into free space")
    } else if outside && !world.walls().is_empty() {
        let [min, max] = [min, max].map(|end| format!("({}, {})", end.x, end.y));
        format!("{at} is outside the walls, which reach from {min} to {max}")
    } else if let Some(from) = from.filter(|from| world.route(*from, p).is_none()) {
        format!("no route from ({}, {}) to {at}; open the walls or move it", from.x, from.y)
    } else {
        return Ok(());
    };
    Err(Error::param(name, reason))
}
