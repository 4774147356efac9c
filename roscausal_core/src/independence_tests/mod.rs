//! Conditional independence tests: `X _||_ Y | Z` on lagged samples of a [`crate::discovery::DataFrame`].
//!
//! A test ([`CondIndTest`]) is a plain value that holds its settings. For one run it is *prepared* on the samples
//! of the run ([`PreparedTest`]). The prepared test holds what the tests of a run share, such as the Gram matrix,
//! cached residuals and null distributions. It is `Sync`, and a result never depends on which tests came before it.

mod cholesky;
pub(crate) mod cmiknn;
mod gpdc;
#[cfg(feature = "python")]
mod gpdc_python;
mod gram;
mod gsquared;
#[cfg(test)]
mod laws;
mod normal;
mod oracle;
mod parcorr;
mod registry;
mod robust_parcorr;
mod settings;
pub(crate) mod significance;
mod student_t;

pub use cmiknn::CmiKnn;
pub use gpdc::Gpdc;
#[cfg(feature = "python")]
pub use gpdc_python::GpdcPython;
pub use gsquared::Gsquared;
pub use oracle::OracleCi;
pub use parcorr::ParCorr;
pub use registry::{by_name, names};
pub use robust_parcorr::RobustParCorr;
pub use settings::{Confidence, Significance, TestSettings};

use crate::{
    Error, Result,
    discovery::{Node, Samples},
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
    /// Samples used.
    pub n_samples: usize,
    /// Samples left out because one of the nodes was missing or masked.
    pub n_lost: usize,
    /// The decision, if the test does not decide by the p-value (`fixed_thres`). The run fills it in.
    pub dependent: Option<bool>,
}

/// A conditional independence test: its name and settings.
pub trait CondIndTest: Send + Sync {
    /// The name by which users choose the test, such as `parcorr`.
    fn name(&self) -> &'static str;

    /// Prepares the test for the samples of one run.
    ///
    /// # Errors
    /// If there are too few samples, or they do not suit the test.
    fn prepare<'a>(&'a self, samples: &'a Samples<'a>) -> Result<Box<dyn PreparedTest + 'a>>;

    /// Whether the decision is `|value| >= threshold` (`fixed_thres`), where the threshold is the significance
    /// level of the run. The run then sets the p-value to 0 (dependent) or 1; the test itself leaves it at 1.
    fn decides_by_value(&self) -> bool {
        false
    }
}

/// A test on the samples of one run.
pub trait PreparedTest: Sync {
    /// Tests `x _||_ y | z`.
    ///
    /// # Errors
    /// If too few complete samples are left for this condition set.
    fn run_test(&self, x: Node, y: Node, z: &[Node]) -> Result<TestResult>;

    /// Model-selection score of `target` given `parents`, for choosing `pc_alpha`. Lower is better.
    ///
    /// # Errors
    /// If the test has no such score (the default).
    fn model_selection_score(&self, _target: Node, _parents: &[Node]) -> Result<f64> {
        Err(Error::param("pc_alpha", "this independence test has no model-selection score; give one value"))
    }

    /// Whether a test takes only microseconds. A run then spreads threads over targets, not over tests.
    fn is_cheap(&self) -> bool {
        false
    }
}
