//! The methods that are models of linear effects, on one thread.
#![allow(missing_docs, clippy::unwrap_used, reason = "criterion's macros; a benchmark fails by panicking")]

mod data;

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use roscausal_discovery::{
    Control,
    methods::{
        DynotearsSettings, GrangerSettings, VarlingamSettings, run_dynotears, run_granger, run_varlingam,
    },
};

fn benches(c: &mut Criterion) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let control = Control::default();
    let mut group = c.benchmark_group("linear_models");
    group.sample_size(10).warm_up_time(std::time::Duration::from_millis(200));
    group.measurement_time(std::time::Duration::from_secs(1));
    let (long, short) = (data::chain(1000, 10), data::chain(500, 10));
    let settings = GrangerSettings { tau_max: 5, ..GrangerSettings::default() };
    group.bench_function("granger_10x1000_p5", |b| {
        b.iter(|| pool.install(|| black_box(run_granger(&long, &settings, &control).unwrap())));
    });
    for (name, tau_max, prune, check_residuals) in [
        ("varlingam_10x1000_p1_full", 1, false, false),
        ("varlingam_10x1000_p5_full", 5, false, false),
        ("varlingam_10x1000_p1_pruned", 1, true, false),
        ("varlingam_10x1000_p5_pruned", 5, true, false),
        ("varlingam_10x1000_p1_pruned_checked", 1, true, true),
    ] {
        let settings = VarlingamSettings { tau_max, prune, check_residuals, ..VarlingamSettings::default() };
        group.bench_function(name, |b| {
            b.iter(|| pool.install(|| black_box(run_varlingam(&long, &settings, &control).unwrap())));
        });
    }
    for (name, tau_max) in [("dynotears_10x500_p1", 1), ("dynotears_10x500_p2", 2)] {
        let settings =
            DynotearsSettings { tau_max, lambda_w: 0.05, lambda_a: 0.05, ..DynotearsSettings::default() };
        group.bench_function(name, |b| {
            b.iter(|| pool.install(|| black_box(run_dynotears(&short, &settings, &control).unwrap())));
        });
    }
    group.finish();
}

criterion_group!(linear_models, benches);
criterion_main!(linear_models);
