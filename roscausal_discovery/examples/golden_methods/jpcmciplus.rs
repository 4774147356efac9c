//! Cases of J-PCMCI+.

use std::path::Path;

use roscausal_discovery::{
    Control, Dummy, Node,
    methods::{
        JpcmciPlusResult, JpcmciPlusSettings, NodeClass, PcmciPlusSettings, PcmciSettings, run_jpcmciplus,
    },
};
use serde_json::{Value, json};

use crate::cases::{Answer, count, data_of, nested, test_of};

pub(crate) fn run(case: &Value, set: &Path) -> Answer<Value> {
    let listed = |name: &str| case[name].as_array().into_iter().flatten().filter_map(Value::as_str);
    let dummies: Vec<Dummy> = listed("dummies").filter_map(dummy_of).collect();
    let classes: Vec<NodeClass> = listed("node_classes").filter_map(class_of).collect();
    let data = data_of(case, set, false)?;
    // An oracle's case has rows of zeros for the dummies, too.
    let data = data.select(&(0..classes.len()).collect::<Vec<_>>());
    let params = &case["params"];
    let rule = params["contemp_collider_rule"].as_str().unwrap_or("majority");
    let usual = PcmciSettings::default();
    let settings = JpcmciPlusSettings {
        pcmci: PcmciSettings {
            tau_min: count(&params["tau_min"]).unwrap_or(0),
            tau_max: count(&params["tau_max"]).unwrap_or(1),
            pc_alpha: vec![params["pc_alpha"].as_f64().unwrap_or(0.01)],
            max_conds_dim: count(&params["max_conds_dim"]),
            max_conds_px: count(&params["max_conds_px"]),
            max_conds_py: count(&params["max_conds_py"]),
            ..usual
        },
        plus: PcmciPlusSettings {
            contemp_collider_rule: rule.parse().map_err(|e: roscausal_discovery::Error| e.to_string())?,
            conflict_resolution: params["conflict_resolution"].as_bool().unwrap_or(true),
            reset_lagged_links: params["reset_lagged_links"].as_bool().unwrap_or(false),
            ..PcmciPlusSettings::default()
        },
        classes,
        dummies,
    };
    let found = run_jpcmciplus(&data, test_of(case)?.as_ref(), &settings, &Control::default());
    Ok(answer(&found.map_err(|e| e.to_string())?))
}

fn dummy_of(name: &str) -> Option<Dummy> {
    match name {
        "time_dummy" => Some(Dummy::Time),
        "space_dummy" => Some(Dummy::Space),
        _ => None,
    }
}

fn class_of(name: &str) -> Option<NodeClass> {
    match name {
        "system" => Some(NodeClass::System),
        "space_context" => Some(NodeClass::SpaceContext),
        "time_context" => Some(NodeClass::TimeContext),
        _ => None,
    }
}

fn answer(found: &JpcmciPlusResult) -> Value {
    let lists = |lists: &[Vec<Node>]| -> Value {
        let list =
            |nodes: &Vec<Node>| -> Value { nodes.iter().map(|n| json!([n.var, -(n.lag as i64)])).collect() };
        Value::Object(lists.iter().enumerate().map(|(j, nodes)| (j.to_string(), list(nodes))).collect())
    };
    json!({
        "graph": nested(&found.result.graph, |mark| json!(mark.symbol())),
        "val_matrix": nested(&found.result.val_matrix, |v| json!(v)),
        "p_matrix": nested(&found.result.p_matrix, |v| json!(v)),
        "n_tests": found.result.n_tests,
        "lagged_parents": lists(&found.lagged_parents),
        "context_parents": lists(&found.context_parents),
        "dummy_parents": lists(&found.dummy_parents),
    })
}
