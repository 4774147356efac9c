//! Granger causality, VARLiNGAM and DYNOTEARS against the reference's numbers, and the laws that they keep.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

#[path = "../examples/golden_methods/data.rs"]
mod data;
#[path = "../examples/golden_methods/dynotears.rs"]
mod dynotears;
#[path = "../examples/golden_methods/granger.rs"]
mod granger;
#[path = "../examples/golden_methods/varlingam.rs"]
mod varlingam;

use std::path::{Path, PathBuf};

use ndarray::{Array2, Axis, concatenate};
use proptest::prelude::*;
use roscausal_discovery::{
    Control, DataFrame,
    methods::{
        DynotearsSettings, GrangerSettings, VarlingamSettings, run_dynotears, run_granger, run_varlingam,
    },
    mix,
};
use serde_json::Value;

/// All numbers of nested lists, in order.
fn flat(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(flat).collect(),
        number => vec![number.as_f64().expect("a number")],
    }
}

/// Every case of `method` with our result.
fn cases(method: &str, run: fn(&Value, &Path) -> Result<Value, String>) -> Vec<(String, Value, Value)> {
    let set: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/golden/methods");
    let files = data::files(&set.join("cases")).unwrap();
    let of_method = files.into_iter().filter(|file| file.starts_with(method));
    let found: Vec<_> = of_method
        .map(|file| {
            let case = data::read_json(&set.join("cases").join(&file)).unwrap();
            let ours = run(&case, &set).unwrap();
            (file, case, ours)
        })
        .collect();
    assert!(found.len() > 2, "{method}");
    found
}

fn check(file: &str, name: &str, golden: &Value, ours: &Value, near: impl Fn(f64) -> f64) {
    let (golden, ours) = (flat(&golden[name]), flat(&ours[name]));
    assert_eq!(golden.len(), ours.len(), "{file} {name}");
    for (at, (a, b)) in golden.iter().zip(&ours).enumerate() {
        assert!((a - b).abs() <= near(*a), "{file} {name} {at}: {a} {b}");
    }
}

#[test]
fn granger_has_the_references_statistics() {
    for (file, case, ours) in cases("granger", granger::run) {
        for name in ["f_matrix", "coef", "t_matrix", "rss", "aic", "bic", "hqic"] {
            check(&file, name, &case["result"], &ours, |golden| (1e-8 * golden.abs()).max(1e-10));
        }
        for name in ["fp_matrix", "p_matrix"] {
            check(&file, name, &case["result"], &ours, |p| if p < 1e-12 { 1e-5 * p } else { 1e-7 * p });
        }
        assert_eq!(case["result"]["df"], ours["df"], "{file}");
        assert_eq!(case["result"]["n_samples"], ours["n_samples"], "{file}");
    }
}

#[test]
fn a_mean_of_a_million_deviations_costs_granger_no_digits() {
    // Multiples of 2^-20, so that the shifted column holds the same numbers exactly. A regression on raw columns loses six digits.
    let small = system(5, 200).mapv(|v| (v * 1048576.0).round() / 1048576.0);
    let mut far = small.clone();
    far.column_mut(0).mapv_inplace(|v| v + 524288.0);
    let settings = GrangerSettings::default();
    let of = |values| run_granger(&frame(vec![values]), &settings, &Control::default()).unwrap();
    let (here, there) = (of(small), of(far));
    for (name, a, b) in [("F", &here.f_matrix, &there.f_matrix), ("p", &here.fp_matrix, &there.fp_matrix)] {
        for (at, (a, b)) in a.iter().zip(b).enumerate() {
            assert!((a / b - 1.0).abs() < 1e-10, "{name} {at}: {a} {b}");
        }
    }
}

#[test]
fn varlingam_has_the_references_order_and_coefficients() {
    for (file, case, ours) in cases("varlingam", varlingam::run) {
        assert_eq!(case["result"]["causal_order"], ours["causal_order"], "{file}");
        check(&file, "ar_coefs", &case["result"], &ours, |_| 1e-8);
        check(&file, "adjacency", &case["result"], &ours, |golden| if golden == 0.0 { 0.0 } else { 1e-6 });
        check(&file, "order_margins", &case["result"], &ours, |_| 1e-6);
    }
}

#[test]
fn dynotears_has_the_references_weights() {
    for (file, case, ours) in cases("dynotears", dynotears::run) {
        let near = 2e-3_f64.max(3.0 * case["result"]["spread"].as_f64().unwrap());
        check(&file, "w", &case["result"], &ours, |_| near);
        check(&file, "a", &case["result"], &ours, |_| near);
        assert!(ours["h"].as_f64().unwrap() <= case["params"]["h_tol"].as_f64().unwrap(), "{file}");
    }
}

/// A random system of four variables: each follows its own past and one other, now or a step before. The noise is uniform.
fn system(seed: u64, n: usize) -> Array2<f64> {
    let mut state = seed;
    let mut unit = move || {
        state = mix(state);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let (lag, strength): (Vec<bool>, Vec<f64>) = (0..4).map(|_| (unit() < 0.5, 0.4 + 0.4 * unit())).unzip();
    let mut values = Array2::from_shape_simple_fn((n, 4), || unit() - 0.5);
    for t in 1..n {
        for k in 0..4 {
            let cause = if k == 0 { 0.0 } else { values[[t - usize::from(lag[k]), k - 1]] };
            values[[t, k]] += 0.3 * values[[t - 1, k]] + strength[k] * cause;
        }
    }
    values
}

fn frame(recordings: Vec<Array2<f64>>) -> DataFrame {
    let n = recordings[0].ncols();
    DataFrame::new(recordings, (0..n).map(|k| format!("v{k}")).collect()).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn granger_does_not_depend_on_the_order_of_variables_or_their_units(seed: u64, scale in 1e-6..1e6_f64) {
        let values = system(seed, 150);
        let settings = GrangerSettings { tau_max: 2, ..GrangerSettings::default() };
        let run = |data: &DataFrame| run_granger(data, &settings, &Control::default()).unwrap();
        let mut other = values.select(Axis(1), &[2, 0, 3, 1]);
        other.column_mut(0).mapv_inplace(|v| scale * v + 3.0);
        let (a, b) = (run(&frame(vec![values])), run(&frame(vec![other])));
        let new = |var: usize| [1, 3, 0, 2][var];
        for ((i, j), f) in a.f_matrix.indexed_iter() {
            prop_assert!((f - b.f_matrix[[new(i), new(j)]]).abs() <= 1e-6 * f.abs().max(1e-3));
        }
    }

    #[test]
    fn a_recording_twice_has_the_same_coefficients_and_more_evidence(seed: u64) {
        let values = system(seed, 150);
        let settings = GrangerSettings::default();
        let run = |data: &DataFrame| run_granger(data, &settings, &Control::default()).unwrap();
        let (once, twice) = (run(&frame(vec![values.clone()])), run(&frame(vec![values.clone(), values.clone()])));
        // One recording in which the second follows the first has a sample across the seam.
        let joined = concatenate(Axis(0), &[values.view(), values.view()]).unwrap();
        prop_assert_eq!(run(&frame(vec![joined])).links.n_samples, twice.links.n_samples + 1);
        for (at, coefficient) in once.coef.indexed_iter() {
            prop_assert!((coefficient - twice.coef[at]).abs() < 1e-9);
        }
        for (at, f) in once.f_matrix.indexed_iter() {
            prop_assert!(twice.f_matrix[at] >= *f);
        }
    }

    #[test]
    fn varlingam_follows_the_names_and_units_of_variables(seed: u64, scale in 1e-3..1e3_f64) {
        let values = system(seed, 300);
        let settings = VarlingamSettings { check_residuals: false, ..VarlingamSettings::default() };
        let run = |data: &DataFrame| run_varlingam(data, &settings, &Control::default()).unwrap();
        let mut other = values.select(Axis(1), &[2, 0, 3, 1]);
        other.column_mut(0).mapv_inplace(|v| scale * v - 7.0);
        let (a, b) = (run(&frame(vec![values])), run(&frame(vec![other])));
        // A tie may fall either way.
        prop_assume!(a.order_margins.iter().all(|margin| *margin > 1e-6));
        let new = |var: usize| [1, 3, 0, 2][var];
        for ((i, j, lag), mark) in a.links.graph.indexed_iter() {
            prop_assert_eq!(*mark, b.links.graph[[new(i), new(j), lag]]);
        }
    }

    #[test]
    fn dynotears_keeps_lag_0_without_cycles_and_follows_names_and_units(seed: u64, scale in 1e-3..1e3_f64) {
        let values = system(seed, 200);
        let run = |data: &DataFrame| run_dynotears(data, &DynotearsSettings::default(), &Control::default()).unwrap();
        let mut other = values.clone();
        other.column_mut(2).mapv_inplace(|v| scale * v + 1.0);
        let (a, b) = (run(&frame(vec![values])), run(&frame(vec![other])));
        prop_assert!(a.h <= 1e-8);
        for (at, weight) in a.a.indexed_iter() {
            prop_assert!((weight - b.a[at]).abs() < 1e-2, "{:?}", at);
        }
    }

    #[test]
    fn no_input_makes_a_panic(seed: u64, rows in 0..12_usize, kind in 0..4) {
        let mut values = system(seed, rows.max(2));
        match kind {
            0 => values.column_mut(1).fill(2.5),
            1 => values.fill(f64::NAN),
            2 => values.fill(1e300),
            _ => {}
        }
        let data = frame(vec![values]);
        for tau_max in 0..3 {
            let control = Control::default();
            let _ = run_granger(&data, &GrangerSettings { tau_max, ..GrangerSettings::default() }, &control);
            let _ = run_varlingam(&data, &VarlingamSettings { tau_max, ..VarlingamSettings::default() }, &control);
            let _ = run_dynotears(&data, &DynotearsSettings { tau_max, ..DynotearsSettings::default() }, &control);
        }
    }
}
