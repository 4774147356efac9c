//! CMIknn with its permutations: one test by number of samples and conditions, and PCMCI on three variables.
#![allow(missing_docs, clippy::unwrap_used, reason = "criterion's macros; a benchmark fails by panicking")]

mod data;

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use roscausal_discovery::{
    Control, Node, Samples,
    independence_tests::{TestSettings, by_name},
    methods::{PcmciSettings, run_pcmci},
};

fn benches(c: &mut Criterion) {
    let mut group = c.benchmark_group("cmiknn");
    group.sample_size(10);
    let test = by_name("cmiknn", &TestSettings::default()).unwrap();
    for (n, conditions) in [(500, 0), (500, 1), (500, 3), (2000, 1)] {
        let data = data::chain(n, conditions + 2);
        let samples = Samples::new(&data, 1);
        let z: Vec<Node> = (0..conditions).map(|k| Node::new(k, 1)).collect();
        let (x, y) = (Node::new(conditions, 1), Node::new(conditions + 1, 0));
        group.bench_function(format!("test_n{n}_dz{conditions}"), |b| {
            b.iter(|| black_box(test.prepare(&samples).unwrap().run_test(x, y, &z).unwrap()));
        });
    }
    let data = data::chain(500, 3);
    group.bench_function("pcmci_3x500_lag1", |b| {
        let settings = PcmciSettings::default();
        b.iter(|| black_box(run_pcmci(&data, test.as_ref(), &settings, &Control::default()).unwrap()));
    });
    group.finish();
}

criterion_group!(cmiknn, benches);
criterion_main!(cmiknn);
