//! Random systems with fixed seeds, shared by the benchmarks.

use ndarray::Array2;
use roscausal_discovery::DataFrame;

/// A chain of `n` samples: variable k follows the sine of variable k - 1 one step before.
pub(crate) fn chain(n: usize, variables: usize) -> DataFrame {
    let mut state = 1u64;
    let mut noise = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    };
    let mut values = Array2::zeros((n, variables));
    for t in 1..n {
        for k in 0..variables {
            let cause: f64 = if k == 0 { 0.0 } else { values[[t - 1, k - 1]] };
            values[[t, k]] = 0.5 * values[[t - 1, k]] + (2.0 * cause).sin() + noise();
        }
    }
    DataFrame::new(vec![values], (0..variables).map(|k| format!("v{k}")).collect()).unwrap()
}
