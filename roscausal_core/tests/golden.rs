//! Results of other implementations: a small set made for this repository (`tests/golden_own`), and the folder of
//! reference results beside the repository if there is one.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

#[path = "../examples/golden/driver.rs"]
mod driver;

use std::path::{Path, PathBuf};

use serde_json::Value;

/// How close a result has to be.
#[derive(Clone, Copy)]
enum Tolerance {
    /// Relative to the p-value.
    Exact,
    /// Residuals that enter through their ranks, and p-values from a null distribution.
    Table,
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
            _ => Self::Exact,
        }
    }

    fn value(test: &Value) -> f64 {
        match test["name"].as_str() {
            Some("GPDC") => 1e-3,
            Some("CMIknn") => 2e-3,
            _ => 1e-9,
        }
    }

    fn p(self, golden: f64) -> f64 {
        match self {
            Self::Exact if golden < 1e-12 => (1e-6 * golden).max(1e-300),
            Self::Exact => (1e-9 * golden).max(1e-15),
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

/// The differences between a golden case and our result; empty if they agree.
fn differences(kind: &str, golden: &Value, ours: &Value) -> Vec<String> {
    let (test, params) = (&golden["test"], &golden["params"]);
    let (golden, ours) = (&golden["result"], &ours["result"]);
    let tolerance = Tolerance::of(test);
    let (value, p) = if kind == "single" { ("val", "pval") } else { ("val_matrix", "p_matrix") };
    let surrogates = matches!(tolerance, Tolerance::Surrogates(_));
    let mut found = Vec::new();
    let same_parents =
        golden["pc_stage"].is_null() || golden["pc_stage"]["all_parents"] == ours["all_parents"];
    if !same_parents {
        // A p-value from surrogates may fall on the other side of the level, and change a condition with it.
        if surrogates {
            return found;
        }
        found.push("parents or their order".to_owned());
    }
    let (values, p_values) = (flat(&golden[value]), flat(&golden[p]));
    if !golden[value].is_null() {
        for (k, (a, b)) in values.iter().zip(flat(&ours[value])).enumerate() {
            if b.is_nan() || (a - b).abs() / a.abs().max(1.0) > Tolerance::value(test) {
                found.push(format!("value {k}: {a} {b}"));
            }
        }
        for (k, (a, b)) in p_values.iter().zip(flat(&ours[p])).enumerate() {
            if b.is_nan() || (a - b).abs() > tolerance.p(*a) {
                found.push(format!("p-value {k}: {a} {b}"));
            }
        }
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

/// Runs the cases of a folder whose id satisfies `wanted`. Returns how many there were.
fn check_folder(dir: &Path, wanted: impl Fn(&str) -> bool) -> usize {
    let mut failures = Vec::new();
    let mut count = 0;
    for kind in ["cases", "single"] {
        for file in driver::files(&dir.join(kind)).unwrap().into_iter().filter(|file| wanted(file)) {
            let golden = driver::read_json(&dir.join(kind).join(&file)).unwrap();
            match driver::run_file(dir, kind, &file) {
                Err(reason) => failures.push(format!("{file}: {reason}")),
                Ok(ours) => {
                    let found = differences(kind, &golden, &ours);
                    if !found.is_empty() {
                        failures.push(format!("{file}: {} differ, first {}", found.len(), found[0]));
                    }
                }
            }
            count += 1;
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
    count
}

/// The folder of reference results, if there is one.
fn reference_folder() -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/golden");
    let folder = std::env::var_os("ROSCAUSAL_GOLDEN").map_or(beside, PathBuf::from);
    if folder.is_dir() {
        return Some(folder);
    }
    eprintln!(
        "SKIPPED: no reference results at {}; set ROSCAUSAL_GOLDEN to their folder to compare with them",
        folder.display()
    );
    None
}

#[test]
fn our_own_numbers_are_met() {
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden_own");
    assert!(check_folder(&own, |_| true) >= 10);
}

#[test]
fn the_reference_is_met_with_partial_correlation() {
    if let Some(folder) = reference_folder() {
        assert!(check_folder(&folder, |id| id.contains("parcorr") && !id.starts_with("lpcmci")) > 0);
    }
}

#[test]
fn the_trace_of_tests_is_met() {
    let Some(folder) = reference_folder() else { return };
    for file in driver::files(&folder.join("traces")).unwrap().into_iter().filter(|f| f.contains("parcorr")) {
        let trace = driver::read_json(&folder.join("traces").join(&file)).unwrap();
        let case = driver::read_json(&folder.join("cases").join(&file)).unwrap();
        let tests: Vec<_> = trace["tests"].as_array().unwrap().iter().collect();
        let results = driver::run_tests(&folder, &case, &tests).unwrap();
        for (test, (value, p)) in tests.iter().zip(results) {
            let (golden, golden_p) = (test[3].as_f64().unwrap(), test[4].as_f64().unwrap());
            assert!((golden - value).abs() < 1e-9, "{file} {test}: {value}");
            assert!((golden_p - p).abs() <= Tolerance::Exact.p(golden_p), "{file} {test}: {p}");
        }
    }
}
