//! Regressions as an independence test: for numbers, categories, and both together.
//!
//! Source: Tsagris, Borboudakis, Lagani and Tsamardinos 2018, International Journal of Data Science and Analytics, "Constraint-based
//! causal discovery with mixed data".
//!
//! 1. A variable with at most ten different values, all whole, is one of categories; others are numbers. A category explains by
//!    a column of 0 and 1 for each of its values.
//! 2. Both numbers: by how much X improves the regression of Y on Z, `n ln(RSS without X / RSS with X)`.
//! 3. One a number: the same, with the number as the target.
//! 4. Both categories: the deviance of multinomial regressions ([`super::multinomial`]) of the one with fewer values.
//! 5. P-value: chi-squared, with one degree of freedom for a number that explains, and one per value for a category (as the
//!    reference counts; one less would be the textbook's, so this is a little cautious).
//!
//! Example: does a person's speed depend on whether a door is open (0 or 1), given her distance to it?

use super::{
    Significance, TestSettings,
    cholesky::{orthogonalize, orthonormal_basis},
    gsquared::levels,
    multinomial::deviance,
};
use crate::{
    ground::{CondIndTest, Error, LaggedArrays, Node, PreparedTest, Result, Samples, TestResult},
    numeric::{
        rows::{dot, is_constant, standardize},
        special::chi_squared_sf,
    },
};

/// Different values up to which a variable of whole numbers is one of categories.
const MOST_VALUES: usize = 10;
/// Part of the variance that rounding leaves of a perfect fit.
const NOTHING_LEFT: f64 = 1e-20;

/// Likelihood-ratio test of regressions, for data with numbers and categories.
///
/// Take it where some variables are categories, such as a door that is open or not, and others are numbers. Effects of numbers
/// are linear. With numbers alone it is [`ParCorr`](super::ParCorr) with another scale; with categories alone take
/// [`Gsquared`](super::Gsquared).
///
/// ```
/// use roscausal_discovery::{CondIndTest, DataFrame, Node, Samples};
/// use roscausal_discovery::independence_tests::{RegressionCi, TestSettings};
///
/// let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0) - 0.5;
/// // The door is open in every third sample; the speed is higher then.
/// let open = |t: usize| f64::from(u8::from(t % 3 == 0));
/// let values = ndarray::Array2::from_shape_fn((150, 2), |(t, k)| if k == 0 { open(t) } else { open(t) + noise(t) });
/// let data = DataFrame::new(vec![values], vec!["open".into(), "speed".into()])?;
/// let samples = Samples::new(&data, 0);
/// let test = RegressionCi::new(&TestSettings::default())?;
/// assert!(test.prepare(&samples)?.run_test(Node::new(0, 0), Node::new(1, 0), &[])?.p_value < 1e-6);
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct RegressionCi;

impl RegressionCi {
    /// The test with these settings.
    ///
    /// # Errors
    /// A setting that this test does not have.
    pub fn new(settings: &TestSettings) -> Result<Self> {
        match (settings.significance, settings.confidence) {
            (None | Some(Significance::Analytic), None) => Ok(Self),
            (_, Some(_)) => Err(Error::param("confidence", "regressionci has none; leave it out")),
            _ => {
                let reason = "regressionci has analytic p-values only; choose 'analytic'";
                Err(Error::param("significance", reason))
            }
        }
    }
}

impl CondIndTest for RegressionCi {
    fn name(&self) -> &'static str {
        "regressionci"
    }

    fn prepare<'a>(&'a self, samples: &'a Samples<'a>) -> Result<Box<dyn PreparedTest + 'a>> {
        let data = samples.data();
        let is_category = |var: usize| {
            let values = || data.recordings().iter().flat_map(move |r| r.column(var).to_vec());
            let mut seen: Vec<f64> = Vec::new();
            values().filter(|v| !v.is_nan()).all(|v| {
                if !seen.contains(&v) {
                    seen.push(v);
                }
                v.fract() == 0.0 && seen.len() <= MOST_VALUES
            })
        };
        let categories = (0..data.n_vars()).map(is_category).collect();
        Ok(Box::new(Prepared { samples, categories }))
    }
}

struct Prepared<'a> {
    samples: &'a Samples<'a>,
    /// Which variables are categories.
    categories: Vec<bool>,
}

impl PreparedTest for Prepared<'_> {
    fn run_test(&self, x: Node, y: Node, z: &[Node]) -> Result<TestResult> {
        let of = |node: Node| self.categories[node.var];
        let LaggedArrays { x: xs, y: ys, z: zs, n_lost } = self.samples.arrays(x, y, z);
        let n_samples = xs.len();
        let (mut value, mut p_value) = (0.0, 1.0);
        if n_samples > 0 && !is_constant(&xs) && !is_constant(&ys) {
            let given: Vec<Vec<f64>> =
                zs.iter().zip(z).flat_map(|(row, node)| columns(row, of(*node))).collect();
            let dof;
            (value, dof) = match (of(x), of(y)) {
                (true, true) => of_categories(&xs, &ys, &given),
                (true, false) => of_number(&ys, &columns(&xs, true), count(&xs), given),
                (false, categories) => {
                    let n = if categories { count(&ys) } else { 1 };
                    of_number(&xs, &columns(&ys, categories), n, given)
                }
            };
            // Without samples to spare nothing is evidence.
            if n_samples > z.len() + 2 {
                p_value = chi_squared_sf(value, dof);
            }
        }
        Ok(TestResult { value, p_value, confidence: None, n_samples, n_lost, dependent: None })
    }
}

fn count(row: &[f64]) -> usize {
    levels(row).iter().max().map_or(0, |most| most + 1)
}

/// What a variable explains with: itself, or a column for each of its values. Two values are one column.
fn columns(row: &[f64], category: bool) -> Vec<Vec<f64>> {
    if !category {
        return vec![row.to_vec()];
    }
    let (levels, n) = (levels(row), count(row));
    let first = if n == 2 { 1 } else { 0 };
    let column =
        |value: usize| levels.iter().map(|&level| f64::from(u8::from(level == value))).collect::<Vec<f64>>();
    (first..n).map(column).collect()
}

/// The statistic where the target is a number.
fn of_number(target: &[f64], by: &[Vec<f64>], dof: usize, given: Vec<Vec<f64>>) -> (f64, usize) {
    let n = target.len() as f64;
    let varying = |rows: Vec<Vec<f64>>| {
        let rows = rows.into_iter().filter_map(|mut row| standardize(&mut row).then_some(row));
        rows.collect::<Vec<_>>()
    };
    let rss = |rows: Vec<Vec<f64>>| {
        let mut left = target.to_vec();
        standardize(&mut left);
        orthogonalize(&mut left, &orthonormal_basis(rows));
        dot(&left, &left).max(NOTHING_LEFT)
    };
    let mut rows = varying(given);
    let without = rss(rows.clone());
    rows.extend(varying(by.to_vec()));
    ((n * (without / rss(rows)).ln()).max(0.0), dof)
}

/// The statistic where both are categories.
fn of_categories(x: &[f64], y: &[f64], given: &[Vec<f64>]) -> (f64, usize) {
    // Same answer for (X, Y) and (Y, X) where one has fewer values.
    let (target, by) = if count(y) < count(x) { (y, x) } else { (x, y) };
    let (category, n) = (levels(target), count(target));
    let more = [given, &columns(by, true)].concat();
    ((deviance(&category, n, given) - deviance(&category, n, &more)).max(0.0), count(by))
}
