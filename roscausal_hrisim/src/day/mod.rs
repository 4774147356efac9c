//! A working day: people with shifts walk between the places of a map, and a robot with a battery has tasks with deadlines.
//!
//! People choose where to go by the weights of their team for each place and hour, which are drawn once for a house
//! ([`DaySpec::house`]); who goes where on a given day is drawn by the run's seed. They shun a place while the robot is there,
//! so what is counted at a place depends on where the robot was. Within 8 m of the robot they walk by the social force, elsewhere
//! straight along their way in steps of 0.2 s.
//!
//! The facts of batteries and the kind of day are those of Castri, Beraldo and Bellotto 2025 (arXiv 2504.11901).

mod people;
mod robot;

use roscausal_core::{Error, Result};
use roscausal_reasoning::route::map::{Map, Place};
use serde::{Deserialize, Serialize};

use crate::{geometry::Vec2, pedestrian::Crowd, ranges::numbers, rng::Rng, robot::Robot, world::World};
use people::Worker;
pub use robot::{Leg, Porter, Task};

/// Seconds of an hour.
pub const HOUR: f64 = 3600.0;
/// A person or robot is counted at the nearest place within this distance, metres.
const COUNTED: f64 = 6.0;
/// Somebody this near to the robot counts as met closely, metres.
const CLOSE: f64 = 1.2;

roscausal_core::with_defaults! {
    /// A working day. `DaySpec::warehouse(4, 7)` has the places of the scenario `warehouse`.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct DaySpec {
        /// Seed of the house: which team is drawn to which place in which hour.
        pub house: u64 = 1,
        /// When the day begins, hours from midnight.
        pub begins: f64 = 8.0,
        /// Length of the working day, hours.
        pub hours: f64 = 10.0,
        /// When the first team goes to lunch, hours from midnight; the second goes an hour later.
        pub lunch: f64 = 12.0,
        /// How differently zones draw people: standard deviation of the logarithm of their weights. Places whose names differ only
        /// behind the last `_` are one zone.
        pub contrast: f64 = 1.8,
        /// People of each team.
        pub teams: Vec<usize> = vec![20, 20],
        /// Places where nobody works and through which nobody walks today.
        pub closed: Vec<String> = Vec::new(),
        /// Tasks of the robot in a day.
        pub tasks: usize = 60,
        /// A way may take this many times its free travel time.
        pub deadline: f64 = 1.6,
        /// Seconds within which a task has to begin.
        pub patience: f64 = 2400.0,
        /// The battery.
        pub battery: Battery = Battery::default(),
        /// The places. Their `kind` says what people do there: `shelf`, `corridor`, `canteen`, `office`, `entrance`, `charger`,
        /// `dock` (where the robot's loads are).
        pub places: Vec<Place> = Vec::new(),
        /// Names of places that are joined.
        pub arcs: Vec<[String; 2]> = Vec::new(),
    }
}

roscausal_core::with_defaults! {
    /// A battery that falls by `idle + drive * speed`, all times `load` under load.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct Battery {
        /// Hours that it lasts when the robot stands.
        pub idle: f64 = 5.0,
        /// Hours that it lasts at top speed.
        pub moving: f64 = 4.0,
        /// How many times faster it falls under load.
        pub load: f64 = 3.0,
        /// Hours that it takes to be charged from empty to full.
        pub charge: f64 = 2.0,
    }
}

impl DaySpec {
    /// A warehouse of `columns` aisles of `rows` places, joined by corridors at both ends and across the middle, with a dock for the
    /// robot's loads at each end of an aisle; entrance, canteen, offices and charger lie outside. Metres; aisles are 10 m apart.
    pub fn warehouse(columns: usize, rows: usize) -> Self {
        let mut spec = Self::default();
        let place = |name: String, x: f64, y: f64, kind: &str| Place { name, at: [x, y], kind: kind.into() };
        let (middle, end) = (rows.div_ceil(2), rows + 1);
        let name = |c: usize, row: usize| match row {
            0 => format!("south_{c}"),
            row if row == end => format!("north_{c}"),
            row if row == middle => format!("middle_{c}"),
            row if row < middle => format!("aisle{c}s_{row}"),
            row => format!("aisle{c}n_{row}"),
        };
        let mut arcs = Vec::new();
        for c in 0..columns {
            let x = 10.0 * c as f64;
            for row in 0..=end {
                let is_corridor = [0, middle, end].contains(&row);
                let kind = if is_corridor { "corridor" } else { "shelf" };
                spec.places.push(place(name(c, row), x, 6.0 * row as f64, kind));
                if row > 0 {
                    arcs.push([name(c, row - 1), name(c, row)]);
                }
                if c > 0 && is_corridor {
                    arcs.push([name(c - 1, row), name(c, row)]);
                }
            }
            for (dock, row, y) in [("dock_s", 0, -7.0), ("dock_n", end, 6.0 * end as f64 + 7.0)] {
                spec.places.push(place(format!("{dock}{c}"), x, y, "dock"));
                arcs.push([format!("{dock}{c}"), name(c, row)]);
            }
        }
        let (east, top) = (10.0 * columns as f64, 6.0 * end as f64);
        let outside = [
            ("entrance", -10.0, 0.0, "entrance", name(0, 0)),
            ("canteen", east, 0.0, "canteen", name(columns.max(1) - 1, 0)),
            ("office", east, top, "office", name(columns.max(1) - 1, end)),
            ("workshop", -10.0, top, "office", name(0, end)),
            ("charger", -10.0, 6.0 * middle as f64, "charger", name(0, middle)),
        ];
        for (name, x, y, kind, by) in outside {
            spec.places.push(place(name.to_owned(), x, y, kind));
            arcs.push([name.to_owned(), by]);
        }
        Self { arcs, ..spec }
    }

    /// The map of the places.
    ///
    /// # Errors
    /// As [`Map::new`].
    pub fn map(&self) -> Result<Map> {
        Ok(Map::new(self.places.clone(), &self.arcs)?)
    }

    /// Checks every field.
    pub(crate) fn check(&self) -> Result<()> {
        let map = self.map()?;
        let ranges = [
            ("hours", self.hours, 0.1, 24.0),
            ("begins", self.begins, 0.0, 24.0),
            ("lunch", self.lunch, 0.0, 48.0),
            ("contrast", self.contrast, 0.0, 4.0),
            ("deadline", self.deadline, 1.0, 100.0),
            ("patience", self.patience, 1.0, 86_400.0),
            ("battery.idle", self.battery.idle, 0.1, 1000.0),
            ("battery.moving", self.battery.moving, 0.1, 1000.0),
            ("battery.load", self.battery.load, 1.0, 100.0),
            ("battery.charge", self.battery.charge, 0.01, 1000.0),
            ("tasks", self.tasks as f64, 0.0, 10_000.0),
            ("teams", self.teams.iter().sum::<usize>() as f64, 0.0, 1000.0),
        ];
        numbers("day", &ranges)?;
        for name in &self.closed {
            map.place(name).map_err(|error| Error::param("day.closed", error))?;
        }
        Ok(())
    }
}

/// Where a place is.
fn position(map: &Map, place: usize) -> Vec2 {
    let [x, y] = map.places[place].at;
    Vec2::new(x, y)
}

/// The first place of a kind.
fn of_kind(map: &Map, kind: &str) -> usize {
    map.places.iter().position(|place| place.kind == kind).unwrap_or(0)
}

/// What is left of a way when its first place is passed: the next place last.
fn still_to_pass(way: &[usize]) -> Vec<usize> {
    way.iter().skip(1).rev().copied().collect()
}

/// A running day.
#[derive(Clone, Debug)]
pub struct Day {
    /// What it is.
    pub spec: DaySpec,
    /// Its places.
    pub map: Map,
    /// The robot's tasks and battery.
    pub porter: Porter,
    workers: Vec<Worker>,
    /// Weights by team, hour and place.
    weights: Vec<Vec<Vec<f64>>>,
    /// Whether people may be at a place at all.
    open: Vec<bool>,
    /// Seconds in which somebody was within 1.2 m of the driving robot.
    pub close_seconds: f64,
    rng: Rng,
}

impl Day {
    /// The day at its beginning; its people are the crowd that is returned.
    ///
    /// # Errors
    /// A wrong map.
    pub(crate) fn new(spec: &DaySpec, rng: Rng, top_speed: f64) -> Result<(Self, Crowd)> {
        let map = spec.map()?;
        let mut day = Self {
            open: map.places.iter().map(|place| !spec.closed.contains(&place.name)).collect(),
            weights: people::weights(spec, &map),
            porter: Porter::new(spec, &map, rng.clone(), top_speed),
            spec: spec.clone(),
            map,
            workers: Vec::new(),
            close_seconds: 0.0,
            rng,
        };
        let crowd = day.people();
        Ok((day, crowd))
    }

    /// The hour of the day, hours from midnight.
    pub fn clock(&self, time: f64) -> f64 {
        self.spec.begins + time / HOUR
    }

    /// Where a place is.
    pub fn at(&self, place: usize) -> Vec2 {
        position(&self.map, place)
    }

    /// The place at which somebody is counted.
    pub fn counted_at(&self, position: Vec2) -> Option<usize> {
        let far = |k: &usize| self.at(*k).distance(position);
        (0..self.map.places.len()).min_by(|a, b| far(a).total_cmp(&far(b))).filter(|k| far(k) <= COUNTED)
    }

    /// How many people are at each place.
    pub fn counts(&self, crowd: &Crowd) -> Vec<u32> {
        let mut counts = vec![0; self.map.places.len()];
        for place in crowd.members.iter().filter_map(|member| self.counted_at(member.position)) {
            counts[place] += 1;
        }
        counts
    }

    /// Moves everybody by one step of the simulation.
    pub(crate) fn step(&mut self, dt: f64, step: u64, world: &World, robot: &mut Robot, crowd: &mut Crowd) {
        self.walk(dt, step, robot, crowd);
        let near = |member: &&crate::pedestrian::Pedestrian| member.position.distance(robot.position) < CLOSE;
        if robot.v > 0.05 && crowd.members.iter().any(|member| near(&member)) {
            self.close_seconds += dt;
        }
        self.drive(dt, step, world, robot, crowd);
    }
}
