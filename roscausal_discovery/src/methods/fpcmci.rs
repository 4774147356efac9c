//! F-PCMCI: a transfer-entropy filter in front of PCMCI.

use ndarray::{Array3, Axis};

use super::{
    pcmci::run_pcmci,
    result::{PcmciResult, Status},
    settings::PcmciSettings,
};
use crate::{
    transfer_entropy::{TeEstimator, TeResult, TransferEntropy},
    types::{Assumption, CondIndTest, Control, DataFrame, LinkAssumptions, Result, add_new},
};

with_defaults! {
    /// Settings of F-PCMCI.
    #[derive(Clone, Debug)]
    pub struct FpcmciSettings {
        /// Estimator of the transfer-entropy filter.
        pub te_estimator: TeEstimator = TeEstimator::Auto,
        /// Significance level of the filter, in (0, 1).
        pub f_alpha: f64 = 0.05,
        /// Whether to leave out variables that depend on their own past only.
        pub neglect_only_autodep: bool = true,
        /// Seed of the filter's surrogates (the Gaussian estimator has none).
        pub seed: u64 = 42,
        /// Settings of PCMCI on the remaining variables. Its link assumptions also restrict the links of the filter.
        pub pcmci: PcmciSettings = PcmciSettings::default(),
    }
}

/// Result of F-PCMCI. Variables are columns of the data frame, in rising order.
#[derive(Clone, Debug, Default)]
pub struct FpcmciResult {
    /// What informs each variable; `None` if the time budget ended in the filter.
    pub filter: Option<TeResult>,
    /// Variables that remain after the filter.
    pub selected: Vec<usize>,
    /// The filter's links among `selected` (as positions in that list), as given to PCMCI.
    pub link_assumptions: LinkAssumptions,
    /// PCMCI on `selected`; `None` if no variable remains.
    pub pcmci: Option<PcmciResult>,
    /// Variables of the model: those of `selected` that have a link after PCMCI.
    pub features: Vec<usize>,
    /// Whether the run came to its end.
    pub status: Status,
}

/// F-PCMCI: PCMCI behind a filter that leaves out what has no part in the system.
///
/// 1. [`TransferEntropy`](crate::transfer_entropy::TransferEntropy) finds what informs each variable; those links are
///    possible, and variables without one are left out. Before a test that sees more than lines the filter does too
///    ([`TeEstimator::Auto`]); the published filter is [`TeEstimator::Gaussian`].
/// 2. [`run_pcmci`](super::run_pcmci) tests the possible links.
/// 3. Variables without a link are left out of the result.
///
/// Take it on sensor data of which much may not matter, and with a slow test: the filter is fast, and PCMCI then has few
/// links to test. It knows lagged links only.
///
/// Source: Castri, Mghames, Hanheide and Bellotto 2023, CLeaR, "Enhancing causal discovery from robot sensor data in dynamic
/// scenarios".
///
/// ```
/// use roscausal_discovery::{Control, DataFrame, LinkMark};
/// use roscausal_discovery::independence_tests::{ParCorr, TestSettings};
/// use roscausal_discovery::methods::{FpcmciSettings, run_fpcmci};
///
/// # let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0) - 0.5;
/// # let mut values = ndarray::Array2::zeros((300, 3));
/// # for t in 1..300 {
/// #     values[[t, 0]] = noise(2 * t);
/// #     values[[t, 1]] = 0.7 * values[[t - 1, 0]] + noise(2 * t + 1);
/// #     values[[t, 2]] = noise(5000 + 3 * t);
/// # }
/// # let data = DataFrame::new(vec![values], vec!["a".into(), "b".into(), "noise".into()])?;
/// let test = ParCorr::new(&TestSettings::default())?;
/// let result = run_fpcmci(&data, &test, &FpcmciSettings::default(), &Control::default())?;
/// // The third variable is noise.
/// assert_eq!(result.features, [0, 1]);
/// # assert!(result.pcmci.is_some_and(|found| found.graph[[0, 1, 1]] == LinkMark::Forward));
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
///
/// # Errors
/// Settings or data that do not match, a test that fails, or cancellation.
pub fn run_fpcmci(
    data: &DataFrame,
    test: &dyn CondIndTest,
    settings: &FpcmciSettings,
    control: &Control,
) -> Result<FpcmciResult> {
    settings.pcmci.check(data.of_scalars("the filter of fpcmci")?, test)?;
    let filter = TransferEntropy {
        estimator: settings.te_estimator.for_test(test.is_linear()),
        min_lag: settings.pcmci.tau_min,
        max_lag: settings.pcmci.tau_max,
        alpha: settings.f_alpha,
        seed: settings.seed,
    };
    let mut result = FpcmciResult::default();
    let found = match filter.run(data, control) {
        Err(error) if control.is_timeout(&error) => {
            result.status =
                Status::Partial("the time budget ended the run in the transfer-entropy filter".into());
            return Ok(result);
        }
        found => found?,
    };
    let links = settings.allowed(&found, data.n_vars())?;
    result.filter = Some(found);
    result.selected = connected(data.n_vars(), &links, settings.neglect_only_autodep);
    if result.selected.is_empty() {
        return Ok(result);
    }
    result.link_assumptions = among(&result.selected, &links)?;
    let pcmci =
        PcmciSettings { link_assumptions: Some(result.link_assumptions.clone()), ..settings.pcmci.clone() };
    let found = run_pcmci(&data.select(&result.selected), test, &pcmci, control)?;
    result.status = found.status.clone();
    let kept = found.connected_features(settings.neglect_only_autodep);
    result.features = kept.into_iter().map(|position| result.selected[position]).collect();
    result.pcmci = Some(found);
    Ok(result)
}

/// `(cause, effect, lag)`
type PossibleLink = (usize, usize, usize, Assumption);

impl FpcmciSettings {
    /// The filter's links that the link assumptions allow, and the links that are assumed to exist.
    fn allowed(&self, found: &TeResult, n_vars: usize) -> Result<Vec<PossibleLink>> {
        let mut links = Vec::new();
        for target in &found.targets {
            for selected in target.selected() {
                let (cause, effect, lag) = (selected.source.var, target.target, selected.source.lag);
                let assumption = match &self.pcmci.link_assumptions {
                    None => Some(Assumption::Test),
                    Some(given) => given.get(cause, effect, lag),
                };
                links.extend(assumption.map(|assumption| (cause, effect, lag, assumption)));
            }
        }
        for (effect, given) in
            self.pcmci.link_assumptions.iter().flat_map(|g| (0..n_vars).map(move |j| (j, g)))
        {
            for (node, assumption) in given.of_target(effect).filter(|(_, a)| a.exists()) {
                add_new(&mut links, (node.var, effect, node.lag, assumption));
            }
        }
        Ok(links)
    }
}

/// Variables that have a link, in rising order. With `neglect_only_autodep` a link to or from another variable is
/// needed.
fn connected(n_vars: usize, links: &[PossibleLink], neglect_only_autodep: bool) -> Vec<usize> {
    let counts = |&&(cause, effect, _, _): &&PossibleLink| cause != effect || !neglect_only_autodep;
    let touches = |var: usize| links.iter().filter(counts).any(|&(i, j, _, _)| i == var || j == var);
    (0..n_vars).filter(|&var| touches(var)).collect()
}

/// The links among the `selected` variables, numbered by position in that list.
fn among(selected: &[usize], links: &[PossibleLink]) -> Result<LinkAssumptions> {
    let mut assumptions = LinkAssumptions::none(selected.len());
    let position = |var: usize| selected.iter().position(|&s| s == var);
    for &(cause, effect, lag, assumption) in links {
        if let (Some(cause), Some(effect)) = (position(cause), position(effect)) {
            assumptions.insert(cause, effect, lag, assumption)?;
        }
    }
    Ok(assumptions)
}

impl PcmciResult {
    /// Variables that have a link, in rising order. With `neglect_only_autodep` a link to or from another variable
    /// is needed.
    pub fn connected_features(&self, neglect_only_autodep: bool) -> Vec<usize> {
        let links = self.graph.indexed_iter().filter(|(_, mark)| mark.is_link());
        let links: Vec<PossibleLink> = links.map(|((i, j, lag), _)| (i, j, lag, Assumption::Test)).collect();
        connected(self.graph.dim().0, &links, neglect_only_autodep)
    }

    /// The same result, restricted to some of its variables.
    #[must_use]
    pub fn on_features(&self, features: &[usize]) -> Self {
        fn of<T: Clone>(matrix: &Array3<T>, features: &[usize]) -> Array3<T> {
            matrix.select(Axis(0), features).select(Axis(1), features)
        }
        Self {
            graph: of(&self.graph, features),
            val_matrix: of(&self.val_matrix, features),
            p_matrix: of(&self.p_matrix, features),
            q_matrix: self.q_matrix.as_ref().map(|q| of(q, features)),
            conf_matrix: self.conf_matrix.as_ref().map(|conf| of(conf, features)),
            samples: of(&self.samples, features),
            // These fields number variables in the full data.
            parents: Vec::new(),
            sepsets: Vec::new(),
            ambiguous_triples: Vec::new(),
            ..self.clone()
        }
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;
    use crate::{
        independence_tests::{TestSettings, by_name},
        numeric::random::Rng,
    };

    /// `a` drives itself and `b`; `c` only itself; `d` is noise.
    fn data(n: usize) -> DataFrame {
        let mut rng = Rng::new(9);
        let mut e = || rng.unit() - 0.5;
        let mut x = Array2::zeros((n, 4));
        for t in 1..n {
            x[[t, 0]] = 0.6 * x[[t - 1, 0]] + e();
            x[[t, 1]] = 0.6 * x[[t - 1, 0]] + e();
            x[[t, 2]] = 0.6 * x[[t - 1, 2]] + e();
            x[[t, 3]] = e();
        }
        DataFrame::new(vec![x], ["a", "b", "c", "d"].map(str::to_owned).to_vec()).expect("is a frame")
    }

    fn run(settings: &FpcmciSettings) -> FpcmciResult {
        let test = by_name("parcorr", &TestSettings::default()).expect("is a test");
        run_fpcmci(&data(600), test.as_ref(), settings, &Control::default()).expect("runs")
    }

    fn settings() -> FpcmciSettings {
        FpcmciSettings {
            f_alpha: 0.001,
            pcmci: PcmciSettings { alpha_level: 0.001, ..PcmciSettings::default() },
            ..FpcmciSettings::default()
        }
    }

    #[test]
    fn variables_without_a_link_to_others_are_left_out() {
        let result = run(&settings());
        assert_eq!((&result.selected[..], &result.features[..]), (&[0, 1][..], &[0, 1][..]));
        let found = result.pcmci.expect("runs");
        let links = |effect: usize| [0, 1].map(|cause| found.graph[[cause, effect, 1]].is_link());
        assert_eq!([links(0), links(1)], [[true, false]; 2]);
        assert!(found.val_matrix[[0, 1, 1]] > 0.3 && found.p_matrix[[0, 1, 1]] < 1e-6);
    }

    #[test]
    fn autodependent_variables_stay_when_they_are_not_neglected() {
        let result = run(&FpcmciSettings { neglect_only_autodep: false, ..settings() });
        assert_eq!((&result.selected[..], &result.features[..]), (&[0, 1, 2][..], &[0, 1, 2][..]));
        let on_c = result.pcmci.expect("runs").on_features(&[2]);
        assert_eq!(on_c.graph.dim(), (1, 1, 2));
        assert!(on_c.graph[[0, 0, 1]].is_link());
    }

    #[test]
    fn forbidden_links_are_not_tested() {
        let links = LinkAssumptions::all(4, 1, 1).exogenous(&[1]);
        let pcmci = PcmciSettings { link_assumptions: Some(links), ..settings().pcmci };
        let result = run(&FpcmciSettings { pcmci, ..settings() });
        assert!(result.selected.is_empty() && result.pcmci.is_none());
        assert_eq!(result.status, Status::Complete);
    }

    #[test]
    fn a_time_budget_that_ends_in_the_filter_leaves_a_partial_result() {
        let test = by_name("parcorr", &TestSettings::default()).expect("is a test");
        let control = Control::default().out_of_time(|| true);
        let result = run_fpcmci(&data(100), test.as_ref(), &settings(), &control).expect("runs");
        assert!(matches!(result.status, Status::Partial(_)) && result.features.is_empty());
    }
}
