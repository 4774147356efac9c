//! Systems that the tests reason on.

#![allow(dead_code, reason = "each test file takes what it needs")]

use ndarray::Array2;
use roscausal_discovery::{DataFrame, mix};
use roscausal_reasoning::{
    Settings, StructuralModel,
    graph::{Arrow, Graph, Pair},
    question::{Action, Intervention, Kind},
};

/// About normal, from a seed and a place.
pub(crate) fn noise(seed: u64, place: usize) -> f64 {
    let one = |k: u64| mix(mix(seed) ^ (12 * place as u64 + k)) as f64 / u64::MAX as f64;
    (0..12).map(one).sum::<f64>() - 6.0
}

/// The robot's speed `r` goes its own way, the distance `d` shrinks with it, the person's speed `h` falls with the distance; `r` and `h`
/// have no other tie. `x(t)` from `x(t-1)`.
pub(crate) fn chain(seed: u64, rows: usize) -> Array2<f64> {
    let mut x = Array2::zeros((rows, 3));
    for t in 1..rows {
        let e = |k: usize| noise(seed, 3 * t + k);
        x[[t, 0]] = 0.8 * x[[t - 1, 0]] + 0.3 * e(0);
        x[[t, 1]] = 0.6 * x[[t - 1, 1]] - 0.5 * x[[t - 1, 0]] + 0.2 * e(1);
        x[[t, 2]] = 0.5 * x[[t - 1, 2]] + 0.7 * x[[t - 1, 1]] + 0.2 * e(2);
    }
    x
}

pub(crate) fn names() -> Vec<String> {
    ["r", "d", "h"].map(str::to_owned).to_vec()
}

pub(crate) fn arrow(cause: usize, effect: usize, lag: usize) -> Arrow {
    Arrow { cause, effect, lag }
}

pub(crate) fn chain_graph() -> Graph {
    let arrows = [arrow(0, 0, 1), arrow(1, 1, 1), arrow(2, 2, 1), arrow(0, 1, 1), arrow(1, 2, 1)];
    Graph::new(names(), 1, &arrows, &[]).unwrap()
}

pub(crate) fn frame(values: Array2<f64>) -> DataFrame {
    DataFrame::new(vec![values], names()).unwrap()
}

pub(crate) fn chain_model(rows: usize) -> StructuralModel {
    StructuralModel::fit(&frame(chain(1, rows)), &chain_graph(), &Settings::default(), &Vec::new()).unwrap()
}

/// `r` and `d` depend on each other within a moment, in a direction that is open; `d` drives `h`.
pub(crate) fn open_model() -> StructuralModel {
    let mut x = Array2::zeros((500, 3));
    for t in 1..500 {
        let e = |k: usize| noise(3, 3 * t + k);
        x[[t, 0]] = e(0);
        x[[t, 1]] = 0.8 * x[[t, 0]] + 0.6 * e(1);
        x[[t, 2]] = 0.5 * x[[t - 1, 2]] + 0.7 * x[[t - 1, 1]] + 0.5 * e(2);
    }
    let pair = Pair { a: 0, b: 1, conflict: false };
    let graph = Graph::new(names(), 1, &[arrow(1, 2, 1), arrow(2, 2, 1)], &[pair]).unwrap();
    StructuralModel::fit(&frame(x), &graph, &Settings::default(), &Vec::new()).unwrap()
}

pub(crate) fn set(name: &str, variable: &str, value: f64) -> Action {
    act(name, variable, Kind::Set, (1, 0), vec![value])
}

pub(crate) fn act(
    name: &str,
    variable: &str,
    kind: Kind,
    (first_step, last_step): (usize, usize),
    values: Vec<f64>,
) -> Action {
    let one = Intervention { variable: variable.to_owned(), kind, first_step, last_step, values };
    Action { name: name.to_owned(), interventions: vec![one] }
}
