//! VARLiNGAM, and DirectLiNGAM as its case without lags.

use std::path::Path;

use ndarray::s;
use roscausal_discovery::{
    Control, Error,
    methods::{VarlingamSettings, run_varlingam},
};
use serde_json::{Value, json};

use crate::data::{count, frame, nested};

/// Runs one case.
pub(crate) fn run(case: &Value, set: &Path) -> Result<Value, String> {
    let data = frame(case, set)?;
    let criterion = case["params"]["criterion"].as_str().map(str::parse).transpose();
    let settings = VarlingamSettings {
        tau_max: count(case, "lags")?,
        choose_lags: criterion.map_err(|e: Error| e.to_string())?,
        prune: case["params"]["prune"].as_bool().unwrap_or(true),
        centre: case["params"]["centre"].as_bool().unwrap_or(true),
        check_residuals: false,
        ..VarlingamSettings::default()
    };
    let result = run_varlingam(&data, &settings, &Control::default()).map_err(|e| e.to_string())?;
    Ok(json!({
        "lags": result.lags,
        "causal_order": result.causal_order,
        "order_margins": result.order_margins,
        "adjacency": nested(result.adjacency.view()),
        "ar_coefs": nested(result.ar_coefs.slice(s![.., .., 1..])),
    }))
}
