//! Every way in which a model or its evidence may be no whole: each is refused in a sentence, and nothing that earlier versions wrote is.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod graphs;

use std::{collections::HashSet, fs, path::Path};

use ndarray::Array2;
use roscausal_discovery::{
    Control, DataFrame, Evidence, LinkMark, Model, Outcome, Settings, analyse_with_evidence,
    confidence::{Resampling, analyse_resampled},
    methods::Method,
};
use serde_json::{Value, json};

/// Three variables that drive each other, within a moment too.
fn data() -> DataFrame {
    let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0) - 0.5;
    let mut values = Array2::zeros((300, 3));
    for t in 1..300 {
        values[[t, 0]] = noise(3 * t);
        values[[t, 1]] = 0.7 * values[[t - 1, 0]] + noise(3 * t + 1);
        values[[t, 2]] = 0.9 * values[[t, 1]] + noise(3 * t + 2);
    }
    DataFrame::new(vec![values], ["a", "b", "c"].map(str::to_owned).to_vec()).unwrap()
}

fn settings() -> Settings {
    let (tau_min, tau_max) = (0, 2);
    Settings {
        method: Method::Pcmciplus,
        cond_ind_test: "parcorr".into(),
        tau_min,
        tau_max,
        ..Settings::default()
    }
}

/// A model with all its fields: resampled, with a link within a moment.
fn whole() -> Value {
    let resampling = Resampling { resamples: 20, ..Resampling::default() };
    let model = analyse_resampled(&data(), &settings(), &resampling, &Control::default()).unwrap();
    assert!(
        model.links.iter().any(|link| link.lag == 0 && link.mark == LinkMark::Forward),
        "{:?}",
        model.links
    );
    serde_json::from_str(&model.to_file_json()).unwrap()
}

fn text_of(mut json: Value, change: impl Fn(&mut Value)) -> String {
    change(&mut json);
    json.to_string()
}

/// What a refusal says, and the change of the JSON that it is of.
type Case = (&'static str, fn(&mut Value));

/// The first link within a moment, by its place in the list.
fn now(model: &Value) -> usize {
    model["links"].as_array().unwrap().iter().position(|link| link["lag"] == 0).unwrap()
}

const MODELS: &[Case] = &[
    ("this program reads 'roscausal/model/2'", |m| m["schema"] = json!("roscausal/model/3")),
    ("this program reads", |m| m["schema"] = json!("roscausal/model/1.5")),
    ("this program reads", |m| m["schema"] = json!("x".repeat(100_000))),
    ("missing field `schema`", |m| drop(m.as_object_mut().unwrap().remove("schema"))),
    ("missing field `val_matrix`", |m| drop(m.as_object_mut().unwrap().remove("val_matrix"))),
    ("1000000000 is above 100000", |m| m["tau_max"] = json!(1_000_000_000)),
    ("is above 100000", |m| m["tau_max"] = json!(1_u64 << 62)),
    ("is above 100000", |m| m["tau_max"] = json!(u64::MAX)),
    ("expected a whole number from 0 on", |m| m["tau_max"] = json!(1e12)),
    ("expected a whole number from 0 on", |m| m["tau_min"] = json!(-1)),
    ("2 is below tau_min 3", |m| m["tau_min"] = json!(3)),
    ("graph is not of the size 3 x 3 x 6", |m| m["tau_max"] = json!(5)),
    ("graph is not of the size 3 x 3 x 2", |m| m["tau_max"] = json!(1)),
    ("causal_structure is not of the size 2 x 3 x 3", |m| m["tau_min"] = json!(1)),
    ("'a' is there twice", |m| m["features"] = json!(["a", "a", "c"])),
    ("variable 2 has no name", |m| m["features"] = json!(["a", "", "c"])),
    ("variable 2 has no name", |m| m["features"] = json!(["a", " \n", "c"])),
    ("'a' is there twice", |m| m["dropped"] = json!(["a"])),
    ("variable 4 has no name", |m| m["dropped"] = json!([""])),
    ("graph is not of the size 2 x 2 x 3", |m| m["features"] = json!(["a", "b"])),
    ("graph is not of the size 0 x 0 x 3", |m| m["features"] = json!([])),
    ("not one of its features", |m| m["features"] = json!(["a", "b", "d"])),
    ("dt", |m| m["dt"] = json!(0.0)),
    ("dt", |m| m["dt"] = json!(-0.1)),
    ("dt", |m| m["dt"] = json!(1e300)),
    ("expected a number", |m| m["alpha"] = json!("small")),
    ("alpha is -1", |m| m["alpha"] = json!(-1)),
    ("pc_alpha is -0.5", |m| m["pc_alpha"] = json!(-0.5)),
    ("run_time_s is -1", |m| m["run_time_s"] = json!(-1)),
    ("val_matrix is not of the size", |m| drop(m["val_matrix"].as_array_mut().unwrap().pop())),
    ("val_matrix is not of the size", |m| m["val_matrix"] = json!([])),
    ("val_matrix is not of the size", |m| m["val_matrix"][1][2] = json!([0.5])),
    ("p_matrix is not of the size", |m| m["p_matrix"][2] = json!([[], [], []])),
    ("val is not of the size", |m| m["val"] = json!([[[0.0]]])),
    ("pval is not of the size", |m| drop(m["pval"].as_array_mut().unwrap().pop())),
    ("'a' -> 'b' at lag 1 is tested, and has no number", |m| m["val_matrix"][0][1][1] = Value::Null),
    ("'a' -> 'a' at lag 0 is not tested, and has a number", |m| m["p_matrix"][0][0][0] = json!(1)),
    ("not tested, and has a number", |m| m["n_matrix"][0][0][0] = json!(5)),
    ("not tested, and has a number", |m| m["outcomes"][0][1][1] = json!("forbidden")),
    ("outcomes is not of the size", |m| drop(m.as_object_mut().unwrap().remove("outcomes"))),
    ("expected", |m| m["outcomes"][0][1][1] = json!("perhaps")),
    ("value and p_value", |m| m["links"][0]["value"] = Value::Null),
    ("'p_matrix' holds -0.1", |m| m["p_matrix"][0][1][1] = json!(-0.1)),
    ("'p_matrix' holds 2", |m| m["p_matrix"][0][1][1] = json!(2)),
    ("causal_structure holds 7", |m| m["causal_structure"][0][0][0] = json!(7)),
    ("'=>' is not a mark", |m| m["graph"][0][1][1] = json!("=>")),
    ("is not a mark", |m| m["graph"][0][1][1] = json!("<script>".repeat(1000))),
    ("which cannot be", |m| m["graph"][1][1][0] = json!("-->")),
    ("comes before its cause", |m| m["graph"][0][1][2] = json!("<--")),
    ("comes before its cause", |m| m["graph"][0][1][2] = json!("---")),
    ("the other way round", |m| m["graph"][2][1][0] = json!("")),
    ("the other way round", |m| m["graph"][0][1][0] = json!("-->")),
    ("links has it not", |m| m["graph"][0][0][2] = json!("-->")),
    ("links has it not", |m| m["links"] = json!([])),
    ("twice", |m| {
        let first = m["links"][0].clone();
        m["links"].as_array_mut().unwrap().push(first);
    }),
    ("links[0] names 'nobody'", |m| m["links"][0]["cause"] = json!("nobody")),
    ("has the mark 'o-o', and graph has '-->'", |m| m["links"][0]["mark"] = json!("o-o")),
    ("than the matrices", |m| m["links"][0]["value"] = json!(-1e308)),
    ("than the matrices", |m| m["links"][0]["n_used"] = json!(3)),
    ("lags are 0 to 2", |m| m["links"][0]["lag"] = json!(1_u64 << 62)),
    ("expected a whole number from 0 on", |m| m["links"][0]["lag"] = json!(-1)),
    ("has the mark", |m| {
        let k = now(m);
        m["links"][k]["lag"] = json!(2);
    }),
    ("p_value, confidence and chance are numbers from 0 to 1", |m| m["links"][0]["p_value"] = json!(1.5)),
    ("p_value, confidence and chance are numbers from 0 to 1", |m| m["links"][0]["confidence"] = json!(-0.5)),
    ("p_value, confidence and chance are numbers from 0 to 1", |m| m["links"][0]["chance"] = json!(2)),
    ("'link_frequency' is not of the size", |m| m["link_frequency"] = json!([])),
    ("'link_frequency' holds 3", |m| m["link_frequency"][0][0][1] = json!(3)),
    ("summary_frequency is not 3 x 3", |m| m["summary_frequency"] = json!([[0.0]])),
    ("is not a mark", |m| m["majority_graph"][0][0][0] = json!("?")),
    ("resampling has more", |m| m["resampling"]["done"] = json!(1_u64 << 40)),
    ("advice names 'nobody'", |m| {
        let none = json!(null);
        m["advice"] = json!([{"cause": "nobody", "effect": "a", "lag": 1, "in_model": true, "confidence": 0.5, "n_needed": none,
            "n_low": none, "n_high": none, "minutes": none, "minutes_low": none, "minutes_high": none, "sentence": ""}]);
    }),
];

#[test]
fn a_model_that_is_not_whole_is_refused_in_a_sentence_however_it_is_read() {
    let whole = whole();
    assert!(Model::from_json(whole.to_string().as_bytes()).is_ok());
    for &(reported, change) in MODELS {
        let text = text_of(whole.clone(), change);
        let error = Model::from_json(text.as_bytes()).expect_err(reported).to_string();
        assert!(error.contains(reported), "{reported}: {error}");
        assert!(error.len() < 600 && error.lines().count() == 1, "{reported}: {error}");
        assert!(error.matches("not a valid model").count() <= 1, "{error}");
        // There is no way around the check.
        assert!(serde_json::from_str::<Model>(&text).is_err(), "{reported}");
        assert!(
            serde_json::from_str::<Value>(&text).is_ok_and(|v| serde_json::from_value::<Model>(v).is_err())
        );
    }
}

#[test]
fn a_text_that_is_no_json_of_a_model_is_refused_before_it_is_taken_apart() {
    let whole = whole().to_string();
    let long = whole.replacen("\"warnings\":[", &format!("\"warnings\":[\"{}\",", "x".repeat(2 << 20)), 1);
    for (reported, text) in [
        ("number out of range", whole.replacen("\"alpha\":0.05", "\"alpha\":1e999", 1)),
        ("at line 1", whole.replacen("\"alpha\":0.05", "\"alpha\":NaN", 1)),
        ("duplicate field `tau_max`", whole.replacen('{', "{\"tau_max\":1,", 1)),
        ("nests deeper than 64", format!("{}{}", "[".repeat(100), "]".repeat(100))),
        (
            "nests deeper than 64",
            whole.replacen("\"warnings\":[", &format!("\"warnings\":[{}", "[".repeat(90)), 1),
        ),
        ("EOF", whole[..whole.len() / 2].to_owned()),
        ("too many for 3 variables and 3 lags", long),
        ("not a valid model", String::new()),
    ] {
        let error = Model::from_json(text.as_bytes()).expect_err(reported).to_string();
        assert!(error.contains(reported) && error.len() < 600, "{reported}: {error}");
    }
}

#[test]
fn what_any_method_finds_is_a_model_that_reads_back() {
    let one = data();
    let twice = DataFrame::new(vec![one.recordings()[0].clone(); 2], one.var_names().to_vec()).unwrap();
    for method in Method::all().filter(|method| *method != Method::Candoit) {
        let info = method.info();
        let (tau_min, test) = (info.tau_min, if info.uses_test { "parcorr" } else { info.test });
        let settings =
            Settings { method, cond_ind_test: test.into(), tau_min, tau_max: 2, ..Settings::default() };
        let data = if method == Method::Jpcmciplus { &twice } else { &one };
        let (model, evidence) = analyse_with_evidence(data, &settings, &Control::default()).unwrap();
        let read =
            Model::from_json(model.to_file_json().as_bytes()).unwrap_or_else(|e| panic!("{method}: {e}"));
        assert_eq!(read.links, model.links, "{method}");
        let read =
            Evidence::from_json(evidence.to_json().as_bytes()).unwrap_or_else(|e| panic!("{method}: {e}"));
        assert!(read.is_of(&model), "{method}");
    }
    for number in (0..graphs::GRAPHS).step_by(20) {
        assert!(graphs::any_graph(number).check().is_ok(), "graph {number}");
    }
}

#[test]
fn a_model_of_an_earlier_version_is_still_read() {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("../roscausal_core/tests/corpus/json/model.json");
    let text = fs::read(corpus).unwrap();
    let model = Model::from_json(&text).unwrap();
    assert_eq!((model.links.len() > 1, model.confidence), (true, None));
    // Fields of later versions may be there, and those that came later may be missing.
    let mut json: Value = serde_json::from_slice(&text).unwrap();
    json["later"] = json!({"field": [1, 2]});
    assert!(Model::from_json(json.to_string().as_bytes()).is_ok());
}

const EVIDENCE: &[Case] = &[
    ("this program reads 'roscausal/evidence/1'", |e| e["schema"] = json!("roscausal/evidence/2")),
    ("missing field", |e| drop(e.as_object_mut().unwrap().remove("links"))),
    ("names 'nobody'", |e| e["links"][0]["effect"] = json!("nobody")),
    ("names 'nobody'", |e| e["links"][0]["conditions"] = json!([{"name": "nobody", "lag": 1}])),
    ("twice", |e| e["links"][1] = e["links"][0].clone()),
    ("which no analysis has", |e| e["links"][0]["lag"] = json!(1_u64 << 62)),
    ("which no analysis has", |e| e["links"][0]["lags"][0]["lag"] = json!(1_u64 << 62)),
    ("expected a whole number from 0 on", |e| e["links"][0]["lags"][0]["lag"] = json!(-3)),
    ("number out of range", |e| e["links"][0]["scatter"][0][0] = json!(1e300)),
    ("p_value", |e| e["links"][0]["lags"][0]["p_value"] = json!(-2)),
    ("there twice", |e| e["variables"][1] = e["variables"][0].clone()),
];

#[test]
fn evidence_that_is_not_whole_is_refused_in_a_sentence_and_that_of_another_model_is_told() {
    let (model, evidence) = analyse_with_evidence(&data(), &settings(), &Control::default()).unwrap();
    let whole: Value = serde_json::from_str(&evidence.to_json()).unwrap();
    for &(reported, change) in EVIDENCE {
        let text = text_of(whole.clone(), change);
        let error = Evidence::from_json(text.as_bytes()).expect_err(reported).to_string();
        assert!(error.contains(reported) && error.len() < 600, "{reported}: {error}");
        assert!(serde_json::from_str::<Evidence>(&text).is_err(), "{reported}");
    }
    let other = text_of(whole.clone(), |e| e["links"][0]["lags"][0]["lag"] = json!(99));
    assert!(!Evidence::from_json(other.as_bytes()).unwrap().is_of(&model));
    let fewer = text_of(whole, |e| drop(e["links"].as_array_mut().unwrap().pop()));
    assert!(!Evidence::from_json(fewer.as_bytes()).unwrap().is_of(&model));
}

#[test]
fn the_cases_are_many_and_differ() {
    let whole = whole();
    let texts: HashSet<String> = MODELS.iter().map(|(_, change)| text_of(whole.clone(), change)).collect();
    assert_eq!(texts.len(), MODELS.len());
}

/// A model as version 1 wrote it.
fn of_version_1(model: &Value) -> Value {
    let mut old = model.clone();
    old["schema"] = json!("roscausal/model/1");
    for field in ["outcomes", "n_matrix"] {
        old.as_object_mut().unwrap().remove(field);
    }
    for (field, untested) in [("val_matrix", 0.0), ("p_matrix", 1.0)] {
        for cell in old[field].as_array_mut().unwrap().iter_mut().flat_map(|of| of.as_array_mut().unwrap()) {
            for cell in cell.as_array_mut().unwrap().iter_mut().filter(|cell| cell.is_null()) {
                *cell = json!(untested);
            }
        }
    }
    old
}

#[test]
fn a_model_of_version_1_is_read_and_what_it_does_not_say_is_unknown() {
    let mut old = of_version_1(&whole());
    old["val_matrix"][2][0][2] = json!(0.0);
    old["p_matrix"][2][0][2] = json!(1.0);
    let model = Model::from_json(old.to_string().as_bytes()).unwrap();
    assert_eq!(model.schema, "roscausal/model/2");
    assert_eq!((model.outcomes[0][0][0], model.val_matrix[0][0][0]), (Outcome::NotAsked, None));
    assert_eq!((model.outcomes[0][1][1], model.outcomes[2][0][2]), (Outcome::Tested, Outcome::Unknown));
    assert_eq!((model.val_matrix[2][0][2], model.p_matrix[2][0][2]), (None, None));
    // Written again, it is one of this version.
    assert_eq!(
        Model::from_json(model.to_file_json().as_bytes()).unwrap(),
        Model { run_time_s: None, ..model }
    );
}
