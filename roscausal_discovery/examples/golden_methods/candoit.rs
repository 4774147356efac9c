//! Cases of CAnDOIT.

use std::path::Path;

use roscausal_discovery::{
    Control,
    methods::{LpcmciSettings, run_lpcmci},
};
use serde_json::Value;

use crate::{
    cases::{Answer, assumptions, count, data_of, test_of},
    lpcmci,
};

pub(crate) fn run(case: &Value, set: &Path) -> Answer<Value> {
    let data = data_of(case, set, case["reading"] == "concat")?;
    let settings = lpcmci::settings(&case["params"], data.n_vars())?;
    let interventions = case["interventions"].as_array().into_iter().flatten();
    let contexts = interventions.filter_map(|i| Some((count(&i["variable"])?, count(&i["context"])?)));
    let with_rule = case["extra_conditions"].as_bool().unwrap_or(true);
    let settings = LpcmciSettings {
        link_assumptions: assumptions(&case["link_assumptions"], data.n_vars())?,
        contexts: if with_rule { contexts.collect() } else { Vec::new() },
        ..settings
    };
    let found = run_lpcmci(&data, test_of(case)?.as_ref(), &settings, &Control::default());
    Ok(lpcmci::answer(&found.map_err(|e| e.to_string())?))
}
