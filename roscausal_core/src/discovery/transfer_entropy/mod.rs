//! Multivariate transfer entropy: which lagged variables inform a target. It is the first step of F-PCMCI.
//!
//! For each target, sources are selected greedily with hierarchical tests (Lizier and Rubinov 2012, MPI MIS
//! preprint 25/2012; Novelli et al. 2019, doi:10.1162/netn_a_00092). All information is in nats.

mod gaussian;
mod kraskov;
mod selection;
mod window;

use rayon::prelude::*;

use self::{gaussian::Gaussian, kraskov::Kraskov, selection::Selection, window::Window};
use super::{Control, DataFrame, Node};
use crate::{Error, Result};

/// How conditional mutual information is estimated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TeEstimator {
    /// Linear-Gaussian, from the correlation matrix; exact null distributions.
    #[default]
    Gaussian,
    /// Nearest neighbours: dependence of any form. Slower, because it needs permutation surrogates.
    Kraskov,
}

impl std::str::FromStr for TeEstimator {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        match name.to_ascii_lowercase().as_str() {
            "gaussian" => Ok(Self::Gaussian),
            "kraskov" => Ok(Self::Kraskov),
            _ => Err(Error::param("te_estimator", format!("'{name}' is not gaussian or kraskov"))),
        }
    }
}

/// Settings of a transfer-entropy filter.
#[derive(Clone, Debug, PartialEq)]
pub struct TransferEntropy {
    /// Estimator of information.
    pub estimator: TeEstimator,
    /// Smallest lag of a source in steps, at least 1.
    pub min_lag: usize,
    /// Largest lag of a source in steps.
    pub max_lag: usize,
    /// Significance level of each of the hierarchical tests, in (0, 1); `f_alpha` of F-PCMCI.
    pub alpha: f64,
    /// Seed of the surrogates (the Gaussian estimator has none).
    pub seed: u64,
}

/// A variable that informs a target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Selected {
    /// The variable and its lag.
    pub source: Node,
    /// Its information about the target given all other selected variables, in nats.
    pub cmi: f64,
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
    /// Transfer entropy of all sources together, in nats.
    pub transfer_entropy: f64,
    /// P-value of all sources together (omnibus test).
    pub p_value: f64,
}

impl TargetSelection {
    /// Everything that informs the target: its own past, then the sources.
    pub fn selected(&self) -> impl Iterator<Item = &Selected> {
        self.autodependency.iter().chain(&self.sources)
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

/// Information estimates and their null distributions on the samples of one run. The `p_*` methods return the
/// fraction of surrogates whose statistic is not below `value`.
trait Estimator: Sync {
    /// `I(target; sources | z)`.
    fn cmi(&self, target: Node, sources: &[Node], z: &[Node]) -> f64;

    /// `I(target; c | z)` of each candidate.
    fn cmi_of_each(&self, target: Node, candidates: &[Node], z: &[Node]) -> Vec<f64> {
        candidates.iter().map(|&candidate| self.cmi(target, &[candidate], z)).collect()
    }

    /// P-value of the maximum over the candidates, each given `z`.
    fn p_max(&self, value: f64, target: Node, candidates: &[Node], z: &[Node]) -> f64;

    /// P-value of the minimum over the sources, each given the others and `past`.
    fn p_min(&self, value: f64, target: Node, sources: &[Node], past: &[Node]) -> f64;

    /// P-value of all sources together.
    fn p_joint(&self, value: f64, target: Node, sources: &[Node], z: &[Node]) -> f64;

    /// P-values of the largest, second largest, ... over the sources, each given the others and `past`. `values` is
    /// in falling order.
    fn p_sequential(&self, values: &[f64], target: Node, sources: &[Node], past: &[Node]) -> Vec<f64>;
}

impl TransferEntropy {
    /// Selects what informs each variable. Targets run in parallel; the result does not depend on the threads.
    ///
    /// # Errors
    /// A parameter out of range, too few complete samples, or a run that `control` stops.
    pub fn run(&self, data: &DataFrame, control: &Control) -> Result<TeResult> {
        self.check()?;
        let window = Window::new(data, self.max_lag)?;
        let estimator: Box<dyn Estimator> = match self.estimator {
            TeEstimator::Gaussian => Box::new(Gaussian::new(&window)),
            TeEstimator::Kraskov => Box::new(Kraskov::new(&window, self.seed, control)),
        };
        let n_samples = window.times().len();
        let selection = Selection {
            estimator: estimator.as_ref(),
            alpha: self.alpha,
            n_vars: data.n_vars(),
            lags: self.min_lag..=self.max_lag,
            limit: n_samples.saturating_sub(3),
            control,
        };
        let targets = (0..data.n_vars())
            .into_par_iter()
            .map(|target| selection.run(target))
            .collect::<Result<Vec<_>>>()?;
        Ok(TeResult { targets, n_samples, n_lost: window.n_lost() })
    }

    fn check(&self) -> Result<()> {
        if self.min_lag == 0 || self.min_lag > self.max_lag {
            return Err(Error::param(
                "min_lag",
                format!("{} must be at least 1 and at most max_lag = {}", self.min_lag, self.max_lag),
            ));
        }
        if !(self.alpha > 0.0 && self.alpha < 1.0) {
            return Err(Error::param(
                "f_alpha",
                format!("{} is not inside (0, 1); 0.05 is usual", self.alpha),
            ));
        }
        if self.estimator == TeEstimator::Kraskov && self.alpha <= kraskov::SMALLEST_P {
            let reason = format!(
                "{} is below {:.4}, the smallest p-value of the kraskov estimator's surrogates; raise it or use \
                 gaussian",
                self.alpha,
                kraskov::SMALLEST_P
            );
            return Err(Error::param("f_alpha", reason));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
