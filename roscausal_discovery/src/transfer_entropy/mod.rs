//! Multivariate transfer entropy: which lagged variables inform a target. It is the first step of F-PCMCI.
//!
//! For each target: its own past is selected first; then the variable with the most information given all selected ones
//! joins them, as long as it beats the largest value that chance gives; then those without information given the others
//! leave; a final test of all together, and one of each, decides. With the Gaussian estimator that finds linear dependence;
//! `gaussian+dcor` then takes a second look for any other, pair by pair.
//!
//! Take it to see quickly what informs what in many variables; for links with conditions on both ends, go on to a method.
//!
//! Source: Lizier and Rubinov 2012, MPI MIS preprint 25/2012; Novelli et al. 2019, doi:10.1162/netn_a_00092. All
//! information is in nats.
//!
//! ```
//! use roscausal_discovery::{Control, DataFrame, transfer_entropy::{TeEstimator, TransferEntropy}};
//!
//! # let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0) - 0.5;
//! # let mut values = ndarray::Array2::zeros((300, 2));
//! # for t in 1..300 {
//! #     values[[t, 0]] = noise(2 * t);
//! #     values[[t, 1]] = 0.7 * values[[t - 1, 0]] + noise(2 * t + 1);
//! # }
//! # let data = DataFrame::new(vec![values], vec!["a".into(), "b".into()])?;
//! let filter = TransferEntropy { estimator: TeEstimator::Gaussian, min_lag: 1, max_lag: 2, alpha: 0.01, seed: 42 };
//! let result = filter.run(&data, &Control::default())?;
//! // `b` is informed by `a` one step before, `a` by nothing.
//! let sources = &result.targets[1].sources;
//! assert_eq!((sources[0].source.var, sources[0].source.lag), (0, 1));
//! assert!(result.targets[0].sources.is_empty());
//! # Ok::<(), roscausal_discovery::Error>(())
//! ```

mod estimator;
mod gaussian;
mod kraskov;
mod nonlinear;
mod result;
mod selection;
mod window;

use rayon::prelude::*;

use self::{
    estimator::Estimator, gaussian::Gaussian, kraskov::Kraskov, nonlinear::SecondLook, selection::Selection,
    window::Window,
};
pub use self::{
    estimator::TeEstimator,
    result::{Selected, TargetSelection, TeResult},
};
use crate::{
    numeric::random::seed_of_draw,
    types::{Control, DataFrame, Error, Result},
};

/// Settings of a transfer-entropy filter.
#[derive(Clone, Debug, PartialEq)]
pub struct TransferEntropy {
    /// Estimator of information; without a test to go by, `Auto` is `GaussianDcor`.
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

impl TransferEntropy {
    /// Selects what informs each variable. Targets run in parallel; the result does not depend on the threads.
    ///
    /// # Errors
    /// A parameter out of range, too few complete samples, or a run that `control` stops.
    pub fn run(&self, data: &DataFrame, control: &Control) -> Result<TeResult> {
        self.check()?;
        let window = Window::new(data, self.max_lag)?;
        let estimator: Box<dyn Estimator> = match self.estimator {
            TeEstimator::Auto | TeEstimator::Gaussian | TeEstimator::GaussianDcor => {
                Box::new(Gaussian::new(&window))
            }
            TeEstimator::Kraskov => {
                Box::new(Kraskov::new(&window, seed_of_draw(self.seed, data.draw), control))
            }
        };
        let n_samples = window.times.len();
        let selection = Selection {
            estimator: estimator.as_ref(),
            alpha: self.alpha,
            n_vars: data.n_vars(),
            lags: self.min_lag..=self.max_lag,
            limit: n_samples.saturating_sub(3),
            control,
        };
        let lags = self.min_lag..=self.max_lag;
        let looks_again = self.estimator.for_test(false) == TeEstimator::GaussianDcor;
        let second_look = looks_again.then(|| SecondLook::new(&window, lags, self.alpha, control));
        let of_target = |target: usize| {
            let mut found = selection.run(target)?;
            second_look.as_ref().map_or(Ok(()), |look| look.add_to(&mut found))?;
            Ok(found)
        };
        let targets = (0..data.n_vars()).into_par_iter().map(of_target).collect::<Result<Vec<_>>>()?;
        Ok(TeResult { targets, n_samples, n_lost: window.n_lost })
    }

    fn check(&self) -> Result<()> {
        let Self { min_lag, max_lag, alpha, .. } = *self;
        Error::ensure(min_lag > 0 && min_lag <= max_lag, "min_lag", || {
            format!("{min_lag} must be at least 1 and at most max_lag = {max_lag}")
        })?;
        Error::ensure(alpha > 0.0 && alpha < 1.0, "f_alpha", || {
            format!("{alpha} is not inside (0, 1); 0.05 is usual")
        })?;
        let smallest = kraskov::SMALLEST_P;
        if self.estimator == TeEstimator::Kraskov && alpha <= smallest {
            let reason = format!(
                "{alpha} is below {smallest:.4}, the smallest p-value of the kraskov estimator's surrogates; raise it or \
                 use gaussian"
            );
            return Err(Error::param("f_alpha", reason));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
