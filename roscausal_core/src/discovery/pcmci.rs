//! PCMCI and its relatives: settings and entry points.
//!
//! [`run_pcmci`] is PC1 followed by MCI. [`run_pc_stable`] and [`run_mci`] are the two phases on their own.
//! [`run_fullci`], [`run_bivci`] and [`get_lagged_dependencies`] test every link under fixed conditions.

use super::{
    Control, DataFrame, LinkAssumptions, Node, PcmciResult, Samples, Status, TargetParents, mci::Mci,
    pc_stable::PcStable, run::Run,
};
use crate::{Error, Result, independence_tests::CondIndTest};

/// Correction of p-values for the number of tests.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Fdr {
    /// No correction.
    #[default]
    None,
    /// Benjamini and Hochberg, over the lagged links. P-values at lag 0 stay as they are.
    Bh,
}

/// Settings of a run. Each method uses those that it has.
#[derive(Clone, Debug)]
pub struct PcmciSettings {
    /// Smallest lag of a link. Default 1 (PCMCI+: 0).
    pub tau_min: usize,
    /// Largest lag of a link. Default 1.
    pub tau_max: usize,
    /// Significance level of the condition selection. With several levels a model-selection score chooses one, per
    /// target (PCMCI+: one for all). Empty means [`PC_ALPHAS`] or [`PCMCIPLUS_ALPHAS`]. Default 0.2, PCMCI+: 0.01.
    pub pc_alpha: Vec<f64>,
    /// Significance level of a link (with `fixed_thres`: the threshold). Default 0.05.
    pub alpha_level: f64,
    /// Largest condition set of PC1; `None`: no limit.
    pub max_conds_dim: Option<usize>,
    /// Condition sets tested per size in PC1. Default 1.
    pub max_combinations: usize,
    /// How many of the effect's parents MCI conditions on; `None`: all.
    pub max_conds_py: Option<usize>,
    /// How many of the cause's parents MCI conditions on; `None`: all.
    pub max_conds_px: Option<usize>,
    /// PCMCI+: the same for lagged causes; `None`: as `max_conds_px`.
    pub max_conds_px_lagged: Option<usize>,
    /// Correction of the p-values of links.
    pub fdr: Fdr,
    /// Which links may exist; `None`: all.
    pub link_assumptions: Option<LinkAssumptions>,
}

/// Levels from which PCMCI chooses by score if none is given.
pub const PC_ALPHAS: [f64; 6] = [0.05, 0.1, 0.2, 0.3, 0.4, 0.5];

/// Levels from which PCMCI+ chooses by score if none is given.
pub const PCMCIPLUS_ALPHAS: [f64; 5] = [0.001, 0.005, 0.01, 0.025, 0.05];

impl Default for PcmciSettings {
    fn default() -> Self {
        Self {
            tau_min: 1,
            tau_max: 1,
            pc_alpha: vec![0.2],
            alpha_level: 0.05,
            max_conds_dim: None,
            max_combinations: 1,
            max_conds_py: None,
            max_conds_px: None,
            max_conds_px_lagged: None,
            fdr: Fdr::None,
            link_assumptions: None,
        }
    }
}

impl PcmciSettings {
    /// Checks the settings against the data and the test.
    pub(crate) fn check(&self, data: &DataFrame, test: &dyn CondIndTest) -> Result<()> {
        if self.tau_min > self.tau_max {
            return Err(Error::param(
                "tau_min",
                format!("{} is larger than tau_max = {}", self.tau_min, self.tau_max),
            ));
        }
        let longest = data.recordings().iter().map(|r| r.nrows()).max().unwrap_or(0);
        let cut_off = self.cut_off();
        if longest <= cut_off {
            return Err(Error::Data(format!(
                "the longest recording has {longest} samples; tau_max = {} needs at least {}: record longer or \
                 lower tau_max",
                self.tau_max,
                cut_off + 4
            )));
        }
        for (name, value) in
            self.pc_alpha.iter().map(|a| ("pc_alpha", *a)).chain([("alpha", self.alpha_level)])
        {
            let allowed = value > 0.0 && (value < 1.0 || (value == 1.0 && name == "pc_alpha"));
            let threshold = test.decides_by_value() && value > 0.0 && value.is_finite();
            if !allowed && !threshold {
                return Err(Error::param(name, format!("{value} is not between 0 and 1")));
            }
        }
        if self.max_combinations == 0 {
            return Err(Error::param("max_combinations", "0 is not allowed; give 1 or more"));
        }
        if self.fdr != Fdr::None && test.decides_by_value() {
            return Err(Error::param("fdr", "fixed_thres gives no p-values to correct; choose fdr none"));
        }
        match &self.link_assumptions {
            Some(links) => links.check(data.n_vars(), self.tau_min, self.tau_max),
            None => Ok(()),
        }
    }

    pub(crate) fn cut_off(&self) -> usize {
        2 * self.tau_max
    }

    /// The given assumptions, or all links.
    pub(crate) fn links(&self, n_vars: usize) -> LinkAssumptions {
        self.link_assumptions
            .clone()
            .unwrap_or_else(|| LinkAssumptions::all(n_vars, self.tau_min, self.tau_max))
    }

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

/// PCMCI (Runge et al. 2019): PC1 selects conditions, then MCI tests every link under them.
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
    if parents.len() != n_vars || wrong.is_some() {
        return Err(Error::param(
            "parents",
            format!("give {n_vars} lists of variables 0..{n_vars} at lags 1..={}", settings.tau_max),
        ));
    }
    with_run(data, test, settings, control, |run, links, result| {
        settings.mci(links, parents).run(run, result)
    })
}

/// Full conditional independence: tests each link given all other lagged links into its target.
///
/// # Errors
/// As [`run_pcmci`].
pub fn run_fullci(
    data: &DataFrame,
    test: &dyn CondIndTest,
    settings: &PcmciSettings,
    control: &Control,
) -> Result<PcmciResult> {
    run_with_conditions(data, test, settings, control, false, |links, target| {
        links.of_target(target).map(|(node, _)| node).filter(|node| node.lag > 0).collect()
    })
}

/// Bivariate conditional independence: tests each link given the past of its target.
///
/// # Errors
/// As [`run_pcmci`].
pub fn run_bivci(
    data: &DataFrame,
    test: &dyn CondIndTest,
    settings: &PcmciSettings,
    control: &Control,
) -> Result<PcmciResult> {
    run_with_conditions(data, test, settings, control, true, |links, target| {
        let own = |node: &Node| node.lag > 0 && node.var == target;
        links.of_target(target).map(|(node, _)| node).filter(own).collect()
    })
}

/// Unconditional dependence of all pairs at all lags.
///
/// # Errors
/// As [`run_pcmci`].
pub fn get_lagged_dependencies(
    data: &DataFrame,
    test: &dyn CondIndTest,
    settings: &PcmciSettings,
    control: &Control,
) -> Result<PcmciResult> {
    run_with_conditions(data, test, settings, control, false, |_, _| Vec::new())
}

fn run_with_conditions(
    data: &DataFrame,
    test: &dyn CondIndTest,
    settings: &PcmciSettings,
    control: &Control,
    directed: bool,
    conditions: impl Fn(&LinkAssumptions, usize) -> Vec<Node>,
) -> Result<PcmciResult> {
    with_run(data, test, settings, control, |run, links, result| {
        let conditions: Vec<_> = (0..run.n_vars()).map(|target| conditions(links, target)).collect();
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
    let links = settings.links(data.n_vars());
    if body(&run, &links, &mut result)? {
        let (done, n) = (run.n_tests(), control.estimated_total());
        result.status =
            Status::Partial(format!("the time budget ended the run after {done} of about {n} tests"));
    }
    result.n_tests = run.n_tests();
    Ok(result)
}

pub(crate) fn nodes_of(parents: &[TargetParents]) -> Vec<Vec<Node>> {
    parents.iter().map(|target| target.parents.clone()).collect()
}
