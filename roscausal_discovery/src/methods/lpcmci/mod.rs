//! LPCMCI: lagged and contemporaneous links where common causes may be hidden.
//!
//! Source: Gerhardus and Runge 2020, NeurIPS, "High-recall causal discovery for autocorrelated time series with latent
//! confounders".
//!
//! 1. Preliminary phases: the ancestral phase runs and learns causes; all but these is forgotten.
//! 2. Ancestral phase ([`phases`]): tests each pair given known parents of both and subsets of possible causes. What removes
//!    links makes rules fire; what they learn joins the conditions, which gives the tests their power under autocorrelation.
//! 3. Non-ancestral phase: also conditions on nodes over which a path through hidden causes may run.
//! 4. The rules run once more ([`rules`]), and what is left open stays a circle.
//!
//! [`tsfci`] is the older method for the same question, with the same graph and rules.
//!
//! Example: `x` and `y` are both driven by something that nobody recorded. PCMCI+ draws a cause; LPCMCI draws `<->`, or a circle
//! where the data cannot tell.

mod answers;
mod graph;
mod knowledge;
mod minimal;
mod phases;
mod rules;
mod search;
mod sets;
mod settings;
mod tsfci;
mod votes;

pub use settings::LpcmciSettings;
pub use tsfci::run_tsfci;

use self::{
    graph::{Middle, Pair},
    rules::{Rules, apply_rules},
    search::Search,
};
use super::{
    result::{PcmciResult, Status},
    run::Run,
};
use crate::types::{CondIndTest, Control, DataFrame, LinkMark, Node, Result, Samples};

/// The graph after a phase, for study.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stage {
    /// The phase, such as `ancestral`.
    pub after: String,
    /// Links from a node to a variable at lag 0, with the middle mark: `o!>`.
    pub links: Vec<(Node, usize, String)>,
    /// Known causes: the node, and the variable at lag 0 that it causes.
    pub ancestors: Vec<(Node, usize)>,
}

/// What LPCMCI finds: the result, and the graph after each phase.
#[derive(Clone, Debug)]
pub struct LpcmciResult {
    /// Graph, values and p-values. A link's p-value is the largest of its tests.
    pub result: PcmciResult,
    /// The graph after each phase.
    pub stages: Vec<Stage>,
    /// Tests asked, those included whose answer was known.
    pub n_asked: usize,
}

/// LPCMCI: what causes what, where common causes may be hidden.
///
/// Take it when not everything was recorded, which is always so with robots. A mark at the cause says what is known: `-->`
/// causes, `<->` does not (something hidden drives both), `o->` one of the two.
///
/// ```
/// use roscausal_discovery::{Control, DataFrame, LinkMark};
/// use roscausal_discovery::independence_tests::{ParCorr, TestSettings};
/// use roscausal_discovery::methods::{LpcmciSettings, run_lpcmci};
///
/// # let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0) - 0.5;
/// // `h` drives `a` and `b`, and is not recorded.
/// let mut values = ndarray::Array2::zeros((2000, 2));
/// for t in 2..2000 {
///     let h = noise(3 * (t - 1));
///     values[[t, 0]] = 0.5 * values[[t - 1, 0]] + h + 0.5 * noise(3 * t + 1);
///     values[[t, 1]] = 0.5 * values[[t - 1, 1]] + h + 0.5 * noise(3 * t + 2);
/// }
/// let data = DataFrame::new(vec![values], vec!["a".into(), "b".into()])?;
/// let test = ParCorr::new(&TestSettings::default())?;
/// let settings = LpcmciSettings { tau_max: 2, pc_alpha: 0.01, ..LpcmciSettings::default() };
/// let found = run_lpcmci(&data, &test, &settings, &Control::default())?;
/// assert_eq!(found.result.graph[[0, 1, 0]], LinkMark::Bidirected);
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
///
/// # Errors
/// Settings or data that do not match, a test that fails, or cancellation. Running out of time is not an error: the status says
/// in which phase, and the graph is what is left so far.
pub fn run_lpcmci(
    data: &DataFrame,
    test: &dyn CondIndTest,
    settings: &LpcmciSettings,
    control: &Control,
) -> Result<LpcmciResult> {
    settings.check(data, test)?;
    let samples = Samples::new(data, 2 * settings.tau_max).with_control(control.clone());
    let run = Run::new(test, &samples)?;
    let mut search = Search::new(&run, settings);
    let mut stages = Vec::new();
    let ended = all_phases(&mut search, &mut stages);
    let result = result_of(&search, &run, ended, &format!("{} phase", search.phase))?;
    Ok(LpcmciResult { result, stages, n_asked: search.n_asked })
}

/// What is found at the end of a search, or in the `phase` in which its time ended.
fn result_of(search: &Search<'_, '_>, run: &Run<'_>, ended: Result<()>, phase: &str) -> Result<PcmciResult> {
    let mut result = found(search);
    match ended {
        Err(error) if run.is_timeout(&error) => {
            let how_far = format!("the time budget ended the {phase} after {} tests", run.n_tests());
            result.status = Status::Partial(how_far);
        }
        ended => {
            ended?;
            result.remarks = run.remarks(&result.lagged_parents())?;
        }
    }
    result.effort = run.effort();
    result.n_tests = run.n_tests();
    Ok(result)
}

fn all_phases(search: &mut Search<'_, '_>, stages: &mut Vec<Stage>) -> Result<()> {
    for round in 1..=search.settings.n_preliminary_iterations {
        search.phase = format!("preliminary {round}");
        search.ancestral_phase(true)?;
        stages.push(stage(search));
        search.initialise(&search.causes_with_link());
    }
    search.phase = "ancestral".to_owned();
    search.ancestral_phase(false)?;
    stages.push(stage(search));
    if search.settings.non_ancestral_phase {
        search.phase = "non-ancestral".to_owned();
        search.non_ancestral_phase()?;
        stages.push(stage(search));
    }
    search.phase = "last".to_owned();
    search.set_middles(Middle::Final);
    apply_rules(search, Rules::Long, false)?;
    search.set_middles(Middle::Final);
    Ok(())
}

fn stage(search: &Search<'_, '_>) -> Stage {
    let links = search.graph.pairs().into_iter().map(|(pair, link)| (pair.x, pair.y.var, link.symbol()));
    let effects = (0..search.graph.n_vars).map(|var| Node::new(var, 0));
    let pairs = effects.flat_map(|y| search.graph.nodes().map(move |x| (x, y)));
    let ancestors = pairs.filter(|&(x, y)| search.is_ancestor(x, y)).map(|(x, y)| (x, y.var));
    Stage { after: search.phase.clone(), links: links.collect(), ancestors: ancestors.collect() }
}

/// Graph and evidence as a result. A link that no test has seen has value 0 and p-value 1; one that is certain 1 and 0.
fn found(search: &Search<'_, '_>) -> PcmciResult {
    let graph = &search.graph;
    let mut result = PcmciResult::untested(graph.n_vars, graph.tau_max, search.run.samples.len());
    for y in (0..graph.n_vars).map(|var| Node::new(var, 0)) {
        for x in graph.nodes().filter(|x| *x != y) {
            let link = graph.get(x, y);
            let at = [x.var, y.var, x.lag];
            result.graph[at] =
                link.map_or(LinkMark::Absent, |link| LinkMark::from_ends(link.left, link.right));
            let Some(evidence) = search.evidence(Pair::of(x, y).0) else { continue };
            let tested = evidence.p_value.is_finite();
            let (value, p_value) = match link {
                _ if tested => (evidence.value, evidence.p_value),
                Some(_) => (1.0, 0.0),
                None => (0.0, 1.0),
            };
            result.put(at, value, p_value, evidence.samples);
        }
    }
    result
}
