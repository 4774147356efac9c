//! Numbers of other implementations, and of the formulas: a part of the reference cases, in `tests/golden`.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

#[path = "../examples/golden_reasoning/kinds.rs"]
mod kinds;

use std::path::Path;

use kinds::case::{Case, names};
use serde_json::Value;

/// Sets have no order.
fn ordered(key: &str, value: &Value) -> Value {
    let mut value = value.clone();
    if ["mediators", "optimal_set", "adjustment_set", "members"].contains(&key)
        && let Some(items) = value.as_array_mut()
    {
        items.sort_by_key(ToString::to_string);
    }
    value
}

/// What differs by more than `tolerance * max(1, |expected|)`.
fn compare(expected: &Value, got: &Value, tolerance: f64, path: &str) -> Vec<String> {
    match expected {
        Value::Object(fields) => fields
            .iter()
            .filter(|(key, _)| *key != "truth" && *key != "window" && *key != "source")
            .flat_map(|(key, item)| {
                compare(&ordered(key, item), &ordered(key, &got[key]), tolerance, &format!("{path}.{key}"))
            })
            .collect(),
        Value::Array(items) => {
            let others = got.as_array().map_or(&[][..], Vec::as_slice);
            if others.len() != items.len() {
                return vec![format!("{path}: {} items expected, got {}", items.len(), others.len())];
            }
            let each = items.iter().zip(others).enumerate();
            each.flat_map(|(i, (a, b))| compare(a, b, tolerance, &format!("{path}[{i}]"))).collect()
        }
        Value::Number(number) => {
            let (a, b) = (number.as_f64().unwrap(), got.as_f64().unwrap_or(f64::NAN));
            let same = (a - b).abs() <= tolerance * a.abs().max(1.0);
            if same { Vec::new() } else { vec![format!("{path}: {a} expected, got {b}")] }
        }
        other => (other != got).then(|| format!("{path}: {other} expected, got {got}")).into_iter().collect(),
    }
}

/// Runs the cases of a kind, and says how many there were.
fn run(kind: &str, judge: impl Fn(&Case, &Value, &Value) -> Vec<String>) -> usize {
    let set = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden");
    let mut count = 0;
    for name in names(&set.join("cases")).unwrap().iter().filter(|name| name.starts_with(kind)) {
        let case = Case::read(&set, name).unwrap();
        let got = kinds::answer(&case).unwrap();
        let differs = judge(&case, &case.expected, &got);
        assert!(differs.is_empty(), "{name}: {:?}", &differs[..differs.len().min(5)]);
        count += 1;
    }
    count
}

fn numbers(tolerance: f64) -> impl Fn(&Case, &Value, &Value) -> Vec<String> {
    move |_, expected, got| compare(expected, got, tolerance, "")
}

#[test]
fn adjustment_sets_and_total_effects_are_those_of_tigramite() {
    assert_eq!(run("adjustment", numbers(1e-8)), 7);
    assert_eq!(run("total_effect", numbers(1e-8)), 2);
}

#[test]
fn mediation_is_that_of_tigramite() {
    assert_eq!(run("mediation", numbers(1e-8)), 3);
}

#[test]
fn forecasts_interventions_counterfactuals_and_explanations_of_lines_are_exact() {
    assert_eq!(run("prediction", numbers(1e-7)), 2);
    assert_eq!(run("linear", numbers(1e-7)), 4);
}

#[test]
fn open_links_give_every_member_and_its_effect() {
    assert_eq!(run("ambiguous", numbers(1e-8)), 5);
}

#[test]
fn support_is_exact() {
    assert_eq!(run("support", numbers(1e-9)), 2);
}

#[test]
fn gaussian_processes_are_those_of_scikit_learn() {
    let judge = |_: &Case, expected: &Value, got: &Value| {
        let mut differs = Vec::new();
        for trend in ["no_trend", "linear_trend"] {
            let (wanted, had) = (&expected[trend], &got[trend]);
            if had["log_likelihood"].as_f64().unwrap() < wanted["log_likelihood"].as_f64().unwrap() - 1e-3 {
                differs.push(format!("{trend}: a lower likelihood"));
            }
            for key in ["mean", "function_variance", "leave_one_out_residuals"] {
                differs.extend(compare(&wanted[key], &had["given"][key], 1e-6, &format!("{trend}.{key}")));
            }
        }
        differs
    };
    assert_eq!(run("gp", judge), 2);
}

#[test]
fn a_curved_system_is_foreseen_with_intervals_that_hold() {
    let judge = |case: &Case, expected: &Value, got: &Value| {
        let sd: Vec<f64> = kinds::case::numbers(&case.input["sd"]).unwrap();
        let levels: Vec<f64> = kinds::case::numbers(&case.input["quantile_levels"]).unwrap();
        let below = |quantiles: &[f64], x: f64| {
            let k = quantiles.partition_point(|q| *q < x);
            if k == 0 {
                0.0
            } else if k == quantiles.len() {
                1.0
            } else {
                0.5 * (levels[k - 1] + levels[k])
            }
        };
        let (mut errors, mut covered, mut squares, mut count) = (0.0, 0.0, 0.0, 0.0);
        for (q, query) in case.input["queries"].as_array().unwrap().iter().enumerate() {
            let acts = query["interventions"].as_array().unwrap();
            for k in 0..query["horizon"].as_u64().unwrap() as usize {
                for var in (0..sd.len()).filter(|&var| acts.iter().all(|act| act["var"] != var)) {
                    let number = |from: &Value, key: &str| from[q][key][k][var].as_f64().unwrap();
                    let quantiles = kinds::case::numbers(&expected[q]["quantiles"][k][var]).unwrap();
                    errors += (number(got, "mean") - number(expected, "mean")).abs() / sd[var];
                    covered +=
                        below(&quantiles, number(got, "upper")) - below(&quantiles, number(got, "lower"));
                    let off = number(got, "counterfactual") - number(expected, "counterfactual");
                    squares += (off / sd[var]).powi(2);
                    count += 1.0;
                }
            }
        }
        let (mean, cover, again) = (errors / count, covered / count, f64::sqrt(squares / count));
        let fine = mean < 0.1 && (0.84..0.95).contains(&cover) && again < 0.12;
        if fine { Vec::new() } else { vec![format!("mean {mean}, coverage {cover}, counterfactual {again}")] }
    };
    assert_eq!(run("nonlinear", judge), 1);
}
