//! Gaussian process regressions for those who predict: the ones of GPDC, kept with what a mean, a variance and residuals need.
//!
//! Rasmussen and Williams 2006: the mean and variance of a process at a new place are 2.25 and 2.26, the residual of a sample
//! that is left out is 5.12. A sample that counts `c` times is one sample with the noise `s / c`: the posterior is the same, and
//! the matrix is as small as the number of different samples.

use faer::{
    Col, Mat, Side,
    linalg::solvers::{DenseSolveCore, Llt, Solve},
};

use super::{
    check_samples,
    kernel::Inputs,
    memory_of,
    regression::{GaussianProcess, SearchSettings, no_covariance},
    resources::Resources,
    theta::Theta,
};
use crate::{
    independence_tests::settings::TestSettings,
    numeric::rows::{is_constant, moments, standardized},
    types::{Error, Result},
};

/// The maximum of a Gaussian process likelihood with the kernel `RBF(length_scale) + White(noise)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GpOptimum {
    /// Length scale, in standard deviations of the conditions.
    pub length_scale: f64,
    /// Noise variance, in variances of the target.
    pub noise: f64,
    /// Log marginal likelihood there.
    pub log_likelihood: f64,
}

impl GpOptimum {
    /// The optimum of the regression of `target` on `conditions` (one row of samples each) that a GPDC test with `settings`
    /// takes: both are standardised first.
    ///
    /// ```
    /// use roscausal_discovery::independence_tests::{GpOptimum, TestSettings};
    ///
    /// let z: Vec<f64> = (0..60).map(|i| f64::from(i * 37 % 60) / 10.0).collect();
    /// let y: Vec<f64> = z.iter().enumerate().map(|(i, z)| z.sin() + 0.1 * f64::from(i as u32 * 17 % 7)).collect();
    /// let optimum = GpOptimum::find(&y, &[z], &TestSettings::default())?;
    /// assert!(optimum.length_scale > 0.3 && optimum.noise < 0.5);
    /// # Ok::<(), roscausal_discovery::Error>(())
    /// ```
    ///
    /// # Errors
    /// Fewer than five samples, rows of other lengths than the target, constant or infinite values.
    pub fn find(target: &[f64], conditions: &[Vec<f64>], settings: &TestSettings) -> Result<Self> {
        check(target, conditions)?;
        let rows: Vec<Vec<f64>> = conditions.iter().map(|row| standardized(row)).collect();
        let process = GaussianProcess::new(&rows, &Resources::new(memory_of(settings)));
        let target = standardized(target);
        let theta = process.fit(&target, &SearchSettings::of(settings), &|| Ok(()))?.theta;
        Ok(Self {
            length_scale: theta.l,
            noise: theta.s,
            log_likelihood: process.log_likelihood(&target, theta),
        })
    }
}

/// Whether a regression of `target` on `conditions` is possible.
fn check(target: &[f64], conditions: &[Vec<f64>]) -> Result<()> {
    let n = target.len();
    check_samples(n)?;
    if let Some(row) = conditions.iter().position(|row| row.len() != n) {
        return Err(Error::Data(format!(
            "condition {row} has {} samples, the target {n}",
            conditions[row].len()
        )));
    }
    let mut rows = conditions.iter().map(Vec::as_slice).chain([target]);
    let fits = |row: &[f64]| !is_constant(row) && row.iter().all(|v| v.is_finite());
    Error::ensure_data(
        !conditions.is_empty() && rows.all(fits),
        || "a regression needs conditions and a target that vary, of finite values",
    )
}

/// A Gaussian process regression with the kernel `RBF(length_scale) + White(noise)`, to predict with: the one that GPDC takes
/// the residuals of, on conditions and a target that are standardised (deviation by `n`) and given back in their units.
///
/// ```
/// use roscausal_discovery::independence_tests::{GpRegression, TestSettings};
///
/// let z: Vec<f64> = (0..60).map(|i| f64::from(i * 37 % 60) / 10.0).collect();
/// let y: Vec<f64> = z.iter().enumerate().map(|(i, z)| z.sin() + 0.01 * f64::from(i as u32 * 17 % 7)).collect();
/// let regression = GpRegression::fit(&y, &[z], &TestSettings::default())?;
/// assert!((regression.mean(&[2.0]) - (2f64.sin() + 0.03)).abs() < 0.02);
/// assert!(regression.function_variance(&[vec![2.0], vec![20.0]])?[1] > 0.1);
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
pub struct GpRegression {
    inputs: Inputs,
    /// Mean and deviation of each condition, and of the target.
    scales: Vec<(f64, f64)>,
    scale: (f64, f64),
    theta: Theta,
    log_likelihood: f64,
    /// `(K + s I)^-1 y`.
    weights: Vec<f64>,
}

impl GpRegression {
    /// Regresses `target` on `conditions` (one row of samples each): the search is that of GPDC with these `settings`.
    ///
    /// # Errors
    /// Those of [`GpOptimum::find`].
    pub fn fit(target: &[f64], conditions: &[Vec<f64>], settings: &TestSettings) -> Result<Self> {
        let GpOptimum { length_scale, noise, .. } = GpOptimum::find(target, conditions, settings)?;
        Self::at(target, conditions, length_scale, noise)
    }

    /// The same with a known length scale and noise variance, in deviations of the conditions and variances of the target.
    ///
    /// # Errors
    /// Those of [`GpOptimum::find`]; hyperparameters that are not above 0, or whose covariance matrix is singular.
    pub fn at(target: &[f64], conditions: &[Vec<f64>], length_scale: f64, noise: f64) -> Result<Self> {
        check(target, conditions)?;
        for (name, value) in [("length_scale", length_scale), ("noise", noise)] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(Error::param(name, format!("{value} is not a finite number above 0")));
            }
        }
        let theta = Theta { l: length_scale, s: noise };
        let rows: Vec<Vec<f64>> = conditions.iter().map(|row| standardized(row)).collect();
        let inputs = Inputs::new(&rows);
        let y = standardized(target);
        let factor = covariance(&inputs, theta.l, |_| theta.s)?;
        let weights = solve(&factor, &y);
        let log_determinant: f64 =
            factor.L().diagonal().column_vector().iter().map(|d| 2.0 * libm::log(*d)).sum();
        let product: f64 = y.iter().zip(&weights).map(|(y, w)| y * w).sum();
        let log_likelihood =
            -0.5 * (product + log_determinant + y.len() as f64 * libm::log(std::f64::consts::TAU));
        let scales = conditions.iter().map(|row| moments(row)).collect();
        Ok(Self { inputs, scales, scale: moments(target), theta, log_likelihood, weights })
    }

    /// The regression of another `target` on the same samples, sample `i` of which counts `counts[i]` times, as in a bootstrap:
    /// hyperparameters and standardisation stay.
    ///
    /// # Errors
    /// Lengths that differ from the number of samples; no sample that counts.
    pub fn resampled(&self, target: &[f64], counts: &[u32]) -> Result<Self> {
        let n = self.inputs.len();
        let kept: Vec<usize> = (0..counts.len()).filter(|&i| counts[i] > 0).collect();
        if target.len() != n || counts.len() != n || kept.is_empty() {
            return Err(Error::Data(format!(
                "a resampled regression needs a target and a count for each of its {n} samples, and one that is not 0"
            )));
        }
        let inputs = self.inputs.chosen(&kept);
        let y: Vec<f64> = kept.iter().map(|&i| (target[i] - self.scale.0) / self.scale.1).collect();
        let factor = covariance(&inputs, self.theta.l, |i| self.theta.s / f64::from(counts[kept[i]]))?;
        let weights = solve(&factor, &y);
        let scales = self.scales.clone();
        Ok(Self { inputs, scales, weights, log_likelihood: f64::NAN, ..*self })
    }

    /// Where the search ended; the log likelihood of a resampled regression is NaN.
    pub fn optimum(&self) -> GpOptimum {
        let Theta { l, s } = self.theta;
        GpOptimum { length_scale: l, noise: s, log_likelihood: self.log_likelihood }
    }

    /// The mean at a place: one value for each condition. In nanoseconds for each sample.
    ///
    /// A place with too few values gives the mean of what is there.
    pub fn mean(&self, place: &[f64]) -> f64 {
        let mut fixed = [0.0; 16];
        let mut long = Vec::new();
        let d = self.scales.len();
        let standard = if d <= fixed.len() {
            &mut fixed[..d]
        } else {
            long.resize(d, 0.0);
            &mut long[..]
        };
        for ((z, value), (mean, deviation)) in standard.iter_mut().zip(place).zip(&self.scales) {
            *z = (value - mean) / deviation;
        }
        self.inputs.weighted_sum(self.theta.l, standard, &self.weights).mul_add(self.scale.1, self.scale.0)
    }

    /// Variance of the function (without noise) at places, in squared units of the target. It factorises the covariance matrix
    /// anew.
    ///
    /// # Errors
    /// A regression that is resampled: its counts are not kept.
    pub fn function_variance(&self, places: &[Vec<f64>]) -> Result<Vec<f64>> {
        let factor = self.factor()?;
        let n = self.inputs.len();
        let variance = |place: &Vec<f64>| {
            let values = place.iter().zip(&self.scales);
            let standard: Vec<f64> =
                values.map(|(value, (mean, deviation))| (value - mean) / deviation).collect();
            let mut kernel = vec![0.0; n];
            self.inputs.to_place(self.theta.l, &standard, &mut kernel);
            let solved = solve(&factor, &kernel);
            let explained: f64 = kernel.iter().zip(&solved).map(|(a, b)| a * b).sum();
            (1.0 - explained).max(0.0) * self.scale.1 * self.scale.1
        };
        Ok(places.iter().map(variance).collect())
    }

    /// For each sample: the target minus its mean by the other samples, in units of the target.
    ///
    /// # Errors
    /// A regression that is resampled: its counts are not kept.
    pub fn leave_one_out(&self) -> Result<Vec<f64>> {
        let inverse = self.factor()?.inverse();
        let left = |(i, weight): (usize, &f64)| self.scale.1 * weight / inverse[(i, i)];
        Ok(self.weights.iter().enumerate().map(left).collect())
    }

    /// The inverse `A` of the samples' covariance matrix, noise included, and `A y`: both of standardised values.
    ///
    /// # Errors
    /// A regression that is resampled: its counts are not kept.
    pub(crate) fn precision(&self) -> Result<(Mat<f64>, &[f64])> {
        Ok((self.factor()?.inverse(), &self.weights))
    }

    fn factor(&self) -> Result<Llt<f64>> {
        let reason = "a resampled regression keeps no counts; ask the one that it was made of";
        Error::ensure_data(!self.log_likelihood.is_nan(), || reason)?;
        covariance(&self.inputs, self.theta.l, |_| self.theta.s)
    }
}

impl std::fmt::Debug for GpRegression {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("GpRegression")
            .field("samples", &self.inputs.len())
            .field("optimum", &self.optimum())
            .finish()
    }
}

/// The Cholesky factor of the kernel matrix with `noise(i)` added to the diagonal.
fn covariance(inputs: &Inputs, l: f64, noise: impl Fn(usize) -> f64) -> Result<Llt<f64>> {
    let n = inputs.len();
    let mut matrix = Mat::<f64>::zeros(n, n);
    let mut column = vec![0.0; n];
    for j in 0..n {
        inputs.column(l, j, j, &mut column[j..], &mut []);
        (j..n).for_each(|i| matrix[(i, j)] = column[i]);
        matrix[(j, j)] = 1.0 + noise(j);
    }
    matrix.llt(Side::Lower).map_err(|_| no_covariance())
}

fn solve(factor: &Llt<f64>, y: &[f64]) -> Vec<f64> {
    factor.solve(&Col::from_fn(y.len(), |i| y[i])).iter().copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples(n: u32) -> (Vec<Vec<f64>>, Vec<f64>) {
        let noise = |i: u32| ((12.9898 * f64::from(i)).sin() * 43_758.545_3).rem_euclid(1.0) - 0.5;
        let rows: Vec<Vec<f64>> = (0..2).map(|k| (0..n).map(|i| 4.0 * noise(3 * i + k)).collect()).collect();
        let y =
            (0..n as usize).map(|i| rows[0][i].sin() + rows[1][i] + 0.4 * noise(7 * i as u32 + 5)).collect();
        (rows, y)
    }

    #[test]
    fn a_residual_left_out_is_that_of_the_regression_without_the_sample() {
        let (rows, y) = samples(61);
        let whole = GpRegression::fit(&y, &rows, &TestSettings::default()).unwrap();
        let left_out = whole.leave_one_out().unwrap();
        for i in [0, 17, 60] {
            let counts: Vec<u32> = (0..61).map(|k| u32::from(k != i)).collect();
            let others = whole.resampled(&y, &counts).unwrap();
            let expected = y[i] - others.mean(&[rows[0][i], rows[1][i]]);
            assert!((left_out[i] - expected).abs() < 1e-9, "{i}: {} {expected}", left_out[i]);
        }
    }

    #[test]
    fn a_sample_that_counts_twice_is_two_samples() {
        let (mut rows, mut y) = samples(40);
        let GpOptimum { length_scale, noise, .. } =
            GpOptimum::find(&y, &rows, &TestSettings::default()).unwrap();
        let once = GpRegression::at(&y, &rows, length_scale, noise).unwrap();
        let mut counts = vec![1; 40];
        counts[3] = 2;
        let twice = once.resampled(&y, &counts).unwrap();
        // The same by definition: the sample stands there twice. Scales are those of the first.
        rows.iter_mut().for_each(|row| row.push(row[3]));
        y.push(y[3]);
        let longer = GpRegression::at(&y, &rows, length_scale, noise).unwrap();
        let longer = GpRegression { scales: once.scales.clone(), scale: once.scale, ..longer };
        let standard = |row: &Vec<f64>, (mean, deviation): (f64, f64)| {
            row.iter().map(|v| (v - mean) / deviation).collect()
        };
        let inputs =
            Inputs::new(&rows.iter().zip(&once.scales).map(|(row, &s)| standard(row, s)).collect::<Vec<_>>());
        let target: Vec<f64> = standard(&y, once.scale);
        let weights = solve(&covariance(&inputs, length_scale, |_| noise).unwrap(), &target);
        let longer = GpRegression { inputs, weights, ..longer };
        for place in [[0.3, -1.0], [1.9, 0.2]] {
            assert!((twice.mean(&place) - longer.mean(&place)).abs() < 1e-9);
        }
    }

    #[test]
    fn what_cannot_be_regressed_is_refused_in_a_sentence() {
        let (rows, y) = samples(20);
        assert!(GpRegression::at(&y[..3], &rows, 1.0, 1.0).is_err());
        assert!(GpRegression::at(&y, &rows, 0.0, 1.0).unwrap_err().to_string().contains("length_scale"));
        let whole = GpRegression::at(&y, &rows, 1.0, 0.1).unwrap();
        assert!(whole.resampled(&y, &[0; 20]).is_err() && whole.resampled(&y, &[1; 3]).is_err());
        assert!(whole.resampled(&y, &[1; 20]).unwrap().leave_one_out().is_err());
    }
}
