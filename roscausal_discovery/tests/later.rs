//! The look at lags beyond those that are tested: over random systems, what it advises contains the true lags, and nothing is advised
//! without them.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use ndarray::Array2;
use roscausal_discovery::{Control, DataFrame, DataProfile, Later, Settings, analyse, methods::Method, mix};

fn uniform(seed: &mut u64) -> f64 {
    *seed += 1;
    mix(*seed) as f64 / u64::MAX as f64
}

fn normal(seed: &mut u64) -> f64 {
    (0..12).map(|_| uniform(seed)).sum::<f64>() - 6.0
}

/// A random system: three to six variables that remember, and `links` effects after `lags`; with the largest of these.
fn system(seed: u64, links: usize, lags: std::ops::RangeInclusive<usize>) -> (DataFrame, usize) {
    let mut seed = mix(seed + 1) >> 1;
    let n = 3 + (4.0 * uniform(&mut seed)) as usize;
    let own: Vec<f64> = (0..n).map(|_| 0.2 + 0.6 * uniform(&mut seed)).collect();
    let of_link = |k: usize, seed: &mut u64| {
        let effect = 1 + k % (n - 1);
        let cause = (uniform(seed) * effect as f64) as usize;
        let span = (lags.end() - lags.start() + 1) as f64;
        let lag = lags.start() + (uniform(seed) * span) as usize;
        (cause, effect, lag, (0.35 + 0.3 * uniform(seed)) * if uniform(seed) < 0.5 { 1.0 } else { -1.0 })
    };
    let all: Vec<_> = (0..links).map(|k| of_link(k, &mut seed)).collect();
    let rows = 600 + (600.0 * uniform(&mut seed)) as usize;
    let mut values = Array2::<f64>::zeros((rows, n));
    for t in 6..rows {
        for var in 0..n {
            let parents = all.iter().filter(|(_, effect, ..)| *effect == var);
            let driven: f64 = parents.map(|(cause, _, lag, size)| size * values[[t - lag, *cause]]).sum();
            values[[t, var]] = own[var] * values[[t - 1, var]] + driven + normal(&mut seed);
        }
    }
    let names = (0..n).map(|var| format!("v{var}")).collect();
    let longest = all.iter().map(|(_, _, lag, _)| *lag).max().unwrap_or(0);
    (DataFrame::new(vec![values], names).unwrap(), longest)
}

fn advised(data: &DataFrame) -> usize {
    let (profile, _) = DataProfile::of(data, 1);
    profile.with_later(data, 1, Some("parcorr"), Some(0.1)).later.first().map_or(1, |later| later.tau_max)
}

#[test]
fn the_advised_lag_contains_the_true_ones_and_is_not_much_longer() {
    let (mut contained, mut short) = (0, 0);
    for seed in 0..100 {
        let (data, longest) = system(seed, 3, 1..=6);
        let advised = advised(&data);
        contained += usize::from(advised >= longest);
        short += usize::from(advised <= (2 * longest).max(1));
    }
    assert!(contained >= 95 && short >= 90, "{contained} {short}");
}

#[test]
fn there_is_no_advice_without_longer_lags() {
    for (links, what) in [(3, "lag 1"), (0, "no links")] {
        let quiet = (0..100).filter(|&seed| advised(&system(900 + seed, links, 1..=1).0) == 1).count();
        assert!(quiet >= 95, "{what}: {quiet}");
    }
}

/// Effects that no line shows, after `lags`: the cause counts by how far it is from 0.
fn bent(seed: u64, lags: std::ops::RangeInclusive<usize>) -> (DataFrame, usize) {
    let mut seed = mix(seed + 77) >> 1;
    let span = (lags.end() - lags.start() + 1) as f64;
    let lag = lags.start() + (uniform(&mut seed) * span) as usize;
    let mut values = Array2::<f64>::zeros((700, 3));
    for t in 6..700 {
        let driven = [0.0, 1.2 * (values[[t - lag, 0]].abs() - 0.9), 0.0];
        for var in 0..3 {
            values[[t, var]] = 0.4 * values[[t - 1, var]] + driven[var] + normal(&mut seed);
        }
    }
    (DataFrame::new(vec![values], ["x", "y", "z"].map(str::to_owned).to_vec()).unwrap(), lag)
}

#[test]
fn a_test_of_any_shape_is_shown_longer_lags_that_no_line_has() {
    let advised = |data: &DataFrame, test: &str| {
        let profile = DataProfile::of(data, 1).0.with_later(data, 1, Some(test), None);
        profile.later.first().map_or(1, |later| later.tau_max)
    };
    let (mut contained, mut by_a_line) = (0, 0);
    for seed in 0..100 {
        let (data, lag) = bent(seed, 2..=6);
        contained += usize::from((lag..=2 * lag).contains(&advised(&data, "gpdc")));
        by_a_line += usize::from(advised(&data, "parcorr") >= lag);
    }
    assert!(contained >= 90 && by_a_line <= 20, "{contained} {by_a_line}");
    for (links, what) in [(3, "lag 1"), (0, "no links")] {
        let quiet = |seed: &u64| advised(&system(900 + seed, links, 1..=1).0, "gpdc") == 1;
        let quiet = (0..100).filter(quiet).count();
        assert!(quiet >= 95, "{what}: {quiet}");
    }
    let quiet = (0..100).filter(|&seed| advised(&bent(seed, 1..=1).0, "gpdc") == 1).count();
    assert!(quiet >= 95, "bent at lag 1: {quiet}");
}

#[test]
fn a_test_of_any_shape_is_shown_lines_where_distances_leave_no_room() {
    // Too few rows for twice as many columns, and too many columns.
    for (rows, vars, tau_max, lag) in [(100, 5, 2, 4), (600, 30, 4, 7)] {
        let mut seed = 5;
        let mut values = Array2::<f64>::zeros((rows, vars));
        values.mapv_inplace(|_| normal(&mut seed));
        for t in lag..rows {
            values[[t, 1]] += 0.8 * values[[t - lag, 0]];
        }
        let names = (0..vars).map(|var| format!("v{var}")).collect();
        let data = DataFrame::new(vec![values], names).unwrap();
        let found = Later::of(&data, tau_max, 1.0, true);
        assert!(found.iter().any(|later| (later.effect.as_str(), later.lag) == ("v1", lag)), "{found:?}");
        assert_eq!(found, Later::of(&data, tau_max, 1.0, false));
    }
}

#[test]
fn recordings_and_missing_values_are_kept_apart_and_the_sentence_says_when() {
    let mut parts: Vec<Array2<f64>> =
        (0..3).map(|k| system(40 + k, 0, 1..=1).0.recordings()[0].clone()).collect();
    for part in &mut parts {
        *part = part.slice(ndarray::s![.., ..3]).to_owned();
        for t in 4..part.nrows() {
            part[[t, 2]] += 0.8 * part[[t - 4, 0]];
        }
        part[[100, 1]] = f64::NAN;
    }
    let data = DataFrame::new(parts, ["near", "b", "speed"].map(str::to_owned).to_vec()).unwrap();
    let found = Later::of(&data, 1, 2.0, false);
    assert!(
        found
            .iter()
            .any(|later| (later.cause.as_str(), later.effect.as_str(), later.lag) == ("near", "speed", 4))
    );
    let reported = Later::reported(&found, Some(0.1)).unwrap();
    assert!(
        reported
            .starts_with("dependence of speed on near at lag 4 (0.4 s), beyond the lags that were tested; "),
        "{reported}"
    );
    assert_eq!(Later::of(&data, 400, 2.0, false), []);
}

#[test]
fn of_more_rows_than_are_looked_at_each_recording_has_its_share_in_any_order() {
    // Only the second recording has the effect, behind as many rows as are looked at.
    let mut parts: Vec<Array2<f64>> = (0..2).map(|_| Array2::zeros((4000, 2))).collect();
    let mut seed = 3;
    parts.iter_mut().for_each(|part| part.mapv_inplace(|_| normal(&mut seed)));
    for t in 4..4000 {
        parts[1][[t, 1]] += 0.8 * parts[1][[t - 4, 0]];
    }
    let of = |parts: Vec<Array2<f64>>| {
        let data = DataFrame::new(parts, vec!["a".into(), "b".into()]).unwrap();
        Later::of(&data, 1, 2.0, false)
            .iter()
            .map(|later| (later.cause.clone(), later.lag))
            .collect::<Vec<_>>()
    };
    assert_eq!(of(parts.clone()), [("a".to_owned(), 4)]);
    parts.reverse();
    assert_eq!(of(parts), [("a".to_owned(), 4)]);
}

/// The ends of a recording give cause and effect different means: what that leaves of an exact effect is no dependence.
#[test]
fn an_exact_effect_leaves_nothing_to_look_for() {
    let noise = system(7, 0, 1..=1).0.recordings()[0].column(0).to_vec();
    let mut rows = Array2::zeros((noise.len(), 2));
    for t in 1..noise.len() {
        rows[[t, 1]] = noise[t];
        rows[[t, 0]] = rows[[t - 1, 1]];
    }
    let data = DataFrame::new(vec![rows], vec!["x1".into(), "x2".into()]).unwrap();
    assert_eq!(Later::of(&data, 1, 2.0, false), []);
}

/// Three series with a trend each: b follows a after three rows if `follows`, c neither.
fn with_trends(follows: bool) -> DataFrame {
    let mut seed = 5;
    let mut values = Array2::from_shape_fn((600, 3), |_| normal(&mut seed));
    for t in (3..600).rev().filter(|_| follows) {
        values[[t, 1]] += 0.7 * values[[t - 3, 0]];
    }
    for ((t, var), value) in values.indexed_iter_mut() {
        *value += (0.01 + 0.002 * var as f64) * t as f64;
    }
    DataFrame::new(vec![values], ["a", "b", "c"].map(str::to_owned).to_vec()).unwrap()
}

#[test]
fn trends_alone_are_no_longer_lag_and_hide_none() {
    assert_eq!(advised(&with_trends(false)), 1);
    let (profile, _) = DataProfile::of(&with_trends(true), 1);
    let later = profile.with_later(&with_trends(true), 1, Some("parcorr"), None).later;
    assert_eq!(later.len(), 1, "{later:?}");
    assert_eq!((later[0].cause.as_str(), later[0].effect.as_str(), later[0].lag), ("a", "b", 3));
}

#[test]
fn dependence_within_a_row_is_said_where_lag_0_is_not_tested_and_no_link_stands_for_it() {
    let data = |memory: f64| {
        let mut seed = 77;
        let mut values = Array2::<f64>::zeros((400, 3));
        for t in 1..400 {
            values[[t, 0]] = memory * values[[t - 1, 0]] + normal(&mut seed);
            values[[t, 1]] = 0.7 * values[[t, 0]] + normal(&mut seed);
            values[[t, 2]] = normal(&mut seed);
        }
        DataFrame::new(vec![values], ["a", "b", "c"].map(str::to_owned).to_vec()).unwrap()
    };
    let within = |data: &DataFrame, settings: &Settings| {
        settings.look_later(DataProfile::of(data, settings.tau_max).0, data, Some(1.0))
    };
    let settings = Settings { method: Method::Pcmci, cond_ind_test: "parcorr".into(), ..Settings::default() };
    let found = within(&data(0.0), &settings).within;
    assert_eq!(found.len(), 1, "{found:?}");
    assert_eq!(found[0].variables, ["a", "b"]);
    assert!((found[0].strength - 0.57).abs() < 0.1, "{found:?}");
    let at_lag_0 = Settings { tau_min: 0, method: Method::Pcmciplus, ..settings.clone() };
    assert_eq!(within(&data(0.0), &at_lag_0).within, []);

    let advised = |settings: &Settings| {
        let rows = data(0.0);
        let mut model = analyse(&rows, settings, &Control::default()).unwrap();
        model.about_data = Some(within(&rows, settings));
        let advice = model.summary().advice;
        advice.iter().find(|one| one.text.starts_with("Test links within a row")).map(|one| one.about)
    };
    assert_eq!(advised(&settings), Some("method"));
    // A method that tests lag 0 unless it is told not to is told to.
    assert_eq!(advised(&Settings { method: Method::Pcmciplus, ..settings.clone() }), Some("tau_min"));

    let conclusion = |data: &DataFrame| {
        let mut model = analyse(data, &settings, &Control::default()).unwrap();
        model.about_data = Some(within(data, &settings));
        model.summary().conclusion.join(" ")
    };
    let words = "Seen, but not tested: dependence within one row of a and b (0.";
    assert!(conclusion(&data(0.0)).contains(words), "{}", conclusion(&data(0.0)));
    // Where a remembers, it tells b one row later, too: that link stands for the two.
    let linked = conclusion(&data(0.7));
    assert!(linked.contains("a drives b") && !linked.contains(words), "{linked}");
}
