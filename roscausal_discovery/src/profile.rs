//! What the data are like, before anything is claimed of them: samples that count, drift, values that stand still, outliers, ties,
//! columns that say the same, and numbers that stand for a missing value.
//!
//! Long recordings are looked at in part: the first rows for what depends on their order, evenly spaced rows for the rest.
//!
//! Sources: effective sample size by the initial positive sequence of autocorrelations (Geyer 1992, Statistical Science 7);
//! stationarity by the KPSS test of a level (Kwiatkowski, Phillips, Schmidt and Shin 1992, Journal of Econometrics 54), here of
//! block means.

use std::collections::HashSet;

use ndarray::{Array2, ArrayView1, s};
use serde::{Deserialize, Serialize};

use crate::{
    later::{Later, Within},
    numeric::rows::{
        cumulated, dot, is_constant, is_constant_column, long_run_variance, moments, standardize,
    },
    season::Season,
    types::{DataFrame, Named, names::plain, same_value},
    unsteady::Unsteady,
};

/// Rows that are looked at.
const MOST_ROWS: usize = 20_000;
/// Blocks of the test of stationarity.
const MOST_BLOCKS: usize = 2000;
/// Fewer rows than this say nothing of stationarity.
const FEWEST_ROWS: usize = 40;
/// The 1 % point of the KPSS statistic of a level.
const KPSS_1_PERCENT: f64 = 0.739;
/// Fewer samples than this are few.
pub(crate) const FEW: usize = 50;
/// Values farther from the median than this many robust deviations are outliers.
const FAR: f64 = 10.0;
/// So many of the variables that cost rows are named.
const MOST_DEAR: usize = 3;
/// A value that fills this share of the rows without a break stands still.
const STILL: f64 = 0.2;
/// Variance that a copy or a combination of other columns may leave.
const NOTHING_LEFT: f64 = 1e-8;
/// Variance that a near copy leaves, such as a rounded one: too little to tell its part in a link from rounding.
const LITTLE_LEFT: f64 = 1e-4;

/// What the data are like.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DataProfile {
    /// Each variable, in the order of the data.
    pub variables: Vec<VariableProfile>,
    /// What a reader should know, one sentence each.
    pub remarks: Vec<String>,
    /// Dependence at lags beyond those that are tested, if it was looked for.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub later: Vec<Later>,
    /// Dependence within a row, where lag 0 is not tested and if it was looked for.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub within: Vec<Within>,
    /// Dependence that changes within the one recording, if it was looked for.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub unsteady: Vec<Unsteady>,
    /// The period that variables share, if one was looked for and found.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub season: Option<Season>,
}

/// What one variable is like.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct VariableProfile {
    /// Its name.
    pub name: String,
    /// Rows without a value.
    pub missing: usize,
    /// Different values among the rows that were looked at.
    pub distinct: usize,
    /// Independent samples that the rows are worth.
    pub effective_samples: f64,
    /// KPSS statistic of a constant level; above 0.739 it drifts (1 %). `None`: too few rows, or constant.
    pub kpss: Option<f64>,
    /// Values more than ten robust deviations from the median.
    pub outliers: usize,
    /// Rows in which the longest stretch of one value lasts.
    pub longest_constant: usize,
}

/// A reason why the data should not be analysed as they are.
#[derive(Clone, Debug, PartialEq)]
pub enum Fault {
    /// A number seems to stand for a missing value.
    MissingFlag {
        /// The variable.
        name: String,
        /// The number.
        value: f64,
        /// How often.
        count: usize,
    },
    /// Two variables are the same, up to unit and offset.
    Twins(String, String),
    /// Two recordings hold the same rows: their places.
    SameRecording(usize, usize),
}

impl DataProfile {
    /// Looks at the data of an analysis with lags up to `tau_max`.
    ///
    /// ```
    /// use ndarray::Array2;
    /// use roscausal_discovery::{DataProfile, DataFrame, Fault};
    ///
    /// let values = Array2::from_shape_fn((200, 2), |(t, k)| if k == 0 { (t * t % 97) as f64 } else { t as f64 });
    /// let data = DataFrame::new(vec![values], vec!["a".into(), "clock".into()])?;
    /// let (profile, faults) = DataProfile::of(&data, 1);
    /// assert!(profile.remarks.iter().any(|remark| remark.contains("clock drifts")));
    /// assert!(faults.is_empty());
    /// # Ok::<(), roscausal_discovery::Error>(())
    /// ```
    pub fn of(data: &DataFrame, tau_max: usize) -> (Self, Vec<Fault>) {
        let names: Vec<String> = data.var_names().iter().map(|name| plain(name)).collect();
        let mut faults = same_recordings(data);
        let mut profile = Self::default();
        let past = tau_max.saturating_mul(2);
        let samples: usize = data.recordings().iter().map(|r| r.nrows().saturating_sub(past)).sum();
        if samples < FEW {
            profile.remarks.push(few(samples));
        }
        let longest = data.longest();
        let (mut ends, mut ties) = (Vec::<(&String, f64, usize)>::new(), Vec::new());
        for (var, name) in names.iter().enumerate() {
            let (variable, remarks, seen) = look_at(data, longest, var);
            profile.remarks.extend(remarks);
            ties.extend(seen.ties.then(|| format!("{name} ({})", variable.distinct)));
            profile.variables.push(variable);
            ends.extend(seen.lone.into_iter().map(|(value, count)| (name, value, count)));
        }
        faults.extend(missing_flags(&ends));
        profile.remarks.extend(costly(data, &names));
        profile.remarks.extend(with_ties(&ties));
        profile.remarks.extend(drifting(&profile.variables));
        if profile.variables.iter().all(|variable| variable.distinct < 2) {
            profile.remarks.push("no variable changes: there is nothing to find".into());
        }
        let (twins, combined) = collinear(data, &names);
        faults.extend(twins);
        profile.remarks.extend(combined);
        (profile, faults)
    }

    /// Whether the levels of both change over the recording, which alone makes dependence at any lag.
    pub(crate) fn both_drift(&self, names: [&String; 2]) -> bool {
        let drifts = |one: &&VariableProfile| one.kpss.is_some_and(|kpss| kpss > KPSS_1_PERCENT);
        self.variables.iter().filter(drifts).filter(|one| names.contains(&&one.name)).count() == 2
    }

    /// Without what is no matter for a test of this name.
    #[must_use]
    pub fn for_test(mut self, test: &str) -> Self {
        let of_categories = ["gsquared", "cmisymb", "regressionci"].contains(&test);
        self.remarks.retain(|remark| !(of_categories && remark.ends_with(TIES)));
        if test == "robustparcorr" {
            for remark in &mut self.remarks {
                remark.truncate(remark.find(RANKS).unwrap_or(remark.len()));
            }
        }
        self
    }

    /// Looks for a period that variables share and, where there is none, for dependence at longer ones than `lags`, and for dependence
    /// that changes, of a shape that this test sees; `None`: for nothing. `dt` is the step in seconds, if known.
    #[must_use]
    pub fn with_later(mut self, data: &DataFrame, lags: usize, test: Option<&str>, dt: Option<f64>) -> Self {
        let Some(test) = test else { return self };
        self.season = Season::of(data);
        if let Some(season) = &self.season {
            self.remarks.insert(0, season.reported(dt));
            return self;
        }
        let rows: usize = data.recordings().iter().map(|recording| recording.nrows()).sum();
        let memory = self.variables.iter().filter(|v| v.distinct > 1);
        let memory =
            memory.map(|v| (rows - v.missing) as f64 / v.effective_samples.max(1.0)).fold(1.0, f64::max);
        let any_shape = ["gpdc", "gpdcpython", "cmiknn"].contains(&test);
        let mut later = Later::of(data, lags, memory, any_shape);
        // Two that drift depend at any lag; what their changes show, too, is more than that.
        let drift = |one: &Later| self.both_drift([&one.cause, &one.effect]);
        if later.iter().any(drift) {
            let seen = changes(data).map_or_else(Vec::new, |data| Later::of(&data, lags, memory, any_shape));
            let is = |a: &Later, b: &Later| a.cause == b.cause && a.effect == b.effect;
            later.retain(|one| !drift(one) || seen.iter().any(|of| is(of, one)));
            let advised = later.iter().map(|one| one.lag + 1).max().unwrap_or(0);
            later.iter_mut().for_each(|one| one.tau_max = advised);
        }
        self.later = later;
        self.unsteady = Unsteady::of(data, lags);
        let reported = [Later::reported(&self.later, dt), Unsteady::reported(&self.unsteady, dt)];
        self.remarks.splice(0..0, reported.into_iter().flatten());
        self
    }
}

/// The changes from row to row.
fn changes(data: &DataFrame) -> Option<DataFrame> {
    let of =
        |rows: &Array2<f64>| (rows.nrows() > 1).then(|| &rows.slice(s![1.., ..]) - &rows.slice(s![..-1, ..]));
    DataFrame::new(data.recordings().iter().filter_map(of).collect(), data.var_names().to_vec()).ok()
}

/// What so few samples can show: the correlation that a two-sided test at 5 % needs (Fisher's z).
fn few(samples: usize) -> String {
    let needed = libm::tanh(1.96 / (samples.max(4) as f64 - 3.0).sqrt());
    format!(
        "only {samples} samples: a dependence shows only if it is stronger than about {needed:.2}, and p-values near the level \
         say little; record longer"
    )
}

/// The variables whose missing values cost many of the rows in which all others have one, dearest first, in one sentence.
fn costly(data: &DataFrame, names: &[String]) -> Option<String> {
    // Both of two are needed.
    if names.len() < 3 {
        return None;
    }
    let (mut complete, mut without) = (0, vec![0; names.len()]);
    for row in data.recordings().iter().flat_map(|recording| recording.rows()) {
        let mut missing = (0..names.len()).filter(|&var| row[var].is_nan());
        match (missing.next(), missing.next()) {
            (None, _) => complete += 1,
            (Some(only), None) => without[only] += 1,
            _ => {}
        }
    }
    let mut dear: Vec<(usize, &String)> =
        without.into_iter().zip(names).filter(|(more, _)| *more >= FEW && 4 * more > complete).collect();
    dear.sort_by_key(|(more, _)| std::cmp::Reverse(*more));
    let each = |(more, name): &(usize, &String)| format!("without {name} {}", complete + more);
    let each: Vec<String> = dear.iter().take(MOST_DEAR).map(each).collect();
    (!each.is_empty()).then(|| {
        format!(
            "{complete} rows have a value of every variable, {}; {} '!name' leaves one out",
            each.join(", "),
            Named("columns")
        )
    })
}

/// The variables that drift, in one sentence.
fn drifting(variables: &[VariableProfile]) -> Option<String> {
    let drifts = |variable: &&VariableProfile| variable.kpss.is_some_and(|kpss| kpss > KPSS_1_PERCENT);
    let names: Vec<&str> = variables.iter().filter(drifts).map(|variable| variable.name.as_str()).collect();
    let verb = match names.len() {
        0 => return None,
        1 => "drifts",
        _ => "drift",
    };
    Some(format!(
        "{} {verb} (KPSS, 1 %), which makes false links: analyse a part, or the differences",
        names.join(", ")
    ))
}

/// The variables of few different values, in one sentence.
fn with_ties(variables: &[String]) -> Option<String> {
    let have = if variables.len() == 1 { "has" } else { "have" };
    (!variables.is_empty()).then(|| format!("{} {have} few different values: {TIES}", variables.join(", ")))
}

/// What a test of numbers makes of categories.
const TIES: &str = "ties blur p-values; gsquared is the test for categories";
/// What is said of outliers, unless the test is one of ranks.
const RANKS: &str = "; correct them, or use a test of ranks";

/// Values and how often they are there.
type Counted = Vec<(f64, usize)>;

/// What is told of several variables together.
#[derive(Default)]
struct Seen {
    lone: Counted,
    ties: bool,
}

fn look_at(data: &DataFrame, longest: &Array2<f64>, var: usize) -> (VariableProfile, Vec<String>, Seen) {
    let name = &plain(&data.var_names()[var]);
    let columns = || data.recordings().iter().map(|recording| recording.column(var));
    let rows: usize = columns().map(|column| column.len()).sum();
    let missing = columns().map(|column| column.iter().filter(|v| v.is_nan()).count()).sum();
    let first_rows: Vec<f64> = present(longest.column(var), MOST_ROWS);
    let stride = rows.div_ceil(MOST_ROWS).max(1);
    // From the first row of each recording on: the same rows in any order of recordings.
    let spread = columns().flat_map(|column| column.into_iter().step_by(stride)).copied();
    let mut spread: Vec<f64> = spread.filter(|v| !v.is_nan()).collect();
    spread.sort_by(f64::total_cmp);
    let mut different = spread.clone();
    different.dedup();
    let mut profile = VariableProfile {
        name: name.clone(),
        missing,
        distinct: different.len(),
        effective_samples: (rows - missing) as f64,
        ..VariableProfile::default()
    };
    // What only says which recording a row is of moves, drifts and has ties by its nature.
    if different.len() < 2 || (data.recordings().len() > 1 && columns().all(is_constant_column)) {
        profile.longest_constant = rows - missing;
        return (profile, Vec::new(), Seen::default());
    }
    let mut remarks = Vec::new();
    let share = effective_share(&first_rows);
    profile.effective_samples *= share;
    if rows - missing >= FEW && (profile.effective_samples < 30.0 || share < 0.02) {
        let (samples, worth) = (rows - missing, profile.effective_samples.max(1.0));
        remarks.push(format!(
            "{name} changes slowly: its {samples} samples are worth about {worth:.0} independent ones; record longer or take a longer step"
        ));
    }
    profile.kpss = kpss(&longest.column(var));
    let (outliers, farthest) = outliers(&spread);
    profile.outliers = outliers * (rows - missing) / spread.len();
    if outliers * 10 >= spread.len() {
        remarks.push(format!(
            "{name} has {} % of its values, such as {farthest}, more than {FAR} robust deviations from the median{RANKS}",
            100 * outliers / spread.len()
        ));
    } else if outliers > 0 {
        let many = if outliers * 100 < spread.len() { "" } else { " in more than 1 % of the rows" };
        remarks.push(format!(
            "{name} has outliers{many}, such as {farthest}: more than {FAR} robust deviations from the median{RANKS}"
        ));
    }
    remarks.extend(below_zero(name, &spread, &different));
    let (length, value) = longest_constant(&first_rows);
    profile.longest_constant = length;
    if length >= 20 && length as f64 > STILL * first_rows.len() as f64 && different.len() > 10 {
        remarks.push(format!(
            "{name} stands still at {value} for {length} rows: those tell nothing of what drives it"
        ));
    }
    let ties = different.len() > 2 && different.len() * 20 < spread.len() && different.len() <= 20;
    (profile, remarks, Seen { lone: lone_ends(&spread, &different), ties })
}

/// The values that are there, at most so many.
fn present(column: ArrayView1<'_, f64>, most: usize) -> Vec<f64> {
    column.iter().copied().filter(|v| !v.is_nan()).take(most).collect()
}

/// Independent samples in a sample: `1 / (1 + 2 sum of autocorrelations)`, up to the first pair of lags whose sum is not
/// positive.
pub(crate) fn effective_share(values: &[f64]) -> f64 {
    let n = values.len();
    let (mean, deviation) = moments(values);
    if n < 8 || deviation == 0.0 {
        return 1.0;
    }
    let centred: Vec<f64> = values.iter().map(|v| v - mean).collect();
    let all = dot(&centred, &centred);
    let at = |lag: usize| dot(&centred[lag..], &centred[..n - lag]) / all;
    let (mut sum, most) = (1.0, (n / 3).min(500));
    for lag in (1..most).step_by(2) {
        let pair = at(lag) + at(lag + 1);
        if pair <= 0.02 {
            break;
        }
        sum += 2.0 * pair;
    }
    (1.0 / sum).min(1.0)
}

/// The KPSS statistic of a level, of block means.
fn kpss(column: &ArrayView1<'_, f64>) -> Option<f64> {
    let values = present(*column, usize::MAX);
    let block = values.len().div_ceil(MOST_BLOCKS).max(1);
    let means: Vec<f64> =
        values.chunks_exact(block).map(|part| part.iter().sum::<f64>() / block as f64).collect();
    let n = means.len();
    let (mean, deviation) = moments(&means);
    if n < FEWEST_ROWS || deviation == 0.0 {
        return None;
    }
    let off: Vec<f64> = means.iter().map(|v| v - mean).collect();
    let long_run = long_run_variance(&off);
    let squares: f64 = cumulated(&off).iter().map(|sum| sum * sum).sum();
    (long_run > 0.0).then(|| squares / (n as f64).powi(2) / long_run)
}

/// How many values of a sorted sample lie far out, and the farthest to four digits.
fn outliers(sorted: &[f64]) -> (usize, f64) {
    let median = sorted[sorted.len() / 2];
    let mut off: Vec<f64> = sorted.iter().map(|v| (v - median).abs()).collect();
    let middle = off.len() / 2;
    let robust = 1.4826 * *off.select_nth_unstable_by(middle, f64::total_cmp).1;
    if robust == 0.0 {
        return (0, 0.0);
    }
    let ends = [sorted[0], sorted[sorted.len() - 1]];
    let farthest = if (ends[0] - median).abs() > (ends[1] - median).abs() { ends[0] } else { ends[1] };
    let farthest = format!("{farthest:.3e}").parse().unwrap_or(farthest);
    (sorted.iter().filter(|v| (*v - median).abs() > FAR * robust).count(), farthest)
}

/// Length and value of the longest stretch of one value.
fn longest_constant(values: &[f64]) -> (usize, f64) {
    let stretches = values.chunk_by(|a, b| a == b);
    stretches.max_by_key(|stretch| stretch.len()).map_or((0, 0.0), |stretch| (stretch.len(), stretch[0]))
}

/// The values at an end that are far from all others.
fn lone_ends(sorted: &[f64], different: &[f64]) -> Counted {
    let last = different.len() - 1;
    if last < 3 {
        return Vec::new();
    }
    let ends = [
        (different[0], different[1] - different[0], different[last] - different[1]),
        (different[last], different[last] - different[last - 1], different[last - 1] - different[0]),
    ];
    let lone = ends.into_iter().filter(|(_, gap, range)| *gap > 3.0 * range);
    lone.map(|(value, ..)| (value, sorted.iter().filter(|v| **v == value).count())).collect()
}

/// The lone values that seem to stand for a missing one: -999, 99.99 and the like, large ones that come again and again, and those
/// that several variables share.
fn missing_flags(ends: &[(&String, f64, usize)]) -> Vec<Fault> {
    let is_flag = |&&(name, value, count): &&(&String, f64, usize)| {
        let digits = value.abs().to_string().replace('.', "");
        let nines = digits.len() >= 2 && digits.trim_end_matches("25").bytes().all(|digit| digit == b'9');
        let of_bits = [32767.0, 32768.0, 65535.0, 2_147_483_647.0].contains(&value.abs());
        // Measurements do not repeat so large a number.
        let huge = value.abs() >= 1e6 && value.fract() == 0.0 && count > 2;
        let shared = ends.iter().any(|(other, of_other, _)| *other != name && *of_other == value);
        nines || of_bits || huge || (shared && count > 1 && value != 0.0)
    };
    // One for each variable.
    let mut flagged = HashSet::new();
    let flags = ends.iter().filter(is_flag).filter(|(name, ..)| flagged.insert(name));
    flags.map(|&(name, value, count)| Fault::MissingFlag { name: name.clone(), value, count }).collect()
}

/// A remark on one whole number below zero that stands again and again among values that are not: -1 for "unknown".
fn below_zero(name: &str, sorted: &[f64], different: &[f64]) -> Option<String> {
    let (value, count) = (different[0], sorted.partition_point(|v| *v <= different[0]));
    let lone = value < 0.0 && value.fract() == 0.0 && different[1] >= 0.0 && count > 2;
    // Of a count or a category nothing can be told.
    (lone && different.len() * 2 > sorted.len() - count).then(|| {
        format!(
            "{name} is {value} in {count} rows and below 0 in no other: if that stands for a missing value, {}={value} takes it as one",
            Named("missing_value")
        )
    })
}

fn same_recordings(data: &DataFrame) -> Vec<Fault> {
    let recordings = data.recordings();
    let same = |a: usize, b: usize| {
        let (a, b) = (&recordings[a], &recordings[b]);
        a.dim() == b.dim() && a.iter().zip(b).all(same_value)
    };
    // A column that recordings have in common which differ otherwise, such as the hour, is no copy; neither is one that stands still.
    let tells = |a: usize, column: usize| {
        let of = recordings[a].column(column);
        let common = |other: usize| {
            let there = recordings[other].column(column);
            other != a && of.len() == there.len() && of.iter().zip(there).all(same_value) && !same(a, other)
        };
        of.iter().any(|value| !same_value((value, &of[0]))) && !(0..recordings.len()).any(common)
    };
    let is_copy = |a: usize, b: usize| {
        recordings[a].nrows() > 1
            && same(a, b)
            && (recordings.len() == 2 || (0..data.n_vars()).any(|k| tells(a, k)))
    };
    let pairs = (0..recordings.len()).flat_map(|b| (0..b).map(move |a| (a, b)));
    pairs.filter(|&(a, b)| is_copy(a, b)).map(|(a, b)| Fault::SameRecording(a, b)).take(1).collect()
}

/// Columns that are the same, and remarks on those that are combinations of others: what a Gram-Schmidt of the standardised
/// columns leaves of each.
fn collinear(data: &DataFrame, names: &[String]) -> (Vec<Fault>, Vec<String>) {
    let total: usize = data.recordings().iter().map(|recording| recording.nrows()).sum();
    let stride = total.div_ceil(MOST_ROWS).max(1);
    let rows = || data.recordings().iter().flat_map(|recording| recording.rows().into_iter()).step_by(stride);
    let columns: Vec<usize> = (0..names.len())
        .filter(|&var| {
            let there: Vec<f64> = rows().map(|row| row[var]).filter(|v| !v.is_nan()).collect();
            !is_constant(&there)
        })
        .collect();
    let complete: Vec<_> = rows().filter(|row| columns.iter().all(|&var| !row[var].is_nan())).collect();
    let (mut twins, mut remarks): (Vec<Fault>, Vec<String>) = (Vec::new(), Vec::new());
    if complete.len() < 2 * columns.len() + 3 {
        return (twins, remarks);
    }
    let mut basis: Vec<(usize, Vec<f64>)> = Vec::new();
    let mut standard: Vec<(usize, Vec<f64>)> = Vec::new();
    for &var in &columns {
        let mut column: Vec<f64> = complete.iter().map(|row| row[var]).collect();
        if !standardize(&mut column) {
            continue;
        }
        if let Some((twin, _)) =
            standard.iter().find(|(_, other)| 1.0 - dot(other, &column).abs() < NOTHING_LEFT * 1e-2)
        {
            twins.push(Fault::Twins(names[*twin].clone(), names[var].clone()));
            continue;
        }
        standard.push((var, column.clone()));
        let mut from = Vec::new();
        // Twice: the second pass subtracts what rounding left in the first.
        for pass in 0..2 {
            for (other, direction) in &basis {
                let along = dot(direction, &column);
                if pass == 0 && along.abs() > 1e-3 {
                    from.push(names[*other].clone());
                }
                column.iter_mut().zip(direction).for_each(|(v, d)| *v -= along * d);
            }
        }
        let left = dot(&column, &column);
        if left < NOTHING_LEFT {
            let (name, others) = (&names[var], from.join(", "));
            remarks.push(format!(
                "{name} is a combination of {others}: no test can tell their parts in a link; leave one of them out"
            ));
            continue;
        }
        if left < LITTLE_LEFT {
            let (name, others, percent) = (&names[var], from.join(", "), 100.0 * left);
            remarks.push(format!(
                "{name} is nearly a combination of {others} ({percent:.4} % of its variance is its own): links of one may \
                 stand for links of the other; leave one of them out"
            ));
        }
        column.iter_mut().for_each(|v| *v /= left.sqrt());
        basis.push((var, column));
    }
    (twins, remarks)
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;
    use crate::numeric::random::Rng;

    fn noise(rows: usize, columns: usize, seed: u64) -> Array2<f64> {
        let mut rng = Rng::new(seed);
        // Nearly normal: the sum of twelve uniform numbers.
        Array2::from_shape_simple_fn((rows, columns), || (0..12).map(|_| rng.unit()).sum::<f64>() - 6.0)
    }

    fn of(recordings: Vec<Array2<f64>>) -> (DataProfile, Vec<Fault>) {
        let names = (0..recordings[0].ncols()).map(|var| ["a", "b", "c", "d"][var].to_owned()).collect();
        DataProfile::of(&DataFrame::new(recordings, names).unwrap(), 1)
    }

    #[test]
    fn a_variable_that_costs_many_rows_is_named_with_what_leaving_it_out_gives() {
        let mut rows = noise(400, 3, 5);
        rows.column_mut(1).iter_mut().skip(100).for_each(|v| *v = f64::NAN);
        rows[[3, 0]] = f64::NAN;
        let (profile, _) = of(vec![rows.clone(), noise(50, 3, 6)]);
        let wanted =
            "149 rows have a value of every variable, without b 449; --columns '!name' leaves one out";
        let spell = |name: &str| format!("--{name}");
        let remarks: Vec<String> =
            profile.remarks.iter().map(|text| crate::types::spelled_out(text, spell)).collect();
        assert_eq!(
            remarks.iter().filter(|remark| remark.contains("every variable")).collect::<Vec<_>>(),
            [wanted]
        );
        // Both of two are needed.
        let two = rows.select(ndarray::Axis(1), &[0, 1]);
        assert!(of(vec![two]).0.remarks.iter().all(|remark| !remark.contains("every variable")));
    }

    #[test]
    fn a_number_that_stands_for_nothing_and_a_rounded_copy_are_told() {
        let mut rows = noise(500, 4, 3);
        for (t, mut row) in rows.outer_iter_mut().enumerate() {
            row[1] = row[0].abs() + 0.1;
            row[2] = if t % 17 == 0 { 1e20 } else { row[2] };
            row[3] = (100.0 * row[0]).round() / 100.0;
            if t % 20 == 0 {
                row[1] = -1.0;
            }
        }
        let (profile, faults) = of(vec![rows]);
        let reported = profile.remarks.join("\n");
        assert!(
            reported.contains("b is -1 in 25 rows") && reported.contains("d is nearly a combination of a"),
            "{reported}"
        );
        assert!(
            matches!(&faults[..], [Fault::MissingFlag { name, value, count: 30 }] if name == "c" && *value == 1e20),
            "{faults:?}"
        );
    }

    #[test]
    fn independent_noise_is_nothing_to_remark_on() {
        for seed in 0..20 {
            let (profile, faults) = of(vec![noise(500, 3, seed)]);
            assert_eq!((profile.remarks, faults), (vec![], vec![]), "{seed}");
            assert!(
                profile.variables.iter().all(|v| (300.0..=500.0).contains(&v.effective_samples)),
                "{:?}",
                profile.variables
            );
        }
    }

    #[test]
    fn a_test_of_ranks_is_not_advised_to_who_uses_one() {
        let mut values = noise(500, 2, 5);
        values[[77, 1]] = 1000.0;
        let (profile, _) = of(vec![values]);
        let advised =
            |test: &str| profile.clone().for_test(test).remarks.join(" ").contains("use a test of ranks");
        assert_eq!([advised("parcorr"), advised("robustparcorr")], [true, false], "{:?}", profile.remarks);
        assert!(profile.for_test("robustparcorr").remarks[0].contains("has outliers"));
        let mut wild = noise(500, 2, 5);
        wild.column_mut(1).iter_mut().step_by(7).for_each(|value| *value *= 1000.0);
        let (profile, _) = of(vec![wild]);
        let remarks = profile.for_test("robustparcorr").remarks.join(" ");
        assert!(remarks.contains("% of its values") && !remarks.contains("ranks"), "{remarks}");
    }

    #[test]
    fn each_trouble_is_told() {
        type Change = fn(usize, f64, f64) -> f64;
        let changes: [(&str, Change); 6] = [
            ("drifts", |t, v, _| v + 0.02 * t as f64),
            ("has outliers, such as 1000:", |t, v, _| if t == 77 { 1000.0321 } else { v }),
            ("stands still at 3 for 200 rows", |t, v, _| if (100..300).contains(&t) { 3.0 } else { v }),
            ("c (5) has few different values", |t, _, _| (t * 7 % 5) as f64),
            ("is a combination of a, b", |_, v, other| 2.0 * v - other),
            ("only 8 samples", |_, v, _| v),
        ];
        for (reported, change) in changes {
            let base = noise(if reported.contains("8 samples") { 10 } else { 500 }, 3, 5);
            let mut values = base.clone();
            for t in 0..values.nrows() {
                values[[t, 2]] = if reported.contains("combination") {
                    change(t, base[[t, 0]], base[[t, 1]])
                } else {
                    change(t, base[[t, 2]], 0.0)
                };
            }
            let (profile, faults) = of(vec![values]);
            assert!(
                profile.remarks.iter().any(|remark| remark.contains(reported)),
                "{reported}: {:?}",
                profile.remarks
            );
            assert!(faults.is_empty(), "{reported}: {faults:?}");
        }
    }

    #[test]
    fn the_same_trouble_of_several_variables_is_one_sentence() {
        let drift = Array2::from_shape_fn((200, 3), |(t, k)| (t * (t + 7 * k) % 97) as f64 + (t * k) as f64);
        let (profile, _) = of(vec![drift]);
        let reported = profile.remarks.iter().filter(|remark| remark.contains("drift")).collect::<Vec<_>>();
        assert!(reported.len() == 1 && reported[0].starts_with("b, c drift (KPSS"), "{reported:?}");
        let (profile, _) = of(vec![Array2::from_elem((200, 3), 1.5)]);
        assert_eq!(profile.remarks, ["no variable changes: there is nothing to find"]);
    }

    #[test]
    fn what_a_variable_is_like_does_not_depend_on_the_order_of_recordings_and_columns() {
        let slow = |rows: usize, seed: u64, own: f64| {
            let mut values = noise(rows, 2, seed);
            (1..rows).for_each(|t| values[[t, 0]] += own * values[[t - 1, 0]]);
            values
        };
        // More rows than are looked at, too.
        for rows in [150, 6001] {
            let parts =
                [slow(rows, 1, 0.995), slow(rows, 2, 0.9), slow(rows, 3, 0.97), slow(rows - 2, 4, 0.5)];
            let seen = |order: [usize; 4], columns: [usize; 2]| {
                let recordings = order.map(|k| parts[k].select(ndarray::Axis(1), &columns)).to_vec();
                let names = columns.map(|column| ["slow", "b"][column].to_owned()).to_vec();
                let mut profile = DataProfile::of(&DataFrame::new(recordings, names).unwrap(), 1).0;
                profile.variables.sort_by(|a, b| a.name.cmp(&b.name));
                profile.remarks.retain(|remark| remark.contains("changes slowly"));
                (profile.variables, profile.remarks)
            };
            let first = seen([0, 1, 2, 3], [0, 1]);
            for order in [[3, 2, 1, 0], [1, 0, 3, 2], [2, 3, 0, 1]] {
                assert_eq!(seen(order, [0, 1]), first);
                assert_eq!(seen(order, [1, 0]), first);
            }
        }
    }

    #[test]
    fn lags_beyond_all_rows_leave_no_sample() {
        let data = DataFrame::new(vec![noise(60, 2, 1)], vec!["a".into(), "b".into()]).unwrap();
        let (profile, _) = DataProfile::of(&data, usize::MAX);
        assert!(profile.remarks[0].starts_with("only 0 samples"), "{:?}", profile.remarks);
    }

    #[test]
    fn a_slow_variable_is_worth_few_samples() {
        let steps = noise(2000, 2, 9);
        let mut values = steps.clone();
        for t in 1..2000 {
            values[[t, 0]] = 0.99 * values[[t - 1, 0]] + steps[[t, 0]];
        }
        let (profile, _) = of(vec![values]);
        // In theory 2000 (1 - 0.99) / (1 + 0.99), about 10.
        assert!(profile.variables[0].effective_samples < 60.0, "{:?}", profile.variables[0]);
        assert!(
            profile.remarks.iter().any(|remark| remark.contains("a changes slowly")),
            "{:?}",
            profile.remarks
        );
    }

    #[test]
    fn copies_and_flags_are_faults() {
        let mut twin = noise(200, 3, 1);
        for t in 0..200 {
            twin[[t, 2]] = 7.0 - 3.0 * twin[[t, 0]];
        }
        assert_eq!(of(vec![twin]).1, [Fault::Twins("a".into(), "c".into())]);
        let mut flag = noise(200, 2, 2);
        flag[[5, 1]] = -999.0;
        flag[[9, 1]] = -999.0;
        for (row, value) in [(5, -999.9), (9, -999.9)] {
            let mut fraction = noise(200, 2, 2);
            fraction[[row, 1]] = value;
            assert!(matches!(&of(vec![fraction]).1[..], [Fault::MissingFlag { value: -999.9, .. }]));
        }
        let mut shared = noise(200, 3, 2);
        for row in [3, 8, 90] {
            (shared[[row, 0]], shared[[row, 2]]) = (77.5, 77.5);
        }
        assert_eq!(of(vec![shared]).1.len(), 2);
        assert_eq!(of(vec![flag]).1, [Fault::MissingFlag { name: "b".into(), value: -999.0, count: 2 }]);
        let once = noise(100, 2, 3);
        assert_eq!(of(vec![once.clone(), noise(100, 2, 4), once]).1, [Fault::SameRecording(0, 2)]);
        // Places where nothing happens share the hour of the day with all others.
        let hours = |mut rows: Array2<f64>, busy: f64| {
            rows.column_mut(0).iter_mut().for_each(|value| *value *= busy);
            rows.column_mut(1).iter_mut().enumerate().for_each(|(t, value)| *value = t as f64);
            rows
        };
        let of_a_house = |busy: [f64; 3]| [0, 1, 2].map(|k| hours(noise(100, 2, k as u64), busy[k])).to_vec();
        assert_eq!(of(of_a_house([1.0, 0.0, 0.0])).1, []);
        assert_eq!(of(of_a_house([0.0, 0.0, 0.0])).1.len(), 1);
    }
}
