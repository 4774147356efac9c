//! PCMCI, its two halves, and the simpler methods beside it.

use super::{
    mci::Mci,
    pc_stable::PcStable,
    result::{PcmciResult, Status, TargetParents},
    run::Run,
    settings::{PC_ALPHAS, PcmciSettings},
};
use crate::ground::{CondIndTest, Control, DataFrame, Error, LinkAssumptions, Node, Result, Samples};

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

/// PC1 alone: the parents of each target, strongest first (`graph` and matrices stay empty).
///
/// # Errors
/// Settings or data that do not fit together; a test that fails; cancellation.
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

/// PCMCI (Runge et al. 2019): PC1, then MCI under the parents it found.
///
/// # Errors
/// Settings or data that do not fit together; a test that fails; cancellation. A time budget that ends is not an
/// error: see [`PcmciResult::status`].
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

/// MCI alone, under the given parents of each target, strongest first.
///
/// # Errors
/// As [`run_pcmci`]; also parents of a wrong number or lag.
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

/// Full conditional independence: each link given all other lagged links into its target.
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

/// Bivariate conditional independence: each link given its target's own past.
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

/// Unconditional dependencies at all lags.
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

/// Checks, prepares the test, runs `body` (which says whether time ran out) and fills in what all results have.
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
