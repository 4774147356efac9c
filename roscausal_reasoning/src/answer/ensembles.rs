//! The paths of one action, by each graph that the model may stand for; and where they leave the data.

use roscausal_discovery::Node;

use super::sentences::short;
use crate::{
    model::{Directed, Schedule, StructuralModel},
    question::{Situation, WhatIf},
    simulate::{Ensemble, Stop, bit, observed_again, simulate},
};

/// Part of the paths outside from which on a step is not supported, and from which on an action is refused.
const LEAVING: f64 = 0.25;
const REFUSED: f64 = 0.5;
/// Part of the recorded range by which a value may lie beyond it, as a sensor rounds.
const ROUNDING: f64 = 0.01;

/// What one graph says of one action.
pub(super) struct Outcome {
    pub(super) paths: Ensemble,
    /// The mean, `[step * n + var]`.
    pub(super) mean: Vec<f64>,
}

/// One action under every graph.
pub(super) struct Outcomes {
    /// By member.
    pub(super) all: Vec<Outcome>,
    /// Steps before the paths leave what was seen.
    pub(super) supported: usize,
    /// Why the action is refused.
    pub(super) refused: Option<String>,
    /// What the action leads its own variable to, at a later step, that was never seen.
    pub(super) unseen: Option<String>,
}

/// Simulates an action, or runs the observed rows again under it. What is not `needed` for the answer may be missing.
pub(super) fn outcomes(
    model: &StructuralModel,
    situation: &Situation<'_>,
    schedule: &Schedule,
    question: &WhatIf,
    needed: &[bool],
    stop: Stop<'_>,
) -> Outcomes {
    let memory = model.graph_memory();
    let first = situation.now + 1 - memory;
    let (mut all, mut supported) = (Vec::new(), schedule.steps());
    let (mut refused, mut unseen) = (None, None);
    let known = situation.now + if question.counterfactual { schedule.steps() } else { 0 };
    let seen = |var: usize| {
        let rows = situation.rows.slice(ndarray::s![first..=known, var]);
        model.samples().range(var).map(|(low, high)| {
            rows.iter().fold((low, high), |(low, high), &value| (low.min(value), high.max(value)))
        })
    };
    let seen: Vec<Option<(f64, f64)>> = (0..needed.len()).map(seen).collect();
    let equations = (0..needed.len()).filter(|&var| needed[var]).fold(0, |bits, var| bits | bit(var));
    for member in model.members() {
        let directed = &member.model;
        let past = situation.stretch(first, situation.now);
        let paths = if question.counterfactual {
            observed_again(directed, &situation.stretch(first, known), memory, schedule)
        } else {
            simulate(directed, &past, schedule, question.paths, question.seed, true, stop)
        };
        let cells =
            (0..schedule.steps()).flat_map(|step| (0..directed.graph.len()).map(move |var| (step, var)));
        let mean = cells.map(|(step, var)| paths.mean(step, var)).collect();
        let outcome = Outcome { paths, mean };
        // A forecast that leaves what was recorded, also of what no equation reads.
        let mean = |step: usize, var: usize| outcome.mean[step * needed.len() + var];
        let strays = |step: usize| {
            let free = |var: &usize| needed[*var] && !schedule.touches(step, *var) && seen[*var].is_some();
            (0..needed.len()).filter(free).find(|&var| !is_seen(seen[var], mean(step, var)))
        };
        let leaves = |step: usize| outcome.paths.share_outside(step, equations) > LEAVING;
        let left = |step: &usize| leaves(*step) || strays(*step).is_some();
        let new = Unseen::of(model, schedule, &outcome.paths);
        let ends = [(0..schedule.steps()).find(left), new.step];
        supported = ends.into_iter().flatten().fold(supported, usize::min);
        refused = refused
            .or_else(|| missing(directed, schedule, needed))
            .or(new.at_once)
            .or_else(|| too_far(directed, &past, schedule, &outcome.paths))
            .or_else(|| {
                (supported == 0).then(|| match strays(0).filter(|_| !leaves(0)) {
                    Some(var) => not_reached(&directed.graph.names()[var], mean(0, var), seen[var], ""),
                    None => no_step(directed, &past, &outcome.paths, needed),
                })
            });
        unseen = unseen.or(new.reason);
        all.push(outcome);
    }
    Outcomes { all, supported, refused, unseen }
}

/// An equation that is needed and could not be fitted.
fn missing(model: &Directed, schedule: &Schedule, needed: &[bool]) -> Option<String> {
    let free = |var: &usize| needed[*var] && !schedule.is_always_set(*var);
    let var = (0..model.graph.len()).filter(free).find(|&var| model.system.equations[var].is_none())?;
    model.summaries[var].missing.clone()
}

/// Where an action leads its own variables to values that were never recorded, whatever the graph says of them.
#[derive(Default)]
struct Unseen {
    /// The first such step.
    step: Option<usize>,
    /// What the data do not reach there.
    reason: Option<String>,
    /// The same if it refuses the action: a value that is set, or the first one of a shift.
    at_once: Option<String>,
}

impl Unseen {
    fn of(model: &StructuralModel, schedule: &Schedule, paths: &Ensemble) -> Self {
        let mut unseen = Self::default();
        let touched = |var: usize| (0..schedule.steps()).filter(move |&step| schedule.touches(step, var));
        for var in 0..paths.n {
            let Some(start) = touched(var).next() else { continue };
            let seen = model.samples().range(var);
            let value = |step: usize| schedule.value(step, var).unwrap_or_else(|| paths.mean(step, var));
            for step in touched(var).filter(|&step| !is_seen(seen, value(step))) {
                let reason = || not_reached(&model.graph().names()[var], value(step), seen, "");
                if unseen.step.is_none_or(|first| step < first) {
                    (unseen.step, unseen.reason) = (Some(step), Some(reason()));
                }
                if unseen.at_once.is_none() && (schedule.is_set(step, var) || step == start) {
                    unseen.at_once = Some(reason());
                }
            }
        }
        unseen
    }
}

/// Whether a value lies within what was recorded; one that is unknown is nowhere.
fn is_seen(seen: Option<(f64, f64)>, value: f64) -> bool {
    let Some((low, high)) = seen else { return false };
    let margin = ROUNDING * (high - low) + 1e-9 * low.abs().max(high.abs());
    value.is_nan() || (value >= low - margin && value <= high + margin)
}

/// `the data do not reach r_v = 9 (seen: r_v from 0.2 to 0.8) ...; ask within what was seen, or record it`.
fn not_reached(name: &str, value: f64, seen: Option<(f64, f64)>, depends: &str) -> String {
    let seen = match seen {
        Some((low, high)) if low == high => format!("seen: {name} = {} in every row", short(low)),
        Some((low, high)) => format!("seen: {name} from {} to {}", short(low), short(high)),
        None => format!("seen: no value of {name}"),
    };
    let value = short(value);
    format!(
        "the data do not reach {name} = {value} ({seen}){depends}; ask within what was seen, or record it"
    )
}

/// A value that acts on another variable where the data do not reach: which, and what was seen.
fn too_far(model: &Directed, past: &[f64], schedule: &Schedule, paths: &Ensemble) -> Option<String> {
    let graph = &model.graph;
    for var in 0..graph.len() {
        let Some(start) = (0..schedule.steps()).find(|&step| schedule.touches(step, var)) else { continue };
        let acts = |child: usize| {
            let own = graph.parents(child).iter().filter(|parent| parent.var == var);
            let free = |&step: &usize| step < schedule.steps() && !schedule.is_set(step, child);
            let first = own.map(|parent| start + parent.lag).filter(free).min();
            first.map(|step| (step, child))
        };
        let children: Vec<(usize, usize)> =
            (0..graph.len()).filter(|&child| child != var).filter_map(acts).collect();
        let Some(step) = children.iter().map(|(step, _)| *step).min() else { continue };
        let leaves =
            |&&(at, child): &&(usize, usize)| at == step && paths.share_outside(step, bit(child)) > REFUSED;
        if let Some(place) = children.iter().find(leaves) {
            return Some(far(model, past, paths, *place, true));
        }
    }
    None
}

/// Why not even the first step is supported: the equation that most paths ask outside its support.
fn no_step(model: &Directed, past: &[f64], paths: &Ensemble, needed: &[bool]) -> String {
    let share = |var: usize| paths.share_outside(0, bit(var));
    let child =
        (0..paths.n).filter(|&var| needed[var]).max_by(|&a, &b| share(a).total_cmp(&share(b))).unwrap_or(0);
    far(model, past, paths, (0, child), false)
}

/// The mean over the paths of a parent, seen from a step; before the first, what was.
fn mean_of(past: &[f64], paths: &Ensemble, parent: Node, step: usize) -> f64 {
    match step.checked_sub(parent.lag) {
        Some(at) => paths.mean(at, parent.var),
        None => past[(past.len() / paths.n + step - parent.lag) * paths.n + parent.var],
    }
}

/// What of a variable's parents the data do not reach at a step. `acting`: an action
/// led there; else the moment itself is like that.
fn far(
    model: &Directed,
    past: &[f64],
    paths: &Ensemble,
    (step, child): (usize, usize),
    acting: bool,
) -> String {
    let (graph, names) = (&model.graph, model.graph.names());
    // The paths' mean state: what the equation is asked.
    let value = |parent: &Node| mean_of(past, paths, *parent, step);
    let parents = graph.parents(child);
    let place: Vec<f64> = parents.iter().map(value).collect();
    let support = model.supports[child].as_ref();
    let Some((k, (low, high))) =
        support.and_then(|s| s.farthest(&place).and_then(|k| Some((k, s.range(k)?))))
    else {
        return format!("the data do not reach the state on which {} depends", names[child]);
    };
    let name = &names[parents[k].var];
    let depends = format!(", on which {} depends", names[child]);
    if place[k] < low || place[k] > high {
        return not_reached(name, place[k], Some((low, high)), &depends);
    }
    let ask = if acting { "ask for less of a change" } else { "ask about another moment" };
    let (low, high, value) = (short(low), short(high), short(place[k]));
    format!(
        "the data have {name} from {low} to {high}, but never {name} = {value} together with a state like this \
         one{depends}; {ask}, or record it"
    )
}

impl StructuralModel {
    /// Rows of the past that every member reads, at least one.
    pub fn graph_memory(&self) -> usize {
        self.members().iter().map(|member| member.model.graph.memory()).max().unwrap_or(0).max(1)
    }
}
