//! What is to be expected of a variable at each place and each hour: its level there, and how it comes back to it.
//!
//! One equation for all places and hours, with the parents that the causal graph gives the variable `y`:
//!
//! `y_t = level[place, hour] (1 - phi) + phi y_(t-1) + sum of slopes x causes + noise`
//!
//! 1. Slopes: least squares on rows minus the mean of their place, hour and day (Frisch and Waugh 1933). So what differs between places,
//!    hours or days confounds nothing.
//! 2. Levels: what is left of the means, as it would be with all causes at 0. A robot that empties the places it visits is a cause: the
//!    plain mean of such a place is too low for a robot that thinks of coming, the level is not.
//! 3. A day whose means differ from those of the days before by more than days differ anyway, in one hour or at one place, begins anew
//!    there: the older days are put away for those hours or places. The first two days tell how much days differ anyway.
//!
//! Example: at a place where people stand 3 of 4 seconds but leave while the robot is there, which is every second time, the mean is
//! 0.38 and the level 0.75.

use std::collections::BTreeSet;

use roscausal_discovery::{DataFrame, Error, Node, Result};

use crate::{graph::Graph, linear::least_squares};

/// An hour or a place of a day has changed if its mean square lies this many standard deviations above the usual one.
const CHANGED: f64 = 6.0;
/// A place and hour is recorded with this many rows, and this share of those of the fullest one.
const FEWEST: f64 = 10.0;
const ENOUGH: f64 = 0.05;
/// A day counts in an hour in which it has this share of the rows of the days before: it may be unfinished.
const WHOLE: f64 = 0.5;
/// The largest square of one cell, so that one alone changes no hour and no place.
const LARGEST: f64 = 15.0;
/// Two cells at least have to differ this much.
const FAR: f64 = 6.0;
/// A cell varies at least by this share of what cells vary on average: where hardly anybody comes, one person is no change.
const LEAST_SPREAD: f64 = 0.25;
/// The largest share of a deviation that is left a row later.
const MOST_KEPT: f64 = 0.9995;

/// Where and when a recording was made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Made {
    /// Index of the place.
    pub place: usize,
    /// Number of the day; days count in order.
    pub day: usize,
}

/// How the levels are had.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Way {
    /// As above.
    #[default]
    Causal,
    /// The mean by place and hour, whatever acted on it; nothing is put away.
    Mean,
    /// One level for all places and hours, with the causes: a vector autoregression. Nothing is put away.
    Lagged,
}

/// What is expected of a value.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Expected {
    /// Mean.
    pub mean: f64,
    /// Variance around it.
    pub variance: f64,
}

/// A day that began anew, at an hour or at a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Anew {
    /// Number of the day.
    pub day: usize,
    /// The hour, counted from the first.
    pub hour: Option<usize>,
    /// The place.
    pub place: Option<usize>,
}

/// The levels by place and hour.
#[derive(Clone, Debug)]
pub struct Levels {
    /// Slopes of the parents, in the order of [`Graph::parents`] without the hour.
    pub slopes: Vec<f64>,
    /// The share of a deviation that is left a row later.
    pub kept: f64,
    /// What began anew.
    pub anew: Vec<Anew>,
    /// First hour, and how many there are.
    hours: (f64, usize),
    /// One level holds for all hours and places.
    pooled: bool,
    /// By place and hour; none where nothing was recorded.
    cells: Vec<Option<Expected>>,
    /// Variance of the value around its level, by place and hour.
    spread: Vec<f64>,
}

/// Sums over the rows of one day, place and hour.
#[derive(Clone, Debug, Default)]
struct Sums {
    n: f64,
    y: f64,
    yy: f64,
    x: Vec<f64>,
}

impl Sums {
    fn add(&mut self, other: &Self) {
        self.n += other.n;
        self.y += other.y;
        self.yy += other.yy;
        self.x.resize(other.x.len().max(self.x.len()), 0.0);
        self.x.iter_mut().zip(&other.x).for_each(|(sum, x)| *sum += x);
    }

    fn variance(&self) -> f64 {
        (self.yy / self.n - (self.y / self.n).powi(2)).max(0.0)
    }
}

/// The rows of all recordings that have the value and its causes.
struct Rows {
    /// Day and cell of each row; a cell is a place in an hour.
    at: Vec<(usize, usize)>,
    /// The value and its causes, by column.
    columns: Vec<Vec<f64>>,
    /// Their sums by day and cell.
    sums: Vec<Vec<Sums>>,
    /// First hour, and how many there are.
    hours: (f64, usize),
}

impl Rows {
    fn new(
        data: &DataFrame,
        made: &[Made],
        target: usize,
        hour: usize,
        parents: &[Node],
        pooled: bool,
    ) -> Result<Self> {
        let memory = parents.iter().map(|node| node.lag).max().unwrap_or(0);
        let all = data.recordings().iter().flat_map(|recording| recording.column(hour).to_vec());
        let (first, last) =
            all.filter(|h| h.is_finite()).fold((f64::MAX, f64::MIN), |(a, b), h| (a.min(h), b.max(h)));
        if !(0.0..=48.0).contains(&first) || !(0.0..=48.0).contains(&last) {
            return Err(Error::Data(format!("'{}' is no time of day in hours", data.var_names()[hour])));
        }
        let first = first.floor();
        let bins = if pooled { 1 } else { (last - first).floor() as usize + 1 };
        let places = made.iter().map(|one| one.place + 1).max().unwrap_or(0);
        let days = made.iter().map(|one| one.day + 1).max().unwrap_or(0);
        let sums = vec![vec![Sums::default(); places * bins]; days];
        let columns = vec![Vec::new(); parents.len() + 1];
        let mut rows = Self { at: Vec::new(), columns, sums, hours: (first, bins) };
        for (recording, one) in data.recordings().iter().zip(made) {
            for t in memory..recording.nrows() {
                let (value, at) = (recording[[t, target]], recording[[t, hour]]);
                let causes: Vec<f64> =
                    parents.iter().map(|node| recording[[t - node.lag, node.var]]).collect();
                if causes.iter().chain([&value, &at]).all(|x| x.is_finite()) {
                    let bin = if pooled { 0 } else { (at - first) as usize };
                    rows.add((one.day, one.place * bins + bin), value, causes);
                }
            }
        }
        if rows.at.is_empty() {
            return Err(Error::Data(format!("no row has '{}' and its causes", data.var_names()[target])));
        }
        Ok(rows)
    }

    fn add(&mut self, at: (usize, usize), value: f64, causes: Vec<f64>) {
        self.at.push(at);
        let values = [&value].into_iter().chain(&causes);
        self.columns.iter_mut().zip(values).for_each(|(column, x)| column.push(*x));
        self.sums[at.0][at.1].add(&Sums { n: 1.0, y: value, yy: value * value, x: causes });
    }

    /// The sums of each cell over the days from `since` on; `pooled`: over all cells, too.
    fn by_cell(&self, since: &[usize], pooled: bool) -> Vec<Sums> {
        let over_days = |(cell, first): (usize, &usize)| {
            let mut sum = Sums::default();
            self.sums[*first..].iter().for_each(|day| sum.add(&day[cell]));
            sum
        };
        let mut cells: Vec<Sums> = since.iter().enumerate().map(over_days).collect();
        if pooled {
            let mut whole = Sums::default();
            cells.iter().for_each(|cell| whole.add(cell));
            cells.fill(whole);
        }
        cells
    }

    /// Takes from each row the mean of its day and cell, or of all.
    fn centre(&mut self, whole: Option<&Sums>) {
        for (row, (day, cell)) in self.at.iter().enumerate() {
            let of = whole.unwrap_or(&self.sums[*day][*cell]);
            let means = [of.y].into_iter().chain(of.x.iter().copied()).map(|sum| sum / of.n);
            self.columns.iter_mut().zip(means).for_each(|(column, mean)| column[row] -= mean);
        }
    }

    /// By how much fewer independent rows each place has: rows that follow one another tell less, and where people stay long, much
    /// less. `own` is the column of the value one row before; the rows are centred.
    fn inflation(&self, own: Option<usize>) -> Vec<f64> {
        let bins = self.hours.1;
        let mut products = vec![(0.0, 0.0); self.sums[0].len() / bins];
        for (row, (_, cell)) in self.at.iter().enumerate() {
            let (square, product) = &mut products[cell / bins];
            *square += self.columns[0][row].powi(2);
            *product += own.map_or(0.0, |k| self.columns[0][row] * self.columns[k][row]);
        }
        let kept = |(square, product): (f64, f64)| {
            if square > 0.0 { (product / square).clamp(0.0, MOST_KEPT) } else { 0.0 }
        };
        products.into_iter().map(kept).map(|r| (1.0 + r) / (1.0 - r)).collect()
    }
}

impl Levels {
    /// Fits the levels of the variable `target`. Each recording is one of one place and one day, `made` says which; `hour` is the
    /// column with the time of day in hours.
    ///
    /// # Errors
    /// No row that has all its values, or an hour outside of 0 to 48.
    pub fn fit(
        data: &DataFrame,
        made: &[Made],
        graph: &Graph,
        target: usize,
        hour: usize,
        way: Way,
    ) -> Result<Self> {
        let pooled = way == Way::Lagged;
        let of_hour = |node: &&Node| node.var != hour && way != Way::Mean;
        let parents: Vec<Node> = graph.parents(target).iter().filter(of_hour).copied().collect();
        let mut rows = Rows::new(data, made, target, hour, &parents, pooled)?;
        let bins = rows.hours.1;
        let since = vec![0; rows.sums[0].len()];
        rows.centre(pooled.then(|| rows.by_cell(&since, true).swap_remove(0)).as_ref());
        let slopes = least_squares(&rows.columns[0], &rows.columns[1..]).coefficients;
        let is_own = |k: &usize| parents[*k].var == target;
        let kept = (0..parents.len()).filter(is_own).map(|k| slopes[k]).sum::<f64>().clamp(0.0, MOST_KEPT);
        let own = (0..parents.len()).find(|k| is_own(k) && parents[*k].lag == 1);
        let inflation = rows.inflation(own.map(|k| k + 1));
        let (anew, since) = match way {
            Way::Causal => begun_anew(&rows.sums, bins, &inflation),
            Way::Mean | Way::Lagged => (Vec::new(), since),
        };
        let present = rows.by_cell(&since, pooled);
        let fullest = present.iter().map(|sum| sum.n).fold(0.0, f64::max);
        let level = |(cell, sum): (usize, &Sums)| {
            let mean = |k: usize| sum.x[k] / sum.n;
            let given: f64 = (0..parents.len()).filter(|k| !is_own(k)).map(|k| slopes[k] * mean(k)).sum();
            let before = own.map_or(sum.y / sum.n, mean);
            (sum.n >= FEWEST.max(ENOUGH * fullest)).then(|| Expected {
                mean: (sum.y / sum.n - given - kept * before) / (1.0 - kept),
                variance: sum.variance() * inflation[cell / bins] / sum.n,
            })
        };
        Ok(Self {
            cells: present.iter().enumerate().map(level).collect(),
            spread: present.iter().map(|sum| if sum.n > 0.0 { sum.variance() } else { 0.0 }).collect(),
            slopes,
            kept,
            anew,
            hours: rows.hours,
            pooled,
        })
    }

    /// An hour as a clock says it.
    pub fn hour(&self, number: usize) -> String {
        format!("{:02}:00", (self.hours.0 as usize + number) % 24)
    }

    fn cell(&self, place: usize, hour: f64) -> Option<usize> {
        let (first, bins) = self.hours;
        let within = |bin: f64| (0.0..bins as f64).contains(&bin).then_some(bin as usize);
        let bin = (hour - first).floor();
        // What goes past midnight counts on in the days, or begins anew.
        let bin = if self.pooled { 0 } else { within(bin).or_else(|| within(bin.rem_euclid(24.0)))? };
        Some(place * bins + bin).filter(|cell| *cell < self.cells.len())
    }

    /// The level at a place and hour with its uncertainty; none where nothing was recorded.
    pub fn level(&self, place: usize, hour: f64) -> Option<Expected> {
        self.cells[self.cell(place, hour)?]
    }

    /// What is expected `ahead` rows after a value was `now` at the hour `since`; `None` for a place or an hour that was not recorded.
    pub fn expected(&self, place: usize, hour: f64, ahead: f64, now: Option<(f64, f64)>) -> Option<Expected> {
        let level = self.level(place, hour)?;
        let left = libm::pow(self.kept, ahead);
        let deviation =
            now.and_then(|(value, since)| Some(value - self.level(place, since)?.mean)).unwrap_or(0.0);
        let known = if now.is_some() { left * left } else { 0.0 };
        Some(Expected {
            mean: (level.mean + left * deviation).max(0.0),
            variance: level.variance + self.spread[self.cell(place, hour)?] * (1.0 - known),
        })
    }
}

/// From which day on each cell is as it is now, and what began anew.
fn begun_anew(sums: &[Vec<Sums>], bins: usize, inflation: &[f64]) -> (Vec<Anew>, Vec<usize>) {
    let places = inflation.len();
    let mut since = vec![0; places * bins];
    let mut anew = Vec::new();
    // The largest mean square of each margin, hours before places, on days that did not differ.
    let mut usual = vec![1.0_f64; bins + places];
    for day in 1..sums.len() {
        let earlier = |cell: usize| {
            let mut pool = Sums::default();
            sums[since[cell]..day].iter().for_each(|earlier| pool.add(&earlier[cell]));
            (pool, (day - since[cell]) as f64)
        };
        let filled = sums[day].iter().filter(|today| today.n > 0.0);
        let spread =
            LEAST_SPREAD * filled.clone().map(Sums::variance).sum::<f64>() / filled.count().max(1) as f64;
        let square = |cell: usize| -> Option<f64> {
            let ((pool, days), today) = (earlier(cell), &sums[day][cell]);
            if pool.n == 0.0 || today.n < WHOLE * pool.n / days {
                return None;
            }
            let part = |sums: &Sums| sums.variance().max(spread) / sums.n;
            let variance = (part(&pool) + part(today)) * inflation[cell / bins];
            (variance > 0.0).then(|| ((pool.y / pool.n - today.y / today.n).powi(2) / variance).min(LARGEST))
        };
        let squares: Vec<Option<f64>> = (0..places * bins).map(square).collect();
        let mut renewed = BTreeSet::new();
        for (margin, usual) in usual.iter_mut().enumerate() {
            let (hour, place) =
                if margin < bins { (Some(margin), None) } else { (None, Some(margin - bins)) };
            let is_in = |cell: &usize| {
                hour.is_none_or(|h| cell % bins == h) && place.is_none_or(|p| cell / bins == p)
            };
            let found: Vec<f64> = (0..places * bins).filter(is_in).filter_map(|cell| squares[cell]).collect();
            let count = found.len().max(1) as f64;
            let mean = found.iter().sum::<f64>() / count;
            // The second day only tells how much days differ anyway.
            let far = found.iter().filter(|square| **square > FAR).count();
            if day > 1 && far > 1 && mean > *usual * (1.0 + CHANGED * (2.0 / count).sqrt()) {
                anew.push(Anew { day, hour, place });
                renewed.extend((0..places * bins).filter(|cell| is_in(cell) && squares[*cell].is_some()));
            } else {
                *usual = usual.max(mean);
            }
        }
        renewed.into_iter().for_each(|cell| since[cell] = day);
    }
    (anew, since)
}
