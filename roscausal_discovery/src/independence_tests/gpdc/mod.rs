//! GPDC: distance correlation of the residuals of Gaussian process regressions (Runge et al. 2019, supplement S3):
//! a test for nonlinear dependence with additive noise.

mod blocks;
mod buffer;
mod cores;
mod dense;
mod distance_correlation;
mod factorisation;
mod incomplete;
mod kernel;
mod large;
mod lbfgsb;
mod likelihood;
mod limit_law;
mod line_search;
mod local_model;
mod low_rank;
mod null_law;
mod null_table;
mod plan;
mod preconditioner;
mod process;
mod real;
mod refine;
mod regression;
mod residuals;
mod resources;
mod search;
mod theta;

use std::sync::Arc;

use super::{
    resampling::{Resampling, optimal_block_length},
    settings::{Confidence, GpSearch, Significance, TestSettings},
};
use crate::{
    numeric::rows::{is_constant, standardized},
    types::{
        CondIndTest, Error, LaggedArrays, Named, Node, PreparedTest, Result, Samples, TestResult, unique,
    },
};
use distance_correlation::of_ranks;
use null_table::NullTable;
pub use process::{GpOptimum, GpRegression};
use regression::{GaussianProcess, SearchSettings};
use residuals::{ResidualCache, Residuals};
use resources::Resources;

/// Distance correlation of the ranks of two series, in `[0, 1]`, and its p-value if both are series of independent samples. 0 and 1
/// where one is constant.
pub(crate) fn dependence(x: &[f64], y: &[f64]) -> (f64, f64) {
    if is_constant(x) || is_constant(y) || x.len() != y.len() {
        return (0.0, 1.0);
    }
    let (x, y) = (distance_correlation::ranks(x), distance_correlation::ranks(y));
    let value = of_ranks(&x, &y);
    (value, null_law::p_value(&x, &y, value))
}

/// The p-value of [`dependence`].
pub(crate) fn tail_dependence(x: &[f64], y: &[f64]) -> f64 {
    dependence(x, y).1
}

/// What GPDC's regression of `target` on `conditions` leaves, in deviations of the target; `target` without conditions. None may be
/// constant.
///
/// # Errors
/// Fewer than five samples, matrices larger than the settings allow, or those of `check`.
pub(crate) fn gp_residuals(
    target: &[f64],
    conditions: &[&[f64]],
    settings: &TestSettings,
    check: &dyn Fn() -> Result<()>,
) -> Result<Vec<f64>> {
    check_samples(target.len())?;
    if conditions.is_empty() {
        return Ok(target.to_vec());
    }
    let resources = Gpdc { settings: settings.clone() }.resources(target.len())?;
    let rows: Vec<Vec<f64>> = conditions.iter().map(|row| standardized(row)).collect();
    let process = GaussianProcess::new(&rows, &resources);
    Ok(Residuals::new(target, Some(&process), &SearchSettings::of(settings), true, check)?.values)
}

/// Samples below which a test is refused.
const FEWEST_SAMPLES: usize = 5;
/// Pairs of uniform series in the reference's table of null values.
const DEFAULT_TABLE: usize = 500;
/// Bytes for large matrices where the settings give no bound.
const DEFAULT_MEMORY: usize = 900 << 20;

/// Bytes for large matrices.
fn memory_of(settings: &TestSettings) -> usize {
    settings.max_memory.map_or(DEFAULT_MEMORY, |bytes| usize::try_from(bytes).unwrap_or(usize::MAX))
}

/// GPDC and its settings: the test for links that are not linear, on up to some ten thousand samples.
///
/// It assumes additive noise and conditions whose effect is smooth; where links may depend on the conditions in other ways take
/// [`super::CmiKnn`], where they are linear [`super::ParCorr`], which is a thousand times faster. Source: Runge et al. 2019,
/// supplement S3.
///
/// Without conditions the two series are compared as they are. With conditions, X and Y are each replaced by their
/// residuals from a Gaussian process regression on Z. Both become ranks; the value is their distance correlation, in
/// `[0, 1]`. Of several maxima of a regression's likelihood the one counts that L-BFGS-B reaches from `l = s = 1`.
///
/// ```
/// use ndarray::Array2;
/// use roscausal_discovery::{
///     CondIndTest, DataFrame, Node, PreparedTest, Samples,
///     independence_tests::{Gpdc, TestSettings},
/// };
///
/// // `b` is the square of `a`, with noise: no correlation, and yet a link.
/// let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0) - 0.5;
/// let values = Array2::from_shape_fn((200, 2), |(t, k)| if k == 0 { noise(t) } else { noise(t).powi(2) + 0.1 * noise(t + 500) });
/// let data = DataFrame::new(vec![values], vec!["a".into(), "b".into()])?;
/// let samples = Samples::new(&data, 0);
/// let test = Gpdc::new(&TestSettings::default())?;
/// let result = test.prepare(&samples)?.run_test(Node::new(0, 0), Node::new(1, 0), &[])?;
/// assert!(result.p_value < 0.01);
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Gpdc {
    settings: TestSettings,
}

impl Gpdc {
    /// The test with `settings`: `significance` (`analytic`, the default: the law of independent ranks; from `null_distributions` where
    /// they have the number of samples; from a table of `sig_samples` random pairs if that is given, and of 500 with `as_tigramite`.
    /// `shuffle_test`: of the residuals; or `fixed_thres`), `confidence` (`bootstrap`: each sample is regressed anew), `seed`,
    /// `max_memory`.
    ///
    /// # Errors
    /// A setting that the test does not allow.
    pub fn new(settings: &TestSettings) -> Result<Self> {
        Error::ensure(settings.sig_samples != Some(0), "sig_samples", || "must be at least 1 (default 500)")?;
        let reason = "gpdc has no analytic interval; use bootstrap";
        Error::ensure(settings.confidence != Some(Confidence::Analytic), "confidence", || reason)?;
        Ok(Self { settings: settings.clone() })
    }

    fn significance(&self) -> Significance {
        self.settings.significance.unwrap_or(Significance::Analytic)
    }

    fn sig_samples(&self) -> usize {
        self.settings.sig_samples.unwrap_or(DEFAULT_TABLE)
    }

    /// What the tests share; refuses what would not fit into memory.
    fn resources(&self, n: usize) -> Result<Arc<Resources>> {
        let threads = rayon::current_num_threads();
        let needed = GaussianProcess::bytes(n, threads, self.settings.gp_search);
        match self.settings.max_memory {
            Some(allowed) if needed as u64 > allowed => Err(Error::param(
                "max_memory",
                format!(
                    "gpdc on {n} samples with {threads} threads may need {} MB and {} MB are allowed; use fewer \
                     samples or threads, allow more, or take the test parcorr or robustparcorr",
                    needed.div_ceil(1 << 20),
                    allowed >> 20
                ),
            )),
            _ => Ok(Resources::new(memory_of(&self.settings))),
        }
    }
}

/// Bytes that one test on `n` samples needs at the least.
pub(crate) fn bytes(n: usize) -> usize {
    GaussianProcess::bytes(n, 1, GpSearch::Default)
}

impl CondIndTest for Gpdc {
    fn name(&self) -> &'static str {
        "gpdc"
    }

    fn prepare<'a>(&'a self, samples: &'a Samples<'a>) -> Result<Box<dyn PreparedTest + 'a>> {
        let n = samples.len();
        check_samples(n)?;
        let resources = self.resources(n)?;
        Ok(Box::new(PreparedGpdc { test: self, samples, resources, residuals: ResidualCache::default() }))
    }

    fn decides_by_value(&self) -> bool {
        self.significance() == Significance::FixedThres
    }
}

/// GPDC on the samples of one run.
struct PreparedGpdc<'a> {
    test: &'a Gpdc,
    samples: &'a Samples<'a>,
    resources: Arc<Resources>,
    residuals: ResidualCache,
}

impl PreparedTest for PreparedGpdc<'_> {
    fn run_test(&self, x: Node, y: Node, z: &[Node]) -> Result<TestResult> {
        // In one order, each once: a regression does not depend on the order of its conditions but for rounding.
        let z = unique(z.to_vec());
        let arrays = self.samples.arrays(x, y, &z);
        let n = arrays.x.len();
        let mut result = TestResult::new(0.0, 1.0, n, arrays.n_lost);
        if n < FEWEST_SAMPLES {
            return Ok(TestResult { n_samples: 0, ..result });
        }
        if is_constant(&arrays.x) || is_constant(&arrays.y) {
            return Ok(result);
        }
        let [of_x, of_y] = self.pair(x, y, &z, &arrays)?;
        result.value = of_ranks(&of_x.ranks, &of_y.ranks);
        let settings = &self.test.settings;
        let mut resampling = Resampling::of(self.samples, settings.seed, x, y, &z);
        match self.test.significance() {
            Significance::Analytic => {
                let given = settings.null_distributions.as_ref();
                let given = given.and_then(|given| given.share_above(n, result.value));
                let pairs = settings.sig_samples.or(settings.as_tigramite.then_some(DEFAULT_TABLE));
                result.p_value = match (given, pairs) {
                    (Some(p_value), _) => p_value,
                    (_, Some(pairs)) => NullTable::get(n, pairs, settings.seed).share_above(result.value),
                    _ => null_law::p_value(&of_x.ranks, &of_y.ranks, result.value),
                };
            }
            Significance::ShuffleTest => {
                let length =
                    settings.sig_blocklength.unwrap_or_else(|| optimal_block_length(&[&of_x.values]));
                let double = |ranks: &[u32]| ranks.iter().map(|&rank| f64::from(rank)).collect::<Vec<_>>();
                let statistic = |x: &[f64], _: &[f64]| {
                    of_ranks(&x.iter().map(|&rank| rank as u32).collect::<Vec<_>>(), &of_y.ranks)
                };
                let (samples, x) = (self.test.sig_samples(), double(&of_x.ranks));
                result.p_value =
                    resampling.shuffle_p(&x, &x, samples, Some(length), result.value, statistic)?;
            }
            Significance::FixedThres => {}
        }
        if settings.confidence.is_some() {
            let check = || self.samples.control().check();
            let value = |x: Vec<f64>, y: Vec<f64>, z: Vec<Vec<f64>>| {
                if is_constant(&x) || is_constant(&y) {
                    return Ok::<f64, Error>(0.0);
                }
                let process = self.regression(&z);
                let ranks =
                    |values: &[f64]| Residuals::new(values, process.as_ref(), &self.how(), false, &check);
                Ok(of_ranks(&ranks(&x)?.ranks, &ranks(&y)?.ranks))
            };
            // A bootstrap sample fails only when the run is cancelled, which `bootstrap` notices as well.
            let value = |x, y, z| value(x, y, z).unwrap_or(0.0);
            result.confidence = Some(resampling.bootstrap(&arrays.x, &arrays.y, &arrays.z, settings, value)?);
            check()?;
        }
        Ok(result)
    }

    fn model_selection_score(&self, target: Node, parents: &[Node]) -> Result<f64> {
        let z = unique(parents.to_vec());
        let arrays = self.samples.arrays(target, target, &z);
        check_samples(arrays.x.len())?;
        let [target, _] = self.pair(target, target, &z, &arrays)?;
        Ok(-target.log_likelihood)
    }

    fn remark(&self, effect: Node, parents: &[Node]) -> Result<Option<String>> {
        let z = unique(parents.to_vec());
        let arrays = self.samples.arrays(effect, effect, &z);
        let Some(process) = self.regression(&arrays.z) else { return Ok(None) };
        if is_constant(&arrays.x) || arrays.x.len() < FEWEST_SAMPLES {
            return Ok(None);
        }
        let [found, _] = self.pair(effect, effect, &z, &arrays)?;
        let Some(theta) = found.theta else { return Ok(None) };
        let check = || self.samples.control().check();
        let better =
            process.better_elsewhere(&standardized(&arrays.x), theta, found.log_likelihood, &check)?;
        let name = |node: &Node| self.samples.data().var_names()[node.var].clone();
        Ok(better.map(|(_, log_likelihood)| {
            let causes: Vec<String> = z.iter().map(|node| format!("{}(t-{})", name(node), node.lag)).collect();
            format!(
                "the Gaussian process of {} on {} has several optima; the result depends on which is found, and a better one is near \
                 (log likelihood {log_likelihood:.1} instead of {:.1}): {} 10 looks for it",
                name(&effect),
                causes.join(", "),
                found.log_likelihood,
                Named("gp_restarts")
            )
        }))
    }

    fn caution(&self) -> Option<String> {
        let [all, _, by_few] = self.residuals.counts();
        (by_few > 0).then(|| {
            format!(
                "{by_few} of {all} Gaussian processes rest on 1000 of the samples, or on one of two equal fits; {} exact uses \
                 all samples, and may find other links",
                Named("gp_search")
            )
        })
    }

    fn effort(&self) -> Option<String> {
        let [all, twice, _] = self.residuals.counts();
        (all > 0).then(|| {
            format!("gpdc: {all} regressions; the path of {twice} was searched again with tight likelihoods")
        })
    }
}

impl PreparedGpdc<'_> {
    /// Residuals of X and Y.
    fn pair(&self, x: Node, y: Node, z: &[Node], arrays: &LaggedArrays) -> Result<[Arc<Residuals>; 2]> {
        let process = self.regression(&arrays.z);
        let keep_values = self.test.significance() == Significance::ShuffleTest;
        let check = || self.samples.control().check();
        let of = |node: Node, values: &[f64]| {
            let make = || Residuals::new(values, process.as_ref(), &self.how(), keep_values, &check);
            // With samples left out, another test of the same node and conditions may have other samples.
            if arrays.n_lost == 0 { self.residuals.get(node, z, make) } else { make().map(Arc::new) }
        };
        let (x, y) = rayon::join(|| of(x, &arrays.x), || of(y, &arrays.y));
        Ok([x?, y?])
    }

    fn how(&self) -> SearchSettings {
        SearchSettings::of(&self.test.settings)
    }

    /// The regression on `conditions`, those that are constant left out; `None` without any.
    fn regression(&self, conditions: &[Vec<f64>]) -> Option<GaussianProcess> {
        let rows: Vec<Vec<f64>> =
            conditions.iter().filter(|row| !is_constant(row)).map(|row| standardized(row)).collect();
        (!rows.is_empty()).then(|| GaussianProcess::new(&rows, &self.resources))
    }
}

fn check_samples(n: usize) -> Result<()> {
    Error::ensure_data(n >= FEWEST_SAMPLES, || {
        format!("gpdc has {n} complete samples and needs at least {FEWEST_SAMPLES}; record more")
    })
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::{super::by_name, *};
    use crate::types::DataFrame;

    /// Columns 0 and 1 depend on column 2; column 3 on column 0.
    fn data(n: usize) -> DataFrame {
        let mut rng = crate::numeric::pcg64::Pcg64::new(5);
        let mut values = Array2::zeros((n, 4));
        for mut row in values.rows_mut() {
            let mut noise = || rng.next_f64() - 0.5;
            row[2] = 3.0 * noise();
            row[0] = row[2].sin() + 0.5 * noise();
            row[1] = row[2] * row[2] + 0.5 * noise();
            row[3] = row[0] + 0.2 * noise();
        }
        DataFrame::new(vec![values], ["a", "b", "c", "d"].map(String::from).to_vec()).unwrap()
    }

    fn run(settings: &TestSettings, x: usize, y: usize, z: &[usize]) -> Result<TestResult> {
        let data = data(120);
        let samples = Samples::new(&data, 0);
        let test = by_name("GPDC", settings)?;
        let nodes: Vec<Node> = z.iter().map(|&var| Node::new(var, 0)).collect();
        test.prepare(&samples)?.run_test(Node::new(x, 0), Node::new(y, 0), &nodes)
    }

    #[test]
    fn a_common_cause_is_explained_away_and_a_link_is_not() {
        for significance in [Significance::Analytic, Significance::ShuffleTest] {
            let settings = TestSettings { significance: Some(significance), ..TestSettings::default() };
            assert!(run(&settings, 1, 2, &[]).unwrap().p_value < 0.01);
            assert!(run(&settings, 0, 1, &[2]).unwrap().p_value > 0.05);
            assert!(run(&settings, 0, 3, &[2]).unwrap().p_value < 0.01);
        }
    }

    #[test]
    fn the_order_of_conditions_does_not_matter() {
        let settings = TestSettings::default();
        assert_eq!(run(&settings, 0, 1, &[2, 3]).unwrap(), run(&settings, 0, 1, &[3, 2, 3]).unwrap());
    }

    #[test]
    fn a_bootstrap_interval_is_ordered_and_inside_the_range() {
        let settings = TestSettings {
            confidence: Some(Confidence::Bootstrap),
            conf_samples: 10,
            ..TestSettings::default()
        };
        let (low, high) = run(&settings, 0, 3, &[2]).unwrap().confidence.unwrap();
        assert!(0.0 <= low && low <= high && high <= 1.0);
    }

    #[test]
    fn too_little_memory_is_refused_with_advice() {
        let settings = TestSettings { max_memory: Some(1000), ..TestSettings::default() };
        let message = run(&settings, 0, 1, &[2]).unwrap_err().to_string();
        assert!(message.contains("max_memory") && message.contains("parcorr"), "{message}");
    }

    #[test]
    fn a_constant_is_independent_of_everything() {
        let data = DataFrame::new(
            vec![Array2::from_shape_fn((30, 2), |(t, k)| if k == 0 { 1.0 } else { t as f64 })],
            vec!["a".into(), "b".into()],
        )
        .unwrap();
        let samples = Samples::new(&data, 0);
        let test = Gpdc::new(&TestSettings::default()).unwrap();
        let prepared = test.prepare(&samples).unwrap();
        let result = prepared.run_test(Node::new(0, 0), Node::new(1, 0), &[]).unwrap();
        assert_eq!((result.value, result.p_value), (0.0, 1.0));
        // A constant condition is none.
        let with = prepared.run_test(Node::new(1, 0), Node::new(1, 0), &[Node::new(0, 0)]).unwrap();
        assert!((with.value - 1.0).abs() < 1e-15);
    }

    #[test]
    fn a_regression_scores_better_than_none() {
        let data = data(80);
        let samples = Samples::new(&data, 0);
        let test = Gpdc::new(&TestSettings::default()).unwrap();
        let prepared = test.prepare(&samples).unwrap();
        let score = |parents: &[Node]| prepared.model_selection_score(Node::new(1, 0), parents).unwrap();
        assert!(score(&[Node::new(2, 0)]) < score(&[Node::new(3, 0)]));
        assert_eq!(score(&[]), f64::INFINITY);
    }
}
