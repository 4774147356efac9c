//! The paths of one action, by each graph that the model may stand for; and where they leave the data.

use roscausal_discovery::Node;

use super::sentences::short;
use crate::{
    model::{Directed, Schedule, StructuralModel},
    question::{Situation, WhatIf},
    simulate::{Ensemble, bit, observed_again, simulate},
};

/// Part of the paths outside from which on a step is not supported, and from which on an action is refused.
const LEAVING: f64 = 0.25;
const REFUSED: f64 = 0.5;
/// Part of the range of what was seen by which a value may lie beyond it.
const BEYOND: f64 = 0.25;

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
}

/// Simulates an action, or runs the observed rows again under it. What is not `needed` for the answer may be missing.
pub(super) fn outcomes(
    model: &StructuralModel,
    situation: &Situation<'_>,
    schedule: &Schedule,
    question: &WhatIf,
    needed: &[bool],
) -> Outcomes {
    let memory = model.graph_memory();
    let first = situation.now + 1 - memory;
    let mut all = Vec::new();
    let (mut supported, mut refused) = (schedule.steps(), None);
    for member in model.members() {
        let directed = &member.model;
        let past = situation.stretch(first, situation.now);
        let paths = if question.counterfactual {
            let rows = situation.stretch(first, situation.now + schedule.steps());
            observed_again(directed, &rows, memory, schedule)
        } else {
            simulate(directed, &past, schedule, question.paths, question.seed, true)
        };
        let cells =
            (0..schedule.steps()).flat_map(|step| (0..directed.graph.len()).map(move |var| (step, var)));
        let mean = cells.map(|(step, var)| paths.mean(step, var)).collect();
        let outcome = Outcome { paths, mean };
        let share = |step: usize| outcome.paths.share_outside(step, u64::MAX);
        supported = supported
            .min((0..schedule.steps()).find(|&step| share(step) > LEAVING).unwrap_or(schedule.steps()));
        refused = refused
            .or_else(|| missing(directed, schedule, needed))
            .or_else(|| too_far(directed, &past, schedule, &outcome.paths));
        all.push(outcome);
    }
    Outcomes { all, supported, refused }
}

/// An equation that is needed and could not be fitted.
fn missing(model: &Directed, schedule: &Schedule, needed: &[bool]) -> Option<String> {
    let free = |var: &usize| needed[*var] && !schedule.is_always_set(*var);
    let var = (0..model.graph.len()).filter(free).find(|&var| model.system.equations[var].is_none())?;
    model.summaries[var].missing.clone()
}

/// A value that acts on another variable where the data do not reach: which, and what was seen.
fn too_far(model: &Directed, past: &[f64], schedule: &Schedule, paths: &Ensemble) -> Option<String> {
    let graph = &model.graph;
    for var in 0..graph.len() {
        let Some(start) = (0..schedule.steps()).find(|&step| schedule.touches(step, var)) else { continue };
        let acts = |child: usize| {
            let lags =
                graph.parents(child).iter().filter(|parent| parent.var == var).map(|parent| parent.lag);
            let steps = lags
                .map(|lag| start + lag)
                .filter(|&step| step < schedule.steps() && !schedule.is_set(step, child));
            steps.min().map(|step| (step, child))
        };
        let children: Vec<(usize, usize)> =
            (0..graph.len()).filter(|&child| child != var).filter_map(acts).collect();
        let Some(step) = children.iter().map(|(step, _)| *step).min() else { continue };
        for (_, child) in children.iter().filter(|(at, _)| *at == step) {
            if paths.share_outside(step, bit(*child)) > REFUSED
                || is_beyond(model, past, paths, (step, *child), var)
            {
                return Some(far(model, past, paths, (step, *child), var));
            }
        }
    }
    None
}

/// Whether the paths ask an equation about a mean value of the acting variable that is far beyond all that were seen. Among many
/// parents the distance of a state may hide this.
fn is_beyond(
    model: &Directed,
    past: &[f64],
    paths: &Ensemble,
    (step, child): (usize, usize),
    acting: usize,
) -> bool {
    let Some(support) = &model.supports[child] else { return false };
    let parents = model.graph.parents(child);
    let beyond = |(k, parent): (usize, &Node)| {
        let Some((low, high)) = support.range(k).filter(|_| parent.var == acting) else { return false };
        let value = mean_of(past, paths, *parent, step);
        let margin = BEYOND * (high - low);
        value < low - margin || value > high + margin
    };
    parents.iter().enumerate().any(beyond)
}

/// The mean over the paths of a parent, seen from a step; before the first, what was.
fn mean_of(past: &[f64], paths: &Ensemble, parent: Node, step: usize) -> f64 {
    match step.checked_sub(parent.lag) {
        Some(at) => paths.mean(at, parent.var),
        None => past[(past.len() / paths.n + step - parent.lag) * paths.n + parent.var],
    }
}

fn far(
    model: &Directed,
    past: &[f64],
    paths: &Ensemble,
    (step, child): (usize, usize),
    acting: usize,
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
        return format!("the data do not reach where {} acts on {}", names[acting], names[child]);
    };
    let beyond = place[k] < low || place[k] > high;
    let seen = format!("{} from {} to {}", names[parents[k].var], short(low), short(high));
    let what = format!("{} = {}", names[parents[k].var], short(place[k]));
    if beyond {
        format!(
            "the data do not reach {what} (seen: {seen}), on which {} depends; ask within what was seen, or record it",
            names[child]
        )
    } else {
        format!(
            "the data have {seen}, but never {what} together with a state like this one, on which {} depends; ask for less of a \
             change, or record it",
            names[child]
        )
    }
}

impl StructuralModel {
    /// Rows of the past that every member reads, at least one.
    pub fn graph_memory(&self) -> usize {
        self.members().iter().map(|member| member.model.graph.memory()).max().unwrap_or(0).max(1)
    }
}
