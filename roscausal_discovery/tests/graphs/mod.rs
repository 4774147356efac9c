//! Random models to draw.

#![allow(dead_code, reason = "not everybody who draws uses all of it")]

use roscausal_discovery::{LinkMark, Matrices, Model, Settings, mix};

/// Graphs of [`any_graph`].
pub(crate) const GRAPHS: u64 = 200;

/// Graph `number` of [`GRAPHS`]: from 3 to 60 variables, sparse to dense.
pub(crate) fn any_graph(number: u64) -> Model {
    let n = 3 + (number * 57 / (GRAPHS - 1)) as usize;
    let per_variable = [0.5, 1.0, 1.5, 2.0, 3.0, 5.0, n as f64][(number % 7) as usize];
    random_model(n, per_variable, mix(number))
}

/// A model of `n` variables in which each ordered pair has a link at each of three lags with a chance that gives about
/// `per_variable` pairs with links for each variable. The same seed gives the same model.
pub(crate) fn random_model(n: usize, per_variable: f64, seed: u64) -> Model {
    let mut drawn = seed;
    let mut uniform = || {
        drawn = mix(drawn);
        (drawn >> 11) as f64 / (1_u64 << 53) as f64
    };
    let lags = 3;
    let empty = || vec![vec![vec![0.0; lags + 1]; n]; n];
    let mut graph = vec![vec![vec![LinkMark::Absent; lags + 1]; n]; n];
    let (mut val_matrix, mut p_matrix) = (empty(), empty());
    for i in 0..n {
        for j in 0..n {
            if uniform() >= per_variable / n as f64 && (i != j || uniform() < 0.5) {
                continue;
            }
            let first = 1 + (uniform() * lags as f64) as usize;
            for lag in first..=lags {
                if lag == first || uniform() < 0.3 {
                    graph[i][j][lag] = LinkMark::Forward;
                    val_matrix[i][j][lag] = 2.0 * uniform() - 1.0;
                    p_matrix[i][j][lag] = 0.05 * uniform() * uniform();
                }
            }
        }
    }
    let features = (0..n).map(|i| format!("variable_{i}")).collect();
    let blank = Model { tau_max: lags, n_samples: 1000, ..Settings::default().blank_model() };
    blank.with_matrices(features, Matrices { graph, val_matrix, p_matrix, ..Matrices::default() })
}
