//! DYNOTEARS.

use std::path::Path;

use ndarray::s;
use roscausal_discovery::{
    Control,
    methods::{DynotearsSettings, run_dynotears},
};
use serde_json::{Value, json};

use crate::data::{count, frame, nested};

/// Runs one case.
pub(crate) fn run(case: &Value, set: &Path) -> Result<Value, String> {
    let data = frame(case, set)?;
    let params = &case["params"];
    let number = |name: &str| params[name].as_f64().ok_or_else(|| format!("'{name}' is not a number"));
    let settings = DynotearsSettings {
        tau_max: count(case, "p")?,
        lambda_w: number("lambda_w")?,
        lambda_a: number("lambda_a")?,
        max_iterations: count(case, "max_iter")?,
        h_tolerance: number("h_tol")?,
        standardise: params["standardise"].as_bool().unwrap_or(true),
        excluded: tabu(&params["tabu"])?,
        ..DynotearsSettings::default()
    };
    let result = run_dynotears(&data, &settings, &Control::default()).map_err(|e| e.to_string())?;
    Ok(json!({
        "w": nested(result.w.view()),
        "a": nested(result.a.slice(s![.., .., 1..])),
        "objective": result.objective,
        "h": result.h,
    }))
}

/// `[lag, from, to]` as cause, effect, lag.
fn tabu(list: &Value) -> Result<Vec<(usize, usize, usize)>, String> {
    let index = |v: &Value| v.as_u64().map(|v| v as usize).ok_or_else(|| format!("{v} is not a count"));
    let link = |link: &Value| Ok((index(&link[1])?, index(&link[2])?, index(&link[0])?));
    list.as_array().map_or(Ok(Vec::new()), |links| links.iter().map(link).collect())
}
