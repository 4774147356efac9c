//! PCMCI and its relatives.
//!
//! [`run_pcmci`] is PC1 followed by MCI. [`run_pc_stable`] and [`run_mci`] are the two phases on their own.
//! [`run_fullci`], [`run_bivci`] and [`get_lagged_dependencies`] test every link under fixed conditions.

use super::{
    mci::Mci,
    pc_stable::PcStable,
    result::{PcmciResult, Status, TargetParents},
    run::Run,
    settings::{PC_ALPHAS, PcmciSettings},
};
use crate::types::{CondIndTest, Control, DataFrame, Error, LinkAssumptions, Node, Result, Samples};

impl PcmciSettings {
    pub(crate) fn pc_stable<'a>(&'a self, links: &'a LinkAssumptions, default: &'a [f64]) -> PcStable<'a> {
        PcStable {
            links,
            pc_alphas: if self.pc_alpha.is_empty() { default } else { &self.pc_alpha },
            max_conds_dim: self.max_conds_dim,
            max_combinations: self.max_combinations,
        }
    }

    fn mci<'a>(&self, links: &'a LinkAssumptions, parents: &'a [Vec<Node>]) -> Mci<'a> {
        Mci {
            links,
            parents,
            max_conds_py: self.max_conds_py,
            max_conds_px: self.max_conds_px,
            alpha_level: self.alpha_level,
            fdr: self.fdr,
            directed: false,
        }
    }
}

/// PC1 alone: the parents of each target, strongest first. `graph` and matrices stay empty.
///
/// Take it to look at the condition selection of [`run_pcmci`], or to give the parents to [`run_mci`] with another test.
///
/// # Errors
/// Settings or data that do not match, a test that fails, or cancellation.
pub fn run_pc_stable(
    data: &DataFrame,
    test: &dyn CondIndTest,
    settings: &PcmciSettings,
    control: &Control,
) -> Result<PcmciResult> {
    with_run(data, test, settings, control, |run, links, result| {
        let (parents, out_of_time) = settings.pc_stable(links, &PC_ALPHAS).run(run)?;
        result.parents = parents;
        Ok(out_of_time)
    })
}

/// PCMCI: PC1 selects conditions, then MCI tests each link under them.
///
/// 1. PC1 (the order-independent PC of Colombo and Maathuis 2014, one target at a time): starts with all lagged variables
///    as parents of a target and drops each one that is independent of it given the strongest others.
/// 2. MCI (momentary conditional independence): tests each link given the parents of its effect and those of its cause. The
///    cause's parents take off its autocorrelation, which would otherwise raise false alarms.
///
/// Take it as the first choice for lagged links. A pair at lag 0 (`tau_min` = 0) gets a mark without direction; for
/// directions there take [`run_pcmciplus`](super::run_pcmciplus).
///
/// Source: Runge, Nowack, Kretschmer, Flaxman and Sejdinovic 2019, Science Advances 5:eaau4996.
///
/// ```
/// use roscausal_discovery::{Control, DataFrame, LinkMark};
/// use roscausal_discovery::independence_tests::{ParCorr, TestSettings};
/// use roscausal_discovery::methods::{PcmciSettings, run_pcmci};
///
/// # let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0) - 0.5;
/// # let mut values = ndarray::Array2::zeros((300, 2));
/// # for t in 1..300 {
/// #     values[[t, 0]] = noise(2 * t);
/// #     values[[t, 1]] = 0.7 * values[[t - 1, 0]] + noise(2 * t + 1);
/// # }
/// # let data = DataFrame::new(vec![values], vec!["a".into(), "b".into()])?;
/// let test = ParCorr::new(&TestSettings::default())?;
/// let settings = PcmciSettings { tau_max: 2, ..PcmciSettings::default() };
/// let result = run_pcmci(&data, &test, &settings, &Control::default())?;
/// assert_eq!(result.graph[[0, 1, 1]], LinkMark::Forward);
/// assert_eq!(result.graph[[1, 0, 1]], LinkMark::Absent);
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
///
/// # Errors
/// Settings or data that do not match, a test that fails, or cancellation. Running out of time is not an error: see
/// [`PcmciResult::status`].
pub fn run_pcmci(
    data: &DataFrame,
    test: &dyn CondIndTest,
    settings: &PcmciSettings,
    control: &Control,
) -> Result<PcmciResult> {
    with_run(data, test, settings, control, |run, links, result| {
        let (parents, out_of_time) = settings.pc_stable(links, &PC_ALPHAS).run(run)?;
        let conditions = nodes_of(&parents);
        result.parents = parents;
        Ok(out_of_time || settings.mci(links, &conditions).run(run, result)?)
    })
}

/// MCI alone, given the parents of each target, strongest first.
///
/// Take it when the parents are known, or come from [`run_pc_stable`] with a faster test.
///
/// # Errors
/// As [`run_pcmci`]; also a wrong number of parent lists, or a parent with a wrong lag.
pub fn run_mci(
    data: &DataFrame,
    test: &dyn CondIndTest,
    settings: &PcmciSettings,
    parents: &[Vec<Node>],
    control: &Control,
) -> Result<PcmciResult> {
    let n_vars = data.n_vars();
    let wrong = parents.iter().flatten().find(|n| n.var >= n_vars || n.lag == 0 || n.lag > settings.tau_max);
    Error::ensure(parents.len() == n_vars && wrong.is_none(), "parents", || {
        format!("give {n_vars} lists of variables 0..{n_vars} at lags 1..={}", settings.tau_max)
    })?;
    with_run(data, test, settings, control, |run, links, result| {
        settings.mci(links, parents).run(run, result)
    })
}

/// Full conditional independence: tests each link given the past of all variables. Assumptions say which links are tested; they take
/// nothing out of the conditions.
///
/// This is Granger causality in a regression on everything. Take it with few variables and many samples: each further
/// variable and lag is one more condition and costs power, which is what PCMCI's selection avoids.
///
/// ```
/// use roscausal_discovery::{Control, DataFrame, LinkMark};
/// use roscausal_discovery::independence_tests::{ParCorr, TestSettings};
/// use roscausal_discovery::methods::{PcmciSettings, run_fullci};
///
/// # let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0) - 0.5;
/// # let mut values = ndarray::Array2::zeros((300, 2));
/// # for t in 1..300 {
/// #     values[[t, 0]] = noise(2 * t);
/// #     values[[t, 1]] = 0.7 * values[[t - 1, 0]] + noise(2 * t + 1);
/// # }
/// # let data = DataFrame::new(vec![values], vec!["a".into(), "b".into()])?;
/// let test = ParCorr::new(&TestSettings::default())?;
/// let result = run_fullci(&data, &test, &PcmciSettings::default(), &Control::default())?;
/// assert_eq!(result.graph[[0, 1, 1]], LinkMark::Forward);
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
///
/// # Errors
/// As [`run_pcmci`].
pub fn run_fullci(
    data: &DataFrame,
    test: &dyn CondIndTest,
    settings: &PcmciSettings,
    control: &Control,
) -> Result<PcmciResult> {
    let past = (0..data.n_vars()).flat_map(|var| past_of(var, settings)).collect::<Vec<_>>();
    run_with_conditions(data, test, settings, control, false, |_| past.clone())
}

/// Bivariate conditional independence: tests each link given the past of its target.
///
/// This is Granger's test of two variables. Take it as a quick look at pairs: a common driver of both makes a false link.
///
/// ```
/// use roscausal_discovery::{Control, DataFrame, LinkMark};
/// use roscausal_discovery::independence_tests::{ParCorr, TestSettings};
/// use roscausal_discovery::methods::{PcmciSettings, run_bivci};
///
/// # let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0) - 0.5;
/// # let mut values = ndarray::Array2::zeros((300, 2));
/// # for t in 1..300 {
/// #     values[[t, 0]] = noise(2 * t);
/// #     values[[t, 1]] = 0.7 * values[[t - 1, 0]] + noise(2 * t + 1);
/// # }
/// # let data = DataFrame::new(vec![values], vec!["a".into(), "b".into()])?;
/// let test = ParCorr::new(&TestSettings::default())?;
/// let result = run_bivci(&data, &test, &PcmciSettings::default(), &Control::default())?;
/// assert_eq!(result.graph[[0, 1, 1]], LinkMark::Forward);
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
///
/// # Errors
/// As [`run_pcmci`].
pub fn run_bivci(
    data: &DataFrame,
    test: &dyn CondIndTest,
    settings: &PcmciSettings,
    control: &Control,
) -> Result<PcmciResult> {
    run_with_conditions(data, test, settings, control, true, |target| past_of(target, settings).collect())
}

/// Unconditional dependence of all pairs at all lags.
///
/// These are not causal links. Take them to see how far dependence reaches before choosing `tau_max`.
///
/// ```
/// use roscausal_discovery::{Control, DataFrame, LinkMark};
/// use roscausal_discovery::independence_tests::{ParCorr, TestSettings};
/// use roscausal_discovery::methods::{PcmciSettings, get_lagged_dependencies};
///
/// # let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0) - 0.5;
/// # let mut values = ndarray::Array2::zeros((300, 2));
/// # for t in 1..300 {
/// #     values[[t, 0]] = noise(2 * t);
/// #     values[[t, 1]] = 0.7 * values[[t - 1, 0]] + noise(2 * t + 1);
/// # }
/// # let data = DataFrame::new(vec![values], vec!["a".into(), "b".into()])?;
/// let test = ParCorr::new(&TestSettings::default())?;
/// let settings = PcmciSettings { tau_max: 3, ..PcmciSettings::default() };
/// let result = get_lagged_dependencies(&data, &test, &settings, &Control::default())?;
/// let strongest = (1..=3).max_by(|&a, &b| result.val_matrix[[0, 1, a]].total_cmp(&result.val_matrix[[0, 1, b]]));
/// assert_eq!((strongest, result.graph[[0, 1, 1]]), (Some(1), LinkMark::Forward));
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
///
/// # Errors
/// As [`run_pcmci`].
pub fn get_lagged_dependencies(
    data: &DataFrame,
    test: &dyn CondIndTest,
    settings: &PcmciSettings,
    control: &Control,
) -> Result<PcmciResult> {
    run_with_conditions(data, test, settings, control, false, |_| Vec::new())
}

/// The lags of a variable on which links into others are conditioned.
fn past_of(var: usize, settings: &PcmciSettings) -> impl Iterator<Item = Node> + use<> {
    (settings.tau_min.max(1)..=settings.tau_max).map(move |lag| Node::new(var, lag))
}

fn run_with_conditions(
    data: &DataFrame,
    test: &dyn CondIndTest,
    settings: &PcmciSettings,
    control: &Control,
    directed: bool,
    conditions: impl Fn(usize) -> Vec<Node>,
) -> Result<PcmciResult> {
    with_run(data, test, settings, control, |run, links, result| {
        let conditions: Vec<_> = (0..run.n_vars()).map(&conditions).collect();
        Mci { max_conds_px: Some(0), max_conds_py: None, directed, ..settings.mci(links, &conditions) }
            .run(run, result)
    })
}

/// Checks the settings, prepares the test, runs `body` (which returns whether time ran out), and fills in the
/// fields that all results share.
pub(crate) fn with_run(
    data: &DataFrame,
    test: &dyn CondIndTest,
    settings: &PcmciSettings,
    control: &Control,
    body: impl FnOnce(&Run<'_>, &LinkAssumptions, &mut PcmciResult) -> Result<bool>,
) -> Result<PcmciResult> {
    settings.check(data, test)?;
    let samples = Samples::new(data, settings.cut_off()).with_control(control.clone());
    let mut result = PcmciResult::untested(data.n_vars(), settings.tau_max, samples.len());
    let run = Run::new(test, &samples)?;
    if body(&run, &settings.links(data.n_vars()), &mut result)? {
        let (done, n) = (run.n_tests(), control.estimated_total());
        result.status =
            Status::Partial(format!("the time budget ended the run after {done} of about {n} tests"));
    } else {
        result.remarks = run.remarks(&result.lagged_parents())?;
    }
    result.effort = run.effort();
    result.n_tests = run.n_tests();
    Ok(result)
}

pub(crate) fn nodes_of(parents: &[TargetParents]) -> Vec<Vec<Node>> {
    parents.iter().map(|target| target.parents.clone()).collect()
}
