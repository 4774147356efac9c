//! Dependence at lags beyond those that are tested: a cheap look before the analysis.
//!
//! 1. From each variable, what all of them tell up to `tau_max` steps before is taken out (least squares).
//! 2. What is left is held against their values at longer lags; the strongest that is there beyond chance (t test, for all that are
//!    looked at) is taken out too, and so on.
//! 3. The longest lag found, and one more, is the advice.
//!
//! Where lag 0 is not tested, what step 1 leaves of two variables in the same row is looked at, too.
//!
//! For a test that sees any shape, so are the variables' distances from their means: `y = x^2` has no line.
//!
//! Example: people slow down 0.2 s after the robot comes near, rows are 0.1 s apart, and `tau_max` is 1: the dependence at lag 2
//! is seen here.

use std::collections::HashSet;

use ndarray::{Array2, s};
use serde::{Deserialize, Serialize};

use crate::{
    numeric::{
        rows::{dot, moments},
        student_t::correlation_p_value,
    },
    types::{DataFrame, Named, names::plain, time_in_words},
};

/// The level for all lags and pairs together.
const LEVEL: f64 = 0.01;
/// Columns of the design, at most.
const MOST_COLUMNS: usize = 320;
/// Rows that are looked at, at most.
const MOST_ROWS: usize = 3000;
/// Lags beyond `tau_max` that are looked at: as many as the memory of the data, within these.
const LAGS: [usize; 2] = [8, 20];
/// Weaker dependence than this is of no interest.
const WEAKEST: f64 = 0.1;

/// Share of its variance that a variable keeps at least, given the tested lags: what is left of an exact effect is rounding, and the
/// difference of means at the ends of a recording.
const EXPLAINED: f64 = 1e-3;
/// Distances from the mean, in standard deviations: farther ones count as this, and about what the mean one is.
const FARTHEST: f64 = 3.0;
const USUAL: f64 = 0.8;

/// Weaker dependence within a row is not worth a word where lag 0 is not asked about.
const WEAKEST_WITHIN: f64 = 0.3;

/// Two variables that depend on each other within one row, where lag 0 is not tested.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Within {
    /// Their names.
    pub variables: [String; 2],
    /// Partial correlation, given all variables at the lags that are tested.
    pub strength: f64,
}

impl Within {
    /// All such pairs, strongest first; on a line.
    pub fn of(data: &DataFrame, tau_max: usize) -> Vec<Self> {
        let n = data.n_vars();
        let given = n.saturating_mul(tau_max);
        if given + n > MOST_COLUMNS {
            return Vec::new();
        }
        let (mut gram, rows) = gram(data, n, tau_max);
        let at = |var: usize| var * (tau_max + 1);
        for (var, lag) in (0..n).flat_map(|var| (1..=tau_max).map(move |lag| (var, lag))) {
            sweep(&mut gram, at(var) + lag);
        }
        let is_left = |var: usize| gram[[at(var), at(var)]] > EXPLAINED * rows as f64;
        let pairs = (0..n).flat_map(|a| (a + 1..n).map(move |b| (a, b)));
        let strength = |(a, b): (usize, usize)| {
            let size = gram[[at(a), at(a)]] * gram[[at(b), at(b)]];
            (a, b, if is_left(a) && is_left(b) { gram[[at(a), at(b)]] / size.sqrt() } else { 0.0 })
        };
        let is_there = |&(_, _, r): &(usize, usize, f64)| {
            let tests = (n * n) as f64;
            r.abs() >= WEAKEST_WITHIN
                && correlation_p_value(r, rows.saturating_sub(given + 2)) * tests <= LEVEL
        };
        let mut found: Vec<_> = pairs.map(strength).filter(is_there).collect();
        found.sort_by(|x, y| y.2.abs().total_cmp(&x.2.abs()));
        let name = |var: usize| plain(&data.var_names()[var]);
        found.into_iter().map(|(a, b, strength)| Self { variables: [name(a), name(b)], strength }).collect()
    }
}

/// A dependence at a lag that was not tested.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Later {
    /// Name of the earlier variable.
    pub cause: String,
    /// Name of the later one.
    pub effect: String,
    /// Steps between them.
    pub lag: usize,
    /// Partial correlation, given all variables at the lags that are tested; of the cause, or of its distance from its mean.
    pub strength: f64,
    /// The largest lag that would test all that were found.
    pub tau_max: usize,
}

impl Later {
    /// The strongest dependence of each pair beyond `tau_max`, on a line or of any shape, strongest first; none with too few rows.
    pub fn of(data: &DataFrame, tau_max: usize, memory: f64, any_shape: bool) -> Vec<Self> {
        let vars = data.n_vars();
        let n = if any_shape { 2 * vars } else { vars };
        let most = (MOST_COLUMNS / n.max(1)).saturating_sub(1);
        let wanted = tau_max
            .saturating_add((2.0 * memory).ceil() as usize)
            .clamp(tau_max.saturating_add(LAGS[0]), tau_max.saturating_add(LAGS[1]));
        let lags = wanted.min(most);
        // Where the distances leave no room for as many lags, or too few rows, lines are looked at.
        let lines = || if any_shape { Self::of(data, tau_max, memory, false) } else { Vec::new() };
        if lags <= tau_max || (any_shape && lags < wanted) {
            return lines();
        }
        let (mut gram, rows) = gram(data, n, lags);
        let given = n * tau_max;
        if rows < 3 * given + 50 {
            return lines();
        }
        let at = |var: usize, lag: usize| var * (lags + 1) + lag;
        for (var, lag) in (0..n).flat_map(|var| (1..=tau_max).map(move |lag| (var, lag))) {
            sweep(&mut gram, at(var, lag));
        }
        let tests = (n * vars * (lags - tau_max)) as f64;
        let mut found: Vec<(usize, usize, usize, f64)> = Vec::new();
        for effect in 0..vars {
            let (mut left, mut taken) = (gram.clone(), given);
            let target = at(effect, 0);
            loop {
                let candidates = (0..n).flat_map(|var| (tau_max + 1..=lags).map(move |lag| (var, lag)));
                let strength = |&(var, lag): &(usize, usize)| {
                    let place = at(var, lag);
                    let size = left[[place, place]] * left[[target, target]];
                    // What is nearly a combination of others says nothing.
                    let explained = |at: usize, but: f64| left[[at, at]] <= but * rows as f64;
                    let is_left = !explained(place, 1e-6) && !explained(target, EXPLAINED);
                    if is_left { left[[place, target]] / size.sqrt() } else { 0.0 }
                };
                let sized = candidates.map(|one| (one, strength(&one)));
                let best = sized.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
                let Some(((var, lag), r)) = best else { break };
                let p = correlation_p_value(r, rows.saturating_sub(taken + 1));
                if p * tests > LEVEL || r.abs() < WEAKEST || taken > given + 2 * n {
                    break;
                }
                found.push((var % vars, effect, lag, r));
                sweep(&mut left, at(var, lag));
                taken += 1;
            }
        }
        // What a variable tells of itself later is not a link of two.
        found.retain(|(cause, effect, ..)| cause != effect);
        let advised = found.iter().map(|(_, _, lag, _)| lag + 1).max().unwrap_or(0);
        found.sort_by(|a, b| b.3.abs().total_cmp(&a.3.abs()));
        let mut pairs = HashSet::new();
        found.retain(|(cause, effect, ..)| pairs.insert((*cause, *effect)));
        let name = |var: usize| plain(&data.var_names()[var]);
        let later = |(cause, effect, lag, strength)| Self {
            cause: name(cause),
            effect: name(effect),
            lag,
            strength,
            tau_max: advised,
        };
        found.into_iter().map(later).collect()
    }

    /// What was found, with the step between rows in seconds; of each pair the lag at which it is strongest.
    pub fn found(found: &[Self], dt: Option<f64>) -> Option<String> {
        const MOST: usize = 3;
        let one = |later: &Self| {
            let after = dt.map_or(String::new(), |dt| format!(" ({})", time_in_words(dt, later.lag)));
            let Self { cause, effect, lag, .. } = later;
            format!("dependence of {effect} on {cause} at lag {lag}{after}")
        };
        let reported: Vec<String> = found.iter().take(MOST).map(one).collect();
        let more =
            if found.len() > MOST { format!(", and {} more", found.len() - MOST) } else { String::new() };
        (!reported.is_empty()).then(|| format!("{}{more}", reported.join(", ")))
    }

    /// The same, and the way out.
    pub fn reported(found: &[Self], dt: Option<f64>) -> Option<String> {
        let way = format!("{} {} tests it", Named("tau_max"), found.first()?.tau_max);
        Self::found(found, dt).map(|found| format!("{found}, beyond the lags that were tested; {way}"))
    }
}

/// Products of all variables at lags 0 to `lags`, summed over the rows that have them all, and how many these are. Each recording has
/// mean 0; a row without some value ends a stretch. Of `wide` columns, those behind the variables are their distances from the means.
fn gram(data: &DataFrame, wide: usize, lags: usize) -> (Array2<f64>, usize) {
    let (n, size) = (data.n_vars(), wide * (lags + 1));
    let (means, deviations): (Vec<Vec<f64>>, Vec<f64>) = (0..n).map(|var| measured(data, var)).unzip();
    let (mut gram, mut count) = (Array2::zeros((size, size)), 0);
    let all: usize = data.recordings().iter().map(|recording| recording.nrows()).sum();
    for (k, recording) in data.recordings().iter().enumerate() {
        // The same share of each, in any order of recordings.
        let until = count + (MOST_ROWS * recording.nrows()).div_ceil(all.max(MOST_ROWS));
        let is_whole = |row: &usize| recording.row(*row).iter().all(|value| !value.is_nan());
        let mut row = 0;
        while row < recording.nrows() && count < until {
            // No row is looked at that would not count.
            let most = recording.nrows().min(row + lags + until - count);
            let end = (row..most).find(|row| !is_whole(row)).unwrap_or(most);
            if end > row + lags {
                let of = |var: usize, value: &f64| (value - means[var][k]) / deviations[var];
                let bent = |value: f64| value.abs().min(FARTHEST) - USUAL;
                let value = |var: usize, v: &f64| if var < n { of(var, v) } else { bent(of(var - n, v)) };
                let column = |var: usize| {
                    recording.slice(s![row..end, var % n]).iter().map(|v| value(var, v)).collect()
                };
                let columns: Vec<Vec<f64>> = (0..wide).map(column).collect();
                add(&mut gram, &columns.iter().map(Vec::as_slice).collect::<Vec<_>>(), lags);
                count += end - row - lags;
            }
            row = end + 1;
        }
    }
    (gram, count)
}

/// The mean of a variable in each recording, and its standard deviation about these; 1 where it is 0.
fn measured(data: &DataFrame, var: usize) -> (Vec<f64>, f64) {
    let (mut means, mut all) = (Vec::new(), Vec::new());
    for recording in data.recordings() {
        let from = all.len();
        all.extend(recording.column(var).iter().filter(|value| !value.is_nan()));
        let mean = moments(&all[from..]).0;
        all[from..].iter_mut().for_each(|value| *value -= mean);
        means.push(mean);
    }
    let deviation = moments(&all).1;
    (means, if deviation > 0.0 { deviation } else { 1.0 })
}

/// Adds the products of one stretch. Those of lags `a + 1`, `b + 1` are those of `a`, `b` but for the two ends.
fn add(gram: &mut Array2<f64>, columns: &[&[f64]], lags: usize) {
    let rows = columns[0].len();
    for (i, x) in columns.iter().enumerate() {
        for (j, y) in columns.iter().enumerate().skip(i) {
            // Along the diagonals of the block, from its upper and its left edge.
            for first in 0..=2 * lags {
                let (mut a, mut b) = if first <= lags { (first, 0) } else { (0, first - lags) };
                let mut sum = dot(&x[lags - a..rows - a], &y[lags - b..rows - b]);
                loop {
                    let at = [i * (lags + 1) + a, j * (lags + 1) + b];
                    gram[at] += sum;
                    if i != j {
                        gram[[at[1], at[0]]] += sum;
                    }
                    if a == lags || b == lags {
                        break;
                    }
                    sum += x[lags - 1 - a] * y[lags - 1 - b] - x[rows - 1 - a] * y[rows - 1 - b];
                    (a, b) = (a + 1, b + 1);
                }
            }
        }
    }
}

/// Takes a column out of all others, as a regression on it does.
fn sweep(gram: &mut Array2<f64>, column: usize) {
    let pivot = gram[[column, column]];
    if pivot <= 0.0 {
        return;
    }
    let row = gram.row(column).to_owned();
    for (k, mut other) in gram.rows_mut().into_iter().enumerate() {
        if k == column || row[k] == 0.0 {
            continue;
        }
        let factor = row[k] / pivot;
        other.scaled_add(-factor, &row);
    }
    gram.row_mut(column).fill(0.0);
    gram.column_mut(column).fill(0.0);
}
