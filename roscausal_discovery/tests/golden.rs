//! Numbers of other implementations: a small set made for this repository (`golden_own`), and the reference's results in
//! `tests/golden` of the repository. Each test prints how many cases it ran and how many agree.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

#[path = "../examples/golden/driver.rs"]
mod driver;

use std::{
    io::Write,
    path::{Path, PathBuf},
};

use ndarray::Array3;
use roscausal_discovery::{
    DataFrame, independence_tests,
    methods::{PcmciSettings, fdr_bh, run_pcmci},
};
use serde_json::{Value, json};

/// Prints a line even where the test passes: cargo holds back only what goes through `println!`.
macro_rules! tell {
    ($($text:tt)*) => {
        let _ = writeln!(std::io::stderr(), $($text)*);
    };
}

/// Shuffle tests whose random numbers differ from the reference's near a threshold, so that other conditions are chosen: the
/// p-values of one test, the filter's p-values of the other.
const OTHER_RANDOM_NUMBERS: [&str; 2] =
    ["pcmci_parcorr_var_shuffle", "fpcmci_parcorr_var_lag2_neglect_fa0.05"];

/// How close a result has to be.
#[derive(Clone, Copy)]
enum Tolerance {
    /// Relative to the p-value.
    Exact,
    /// Residuals that enter through their ranks, and p-values from a null distribution.
    Table,
    /// Of an optimum that the reference's search stops short of.
    Optimum,
    /// P-values from this many surrogates.
    Surrogates(f64),
}

impl Tolerance {
    fn of(test: &Value) -> Self {
        let name = test["name"].as_str().unwrap_or_default();
        let shuffles = match test["kwargs"]["significance"].as_str() {
            Some(significance) => significance == "shuffle_test",
            None => matches!(name, "CMIknn" | "CMIsymb"),
        };
        match (name, shuffles) {
            (_, true) => Self::Surrogates(test["kwargs"]["sig_samples"].as_f64().unwrap_or(500.0)),
            ("GPDC", _) => Self::Table,
            ("RegressionCI", _) => Self::Optimum,
            _ => Self::Exact,
        }
    }

    fn value(test: &Value) -> f64 {
        match test["name"].as_str() {
            Some("GPDC") => 1e-3,
            Some("CMIknn") => 2e-3,
            Some("RegressionCI") => 1e-5,
            _ => 1e-9,
        }
    }

    fn p(self, golden: f64) -> f64 {
        match self {
            Self::Exact if golden < 1e-12 => (1e-6 * golden).max(1e-300),
            Self::Exact => (1e-9 * golden).max(1e-15),
            Self::Optimum => 1e-6 + 1e-4 * golden,
            Self::Table => 6e-3,
            Self::Surrogates(n) => 4.0 * ((golden * (1.0 - golden)).max(1e-4) * 2.0 / n).sqrt() + 2.0 / n,
        }
    }
}

/// All numbers of nested lists, in order.
fn flat(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(flat).collect(),
        Value::Number(number) => vec![number.as_f64().unwrap()],
        _ => vec![f64::NAN],
    }
}

fn flat_marks(value: &Value) -> Vec<&str> {
    match value {
        Value::Array(items) => items.iter().flat_map(flat_marks).collect(),
        mark => vec![mark.as_str().unwrap_or_default()],
    }
}

/// The numbers of ours that are farther from the golden ones than `near` allows.
fn far(what: &str, golden: &Value, ours: &Value, near: impl Fn(f64) -> f64) -> Vec<String> {
    let (golden, ours) = (flat(golden), flat(ours));
    if golden.len() != ours.len() {
        return vec![format!("{} {what}s for {}", ours.len(), golden.len())];
    }
    let is_near = |a: f64, b: f64| a.is_nan() && b.is_nan() || (a - b).abs() <= near(a);
    let both = golden.into_iter().zip(ours).enumerate();
    both.filter(|(_, (a, b))| !is_near(*a, *b)).map(|(k, (a, b))| format!("{what} {k}: {a} {b}")).collect()
}

/// The differences between a golden case and our result; empty if they agree.
fn differences(kind: &str, golden: &Value, ours: &Value) -> Vec<String> {
    let (test, params) = (&golden["test"], &golden["params"]);
    let (golden, ours) = (&golden["result"], &ours["result"]);
    let tolerance = Tolerance::of(test);
    let (value, p) = if kind == "single" { ("val", "pval") } else { ("val_matrix", "p_matrix") };
    let mut found = Vec::new();
    let same_parents =
        golden["pc_stage"].is_null() || golden["pc_stage"]["all_parents"] == ours["all_parents"];
    if !same_parents {
        found.push("parents or their order".to_owned());
    }
    let p_values = flat(&golden[p]);
    if !golden[value].is_null() {
        let near = |golden: f64| Tolerance::value(test) * golden.abs().max(1.0);
        found.extend(far("value", &golden[value], &ours[value], near));
    }
    if !golden[p].is_null() {
        found.extend(far("p-value", &golden[p], &ours[p], |golden| tolerance.p(golden)));
    }
    if !golden["graph"].is_null() {
        let level =
            [&params["alpha_level"], &params["pc_alpha"]].iter().find_map(|v| v.as_f64()).unwrap_or(0.05);
        let marks = flat_marks(&golden["graph"]).into_iter().zip(flat_marks(&ours["graph"]));
        for (k, (a, b)) in marks.enumerate() {
            let near = match tolerance {
                Tolerance::Exact => 1e-6,
                other => other.p(p_values[k]),
            };
            if a != b && (p_values[k] - level).abs() > near {
                found.push(format!("mark {k}: '{a}' '{b}'"));
            }
        }
    }
    found
}

/// What differs between an F-PCMCI case, as the ROS message has it, and ours.
fn differences_of_message(golden: &Value, ours: &Value) -> Vec<String> {
    let test = &golden["test"];
    let (golden, ours) = (&golden["result"], &ours["result"]);
    let mut found = Vec::new();
    for key in
        ["features", "selected_features", "causal_structure", "original_shape", "causal_structure_flat_int32"]
    {
        if !golden[key].is_null() && golden[key] != ours[key] {
            found.push(key.to_owned());
        }
    }
    for key in ["val_matrix", "val_matrix_flat"] {
        let near = |golden: f64| Tolerance::value(test) * golden.abs().max(1.0);
        found.extend(far(key, &golden[key], &ours[key], near));
    }
    for key in ["pval_matrix", "pval_matrix_flat"] {
        found.extend(far(key, &golden[key], &ours[key], |golden| Tolerance::of(test).p(golden)));
    }
    // The causes that the filter keeps, in its order; its p-values are those of random surrogates.
    let causes = |filter: &Value, target: &str| -> Vec<(Value, Value)> {
        let kept = filter[target].as_array().cloned().unwrap_or_default();
        kept.into_iter().map(|mut one| (one["cause"].take(), one["lag"].take())).collect()
    };
    for target in golden["filter"].as_object().into_iter().flat_map(|filter| filter.keys()) {
        if causes(&golden["filter"], target) != causes(&ours["filter"], target) {
            found.push(format!("filter of {target}"));
        }
    }
    found
}

/// What became of the cases of some folders.
#[derive(Default)]
struct Outcome {
    count: usize,
    /// Cases that differ, and in what.
    differing: Vec<(String, String)>,
}

impl Outcome {
    /// Runs the cases in `dir/kind`.
    fn add(&mut self, dir: &Path, kind: &str) {
        for file in driver::files(&dir.join(kind)).unwrap() {
            let id = file.trim_end_matches(".json").to_owned();
            let golden = driver::read_json(&dir.join(kind).join(&file)).unwrap();
            self.count += 1;
            let found = match driver::run_file(dir, kind, &file) {
                Err(reason) => vec![reason],
                Ok(ours) if kind == "fpcmci" => differences_of_message(&golden, &ours),
                Ok(ours) => differences(kind, &golden, &ours),
            };
            if let Some(first) = found.first() {
                self.differing.push((id, format!("{} differ, first {first}", found.len())));
            }
        }
    }

    /// Prints the count; no case may differ but `expected`, which must.
    fn check(self, what: &str, expected: &[&str]) {
        let (ran, differing) = (self.count, self.differing.len());
        tell!("golden, {what}: {} of {ran} cases agree", ran - differing);
        for (id, reason) in &self.differing {
            tell!("  differs: {id}: {reason}");
        }
        let ids: Vec<&str> = self.differing.iter().map(|(id, _)| id.as_str()).collect();
        assert_eq!(ids, expected, "{:#?}", self.differing);
        assert!(ran > 0, "no cases of {what}");
    }
}

/// The reference's results.
fn reference() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/golden")
}

#[test]
fn our_own_numbers_are_met() {
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden_own");
    let mut outcome = Outcome::default();
    ["cases", "single"].into_iter().for_each(|kind| outcome.add(&own, kind));
    outcome.check("our own", &[]);
}

#[test]
fn the_reference_is_met() {
    let mut outcome = Outcome::default();
    ["cases", "single"].into_iter().for_each(|kind| outcome.add(&reference(), kind));
    outcome.check("tigramite", &OTHER_RANDOM_NUMBERS[..1]);
}

/// Without the switch only what docs/methods.md lists is different: p-values of GPDC and gsquared, and three tests.
#[test]
fn without_the_switch_only_what_is_listed_differs() {
    let (dir, mut count) = (reference(), 0);
    for file in driver::files(&dir.join("single")).unwrap() {
        let mut case = driver::read_json(&dir.join("single").join(&file)).unwrap();
        let name = case["test"]["name"].as_str().unwrap_or_default().to_lowercase();
        if name == "cmiknn" || ["parcorrwls", "regressionci", "robustparcorr"].contains(&name.as_str()) {
            continue;
        }
        let theirs = driver::run_single(&case).unwrap();
        case["test"]["kwargs"]["as_tigramite"] = false.into();
        let ours = driver::run_single(&case).unwrap();
        assert_eq!(theirs["val"], ours["val"], "{file}");
        if !["gpdc", "gsquared"].contains(&name.as_str()) {
            assert_eq!(theirs["pval"], ours["pval"], "{file}");
        }
        count += 1;
    }
    tell!("golden, without the switch: {count} of {count} values agree");
    assert!(count > 0);
}

#[test]
fn the_original_node_is_met() {
    let mut outcome = Outcome::default();
    outcome.add(&reference(), "fpcmci");
    outcome.check("F-PCMCI as ROS-Causal publishes it", &OTHER_RANDOM_NUMBERS[1..]);
}

#[test]
fn the_trace_of_tests_is_met() {
    let (folder, mut count) = (reference(), 0);
    for file in driver::files(&folder.join("traces")).unwrap() {
        let trace = driver::read_json(&folder.join("traces").join(&file)).unwrap();
        let case = driver::read_json(&folder.join("cases").join(&file)).unwrap();
        let tests: Vec<_> = trace["tests"].as_array().unwrap().iter().collect();
        let results = driver::run_tests(&folder, &case, &tests).unwrap();
        for (test, (value, p)) in tests.iter().zip(&results) {
            let (golden, golden_p) = (test[3].as_f64().unwrap(), test[4].as_f64().unwrap());
            let near = Tolerance::value(&case["test"]);
            assert!((golden - value).abs() <= near * golden.abs().max(1.0), "{file} {test}: {value}");
            assert!((golden_p - p).abs() <= Tolerance::of(&case["test"]).p(golden_p), "{file} {test}: {p}");
        }
        count += results.len();
    }
    tell!("golden, traces: {count} of {count} tests agree");
    assert!(count > 1000);
}

/// The p-value of a GPDC test without conditions is the share of its null distribution above the value: so each test of
/// two series says where one value lies in the distribution.
#[test]
fn the_null_distributions_of_gpdc_are_met() {
    let (dir, mut count) = (reference().join("null_dists"), 0);
    for entry in std::fs::read_dir(&dir).unwrap() {
        let path = entry.unwrap().path();
        let text = std::fs::read_to_string(&path).unwrap();
        let table: Vec<f64> = text.lines().skip(1).map(|line| line.parse().unwrap()).collect();
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        let samples: usize = name.rsplit('T').next().unwrap().parse().unwrap();
        let test = json!({ "name": "GPDC", "kwargs": { "seed": 42, "sig_samples": table.len() } });
        for shift in 1..=40 {
            // Two series of which the second turns about faster and faster.
            let angle = |t: usize| t as f64 * (0.1 + 0.37 * f64::from(shift));
            let x: Vec<f64> = (0..samples).map(|t| (t as f64 * 0.618).fract()).collect();
            let y: Vec<f64> = (0..samples).map(|t| angle(t).sin() + 0.01 * angle(t * t).cos()).collect();
            let ours = driver::run_single(&json!({ "test": test, "x": x, "y": y, "z": null })).unwrap();
            let (value, p) = (ours["val"].as_f64().unwrap(), ours["pval"].as_f64().unwrap());
            let above = table.iter().filter(|null| **null > value).count();
            let share = above as f64 / table.len() as f64;
            assert!((p - share).abs() < 1e-12, "{name}: {value} has p = {p}, the table says {share}");
        }
        count += 1;
    }
    tell!("golden, null distributions: {count} of {count} agree");
    assert!(count > 0);
}

#[test]
fn corrected_p_values_and_a_constant_column_are_met() {
    let misc = driver::read_json(&reference().join("misc.json")).unwrap();
    let matrix = |value: &Value| -> Array3<f64> {
        let (n, effects) = (value.as_array().unwrap().len(), value[0].as_array().unwrap().len());
        let lags = value[0][0].as_array().unwrap().len();
        Array3::from_shape_vec((n, effects, lags), flat(value)).unwrap()
    };
    for case in misc["fdr"].as_array().unwrap() {
        let p = matrix(&case["p"]);
        let lagged_only = case["exclude_contemporaneous"].as_bool().unwrap();
        let tau_min = case["tau_min"].as_u64().unwrap() as usize;
        for (key, first) in [("q_no_assumptions", 0), ("q_all_links_tau_min_to_tau_max", tau_min)] {
            let tested = |(i, j, lag): (usize, usize, usize)| {
                lag >= first && if lag == 0 { i != j && !lagged_only } else { true }
            };
            let q = fdr_bh(&p, &Array3::from_shape_fn(p.dim(), tested));
            for ((at, ours), golden) in q.indexed_iter().zip(matrix(&case[key])) {
                assert!((ours - golden).abs() < 1e-12, "{key} {at:?}: {golden} {ours}");
            }
        }
    }
    let golden = &misc["constant_column"];
    tell!("golden, corrections: {} of {0} agree", misc["fdr"].as_array().unwrap().len());
    let rows = golden["data"].as_array().unwrap();
    let values = ndarray::Array2::from_shape_fn((rows.len(), 3), |(t, k)| rows[t][k].as_f64().unwrap());
    let names = ["a", "b", "constant"].map(str::to_owned).to_vec();
    let data = DataFrame::new(vec![values], names).unwrap();
    let test = independence_tests::by_name("parcorr", &Default::default()).unwrap();
    let settings = PcmciSettings::default();
    let ours = run_pcmci(&data, test.as_ref(), &settings, &Default::default()).unwrap();
    for (what, ours, golden) in
        [("value", &ours.val_matrix, &golden["val"]), ("p", &ours.p_matrix, &golden["p"])]
    {
        for ((at, ours), golden) in ours.indexed_iter().zip(matrix(golden)) {
            assert!((ours - golden).abs() < 1e-9, "{what} {at:?}: {golden} {ours}");
        }
    }
}

/// A larger difference of the value has always been another maximum of a likelihood.
#[test]
fn searches_with_several_maxima_end_in_the_references() {
    let dir = reference().join("gpdc_basins");
    let mut outcome = Outcome::default();
    for file in driver::files(&dir.join("single")).unwrap() {
        let golden = driver::read_json(&dir.join("single").join(&file)).unwrap();
        let ours = driver::run_file(&dir, "single", &file).unwrap();
        let found = far("value", &golden["result"]["val"], &ours["result"]["val"], |_| 5e-4);
        outcome.count += 1;
        outcome.differing.extend(found.into_iter().map(|reason| (file.clone(), reason)));
        for side in ["gp_x", "gp_y"] {
            let likelihood = |of: &Value| of["result"][side]["log_marginal_likelihood"].clone();
            let found = far(side, &likelihood(&golden), &likelihood(&ours), |_| 1e-4);
            outcome.differing.extend(found.into_iter().map(|reason| (file.clone(), reason)));
        }
    }
    outcome.check("GPDC with several maxima", &[]);
}
