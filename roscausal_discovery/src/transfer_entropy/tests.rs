//! Tests of the transfer-entropy filter on systems whose sources are known.

use ndarray::Array2;

use super::*;
use crate::{numeric::random::Rng, types::Node};

/// Uniform noise of unit variance; the Gaussian estimator tolerates it.
fn noise(seed: u64) -> impl FnMut() -> f64 {
    let mut rng = Rng::new(seed);
    move || (rng.unit() - 0.5) * 12.0_f64.sqrt()
}

/// `c` follows `a` at lag 1 and `b` at lag 2; `a` depends on its past, `b` does not; `d` follows only `c`.
fn system(n: usize, seed: u64) -> Array2<f64> {
    let mut e = noise(seed);
    let mut x = Array2::zeros((n, 4));
    for t in 2..n {
        x[[t, 0]] = 0.6 * x[[t - 1, 0]] + e();
        x[[t, 1]] = e();
        x[[t, 2]] = 0.5 * x[[t - 1, 0]] - 0.6 * x[[t - 2, 1]] + e();
        x[[t, 3]] = 0.7 * x[[t - 1, 2]] + e();
    }
    x
}

fn frame(recordings: Vec<Array2<f64>>) -> DataFrame {
    DataFrame::new(recordings, ["a", "b", "c", "d"].map(str::to_owned).to_vec()).expect("is a frame")
}

fn filter() -> TransferEntropy {
    TransferEntropy { estimator: TeEstimator::Gaussian, min_lag: 1, max_lag: 2, alpha: 0.001, seed: 42 }
}

fn links(selected: &[Selected]) -> Vec<(usize, usize)> {
    selected.iter().map(|s| (s.source.var, s.source.lag)).collect()
}

#[test]
fn the_sources_of_a_known_system_are_found() {
    let result = filter().run(&frame(vec![system(1500, 7)]), &Control::default()).expect("runs");
    let sources: Vec<_> = result.targets.iter().map(|t| links(&t.sources)).collect();
    assert_eq!(sources, [vec![], vec![], vec![(0, 1), (1, 2)], vec![(2, 1)]]);
    assert_eq!(links(&result.targets[0].autodependency), [(0, 1)]);
    assert!(result.targets[1].autodependency.is_empty());
    assert_eq!((result.n_samples, result.n_lost), (1498, 0));
    for target in &result.targets {
        assert!(target.selected().all(|s| s.value > 0.0 && s.p_value < 0.001));
    }
}

#[test]
fn information_does_not_depend_on_units() {
    let data = system(400, 3);
    let scaled = &data * &ndarray::arr2(&[[1e6, -1e-6, 3.0, 1.0]]) + 5.0;
    let (a, b) = (
        filter().run(&frame(vec![data]), &Control::default()).expect("runs"),
        filter().run(&frame(vec![scaled]), &Control::default()).expect("runs"),
    );
    for (a, b) in a.targets.iter().zip(&b.targets) {
        assert_eq!(links(&a.sources), links(&b.sources));
        for (a, b) in a.selected().zip(b.selected()) {
            assert!((a.value - b.value).abs() < 1e-10);
        }
    }
}

#[test]
fn recordings_and_gaps_only_lose_samples() {
    let whole = system(1600, 11);
    let mut gap = whole.slice(ndarray::s![800.., ..]).to_owned();
    gap[[300, 2]] = f64::NAN;
    let parts = vec![whole.slice(ndarray::s![..800, ..]).to_owned(), gap];
    let result = filter().run(&frame(parts), &Control::default()).expect("runs");
    assert_eq!((result.n_samples, result.n_lost), (798 + 798 - 3, 3));
    assert_eq!(links(&result.targets[3].sources), [(2, 1)]);
}

#[test]
fn independent_noise_seldom_passes() {
    let names = |n: usize| (0..n).map(|i| i.to_string()).collect::<Vec<_>>();
    let (mut found, mut targets) = (0, 0);
    for seed in 0..60 {
        let mut e = noise(1000 + seed);
        let data = DataFrame::new(vec![Array2::from_shape_simple_fn((200, 5), &mut e)], names(5))
            .expect("is a frame");
        let result = TransferEntropy { alpha: 0.05, ..filter() }.run(&data, &Control::default());
        for target in result.expect("runs").targets {
            targets += 1;
            found += usize::from(!target.sources.is_empty());
        }
    }
    // At the level 0.05 per target, 15 of 300 are expected, with a standard deviation below 4.
    assert_eq!(targets, 300);
    assert!((3..=30).contains(&found), "{found} of {targets} targets have false sources");
}

#[test]
fn constant_and_duplicate_columns_are_harmless() {
    let mut data = system(300, 5);
    data.column_mut(1).fill(4.0);
    let a = data.column(0).to_owned();
    data.column_mut(3).assign(&a);
    let result = filter().run(&frame(vec![data]), &Control::default()).expect("runs");
    for target in &result.targets {
        assert!(target.selected().all(|s| s.value.is_finite() && (0.0..=1.0).contains(&s.p_value)));
        assert!(target.selected().all(|s| s.source.var != 1));
    }
    assert_eq!(result.targets[1].selected().count(), 0);
}

#[test]
fn parameters_out_of_range_are_named() {
    let data = frame(vec![system(50, 1)]);
    for bad in [
        TransferEntropy { min_lag: 0, ..filter() },
        TransferEntropy { min_lag: 3, ..filter() },
        TransferEntropy { alpha: 1.0, ..filter() },
        TransferEntropy { alpha: f64::NAN, ..filter() },
        TransferEntropy { max_lag: 60, ..filter() },
    ] {
        assert!(bad.run(&data, &Control::default()).is_err(), "{bad:?} passes");
    }
}

#[test]
fn nearest_neighbours_find_what_correlation_cannot_see() {
    let mut e = noise(21);
    let mut x = Array2::zeros((150, 2));
    for t in 1..150 {
        x[[t, 0]] = e();
        x[[t, 1]] = x[[t - 1, 0]] * x[[t - 1, 0]] + 0.2 * e();
    }
    let data = DataFrame::new(vec![x], ["a", "b"].map(str::to_owned).to_vec()).expect("is a frame");
    let run = |estimator| {
        let filter = TransferEntropy { estimator, max_lag: 1, alpha: 0.01, ..filter() };
        filter.run(&data, &Control::default()).expect("runs").targets.swap_remove(1)
    };
    assert!(run(TeEstimator::Gaussian).sources.is_empty());
    let found = run(TeEstimator::Kraskov);
    assert_eq!(links(&found.sources), [(0, 1)]);
    assert!(found.sources[0].value > 0.3 && found.sources[0].p_value <= 0.01);
    assert_eq!(found, run(TeEstimator::Kraskov));
}

#[test]
fn both_estimators_agree_on_linear_systems() {
    let data = frame(vec![system(200, 4)]).select(&[2, 3]);
    let run = |estimator| {
        let filter = TransferEntropy { estimator, max_lag: 1, alpha: 0.01, ..filter() };
        filter.run(&data, &Control::default()).expect("runs").targets.swap_remove(1)
    };
    let (gaussian, kraskov) = (run(TeEstimator::Gaussian), run(TeEstimator::Kraskov));
    assert_eq!(links(&gaussian.sources), [(0, 1)]);
    assert_eq!(links(&kraskov.sources), [(0, 1)]);
    assert!((gaussian.sources[0].value - kraskov.sources[0].value).abs() < 0.12);
}

#[test]
fn levels_below_what_surrogates_resolve_are_refused() {
    let filter = TransferEntropy { estimator: TeEstimator::Kraskov, alpha: 0.004, ..filter() };
    assert!(filter.run(&frame(vec![system(50, 1)]), &Control::default()).is_err());
}

/// `d` follows `a` at lag 1, and for "product" `a` times `b`; all have a past of 0.4. Links that have no correlation.
fn beyond_lines(kind: &str, n: usize, seed: u64) -> Array2<f64> {
    let mut e = noise(seed);
    let mut x = Array2::zeros((n, 4));
    for t in 1..n {
        let (a, b): (f64, f64) = (x[[t - 1, 0]], x[[t - 1, 1]]);
        let (effect, strength) = match kind {
            "quadratic" => (a * a, 1.0),
            "absolute" => (a.abs(), 1.0),
            "cosine" => ((2.0 * a).cos(), 1.0),
            _ => (a * b, 0.3),
        };
        for var in 0..3 {
            x[[t, var]] = 0.4 * x[[t - 1, var]] + e();
        }
        x[[t, 3]] = 0.4 * x[[t - 1, 3]] + effect + strength * e();
    }
    x
}

#[test]
fn distance_correlation_finds_quadratic_absolute_cosine_and_product_links_in_11_of_12_runs() {
    for kind in ["quadratic", "absolute", "cosine", "product"] {
        let finds = |estimator, seed| {
            let filter = TransferEntropy { estimator, max_lag: 1, alpha: 0.05, ..filter() };
            let result =
                filter.run(&frame(vec![beyond_lines(kind, 500, seed)]), &Control::default()).expect("runs");
            result.targets[3].selected().any(|s| s.source == Node::new(0, 1))
        };
        let count = |estimator| (201..213).filter(|&seed| finds(estimator, seed)).count();
        assert!(count(TeEstimator::GaussianDcor) >= 11, "{kind}: {}", count(TeEstimator::GaussianDcor));
        assert!(count(TeEstimator::Gaussian) <= 4, "{kind} has a correlation");
    }
}

#[test]
fn the_second_look_adds_to_what_the_gaussian_filter_finds() {
    let data = frame(vec![system(300, 5)]);
    let run = |estimator| {
        let filter = TransferEntropy { estimator, alpha: 0.05, ..filter() };
        filter.run(&data, &Control::default()).expect("runs").targets
    };
    for (one, both) in run(TeEstimator::Gaussian).into_iter().zip(run(TeEstimator::GaussianDcor)) {
        assert_eq!(one, TargetSelection { beyond: Vec::new(), ..both });
    }
}

#[test]
fn independent_series_pass_the_second_look_as_rarely_as_its_level_says() {
    let alpha = 0.05;
    let filter = TransferEntropy { estimator: TeEstimator::GaussianDcor, max_lag: 1, alpha, ..filter() };
    let passed = |seed| {
        let mut e = noise(seed);
        let data = frame(vec![Array2::from_shape_simple_fn((200, 4), &mut e)]);
        let result = filter.run(&data, &Control::default()).expect("runs");
        result.targets.iter().map(|t| t.beyond.len()).sum::<usize>()
    };
    // 16 pairs in each of 100 runs; four standard errors are 0.022.
    let rate = (1..=100).map(passed).sum::<usize>() as f64 / 1600.0;
    assert!((rate - alpha).abs() < 0.022, "{rate}");
}
