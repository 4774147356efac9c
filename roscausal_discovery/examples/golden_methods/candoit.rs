//! Cases of CAnDOIT. The link assumptions are those that we make of the interventions.

use std::path::Path;

use roscausal_discovery::{
    Control,
    methods::{Intervened, run_candoit},
};
use serde_json::Value;

use crate::{
    cases::{Answer, count, data_of, test_of},
    lpcmci,
};

pub(crate) fn run(case: &Value, set: &Path) -> Answer<Value> {
    let data = data_of(case, set, case["reading"] == "concat")?;
    let settings = lpcmci::settings(&case["params"], data.n_vars())?;
    let listed = case["interventions"].as_array().into_iter().flatten();
    let intervened = |i: &Value| {
        Some(Intervened { variable: Some(count(&i["variable"])?), context: count(&i["context"])? })
    };
    let interventions: Vec<Intervened> = listed.filter_map(intervened).collect();
    let with_rule = case["extra_conditions"].as_bool().unwrap_or(true);
    let test = test_of(case)?;
    let found = run_candoit(&data, test.as_ref(), &settings, &interventions, with_rule, &Control::default());
    Ok(lpcmci::answer(&found.map_err(|e| e.to_string())?))
}
