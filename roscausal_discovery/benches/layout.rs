//! How long the picture of a graph takes: 3 to 60 variables, sparse and crowded, and the slowest of the 200 graphs that the laws are
//! tested on. At most 200 ms is aimed at.

#![allow(missing_docs, reason = "criterion's macros make undocumented functions")]

#[path = "../tests/graphs/mod.rs"]
mod graphs;

use std::{hint::black_box, time::Instant};

use criterion::{Criterion, criterion_group, criterion_main};
use roscausal_discovery::draw;

fn dag(c: &mut Criterion) {
    for (n, per_variable) in [(3, 3.0), (9, 9.0), (15, 15.0), (30, 2.0), (60, 2.0), (60, 3.0), (60, 60.0)] {
        let model = graphs::random_model(n, per_variable, 7);
        c.bench_function(&format!("dag of {n} variables, {} links", model.links.len()), |b| {
            b.iter(|| draw::dag(black_box(&model)));
        });
    }
}

/// The one that takes longest when each is drawn once.
fn slowest(c: &mut Criterion) {
    let slowest = (0..graphs::GRAPHS).map(graphs::any_graph).max_by_key(|model| {
        let start = Instant::now();
        black_box(draw::dag(model));
        start.elapsed()
    });
    let Some(model) = slowest else { return };
    let name = format!(
        "the slowest of {}: {} variables, {} links",
        graphs::GRAPHS,
        model.features.len(),
        model.links.len()
    );
    c.bench_function(&name, |b| b.iter(|| draw::dag(black_box(&model))));
}

criterion_group!(benches, dag, slowest);
criterion_main!(benches);
