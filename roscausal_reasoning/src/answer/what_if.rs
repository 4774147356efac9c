//! Predict, what if, had I: paths under actions, in numbers and words.

use super::{
    Forecast, Outlook, Status, WhatIfAnswer, ambiguity, caveats,
    effect::bounds,
    ensembles::{Outcomes, outcomes},
    plan::{Plan, moved},
    sentences::{listed, short, steps, with_unit},
};
use crate::{
    model::{Schedule, StructuralModel},
    question::{Asked, Situation, WhatIf},
    simulate::Stop,
};

/// Part of a variable's deviation below which an effect is none.
const NOTHING: f64 = 0.05;

/// What will happen if nobody acts.
pub fn predict(
    model: &StructuralModel,
    situation: &Situation<'_>,
    horizon: usize,
    paths: usize,
    seed: u64,
) -> WhatIfAnswer {
    what_if(model, situation, &WhatIf { horizon, paths, seed, ..WhatIf::default() })
}

/// What will happen under each action, or would have happened; and which is best.
pub fn what_if(model: &StructuralModel, situation: &Situation<'_>, question: &WhatIf) -> WhatIfAnswer {
    what_if_until(model, situation, question, &|| false)
}

/// As [`what_if`], until `stop` is true: then the answer is [`Status::Late`].
pub fn what_if_until(
    model: &StructuralModel,
    situation: &Situation<'_>,
    question: &WhatIf,
    stop: Stop<'_>,
) -> WhatIfAnswer {
    let refuse = |status, message: String| WhatIfAnswer {
        status,
        message,
        dt: model.facts.dt,
        model_id: model.id(),
        ..WhatIfAnswer::default()
    };
    let (graphs, refits) = (model.members().len(), model.settings().members);
    let asked = match question.checked(model.graph().names(), graphs, refits) {
        Ok(asked) => asked,
        Err(message) => return refuse(Status::BadRequest, message),
    };
    let needed = needed(model, &asked);
    if let Err((status, message)) = rows_there(model, situation, question, &needed) {
        return refuse(status, message);
    }
    let free = Schedule::free(model.graph().len(), question.horizon);
    // What the actions are compared with, where graphs may disagree.
    let of = |schedule: &Schedule| outcomes(model, situation, schedule, question, &needed, stop);
    let baseline = (model.members().len() > 1).then(|| of(&free));
    let all: Vec<Outcomes> = asked.actions.iter().map(|(_, schedule)| of(schedule)).collect();
    if stop() {
        let reason =
            "there was no answer within the question's patience; ask for a shorter horizon or fewer actions";
        return refuse(Status::Late, reason.to_owned());
    }
    let plan = Plan::of(model, &asked, &all, question.horizon);
    let stands = |k: usize| !question.allow_extrapolation || model_lacks(model, &asked.actions[k].1, &needed);
    let refused = |k: usize| all[k].refused.as_ref().filter(|_| stands(k));
    let ranked = !asked.targets().is_empty();
    let mut depends = None;
    let mut outlooks = Vec::new();
    for (k, (name, schedule)) in asked.actions.iter().enumerate() {
        let mut outlook =
            outlook(model, question, (name, schedule), &all[k], &asked.variables, refused(k).is_some());
        outlook.text = match refused(k) {
            Some(reason) => {
                (outlook.cost, outlook.cost_lower, outlook.cost_upper) = (f64::NAN, f64::NAN, f64::NAN);
                format!("{name}: not answered: {reason}.")
            }
            None => {
                outlook.priced(&plan, k, 0.5 * (1.0 - model.settings().interval));
                let plan = ranked.then_some((&plan, k));
                text(model, situation, question, &outlook, (&asked.variables, schedule), plan)
            }
        };
        if let (Some(baseline), None, false) = (&baseline, &depends, schedule.is_free()) {
            let on_link = |&var: &usize| depends_on_link(model, &all[k], baseline, schedule, var);
            depends = asked.variables.iter().find_map(on_link);
        }
        outlooks.push(outlook);
    }
    let depends = depends.or_else(|| {
        let acting: Vec<usize> = asked.actions.iter().flat_map(|(_, schedule)| schedule.acting()).collect();
        let named = if question.variables.is_empty() { &[][..] } else { &asked.variables };
        let moved = asked.actions.iter().map(|(_, schedule)| moved(model, schedule, question.horizon));
        let moved: Vec<Vec<bool>> = moved.collect();
        let is_moved = |var: &usize| moved.iter().any(|moved| moved[*var]);
        let effects: Vec<usize> = named.iter().copied().chain(asked.targets()).filter(is_moved).collect();
        caveats::shared_by(model, &acting, &effects)
    });
    let reasons: Vec<&String> = (0..all.len()).filter_map(refused).collect();
    let (status, message) = if reasons.len() == all.len() {
        (Status::NotSupported, reasons.first().map_or(String::new(), |reason| (*reason).clone()))
    } else if let Some(reason) = no_step(&all) {
        // Answered as a guess, since the question allows it.
        (Status::NotSupported, reason)
    } else if let Some(message) = depends {
        (Status::Ambiguous, message)
    } else if ranked && plan.ranking.is_empty() {
        let answered: Vec<usize> = (0..all.len()).filter(|&k| refused(k).is_none()).collect();
        (Status::Ok, plan.why_empty(&asked, &answered))
    } else {
        (Status::Ok, String::new())
    };
    let caveats = caveats::of_what_if(model, question, &asked, &outlooks, &plan);
    WhatIfAnswer {
        status,
        message,
        dt: model.facts.dt,
        model_id: model.id(),
        outlooks,
        ranking: plan.ranking,
        caveats,
    }
}

impl Outlook {
    /// Enters what the plan says of action `k`; `tail` is the part of the costs beyond each end of the interval.
    fn priced(&mut self, plan: &Plan, k: usize, tail: f64) {
        let price = &plan.prices[k];
        self.cost = price.mean();
        (self.cost_lower, self.cost_upper) = bounds(price.costs.iter().copied(), tail);
        (self.probability_limits, self.probability_best) = (price.all_kept, plan.best[k]);
    }
}

/// Why the data carry no step of any action, if they carry none.
fn no_step(all: &[Outcomes]) -> Option<String> {
    let first = all.first().filter(|_| all.iter().all(|one| one.supported == 0))?;
    let unknown = || "the data carry no step of any action; ask about another moment".to_owned();
    Some(first.refused.clone().or_else(|| first.unseen.clone()).unwrap_or_else(unknown))
}

/// By variable: whether the answer is about it, or about something that it drives.
fn needed(model: &StructuralModel, asked: &Asked) -> Vec<bool> {
    let mut open = asked.variables.clone();
    open.extend(asked.cost.iter().map(|(var, _)| *var));
    open.extend(asked.limits.iter().map(|(var, ..)| *var));
    let mut needed = vec![false; model.graph().len()];
    while let Some(var) = open.pop() {
        if !std::mem::replace(&mut needed[var], true) {
            for member in model.members() {
                open.extend(member.model.graph.parents(var).iter().map(|parent| parent.var));
            }
        }
    }
    needed
}

/// Whether an equation that the action needs is missing: then nothing can be extrapolated.
fn model_lacks(model: &StructuralModel, schedule: &Schedule, needed: &[bool]) -> bool {
    let free = |var: &usize| needed[*var] && !schedule.is_always_set(*var);
    let lacks =
        |var: usize| model.members().iter().any(|member| member.model.system.equations[var].is_none());
    (0..model.graph().len()).filter(free).any(lacks)
}

/// Whether the rows that the question needs are there.
fn rows_there(
    model: &StructuralModel,
    situation: &Situation<'_>,
    question: &WhatIf,
    needed: &[bool],
) -> Result<(), (Status, String)> {
    let (n, names, memory) = (model.graph().len(), model.graph().names(), model.graph_memory());
    if situation.rows.ncols() != n {
        let (columns, names) = (situation.rows.ncols(), names.join(", "));
        let message = format!("the rows have {columns} variables and the model has {n}: {names}");
        return Err((Status::NoModel, message));
    }
    let (rows, now) = (situation.rows.nrows(), situation.now);
    if now >= rows || now + 1 < memory {
        let message = format!(
            "row {now} is not answered: there are {rows} rows, and {memory} up to now are needed; record longer or ask for another time"
        );
        return Err((Status::NoData, message));
    }
    let last = if question.counterfactual { now + question.horizon } else { now };
    if last >= rows {
        let (rows, needed) = (rows - 1 - now, question.horizon);
        let message = format!(
            "had-I asks about rows that were observed: {rows} follow the row that is asked about and {needed} are needed; \
             choose an earlier time or a shorter horizon"
        );
        return Err((Status::NoData, message));
    }
    // What no equation reads may be missing, but not in rows that are run again.
    let read = |row: usize, var: usize| {
        let lag = now + 1 - row.min(now);
        let reads = |member: &crate::model::Member| {
            let by =
                |child: usize| member.model.graph.parents(child).iter().any(|p| p.var == var && p.lag >= lag);
            (0..n).any(|child| needed[child] && by(child))
        };
        (row > now && needed[var]) || model.members().iter().any(reads)
    };
    for row in now + 1 - memory..=last {
        if let Some(var) = (0..n).find(|&var| !situation.rows[[row, var]].is_finite() && read(row, var)) {
            let name = &names[var];
            let message =
                format!("{name} is missing in row {row}, which the answer needs; ask for another time");
            return Err((Status::NoData, message));
        }
    }
    Ok(())
}

fn outlook(
    model: &StructuralModel,
    question: &WhatIf,
    (name, schedule): (&str, &Schedule),
    outcomes: &Outcomes,
    variables: &[usize],
    refused: bool,
) -> Outlook {
    let n = model.graph().len();
    let steps = question.answered_steps(outcomes.supported);
    let tail = 0.5 * (1.0 - model.settings().interval);
    let shares = [tail, 0.25, 0.5, 0.75, 1.0 - tail];
    let forecast = |&var: &usize| {
        // A speed or a distance: what was never below 0 does not go there.
        let is_positive = model.samples().range(var).is_some_and(|(low, _)| low >= 0.0);
        let floor = |value: f64| if is_positive { value.max(0.0) } else { value };
        let is_forecast = |step: usize| !schedule.is_set(step, var) && !question.counterfactual;
        let mut forecast = Forecast { variable: model.graph().names()[var].clone(), ..Forecast::default() };
        for step in 0..steps {
            let (mut means, mut medians) = (0.0, 0.0);
            let (mut lower, mut upper) = (f64::INFINITY, f64::NEG_INFINITY);
            let (mut inner_lower, mut inner_upper) = (lower, upper);
            for (outcome, member) in outcomes.all.iter().zip(model.members()) {
                let [low, inner_low, median, inner_high, high] = match question.counterfactual {
                    true => outcome.paths.of_refits(step, var, model.settings().interval),
                    false => outcome.paths.quantiles(step, var, shares),
                };
                let quality = member.quality.as_ref().filter(|_| is_forecast(step));
                let wider = quality.map_or(0.0, |quality| quality.widening(step, var));
                let (by, inner_by) = (wider * (high - low), wider * (inner_high - inner_low));
                means += outcome.mean[step * n + var];
                medians += median;
                (lower, upper) = (lower.min(low - by), upper.max(high + by));
                inner_lower = inner_lower.min(inner_low - inner_by);
                inner_upper = inner_upper.max(inner_high + inner_by);
            }
            let members = outcomes.all.len() as f64;
            let mean = floor(means / members);
            (lower, upper) = (floor(lower.min(mean)), floor(upper.max(mean)));
            let within = |value: f64| value.max(lower).min(upper);
            forecast.mean.push(mean);
            forecast.lower.push(lower);
            forecast.upper.push(upper);
            forecast.median.push(within(medians / members));
            forecast.inner_lower.push(within(inner_lower));
            forecast.inner_upper.push(within(inner_upper));
            let quality = model.members()[0].quality.as_ref().filter(|_| is_forecast(step));
            forecast.skill.push(quality.and_then(|quality| quality.skill(step, var)));
        }
        forecast
    };
    Outlook {
        action: name.to_owned(),
        refused,
        forecasts: if refused { Vec::new() } else { variables.iter().map(forecast).collect() },
        supported_steps: if refused { 0 } else { outcomes.supported },
        ..Outlook::default()
    }
}

/// What says that the mean effect of an action on a variable depends on an open link.
fn depends_on_link(
    model: &StructuralModel,
    acted: &Outcomes,
    baseline: &Outcomes,
    schedule: &Schedule,
    var: usize,
) -> Option<String> {
    let (n, steps) = (model.graph().len(), schedule.steps());
    let free: Vec<usize> = (0..steps).filter(|&step| !schedule.is_set(step, var)).collect();
    let effect = |(a, b): (&super::ensembles::Outcome, &super::ensembles::Outcome)| {
        free.iter().map(|step| a.mean[step * n + var] - b.mean[step * n + var]).sum::<f64>()
            / free.len().max(1) as f64
    };
    let effects: Vec<f64> = acted.all.iter().zip(&baseline.all).map(effect).collect();
    ambiguity::sentence(model, &effects, NOTHING * model.members()[0].model.deviations[var])
        .map(|sentence| format!("{}: {sentence}", model.graph().names()[var]))
}

fn text(
    model: &StructuralModel,
    situation: &Situation<'_>,
    question: &WhatIf,
    outlook: &Outlook,
    (variables, schedule): (&[usize], &Schedule),
    plan: Option<(&Plan, usize)>,
) -> String {
    let last = question.answered_steps(outlook.supported_steps) - 1;
    let all = variables.iter().copied().zip(&outlook.forecasts);
    let free: Vec<(usize, &Forecast)> = all.filter(|(var, _)| !schedule.is_set(last, *var)).collect();
    let one = |(var, Forecast { variable, mean, lower, upper, .. }): &(usize, &Forecast)| {
        let [now, lower, upper] =
            [situation.rows[[situation.now, *var]], lower[last], upper[last]].map(short);
        format!("{variable} {now} -> {} ({lower} to {upper})", with_unit(model, *var, mean[last]))
    };
    let parts: Vec<String> = free.iter().map(one).collect();
    let when = steps(model, last + 1);
    let mut sentences = vec![if parts.is_empty() {
        format!("{}: every variable asked for is set", outlook.action)
    } else if question.counterfactual {
        format!("{}, had it been done: after {when} {}", outlook.action, parts.join(", "))
    } else {
        format!("{}: after {when} {}", outlook.action, parts.join(", "))
    }];
    if outlook.supported_steps < question.horizon {
        let horizon = steps(model, question.horizon);
        sentences.push(format!("The data carry it for {} of {horizon}", outlook.supported_steps));
    }
    let no_skill = |(_, forecast): &&(usize, &Forecast)| {
        forecast.skill.iter().any(|skill| skill.is_some_and(|skill| skill <= 0.0))
    };
    let without: Vec<String> =
        free.iter().filter(no_skill).map(|(_, forecast)| forecast.variable.clone()).collect();
    if !without.is_empty() {
        let (without, verb) = (listed(&without), if without.len() == 1 { "is" } else { "are" });
        sentences.push(format!(
            "{without} {verb} at some of these steps not forecast better than by the last value"
        ));
    }
    if let Some((plan, k)) = plan {
        let [mean, low, high] = [outlook.cost, outlook.cost_lower, outlook.cost_upper].map(short);
        let mut cost = format!("Cost {mean} ({low} to {high})");
        if plan.steps < question.horizon {
            cost += &format!(" over {}", steps(model, plan.steps));
        }
        let why = match &plan.left_out[k] {
            Some(reason) => format!("not ranked: {reason}"),
            None if plan.left_out.iter().flatten().count() + 1 == plan.left_out.len() => {
                "no other action to compare it with".to_owned()
            }
            None => format!("the best with probability {}", short(outlook.probability_best)),
        };
        sentences.push(format!("{cost}; {why}"));
    }
    format!("{}.", sentences.join(". "))
}
