//! Cases of LPCMCI.

use std::path::Path;

use roscausal_discovery::{
    Control,
    methods::{LpcmciResult, LpcmciSettings, run_lpcmci},
};
use serde_json::{Value, json};

use crate::cases::{Answer, assumptions, count, data_of, nested, test_of};

pub(crate) fn run(case: &Value, set: &Path) -> Answer<Value> {
    let data = data_of(case, set, false)?;
    let settings = settings(&case["params"], data.n_vars())?;
    let found = run_lpcmci(&data, test_of(case)?.as_ref(), &settings, &Control::default());
    Ok(answer(&found.map_err(|e| e.to_string())?))
}

pub(crate) fn settings(params: &Value, n_vars: usize) -> Answer<LpcmciSettings> {
    let usual = LpcmciSettings::default();
    Ok(LpcmciSettings {
        tau_min: count(&params["tau_min"]).unwrap_or(usual.tau_min),
        tau_max: count(&params["tau_max"]).unwrap_or(usual.tau_max),
        pc_alpha: params["pc_alpha"].as_f64().unwrap_or(usual.pc_alpha),
        n_preliminary_iterations: count(&params["n_preliminary_iterations"])
            .unwrap_or(usual.n_preliminary_iterations),
        max_cond_px: count(&params["max_cond_px"]).unwrap_or(usual.max_cond_px),
        max_p_global: count(&params["max_p_global"]),
        max_p_non_ancestral: count(&params["max_p_non_ancestral"]),
        max_q_global: count(&params["max_q_global"]),
        max_pds_set: count(&params["max_pds_set"]),
        prelim_with_collider_rules: params["prelim_with_collider_rules"].as_bool().unwrap_or(true),
        non_ancestral_phase: !params["no_non_ancestral_phase"].as_bool().unwrap_or(false),
        link_assumptions: assumptions(&params["link_assumptions"], n_vars)?,
        ..usual
    })
}

pub(crate) fn answer(found: &LpcmciResult) -> Value {
    let stages: Vec<Value> = found
        .stages
        .iter()
        .map(|stage| {
            let links: Vec<_> =
                stage.links.iter().map(|(x, y, marks)| json!([x.var, y, x.lag, marks])).collect();
            let ancestors: Vec<_> = stage.ancestors.iter().map(|(x, y)| json!([x.var, x.lag, y])).collect();
            json!({ "after": stage.after, "links": links, "ancestors": ancestors })
        })
        .collect();
    json!({
        "graph": nested(&found.result.graph, |mark| json!(mark.symbol())),
        "val_matrix": nested(&found.result.val_matrix, |v| json!(v)),
        "p_matrix": nested(&found.result.p_matrix, |v| json!(v)),
        "n_tests": found.n_asked,
        "stages": stages,
    })
}
