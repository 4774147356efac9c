//! What an independence test is.

use super::{
    error::{Error, Result},
    node::Node,
    samples::Samples,
};

/// The result of one test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TestResult {
    /// Strength of the dependence. Its range and sign depend on the test.
    pub value: f64,
    /// P-value in `[0, 1]`.
    pub p_value: f64,
    /// Confidence interval of `value`, if the settings ask for one.
    pub confidence: Option<(f64, f64)>,
    /// Samples used; 0 if the test has no answer.
    pub n_samples: usize,
    /// Samples left out because one of the nodes was missing or masked.
    pub n_lost: usize,
    /// The decision, if the test does not decide by the p-value (`fixed_thres`). The run fills it in.
    pub dependent: Option<bool>,
}

/// Samples of one test.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SampleCount {
    /// Samples that it used; 0 if it has no answer.
    pub used: usize,
    /// Samples that it left out because a value was missing or masked.
    pub lost: usize,
}

impl TestResult {
    /// A result without an interval, decided by its p-value.
    pub(crate) fn new(value: f64, p_value: f64, n_samples: usize, n_lost: usize) -> Self {
        Self { value, p_value, confidence: None, n_samples, n_lost, dependent: None }
    }
    /// Its samples.
    pub fn samples(&self) -> SampleCount {
        SampleCount { used: self.n_samples, lost: self.n_lost }
    }
}

/// A conditional independence test: its name and settings.
///
/// A test of your own needs two types: its settings, and what it makes of the samples of one run.
///
/// ```
/// use roscausal_discovery::{CondIndTest, Node, PreparedTest, Result, Samples, TestResult};
///
/// /// Says "dependent" when the signs of X and Y agree more often than not; it knows no conditions.
/// struct Signs;
///
/// impl CondIndTest for Signs {
///     fn name(&self) -> &'static str {
///         "signs"
///     }
///
///     fn prepare<'a>(&'a self, samples: &'a Samples<'a>) -> Result<Box<dyn PreparedTest + 'a>> {
///         Ok(Box::new(OnSamples(samples)))
///     }
/// }
///
/// struct OnSamples<'a>(&'a Samples<'a>);
///
/// impl PreparedTest for OnSamples<'_> {
///     fn run_test(&self, x: Node, y: Node, _z: &[Node]) -> Result<TestResult> {
///         let arrays = self.0.arrays(x, y, &[]);
///         let n = arrays.x.len();
///         let agree = arrays.x.iter().zip(&arrays.y).filter(|(x, y)| (**x > 0.0) == (**y > 0.0)).count();
///         let value = 2.0 * agree as f64 / n as f64 - 1.0;
///         // Hoeffding's bound on the p-value.
///         let p_value = (2.0 * (-0.5 * n as f64 * value * value).exp()).min(1.0);
///         Ok(TestResult { value, p_value, confidence: None, n_samples: n, n_lost: arrays.n_lost, dependent: None })
///     }
/// }
///
/// # use roscausal_discovery::{Control, DataFrame, methods::{PcmciSettings, run_pcmci}};
/// # let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0) - 0.5;
/// # let values = ndarray::Array2::from_shape_fn((200, 2), |(t, k)| noise(if k == 0 { t } else { t.wrapping_sub(1) }));
/// # let data = DataFrame::new(vec![values], vec!["a".into(), "b".into()])?;
/// let result = run_pcmci(&data, &Signs, &PcmciSettings::default(), &Control::default())?;
/// assert!(result.graph[[0, 1, 1]].is_link());
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
pub trait CondIndTest: Send + Sync {
    /// The name by which users choose the test, such as `parcorr`.
    fn name(&self) -> &'static str;

    /// Prepares the test for the samples of one run.
    ///
    /// # Errors
    /// If there are too few samples, or they do not suit the test.
    fn prepare<'a>(&'a self, samples: &'a Samples<'a>) -> Result<Box<dyn PreparedTest + 'a>>;

    /// Whether the decision is `|value| >= threshold` (`fixed_thres`; without the bars if the test is one-sided), where the threshold is the significance
    /// level of the run. The run then sets the p-value to 0 (dependent) or 1; the test itself leaves it at 1.
    fn decides_by_value(&self) -> bool {
        false
    }

    /// Whether only large values are evidence, so that such a threshold is compared with the value itself: estimates of information
    /// may be below 0, which says no more than 0 does.
    fn is_one_sided(&self) -> bool {
        false
    }

    /// Whether the test sees linear (or monotone) dependence only. F-PCMCI's filter then looks for no more.
    fn is_linear(&self) -> bool {
        false
    }

    /// Whether the test looks at all components of variables that have several ([`DataFrame::with_vectors`](super::DataFrame::with_vectors)).
    fn supports_vectors(&self) -> bool {
        false
    }

    /// The same test for data with dummies: their nodes come after the variables of the data, in this order. Default: there is
    /// none.
    ///
    /// # Errors
    /// If the test judges numbers only.
    fn with_dummies(&self, _dummies: &[Dummy]) -> Result<Box<dyn CondIndTest + '_>> {
        let reason = format!(
            "{} cannot judge which recording a sample is of; take parcorr, or leave the dummy out",
            self.name()
        );
        Err(Error::param("test", reason))
    }
}

/// A variable that is not a column of the data: it tells where a sample is from, and stands for all that differs there and was not
/// recorded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Dummy {
    /// Which step of its recording a sample is.
    Time,
    /// Which recording a sample is from.
    Space,
}

/// A test on the samples of one run.
pub trait PreparedTest: Sync {
    /// Tests `x _||_ y | z`.
    ///
    /// # Errors
    /// If too few complete samples are left for this condition set.
    fn run_test(&self, x: Node, y: Node, z: &[Node]) -> Result<TestResult>;

    /// The same result if it rested on `n_samples` independent samples, as many as count where its samples are not; `None` (the
    /// default): the test cannot say, and is asked again on fewer samples.
    fn with_samples(
        &self,
        _result: TestResult,
        _n_samples: usize,
        _n_conditions: usize,
    ) -> Option<TestResult> {
        None
    }

    /// Model-selection score of `target` given `parents`, for choosing `pc_alpha`. Lower is better.
    ///
    /// # Errors
    /// If the test has no such score (the default).
    fn model_selection_score(&self, _target: Node, _parents: &[Node]) -> Result<f64> {
        Err(Error::param("pc_alpha", "this independence test has no model-selection score; give one value"))
    }

    /// What the reader of a result should know about the tests of `effect` given `parents`: one sentence, or nothing (the
    /// default).
    ///
    /// # Errors
    /// Those of [`PreparedTest::run_test`].
    fn remark(&self, _effect: Node, _parents: &[Node]) -> Result<Option<String>> {
        Ok(None)
    }

    /// What the reader of a result should know about all tests so far: one sentence, or nothing (the default).
    fn caution(&self) -> Option<String> {
        None
    }

    /// What the tests so far took, for who wants to know: one sentence, or nothing (the default).
    fn effort(&self) -> Option<String> {
        None
    }

    /// Whether a test takes only microseconds. A run then spreads threads over targets, not over tests.
    fn is_cheap(&self) -> bool {
        false
    }
}
