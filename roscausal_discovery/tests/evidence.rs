//! The laws of the evidence: it is that of the model's own tests, and its size is limited.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use ndarray::Array2;
use proptest::prelude::*;
use roscausal_discovery::{
    Control, DataFrame, Evidence, MOST_POINTS, Model, Settings, analyse, analyse_with_evidence,
    methods::Method, mix,
};

/// `n` variables, each driven by the one before it and by its own past.
fn chain(n: usize, rows: usize, seed: u64) -> DataFrame {
    let mut state = seed;
    let mut noise = || {
        state = mix(state);
        (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    let mut values = Array2::zeros((rows, n));
    for t in 1..rows {
        for var in 0..n {
            let driver = if var == 0 { 0.0 } else { 0.7 * values[[t - 1, var - 1]] };
            values[[t, var]] = 0.4 * values[[t - 1, var]] + driver + noise();
        }
    }
    DataFrame::new(vec![values], (0..n).map(|i| format!("v{i}")).collect()).unwrap()
}

fn found(data: &DataFrame, method: Method) -> (Model, Evidence) {
    let settings = Settings {
        method,
        cond_ind_test: "parcorr".into(),
        tau_min: method.info().tau_min,
        tau_max: 2,
        ..Settings::default()
    };
    let (model, evidence) = analyse_with_evidence(data, &settings, &Control::default()).unwrap();
    assert_eq!(model, analyse(data, &settings, &Control::default()).unwrap(), "evidence changes nothing");
    (model, evidence)
}

fn correlation(points: &[[f32; 2]]) -> f64 {
    let n = points.len() as f64;
    let mean = [0, 1].map(|i| points.iter().map(|p| f64::from(p[i])).sum::<f64>() / n);
    let product = |i: usize, j: usize| -> f64 {
        points.iter().map(|p| (f64::from(p[i]) - mean[i]) * (f64::from(p[j]) - mean[j])).sum()
    };
    product(0, 1) / (product(0, 0) * product(1, 1)).sqrt()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// With a linear test the residuals correlate as strongly as the link says: the conditions are those of its test.
    #[test]
    fn the_residuals_of_a_link_have_its_strength(n in 2..6_usize, seed in 1..1000_u64) {
        let data = chain(n, 290, seed);
        let mut compared = 0;
        for method in [Method::Pcmci, Method::Fpcmci, Method::Fullci, Method::Bivci, Method::Lagdep] {
            let (model, evidence) = found(&data, method);
            prop_assert_eq!(model.links.len(), evidence.links.len());
            for link in &model.links {
                let evidence = evidence.of(link).expect("evidence");
                let seen = if evidence.residuals.is_empty() { &evidence.scatter } else { &evidence.residuals };
                let whole = seen.len() == evidence.n_samples;
                compared += usize::from(whole);
                prop_assert!(!whole || (correlation(seen) - link.value.expect("tested")).abs() < 2e-3, "{method}: {link:?}");
                // The band is where the level is.
                let band = evidence.band.expect("parcorr has a formula");
                let (value, p) = (link.value.expect("tested"), link.p_value.expect("tested"));
                prop_assert_eq!(p <= model.alpha, value.abs() >= band - 1e-9, "{} {:?}", method, link);
                let own = evidence.lags.iter().find(|at| at.lag == link.lag).expect("its own lag");
                prop_assert_eq!((Some(own.value), Some(own.p_value)), (link.value, link.p_value));
            }
        }
        prop_assert!(compared > 4, "only {} links compared", compared);
    }
}

#[test]
fn the_size_is_limited_however_many_links_there_are() {
    let (model, evidence) = found(&chain(40, 400, 3), Method::Lagdep);
    let points: usize = evidence.links.iter().map(|link| link.scatter.len() + link.residuals.len()).sum();
    assert!(model.links.len() > 300, "{}", model.links.len());
    assert!(
        points <= MOST_POINTS && points > MOST_POINTS / 8,
        "{points} points of {} links",
        model.links.len()
    );
    assert!(evidence.to_json().len() < 1_500_000);
}

#[test]
fn no_linear_residuals_are_kept_for_a_test_of_any_form() {
    let settings = Settings { method: Method::Pcmci, cond_ind_test: "gpdc".into(), ..Settings::default() };
    let data = chain(2, 150, 7);
    let (_, evidence) = analyse_with_evidence(&data, &settings, &Control::default()).unwrap();
    assert!(evidence.links.iter().any(|link| !link.conditions.is_empty()), "{evidence:?}");
    assert!(evidence.links.iter().all(|link| link.residuals.is_empty() && !link.scatter.is_empty()));
}

#[test]
fn evidence_reads_back_as_it_was_written() {
    let (_, evidence) = found(&chain(3, 200, 5), Method::Pcmciplus);
    let read: Evidence = serde_json::from_str(&evidence.to_json()).unwrap();
    assert_eq!(read, evidence);
    assert!(
        evidence.links.iter().all(|link| !link.note.is_empty()),
        "PCMCI+ says what is not among the conditions"
    );
}
