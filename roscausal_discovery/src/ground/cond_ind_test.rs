//! What an independence test is.

use super::{
    error::{Error, Result},
    node::Node,
    samples::Samples,
};

/// The answer of one test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TestResult {
    /// Strength of the dependence; its range and sign are the test's own.
    pub value: f64,
    /// P-value in `[0, 1]`.
    pub p_value: f64,
    /// Confidence interval of `value`, where the settings ask for one.
    pub confidence: Option<(f64, f64)>,
    /// Samples used.
    pub n_samples: usize,
    /// Samples left out because one of the nodes was missing or masked.
    pub n_lost: usize,
    /// Decision where the test does not decide by the p-value (`fixed_thres`); the run fills it in.
    pub dependent: Option<bool>,
}

/// A conditional independence test: its name and settings.
pub trait CondIndTest: Send + Sync {
    /// The name users choose it by, such as `parcorr`.
    fn name(&self) -> &'static str;

    /// Makes it ready for the samples of one run.
    ///
    /// # Errors
    /// When the samples are too few, or do not suit the test.
    fn prepare<'a>(&'a self, samples: &'a Samples<'a>) -> Result<Box<dyn PreparedTest + 'a>>;

    /// Whether the decision is `|value| >= threshold` (`fixed_thres`), the run's level being the threshold.
    /// The run then sets the p-value to 0 (dependent) or 1; the test itself leaves it at 1.
    fn decides_by_value(&self) -> bool {
        false
    }
}

/// A test on the samples of one run.
pub trait PreparedTest: Sync {
    /// Tests `x _||_ y | z`.
    ///
    /// # Errors
    /// When too few complete samples are left for this condition set.
    fn run_test(&self, x: Node, y: Node, z: &[Node]) -> Result<TestResult>;

    /// Model-selection score of "`target` on `parents`", lower is better; for choosing `pc_alpha`.
    ///
    /// # Errors
    /// When the test has no such score (the default).
    fn model_selection_score(&self, _target: Node, _parents: &[Node]) -> Result<f64> {
        Err(Error::param("pc_alpha", "this independence test has no model-selection score; give one value"))
    }

    /// Whether a test takes only microseconds, so that a run spreads threads over targets, not over tests.
    fn is_cheap(&self) -> bool {
        false
    }
}
