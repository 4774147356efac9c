//! CMIknn with its permutations: one test by number of samples and conditions; PCMCI on three variables.
#![allow(missing_docs, clippy::unwrap_used, reason = "criterion's macros; a benchmark fails by panicking")]

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use ndarray::Array2;
use roscausal_core::{
    discovery::{Control, DataFrame, Node, PcmciSettings, Samples, run_pcmci},
    independence_tests::{TestSettings, by_name},
};

/// A chain: variable k follows the square of variable k - 1 one step before.
fn data(n: usize, variables: usize) -> DataFrame {
    let mut state = 3u64;
    let mut noise = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    };
    let mut values = Array2::zeros((n, variables));
    for t in 1..n {
        for k in 0..variables {
            let cause: f64 = if k == 0 { 0.0 } else { values[[t - 1, k - 1]] };
            values[[t, k]] = 0.4 * values[[t - 1, k]] + cause * cause + noise();
        }
    }
    DataFrame::new(vec![values], (0..variables).map(|k| format!("v{k}")).collect()).unwrap()
}

fn benches(c: &mut Criterion) {
    let mut group = c.benchmark_group("cmiknn");
    group.sample_size(10);
    let test = by_name("cmiknn", &TestSettings::default()).unwrap();
    for (n, conditions) in [(500, 0), (500, 1), (500, 3), (2000, 1)] {
        let data = data(n, conditions + 2);
        let samples = Samples::new(&data, 1);
        let z: Vec<Node> = (0..conditions).map(|k| Node::new(k, 1)).collect();
        let (x, y) = (Node::new(conditions, 1), Node::new(conditions + 1, 0));
        group.bench_function(format!("test_n{n}_dz{conditions}"), |b| {
            b.iter(|| black_box(test.prepare(&samples).unwrap().run_test(x, y, &z).unwrap()));
        });
    }
    let data = data(500, 3);
    group.bench_function("pcmci_3x500_lag1", |b| {
        let settings = PcmciSettings::default();
        b.iter(|| black_box(run_pcmci(&data, test.as_ref(), &settings, &Control::default()).unwrap()));
    });
    group.finish();
}

criterion_group!(cmiknn, benches);
criterion_main!(cmiknn);
