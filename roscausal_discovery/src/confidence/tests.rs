//! Laws of resampling.

use ndarray::Array2;
use rayon::ThreadPoolBuilder;

use super::*;
use crate::{methods::Method, numeric::random::Rng};

/// `a` drives `b` strongly one step later; `c` is noise.
fn data(n: usize, seed: u64) -> DataFrame {
    let mut rng = Rng::new(seed);
    let mut x = Array2::zeros((n, 3));
    for t in 1..n {
        x[[t, 0]] = rng.unit() - 0.5;
        x[[t, 1]] = 0.7 * x[[t - 1, 0]] + rng.unit() - 0.5;
        x[[t, 2]] = rng.unit() - 0.5;
    }
    DataFrame::new(vec![x], ["a", "b", "c"].map(str::to_owned).to_vec()).unwrap()
}

fn settings(method: Method, test: &str) -> Settings {
    Settings { method, cond_ind_test: test.into(), ..Settings::default() }
}

fn resampling(resamples: usize) -> Resampling {
    Resampling { resamples, ..Resampling::default() }
}

fn of(model: &Model) -> &Confidence {
    model.confidence.as_ref().unwrap()
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    for (method, test) in [(Method::Pcmci, "parcorr"), (Method::Fpcmci, "gpdc"), (Method::Pcmci, "cmiknn")] {
        let run = |threads: usize| {
            let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let analyse = || {
                let (data, settings) = (data(80, 3), settings(method, test));
                analyse_resampled(&data, &settings, &resampling(20), &Control::default()).unwrap()
            };
            pool.install(analyse).to_file_json()
        };
        assert_eq!(run(1), run(3), "{method} {test}");
    }
}

#[test]
fn a_strong_link_is_firm_and_an_absent_one_is_not() {
    // These two want interventions, and several recordings.
    for method in Method::all().filter(|method| !matches!(method, Method::Candoit | Method::Jpcmciplus)) {
        let info = method.info();
        let tau_min = if info.models_lag_zero { 0 } else { info.tau_min.max(1) };
        let settings = Settings { tau_min, ..settings(method, "parcorr") };
        let model =
            analyse_resampled(&data(300, 5), &settings, &resampling(50), &Control::default()).unwrap();
        let link = model.links.iter().find(|l| l.cause == "a" && l.effect == "b").unwrap();
        assert!(link.confidence.is_some_and(|share| share > 0.95), "{method}: {link:?}");
        assert!(link.value_low <= link.value_high);
        let back = model.features.iter().position(|f| f == "b").unwrap();
        assert!(of(&model).link_frequency[back][0][1] < 0.5, "{method}");
    }
}

#[test]
fn a_time_budget_that_ends_leaves_the_resamples_that_were_done() {
    let whole = analyse_resampled(
        &data(200, 7),
        &settings(Method::Pcmci, "parcorr"),
        &resampling(40),
        &Control::default(),
    );
    let asks = std::sync::Arc::new(std::sync::atomic::AtomicUsize::new(0));
    let many = 1500;
    let control = Control::default().out_of_time({
        let asks = asks.clone();
        move || asks.fetch_add(1, std::sync::atomic::Ordering::Relaxed) > many
    });
    // One thread: another that waits for a core would keep an early resample open, and those after it do not count.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let settings_of = settings(Method::Pcmci, "parcorr");
    let budgeted = || analyse_resampled(&data(200, 7), &settings_of, &resampling(10_000), &control);
    let model = pool.install(budgeted).unwrap();
    assert!(model.status.to_string().starts_with("partial: the time budget ended after"), "{}", model.status);
    let done = of(&model).resampling.done;
    assert!((20..10_000).contains(&done), "{done}");
    // The resamples that were done are the first ones.
    let again = analyse_resampled(
        &data(200, 7),
        &settings(Method::Pcmci, "parcorr"),
        &resampling(done),
        &Control::default(),
    )
    .unwrap();
    assert_eq!(of(&again).link_frequency, of(&model).link_frequency);
    assert_eq!(of(&whole.unwrap()).resampling.done, 40);
}

/// Each resample asks at least once whether time is up, so a budget that is up at the first question leaves few or none.
#[test]
fn a_time_budget_that_ends_before_the_twentieth_resample_leaves_the_model_without_confidence() {
    let asks = std::sync::Arc::new(std::sync::atomic::AtomicUsize::new(0));
    let settings = settings(Method::Pcmci, "parcorr");
    let count = asks.clone();
    let counting = Control::default().out_of_time(move || {
        count.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        false
    });
    analyse(&data(200, 7), &settings, &counting).unwrap();
    // The whole run has its time, and one resample about as much again.
    let most = 2 * asks.swap(0, std::sync::atomic::Ordering::Relaxed);
    let control = Control::default()
        .out_of_time(move || asks.fetch_add(1, std::sync::atomic::Ordering::Relaxed) > most);
    let model = analyse_resampled(&data(200, 7), &settings, &resampling(100), &control).unwrap();
    assert!(model.status.to_string().starts_with("partial: the time budget ended after"), "{}", model.status);
    assert!(model.confidence.is_none() && !model.links.is_empty(), "{:?}", model.status);
    assert!(model.warnings.iter().any(|w| w.contains("too few for a confidence")), "{:?}", model.warnings);
}

#[test]
fn numbers_that_make_no_sense_are_refused_in_a_sentence() {
    let refused = |resampling: Resampling, n: usize, says: &str| {
        let settings = settings(Method::Pcmci, "parcorr");
        let error = analyse_resampled(&data(n, 1), &settings, &resampling, &Control::default()).unwrap_err();
        assert!(error.to_string().contains(says), "{error}");
    };
    refused(resampling(19), 100, "'resamples'");
    refused(Resampling { share: 0.0, ..resampling(20) }, 100, "'share'");
    refused(Resampling { share: 1.0, ..resampling(20) }, 100, "'share'");
    refused(Resampling { block: Block::Rows(100), ..resampling(20) }, 100, "'block'");
    refused(Resampling { block: Block::Rows(30), ..resampling(20) }, 100, "at least 10");
    // Two of them are only the past of others.
    refused(resampling(20), 21, "draws from 19 rows");
    assert!(
        analyse_resampled(
            &data(22, 1),
            &settings(Method::Pcmci, "parcorr"),
            &resampling(20),
            &Control::default()
        )
        .is_ok()
    );
    assert!("1.5".parse::<Block>().is_err() && "0".parse::<Block>().is_err());
    assert!("bootstap".parse::<Scheme>().unwrap_err().to_string().contains("did you mean 'bootstrap'?"));
}

#[test]
fn a_share_is_that_of_the_formula_for_the_statistic() {
    // p-values 0.05, 0.01 and 0.001 of the whole data.
    let shares = |resampling: &Resampling| {
        [1.959_964, 2.575_829, 3.290_527].map(|z| advice::found_share(resampling, z, 1.959_964))
    };
    let near = |ours: [f64; 3], page: [f64; 3]| ours.iter().zip(page).all(|(a, b)| (a - b).abs() < 0.01);
    assert!(near(shares(&resampling(20)), [0.25, 0.56, 0.86]));
    assert!(near(shares(&Resampling { scheme: Scheme::Bootstrap, ..resampling(20) }), [0.50, 0.73, 0.91]));
}

#[test]
fn a_model_with_confidence_reads_back_and_one_without_has_nulls() {
    let settings = settings(Method::Pcmci, "parcorr");
    let model = analyse_resampled(&data(150, 2), &settings, &resampling(30), &Control::default()).unwrap();
    let read: Model = serde_json::from_str(&model.to_file_json()).unwrap();
    assert_eq!(read.confidence.is_some(), model.confidence.is_some());
    assert_eq!(of(&read).link_frequency, of(&model).link_frequency);
    let without = analyse(&data(150, 2), &settings, &Control::default()).unwrap().to_file_json();
    assert!(without.contains("\"link_frequency\": null"), "{without}");
    assert!(serde_json::from_str::<Model>(&without).unwrap().confidence.is_none());
}
