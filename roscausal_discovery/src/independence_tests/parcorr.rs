//! Linear partial correlation, and what it shares with the robust variant.

use std::sync::Mutex;

use super::{
    cholesky::{Factor, correlation, residuals},
    gram::Correlations,
    incomplete::Incomplete,
    parcorr_mult::ParCorrMult,
    resampling::Resampling,
    settings::{Confidence, Significance, TestSettings},
};
use crate::{
    numeric::{
        rows::standardize,
        student_t::{correlation_p_value, quantile},
    },
    types::{CondIndTest, Dummy, Error, LaggedArrays, Node, PreparedTest, Result, Samples, TestResult, lock},
};

/// Linear partial correlation: correlation of the residuals of X and Y after linear regression on Z.
///
/// Take it first: it is by far the fastest test and has the most power where dependence is linear. It misses dependence
/// that has no linear part, such as Y on the square of X.
///
/// P-value: two-sided Student t with `n - 2 - |Z|` degrees of freedom (Fisher 1924, "The distribution of the partial
/// correlation coefficient"). All tests of a run follow from one correlation matrix of the lagged variables; a test is a
/// small Cholesky factorisation. Only where something is missing, where Z is nearly collinear, or where surrogates are asked
/// for does a test go back to the samples.
///
/// ```
/// use roscausal_discovery::{CondIndTest, DataFrame, Node, Samples};
/// use roscausal_discovery::independence_tests::{ParCorr, TestSettings};
///
/// // X and Y both follow Z.
/// let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0) - 0.5;
/// let values = ndarray::Array2::from_shape_fn((300, 3), |(t, k)| noise(3 * t) + if k < 2 { noise(3 * t + 1 + k) } else { 0.0 });
/// let data = DataFrame::new(vec![values], vec!["x".into(), "y".into(), "z".into()])?;
/// let samples = Samples::new(&data, 0);
/// let (x, y, z) = (Node::new(0, 0), Node::new(1, 0), Node::new(2, 0));
/// let test = ParCorr::new(&TestSettings::default())?;
/// let prepared = test.prepare(&samples)?;
/// assert!(prepared.run_test(x, y, &[])?.p_value < 1e-6);
/// assert!(prepared.run_test(x, y, &[z])?.p_value > 0.05);
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct ParCorr {
    linear: Linear,
}

impl ParCorr {
    /// The test with these settings.
    ///
    /// # Errors
    /// A setting that is not allowed.
    pub fn new(settings: &TestSettings) -> Result<Self> {
        Ok(Self { linear: Linear::new(settings)? })
    }
}

impl CondIndTest for ParCorr {
    fn name(&self) -> &'static str {
        "parcorr"
    }

    fn is_linear(&self) -> bool {
        true
    }

    fn prepare<'a>(&'a self, samples: &'a Samples<'a>) -> Result<Box<dyn PreparedTest + 'a>> {
        self.linear.prepare(samples, None)
    }

    fn with_dummies(&self, dummies: &[Dummy]) -> Result<Box<dyn CondIndTest + '_>> {
        let Linear { significance, settings } = &self.linear;
        let is_analytic = *significance == Significance::Analytic && settings.confidence.is_none();
        let reason = "with dummies parcorr has analytic p-values only, and no intervals; leave it out";
        Error::ensure(is_analytic, "significance", || reason)?;
        Ok(Box::new(ParCorrMult::new(self, dummies)))
    }

    fn decides_by_value(&self) -> bool {
        self.linear.significance == Significance::FixedThres
    }
}

/// Transforms each row before the linear test.
pub(crate) type Transform = fn(&mut [f64]);

/// What the partial-correlation tests share: their settings, and the test on prepared samples.
#[derive(Clone, Debug)]
pub(crate) struct Linear {
    pub(crate) significance: Significance,
    settings: TestSettings,
}

impl Linear {
    pub(crate) fn new(settings: &TestSettings) -> Result<Self> {
        settings.check()?;
        let significance = settings.significance.unwrap_or(Significance::Analytic);
        Ok(Self { significance, settings: settings.clone() })
    }

    /// Whether it needs the samples themselves, and not their correlations only.
    fn is_by_samples(&self) -> bool {
        self.significance == Significance::ShuffleTest
            || self.settings.confidence == Some(Confidence::Bootstrap)
    }

    pub(crate) fn prepare<'a>(
        &'a self,
        samples: &'a Samples<'a>,
        transform: Option<Transform>,
    ) -> Result<Box<dyn PreparedTest + 'a>> {
        if samples.len() < 4 {
            return Err(Error::Data(format!(
                "{} samples after a cut-off of {} are too few for a partial correlation: it needs at least 4",
                samples.len(),
                samples.cut_off()
            )));
        }
        let fits = Correlations::fits(samples);
        let incomplete = (fits && transform.is_none() && samples.data().lacks_values_only())
            .then(|| Incomplete::new(samples))
            .transpose()?;
        let shared = if samples.data().is_incomplete() || !fits {
            None
        } else if let Some(transform) = transform {
            Some(Correlations::of_transformed(samples, transform)?)
        } else {
            Some(Correlations::lagged(samples)?)
        };
        Ok(Box::new(Prepared {
            test: self,
            samples,
            transform,
            shared,
            incomplete,
            factors: Mutex::default(),
        }))
    }
}

/// The test on the samples of one run.
struct Prepared<'a> {
    test: &'a Linear,
    samples: &'a Samples<'a>,
    transform: Option<Transform>,
    /// `None` if the samples differ from test to test.
    shared: Option<Correlations>,
    /// The sums from which each test takes its matrix, if values are missing.
    incomplete: Option<Incomplete>,
    /// Factors of the previous tests, one per working thread.
    factors: Mutex<Vec<Workspace>>,
}

#[derive(Default)]
struct Workspace {
    factor: Factor,
    z: Vec<usize>,
}

/// A test from sums of products.
struct Fast {
    /// `None` if X or Y is constant.
    value: Option<f64>,
    n_samples: usize,
    n_lost: usize,
}

/// Rows of one test, standardised, without the constant rows of Z.
struct Rows {
    x: Vec<f64>,
    y: Vec<f64>,
    z: Vec<Vec<f64>>,
    n_samples: usize,
    n_lost: usize,
    /// X or Y is constant.
    constant: bool,
}

impl Prepared<'_> {
    fn rows(&self, x: Node, y: Node, z: &[Node]) -> Rows {
        let LaggedArrays { mut x, mut y, mut z, n_lost } = self.samples.arrays(x, y, z);
        let transform = |row: &mut Vec<f64>| {
            if let Some(transform) = self.transform {
                transform(row);
            }
            standardize(row)
        };
        let n_samples = x.len();
        let constant = n_samples < 2 || !transform(&mut x) || !transform(&mut y);
        z.retain_mut(transform);
        Rows { x, y, z, n_samples, n_lost, constant }
    }

    /// The value from sums of products; `None` if the samples are needed.
    fn fast(&self, x: Node, y: Node, z: &[Node]) -> Result<Option<Fast>> {
        if let Some(sums) = &self.incomplete {
            let nodes: Vec<Node> = [x, y].iter().chain(z).copied().collect();
            let Some(answer) = sums.correlations(&nodes) else { return Ok(None) };
            let others: Vec<usize> = (2..nodes.len()).collect();
            let value = Factor::default().partial_correlation(&answer.correlations, 0, 1, &others);
            let fast =
                |value| Fast { value: Some(value), n_samples: answer.n_samples, n_lost: answer.n_lost };
            return Ok(value.map(fast));
        }
        let Some(r) = &self.shared else { return Ok(None) };
        let fast = |value| Fast { value, n_samples: self.samples.len(), n_lost: 0 };
        let (x, y) = (r.index(x)?, r.index(y)?);
        if r.is_constant(x) || r.is_constant(y) {
            return Ok(Some(fast(None)));
        }
        self.with_workspace(|workspace| {
            r.varying(z, &mut workspace.z)?;
            let value = workspace.factor.partial_correlation(r, x, y, &workspace.z);
            Ok(value.map(|value| fast(Some(value))))
        })
    }

    fn with_workspace<T>(&self, f: impl FnOnce(&mut Workspace) -> T) -> T {
        let pool = || lock(&self.factors);
        let mut workspace = pool().pop().unwrap_or_default();
        let result = f(&mut workspace);
        pool().push(workspace);
        result
    }

    fn analytic_confidence(&self, value: f64, dof: usize) -> (f64, f64) {
        let dof_f = dof as f64;
        let t = value * (dof_f / ((1.0 - value) * (1.0 + value)).max(f64::MIN_POSITIVE)).sqrt();
        let width = quantile(0.5 + 0.5 * self.test.settings.conf_lev, dof);
        let back = |t: f64| (t / (dof_f + t * t).sqrt()).clamp(-1.0, 1.0);
        (back(t - width), back(t + width))
    }
}

impl PreparedTest for Prepared<'_> {
    fn run_test(&self, x: Node, y: Node, z: &[Node]) -> Result<TestResult> {
        let (test, settings, by_samples) = (self.test, &self.test.settings, self.test.is_by_samples());
        let mut rows = None;
        let fast = if by_samples { None } else { self.fast(x, y, z)? };
        let (value, n_samples, n_lost) = match fast {
            Some(Fast { value, n_samples, n_lost }) => (value, n_samples, n_lost),
            None => {
                let mut r = self.rows(x, y, z);
                let (n_samples, n_lost) = (r.n_samples, r.n_lost);
                let value = (!r.constant).then(|| {
                    let z = if by_samples { r.z.clone() } else { std::mem::take(&mut r.z) };
                    let (x_left, y_left) = residuals(r.x.clone(), r.y.clone(), z);
                    let value = correlation(&x_left, &y_left);
                    rows = by_samples.then_some((x_left, y_left, r));
                    value
                });
                (value, n_samples, n_lost)
            }
        };
        let mut result = TestResult::new(0.0, 1.0, n_samples, n_lost);
        // Defined answers: a constant has no dependence, and without degrees of freedom there is no evidence.
        let dof = n_samples.saturating_sub(2 + z.len());
        let Some(value) = value.filter(|_| dof > 0) else {
            result.confidence = settings.confidence.map(|_| (0.0, 0.0));
            return Ok(result);
        };
        result.value = value;
        let mut resampling = Resampling::of(self.samples, settings.seed, x, y, z);
        result.p_value = match (test.significance, &rows) {
            (Significance::ShuffleTest, Some((x, y, _))) => {
                let samples = settings.sig_samples.unwrap_or(500);
                resampling.shuffle_p(x, y, samples, settings.sig_blocklength, value, correlation)?
            }
            (Significance::FixedThres, _) => 1.0,
            _ => correlation_p_value(value, dof),
        };
        result.confidence = match (settings.confidence, rows) {
            (None, _) => None,
            (Some(Confidence::Bootstrap), Some((_, _, r))) => {
                Some(resampling.bootstrap(&r.x, &r.y, &r.z, settings, |x, y, z| {
                    let (mut x, mut y, mut z) = (x, y, z);
                    if !standardize(&mut x) || !standardize(&mut y) {
                        return 0.0;
                    }
                    z.retain_mut(|row| standardize(row));
                    let (x, y) = residuals(x, y, z);
                    correlation(&x, &y)
                })?)
            }
            _ => Some(self.analytic_confidence(value, dof)),
        };
        Ok(result)
    }

    fn with_samples(&self, result: TestResult, n_samples: usize, n_conditions: usize) -> Option<TestResult> {
        let (test, dof) = (self.test, n_samples.saturating_sub(2 + n_conditions));
        if test.is_by_samples() {
            return None;
        }
        if dof == 0 {
            let confidence = test.settings.confidence.map(|_| (0.0, 0.0));
            return Some(TestResult { value: 0.0, p_value: 1.0, confidence, n_samples, ..result });
        }
        let p_value = match test.significance {
            Significance::FixedThres => result.p_value,
            _ => correlation_p_value(result.value, dof),
        };
        let confidence = result.confidence.map(|_| self.analytic_confidence(result.value, dof));
        Some(TestResult { p_value, confidence, n_samples, ..result })
    }

    /// AIC of the standardised target: `n ln(RSS) + 2 (k + 1)` with k parents.
    fn model_selection_score(&self, target: Node, parents: &[Node]) -> Result<f64> {
        let penalty = 2.0 * (parents.len() as f64 + 1.0);
        // Parents that determine the target: the residual is as small as rounding allows.
        let score = |n: usize, left: f64| n as f64 * libm::log(n as f64 * left.max(1e-30)) + penalty;
        if let Some(r) = &self.shared {
            let target = r.index(target)?;
            if r.is_constant(target) {
                return Ok(penalty);
            }
            let left = self.with_workspace(|workspace| {
                r.varying(parents, &mut workspace.z)?;
                Ok::<_, Error>(workspace.factor.residual_variance(r, target, &workspace.z))
            })?;
            if let Some(left) = left {
                return Ok(score(self.samples.len(), left));
            }
        }
        if let Some(sums) = &self.incomplete {
            let nodes: Vec<Node> = [target].iter().chain(parents).copied().collect();
            let others: Vec<usize> = (1..nodes.len()).collect();
            let answer = sums.correlations(&nodes).and_then(|answer| {
                let left = Factor::default().residual_variance(&answer.correlations, 0, &others)?;
                Some(score(answer.n_samples, left))
            });
            if let Some(score) = answer {
                return Ok(score);
            }
        }
        let rows = self.rows(target, target, parents);
        if rows.constant {
            return Ok(penalty);
        }
        let (_, left) = residuals(rows.x, rows.y, rows.z);
        Ok(score(rows.n_samples, left.iter().map(|v| v * v).sum()))
    }

    fn is_cheap(&self) -> bool {
        self.shared.is_some() && !self.test.is_by_samples()
    }
}
