//! Experiments on random systems: graphs for a comparison of quality.

use std::{collections::BTreeMap, path::Path};

use ndarray::{Array2, Array3, Axis, concatenate, s};
use roscausal_discovery::{
    CondIndTest, Control, DataFrame, Dummy, LinkMark,
    independence_tests::{self, TestSettings},
    methods::{
        Intervened, JpcmciPlusSettings, LpcmciSettings, NodeClass, PcmciPlusSettings, PcmciSettings,
        run_candoit, run_jpcmciplus, run_lpcmci, run_pcmciplus,
    },
};
use serde_json::{Value, json};

use crate::{
    cases::{Answer, count, read_csv},
    data::read_json as read,
};

/// Name of the experiment, first letter of its systems, independence test.
const EXPERIMENTS: [(&str, char, &str); 13] = [
    ("L_lpcmci_parcorr_a05", 'L', "parcorr"),
    ("L_lpcmci_parcorr_a01", 'L', "parcorr"),
    ("L_lpcmci_parcorr_k4", 'L', "parcorr"),
    ("L_lpcmci_robustparcorr", 'L', "robustparcorr"),
    ("L_lpcmci_gpdc", 'L', "gpdc"),
    ("C_candoit_concat", 'C', "parcorr"),
    ("C_candoit_segments", 'C', "parcorr"),
    ("C_candoit_plain", 'C', "parcorr"),
    ("C_lpcmci_observed", 'C', "parcorr"),
    ("C_lpcmci_pooled", 'C', "parcorr"),
    ("J_jpcmciplus_dummy", 'J', "parcorr"),
    ("J_jpcmciplus_nodummy", 'J', "parcorr"),
    ("J_pcmciplus_pooled", 'J', "parcorr"),
];

/// Runs every experiment whose name holds `only`; writes `OUT/graphs_EXPERIMENT.json`.
pub(crate) fn run_all(set: &Path, out: &Path, only: &str) -> Answer<()> {
    std::fs::create_dir_all(out).map_err(|e| format!("{}: {e}", out.display()))?;
    let truth = read(&set.join("truth.json"))?;
    for (experiment, letter, test) in EXPERIMENTS.iter().filter(|(name, ..)| name.contains(only)) {
        let mut graphs = BTreeMap::new();
        for (name, system) in truth.as_object().into_iter().flatten() {
            let nonlinear_only = *letter == 'L' && *test != "parcorr";
            if name.starts_with(*letter) && !(nonlinear_only && system["kind"] != "nonlinear") {
                let table = read_csv(&set.join("data").join(format!("{name}.csv")))?;
                graphs.insert(name.clone(), graph_of(experiment, test, system, table)?);
            }
        }
        let path = out.join(format!("graphs_{experiment}.json"));
        std::fs::write(&path, json!(graphs).to_string()).map_err(|e| format!("{}: {e}", path.display()))?;
        println!("{experiment}: {} systems", graphs.len());
    }
    Ok(())
}

/// The links `[cause, effect, lag, mark]` of one system. The table's first column is the recording.
fn graph_of(
    experiment: &str,
    test: &str,
    system: &Value,
    table: (Vec<String>, Array2<f64>),
) -> Answer<Value> {
    let (names, table) = table;
    let n_observed = system["observed"].as_array().map_or(0, Vec::len);
    let with_contexts = experiment.starts_with("C_candoit");
    let columns = if experiment.starts_with('C') && !with_contexts { n_observed } else { names.len() - 1 };
    let n_recordings = table.column(0).iter().fold(0.0_f64, |most, &v| most.max(v)) as usize + 1;
    let mut recordings: Vec<Array2<f64>> = (0..n_recordings)
        .map(|k| {
            let rows: Vec<usize> = (0..table.nrows()).filter(|&t| table[[t, 0]] == k as f64).collect();
            table.select(Axis(0), &rows).slice(s![.., 1..=columns]).to_owned()
        })
        .collect();
    if experiment.ends_with("observed") {
        recordings.truncate(1);
    }
    if experiment.ends_with("concat") {
        let views: Vec<_> = recordings.iter().map(|one| one.view()).collect();
        recordings = vec![concatenate(Axis(0), &views).map_err(|e| e.to_string())?];
    }
    let data = DataFrame::new(recordings, names[1..=columns].to_vec()).map_err(|e| e.to_string())?;
    let test = independence_tests::by_name(test, &TestSettings::default()).map_err(|e| e.to_string())?;
    if experiment.starts_with('J') {
        return several_recordings(experiment, test.as_ref(), system, &data);
    }
    let settings = LpcmciSettings {
        tau_max: count(&system["tau_max"]).ok_or("no tau_max")?,
        pc_alpha: if experiment.ends_with("a01") { 0.01 } else { 0.05 },
        n_preliminary_iterations: if experiment.ends_with("k4") { 4 } else { 1 },
        ..LpcmciSettings::default()
    };
    let control = Control::default();
    let found = if with_contexts {
        let listed = system["interventions"].as_array().into_iter().flatten();
        let intervened =
            |i: &Value| Some(Intervened { variable: Some(count(&i[0])?), context: count(&i[1])? });
        let interventions: Vec<Intervened> = listed.filter_map(intervened).collect();
        let with_rule = !experiment.ends_with("plain");
        run_candoit(&data, test.as_ref(), &settings, &interventions, with_rule, &control)
    } else {
        run_lpcmci(&data, test.as_ref(), &settings, &control)
    };
    Ok(listed(&found.map_err(|e| e.to_string())?.result.graph))
}

/// Methods for several recordings that differ.
fn several_recordings(
    experiment: &str,
    test: &dyn CondIndTest,
    system: &Value,
    data: &DataFrame,
) -> Answer<Value> {
    let pcmci = PcmciSettings {
        tau_min: 0,
        tau_max: count(&system["tau_max"]).ok_or("no tau_max")?,
        pc_alpha: vec![0.05],
        ..PcmciSettings::default()
    };
    let control = Control::default();
    let of_class = |class: &Value| match class.as_str() {
        Some("space_context") => Some(NodeClass::SpaceContext),
        Some("system") => Some(NodeClass::System),
        _ => None,
    };
    let classes: Vec<NodeClass> =
        system["classes"].as_array().into_iter().flatten().filter_map(of_class).collect();
    let is_system = |var: &usize| classes[*var] == NodeClass::System;
    let graph = if experiment == "J_pcmciplus_pooled" {
        let data = data.select(&(0..classes.len()).filter(is_system).collect::<Vec<_>>());
        run_pcmciplus(&data, test, &pcmci, &PcmciPlusSettings::default(), &control).map(|found| found.graph)
    } else {
        let dummies = if experiment.ends_with("nodummy") { Vec::new() } else { vec![Dummy::Space] };
        let settings = JpcmciPlusSettings { pcmci, classes, dummies, ..JpcmciPlusSettings::default() };
        run_jpcmciplus(data, test, &settings, &control).map(|found| found.result.graph)
    };
    Ok(listed(&graph.map_err(|e| e.to_string())?))
}

/// The links `[cause, effect, lag, mark]`, a pair at lag 0 once.
fn listed(graph: &Array3<LinkMark>) -> Value {
    let links = graph.indexed_iter().filter(|((i, j, lag), mark)| mark.is_link() && (*lag > 0 || i < j));
    links.map(|((i, j, lag), mark)| json!([i, j, lag, mark.symbol()])).collect()
}
