//! Least squares on weighted samples.
//!
//! Columns are centred and scaled to norm 1. The normal equations are solved by Cholesky; a column that earlier ones explain is left
//! out. One step of iterative refinement on the residuals gives back the digits that the normal equations cost (Björck 1987).

/// Part of a column's norm, squared, below which earlier columns explain it.
const RANK_TOLERANCE: f64 = 1e-11;
/// What is left of a column beside this share of its mean is what rounding leaves of a constant.
pub(crate) const CONSTANT: f64 = 1e-13;

/// A fit of `target = intercept + sum of coefficients x columns`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Fit {
    /// The constant.
    pub intercept: f64,
    /// One for each column; 0 for one that is left out.
    pub coefficients: Vec<f64>,
    /// The columns that are left out: constant, or a combination of earlier ones.
    pub dropped: Vec<usize>,
    /// Target minus fit, by sample.
    pub residuals: Vec<f64>,
    /// Influence of each sample on its own fit, `h_ii`; the residual without the sample is `e / (1 - h)`.
    pub leverages: Vec<f64>,
    /// `RSS / (n - k - 1)` with the `k` columns that are kept.
    pub variance: f64,
    /// Standard error of each coefficient; 0 for one that is left out.
    pub standard_errors: Vec<f64>,
}

/// The Cholesky factor of the scaled normal equations, on the columns that are kept.
pub(crate) struct Factor {
    /// The columns that are kept.
    pub(crate) kept: Vec<usize>,
    /// Rows of the lower triangle.
    rows: Vec<Vec<f64>>,
}

impl Factor {
    /// Of a matrix of products with a diagonal of ones (or zeros, for columns without variance).
    pub(crate) fn new(n: usize, product: impl Fn(usize, usize) -> f64) -> Self {
        let (mut kept, mut rows) = (Vec::new(), Vec::<Vec<f64>>::new());
        for k in 0..n {
            let mut row: Vec<f64> = Vec::with_capacity(kept.len() + 1);
            for (i, &j) in kept.iter().enumerate() {
                let sum: f64 = row.iter().zip(&rows[i]).map(|(a, b)| a * b).sum();
                row.push((product(k, j) - sum) / rows[i][i]);
            }
            let pivot = product(k, k) - row.iter().map(|v| v * v).sum::<f64>();
            if pivot > RANK_TOLERANCE {
                row.push(pivot.sqrt());
                rows.push(row);
                kept.push(k);
            }
        }
        Self { kept, rows }
    }

    /// The sum of the logarithms of the diagonal.
    pub(crate) fn log_diagonal(&self) -> f64 {
        self.rows.iter().filter_map(|row| row.last()).map(|pivot| libm::log(*pivot)).sum()
    }

    /// `L^-1 b`, `b` by kept column.
    pub(crate) fn half(&self, b: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut solved: Vec<f64> = Vec::with_capacity(self.rows.len());
        for (row, &k) in self.rows.iter().zip(&self.kept) {
            let sum: f64 = solved.iter().zip(row).map(|(a, b)| a * b).sum();
            solved.push((b(k) - sum) / row[solved.len()]);
        }
        solved
    }

    /// The kept columns made orthonormal: `X L^-T`.
    fn orthonormal(&self, columns: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let mut made: Vec<Vec<f64>> = Vec::with_capacity(self.rows.len());
        for (row, &k) in self.rows.iter().zip(&self.kept) {
            let mut column = columns[k].clone();
            for (before, factor) in made.iter().zip(row) {
                column.iter_mut().zip(before).for_each(|(v, b)| *v -= factor * b);
            }
            let diagonal = row[made.len()];
            column.iter_mut().for_each(|v| *v /= diagonal);
            made.push(column);
        }
        made
    }

    /// The solution by kept column.
    pub(crate) fn solve(&self, b: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut x = self.half(b);
        for i in (0..x.len()).rev() {
            x[i] /= self.rows[i][i];
            let xi = x[i];
            (0..i).for_each(|j| x[j] -= xi * self.rows[i][j]);
        }
        x
    }
}

/// Fits `target` on `columns`, each sample with the same weight.
///
/// ```
/// use roscausal_reasoning::linear::least_squares;
///
/// let x = [0.0, 1.0, 2.0, 3.0];
/// let fit = least_squares(&[1.0, 3.0, 5.0, 7.0], &[&x, &x]);
/// assert!((fit.intercept - 1.0).abs() < 1e-12 && (fit.coefficients[0] - 2.0).abs() < 1e-12);
/// assert_eq!(fit.dropped, [1]);
/// ```
pub fn least_squares<C: AsRef<[f64]>>(target: &[f64], columns: &[C]) -> Fit {
    weighted(target, columns, None)
}

/// The same with sample `i` counted `counts[i]` times.
pub(crate) fn weighted<C: AsRef<[f64]>>(target: &[f64], columns: &[C], counts: Option<&[u32]>) -> Fit {
    let weight = |i: usize| counts.map_or(1.0, |counts| f64::from(counts[i]));
    let n = target.len();
    let total: f64 = (0..n).map(weight).sum();
    if total <= 0.0 {
        let zeros = vec![0.0; columns.len()];
        return Fit {
            coefficients: zeros.clone(),
            standard_errors: zeros,
            dropped: (0..columns.len()).collect(),
            ..Fit::default()
        };
    }
    let mean = |column: &[f64]| column.iter().enumerate().map(|(i, v)| weight(i) * v).sum::<f64>() / total;
    let product = |a: &[f64], b: &[f64]| match counts {
        None => a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>(),
        Some(counts) => a.iter().zip(b).zip(counts).map(|((a, b), &c)| a * b * f64::from(c)).sum(),
    };
    // Centred twice, so that a large mean costs no digits.
    let centred = |column: &[f64]| {
        let first = mean(column);
        let once: Vec<f64> = column.iter().map(|v| v - first).collect();
        let second = mean(&once);
        (first + second, once.into_iter().map(|v| v - second).collect::<Vec<f64>>())
    };
    let mut means = Vec::with_capacity(columns.len());
    let mut norms = Vec::with_capacity(columns.len());
    let mut scaled = Vec::with_capacity(columns.len());
    for column in columns {
        let (centre, mut values) = centred(column.as_ref());
        let norm = product(&values, &values).sqrt();
        let constant = norm <= CONSTANT * total.sqrt() * centre.abs();
        values.iter_mut().for_each(|v| *v = if constant { 0.0 } else { *v / norm });
        means.push(centre);
        norms.push(norm);
        scaled.push(values);
    }
    let (target_mean, y) = centred(target);
    let factor = Factor::new(scaled.len(), |a, b| product(&scaled[a], &scaled[b]));
    let mut residuals = y;
    let mut solution = vec![0.0; factor.kept.len()];
    for _ in 0..2 {
        let step = factor.solve(|k| product(&scaled[k], &residuals));
        for ((value, step), &k) in solution.iter_mut().zip(&step).zip(&factor.kept) {
            *value += step;
            residuals.iter_mut().zip(&scaled[k]).for_each(|(r, x)| *r -= step * x);
        }
    }
    let mut coefficients = vec![0.0; columns.len()];
    let mut standard_errors = vec![0.0; columns.len()];
    let degrees = total - factor.kept.len() as f64 - 1.0;
    let variance = if degrees > 0.0 { product(&residuals, &residuals) / degrees } else { f64::NAN };
    for (position, &k) in factor.kept.iter().enumerate() {
        coefficients[k] = solution[position] / norms[k];
        let inverse = factor.solve(|other| f64::from(other == k))[position];
        standard_errors[k] = (variance * inverse).max(0.0).sqrt() / norms[k];
    }
    let mut leverages = vec![1.0 / total; n];
    for column in factor.orthonormal(&scaled) {
        leverages.iter_mut().zip(column).for_each(|(h, v)| *h += v * v);
    }
    let intercept = target_mean - coefficients.iter().zip(&means).map(|(b, m)| b * m).sum::<f64>();
    let dropped = (0..columns.len()).filter(|k| !factor.kept.contains(k)).collect();
    Fit { intercept, coefficients, dropped, residuals, leverages, variance, standard_errors }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn samples(n: usize, seed: u64) -> (Vec<f64>, Vec<Vec<f64>>) {
        let number = |i: usize| roscausal_discovery::mix(seed + i as u64) as f64 / u64::MAX as f64 - 0.5;
        let columns: Vec<Vec<f64>> =
            (0..3).map(|k| (0..n).map(|i| number(10 * i + k) + 5.0).collect()).collect();
        let target =
            (0..n).map(|i| 2.0 + columns[0][i] - 3.0 * columns[2][i] + 0.1 * number(10 * i + 9)).collect();
        (target, columns)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        #[test]
        fn residuals_are_orthogonal_to_every_column_and_a_leverage_is_what_leaving_out_says(seed in 0u64..1_000_000) {
            let (target, columns) = samples(30, seed);
            let fit = least_squares(&target, &columns);
            for column in &columns {
                let product: f64 = column.iter().zip(&fit.residuals).map(|(a, b)| a * b).sum();
                prop_assert!(product.abs() < 1e-10);
            }
            let counts: Vec<u32> = (0..30).map(|i| u32::from(i != 7)).collect();
            let without = weighted(&target, &columns, Some(&counts));
            let expected = fit.residuals[7] / (1.0 - fit.leverages[7]);
            prop_assert!((without.residuals[7] - expected).abs() < 1e-9);
        }

        #[test]
        fn a_count_is_a_sample_that_stands_there_so_often(seed in 0u64..1_000_000) {
            let (mut target, mut columns) = samples(20, seed);
            let mut counts = vec![1; 20];
            (counts[3], counts[5]) = (3, 0);
            let weighed = weighted(&target, &columns, Some(&counts));
            for column in columns.iter_mut().chain([&mut target]) {
                column.extend([column[3], column[3]]);
                column.remove(5);
            }
            let listed = least_squares(&target, &columns);
            prop_assert!((weighed.intercept - listed.intercept).abs() < 1e-9);
            for (a, b) in weighed.coefficients.iter().zip(&listed.coefficients) {
                prop_assert!((a - b).abs() < 1e-10);
            }
            prop_assert!((weighed.variance - listed.variance).abs() < 1e-12);
        }
    }

    #[test]
    fn a_constant_and_a_combination_are_left_out_and_named() {
        let (target, mut columns) = samples(30, 1);
        columns.insert(1, vec![4.0; 30]);
        columns.push((0..30).map(|i| columns[0][i] + 2.0 * columns[2][i]).collect());
        let fit = least_squares(&target, &columns);
        assert_eq!(fit.dropped, [1, 4]);
        assert_eq!(fit.coefficients[4], 0.0);
        assert!(least_squares(&[], &[[]; 2]).coefficients == [0.0, 0.0]);
    }
}
