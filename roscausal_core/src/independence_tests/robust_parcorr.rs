//! Partial correlation of normal scores.

use super::{CondIndTest, PreparedTest, Significance, TestSettings, normal::normal_scores, parcorr::Linear};
use crate::{Result, discovery::Samples};

/// [`super::ParCorr`] on normal scores: each row of a test is replaced by its ranks, and these by normal quantiles.
/// Take it for variables with outliers, heavy tails, or any other marginal distribution.
#[derive(Clone, Debug)]
pub struct RobustParCorr {
    linear: Linear,
}

impl RobustParCorr {
    /// The test with these settings.
    ///
    /// # Errors
    /// A setting that is not allowed.
    pub fn new(settings: &TestSettings) -> Result<Self> {
        Ok(Self { linear: Linear::new(settings)? })
    }
}

impl CondIndTest for RobustParCorr {
    fn name(&self) -> &'static str {
        "robustparcorr"
    }

    fn prepare<'a>(&'a self, samples: &'a Samples<'a>) -> Result<Box<dyn PreparedTest + 'a>> {
        self.linear.prepare(samples, Some(normal_scores))
    }

    fn decides_by_value(&self) -> bool {
        self.linear.significance == Significance::FixedThres
    }
}
