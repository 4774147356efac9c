//! J-PCMCI+ and its test: what recordings differ in makes no link, and a question that the data cannot answer is refused.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use ndarray::{Array2, array};
use roscausal_discovery::{
    CondIndTest, Control, DataFrame, Dummy, LinkMark, Node, Samples,
    independence_tests::{ParCorr, RobustParCorr, TestSettings},
    methods::{JpcmciPlusSettings, NodeClass, PcmciPlusSettings, PcmciResult, run_jpcmciplus, run_pcmciplus},
    mix,
};

/// Uniform noise of variance 1.3.
fn noise(seed: u64, i: usize) -> f64 {
    4.0 * (mix(seed.wrapping_mul(1_000_003) + i as u64) as f64 / u64::MAX as f64 - 0.5)
}

fn parcorr() -> ParCorr {
    ParCorr::new(&TestSettings::default()).unwrap()
}

/// Recordings of three variables, the second of which follows the first one step later. All values of a recording are
/// `higher(k)` higher.
fn people(n: usize, seed: u64, higher: impl Fn(usize) -> f64) -> DataFrame {
    let recording = |k: usize| {
        let mut values = Array2::from_shape_fn((150, 3), |(t, v)| noise(seed, 450 * k + 3 * t + v));
        (1..150).for_each(|t| values[[t, 1]] += 0.7 * values[[t - 1, 0]]);
        values.mapv_into(|v| v + higher(k))
    };
    let names = ["a", "b", "c"].map(String::from).to_vec();
    DataFrame::new((0..n).map(recording).collect(), names).unwrap()
}

/// Links between different variables of the system.
fn links(result: &PcmciResult) -> Vec<(usize, usize, usize)> {
    let system =
        |&((i, j, lag), _): &((usize, usize, usize), &LinkMark)| i.max(j) < 3 && i != j && (lag > 0 || i < j);
    let found = result.graph.indexed_iter().filter(system).filter(|(_, mark)| mark.is_link());
    found.map(|(at, _)| at).collect()
}

/// A law: that pooled recordings differ in their means makes no link. At a level of 0.01, chance leaves about one false link in
/// ten systems of nine pairs.
#[test]
fn pooling_systems_that_differ_in_their_means_makes_no_link() {
    let settings = JpcmciPlusSettings::default();
    let plus = PcmciPlusSettings::default();
    let control = Control::default();
    for height in [1.0, 3.0, 10.0] {
        let (mut with_dummy, mut without) = (0, 0);
        for seed in 0..10 {
            let data = people(2, seed, |k| height * k as f64);
            let found = links(&run_jpcmciplus(&data, &parcorr(), &settings, &control).unwrap().result);
            let pooled = links(&run_pcmciplus(&data, &parcorr(), &settings.pcmci, &plus, &control).unwrap());
            assert!(found.contains(&(0, 1, 1)), "seed {seed}: {found:?}");
            with_dummy += found.iter().filter(|link| **link != (0, 1, 1)).count();
            without += pooled.iter().filter(|link| **link != (0, 1, 1)).count();
        }
        let counts = format!("false links: {with_dummy} with the dummy, {without} without");
        assert!(with_dummy <= 5 && without > with_dummy + 3, "{height}: {counts}");
    }
}

#[test]
fn a_context_that_was_recorded_is_found_as_a_cause() {
    let plain = people(8, 3, |_| 0.0);
    let with_age = |(k, r): (usize, &Array2<f64>)| {
        let age = (k as f64) / 2.0;
        Array2::from_shape_fn((r.nrows(), 4), |(t, v)| match v {
            3 => age,
            2 => r[[t, 2]] + age,
            _ => r[[t, v]],
        })
    };
    let recordings = plain.recordings().iter().enumerate().map(with_age).collect();
    let data = DataFrame::new(recordings, ["a", "b", "c", "age"].map(String::from).to_vec()).unwrap();
    let mut classes = vec![NodeClass::System; 4];
    classes[3] = NodeClass::SpaceContext;
    let settings = JpcmciPlusSettings { classes, dummies: Vec::new(), ..JpcmciPlusSettings::default() };
    let found = run_jpcmciplus(&data, &parcorr(), &settings, &Control::default()).unwrap();
    assert_eq!(found.context_parents[2], [Node::new(3, 0)]);
    assert_eq!(found.result.graph[[3, 2, 0]], LinkMark::Forward);
}

#[test]
fn bad_contexts_and_dummies_are_refused_in_a_sentence() {
    let recording = || Array2::from_shape_fn((40, 2), |(t, v)| ((t * t * (v + 1)) % 7) as f64);
    let names = || vec!["x".to_owned(), "age".to_owned()];
    let data = DataFrame::new(vec![recording(), recording()], names()).unwrap();
    let refused = |data: &DataFrame, test: &dyn CondIndTest, settings: JpcmciPlusSettings| {
        run_jpcmciplus(data, test, &settings, &Control::default()).unwrap_err().to_string()
    };
    let usual = JpcmciPlusSettings::default;
    let space = vec![NodeClass::System, NodeClass::SpaceContext];
    let error = refused(&data, &parcorr(), JpcmciPlusSettings { classes: space, ..usual() });
    assert!(error.contains("'age' varies within recording 0"), "{error}");
    let other = array![[0.0, 1.0], [1.0, 2.0], [2.0, 3.0], [5.0, 1.0], [2.0, 2.0], [1.0, 1.0]];
    let uneven = DataFrame::new(vec![recording(), other], names()).unwrap();
    let time = vec![NodeClass::System, NodeClass::TimeContext];
    let error = refused(&uneven, &parcorr(), JpcmciPlusSettings { classes: time, ..usual() });
    assert!(error.contains("same in all recordings"), "{error}");
    let one = DataFrame::new(vec![recording()], names()).unwrap();
    assert!(refused(&one, &parcorr(), usual()).contains("one recording"));
    let robust = RobustParCorr::new(&TestSettings::default()).unwrap();
    assert!(refused(&data, &robust, usual()).contains("take parcorr"));
    let mut levels = usual();
    levels.pcmci.pc_alpha = vec![0.01, 0.05];
    assert!(refused(&data, &parcorr(), levels).contains("one level"));
    let mut late = usual();
    late.pcmci.tau_min = 1;
    assert!(refused(&data, &parcorr(), late).contains("lag 0"));
}

/// Recordings of two independent variables and a third that follows the first; each recording has a level of its own.
fn levels(n_recordings: usize, missing: bool) -> DataFrame {
    let recording = |k: usize| {
        let mut values =
            Array2::from_shape_fn((60, 3), |(t, v)| noise(7, 999 * k + 3 * t + v) + ((k * k) % 5) as f64);
        (0..60).for_each(|t| values[[t, 2]] += values[[t, 0]]);
        if missing && k == 1 {
            values[[7, 1]] = f64::NAN;
        }
        values
    };
    let names = ["a", "b", "c"].map(String::from).to_vec();
    DataFrame::new((0..n_recordings).map(recording).collect(), names).unwrap()
}

/// The same with the dummy as columns of the data, but the last, which follows from the others.
fn with_columns(data: &DataFrame) -> DataFrame {
    let n = data.recordings().len();
    let wide = |(k, r): (usize, &Array2<f64>)| {
        Array2::from_shape_fn((r.nrows(), 3 + n - 1), |(t, v)| {
            if v < 3 { r[[t, v]] } else { f64::from(u8::from(v - 3 == k)) }
        })
    };
    let names = (0..3 + n - 1).map(|v| format!("v{v}")).collect();
    DataFrame::new(data.recordings().iter().enumerate().map(wide).collect(), names).unwrap()
}

#[test]
fn a_dummy_among_the_conditions_gives_the_value_of_its_columns() {
    let plain = ParCorr::new(&TestSettings::default()).unwrap();
    let test = plain.with_dummies(&[Dummy::Space]).unwrap();
    for missing in [false, true] {
        let (data, wide) = (levels(4, missing), with_columns(&levels(4, missing)));
        let (samples, wide_samples) = (Samples::new(&data, 2), Samples::new(&wide, 2));
        let (prepared, by_columns) = (test.prepare(&samples).unwrap(), plain.prepare(&wide_samples).unwrap());
        for (x, y, z) in
            [(0, 1, vec![]), (0, 2, vec![Node::new(1, 1)]), (1, 2, vec![Node::new(0, 0), Node::new(2, 1)])]
        {
            let (x, y) = (Node::new(x, 1), Node::new(y, 0));
            let columns = (3..6).map(|var| Node::new(var, 0));
            let wide_z: Vec<Node> = z.iter().copied().chain(columns).collect();
            let dummy_z: Vec<Node> = z.iter().copied().chain([Node::new(3, 0)]).collect();
            let expected = by_columns.run_test(x, y, &wide_z).unwrap();
            let found = prepared.run_test(x, y, &dummy_z).unwrap();
            assert!((found.value - expected.value).abs() < 1e-10, "{found:?} {expected:?}");
            assert_eq!((found.n_samples, found.n_lost), (expected.n_samples, expected.n_lost));
        }
    }
}

#[test]
fn a_dummy_as_a_cause_is_the_strongest_of_its_columns() {
    let plain = ParCorr::new(&TestSettings::default()).unwrap();
    let test = plain.with_dummies(&[Dummy::Space]).unwrap();
    let (data, wide) = (levels(4, false), with_columns(&levels(4, false)));
    let (samples, wide_samples) = (Samples::new(&data, 0), Samples::new(&wide, 0));
    let (prepared, by_columns) = (test.prepare(&samples).unwrap(), plain.prepare(&wide_samples).unwrap());
    let z = [Node::new(0, 0)];
    let found = prepared.run_test(Node::new(3, 0), Node::new(1, 0), &z).unwrap();
    let of = |var| by_columns.run_test(Node::new(var, 0), Node::new(1, 0), &z).unwrap().value;
    let largest = (3..6).map(of).fold(0.0_f64, |most, value| most.max(value.abs()));
    assert!(found.value.abs() >= largest - 1e-10, "{found:?} {largest}");
    assert!(found.p_value < 0.05);
}

#[test]
fn what_a_dummy_cannot_be_asked_is_one_sentence() {
    let plain = parcorr();
    let test = plain.with_dummies(&[Dummy::Space]).unwrap();
    let one = levels(1, false);
    let error = test.prepare(&Samples::new(&one, 0)).err().unwrap().to_string();
    assert!(error.contains("one recording"), "{error}");
    let uneven =
        DataFrame::new(vec![Array2::zeros((9, 2)), Array2::zeros((8, 2))], vec!["a".into(), "b".into()]);
    let test = plain.with_dummies(&[Dummy::Time]).unwrap();
    let error = test.prepare(&Samples::new(&uneven.unwrap(), 0)).err().unwrap().to_string();
    assert!(error.contains("equal length"), "{error}");
}

/// A column that no test asks about, with a hole, sends every test to the samples. Recordings differ by up to thirty thousand deviations.
#[test]
fn sums_over_recordings_give_what_the_samples_give() {
    let wide = |hole: bool| {
        let more = |(k, r): (usize, &Array2<f64>)| {
            Array2::from_shape_fn((r.nrows(), 5), |(t, v)| match v {
                0..3 => r[[t, v]] + if v == 1 { 1e4 * ((k * k) % 5) as f64 } else { 0.0 },
                3 => (k % 3) as f64,
                _ if hole && t == 30 => f64::NAN,
                _ => noise(11, 99 * k + t),
            })
        };
        let recordings = levels(6, false).recordings().iter().enumerate().map(more).collect();
        DataFrame::new(recordings, ["a", "b", "c", "context", "other"].map(String::from).to_vec()).unwrap()
    };
    let (whole, holed) = (wide(false), wide(true));
    let (samples, holed_samples) = (Samples::new(&whole, 2), Samples::new(&holed, 2));
    let plain = parcorr();
    for dummies in [&[Dummy::Space][..], &[Dummy::Time], &[Dummy::Space, Dummy::Time]] {
        let test = plain.with_dummies(dummies).unwrap();
        let (fast, slow) = (test.prepare(&samples).unwrap(), test.prepare(&holed_samples).unwrap());
        let nodes = [(0, 1), (1, 0), (1, 1), (2, 0), (2, 2), (3, 0), (5, 0), (6, 0)];
        let nodes: Vec<Node> =
            nodes[..6 + dummies.len()].iter().map(|&(var, lag)| Node::new(var, lag)).collect();
        for (k, &x) in nodes.iter().enumerate() {
            for &y in nodes.iter().filter(|y| **y != x && y.var < 3) {
                for size in 0..4 {
                    let z: Vec<Node> = (1..=size).map(|m| nodes[(k + 2 * m) % nodes.len()]).collect();
                    if z.contains(&x) || z.contains(&y) {
                        continue;
                    }
                    let (a, b) = (fast.run_test(x, y, &z).unwrap(), slow.run_test(x, y, &z).unwrap());
                    assert!((a.value.abs() - b.value.abs()).abs() < 1e-9, "{x:?} {y:?} {z:?}: {a:?} {b:?}");
                    assert!((a.p_value - b.p_value).abs() < 1e-7, "{x:?} {y:?} {z:?}: {a:?} {b:?}");
                }
            }
        }
    }
}
