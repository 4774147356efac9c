//! When to set out and by which places: the way and the moment with the least expected cost.
//!
//! For each minute at which the robot may set out, petgraph's A* finds the way whose arcs cost least at the moments at which it comes
//! to them when nobody is in its way. The best moment is then the one with the least sum of waiting, driving, battery, people met and
//! the chance to be late.

use petgraph::{algo::astar, graph::NodeIndex, visit::EdgeRef};
use roscausal_discovery::{Error, Result};

use super::{
    levels::{Expected, Levels},
    map::Map,
    pace::{Drain, Pace},
};

/// The largest number of a question: the seconds of a day.
const LONGEST: f64 = 86_400.0;
/// Seconds between two moments that are compared.
pub const STEP: f64 = 60.0;

/// What a robot's cost is made of, all in seconds of its time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cost {
    /// For a second of waiting.
    pub waiting: f64,
    /// For a person met.
    pub person: f64,
    /// For a percent of the battery.
    pub percent: f64,
    /// For being late.
    pub late: f64,
}

impl Default for Cost {
    fn default() -> Self {
        Self { waiting: 0.02, person: 0.0, percent: 1.0, late: 300.0 }
    }
}

/// A question: from where to where, and when.
#[derive(Clone, Copy, Debug)]
pub struct Trip<'a> {
    /// Index of the place where the robot is.
    pub from: usize,
    /// Index of the place where it has to go.
    pub to: usize,
    /// Hours from midnight.
    pub hour: f64,
    /// Seconds for which it may wait.
    pub horizon: f64,
    /// Seconds that the way may take; none: as long as it takes.
    pub allowed: Option<f64>,
    /// The value at each place now, where it is known.
    pub now: Option<&'a [f64]>,
    /// What the cost is made of.
    pub cost: Cost,
}

/// One way at one moment.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// Seconds to wait.
    pub wait: f64,
    /// The places, first and last among them.
    pub places: Vec<usize>,
    /// Seconds of the way.
    pub seconds: Expected,
    /// People on it, summed over its arcs.
    pub people: Expected,
    /// Percent of the battery, waiting included.
    pub battery: f64,
    /// The chance to take longer than allowed.
    pub late: f64,
    /// All in seconds.
    pub cost: f64,
}

/// What is known of a house: its map, what is expected where, and how the robot drives.
#[derive(Clone, Debug)]
pub struct House<'a> {
    /// Places and arcs.
    pub map: &'a Map,
    /// What is expected at each place.
    pub levels: &'a Levels,
    /// How fast the robot drives among people.
    pub pace: Pace,
    /// What its battery loses.
    pub drain: Drain,
    /// Seconds of a row of the recordings.
    pub row: f64,
}

/// What is expected at each place and step of a trip.
struct Table(Vec<Vec<Option<Expected>>>);

impl House<'_> {
    /// The best choice, and the best one of those that set out at once.
    ///
    /// # Errors
    /// A number that is none, below 0 or above a day, counts for other places than the map's; a trip in hours or through places that
    /// were never recorded.
    pub fn best(&self, trip: &Trip<'_>) -> Result<(Choice, Choice)> {
        let cost = [trip.cost.waiting, trip.cost.person, trip.cost.percent, trip.cost.late];
        let numbers = [trip.hour, trip.horizon, trip.allowed.unwrap_or_default()];
        let counts = trip.now.unwrap_or_default();
        if numbers.iter().chain(&cost).chain(counts).any(|number| !(0.0..=LONGEST).contains(number)) {
            return Err(Error::param("trip", format!("a number is below 0, above {LONGEST} or none")));
        }
        if trip.now.is_some() && counts.len() != self.map.places.len() {
            let reason = format!(
                "{} counts for {} places; give one for each, or none",
                counts.len(),
                self.map.places.len()
            );
            return Err(Error::param("now", reason));
        }
        let free: Vec<f64> =
            self.map.distance[trip.from].iter().map(|metres| metres * self.pace.free).collect();
        let longest = free.iter().fold(0.0, |a: f64, b| a.max(*b));
        let steps = (trip.horizon / STEP) as usize;
        // Beyond a day more nothing is expected.
        let table = self.table(trip, steps + (longest / STEP).min(LONGEST / STEP) as usize + 1);
        let refused = || {
            let (from, to) = (&self.map.places[trip.from].name, &self.map.places[trip.to].name);
            Error::Data(format!(
                "no recording reaches from '{from}' to '{to}' at {:.2} h; record that time of day there",
                trip.hour
            ))
        };
        let at_once = self.choice(trip, &table, &free, 0).ok_or_else(refused)?;
        let mut best = at_once.clone();
        for step in 1..=steps {
            // Waiting alone would cost more than the best.
            if trip.cost.waiting * step as f64 * STEP > best.cost {
                break;
            }
            if let Some(choice) =
                self.choice(trip, &table, &free, step).filter(|choice| choice.cost < best.cost)
            {
                best = choice;
            }
        }
        Ok((best, at_once))
    }

    fn table(&self, trip: &Trip<'_>, steps: usize) -> Table {
        let at = |place: usize, step: usize| {
            let ahead = step as f64 * STEP;
            let now = trip.now.map(|now| (now[place], trip.hour));
            self.levels.expected(place, trip.hour + ahead / 3600.0, ahead / self.row, now)
        };
        Table(
            (0..self.map.places.len())
                .map(|place| (0..=steps).map(|step| at(place, step)).collect())
                .collect(),
        )
    }

    /// The best way for a moment; none if what is expected on it is not known.
    fn choice(&self, trip: &Trip<'_>, table: &Table, free: &[f64], step: usize) -> Option<Choice> {
        let (from, to) = (NodeIndex::new(trip.from), NodeIndex::new(trip.to));
        let arc = |a: usize, b: usize, metres: f64| {
            let moment = step + (free[a] / STEP) as usize;
            let ends = [a, b].map(|place| table.0[place].get(moment).copied().flatten());
            let [Some(a), Some(b)] = ends else { return None };
            let people =
                Expected { mean: (a.mean + b.mean) / 2.0, variance: (a.variance + b.variance) / 4.0 };
            let seconds = Expected {
                mean: metres * (self.pace.free + self.pace.each * people.mean),
                variance: (metres * self.pace.each).powi(2) * people.variance,
            };
            Some((people, seconds))
        };
        let price = |people: Expected, seconds: Expected, metres: f64| {
            let battery = self.drain.second * seconds.mean + self.drain.metre * metres;
            seconds.mean + trip.cost.person * people.mean + trip.cost.percent * battery
        };
        let (_, nodes) = astar(
            &self.map.graph,
            from,
            |node| node == to,
            |edge| {
                let found = arc(edge.source().index(), edge.target().index(), *edge.weight());
                found.map_or(f64::INFINITY, |(people, seconds)| price(people, seconds, *edge.weight()))
            },
            |_| 0.0,
        )?;
        let places: Vec<usize> = nodes.iter().map(|node| node.index()).collect();
        let mut choice = Choice {
            wait: step as f64 * STEP,
            places,
            seconds: Expected::default(),
            people: Expected::default(),
            battery: self.drain.second * step as f64 * STEP,
            late: 0.0,
            cost: trip.cost.waiting * step as f64 * STEP,
        };
        for pair in choice.places.windows(2) {
            let metres = self.map.graph.find_edge(NodeIndex::new(pair[0]), NodeIndex::new(pair[1]))?;
            let metres = self.map.graph[metres];
            let (people, seconds) = arc(pair[0], pair[1], metres)?;
            for (sum, part) in [(&mut choice.seconds, seconds), (&mut choice.people, people)] {
                sum.mean += part.mean;
                sum.variance += part.variance;
            }
            choice.battery += self.drain.second * seconds.mean + self.drain.metre * metres;
            choice.cost += price(people, seconds, metres);
        }
        if let Some(allowed) = trip.allowed {
            // A normal law for the sum over the arcs.
            let sd = choice.seconds.variance.sqrt().max(1e-9);
            choice.late = libm::erfc((allowed - choice.seconds.mean) / (sd * std::f64::consts::SQRT_2)) / 2.0;
            choice.cost += trip.cost.late * choice.late;
        }
        Some(choice)
    }
}

/// A duration in words: `40 s`, `12 min`.
fn duration(seconds: f64) -> String {
    if seconds < 120.0 { format!("{seconds:.0} s") } else { format!("{:.0} min", seconds / 60.0) }
}

impl Choice {
    /// The 90 % interval of the seconds on the way.
    pub fn seconds_interval(&self) -> (f64, f64) {
        let half = 1.645 * self.seconds.variance.sqrt();
        ((self.seconds.mean - half).max(0.0), self.seconds.mean + half)
    }

    /// The choice in a sentence, and why it is better than setting out at once where it is.
    pub fn sentence(&self, map: &Map, at_once: &Self) -> String {
        let names = |places: &[usize]| {
            let inner = places.get(1..places.len().max(2) - 1).unwrap_or_default();
            inner.iter().map(|place| map.places[*place].name.as_str()).collect::<Vec<_>>().join(", ")
        };
        let on_way = |choice: &Self| {
            let (low, high) = choice.seconds_interval();
            let late = if choice.late > 0.0 {
                format!(", late in {:.0} of 100", 100.0 * choice.late)
            } else {
                String::new()
            };
            format!(
                "{:.0} s ({low:.0} to {high:.0}), {:.1} people on the way{late}",
                choice.seconds.mean, choice.people.mean
            )
        };
        let by = |choice: &Self| match names(&choice.places) {
            inner if inner.is_empty() => "straight".to_owned(),
            inner => format!("by {inner}"),
        };
        if self.wait == 0.0 {
            return format!("Go now, {}: {}.", by(self), on_way(self));
        }
        format!(
            "Wait {}, then go {}: {}. Now the best way is {}: {}.",
            duration(self.wait),
            by(self),
            on_way(self),
            by(at_once),
            on_way(at_once)
        )
    }
}
