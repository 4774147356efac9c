//! Robust partial correlation: monotone dependence of variables of any distribution.

use super::{
    parcorr::Linear,
    settings::{Significance, TestSettings},
};
use crate::{
    numeric::normal::{normal_scores, reference_normal_scores},
    types::{CondIndTest, PreparedTest, Result, Samples},
};

/// Partial correlation of normal scores: [`ParCorr`](super::ParCorr) after each row of a test has become ranks, and the ranks
/// normal quantiles.
///
/// Take it where [`ParCorr`](super::ParCorr) would do but for outliers, heavy tails or skewed variables: the result depends
/// on the order of values only. It takes a little more time.
///
/// The transform is the nonparanormal of Liu, Lafferty and Wasserman 2009 (JMLR 10:2295).
///
/// ```
/// use roscausal_discovery::{CondIndTest, DataFrame, Node, Samples};
/// use roscausal_discovery::independence_tests::{ParCorr, RobustParCorr, TestSettings};
///
/// // Y follows X, and one sample is an outlier.
/// let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0) - 0.5;
/// let mut values = ndarray::Array2::from_shape_fn((200, 2), |(t, k)| noise(2 * t) + if k == 1 { noise(2 * t + 1) } else { 0.0 });
/// values[[100, 0]] = 1e4;
/// let data = DataFrame::new(vec![values], vec!["x".into(), "y".into()])?;
/// let samples = Samples::new(&data, 0);
/// let (x, y, settings) = (Node::new(0, 0), Node::new(1, 0), TestSettings::default());
/// let (plain, robust) = (ParCorr::new(&settings)?, RobustParCorr::new(&settings)?);
/// assert!(plain.prepare(&samples)?.run_test(x, y, &[])?.p_value > 0.01);
/// assert!(robust.prepare(&samples)?.run_test(x, y, &[])?.p_value < 1e-6);
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct RobustParCorr {
    linear: Linear,
    as_tigramite: bool,
}

impl RobustParCorr {
    /// The test with these settings.
    ///
    /// # Errors
    /// A setting that is not allowed.
    pub fn new(settings: &TestSettings) -> Result<Self> {
        Ok(Self { linear: Linear::new(settings)?, as_tigramite: settings.as_tigramite })
    }
}

impl CondIndTest for RobustParCorr {
    fn name(&self) -> &'static str {
        "robustparcorr"
    }

    fn is_linear(&self) -> bool {
        true
    }

    fn prepare<'a>(&'a self, samples: &'a Samples<'a>) -> Result<Box<dyn PreparedTest + 'a>> {
        let scores = if self.as_tigramite { reference_normal_scores } else { normal_scores };
        self.linear.prepare(samples, Some(scores))
    }

    fn decides_by_value(&self) -> bool {
        self.linear.significance == Significance::FixedThres
    }
}
