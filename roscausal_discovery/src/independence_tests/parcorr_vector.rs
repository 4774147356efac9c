//! Partial correlation of vectors: linear dependence of variables of several columns.
//!
//! Source: the test of Günther, Ninad and Runge 2023, UAI, for variables of several components.
//!
//! 1. Every component of X and of Y is regressed on all components of Z.
//! 2. The value is the correlation of the largest size between what is left of a component of X and one of Y, the first one on ties.
//! 3. P-value: Student's t with `n` minus the number of all components, times the number of pairs of components; 1 at most.
//!
//! Example: a place `(x, y)` and a speed that follows `y`: the value is the correlation of the speed with `y`, the p-value twice that
//! of this correlation.

use super::{
    ParCorr, TestSettings,
    cholesky::{correlation, orthogonalize, orthonormal_basis},
};
use crate::{
    numeric::{rows::standardize, student_t::correlation_p_value},
    types::{Components, CondIndTest, Node, PreparedTest, Result, Samples, TestResult},
};

/// Partial correlation of variables that may have several components.
///
/// Take it where some variables are vectors, such as a place or a velocity, and dependence is linear. Of variables of one column each
/// it is [`ParCorr`].
///
/// ```
/// use roscausal_discovery::{CondIndTest, DataFrame, Node, Samples};
/// use roscausal_discovery::independence_tests::{ParCorrVector, TestSettings};
///
/// // Speed follows the second component of the place.
/// let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0) - 0.5;
/// let values = ndarray::Array2::from_shape_fn((100, 3), |(t, k)| match k {
///     2 => noise(2 * t + 1) + 0.2 * noise(t + 500),
///     k => noise(2 * t + k),
/// });
/// let data = DataFrame::new(vec![values], ["x", "y", "speed"].map(String::from).to_vec())?;
/// let data = data.with_vectors(&[("place".to_owned(), vec![0, 1])])?;
/// let test = ParCorrVector::new(&TestSettings::default())?;
/// let samples = Samples::new(&data, 0);
/// let result = test.prepare(&samples)?.run_test(Node::new(0, 0), Node::new(1, 0), &[])?;
/// assert!(result.value > 0.9 && result.p_value < 1e-9);
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct ParCorrVector {
    plain: ParCorr,
}

impl ParCorrVector {
    /// The test with these settings.
    ///
    /// # Errors
    /// A setting that this test does not have.
    pub fn new(settings: &TestSettings) -> Result<Self> {
        settings.check_analytic("parcorrmult")?;
        Ok(Self { plain: ParCorr::new(settings)? })
    }
}

impl CondIndTest for ParCorrVector {
    fn name(&self) -> &'static str {
        "parcorrmult"
    }

    fn is_linear(&self) -> bool {
        true
    }

    fn supports_vectors(&self) -> bool {
        true
    }

    fn prepare<'a>(&'a self, samples: &'a Samples<'a>) -> Result<Box<dyn PreparedTest + 'a>> {
        match samples.data().has_vectors() {
            true => Ok(Box::new(Prepared { samples })),
            false => self.plain.prepare(samples),
        }
    }
}

struct Prepared<'a> {
    samples: &'a Samples<'a>,
}

impl PreparedTest for Prepared<'_> {
    fn run_test(&self, x: Node, y: Node, z: &[Node]) -> Result<TestResult> {
        let Components { x, y, z, n_samples, n_lost } = self.samples.components(x, y, z);
        let n_pairs = x.len() * y.len();
        let dof = n_samples.saturating_sub(x.len() + y.len() + z.len());
        let (mut value, mut p_value) = (0.0_f64, 1.0);
        if dof > 0 {
            let z = z.into_iter().filter_map(scaled).collect();
            let basis = orthonormal_basis(z);
            let left = |rows: Vec<Vec<f64>>| -> Vec<Vec<f64>> {
                let rows = rows.into_iter().filter_map(scaled);
                rows.filter_map(|mut row| orthogonalize(&mut row, &basis).then_some(row)).collect()
            };
            let (x, y) = (left(x), left(y));
            for of_pair in x.iter().flat_map(|x| y.iter().map(|y| correlation(x, y))) {
                if of_pair.abs() > value.abs() {
                    value = of_pair;
                }
            }
            p_value = (correlation_p_value(value, dof) * n_pairs as f64).min(1.0);
        }
        Ok(TestResult::new(value, p_value, n_samples, n_lost))
    }
}

/// A row with mean 0 and norm 1; `None` if it is constant.
fn scaled(mut row: Vec<f64>) -> Option<Vec<f64>> {
    standardize(&mut row).then_some(row)
}
