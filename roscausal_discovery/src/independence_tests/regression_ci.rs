//! Regressions as an independence test: for numbers, categories, and both together.
//!
//! Source: Tsagris, Borboudakis, Lagani and Tsamardinos 2018, International Journal of Data Science and Analytics, "Constraint-based
//! causal discovery with mixed data".
//!
//! 1. The variables that the setting `categories` names are those of categories; where it names none, those with at most ten different
//!    values, all whole. Others are numbers. A category explains by
//!    a column of 0 and 1 for each of its values.
//! 2. Both numbers: by how much X improves the regression of Y on Z, `n ln(RSS without X / RSS with X)`.
//! 3. One a number: the same, with the number as the target.
//! 4. Both categories: the deviance of multinomial regressions ([`super::multinomial`]) of the one with fewer values.
//! 5. P-value: `d` columns of X are not determined by Z (one for a number, one less than its values for a category). Of a number it is
//!    that of the F test of these columns, which is exact for normal noise; of a category with `k` values chi-squared with `d (k - 1)`
//!    degrees of freedom, of the statistic divided by Williams' factor (1976, Biometrika 63:33), which few samples make larger than 1.
//!
//! With `as_tigramite` p-values are chi-squared with one degree of freedom for a number that explains and one per value for a
//! category, and slopes in the units of the data have a price.
//!
//! Example: does a person's speed depend on whether a door is open (0 or 1), given their distance to it?

use super::{
    TestSettings,
    cholesky::{orthogonalize, orthonormal_basis},
    gsquared::{FALSE_LINKS, Sparse, levels},
    multinomial::{Price, deviance},
};
use crate::{
    numeric::{
        beta::f_sf,
        rows::{dot, is_constant, standardize},
        special::chi_squared_sf,
    },
    types::{CondIndTest, DataFrame, LaggedArrays, Node, PreparedTest, Result, Samples, TestResult, names},
};

/// Different values up to which a variable of whole numbers is one of categories.
pub(crate) const MOST_VALUES: usize = 10;
/// Samples for each degree of freedom below which chi-squared finds too much between categories.
pub(crate) const ENOUGH: usize = 30;
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
pub struct RegressionCi {
    as_tigramite: bool,
    categories: Vec<String>,
}

impl RegressionCi {
    /// The test with these settings.
    ///
    /// # Errors
    /// A setting that this test does not have.
    pub fn new(settings: &TestSettings) -> Result<Self> {
        settings.check_analytic("regressionci")?;
        Ok(Self { as_tigramite: settings.as_tigramite, categories: settings.categories.clone() })
    }
}

impl CondIndTest for RegressionCi {
    fn name(&self) -> &'static str {
        "regressionci"
    }

    fn prepare<'a>(&'a self, samples: &'a Samples<'a>) -> Result<Box<dyn PreparedTest + 'a>> {
        let categories = categories(samples.data(), &self.categories);
        Ok(Box::new(Prepared {
            samples,
            categories,
            as_tigramite: self.as_tigramite,
            sparse: Sparse::default(),
        }))
    }
}

/// Whether each variable is one of categories: those `named`; where none is, those with at most ten different values, all whole.
pub(crate) fn categories(data: &DataFrame, named: &[String]) -> Vec<bool> {
    let is_category = |var: usize| {
        let values = data.different_values(var, MOST_VALUES);
        values.len() <= MOST_VALUES && values.iter().all(|v| v.fract() == 0.0)
    };
    let is_named = |var: usize| named.iter().any(|name| names::position(data.var_names(), name) == Some(var));
    (0..data.n_vars()).map(|var| if named.is_empty() { is_category(var) } else { is_named(var) }).collect()
}

struct Prepared<'a> {
    samples: &'a Samples<'a>,
    /// Which variables are categories.
    categories: Vec<bool>,
    as_tigramite: bool,
    sparse: Sparse,
}

impl PreparedTest for Prepared<'_> {
    fn run_test(&self, x: Node, y: Node, z: &[Node]) -> Result<TestResult> {
        let of = |node: Node| self.categories[node.var];
        let LaggedArrays { x: xs, y: ys, z: zs, n_lost } = self.samples.arrays(x, y, z);
        let n_samples = xs.len();
        let (mut value, mut p_value) = (0.0, 1.0);
        if n_samples > 0 && !is_constant(&xs) && !is_constant(&ys) {
            let given: Vec<Vec<f64>> =
                zs.iter().zip(z).flat_map(|(row, node)| columns(row, of(*node), self.as_tigramite)).collect();
            let found = match (of(x), of(y)) {
                (true, true) => self.of_categories(&xs, &ys, &given),
                (true, false) => self.of_number(&ys, (&xs, true), given),
                (false, category) => self.of_number(&xs, (&ys, category), given),
            };
            value = found.0;
            // Without samples to spare nothing is evidence.
            if n_samples > z.len() + 2 {
                p_value = found.1;
            }
        }
        Ok(TestResult::new(value, p_value, n_samples, n_lost))
    }

    fn caution(&self) -> Option<String> {
        self.sparse.caution("regressionci", FALSE_LINKS, ENOUGH)
    }
}

impl Prepared<'_> {
    /// Statistic and p-value where the target is a number, and what explains a category or not.
    fn of_number(&self, target: &[f64], by: (&[f64], bool), given: Vec<Vec<f64>>) -> (f64, f64) {
        let n = target.len();
        let fit = |rows: Vec<Vec<f64>>| {
            let basis = orthonormal_basis(varying(rows));
            let mut left = target.to_vec();
            standardize(&mut left);
            orthogonalize(&mut left, &basis);
            (dot(&left, &left).max(NOTHING_LEFT), basis.len())
        };
        let more = columns(by.0, by.1, self.as_tigramite);
        let (without, rank) = fit(given.clone());
        let (with, rank_with) = fit([given, more].concat());
        let value = (n as f64 * libm::log(without / with)).max(0.0);
        if self.as_tigramite {
            return (value, chi_squared_sf(value, if by.1 { count(by.0) } else { 1 }));
        }
        let (d, dof) = (rank_with - rank, n.saturating_sub(rank_with + 1));
        let f = (without - with) / with * dof as f64 / d.max(1) as f64;
        (value, f_sf(f, d, dof))
    }

    /// Statistic and p-value where both are categories.
    fn of_categories(&self, x: &[f64], y: &[f64], given: &[Vec<f64>]) -> (f64, f64) {
        // Same answer for (X, Y) and (Y, X) where one has fewer values.
        let (target, by) = if count(y) < count(x) { (y, x) } else { (x, y) };
        let (category, n) = (levels(target), count(target));
        let more = [given, &columns(by, true, self.as_tigramite)].concat();
        let gain = |without: &[Vec<f64>], with: &[Vec<f64>], price| {
            (deviance(&category, n, without, price) - deviance(&category, n, with, price)).max(0.0)
        };
        if self.as_tigramite {
            let value = gain(given, &more, Price::Reference);
            return (value, chi_squared_sf(value, count(by)));
        }
        // In a frame in which units do not matter: of deviation 1, each column without what the earlier ones have.
        let frame = |rows: Vec<Vec<f64>>| {
            let mut frame = orthonormal_basis(varying(rows));
            let unit = (target.len() as f64).sqrt();
            frame.iter_mut().flatten().for_each(|v| *v *= unit);
            frame
        };
        let (without, with) = (frame(given.to_vec()), frame(more));
        let value = gain(&without, &with, Price::None);
        let dof = (with.len() - without.len()) * (n - 1);
        self.sparse.count(target.len(), dof, ENOUGH);
        let factor = 1.0 + spread(target) * spread(by) / (6 * target.len() * dof.max(1)) as f64;
        (value, chi_squared_sf(value / factor, dof))
    }
}

fn count(row: &[f64]) -> usize {
    levels(row).iter().max().map_or(0, |most| most + 1)
}

/// The sum over the values of a category of one over its share, less 1: the smallest for values that are equally frequent.
fn spread(row: &[f64]) -> f64 {
    let mut counts = vec![0_usize; count(row)];
    levels(row).into_iter().for_each(|level| counts[level] += 1);
    counts.iter().map(|&of| row.len() as f64 / of as f64).sum::<f64>() - 1.0
}

/// The rows that vary, of mean 0 and norm 1.
fn varying(rows: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    rows.into_iter().filter_map(|mut row| standardize(&mut row).then_some(row)).collect()
}

/// What a variable explains with: itself, or a column for each of its values but the first, which the others determine. The
/// reference has that one too where there are more than two.
fn columns(row: &[f64], category: bool, as_tigramite: bool) -> Vec<Vec<f64>> {
    if !category {
        return vec![row.to_vec()];
    }
    let (levels, n) = (levels(row), count(row));
    let first = if as_tigramite && n != 2 { 0 } else { 1 };
    let column = |value: usize| levels.iter().map(|&level| f64::from(level == value)).collect::<Vec<f64>>();
    (first..n).map(column).collect()
}
