//! Whether a curve differs in the rows after: a score test.
//!
//! 1. A Gaussian process of the effect on its inputs, over the rows before and after: covariance `V = K + s I`.
//! 2. Six cosines of the ranks `u` of a cause: `f_k = cos(pi k u)`. Ranks, so that no far value has a weight of its own.
//! 3. The model is `y = process + sum b_k f_k + after * sum g_k f_k + noise`. The `b_k` are any numbers: what the process misses
//!    of this cause, before as after, is no difference. The `g_k` have the variance `v / k`; nothing changed if `v = 0`.
//! 4. With `P = V^-1 - V^-1 F (F' V^-1 F)^-1 F' V^-1` and the rows `D` of the cosines after, less their mean there, the score of
//!    `v` is `Q = sum (D' P y)_k^2 / k`. If nothing changed, `D' P y` has the covariance `C = D' P D`, and `Q` is a sum of
//!    chi-squared variables with the eigenvalues of `C` times the weights.
//! 5. The noise may have another size in each row: `C + s U' diag(e^2 - 1) U` with `U = P D` and the residuals `e^2 = (P y)^2 / P_tt`,
//!    as HC estimates have it. So a noise that becomes larger is not a change.
//! 6. The p-value is that of the chi-squared variable with the same first three moments.
//!
//! Sources: Lin 1997 (score test of a variance), Liu, Lin and Ghosh 2007 (of a smooth function, with kernels), Neyman 1937 (cosines of
//! ranks), MacKinnon and White 1985 (HC), Liu, Tang and Zhang 2009 (sums of chi-squared variables).
//!
//! A distance correlation of the residuals with the cause sees less: a fit to both groups takes a part of the difference with it,
//! and of 150 rows it is blind to what one direction of the six shows.

use faer::{Mat, Side};
use statrs::function::gamma::checked_gamma_ur;

use crate::{independence_tests::GpRegression, numeric::rows::is_constant, types::Result};

/// Number of cosines.
const COSINES: usize = 6;

/// What the tests of all causes of one effect share.
pub(super) struct Score {
    /// `V^-1`.
    precision: Mat<f64>,
    /// `V^-1 y`.
    weighted: Mat<f64>,
    /// `s`.
    noise: f64,
    /// The last rows are those after.
    n_after: usize,
}

impl Score {
    /// Of the regression over all rows, the last `n_after` of which are after.
    ///
    /// # Errors
    /// A covariance matrix that is singular.
    pub(super) fn new(regression: &GpRegression, n_after: usize) -> Result<Self> {
        let (precision, weights) = regression.precision()?;
        let weighted = Mat::from_fn(weights.len(), 1, |t, _| weights[t]);
        Ok(Self { precision, weighted, noise: regression.optimum().noise, n_after })
    }

    /// P-value of one curve of this cause before and after, in the order of the regression's rows; 1 where nothing can be said.
    pub(super) fn p_value(&self, cause: &[f64]) -> f64 {
        let n = self.precision.nrows();
        let first = n.saturating_sub(self.n_after);
        if cause.len() != n || first == 0 || first == n || is_constant(cause) || is_constant(&cause[first..])
        {
            return 1.0;
        }
        let ranks = middle_ranks(cause);
        // The last column is the constant.
        let common = Mat::from_fn(n, COSINES + 1, |t, k| {
            if k < COSINES { libm::cos(std::f64::consts::PI * (k + 1) as f64 * ranks[t]) } else { 1.0 }
        });
        let mean = |k: usize| (first..n).map(|t| common[(t, k)]).sum::<f64>() / (n - first) as f64;
        let means: Vec<f64> = (0..COSINES).map(mean).collect();
        let after = Mat::from_fn(n, COSINES, |t, k| if t < first { 0.0 } else { common[(t, k)] - means[k] });

        let solved = &self.precision * &common;
        let Some(inverse) = inverse(&(common.transpose() * &solved)) else { return 1.0 };
        let taken = &solved * &inverse;
        let left = &self.weighted - &taken * (common.transpose() * &self.weighted);
        let moved = &self.precision * &after - &taken * (solved.transpose() * &after);
        let scores = after.transpose() * &left;
        let mut covariance = after.transpose() * &moved;
        for t in 0..n {
            let explained: f64 = (0..=COSINES).map(|k| taken[(t, k)] * solved[(t, k)]).sum();
            let own = (self.precision[(t, t)] - explained).max(1e-9 * self.precision[(t, t)]);
            let excess = self.noise * (left[(t, 0)].powi(2) / own - 1.0);
            for i in 0..COSINES {
                for j in 0..COSINES {
                    covariance[(i, j)] += excess * moved[(t, i)] * moved[(t, j)];
                }
            }
        }
        let weight = |k: usize| 1.0 / (k + 1) as f64;
        let sum = (0..COSINES).map(|k| weight(k) * scores[(k, 0)].powi(2)).sum();
        let weighted =
            Mat::from_fn(COSINES, COSINES, |i, j| covariance[(i, j)] * (weight(i) * weight(j)).sqrt());
        p_value_of_sum(sum, &weighted)
    }
}

/// Ranks in (0, 1); ties have their mean.
fn middle_ranks(values: &[f64]) -> Vec<f64> {
    let n = values.len();
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let mut ranks = vec![0.0; n];
    let mut below = 0;
    for equals in order.chunk_by(|&a, &b| values[a] == values[b]) {
        let middle = (below as f64 + 0.5 * equals.len() as f64) / n as f64;
        equals.iter().for_each(|&t| ranks[t] = middle);
        below += equals.len();
    }
    ranks
}

/// The inverse of a symmetric matrix within the space where it is not (nearly) 0: a cause of few values has fewer cosines.
fn inverse(matrix: &Mat<f64>) -> Option<Mat<f64>> {
    let parts = matrix.self_adjoint_eigen(Side::Lower).ok()?;
    let (values, vectors) = (parts.S(), parts.U());
    let n = matrix.nrows();
    let largest = (0..n).map(|k| values[k]).fold(0.0, f64::max);
    let part = |k: usize| if values[k] > 1e-9 * largest { 1.0 / values[k] } else { 0.0 };
    let of = |i: usize, j: usize| (0..n).map(|k| vectors[(i, k)] * part(k) * vectors[(j, k)]).sum();
    Some(Mat::from_fn(n, n, of))
}

/// `P(sum l_k chi_k^2 >= x)` for the eigenvalues `l` of a matrix, by three moments.
fn p_value_of_sum(x: f64, matrix: &Mat<f64>) -> f64 {
    let n = matrix.nrows();
    let square = matrix * matrix;
    let trace = |of: &Mat<f64>| (0..n).map(|k| of[(k, k)]).sum::<f64>();
    let (first, second, third) = (trace(matrix), trace(&square), trace(&(&square * matrix)));
    if !(second > 0.0 && third > 0.0 && x.is_finite()) {
        return 1.0;
    }
    let dof = second.powi(3) / third.powi(2);
    let standard = (x - first) / (2.0 * second).sqrt();
    let value = standard.mul_add((2.0 * dof).sqrt(), dof);
    if value <= 0.0 {
        return 1.0;
    }
    checked_gamma_ur(0.5 * dof, 0.5 * value).map_or(1.0, |p| p.clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::Rng;

    #[test]
    fn a_sum_of_equal_parts_is_a_chi_squared_variable() {
        let one = Mat::from_fn(3, 3, |i, j| if i == j { 2.0 } else { 0.0 });
        // 95 % quantile of three degrees of freedom.
        assert!((p_value_of_sum(2.0 * 7.814_727_903_251_179, &one) - 0.05).abs() < 1e-10);
        assert_eq!(p_value_of_sum(f64::NAN, &one), 1.0);
        assert_eq!(p_value_of_sum(1.0, &Mat::zeros(3, 3)), 1.0);
    }

    /// `y = strength(t) sin(1.5 x) + size(t) noise`, the last 150 of 600 rows after.
    fn p_value(seed: u64, strength: impl Fn(usize) -> f64, size: impl Fn(usize) -> f64) -> f64 {
        let mut rng = Rng::new(seed);
        let mut normal = || (0..12).map(|_| rng.unit()).sum::<f64>() - 6.0;
        let x: Vec<f64> = (0..600).map(|_| normal()).collect();
        let y: Vec<f64> = (0..600).map(|t| strength(t) * (1.5 * x[t]).sin() + size(t) * normal()).collect();
        // Hyperparameters of a process that takes the curve for noise in part: that is no difference, either.
        let regression = GpRegression::at(&y, std::slice::from_ref(&x), 3.0, 0.8).unwrap();
        Score::new(&regression, 150).unwrap().p_value(&x)
    }

    #[test]
    fn the_level_holds_where_nothing_changes_or_only_the_noise_does_and_a_change_is_seen() {
        let below = |of: &dyn Fn(u64) -> f64| (1..=200).filter(|&seed| of(seed) <= 0.05).count();
        let same = below(&|seed| p_value(seed, |_| 0.8, |_| 1.0));
        let louder = below(&|seed| p_value(seed, |_| 0.8, |t| if t < 450 { 1.0 } else { 2.0 }));
        let quieter = below(&|seed| p_value(seed, |_| 0.8, |t| if t < 450 { 1.0 } else { 0.5 }));
        // 10 of 200; four deviations are 12.
        assert!(same <= 22 && louder <= 22 && quieter <= 22, "{same} {louder} {quieter}");
        let gone = (1..=20)
            .filter(|&seed| p_value(seed, |t| if t < 450 { 0.8 } else { 0.0 }, |_| 1.0) <= 1e-3)
            .count();
        assert!(gone >= 18, "of 20: {gone}");
    }

    #[test]
    fn odd_causes_have_an_answer() {
        let y: Vec<f64> = (0..60).map(|t| f64::from(t * 37 % 60)).collect();
        let x: Vec<f64> = (0..60).map(|t| f64::from(t * 17 % 60)).collect();
        let regression = GpRegression::at(&y, &[x], 1.0, 0.5).unwrap();
        let score = Score::new(&regression, 20).unwrap();
        assert_eq!(score.p_value(&[1.0; 60]), 1.0);
        assert_eq!(score.p_value(&[1.0; 3]), 1.0);
        let two: Vec<f64> = (0..60).map(|t| f64::from(t % 2)).collect();
        assert!((0.0..=1.0).contains(&score.p_value(&two)));
    }
}
