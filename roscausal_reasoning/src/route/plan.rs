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
/// Standard deviations of an arc that the cautious way counts.
const CAUTIOUS: f64 = 1.3;
/// Seconds between two moments that are compared.
pub const STEP: f64 = 60.0;

roscausal_discovery::with_defaults! {
    /// What a robot's cost is made of, all in seconds of its time.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct Cost {
        /// For a second of waiting.
        pub waiting: f64 = 0.02,
        /// For a person met.
        pub person: f64 = 0.0,
        /// For a percent of the battery.
        pub percent: f64 = 1.0,
        /// For being late.
        pub late: f64 = 300.0,
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
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Choice {
    /// Seconds to wait.
    pub wait: f64,
    /// The places, first and last among them.
    pub places: Vec<usize>,
    /// Seconds of the way.
    pub seconds: Expected,
    /// Seconds of the way if nobody is on it.
    pub least: f64,
    /// People on it, summed over its arcs.
    pub people: f64,
    /// Percent of the battery, waiting included.
    pub battery: f64,
    /// The chance to take longer than allowed, if that was said.
    pub late: Option<f64>,
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
    /// The best choice, and the best one of those that set out at once; `None` where nothing is known of that.
    ///
    /// # Errors
    /// A number that is none, below 0 or above a day, counts for other places than the map's; a trip in hours or through places that
    /// were never recorded.
    pub fn best(&self, trip: &Trip<'_>) -> Result<(Choice, Option<Choice>)> {
        let cost = [trip.cost.waiting, trip.cost.person, trip.cost.percent, trip.cost.late];
        let numbers = [trip.hour, trip.horizon, trip.allowed.unwrap_or_default()];
        let counts = trip.now.unwrap_or_default();
        let fit = numbers.iter().chain(&cost).chain(counts).all(|number| (0.0..=LONGEST).contains(number));
        Error::ensure(fit, "trip", || format!("a number is below 0, above {LONGEST} or none"))?;
        let (given, n) = (counts.len(), self.map.places.len());
        Error::ensure(trip.now.is_none() || given == n, "now", || {
            format!("{given} counts for {n} places; give one for each, or none")
        })?;
        let free: Vec<f64> =
            self.map.distance[trip.from].iter().map(|metres| metres * self.pace.free).collect();
        let longest = free.iter().fold(0.0, |a: f64, b| a.max(*b));
        let steps = (trip.horizon / STEP) as usize;
        // Beyond a day more nothing is expected.
        let table = self.table(trip, steps + (longest / STEP).min(LONGEST / STEP) as usize + 1);
        let at_once = self.choice(trip, &table, &free, 0);
        let mut best = at_once.clone();
        for step in 1..=steps {
            // Waiting alone would cost more than the best.
            let waiting = self.waiting(trip, step as f64 * STEP);
            if best.as_ref().is_some_and(|best| waiting > best.cost) {
                break;
            }
            let choice = self.choice(trip, &table, &free, step);
            best = [best, choice].into_iter().flatten().reduce(|a, b| if b.cost < a.cost { b } else { a });
        }
        let best = best.filter(|best| best.seconds.mean <= LONGEST).ok_or_else(|| {
            let (from, to) = (&self.map.places[trip.from].name, &self.map.places[trip.to].name);
            let (hour, minute) = (trip.hour as u32 % 24, (trip.hour.fract() * 60.0) as u32);
            let reason = "each place of a way needs rows of that hour, and the way has to end within a day";
            Error::Data(format!(
                "the recorded days do not reach from '{from}' to '{to}' at {hour}:{minute:02}: {reason}"
            ))
        })?;
        Ok((best, at_once))
    }

    /// What waiting costs, the battery that it takes among it.
    fn waiting(&self, trip: &Trip<'_>, seconds: f64) -> f64 {
        seconds * (trip.cost.waiting + trip.cost.percent * self.drain.second)
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

    /// The better one of two ways for a moment: the one with the least mean, and the one with the least of what is rarely exceeded.
    /// None if what is expected on all ways is not known.
    fn choice(&self, trip: &Trip<'_>, table: &Table, free: &[f64], step: usize) -> Option<Choice> {
        let ways = [0.0, CAUTIOUS].map(|sds| self.way(trip, table, free, (step, sds)));
        let choices = ways.into_iter().flatten().filter_map(|way| self.priced(trip, table, free, step, way));
        choices.reduce(|a, b| if b.cost < a.cost { b } else { a })
    }

    /// What is expected at a place when the robot comes to it.
    fn there(
        &self,
        table: &Table,
        free: &[f64],
        step: usize,
        (from, place): (usize, usize),
    ) -> Option<Expected> {
        table.0[place].get(step + (free[from] / STEP) as usize).copied().flatten()
    }

    /// The way with the least cost, where each arc counts as its mean and so many standard deviations.
    fn way(
        &self,
        trip: &Trip<'_>,
        table: &Table,
        free: &[f64],
        (step, sds): (usize, f64),
    ) -> Option<Vec<usize>> {
        let price = |a: usize, b: usize, metres: f64| {
            let ends = [a, b].map(|place| self.there(table, free, step, (a, place)));
            let [Some(a), Some(b)] = ends else { return f64::INFINITY };
            let spread = sds * metres * self.pace.each * (a.variance + b.variance).sqrt() / 2.0;
            (self.price(trip, (a.mean + b.mean) / 2.0, metres).0 + spread).max(0.0)
        };
        let arc = |edge: petgraph::graph::EdgeReference<'_, f64>| {
            price(edge.source().index(), edge.target().index(), *edge.weight())
        };
        let (from, to) = (NodeIndex::new(trip.from), NodeIndex::new(trip.to));
        let (_, nodes) = astar(&self.map.graph, from, |node| node == to, arc, |_| 0.0)?;
        Some(nodes.iter().map(|node| node.index()).collect())
    }

    /// The cost of an arc with so many people, its seconds, and what the battery loses on it.
    fn price(&self, trip: &Trip<'_>, people: f64, metres: f64) -> (f64, f64, f64) {
        let seconds = metres * (self.pace.free + self.pace.each * people);
        let battery = self.drain.second * seconds + self.drain.metre * metres;
        (seconds + trip.cost.person * people + trip.cost.percent * battery, seconds, battery)
    }

    /// A way with its figures. The people at a place count for both arcs that meet there.
    fn priced(
        &self,
        trip: &Trip<'_>,
        table: &Table,
        free: &[f64],
        step: usize,
        places: Vec<usize>,
    ) -> Option<Choice> {
        let wait = step as f64 * STEP;
        let (battery, cost) = (self.drain.second * wait, self.waiting(trip, wait));
        let mut choice = Choice { wait, battery, cost, places, ..Choice::default() };
        // Seconds that a person more costs, by place.
        let mut weights = vec![(0.0, 0.0); choice.places.len()];
        for (k, pair) in choice.places.windows(2).enumerate() {
            let metres =
                self.map.graph[self.map.graph.find_edge(NodeIndex::new(pair[0]), NodeIndex::new(pair[1]))?];
            let [a, b] = [pair[0], pair[1]].map(|place| self.there(table, free, step, (pair[0], place)));
            let (a, b) = (a?, b?);
            let people = (a.mean + b.mean) / 2.0;
            let (cost, seconds, battery) = self.price(trip, people, metres);
            choice.cost += cost;
            choice.seconds.mean += seconds;
            choice.battery += battery;
            choice.people += people;
            choice.least += metres * self.pace.free;
            for (at, end) in [(k, a), (k + 1, b)] {
                weights[at] = (weights[at].0 + metres * self.pace.each / 2.0, end.variance);
            }
        }
        choice.seconds.variance = weights.iter().map(|(weight, variance)| weight * weight * variance).sum();
        choice.late = trip.allowed.map(|allowed| {
            // A normal law for the sum over the places.
            let sd = choice.seconds.variance.sqrt().max(1e-9);
            libm::erfc((allowed - choice.seconds.mean) / (sd * std::f64::consts::SQRT_2)) / 2.0
        });
        choice.cost += trip.cost.late * choice.late.unwrap_or(0.0);
        choice.cost.is_finite().then_some(choice)
    }
}

/// A duration in words: `40 s`, `12 min`.
fn duration(seconds: f64) -> String {
    if seconds < 120.0 { format!("{seconds:.0} s") } else { format!("{:.0} min", seconds / 60.0) }
}

impl Choice {
    /// The 90 % interval of the seconds on the way: not below what it takes where nobody is.
    pub fn seconds_interval(&self) -> (f64, f64) {
        let half = 1.645 * self.seconds.variance.sqrt();
        ((self.seconds.mean - half).max(self.least.min(self.seconds.mean)), self.seconds.mean + half)
    }

    /// The choice in a sentence, and beside it what the best way at once would be.
    pub fn sentence(&self, map: &Map, at_once: Option<&Self>) -> String {
        if self.places.len() < 2 {
            return "The robot is there.".to_owned();
        }
        let by = |choice: &Self| {
            let inner = &choice.places[1..choice.places.len() - 1];
            let names: Vec<&str> = inner.iter().map(|place| map.places[*place].name.as_str()).collect();
            if names.is_empty() { "straight".to_owned() } else { format!("by {}", names.join(", ")) }
        };
        let on_way = |choice: &Self| {
            let (low, high) = choice.seconds_interval();
            let late = choice.late.map(|late| match (100.0 * late).round() {
                0.0 => ", late in fewer than 1 of 100".to_owned(),
                of => format!(", late in {of} of 100"),
            });
            let (seconds, people, late) = (choice.seconds.mean, choice.people, late.unwrap_or_default());
            format!(
                "{}: {seconds:.0} s ({low:.0} to {high:.0}), {people:.1} people on the way{late}",
                by(choice)
            )
        };
        if self.wait == 0.0 {
            return format!("Go now, {}.", on_way(self));
        }
        let now = at_once.map_or("What comes of setting out now is not known.".to_owned(), |now| {
            format!("Now the best way is {}.", on_way(now))
        });
        format!("Wait {}, then go {}. {now}", duration(self.wait), on_way(self))
    }
}
