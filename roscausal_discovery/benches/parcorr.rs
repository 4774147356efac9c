//! PCMCI and PCMCI+ with ParCorr on random linear networks, on one thread.

#![allow(missing_docs, clippy::expect_used, reason = "criterion's macros; a benchmark fails by panicking")]

use criterion::{Criterion, criterion_group, criterion_main};
use ndarray::Array2;
use roscausal_discovery::{
    CondIndTest, Control, DataFrame,
    independence_tests::{ParCorr, RobustParCorr, TestSettings},
    methods::{PcmciPlusSettings, PcmciSettings, run_pcmci, run_pcmciplus},
};

/// A stable vector autoregression: autocorrelation 0.5, each variable driven by two others at lags 1 to 3.
fn network(n_vars: usize, n_samples: usize) -> DataFrame {
    let mut state = 7_u64;
    let mut uniform = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let links: Vec<Vec<(usize, usize, f64)>> = (0..n_vars)
        .map(|_| {
            (0..2)
                .map(|_| {
                    let cause = (uniform() * n_vars as f64) as usize;
                    (cause, 1 + (uniform() * 3.0) as usize, 0.2 - 0.4 * uniform())
                })
                .collect()
        })
        .collect();
    let warm_up = 100;
    let mut values = Array2::zeros((warm_up + n_samples, n_vars));
    for t in 0..warm_up + n_samples {
        for j in 0..n_vars {
            let noise: f64 = (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
            let own = if t > 0 { 0.5 * values[[t - 1, j]] } else { 0.0 };
            let driven: f64 =
                links[j].iter().filter(|l| t >= l.1).map(|l| l.2 * values[[t - l.1, l.0]]).sum();
            values[[t, j]] = own + driven + noise;
        }
    }
    let names = (0..n_vars).map(|v| format!("X{v}")).collect();
    DataFrame::new(vec![values.slice(ndarray::s![warm_up.., ..]).to_owned()], names).expect("fits")
}

fn pcmci(c: &mut Criterion) {
    let single = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("one thread");
    let settings = TestSettings::default();
    let parcorr = ParCorr::new(&settings).expect("default settings");
    let robust = RobustParCorr::new(&settings).expect("default settings");
    let tests: [(&str, &dyn CondIndTest); 2] = [("parcorr", &parcorr), ("robustparcorr", &robust)];
    let mut group = c.benchmark_group("pcmci");
    group.sample_size(10);
    for (name, test) in tests {
        for (n_vars, n_samples, tau_max) in [(20, 2000, 5), (50, 500, 5), (3, 500, 1)] {
            let data = network(n_vars, n_samples);
            let settings = PcmciSettings { tau_max, ..PcmciSettings::default() };
            group.bench_function(format!("{name} N={n_vars} T={n_samples} lag={tau_max}"), |b| {
                b.iter(|| {
                    single.install(|| run_pcmci(&data, test, &settings, &Control::default()).expect("runs"))
                });
            });
        }
    }
    group.finish();
}

fn pcmciplus(c: &mut Criterion) {
    let single = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("one thread");
    let parcorr = ParCorr::new(&TestSettings::default()).expect("default settings");
    let data = network(10, 500);
    let settings = PcmciSettings { tau_min: 0, tau_max: 5, pc_alpha: vec![0.01], ..PcmciSettings::default() };
    let plus = PcmciPlusSettings::default();
    c.bench_function("pcmciplus parcorr N=10 T=500 lag=5", |b| {
        b.iter(|| {
            single.install(|| {
                run_pcmciplus(&data, &parcorr, &settings, &plus, &Control::default()).expect("runs")
            })
        });
    });
}

criterion_group!(benches, pcmci, pcmciplus);
criterion_main!(benches);
