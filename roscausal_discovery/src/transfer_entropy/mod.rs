//! Multivariate transfer entropy: which lagged variables inform a target, as the first step of F-PCMCI.
//!
//! Greedy selection with hierarchical tests (Lizier and Rubinov 2012, MPI MIS preprint 25/2012; Novelli et al.
//! 2019, doi:10.1162/netn_a_00092). All information is in nats.

mod estimator;
mod gaussian;
mod kraskov;
mod result;
mod selection;
mod window;

use rayon::prelude::*;

use self::{
    estimator::Estimator, gaussian::Gaussian, kraskov::Kraskov, selection::Selection, window::Window,
};
pub use self::{
    estimator::TeEstimator,
    result::{Selected, TargetSelection, TeResult},
};
use crate::ground::{Control, DataFrame, Error, Result};

/// Settings of a transfer-entropy filter.
#[derive(Clone, Debug, PartialEq)]
pub struct TransferEntropy {
    /// Estimator of information.
    pub estimator: TeEstimator,
    /// Smallest lag of a source in steps, at least 1.
    pub min_lag: usize,
    /// Largest lag of a source in steps.
    pub max_lag: usize,
    /// Level of each of the hierarchical tests, inside (0, 1); `f_alpha` of F-PCMCI.
    pub alpha: f64,
    /// Seed of the surrogates; the Gaussian estimator needs none.
    pub seed: u64,
}

impl TransferEntropy {
    /// Selects what informs each variable. Targets run in parallel; the result does not depend on the threads.
    ///
    /// # Errors
    /// A parameter out of its range, too few complete samples, or `control` stops the run.
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
