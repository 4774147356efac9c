//! Weighted partial correlation: linear dependence of variables whose noise changes its size over time.
//!
//! Source: Günther, Ninad, Wahl and Runge 2022, UAI workshop, "Conditional independence testing with heteroskedastic data and
//! applications to causal discovery".
//!
//! 1. X and Y are regressed on Z and a constant by least squares.
//! 2. The size of a residual at a time is its mean absolute value over the last ten samples; before there are ten, over the first ten.
//! 3. Both are regressed again, each sample weighted by one over that size squared.
//! 4. What is left, divided by its size, is correlated. P-value: Student's t with `n - 2 - |Z|` degrees of freedom.
//!
//! Example: a sensor that shakes while the robot drives. Partial correlation takes its loud half for half of the evidence; here
//! each sample counts by what it can tell.

use super::{
    TestSettings,
    cholesky::{correlation, orthogonalize, orthonormal_basis},
};
use crate::{
    numeric::{
        rows::{dot, is_constant, standardize},
        student_t::correlation_p_value,
    },
    types::{CondIndTest, LaggedArrays, Node, PreparedTest, Result, Samples, TestResult},
};

/// Samples over which the size of a residual is taken.
const WINDOW: usize = 10;
/// Smallest size of a residual, as a part of its mean size: a residual of 0 must not weigh all.
const SMALLEST: f64 = 1e-3;

/// Partial correlation that weighs each sample by how large the noise is at its time.
///
/// Take it where [`ParCorr`](super::ParCorr) would do, but the noise grows and shrinks: its p-values are then too small in
/// `ParCorr`. Units and means do not matter. With `as_tigramite` there is no constant in the regressions and the first nine samples
/// have the weight 1, whatever the unit: bring variables to mean 0 and deviation 1 first.
///
/// ```
/// use roscausal_discovery::{CondIndTest, DataFrame, Node, Samples};
/// use roscausal_discovery::independence_tests::{ParCorrWls, TestSettings};
///
/// // Y follows X; both are loud in every other fifty samples.
/// let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0) - 0.5;
/// let loud = |t: usize| if (t / 50) % 2 == 0 { 5.0 } else { 1.0 };
/// let values = ndarray::Array2::from_shape_fn((200, 2), |(t, k)| {
///     noise(2 * t) * loud(t) + if k == 1 { loud(t) * noise(2 * t + 1) } else { 0.0 }
/// });
/// let data = DataFrame::new(vec![values], vec!["x".into(), "y".into()])?;
/// let samples = Samples::new(&data, 0);
/// let test = ParCorrWls::new(&TestSettings::default())?;
/// assert!(test.prepare(&samples)?.run_test(Node::new(0, 0), Node::new(1, 0), &[])?.p_value < 1e-6);
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct ParCorrWls {
    as_tigramite: bool,
}

impl ParCorrWls {
    /// The test with these settings.
    ///
    /// # Errors
    /// A setting that this test does not have.
    pub fn new(settings: &TestSettings) -> Result<Self> {
        settings.check_analytic("parcorrwls")?;
        Ok(Self { as_tigramite: settings.as_tigramite })
    }
}

impl CondIndTest for ParCorrWls {
    fn name(&self) -> &'static str {
        "parcorrwls"
    }

    fn is_linear(&self) -> bool {
        true
    }

    fn prepare<'a>(&'a self, samples: &'a Samples<'a>) -> Result<Box<dyn PreparedTest + 'a>> {
        Ok(Box::new(Prepared { samples, as_tigramite: self.as_tigramite }))
    }
}

struct Prepared<'a> {
    samples: &'a Samples<'a>,
    as_tigramite: bool,
}

impl PreparedTest for Prepared<'_> {
    fn run_test(&self, x: Node, y: Node, z: &[Node]) -> Result<TestResult> {
        let LaggedArrays { mut x, mut y, mut z, n_lost } = self.samples.arrays(x, y, z);
        let n_samples = x.len();
        let dof = n_samples.saturating_sub(2 + z.len());
        let size_of_first = if self.as_tigramite {
            Some(1.0)
        } else {
            [&mut x, &mut y].into_iter().chain(&mut z).for_each(|row| {
                standardize(row);
            });
            // The constant.
            z.push(vec![1.0; n_samples]);
            None
        };
        let (mut value, mut p_value) = (0.0, 1.0);
        if dof > 0
            && let (Some(x_left), Some(y_left)) = (left(&x, &z, size_of_first), left(&y, &z, size_of_first))
        {
            value = correlation(&x_left, &y_left);
            p_value = correlation_p_value(value, dof);
        }
        Ok(TestResult::new(value, p_value, n_samples, n_lost))
    }
}

/// What the weighted regression of `row` on `z` leaves, as a row of mean 0 and norm 1; `None` if nothing is left. `size_of_first` is
/// that of the samples before the first window, or `None` for that of the window.
fn left(row: &[f64], z: &[Vec<f64>], size_of_first: Option<f64>) -> Option<Vec<f64>> {
    if is_constant(row) {
        return None;
    }
    let ones = vec![1.0; row.len()];
    let sizes = sizes_of(&residual(row, z, &ones)?, size_of_first);
    let weights: Vec<f64> = sizes.iter().map(|size| 1.0 / size).collect();
    let mut left = residual(row, z, &weights)?;
    standardize(&mut left).then_some(left)
}

/// The residual of `row` on `z`, all weighted; `None` if it is zero up to rounding.
fn residual(row: &[f64], z: &[Vec<f64>], weights: &[f64]) -> Option<Vec<f64>> {
    let weighted = |row: &[f64]| {
        let mut row: Vec<f64> = row.iter().zip(weights).map(|(v, w)| v * w).collect();
        let norm = dot(&row, &row).sqrt();
        (norm > 0.0 && norm.is_finite()).then(|| {
            row.iter_mut().for_each(|v| *v /= norm);
            (row, norm)
        })
    };
    let rows = z.iter().filter_map(|row| weighted(row)).map(|(row, _)| row).collect();
    let (mut row, norm) = weighted(row)?;
    if !orthogonalize(&mut row, &orthonormal_basis(rows)) {
        return None;
    }
    row.iter_mut().for_each(|v| *v *= norm);
    Some(row)
}

/// The size of each residual: the mean of the last [`WINDOW`] absolute values; before there are as many `first`, or the mean of the
/// first ones.
fn sizes_of(residual: &[f64], first: Option<f64>) -> Vec<f64> {
    let mean = residual.iter().map(|v| v.abs()).sum::<f64>() / residual.len() as f64;
    let size = |t: usize| match ((t + 1).checked_sub(WINDOW), first) {
        (None, Some(first)) => first,
        (from, _) => {
            let window = residual[from.unwrap_or(0)..].iter().take(WINDOW);
            window.clone().map(|v| v.abs()).sum::<f64>() / window.len() as f64
        }
    };
    (0..residual.len()).map(|t| size(t).max(SMALLEST * mean)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_follow_the_last_ten_residuals() {
        let residual: Vec<f64> = (0..30).map(|t| if t < 15 { -1.0 } else { 3.0 }).collect();
        let sizes = sizes_of(&residual, None);
        assert_eq!(sizes_of(&residual, Some(5.0))[..10], [5.0, 5.0, 5.0, 5.0, 5.0, 5.0, 5.0, 5.0, 5.0, 1.0]);
        assert_eq!((sizes[0], sizes[8], sizes[9], sizes[14]), (1.0, 1.0, 1.0, 1.0));
        assert!((sizes[19] - 2.0).abs() < 1e-12 && (sizes[29] - 3.0).abs() < 1e-12, "{sizes:?}");
    }

    #[test]
    fn a_variable_that_stands_still_for_a_while_gives_an_answer() {
        let still: Vec<f64> =
            (0..60).map(|t| if t % 30 < 20 { 0.0 } else { f64::from(t % 7) - 3.0 }).collect();
        let left = left(&still, &[], None).expect("something is left");
        assert!(left.iter().all(|v| v.is_finite()));
    }
}
