//! What the filter finds.

use crate::types::Node;

/// A variable that informs a target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Selected {
    /// The variable and its lag.
    pub source: Node,
    /// Its information about the target given all other selected variables, in nats; of those in
    /// [`TargetSelection::beyond`] the distance correlation.
    pub value: f64,
    /// P-value of its final test.
    pub p_value: f64,
}

/// What informs one target.
#[derive(Clone, Debug, PartialEq)]
pub struct TargetSelection {
    /// The target variable.
    pub target: usize,
    /// Its own past, in the order of selection. The p-value is that of the whole past.
    pub autodependency: Vec<Selected>,
    /// The sources, in the order of selection.
    pub sources: Vec<Selected>,
    /// What distance correlation finds beyond them ([`GaussianDcor`](super::TeEstimator::GaussianDcor)), by variable and lag.
    pub beyond: Vec<Selected>,
    /// Transfer entropy of all sources together, in nats.
    pub transfer_entropy: f64,
    /// P-value of all sources together (omnibus test).
    pub p_value: f64,
}

impl TargetSelection {
    /// Everything that informs the target: its own past, the sources, and what was found beyond them.
    pub fn selected(&self) -> impl Iterator<Item = &Selected> {
        self.autodependency.iter().chain(&self.sources).chain(&self.beyond)
    }
}

/// What informs every target.
#[derive(Clone, Debug, PartialEq)]
pub struct TeResult {
    /// One entry per variable, in the order of the data frame.
    pub targets: Vec<TargetSelection>,
    /// Samples used by every estimate.
    pub n_samples: usize,
    /// Samples left out because a variable was missing at some lag.
    pub n_lost: usize,
}
