//! Robust partial correlation: monotone dependence of variables of any distribution.

use super::{
    parcorr::Linear,
    settings::{Significance, TestSettings},
};
use crate::{
    ground::{CondIndTest, PreparedTest, Result, Samples},
    numeric::normal::normal_scores,
};

/// [`super::ParCorr`] of normal scores: each row of a test first to ranks, then to normal quantiles. It suits
/// variables of any marginal distribution, heavy tails and outliers.
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
