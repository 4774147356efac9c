//! The transfer-entropy filter of F-PCMCI with both estimators.
#![allow(missing_docs, clippy::unwrap_used, reason = "criterion's macros; a benchmark fails by panicking")]

mod data;

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use roscausal_discovery::{
    Control,
    transfer_entropy::{TeEstimator, TransferEntropy},
};

fn benches(c: &mut Criterion) {
    let mut group = c.benchmark_group("transfer_entropy");
    group.sample_size(10);
    for (name, estimator, variables, n) in [
        ("gaussian_3x500", TeEstimator::Gaussian, 3, 500),
        ("gaussian_8x2000", TeEstimator::Gaussian, 8, 2000),
        ("kraskov_3x500", TeEstimator::Kraskov, 3, 500),
    ] {
        let data = data::chain(n, variables);
        let filter = TransferEntropy { estimator, min_lag: 1, max_lag: 1, alpha: 0.05, seed: 1 };
        group.bench_function(name, |b| b.iter(|| black_box(filter.run(&data, &Control::default()).unwrap())));
    }
    group.finish();
}

criterion_group!(transfer_entropy, benches);
criterion_main!(transfer_entropy);
