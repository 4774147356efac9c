//! GPDC: the null distribution, and one test by number of samples and conditions.
#![allow(missing_docs, clippy::unwrap_used)]

mod data;

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use roscausal_discovery::{
    Node, Samples,
    independence_tests::{TestSettings, by_name},
};

fn benches(c: &mut Criterion) {
    let mut group = c.benchmark_group("gpdc");
    group.sample_size(10);
    let mut seed = 1;
    for n in [500, 2000] {
        let data = data::chain(n, 3);
        let samples = Samples::new(&data, 0);
        group.bench_function(format!("null_table_500_n{n}"), |b| {
            b.iter(|| {
                // A null distribution is computed once per process and seed.
                seed += 1;
                let test = by_name("gpdc", &TestSettings { seed, ..TestSettings::default() }).unwrap();
                let prepared = test.prepare(&samples).unwrap();
                black_box(prepared.run_test(Node::new(0, 0), Node::new(1, 0), &[]).unwrap())
            });
        });
    }
    for (n, conditions) in [(500, 1), (500, 2), (500, 4), (1000, 1), (1000, 2)] {
        let data = data::chain(n, conditions + 2);
        let samples = Samples::new(&data, 1);
        let test = by_name("gpdc", &TestSettings::default()).unwrap();
        let z: Vec<Node> = (0..conditions).map(|k| Node::new(k, 1)).collect();
        let (x, y) = (Node::new(conditions, 0), Node::new(conditions + 1, 0));
        group.bench_function(format!("test_n{n}_dz{conditions}"), |b| {
            b.iter(|| black_box(test.prepare(&samples).unwrap().run_test(x, y, &z).unwrap()));
        });
    }
    group.finish();
}

criterion_group!(gpdc, benches);
criterion_main!(gpdc);
