//! The agents in a table, and their states as the human node computes them.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
};

use roscausal_discovery::{Named, ensure};
use roscausal_msgs::geometry_msgs::{Point, Quaternion};
use roscausal_msgs::std_msgs::Header;

use super::{
    TrajectoryReading,
    layout::{self, Clock, Layout},
    motion::{self, Missing},
    sample::{PositionUnit, Sample},
};
use crate::{
    Error, Result, Time,
    batch::{
        recorder,
        table::{binary::Column, grid::Grid, median, time},
        tracks::{Track, Values},
    },
    grammar::Parsed,
    memory::Memory,
    state::{
        human::{PeopleTracker, Sighting, walking},
        identity::Who,
    },
};

/// Somebody who never leaves a circle of this size stands still, metres.
const STILL: f64 = 0.01;
/// A person is kept for any time, since only that person's own samples are given.
const FOR_EVER_S: f64 = 1e12;

/// A person, a robot, or a thing that moves.
#[derive(Debug)]
pub struct Agent {
    /// As the table names it.
    pub name: String,
    /// The number in the table, or else its place in it.
    pub id: u32,
    is_robot: bool,
    /// It stays where it is.
    pub(super) stands: bool,
    pub(super) start: f64,
    pub(super) end: f64,
    track: Track,
}

/// All agents of a table.
#[derive(Debug)]
pub struct Agents {
    /// In the order of their first rows.
    pub all: Vec<Agent>,
    /// What was made of the file, one sentence each.
    pub notes: Vec<String>,
    /// Median step between the samples of an agent, seconds.
    pub(super) usual_step: f64,
}

/// The rows of one agent, before they are states.
#[derive(Default)]
struct Raw {
    name: String,
    is_robot: bool,
    samples: Vec<Sample>,
}

impl Agents {
    /// The agents in a file.
    ///
    /// # Errors
    /// A file that is not a table of trajectories.
    pub fn read(path: &Path, reading: &TrajectoryReading) -> Result<Self> {
        let fault = |reason: String| Error::file(path, reason);
        let mut grid = Grid::read(path, &reading.missing, Memory::of(reading.max_memory), |words| {
            layout::is_header(words, &reading.columns)
        })?;
        let lost = reading.columns.is_empty().then(|| layout::without_boxes(&mut grid)).flatten();
        let layout = layout::of(&grid, &reading.columns).map_err(fault)?;
        let mut notes = Vec::new();
        let unit = reading.unit.or(layout::unit_of(&layout, &grid));
        let mut frame_rate = reading.frame_rate.or(grid.frame_rate);
        if let Some(lost) = lost {
            let (pixel, rate) = (Named("position_unit"), Named("frame_rate"));
            unit.ok_or_else(|| fault(format!("places are pixels, and {pixel} 0.03m says how long one is")))?;
            notes.push(format!(
                "boxes as of the Stanford drones: places are their middles, {} frames a second ({rate} says otherwise); {lost} rows \
                 are left out, in which the agent is lost",
                frame_rate.get_or_insert(30.0)
            ));
        }
        let reading = &TrajectoryReading { unit, frame_rate, ..reading.clone() };
        let raw = raw(&grid, &layout, reading, &mut notes).map_err(fault)?;
        let counts_frames =
            matches!(layout, Layout::Long(Clock::Frame(_), _) | Layout::Wide(Clock::Frame(_), _));
        Self::of(raw, reading, counts_frames, notes).map_err(fault)
    }

    fn of(
        mut raw: Vec<Raw>,
        reading: &TrajectoryReading,
        counts_frames: bool,
        mut notes: Vec<String>,
    ) -> Parsed<Self> {
        raw.retain(|raw| !raw.samples.is_empty());
        ensure(!raw.is_empty(), || "nobody is in it: no row has a time, x and y")?;
        let mut doubles = 0;
        for raw in &mut raw {
            raw.samples.sort_by(|a, b| a.time.total_cmp(&b.time));
            let before = raw.samples.len();
            raw.samples.dedup_by(|b, a| a.time == b.time);
            doubles += before - raw.samples.len();
        }
        if doubles > 0 {
            notes.push(format!("{doubles} rows are left out: the agent has one with the same time already"));
        }
        if let Some(reported) = motion::degrees(raw.iter().map(|raw| raw.samples.as_slice())) {
            notes.push(reported);
            raw.iter_mut().flat_map(|raw| &mut raw.samples).for_each(Sample::turn_into_radians);
        }
        raw.iter_mut().flat_map(|raw| &mut raw.samples).for_each(Sample::with_velocity);
        let missing = Missing { rate: counts_frames && reading.frame_rate.is_none(), unit: reading.unit };
        let tracks: Vec<&[Sample]> = raw.iter().map(|raw| raw.samples.as_slice()).collect();
        let found = motion::found(&tracks, &missing)?;
        notes.extend(found.notes);
        raw.iter_mut().flat_map(|raw| &mut raw.samples).for_each(|sample| sample.time /= found.rate);
        let pairs = raw.iter().flat_map(|raw| raw.samples.windows(2));
        let usual_step = median(pairs.map(|pair| pair[1].time - pair[0].time));
        let agents = raw.into_iter().enumerate();
        let all = agents.map(|(place, raw)| Agent::of(raw, place, found.unit, reading));
        Ok(Self { all: all.collect(), notes, usual_step: usual_step.unwrap_or(1.0) })
    }

    /// The agent of this name or number.
    ///
    /// # Errors
    /// Nobody has it, as an error of the flag.
    pub(super) fn named(&self, flag: &str, name: &str) -> Result<&Agent> {
        let found = self.all.iter().find(|agent| agent.name == name);
        let by_number = || self.all.iter().find(|agent| Ok(agent.id) == name.parse());
        found.or_else(by_number).ok_or_else(|| {
            const MOST: usize = 20;
            let mut names: Vec<&str> = self.all.iter().take(MOST).map(|agent| agent.name.as_str()).collect();
            if self.all.len() > MOST {
                names.push("...");
            }
            let reason = format!(
                "'{name}' is nobody in this table; it has {}, nearest:N and all are allowed, too",
                names.join(", ")
            );
            Error::param(flag, reason)
        })
    }

    /// The agents that a word means: a name, a number, or a range of numbers, such as `3..7`.
    ///
    /// # Errors
    /// As [`Agents::named`].
    pub(super) fn meant(&self, word: &str) -> Result<Vec<&Agent>> {
        let number = |text: &str| text.parse::<f64>().ok();
        let ends = word.split_once("..").and_then(|(from, to)| number(from).zip(number(to)));
        let Some((from, to)) = ends else { return Ok(vec![self.named("agent", word)?]) };
        let within =
            |agent: &&Agent| agent.name.parse().is_ok_and(|number: f64| (from..=to).contains(&number));
        let found: Vec<&Agent> = self.all.iter().filter(within).collect();
        if found.is_empty() { self.named("agent", word).map(|agent| vec![agent]) } else { Ok(found) }
    }

    /// The robot, if there is one and no other.
    pub(super) fn robot(&self) -> Option<&Agent> {
        let mut robots = self.all.iter().filter(|agent| agent.is_robot);
        robots.next().filter(|_| robots.next().is_none())
    }

    /// The first time of all, seconds.
    pub(super) fn start(&self) -> f64 {
        self.all.iter().map(|agent| agent.start).fold(f64::INFINITY, f64::min)
    }
}

impl Agent {
    fn of(raw: Raw, place: usize, unit: PositionUnit, reading: &TrajectoryReading) -> Self {
        let number = raw.name.parse::<f64>().ok().filter(|id| id.fract() == 0.0 && (0.0..4e9).contains(id));
        let id = number.map_or(place as u32 + 1, |id| id as u32);
        let per_metre = unit.per_metre();
        let scaled = |(x, y): (f64, f64)| (x / per_metre, y / per_metre);
        let last = raw.samples.last().map(|sample| scaled(sample.place));
        let mut tracker = PeopleTracker::new("map", "map", FOR_EVER_S);
        let mut track = Track::without_limit();
        for sample in &raw.samples {
            let stamp = Time::from_secs_f64(sample.time);
            let (x, y) = scaled(sample.place);
            let goal = if reading.last_is_goal { last.unwrap_or((x, y)) } else { scaled(sample.goal) };
            let mut sighting = Sighting {
                id,
                header: Header { stamp, frame_id: "map".into() },
                goal: Some(Point { x: goal.0, y: goal.1, z: 0.0 }),
                ..Sighting::default()
            };
            (sighting.pose.position.x, sighting.pose.position.y) = (x, y);
            sighting.pose.orientation = Quaternion::from_yaw(sample.heading(scaled));
            sighting.twist = sample.velocity.map(|velocity| walking(scaled(velocity).into()));
            tracker.message(stamp, vec![(Who::Number(id), sighting)]);
            if let Some(state) = tracker.people(|_| None).humans.into_iter().next() {
                track.insert(stamp.as_nanos(), recorder::values(&state.pose2d, &state.twist, &state.goal));
            }
        }
        let time = |sample: Option<&Sample>| sample.map_or(f64::NAN, |sample| sample.time);
        let (start, end) = (time(raw.samples.first()), time(raw.samples.last()));
        let from = raw.samples.first().map_or((0.0, 0.0), |sample| sample.place);
        let is_near = |s: &Sample| libm::hypot(s.place.0 - from.0, s.place.1 - from.1) < STILL * per_metre;
        let stands = raw.samples.iter().all(is_near);
        Self { name: raw.name, id, is_robot: raw.is_robot, stands, start, end, track }
    }

    /// The values at these stamps; unknown where the agent is not there.
    pub(super) fn rows(&self, stamps: &[i64], max_gap: i64) -> Vec<Values> {
        stamps.iter().map(|&stamp| self.track.at(stamp, max_gap, false).unwrap_or(Values::UNKNOWN)).collect()
    }
}

/// The samples of each agent, in the order of their first rows.
fn raw(
    grid: &Grid,
    layout: &Layout,
    reading: &TrajectoryReading,
    notes: &mut Vec<String>,
) -> Parsed<Vec<Raw>> {
    let (Layout::Long(clock, _) | Layout::Wide(clock, _)) = layout;
    let times = times(grid, *clock, reading, notes)?;
    let mut agents: Vec<Raw> = Vec::new();
    let mut places: BTreeMap<String, usize> = BTreeMap::new();
    let mut add = |name: String, is_robot: bool, sample: Sample| {
        let place = *places.entry(name.clone()).or_insert_with(|| {
            agents.push(Raw { name: name.clone(), ..Raw::default() });
            agents.len() - 1
        });
        let raw = &mut agents[place];
        raw.is_robot |= is_robot || name.to_lowercase().contains("robot");
        if sample.time.is_finite() && sample.place.0.is_finite() && sample.place.1.is_finite() {
            raw.samples.push(sample);
        }
    };
    match layout {
        Layout::Long(_, roles) => {
            let number = |role: &str, row: usize| {
                roles.get(role).map_or(f64::NAN, |&column| grid.columns[column].1.number(row))
            };
            let text =
                |role: &str, row: usize| roles.get(role).and_then(|&column| grid.columns[column].1.text(row));
            for (row, &time) in times.iter().enumerate() {
                let Some(name) = text("id", row) else { continue };
                let kind = text("kind", row).unwrap_or_default().to_lowercase();
                let (vx, vy) = (number("vx", row), number("vy", row));
                let sample = Sample {
                    velocity: (vx.is_finite() && vy.is_finite()).then_some((vx, vy)),
                    speed: if roles.contains_key("vx") { f64::NAN } else { number("speed", row) },
                    heading: number("heading", row),
                    goal: (number("gx", row), number("gy", row)),
                    ..Sample::at(time, (number("x", row), number("y", row)))
                };
                add(name, kind.contains("robot"), sample);
            }
        }
        Layout::Wide(_, bodies) => {
            let known = times.iter().filter(|time| time.is_finite());
            let different: BTreeSet<u64> = known.clone().map(|time| time.to_bits()).collect();
            let used = 1 + 2 * bodies.values().map(Vec::len).sum::<usize>();
            if 2 * different.len() < known.count() && grid.columns.len() > used {
                let names: Vec<&str> = grid.columns.iter().map(|(name, _)| name.as_str()).collect();
                return Err(format!(
                    "rows of one time are of several agents, but {}",
                    layout::lacking("id", &names)
                ));
            }
            for (name, markers) in bodies {
                for (row, &time) in times.iter().enumerate() {
                    add(name.clone(), false, Sample::at(time, middle(grid, markers, row)));
                }
            }
        }
    }
    Ok(agents)
}

/// The middle of the markers that are seen.
fn middle(grid: &Grid, markers: &[(usize, usize)], row: usize) -> (f64, f64) {
    let seen = markers.iter().map(|&(x, y)| (grid.columns[x].1.number(row), grid.columns[y].1.number(row)));
    let seen: Vec<(f64, f64)> = seen.filter(|(x, y)| x.is_finite() && y.is_finite()).collect();
    let n = seen.len() as f64;
    (seen.iter().map(|(x, _)| x).sum::<f64>() / n, seen.iter().map(|(_, y)| y).sum::<f64>() / n)
}

/// The time of each row, seconds.
fn times(
    grid: &Grid,
    clock: Clock,
    reading: &TrajectoryReading,
    notes: &mut Vec<String>,
) -> Parsed<Vec<f64>> {
    let (column, unit) = match clock {
        Clock::Frame(column) => {
            // Seconds if the rate is known, frames otherwise.
            let rate = reading.frame_rate.unwrap_or(1.0);
            if !(rate.is_finite() && rate > 0.0) {
                let setting = Named("frame_rate");
                return Err(format!("{setting} {rate} is not a number of frames per second above 0"));
            }
            let frames = &grid.columns[column].1;
            return Ok((0..frames.len()).map(|row| frames.number(row) / rate).collect());
        }
        Clock::Time(column, unit) => (column, unit),
    };
    match &grid.columns[column].1 {
        Column::Times(times) => Ok(times.clone()),
        Column::Numbers(numbers) => {
            // Rows of different agents may come in any order; the guess of a unit needs them in the order of time.
            let mut order: Vec<f64> = numbers.iter().copied().filter(|t| t.is_finite()).collect();
            order.sort_by(f64::total_cmp);
            order.dedup();
            let first = order.first().copied().unwrap_or(0.0);
            let (seconds, reported) = time::in_seconds(order.clone(), unit);
            notes.extend(reported);
            let (n, last) = (order.len(), order.last().copied().unwrap_or(0.0));
            let scale = if n > 1 { (seconds[n - 1] - seconds[0]) / (last - first) } else { 1.0 };
            let base = seconds.first().copied().unwrap_or(0.0);
            Ok(numbers.iter().map(|t| base + (t - first) * scale).collect())
        }
        Column::Words(_) | Column::Other(_) => {
            Err(format!("column '{}' holds no times: neither numbers nor dates", grid.columns[column].0))
        }
    }
}
