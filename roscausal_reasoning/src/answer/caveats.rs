//! What an answer rests on, one sentence each.

use super::{
    Outlook,
    plan::{Plan, moved},
    sentences::{listed, named, no_effect, short},
};
use crate::{
    model::StructuralModel,
    question::{Asked, WhatIf},
};

/// Coverage below which intervals are said to have been too narrow.
const NARROW: f64 = 0.05;

/// Of predictions, what-if and had-I.
pub(super) fn of_what_if(
    model: &StructuralModel,
    question: &WhatIf,
    asked: &Asked,
    outlooks: &[Outlook],
    plan: &Plan,
) -> Vec<String> {
    let acted = |var: &usize| asked.actions.iter().any(|(_, schedule)| schedule.acting().contains(var));
    let acting: Vec<usize> = (0..model.graph().len()).filter(acted).collect();
    let mut caveats: Vec<String> = acting.iter().map(|&var| imposed(model, var, "what follows")).collect();
    caveats.extend(unmoved(model, question, asked, outlooks, plan));
    if question.counterfactual {
        caveats.push(
            "had-I takes the noise of each row for what else happened then, and adds it whatever is done (additive noise); its \
             intervals hold the uncertainty of the equations only"
                .to_owned(),
        );
    }
    let short_of = |outlook: &&Outlook| !outlook.refused && outlook.supported_steps < question.horizon;
    let beyond: Vec<String> =
        outlooks.iter().filter(short_of).map(|outlook| format!("'{}'", outlook.action)).collect();
    if !beyond.is_empty() {
        let then = match question.answered_steps(0) {
            0 => "the answer ends there",
            _ => "from there on the answer is a guess along the trend",
        };
        caveats.push(format!("{} leads where the data do not reach; {then}", listed(&beyond)));
    }
    caveats.extend(quality(model, &asked.variables));
    caveats.extend(of_model(model));
    caveats
}

/// What the answered actions do not move of what was asked for: an equal forecast is not to be taken for a finding.
fn unmoved(
    model: &StructuralModel,
    question: &WhatIf,
    asked: &Asked,
    outlooks: &[Outlook],
    plan: &Plan,
) -> Vec<String> {
    let (targets, mut stated) = (asked.targets(), Vec::new());
    for (k, (_, schedule)) in asked.actions.iter().enumerate() {
        if schedule.is_free() || outlooks[k].refused {
            continue;
        }
        let (acting, moved) = (schedule.acting(), moved(model, schedule, question.horizon));
        // Where all variables are asked for, those that stay as they are need no note, unless all others do.
        let all = !question.variables.is_empty()
            || !asked.variables.iter().any(|var| moved[*var] && !acting.contains(var));
        let still =
            |var: &usize| !moved[*var] && (targets.contains(var) || (all && asked.variables.contains(var)));
        let still: Vec<usize> = (0..moved.len()).filter(still).collect();
        if still.is_empty() {
            continue;
        }
        let mut sentence = no_effect(model, &acting, &still, question.horizon);
        if plan.ranking.contains(&k) && still.iter().any(|var| targets.contains(var)) {
            let rest: Vec<usize> = targets.iter().copied().filter(|&var| moved[var]).collect();
            sentence += &format!("; it is ranked by {} alone", named(model, &rest));
        }
        if !stated.contains(&sentence) {
            stated.push(sentence);
        }
    }
    stated
}

/// Whether a variable was ever set by experiment.
pub(super) fn imposed(model: &StructuralModel, var: usize, what: &str) -> String {
    let name = &model.graph().names()[var];
    match model.samples().times_imposed(var) {
        0 => format!(
            "{name} was never imposed in these data: an unrecorded cause of {name} and of what it drives would bias {what}"
        ),
        rows => format!(
            "{name} was imposed by experiment in {rows} rows; these do not train its own equation, all others they do"
        ),
    }
}

/// Skill and coverage on rows that the model had not seen.
fn quality(model: &StructuralModel, variables: &[usize]) -> Vec<String> {
    let Some(quality) = model.members().first().and_then(|member| member.quality.as_ref()) else {
        return vec![
            "skill and intervals could not be checked on rows that the model had not seen: too few of them"
                .to_owned(),
        ];
    };
    let names = model.graph().names();
    let wanted = model.settings().interval;
    let narrow =
        |var: &&usize| quality.coverage.get(**var).copied().flatten().is_some_and(|c| c < wanted - NARROW);
    let of = |var: &usize| {
        format!("{} {} %", names[*var], short(100.0 * quality.coverage[*var].unwrap_or(f64::NAN)))
    };
    let narrow: Vec<String> = variables.iter().filter(narrow).map(of).collect();
    let mut stated = Vec::new();
    if !narrow.is_empty() {
        let (percent, narrow) = (short(100.0 * wanted), narrow.join(", "));
        stated.push(format!(
            "on the last fifth of the rows intervals of {percent} % held less often ({narrow}) and are widened accordingly"
        ));
    }
    let no_skill = |var: &usize| quality.skill(0, *var).is_some_and(|skill| skill <= 0.0);
    let without: Vec<usize> = variables.iter().copied().filter(no_skill).collect();
    if !without.is_empty() {
        let without = named(model, &without);
        stated
            .push(format!("one step ahead the model forecasts {without} no better than its last value does"));
    }
    stated
}

/// What holds for every answer of a model.
pub(super) fn of_model(model: &StructuralModel) -> Vec<String> {
    let names = model.graph().names();
    let mut caveats = Vec::new();
    let pairs: Vec<String> =
        model.graph().pairs().iter().map(|pair| format!("{} - {}", names[pair.a], names[pair.b])).collect();
    if !pairs.is_empty() {
        let (pairs, graphs) = (listed(&pairs), model.members().len());
        caveats.push(format!(
            "the direction of {pairs} is open: the answer covers the {graphs} graphs that this may stand for"
        ));
    }
    if model.members().iter().any(|member| member.against_the_rule) {
        caveats.push("each direction of the open links makes a collider that the method did not find; all of them are taken".to_owned());
    }
    if let Some(member) = model.members().first() {
        caveats.extend(member.model.noise.shared.iter().map(|pair| shared(model, *pair)));
        for (name, summary) in names.iter().zip(&member.model.summaries) {
            if let Some(reason) = &summary.missing {
                caveats.push(reason.clone());
            }
            if !summary.dropped.is_empty() {
                let dropped = listed(&summary.dropped);
                caveats.push(format!(
                    "{dropped} is left out of the equation of {name}: other parents say the same"
                ));
            }
            if summary.alone > 0 {
                let rows =
                    if summary.alone == 1 { "1 row".to_owned() } else { format!("{} rows", summary.alone) };
                caveats.push(format!(
                    "the equation of {name} has a coefficient that rests on one row alone ({rows} left out of its noise); record more \
                     rows like that"
                ));
            }
        }
    }
    if !model.facts.dropped.is_empty() {
        caveats.push(format!("{} had no link and is not part of the model", listed(&model.facts.dropped)));
    }
    caveats.extend(model.facts.warnings.iter().cloned());
    caveats
}

fn shared(model: &StructuralModel, (a, b, r): (usize, usize, f64)) -> String {
    let names = model.graph().names();
    let (a, b, r) = (&names[a], &names[b], short(r));
    format!(
        "what the equations of {a} and {b} leave is correlated ({r}): they share something unrecorded, or a link is missing"
    )
}

/// What makes an effect of one of the `causes` on one of the `effects` doubtful: what their equations leave is correlated.
pub(super) fn shared_by(model: &StructuralModel, causes: &[usize], effects: &[usize]) -> Option<String> {
    let is_asked = |a: &usize, b: &usize| causes.contains(a) && effects.contains(b);
    let pairs = &model.members().first()?.model.noise.shared;
    Some(shared(model, *pairs.iter().find(|(a, b, _)| is_asked(a, b) || is_asked(b, a))?))
}

/// The strongest path from one variable to another, over standardised coefficients: the variables on it. Empty without one.
pub(super) fn strongest_path(model: &StructuralModel, from: usize, to: usize) -> Vec<usize> {
    let n = model.graph().len();
    // Strongest link of each ordered pair.
    let mut strength = vec![0.0_f64; n * n];
    if let Some(member) = model.members().first() {
        let deviations = &member.model.deviations;
        for effect in 0..n {
            let parents = member.model.graph.parents(effect);
            for (parent, b) in parents.iter().zip(&member.model.summaries[effect].coefficients) {
                let size =
                    (b * deviations[parent.var] / deviations[effect].max(f64::MIN_POSITIVE)).abs().min(1.0);
                let cell = &mut strength[parent.var * n + effect];
                *cell = cell.max(size);
            }
        }
    }
    // Widest products first, as by Dijkstra on -log.
    let (mut best, mut before, mut done) = (vec![0.0_f64; n], vec![usize::MAX; n], vec![false; n]);
    best[from] = 1.0;
    while let Some(var) =
        (0..n).filter(|&v| !done[v] && best[v] > 0.0).max_by(|&a, &b| best[a].total_cmp(&best[b]))
    {
        done[var] = true;
        for next in (0..n).filter(|&next| next != var) {
            let through = best[var] * strength[var * n + next];
            if !done[next] && through > best[next] {
                (best[next], before[next]) = (through, var);
            }
        }
    }
    if from == to || best[to] == 0.0 {
        return Vec::new();
    }
    let mut path = vec![to];
    while let Some(&last) = path.last().filter(|last| **last != from) {
        path.push(before[last]);
    }
    path.reverse();
    path
}

/// `r_v -> d -> h_v`.
pub(super) fn arrows(model: &StructuralModel, path: &[usize]) -> String {
    path.iter().map(|&var| model.graph().names()[var].as_str()).collect::<Vec<_>>().join(" -> ")
}

/// The least certain link on a path, where p-values are known.
pub(super) fn weakest_link(model: &StructuralModel, path: &[usize]) -> Option<String> {
    let names = model.graph().names();
    let p_of = |pair: &[usize]| {
        let (cause, effect) = (&names[pair[0]], &names[pair[1]]);
        let all = model.facts.p_values.iter().filter(|(c, e, ..)| c == cause && e == effect);
        all.map(|(.., p)| *p).min_by(f64::total_cmp).map(|p| (cause, effect, p))
    };
    let (cause, effect, p) = path.windows(2).filter_map(p_of).max_by(|a, b| a.2.total_cmp(&b.2))?;
    let p = if p < 0.001 { "p < 0.001".to_owned() } else { format!("p = {}", short(p)) };
    Some(format!("the weakest link on the path {} is {cause} -> {effect} ({p})", arrows(model, path)))
}
