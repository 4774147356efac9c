//! Rows of numbers: mean and deviation, scaling, products, ranks.

use super::random::Rng;
use crate::types::DataFrame;

/// Whether all values are the same.
pub(crate) fn is_constant(row: &[f64]) -> bool {
    row.windows(2).all(|w| w[0] == w[1])
}

/// Whether all values that are there are the same.
pub(crate) fn is_constant_column(column: ndarray::ArrayView1<'_, f64>) -> bool {
    let mut values = column.iter().filter(|v| !v.is_nan());
    let first = values.next();
    values.all(|v| Some(v) == first)
}

/// Subtracts the mean and scales to norm 1; false if the row is constant.
pub(crate) fn standardize(row: &mut [f64]) -> bool {
    if is_constant(row) {
        return false;
    }
    let n = row.len() as f64;
    let unit = unit_factor(row);
    row.iter_mut().for_each(|v| *v *= unit);
    // Twice: the second pass subtracts what rounding left in the first.
    for _ in 0..2 {
        let mean = row.iter().sum::<f64>() / n;
        row.iter_mut().for_each(|v| *v -= mean);
    }
    let largest = row.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    if largest == 0.0 || !largest.is_finite() {
        return false;
    }
    row.iter_mut().for_each(|v| *v /= largest);
    let norm = row.iter().map(|v| v * v).sum::<f64>().sqrt();
    row.iter_mut().for_each(|v| *v /= norm);
    true
}

/// The power of two that brings the largest size of a value to between 1 and 4, so that neither squares nor sums overflow or vanish.
/// Multiplying by it is exact: what is computed afterwards does not depend on units that differ by powers of two.
#[must_use]
pub fn unit_factor(row: &[f64]) -> f64 {
    let largest = largest(row);
    if largest == 0.0 || !largest.is_finite() {
        return 1.0;
    }
    // The biased exponent; 2046 at the most, of which the mirror image would be the exponent of 0.
    let exponent = (largest.to_bits() >> 52).min(2045);
    f64::from_bits((2046 - exponent) << 52)
}

/// For each variable the power of two that brings its largest size to between 1 and 4.
pub(crate) fn units(data: &DataFrame) -> Vec<f64> {
    (0..data.n_vars()).map(|var| unit(data, var)).collect()
}

/// That of one variable.
pub(crate) fn unit(data: &DataFrame, var: usize) -> f64 {
    let values = data.recordings().iter().flat_map(|of| of.column(var).to_vec());
    unit_factor(&[values.filter(|v| !v.is_nan()).fold(0.0, |most: f64, v| most.max(v.abs()))])
}

/// Sum of products, in eight lanes.
#[inline]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut lanes = [0.0; 8];
    let (a8, a_rest) = a.as_chunks::<8>();
    let (b8, b_rest) = b.as_chunks::<8>();
    for (x, y) in a8.iter().zip(b8) {
        for k in 0..8 {
            lanes[k] += x[k] * y[k];
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(x, y)| x * y).sum();
    lanes.iter().sum::<f64>() + rest
}

/// Sum, in eight lanes: one addition does not wait for the last.
#[inline]
pub(crate) fn sum(row: &[f64]) -> f64 {
    let mut lanes = [0.0; 8];
    let (eights, rest) = row.as_chunks::<8>();
    for eight in eights {
        for k in 0..8 {
            lanes[k] += eight[k];
        }
    }
    lanes.iter().sum::<f64>() + rest.iter().sum::<f64>()
}

/// The largest size of a value, in eight lanes; 0 of none.
#[inline]
pub(crate) fn largest(row: &[f64]) -> f64 {
    let larger = |most: f64, v: &f64| if v.abs() > most { v.abs() } else { most };
    let mut lanes = [0.0; 8];
    let (eights, rest) = row.as_chunks::<8>();
    for eight in eights {
        for k in 0..8 {
            lanes[k] = larger(lanes[k], &eight[k]);
        }
    }
    lanes.iter().chain(rest).fold(0.0, larger)
}

/// A quantile of sorted values, linear between them; NaN of none.
///
/// ```
/// assert_eq!(roscausal_discovery::quantile(&[1.0, 2.0, 4.0], 0.75), 3.0);
/// ```
pub fn quantile(sorted: &[f64], q: f64) -> f64 {
    if sorted.is_empty() {
        return f64::NAN;
    }
    let place = q * (sorted.len() - 1) as f64;
    let (low, rest) = (place.floor() as usize, place.fract());
    let high = (low + 1).min(sorted.len() - 1);
    sorted[low] + rest * (sorted[high] - sorted[low])
}

/// Ranks `0..n`, each once; ties are in random order.
pub(crate) fn random_ranks(row: &[f64], rng: &mut Rng) -> Vec<usize> {
    let mut order: Vec<usize> = (0..row.len()).collect();
    order.sort_by(|&a, &b| row[a].total_cmp(&row[b]));
    order.chunk_by_mut(|&a, &b| row[a] == row[b]).for_each(|equals| rng.shuffle(equals));
    let mut ranks = vec![0; row.len()];
    order.iter().enumerate().for_each(|(rank, &i)| ranks[i] = rank);
    ranks
}

/// Mean and standard deviation (by `n`).
pub(crate) fn moments(row: &[f64]) -> (f64, f64) {
    let (n, unit) = (row.len() as f64, unit_factor(row));
    let mean = row.iter().map(|v| v * unit).sum::<f64>() / n;
    let deviation = (row.iter().map(|v| (v * unit - mean).powi(2)).sum::<f64>() / n).sqrt();
    (mean / unit, deviation / unit)
}

/// `row` with mean 0 and standard deviation 1 (by `n`); a constant row becomes 0.
pub(crate) fn standardized(row: &[f64]) -> Vec<f64> {
    let unit = unit_factor(row);
    let row: Vec<f64> = row.iter().map(|v| v * unit).collect();
    let (mean, deviation) = moments(&row);
    let scale = if deviation > 0.0 { deviation } else { 1.0 };
    row.iter().map(|v| (v - mean) / scale).collect()
}

/// The values without their mean.
pub(crate) fn centred(mut values: Vec<f64>) -> Vec<f64> {
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    values.iter_mut().for_each(|value| *value -= mean);
    values
}

/// The sum of each value and all before it.
pub(crate) fn cumulated(row: &[f64]) -> Vec<f64> {
    let added = |sum: &mut f64, value: &f64| {
        *sum += value;
        Some(*sum)
    };
    row.iter().scan(0.0, added).collect()
}

/// The variance that a mean of so many values has, times their number (Bartlett's weights); `off` are differences from the mean.
pub(crate) fn long_run_variance(off: &[f64]) -> f64 {
    let n = off.len();
    let lags = (12.0 * libm::pow(n as f64 / 100.0, 0.25)) as usize;
    let autocovariance = |lag: usize| dot(&off[lag..], &off[..n - lag]) / n as f64;
    let weighted = |lag: usize| 2.0 * (1.0 - lag as f64 / (lags as f64 + 1.0)) * autocovariance(lag);
    autocovariance(0) + (1..=lags.min(n - 1)).map(weighted).sum::<f64>()
}
