//! Properties of runs on any data: invariances, bad input, progress, time budget, cancellation.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use std::sync::{
    Arc, Mutex,
    atomic::{AtomicBool, AtomicUsize, Ordering},
};

use ndarray::{Array2, Array3, Axis};
use proptest::prelude::*;
use roscausal_discovery::{
    Control, DataFrame, Error, LinkAssumptions, Outcome, Settings, analyse,
    independence_tests::{ParCorr, RobustParCorr, TestSettings},
    methods::{
        Fdr, Method, PcmciPlusSettings, PcmciResult, PcmciSettings, Status, fdr_bh, get_lagged_dependencies,
        run_bivci, run_fullci, run_pcmci, run_pcmciplus,
    },
    mix,
};

fn parcorr() -> ParCorr {
    ParCorr::new(&TestSettings::default()).unwrap()
}

fn data_of(values: Array2<f64>) -> DataFrame {
    let names = (0..values.ncols()).map(|v| format!("X{v}")).collect();
    DataFrame::new(vec![values], names).unwrap()
}

/// A linear network of four variables: 0 -> 1 -> 2 -> 3, autocorrelated.
fn chain(seed: u64, n: usize) -> Array2<f64> {
    let mut state = seed | 1;
    let mut noise = move || {
        (0..12)
            .map(|_| {
                state ^= state << 13;
                state ^= state >> 7;
                state ^= state << 17;
                (state >> 11) as f64 / (1_u64 << 53) as f64
            })
            .sum::<f64>()
            - 6.0
    };
    let mut values: Array2<f64> = Array2::zeros((n, 4));
    for t in 0..n {
        for j in 0..4 {
            let past = if t > 0 { 0.5 * values[[t - 1, j]] } else { 0.0 };
            let driven = if t > 0 && j > 0 { 0.5 * values[[t - 1, j - 1]] } else { 0.0 };
            values[[t, j]] = past + driven + noise();
        }
    }
    values
}

fn settings() -> PcmciSettings {
    PcmciSettings { tau_max: 2, ..PcmciSettings::default() }
}

fn run(values: Array2<f64>) -> PcmciResult {
    run_pcmci(&data_of(values), &parcorr(), &settings(), &Control::default()).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn scale_and_shift_change_nothing(
        seed in any::<u64>(),
        scales in prop::array::uniform4(prop::sample::select(vec![-300.0, -1.0, 1e-6, 0.3, 1.0, 4e5])),
        shifts in prop::array::uniform4(-100.0..100.0),
    ) {
        let values = chain(seed, 120);
        let mut moved = values.clone();
        for (j, mut column) in moved.columns_mut().into_iter().enumerate() {
            column.mapv_inplace(|v| scales[j] * (v + shifts[j]));
        }
        let (a, b) = (run(values), run(moved));
        for ((i, j, lag), p) in a.p_matrix.indexed_iter() {
            let sign = f64::signum(scales[i]) * f64::signum(scales[j]);
            prop_assert!((0.0..=1.0).contains(p));
            prop_assert!((p - b.p_matrix[[i, j, lag]]).abs() < 1e-9);
            prop_assert!((a.val_matrix[[i, j, lag]] - sign * b.val_matrix[[i, j, lag]]).abs() < 1e-9);
        }
    }

    #[test]
    fn permuting_the_variables_permutes_the_graph(
        seed in any::<u64>(),
        order in Just(vec![0_usize, 1, 2, 3]).prop_shuffle(),
    ) {
        let values = chain(seed, 120);
        let (a, b) = (run(values.clone()), run(values.select(Axis(1), &order)));
        for ((i, j, lag), mark) in b.graph.indexed_iter() {
            let at = [order[i], order[j], lag];
            prop_assert_eq!(*mark, a.graph[at]);
            prop_assert!((b.p_matrix[[i, j, lag]] - a.p_matrix[at]).abs() < 1e-9);
        }
    }

    #[test]
    fn no_input_makes_it_panic_or_give_nan(
        n in 1_usize..30,
        tau_min in 0_usize..3,
        tau_max in 0_usize..8,
        pc_alpha in prop::sample::select(vec![-1.0, 0.0, 0.05, 0.2, 1.0, 2.0, f64::NAN]),
        alpha_level in prop::sample::select(vec![0.0, 0.05, 1.0, f64::NAN]),
        kinds in prop::array::uniform4(0_u8..5),
        robust in any::<bool>(),
        seed in any::<u64>(),
    ) {
        let mut values = chain(seed, n);
        for (j, kind) in kinds.into_iter().enumerate() {
            let first = values.column(0).to_owned();
            let mut column = values.column_mut(j);
            match kind {
                1 => column.fill(0.1),
                2 => column.assign(&first),
                3 => column.iter_mut().step_by(3).for_each(|v| *v = f64::NAN),
                4 => column.iter_mut().for_each(|v| *v *= 1e200),
                _ => {}
            }
        }
        let data = data_of(values);
        let settings = PcmciSettings { tau_min, tau_max, pc_alpha: vec![pc_alpha], alpha_level, ..settings() };
        let test: Box<dyn roscausal_discovery::CondIndTest> = if robust {
            Box::new(RobustParCorr::new(&TestSettings::default()).unwrap())
        } else {
            Box::new(parcorr())
        };
        let (test, control) = (test.as_ref(), Control::default());
        let results = [
            run_pcmci(&data, test, &settings, &control),
            run_pcmciplus(&data, test, &settings, &PcmciPlusSettings::default(), &control),
            run_fullci(&data, test, &settings, &control),
            run_bivci(&data, test, &settings, &control),
            get_lagged_dependencies(&data, test, &settings, &control),
        ];
        for result in results {
            match result {
                Ok(result) => {
                    prop_assert!(result.val_matrix.iter().all(|v| v.is_finite()));
                    prop_assert!(result.p_matrix.iter().all(|p| (0.0..=1.0).contains(p)));
                }
                Err(error) => prop_assert!(error.to_string().len() > 10),
            }
        }
    }
}

#[test]
fn the_chain_is_found() {
    let result = run(chain(4, 500));
    for j in 0..4 {
        assert!(result.graph[[j, j, 1]].is_link());
        if j > 0 {
            assert!(result.graph[[j - 1, j, 1]].is_link());
        }
    }
    assert_eq!(result.status, Status::Complete);
    assert_eq!(result.n_samples, 496);
}

#[test]
fn nothing_points_to_an_exogenous_variable() {
    let links = LinkAssumptions::all(4, 0, 2).exogenous(&[2]);
    let settings = PcmciSettings { tau_min: 0, link_assumptions: Some(links), ..settings() };
    let data = data_of(chain(4, 300));
    for result in [
        run_pcmci(&data, &parcorr(), &settings, &Control::default()).unwrap(),
        run_pcmciplus(&data, &parcorr(), &settings, &PcmciPlusSettings::default(), &Control::default())
            .unwrap(),
    ] {
        for ((i, j, lag), mark) in result.graph.indexed_iter() {
            let into = j == 2 && matches!(mark.symbol(), "-->" | "o-o" | "x-x");
            assert!(!into, "{i} {mark} {j} at lag {lag}");
        }
        assert!(result.graph[[2, 3, 1]].is_link());
    }
}

#[test]
fn corrected_p_values_decide_and_the_others_stay() {
    let settings = PcmciSettings { fdr: Fdr::Bh, ..settings() };
    let data = data_of(chain(9, 150));
    let result = run_pcmci(&data, &parcorr(), &settings, &Control::default()).unwrap();
    let plain = run(chain(9, 150));
    assert_eq!(result.p_matrix, plain.p_matrix);
    let q = result.q_matrix.as_ref().unwrap();
    for (at, mark) in result.graph.indexed_iter() {
        assert!(q[at] >= result.p_matrix[at]);
        assert_eq!(mark.is_link(), q[at] <= 0.05);
    }
}

#[test]
fn pairs_at_lag_0_are_corrected_once_each_and_by_the_reference_not_at_all() {
    let data = data_of(chain(9, 150));
    let found = |fdr| {
        let settings = PcmciSettings { fdr, tau_min: 0, ..settings() };
        run_pcmci(&data, &parcorr(), &settings, &Control::default()).unwrap()
    };
    let (ours, reference) = (found(Fdr::Bh), found(Fdr::BhLagged));
    let (p, q) = (&ours.p_matrix, ours.q_matrix.as_ref().unwrap());
    let once = Array3::from_shape_fn(p.dim(), |(i, j, lag)| lag > 0 || i < j);
    let expected = fdr_bh(p, &once);
    for ((i, j, lag), &q) in q.indexed_iter() {
        let (first, second) = if lag == 0 { (i.min(j), i.max(j)) } else { (i, j) };
        assert!(i == j && lag == 0 || q == expected[[first, second, lag]], "{i} {j} {lag}");
        assert!(lag > 0 || reference.q_matrix.as_ref().unwrap()[[i, j, 0]] == p[[i, j, 0]]);
    }
}

#[test]
fn what_the_conditions_determine_is_not_tested() {
    let noise = chain(4, 300);
    let a = |t: usize| noise[[t, 0]];
    // b is a of the sample before, d what b was two samples before; a, given as the cause of b, says all of it.
    let values = Array2::from_shape_fn((295, 3), |(t, v)| [a(t + 4), a(t + 3), -a(t + 1)][v]);
    let data = DataFrame::new(vec![values], ["a", "b", "d"].map(str::to_owned).to_vec()).unwrap();
    let settings = Settings {
        method: Method::Pcmci,
        cond_ind_test: "parcorr".into(),
        tau_max: 2,
        ..Settings::default()
    };
    let model = analyse(&data, &settings, &Control::default()).unwrap();
    assert!((model.val_matrix[0][1][1].unwrap() - 1.0).abs() < 1e-9);
    let (value, outcome) = (model.val_matrix[1][2][2], model.outcomes[1][2][2]);
    assert!(value.is_none_or(|value| value.abs() > 0.5) && (value.is_some() == (outcome == Outcome::Tested)));
}

#[test]
fn recordings_are_analysed_without_a_sample_across_the_boundary() {
    let values = chain(5, 200);
    let names: Vec<String> = (0..4).map(|v| format!("X{v}")).collect();
    let parts =
        vec![values.slice(ndarray::s![..90, ..]).to_owned(), values.slice(ndarray::s![90.., ..]).to_owned()];
    let data = DataFrame::new(parts, names).unwrap();
    let result = get_lagged_dependencies(&data, &parcorr(), &settings(), &Control::default()).unwrap();
    assert_eq!(result.n_samples, (90 - 4) + (110 - 4));
    // The same computed from the definition: pairs (x at t - lag, y at t) of both parts, with t from 4 on in each.
    for ((i, j, lag), value) in result.val_matrix.indexed_iter().filter(|((_, _, lag), _)| *lag > 0) {
        let pairs: Vec<(f64, f64)> =
            (4..90).chain(94..200).map(|t| (values[[t - lag, i]], values[[t, j]])).collect();
        let n = pairs.len() as f64;
        let mean = pairs.iter().fold((0.0, 0.0), |m, p| (m.0 + p.0 / n, m.1 + p.1 / n));
        let product =
            |f: fn(f64, f64) -> f64| pairs.iter().map(|p| f(p.0 - mean.0, p.1 - mean.1)).sum::<f64>();
        let expected = product(|a, b| a * b) / (product(|a, _| a * a) * product(|_, b| b * b)).sqrt();
        assert!((value - expected).abs() < 1e-12, "{i} {j} {lag}: {value} {expected}");
    }
}

/// Two signals of a robot and the speed of each of `people`, all independent: a recording for each person, as a batch is pooled.
/// `together`: how much of each speed is of all people alike, such as a crowd's.
fn pooled(seed: u64, people: usize, rows: usize, together: f64) -> DataFrame {
    let signal = |k: usize| chain(mix(1000 * seed + k as u64), rows).column(0).to_owned();
    let (a, b, crowd) = (signal(0), signal(1), signal(999));
    let of = |person: usize| {
        let speed = (1.0 - together).sqrt() * signal(2 + person) + together.sqrt() * &crowd;
        Array2::from_shape_fn((rows, 3), |(t, k)| [&a, &b, &speed][k][t])
    };
    let names = ["r_a", "r_b", "h_v"].map(str::to_owned).to_vec();
    let data = DataFrame::new((0..people).map(of).collect(), names).unwrap();
    data.of_sources(&vec![0; people]).unwrap()
}

#[test]
fn rows_that_people_share_are_counted_once() {
    let (rows, seeds) = (150, 250);
    for (people, together) in [(1, 0.0), (4, 0.0), (20, 0.0), (2, 0.5), (4, 0.5), (20, 0.5)] {
        let (mut robot, mut mixed) = (0, 0);
        for seed in 0..seeds {
            let result = run_pcmci(
                &pooled(seed, people, rows, together),
                &parcorr(),
                &settings(),
                &Control::default(),
            )
            .unwrap();
            let samples = |cause: usize, effect: usize| result.samples[[cause, effect, 1]].unwrap().used;
            assert_eq!(samples(0, 1), rows - 4);
            let share = samples(0, 2) as f64 / (people * (rows - 4)) as f64;
            // As many as are independent, give or take what an estimate from so many times is off.
            let independent = 1.0 / (1.0 + (people as f64 - 1.0) * together);
            assert!((share / independent - 1.0).abs() < 0.6, "{people} people: {share}");
            let found = |cause: usize, effect: usize| usize::from(result.graph[[cause, effect, 1]].is_link());
            robot += found(0, 1) + found(1, 0);
            mixed += found(0, 2) + found(1, 2) + found(2, 0) + found(2, 1);
        }
        // At a level of 5 % more than this happens once in a thousand runs.
        let most = |tests: f64| 0.05 * tests + 3.1 * (0.05 * 0.95 * tests).sqrt();
        let tests = seeds as f64;
        assert!(
            (robot as f64) < most(2.0 * tests),
            "{people} people: {robot} links between the robot's signals"
        );
        println!("{people} people, {together}: {robot} of {}, mixed {mixed} of {}", 2.0 * tests, 4.0 * tests);
        assert!((mixed as f64) < most(4.0 * tests), "{people} people: {mixed} links of robot and person");
    }
}

#[test]
fn a_time_budget_gives_a_partial_result() {
    let asked = Arc::new(AtomicUsize::new(0));
    let control = Control::default().out_of_time(move || asked.fetch_add(1, Ordering::Relaxed) > 40);
    let result = run_pcmci(&data_of(chain(1, 200)), &parcorr(), &settings(), &control).unwrap();
    let Status::Partial(why) = &result.status else { panic!("{:?}", result.status) };
    assert!(why.contains("time budget"), "{why}");
    assert!(result.n_tests <= 41);
    for (at, mark) in result.graph.indexed_iter() {
        assert!(!mark.is_link() || result.p_matrix[at] <= 0.05);
    }
}

#[test]
fn a_time_budget_that_is_up_before_the_run_begins_gives_a_partial_result_with_every_method() {
    let of_one_recording = Method::all().filter(|m| !matches!(m, Method::Candoit | Method::Jpcmciplus));
    for method in of_one_recording {
        let tests =
            if method.info().uses_test { &["parcorr", "robustparcorr", "gpdc"][..] } else { &["parcorr"] };
        let fits = |test: &&&str| method != Method::Timino || **test != "robustparcorr";
        for test in tests.iter().filter(fits) {
            let settings = Settings {
                method,
                tau_min: method.info().tau_min,
                cond_ind_test: (*test).into(),
                ..Settings::default()
            };
            let control = Control::default().out_of_time(|| true);
            let model = analyse(&data_of(chain(1, 200)), &settings, &control).unwrap();
            assert!(
                model.status.to_string().starts_with("partial: the time budget ended"),
                "{method} {test}: {}",
                model.status
            );
        }
    }
}

#[test]
fn a_cancelled_run_ends_with_an_error() {
    let flag = Arc::new(AtomicBool::new(false));
    let raise = flag.clone();
    let control = Control::default().cancel_on(flag).on_progress(move |p| {
        if p.done > 10 {
            raise.store(true, Ordering::Relaxed);
        }
    });
    let end = run_pcmci(&data_of(chain(1, 200)), &parcorr(), &settings(), &control);
    assert!(matches!(end, Err(Error::Cancelled(_))));
}

#[test]
fn progress_ends_at_the_number_of_tests() {
    let seen = Arc::new(Mutex::new(Vec::new()));
    let sink = seen.clone();
    let control = Control::default().on_progress(move |p| sink.lock().unwrap().push(p));
    let result = run_pcmci(&data_of(chain(1, 200)), &parcorr(), &settings(), &control).unwrap();
    let seen = seen.lock().unwrap();
    assert_eq!(seen.len(), result.n_tests);
    assert!(seen.iter().all(|p| p.done <= p.estimated_total));
    assert_eq!(seen.iter().map(|p| p.done).max(), Some(result.n_tests));
}

#[test]
fn complaints_name_the_parameter_and_the_way_out() {
    let data = data_of(chain(1, 20));
    let complaint = |settings: PcmciSettings| {
        run_pcmci(&data, &parcorr(), &settings, &Control::default()).unwrap_err().to_string()
    };
    let message = complaint(PcmciSettings { tau_max: 20, ..settings() });
    assert!(
        message.contains("20 samples") && message.contains("tau_max = 20 needs at least 44"),
        "{message}"
    );
    let message = complaint(PcmciSettings { pc_alpha: vec![1.5], ..settings() });
    assert!(message.contains("'pc_alpha'") && message.contains("between 0 and 1"), "{message}");
    let message = complaint(PcmciSettings { alpha_level: 0.0, ..settings() });
    assert!(message.contains("'alpha'"), "{message}");
    let message = complaint(PcmciSettings { tau_min: 3, ..settings() });
    assert!(message.contains("'tau_min'"), "{message}");
}
