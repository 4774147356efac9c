//! `--out`: an answer as fan charts and as JSON.

use ndarray::{Array2, ArrayView2, Axis, s};
use roscausal_core::{Error, Result};
use roscausal_discovery::{
    draw::{self, Candidate, Fan, FanChart, fans},
    names,
};
use roscausal_reasoning::{
    StructuralModel,
    answer::{Forecast, Outlook, WhatIfAnswer},
    question::{Situation, WhatIf},
};

use crate::{output, results::Results};

/// Fewest rows of the past that are drawn, where they are there.
const PAST: usize = 10;
/// The part of the outcomes that lies in the inner band.
const INNER: f64 = 0.5;

/// Writes the answer as `name.svg`, `name.png`, `name.pdf` and `name.json`; without an outlook nothing.
pub(super) fn write(
    results: Results,
    name: &str,
    model: &StructuralModel,
    situation: &Situation<'_>,
    (question, answer): (&WhatIf, &WhatIfAnswer),
) -> Result<()> {
    if answer.outlooks.is_empty() {
        return Ok(());
    }
    let json = serde_json::to_string_pretty(answer).map_err(|e| Error::Data(e.to_string()))?;
    let svg = picture(model, situation, question, answer);
    results.write(|dir| {
        output::write_file(dir, &format!("{name}.pdf"), &draw::pdf(&svg)?)?;
        output::write_picture(dir, name, &svg)?;
        output::write_file(dir, &format!("{name}.json"), json.as_bytes())
    })
}

/// The answer as fan charts: a column for each action.
fn picture(
    model: &StructuralModel,
    situation: &Situation<'_>,
    question: &WhatIf,
    answer: &WhatIfAnswer,
) -> String {
    let all = model.graph().names();
    let shown: Vec<usize> = match question.variables.is_empty() {
        true => (0..all.len()).collect(),
        false => question.variables.iter().filter_map(|name| names::position(all, name)).collect(),
    };
    let of = |rows: ArrayView2<'_, f64>| -> Array2<f64> { rows.select(Axis(1), &shown) };
    let now = situation.now;
    let first = now.saturating_sub(question.horizon.max(PAST));
    let last = (now + question.horizon).min(situation.rows.nrows() - 1);
    let past = of(situation.rows.slice(s![first..=now, ..]));
    let observed = of(situation.rows.slice(s![now + 1..last + 1, ..]));
    let unit = |&var: &usize| {
        let known = model.facts.units.iter().find(|(name, _)| *name == all[var]);
        known.map_or(String::new(), |(_, unit)| unit.clone())
    };
    let place = |name: &str| shown.iter().position(|&var| all[var] == name);
    let candidate = |(k, outlook): (usize, &Outlook)| {
        let interventions = question.actions.get(k).map_or(&[][..], |action| &action.interventions);
        let act = |one: &roscausal_reasoning::question::Intervention| {
            let last = if one.last_step == 0 { question.horizon } else { one.last_step };
            (place(&one.variable), one.first_step, last)
        };
        Candidate {
            name: outlook.action.clone(),
            note: note(outlook, question, (!answer.ranking.is_empty()).then(|| answer.ranking.contains(&k))),
            fans: outlook.forecasts.iter().map(fan).collect(),
            carried: outlook.supported_steps,
            acts: interventions.iter().map(act).collect(),
        }
    };
    fans(&FanChart {
        names: &shown.iter().map(|&var| all[var].clone()).collect::<Vec<_>>(),
        units: &shown.iter().map(unit).collect::<Vec<_>>(),
        past: past.view(),
        observed: observed.view(),
        dt: answer.dt,
        horizon: question.horizon,
        bands: [INNER, model.settings().interval],
        candidates: &answer.outlooks.iter().enumerate().map(candidate).collect::<Vec<_>>(),
    })
}

fn fan(forecast: &Forecast) -> Fan {
    Fan {
        median: forecast.median.clone(),
        inner: [forecast.inner_lower.clone(), forecast.inner_upper.clone()],
        outer: [forecast.lower.clone(), forecast.upper.clone()],
    }
}

/// What stands below an action's name.
fn note(outlook: &Outlook, question: &WhatIf, ranked: Option<bool>) -> String {
    if outlook.refused {
        let start = format!("{}: ", outlook.action);
        return outlook.text.strip_prefix(&start).unwrap_or(&outlook.text).to_owned();
    }
    let mut notes = Vec::new();
    if question.counterfactual {
        notes.push("had it been done".to_owned());
    }
    match ranked {
        Some(true) => notes
            .push(format!("cost {:.3}, best with probability {:.2}", outlook.cost, outlook.probability_best)),
        Some(false) => notes.push("not ranked".to_owned()),
        None => {}
    }
    if !question.limits.is_empty() {
        notes.push(format!("limits kept with probability {:.2}", outlook.probability_limits));
    }
    notes.join("; ")
}
