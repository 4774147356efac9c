//! Cases that go the whole way: fit, ask, answer.

use ndarray::{Array2, ArrayView2, concatenate};
use roscausal_reasoning::{
    StructuralModel,
    answer::{Outlook, WhatIfAnswer, what_if},
    model::Settings,
    question::{Action, Intervention, Situation, WhatIf},
};
use serde_json::{Value, json};

use super::case::{Answer, Case, count, list, number, numbers};

fn fitted(case: &Case) -> Answer<StructuralModel> {
    StructuralModel::fit(&case.frame()?, &case.graph()?, &Settings::default(), &Vec::new())
        .map_err(|e| e.to_string())
}

/// `[step][variable]` of one list of each forecast.
fn by_step(outlook: &Outlook, pick: fn(&roscausal_reasoning::answer::Forecast) -> &Vec<f64>) -> Value {
    let steps = outlook.forecasts.first().map_or(0, |forecast| forecast.mean.len());
    (0..steps)
        .map(|k| outlook.forecasts.iter().map(|forecast| pick(forecast)[k]).collect::<Value>())
        .collect()
}

fn only(answer: WhatIfAnswer) -> Answer<Outlook> {
    let message = answer.message;
    answer.outlooks.into_iter().next().filter(|outlook| !outlook.refused).ok_or(message)
}

/// The outlook of one action, or the rows that were observed again under it.
fn ask(
    model: &StructuralModel,
    rows: ArrayView2<'_, f64>,
    now: usize,
    (horizon, interventions): (usize, Vec<Intervention>),
    counterfactual: bool,
) -> Answer<Outlook> {
    let name = if interventions.is_empty() { "go on" } else { "action" };
    let actions = vec![Action { name: name.to_owned(), interventions }];
    let question =
        WhatIf { horizon, actions, counterfactual, allow_extrapolation: true, ..WhatIf::default() };
    only(what_if(model, &Situation { rows, now }, &question))
}

pub(crate) fn nonlinear(case: &Case) -> Answer<Value> {
    let (model, names) = (fitted(case)?, case.variables()?);
    let data = case.recordings()?.swap_remove(0);
    let answer = |query: &Value| {
        let (row, horizon) = (count(&query["row"])?, count(&query["horizon"])?);
        let one = |one: &Value| {
            let step = count(&one["step"])?;
            let (variable, value) = (&names[count(&one["var"])?], [number(&one["value"])?]);
            let set = one["type"] == "set";
            let one =
                if set { Intervention::set(variable, value) } else { Intervention::shift(variable, value) };
            Ok(one.during(step, step))
        };
        let acts: Vec<Intervention> =
            list(&query["interventions"])?.iter().map(one).collect::<Answer<_>>()?;
        let ahead = ask(&model, data.view(), row, (horizon, acts.clone()), false)?;
        let again = ask(&model, data.view(), row, (horizon, acts), true)?;
        Ok(json!({ "mean": by_step(&ahead, |f| &f.mean), "lower": by_step(&ahead, |f| &f.lower),
            "upper": by_step(&ahead, |f| &f.upper), "counterfactual": by_step(&again, |f| &f.mean),
            "supported_steps": ahead.supported_steps }))
    };
    list(&case.input["queries"])?.iter().map(answer).collect()
}

pub(crate) fn experiment(case: &Case) -> Answer<Value> {
    let (model, names) = (fitted(case)?, case.variables()?);
    let acting = names[count(&case.input["action_variable"])?].clone();
    let horizon = count(&case.input["horizon"])?;
    let set = |values: Vec<f64>| (horizon, vec![Intervention::set(&acting, values)]);
    let table = |rows: &Value| -> Answer<Array2<f64>> {
        let rows = list(rows)?.iter().map(numbers).collect::<Answer<Vec<_>>>()?;
        Array2::from_shape_vec((rows.len(), names.len()), rows.concat()).map_err(|e| e.to_string())
    };
    let mut answer = json!({});
    let actions: Vec<String> =
        case.input["windows"][0]["actions"].as_object().ok_or("no actions")?.keys().cloned().collect();
    for action in actions {
        let window = |window: &Value| {
            let (history, untouched) = (table(&window["history"])?, table(&window["untouched"])?);
            let rows = concatenate(ndarray::Axis(0), &[history.view(), untouched.view()])
                .map_err(|e| e.to_string())?;
            let now = history.nrows() - 1;
            let own = untouched.column(count(&case.input["action_variable"])?).to_vec();
            let imposed = numbers(&window["actions"][&action])?;
            let ahead = ask(&model, rows.view(), now, set(imposed.clone()), false)?;
            let untouched = ask(&model, rows.view(), now, set(own), false)?;
            let again = ask(&model, rows.view(), now, set(imposed), true)?;
            Ok(json!({ "mean": by_step(&ahead, |f| &f.mean), "lower": by_step(&ahead, |f| &f.lower),
                "upper": by_step(&ahead, |f| &f.upper), "mean_untouched": by_step(&untouched, |f| &f.mean),
                "counterfactual": by_step(&again, |f| &f.mean), "supported_steps": ahead.supported_steps,
                "supported_steps_untouched": untouched.supported_steps, "too_fast_is_refused": too_fast(&model, rows.view(), now, &acting, horizon) }))
        };
        answer[&action] = list(&case.input["windows"])?.iter().map(window).collect::<Answer<Value>>()?;
    }
    Ok(answer)
}

/// Whether a speed that was never seen is refused.
fn too_fast(
    model: &StructuralModel,
    rows: ArrayView2<'_, f64>,
    now: usize,
    variable: &str,
    horizon: usize,
) -> bool {
    let action = Action::one("too fast", Intervention::set(variable, [1.2]));
    let question = WhatIf { horizon, actions: vec![action], ..WhatIf::default() };
    what_if(model, &Situation { rows, now }, &question)
        .outlooks
        .first()
        .is_some_and(|outlook| outlook.refused)
}
