//! What an estimator of information is.

use crate::types::Node;

/// How the filter sees dependence.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum TeEstimator {
    /// By the independence test of the run: `Gaussian` for a linear one, else `GaussianDcor`.
    #[default]
    Auto,
    /// Linear-Gaussian, from the correlation matrix; exact null distributions. The published F-PCMCI's default. It is blind to
    /// links that are not linear.
    Gaussian,
    /// `Gaussian`, then distance correlation for what it leaves out: dependence of any form, fast.
    GaussianDcor,
    /// Nearest neighbours: dependence of any form. Slower, because it needs permutation surrogates.
    Kraskov,
}

impl TeEstimator {
    /// The estimator that goes with an independence test, for `Auto`.
    #[must_use]
    pub fn for_test(self, is_linear: bool) -> Self {
        match self {
            Self::Auto if is_linear => Self::Gaussian,
            Self::Auto => Self::GaussianDcor,
            chosen => chosen,
        }
    }
}

words!(TeEstimator, "te_estimator": Auto "auto", Gaussian "gaussian", GaussianDcor "gaussian+dcor", Kraskov "kraskov");

/// Information estimates and their null distributions on the samples of one run. The `p_*` methods return the
/// fraction of surrogates whose statistic is not below `value`.
pub(super) trait Estimator: Sync {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unknown_estimator_is_an_error_that_names_the_nearest() {
        assert_eq!("Kraskov".parse::<TeEstimator>().unwrap(), TeEstimator::Kraskov);
        assert_eq!("gaussian".parse::<TeEstimator>().unwrap(), TeEstimator::Gaussian);
        let error = "gausian".parse::<TeEstimator>().unwrap_err().to_string();
        assert!(error.contains("te_estimator") && error.contains("did you mean 'gaussian'?"), "{error}");
    }

    #[test]
    fn auto_sees_what_the_test_of_the_run_sees_and_a_chosen_estimator_stays() {
        use TeEstimator::{Auto, Gaussian, GaussianDcor, Kraskov};
        assert_eq!((Auto.for_test(true), Auto.for_test(false)), (Gaussian, GaussianDcor));
        for chosen in [Gaussian, GaussianDcor, Kraskov] {
            assert_eq!((chosen.for_test(true), chosen.for_test(false)), (chosen, chosen));
            assert_eq!(chosen.name().parse::<TeEstimator>().unwrap(), chosen);
        }
    }
}
