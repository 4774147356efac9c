//! Tests of CMIknn: false positives, power, surrogates, settings.

use ndarray::Array2;

use super::*;
use crate::types::DataFrame;

/// Uniform noise in (-1, 1).
fn noise(seed: u64) -> impl FnMut() -> f64 {
    let mut rng = Rng::for_test(seed, Node::new(0, 0), Node::new(1, 0), &[]);
    move || 2.0 * (rng.unit()) - 1.0
}

/// X and Y both follow Z (columns 0, 1, 2); with `direct`, Y also depends on the size of X.
fn fork(n: usize, seed: u64, direct: bool) -> Array2<f64> {
    let mut e = noise(seed);
    let mut data = Array2::zeros((n, 3));
    for mut row in data.rows_mut() {
        let z = e();
        let x = z * z + 0.5 * e();
        let y = z.abs() + 0.3 * e() + if direct { 1.5 * (x - 0.3).abs() } else { 0.0 };
        row.assign(&ndarray::arr1(&[x, y, z]));
    }
    data
}

fn run_with(data: Array2<f64>, settings: &TestSettings, z: &[Node]) -> TestResult {
    let names = (0..data.ncols()).map(|i| i.to_string()).collect();
    let data = DataFrame::new(vec![data], names).expect("is a frame");
    let test = CmiKnn::new(settings).expect("is a test");
    let samples = Samples::new(&data, 0);
    let prepared = test.prepare(&samples).expect("prepares");
    prepared.run_test(Node::new(0, 0), Node::new(1, 0), z).expect("runs")
}

fn settings() -> TestSettings {
    TestSettings { sig_samples: Some(199), ..TestSettings::default() }
}

const Z: [Node; 1] = [Node { var: 2, lag: 0 }];

#[test]
fn a_common_cause_explains_dependence_away_and_a_direct_link_stays() {
    assert!(run_with(fork(300, 1, false), &settings(), &[]).p_value < 0.01);
    assert!(run_with(fork(300, 1, false), &settings(), &Z).p_value > 0.05);
    assert!(run_with(fork(300, 1, true), &settings(), &Z).p_value < 0.01);
}

#[test]
fn false_alarms_come_at_the_level() {
    let p = |seed| run_with(fork(80, seed, false), &settings(), &Z).p_value;
    let alarms = (100..250).filter(|&seed| p(seed) <= 0.1).count();
    // 15 of 150 are expected, with a standard deviation below 4.
    assert!((3..=32).contains(&alarms), "{alarms} of 150 tests at the level 0.1 reject");
}

#[test]
fn a_test_that_stops_gives_the_share_of_those_drawn_until_then() {
    for (seed, direct) in [(1, false), (2, false), (3, false), (1, true)] {
        let all = run_with(fork(120, seed, direct), &settings(), &Z);
        let stopping = |stop| TestSettings { shuffle_stop: Some(stop), ..settings() };
        let stopped = run_with(fork(120, seed, direct), &stopping(10), &Z);
        assert_eq!(all.value, stopped.value);
        let count = (all.p_value * 200.0).round() as usize - 1;
        if count < 10 {
            // Fewer than ten of all reach the value: nothing stops, and nothing changes.
            assert_eq!(stopped.p_value, all.p_value);
        } else {
            // Ten of those drawn, which are at most all.
            let drawn = 10.0 / stopped.p_value;
            assert!((drawn - drawn.round()).abs() < 1e-9 && (10.0..=199.0).contains(&drawn), "{drawn}");
        }
        // One that cannot be reached stops nothing, in batches or at once.
        assert_eq!(run_with(fork(120, seed, direct), &stopping(count + 1), &Z).p_value, all.p_value);
    }
}

#[test]
fn false_alarms_of_a_test_that_stops_come_at_the_level() {
    let settings = TestSettings { shuffle_stop: Some(5), ..settings() };
    let p = |seed| run_with(fork(80, seed, false), &settings, &Z).p_value;
    let alarms = (100..250).filter(|&seed| p(seed) <= 0.1).count();
    assert!((3..=32).contains(&alarms), "{alarms} of 150 tests at the level 0.1 reject");
}

#[test]
fn ranks_do_not_see_monotone_changes() {
    let data = fork(150, 5, true);
    let bent = data.mapv(|v| (3.0 * v).exp());
    assert_eq!(run_with(data.clone(), &settings(), &Z), run_with(bent.clone(), &settings(), &Z));
    let uniform = TestSettings { transform: "uniform".into(), ..settings() };
    assert_eq!(run_with(data.clone(), &settings(), &Z), run_with(data.clone(), &uniform, &Z));
    let standardize = TestSettings { transform: "standardize".into(), ..settings() };
    let scaled = &data * 7.0 + 3.0;
    let (a, b) = (run_with(data, &standardize, &Z), run_with(scaled, &standardize, &Z));
    assert!((a.value - b.value).abs() < 1e-9);
}

#[test]
fn the_value_of_dependent_normals_is_near_the_true_information() {
    let mut e = noise(8);
    // Sums of twelve uniform numbers are nearly normal.
    let mut normal = || (0..12).map(|_| e()).sum::<f64>() / 2.0;
    let data = Array2::from_shape_fn((2000, 2), |_| normal());
    let r = 0.6_f64;
    let mixed = Array2::from_shape_fn((2000, 2), |(t, i)| {
        if i == 0 { data[[t, 0]] } else { r * data[[t, 0]] + (1.0 - r * r).sqrt() * data[[t, 1]] }
    });
    let settings = TestSettings {
        significance: Some(Significance::FixedThres),
        knn: 10.0,
        transform: "standardize".into(),
        ..TestSettings::default()
    };
    let value = run_with(mixed, &settings, &[]).value;
    assert!((value + 0.5 * (1.0 - r * r).ln()).abs() < 0.04, "{value}");
}

#[test]
fn ties_constants_and_short_data_have_defined_answers() {
    let rounded = fork(120, 3, true).mapv(|v| (3.0 * v).round());
    let result = run_with(rounded, &settings(), &Z);
    assert!(result.value.is_finite() && (0.0..=1.0).contains(&result.p_value));
    for column in 0..2 {
        let mut data = fork(50, 2, true);
        data.column_mut(column).fill(1.0);
        let result = run_with(data, &settings(), &Z);
        assert_eq!((result.value, result.p_value), (0.0, 1.0));
    }
    let mut data = fork(50, 2, true);
    data.column_mut(2).fill(1.0);
    let constant_z = run_with(data.clone(), &settings(), &Z).value;
    assert!((constant_z - run_with(data, &settings(), &[]).value).abs() < 1e-12);
    let names = vec!["a".into(), "b".into()];
    let short = DataFrame::new(vec![Array2::zeros((3, 2))], names).expect("is a frame");
    let test = CmiKnn::new(&TestSettings { knn: 5.0, ..settings() }).expect("is a test");
    assert!(test.prepare(&Samples::new(&short, 0)).is_err());
}

#[test]
fn settings_out_of_range_are_named() {
    for bad in [
        TestSettings { knn: 0.0, ..settings() },
        TestSettings { knn: f64::NAN, ..settings() },
        TestSettings { shuffle_neighbors: 1, ..settings() },
        TestSettings { transform: "rank".into(), ..settings() },
        TestSettings { significance: Some(Significance::Analytic), ..settings() },
        TestSettings { confidence: Some(Confidence::Analytic), ..settings() },
    ] {
        assert!(CmiKnn::new(&bad).is_err(), "{bad:?} passes");
    }
}

#[test]
fn the_bootstrap_interval_is_an_interval() {
    let settings = TestSettings {
        significance: Some(Significance::FixedThres),
        confidence: Some(Confidence::Bootstrap),
        conf_samples: 50,
        ..settings()
    };
    let result = run_with(fork(200, 4, true), &settings, &Z);
    let (low, high) = result.confidence.expect("has an interval");
    assert!(low < high && low.is_finite() && high.is_finite());
}
