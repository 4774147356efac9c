//! A period that several variables share, such as a day: links between them may be the clock's.
//!
//! Steps, for the longest recording:
//!
//! 1. Candidates are the peaks of each variable's autocorrelation.
//! 2. For each, take out of a variable what its last value explains beside its mean course over the period (a slow variable repeats
//!    nothing, but looks so). Take the mean course of the first half of the rows, and correlate it with the second half. Without a
//!    period the correlation over `n` rows is about Gaussian with variance `1 / n`.
//! 3. The period is the one at which the correlations of two or more variables that are beyond chance have the largest sum.
//!
//! Example: speed and number of people at 100 places of a day, over a week, both higher at noon: the period is 100 rows.

use std::collections::BTreeSet;

use ndarray::{ArrayView1, ArrayViewMut1};
use serde::{Deserialize, Serialize};

use crate::{
    numeric::rows::dot,
    types::{DataFrame, Named, names::plain, time_in_words},
};

/// Rows that are looked at, and the longest period, at most.
const MOST_ROWS: usize = 2000;
const LONGEST: usize = 400;
/// Rows of the shortest period.
const SHORTEST: usize = 4;
/// Standard deviations beyond which a correlation is not chance: many periods are tried.
const FAR: f64 = 4.5;
/// Peaks of a variable's autocorrelation that are looked at, and how high one is at least.
const PEAKS: usize = 5;
const LOWEST_PEAK: f64 = 0.1;

/// A period that several variables share.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Season {
    /// Rows after which they repeat.
    pub period: usize,
    /// Their names.
    pub variables: Vec<String>,
}

impl Season {
    /// The period of the data, if two variables or more share one; four of it or more are needed.
    pub fn of(data: &DataFrame) -> Option<Self> {
        let rows = data.longest();
        let columns: Vec<Vec<f64>> = rows.columns().into_iter().map(centred).collect();
        let longest = LONGEST.min(rows.nrows().min(MOST_ROWS) / 4);
        let highest = columns.iter().flat_map(|column| peaks(column, longest));
        let near = highest.flat_map(|peak| peak - 1..=peak + 1);
        let candidates: BTreeSet<usize> =
            near.filter(|period| (SHORTEST..=longest).contains(period)).collect();
        let of = |period: usize| {
            let found: Vec<(usize, f64)> =
                (0..columns.len()).filter_map(|var| Some((var, repeats(&columns[var], period)?))).collect();
            (period, found)
        };
        let sum = |found: &[(usize, f64)]| found.iter().map(|(_, r)| r).sum::<f64>();
        let shared = candidates.into_iter().map(of).filter(|(_, found)| found.len() > 1);
        let (period, found) = shared.max_by(|a, b| sum(&a.1).total_cmp(&sum(&b.1)))?;
        let variables = found.iter().map(|(var, _)| plain(&data.var_names()[*var])).collect();
        Some(Self { period, variables })
    }

    /// What was found, with the step between rows in seconds.
    pub fn found(&self, dt: Option<f64>) -> String {
        let time = dt.map_or(String::new(), |dt| format!(" ({})", time_in_words(dt, self.period)));
        let (names, period) = (self.variables.join(", "), self.period);
        format!("{names} repeat every {period} rows{time}: links between them may come from the clock alone")
    }

    /// The same, and the way out.
    pub fn reported(&self, dt: Option<f64>) -> String {
        let way = format!("{} {} takes the mean course of a period out", Named("season"), self.period);
        format!("{}; {way}", self.found(dt))
    }
}

/// A column without its mean; 0 where it has no value.
fn centred(column: ArrayView1<'_, f64>) -> Vec<f64> {
    let known = column.iter().take(MOST_ROWS).filter(|value| !value.is_nan());
    let (sum, count) = known.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    let values = column.iter().take(MOST_ROWS).map(|value| value - sum / count);
    values.map(|value| if value.is_nan() { 0.0 } else { value }).collect()
}

/// The correlation of a column with itself, so many rows later.
fn repeated(values: &[f64], rows: usize) -> f64 {
    dot(&values[rows..], &values[..values.len() - rows]) / dot(values, values)
}

/// The highest peaks of the autocorrelation, by the period.
fn peaks(values: &[f64], longest: usize) -> Vec<usize> {
    if longest < SHORTEST {
        return Vec::new();
    }
    let all: Vec<f64> = (0..=longest + 1).map(|rows| repeated(values, rows)).collect();
    let is_peak = |&at: &usize| all[at] > LOWEST_PEAK && all[at] >= all[at - 1] && all[at] >= all[at + 1];
    let mut found: Vec<usize> = (SHORTEST..=longest).filter(is_peak).collect();
    found.sort_by(|a, b| all[*b].total_cmp(&all[*a]));
    found.truncate(PEAKS);
    found
}

/// The mean course of a period, from a first row on.
fn course(values: &[f64], period: usize) -> Vec<f64> {
    let (mut sums, mut counts) = (vec![0.0; period], vec![0.0; period]);
    for (row, value) in values.iter().enumerate() {
        sums[row % period] += value;
        counts[row % period] += 1.0;
    }
    sums.iter().zip(counts).map(|(sum, count)| sum / count).collect()
}

/// The correlation of the mean course in the first half of a column with its second half, if it is beyond chance.
fn repeats(values: &[f64], period: usize) -> Option<f64> {
    let mean = course(values, period);
    let rest: Vec<f64> = values.iter().enumerate().map(|(row, value)| value - mean[row % period]).collect();
    let slope = repeated(&rest, 1);
    let left: Vec<f64> = values.windows(2).map(|pair| pair[1] - slope * pair[0]).collect();
    // Both halves begin with the same phase.
    let (first, second) = left.split_at(left.len() / 2 / period * period);
    let mean = course(first, period);
    let expected: Vec<f64> = (0..second.len()).map(|row| mean[row % period]).collect();
    let r = dot(&expected, second) / (dot(&expected, &expected) * dot(second, second)).sqrt();
    (r * (second.len() as f64).sqrt() > FAR).then_some(r)
}

/// Takes the mean of each phase of a period out of a column of one recording, and leaves its own mean.
pub fn without_season(mut column: ArrayViewMut1<'_, f64>, period: usize) {
    let mean = |values: &mut dyn Iterator<Item = f64>| {
        let (sum, count) = values.filter(|v| !v.is_nan()).fold((0.0, 0.0), |(sum, n), v| (sum + v, n + 1.0));
        sum / count
    };
    let all = mean(&mut column.iter().copied());
    for phase in 0..period.min(column.len()) {
        let off = mean(&mut column.iter().skip(phase).step_by(period).copied()) - all;
        column.iter_mut().skip(phase).step_by(period).for_each(|value| *value -= off);
    }
}

#[cfg(test)]
mod tests {
    use ndarray::{Array1, Array2};

    use super::*;
    use crate::numeric::random::mix;

    /// Gaussian enough: the sum of twelve even numbers.
    fn noise(at: usize) -> f64 {
        (0..12).map(|i| mix((at * 12 + i) as u64) as f64 / u64::MAX as f64).sum::<f64>() - 6.0
    }

    /// Two variables that are slow or not, with a share of a common course.
    fn data(rows: usize, slope: f64, course: impl Fn(usize) -> f64, seed: usize) -> DataFrame {
        let mut values = Array2::zeros((rows, 2));
        for (row, var) in (1..rows).flat_map(|row| [(row, 0), (row, 1)]) {
            let before = values[[row - 1, var]];
            values[[row, var]] = slope * before + noise((seed * rows + row) * 2 + var) + course(row);
        }
        DataFrame::new(vec![values], vec!["a".into(), "b".into()]).expect("data")
    }

    #[test]
    fn a_common_period_is_found_and_none_where_there_is_none() {
        for (period, slope) in [(24, 0.3), (7, 0.0), (100, 0.8), (12, 0.95)] {
            let course = |row: usize| (std::f64::consts::TAU * (row % period) as f64 / period as f64).sin();
            let season = Season::of(&data(800, slope, course, period)).expect("a period");
            assert_eq!((season.period, season.variables.len()), (period, 2), "{slope}");
        }
        for seed in 0..40 {
            for slope in [0.0, 0.5, 0.9, 0.99, 1.0] {
                assert_eq!(Season::of(&data(600, slope, |_| 0.0, seed)), None, "{seed} {slope}");
            }
        }
    }

    #[test]
    fn what_repeats_is_taken_out_and_the_mean_and_gaps_stay() {
        let mut column: Array1<f64> = (0..12).map(|row| (row % 3) as f64 * 10.0 + row as f64).collect();
        column[4] = f64::NAN;
        let mean = column.iter().filter(|v| !v.is_nan()).sum::<f64>() / 11.0;
        without_season(column.view_mut(), 3);
        assert!(column[4].is_nan());
        for phase in 0..3 {
            let of: Vec<f64> =
                column.iter().skip(phase).step_by(3).copied().filter(|v| !v.is_nan()).collect();
            assert!((of.iter().sum::<f64>() / of.len() as f64 - mean).abs() < 1e-12);
        }
        let mut empty: Array1<f64> = Array1::zeros(0);
        without_season(empty.view_mut(), 5);
    }
}
