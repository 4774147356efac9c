//! The transfer-entropy filter of F-PCMCI with both estimators.
#![allow(missing_docs, clippy::unwrap_used, reason = "criterion's macros; a benchmark fails by panicking")]

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use ndarray::Array2;
use roscausal_core::discovery::{
    Control, DataFrame,
    transfer_entropy::{TeEstimator, TransferEntropy},
};

/// A chain: variable k follows variable k - 1 one step before.
fn data(n: usize, variables: usize) -> DataFrame {
    let mut state = 5u64;
    let mut noise = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    };
    let mut values = Array2::zeros((n, variables));
    for t in 1..n {
        for k in 0..variables {
            let cause: f64 = if k == 0 { 0.0 } else { values[[t - 1, k - 1]] };
            values[[t, k]] = 0.4 * values[[t - 1, k]] + (2.0 * cause).sin() + noise();
        }
    }
    DataFrame::new(vec![values], (0..variables).map(|k| format!("v{k}")).collect()).unwrap()
}

fn benches(c: &mut Criterion) {
    let mut group = c.benchmark_group("transfer_entropy");
    group.sample_size(10);
    for (name, estimator, variables, n) in [
        ("gaussian_3x500", TeEstimator::Gaussian, 3, 500),
        ("gaussian_8x2000", TeEstimator::Gaussian, 8, 2000),
        ("kraskov_3x500", TeEstimator::Kraskov, 3, 500),
    ] {
        let data = data(n, variables);
        let filter = TransferEntropy { estimator, min_lag: 1, max_lag: 1, alpha: 0.05, seed: 1 };
        group.bench_function(name, |b| b.iter(|| black_box(filter.run(&data, &Control::default()).unwrap())));
    }
    group.finish();
}

criterion_group!(transfer_entropy, benches);
criterion_main!(transfer_entropy);
