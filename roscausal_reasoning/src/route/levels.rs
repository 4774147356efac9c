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

use roscausal_discovery::{DataFrame, Error, Result};

use crate::{graph::Graph, linear::least_squares};

/// An hour or a place of a day has changed if its mean square lies this many standard deviations above the usual one.
const CHANGED: f64 = 6.0;
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
        let parents: Vec<_> =
            graph.parents(target).iter().filter(|node| node.var != hour && way != Way::Mean).collect();
        let memory = parents.iter().map(|node| node.lag).max().unwrap_or(0);
        let hours_of = |recording: usize| data.recordings()[recording].column(hour);
        let all_hours =
            || (0..made.len()).flat_map(|r| hours_of(r).into_iter().copied()).filter(|h| h.is_finite());
        let (first, last) = all_hours().fold((f64::MAX, f64::MIN), |(a, b), h| (a.min(h), b.max(h)));
        if !(0.0..=48.0).contains(&first) || !(0.0..=48.0).contains(&last) {
            return Err(Error::Data(format!("'{}' is no time of day in hours", data.var_names()[hour])));
        }
        let first = first.floor();
        let bins = if way == Way::Lagged { 1 } else { (last - first).floor() as usize + 1 };
        let places = made.iter().map(|one| one.place + 1).max().unwrap_or(0);
        let days = made.iter().map(|one| one.day + 1).max().unwrap_or(0);
        let cells = places * bins;
        // Rows: day, cell, value, causes.
        let mut rows: Vec<(usize, usize)> = Vec::new();
        let mut columns = vec![Vec::new(); parents.len() + 1];
        let mut sums = vec![vec![Sums::default(); cells]; days];
        for (recording, one) in data.recordings().iter().zip(made) {
            for t in memory..recording.nrows() {
                let value = recording[[t, target]];
                let causes: Vec<f64> =
                    parents.iter().map(|node| recording[[t - node.lag, node.var]]).collect();
                let at = recording[[t, hour]];
                if !value.is_finite() || !at.is_finite() || causes.iter().any(|x| !x.is_finite()) {
                    continue;
                }
                let bin = if bins == 1 { 0 } else { (at - first) as usize };
                let cell = one.place * bins + bin;
                columns[0].push(value);
                columns[1..].iter_mut().zip(&causes).for_each(|(column, x)| column.push(*x));
                rows.push((one.day, cell));
                sums[one.day][cell].add(&Sums { n: 1.0, y: value, yy: value * value, x: causes });
            }
        }
        if rows.is_empty() {
            return Err(Error::Data(format!("no row has '{}' and its causes", data.var_names()[target])));
        }
        let pooled = |of: &dyn Fn(usize, usize) -> bool| -> Vec<Sums> {
            let pool = |cell: usize| {
                let mut pool = Sums::default();
                (0..days).filter(|&day| of(day, cell)).for_each(|day| pool.add(&sums[day][cell]));
                pool
            };
            let mut pools: Vec<Sums> = (0..cells).map(pool).collect();
            if way == Way::Lagged {
                let mut whole = Sums::default();
                pools.iter().for_each(|pool| whole.add(pool));
                pools.fill(whole);
            }
            pools
        };
        let all = pooled(&|_, _| true);
        for (row, (day, cell)) in rows.iter().enumerate() {
            let pool = if way == Way::Lagged { &all[*cell] } else { &sums[*day][*cell] };
            columns[0][row] -= pool.y / pool.n;
            columns[1..].iter_mut().zip(&pool.x).for_each(|(column, x)| column[row] -= x / pool.n);
        }
        let slopes = least_squares(&columns[0], &columns[1..]).coefficients;
        let own = parents.iter().zip(&slopes).filter(|(node, _)| node.var == target).map(|(_, slope)| slope);
        let kept = own.sum::<f64>().clamp(0.0, MOST_KEPT);
        // Rows that follow one another tell less than as many independent ones; where people stay long, much less.
        let own_before = parents.iter().position(|node| node.var == target && node.lag == 1);
        let mut products = vec![(0.0, 0.0); places];
        for (row, (_, cell)) in rows.iter().enumerate() {
            let (square, product) = &mut products[cell / bins];
            *square += columns[0][row].powi(2);
            *product += own_before.map_or(0.0, |k| columns[0][row] * columns[k + 1][row]);
        }
        let inflation: Vec<f64> = products
            .iter()
            .map(
                |(square, product)| {
                    if *square > 0.0 { (product / square).clamp(0.0, MOST_KEPT) } else { 0.0 }
                },
            )
            .map(|r| (1.0 + r) / (1.0 - r))
            .collect();
        let (anew, since) = match way {
            Way::Causal => begun_anew(&sums, bins, &inflation),
            Way::Mean | Way::Lagged => (Vec::new(), vec![0; cells]),
        };
        let level = |pool: &Sums, place: usize| {
            let others = parents.iter().zip(&slopes).zip(&pool.x).filter(|((node, _), _)| node.var != target);
            let given: f64 = others.map(|((_, slope), x)| slope * x / pool.n).sum();
            let own = parents.iter().zip(&slopes).zip(&pool.x).filter(|((node, _), _)| node.var == target);
            let before: f64 = own.map(|((_, slope), x)| slope * x / pool.n).sum();
            Expected {
                mean: (pool.y / pool.n - before - given) / (1.0 - kept),
                variance: pool.variance() * inflation[place] / pool.n,
            }
        };
        let present = pooled(&|day, cell| day >= since[cell]);
        Ok(Self {
            cells: (present.iter().enumerate())
                .map(|(cell, pool)| (pool.n > 0.0).then(|| level(pool, cell / bins)))
                .collect(),
            spread: present.iter().map(|pool| if pool.n > 0.0 { pool.variance() } else { 0.0 }).collect(),
            slopes,
            kept,
            anew,
            hours: (first, bins),
        })
    }

    /// An hour as a clock says it.
    pub fn hour(&self, number: usize) -> String {
        format!("{:02}:00", (self.hours.0 as usize + number) % 24)
    }

    fn cell(&self, place: usize, hour: f64) -> Option<usize> {
        let (first, bins) = self.hours;
        let bin = if bins == 1 {
            0
        } else if !hour.is_finite() {
            return None;
        } else {
            usize::try_from((hour - first).floor() as i64).ok().filter(|bin| *bin < bins)?
        };
        Some(place * bins + bin).filter(|cell| *cell < self.cells.len())
    }

    /// The level at a place and hour with its uncertainty; none where nothing was recorded.
    pub fn level(&self, place: usize, hour: f64) -> Option<Expected> {
        self.cells[self.cell(place, hour)?]
    }

    /// What is expected `ahead` rows after a value was `now` at the hour `since`; `None` for a place or an hour that was not recorded.
    pub fn expected(&self, place: usize, hour: f64, ahead: f64, now: Option<(f64, f64)>) -> Option<Expected> {
        let level = self.level(place, hour)?;
        let left = self.kept.powf(ahead);
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
        let square = |cell: usize| -> Option<f64> {
            let mut pool = Sums::default();
            (since[cell]..day).for_each(|earlier| pool.add(&sums[earlier][cell]));
            let today = &sums[day][cell];
            if pool.n == 0.0 || today.n == 0.0 {
                return None;
            }
            let variance = (pool.variance() / pool.n + today.variance() / today.n) * inflation[cell / bins];
            (variance > 0.0).then(|| (pool.y / pool.n - today.y / today.n).powi(2) / variance)
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
            if day > 1 && mean > *usual * (1.0 + CHANGED * (2.0 / count).sqrt()) {
                anew.push(Anew { day, hour, place });
                renewed.extend((0..places * bins).filter(is_in));
            } else {
                *usual = usual.max(mean);
            }
        }
        renewed.into_iter().for_each(|cell| since[cell] = day);
    }
    (anew, since)
}
