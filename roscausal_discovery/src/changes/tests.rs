//! Laws of the detector.

use ndarray::Array2;

use super::*;
use crate::{numeric::random::Rng, types::Control};

/// `a` drives `b` with the strength of each row, `c` is driven by `b`; `noise` scales the noise of `b`, `mean` moves it.
fn series(n: usize, seed: u64, strength: impl Fn(usize) -> f64, noise: impl Fn(usize) -> f64) -> Array2<f64> {
    let mut rng = Rng::new(seed);
    let mut normal = || (0..12).map(|_| rng.unit()).sum::<f64>() - 6.0;
    let mut x = Array2::zeros((n, 3));
    for t in 1..n {
        x[[t, 0]] = 0.5 * x[[t - 1, 0]] + normal();
        x[[t, 1]] = 0.4 * x[[t - 1, 1]] + strength(t) * x[[t - 1, 0]] + noise(t) * normal();
        x[[t, 2]] = 0.5 * x[[t - 1, 1]] + normal();
    }
    x
}

fn names() -> Vec<String> {
    ["a", "b", "c"].map(str::to_owned).to_vec()
}

fn reported(values: &Array2<f64>) -> Vec<ChangeEvent> {
    let mut detector = Detector::new(names(), 1, &[], Levels::default()).unwrap();
    detector.read_in_parts(values.view(), &[], 200, &Control::default()).unwrap()
}

fn confirmed(values: &Array2<f64>) -> Vec<ChangeEvent> {
    reported(values).into_iter().filter(|event| event.status == Status::Confirmed).collect()
}

/// Whether the one event of a change at row 1000, where a part begins, says all of it: link, kind, slopes, and when.
fn is_told(events: &[ChangeEvent], (before, after, kind): (f64, f64, Kind)) -> bool {
    let [event] = events else { return false };
    let of_link = (event.cause.as_str(), event.effect.as_str(), event.lag, event.kind) == ("a", "b", 1, kind);
    let slopes = (event.before - before).abs() < 0.2 && (event.after - after).abs() < 0.2;
    let in_time = event.time <= 1000 + 400;
    let within = event
        .changed_between
        .is_some_and(|[from, to]| from <= 1000 + 40 && to + 40 >= 1000 && to - from < 300);
    of_link && slopes && in_time && within && event.sentence().contains("changed between rows")
}

/// Each decision is a test at some level (a link that is gone still has p < 0.05 in one of twenty), so this is a law of many runs.
#[test]
fn a_link_that_changes_is_confirmed_with_its_kind_and_its_time() {
    let cases: [(f64, f64, Kind); 5] = [
        (0.7, 0.0, Kind::Vanished),
        (0.0, 0.7, Kind::Appeared),
        (0.7, -0.7, Kind::Reversed),
        (0.3, 1.0, Kind::Stronger),
        (1.0, 0.3, Kind::Weaker),
    ];
    let right = cases.map(|case| {
        let (before, after, kind) = case;
        let events =
            |seed| confirmed(&series(2000, seed, |t| if t < 1000 { before } else { after }, |_| 1.0));
        (kind, (1..=40).filter(|&seed| is_told(&events(seed), case)).count())
    });
    // Where nine of ten are right, fewer than 30 of 40 are once in five hundred times.
    assert!(right.iter().all(|(_, count)| *count >= 30), "of 40 each: {right:?}");
}

#[test]
fn of_two_links_to_one_effect_that_change_together_both_are_told() {
    let both_told = |seed: u64| {
        let mut values = series(3000, seed, |_| 0.0, |_| 1.0);
        let mut rng = Rng::new(1000 + seed);
        let mut normal = || (0..12).map(|_| rng.unit()).sum::<f64>() - 6.0;
        for t in 1..3000 {
            // a drives c until row 1500, then b does.
            let cause = usize::from(t >= 1500);
            values[[t, 2]] = 0.3 * values[[t - 1, 2]] + 0.5 * values[[t - 1, cause]] + normal();
        }
        let events = confirmed(&values);
        let is_told = |cause: &str, kind: Kind| {
            events
                .iter()
                .any(|event| (event.cause.as_str(), event.effect.as_str(), event.kind) == (cause, "c", kind))
        };
        let ids: std::collections::BTreeSet<&str> = events.iter().map(|event| event.id.as_str()).collect();
        assert_eq!(ids.len(), events.len(), "each event has its own id: {events:?}");
        is_told("a", Kind::Vanished) && is_told("b", Kind::Appeared)
    };
    let told = (1..=20).filter(|&seed| both_told(seed)).count();
    assert!(told >= 15, "of 20: {told}");
}

#[test]
fn a_link_that_comes_to_another_lag_is_told_as_such() {
    let is_told = |seed: u64| {
        let mut values = series(3000, seed, |_| 0.0, |_| 1.0);
        let mut rng = Rng::new(2000 + seed);
        let mut normal = || (0..12).map(|_| rng.unit()).sum::<f64>() - 6.0;
        for t in 2..3000 {
            let lag = 1 + usize::from(t >= 1500);
            values[[t, 2]] = 0.3 * values[[t - 1, 2]] + 0.5 * values[[t - lag, 0]] + normal();
        }
        let mut detector = Detector::new(names(), 2, &[], Levels::default()).unwrap();
        let events = detector.read_in_parts(values.view(), &[], 200, &Control::default()).unwrap();
        let came = events.iter().find(|event| event.moved_from.is_some());
        came.is_some_and(|event| {
            assert!(event.sentence().contains("a drives c (lag 2), where it was lag 1 before"), "{event:?}");
            event.status == Status::Confirmed
        })
    };
    let told = (1..=20).filter(|&seed| is_told(seed)).count();
    assert!(told >= 15, "of 20: {told}");
}

#[test]
fn a_mean_or_a_noise_that_changes_is_no_event() {
    for seed in 1..6 {
        let louder = series(2000, seed, |_| 0.6, |t| if t < 900 { 1.0 } else { 2.5 });
        assert_eq!(confirmed(&louder), [], "seed {seed}");
        let mut moved = series(2000, seed, |_| 0.6, |_| 1.0);
        moved.column_mut(1).iter_mut().skip(1000).for_each(|v| *v += 3.0);
        assert_eq!(confirmed(&moved), [], "seed {seed}");
    }
}

#[test]
fn a_suspicion_keeps_its_id_and_a_regime_that_returns_is_named() {
    let strength = |t: usize| if (1200..2600).contains(&t) { -0.6 } else { 0.6 };
    let all = reported(&series(4000, 11, strength, |_| 1.0));
    let confirmed: Vec<&ChangeEvent> = all.iter().filter(|event| event.status == Status::Confirmed).collect();
    assert_eq!(confirmed.len(), 2, "{all:?}");
    assert_eq!(confirmed[1].same_as, Some(1), "{all:?}");
    assert_eq!((confirmed[0].regime, confirmed[1].regime), (Some(2), Some(3)));
    for event in &all {
        let first = all.iter().find(|other| other.id == event.id).unwrap();
        assert_eq!(first.status, Status::Suspected, "{event:?}");
    }
    // Each suspicion comes to its end, but for one in the last batch.
    let ended = |id: &str| all.iter().any(|event| event.id == id && event.status != Status::Suspected);
    assert!(all.iter().all(|event| ended(&event.id) || event.time == 4000), "{all:?}");
}

#[test]
fn a_change_by_an_announced_intervention_is_no_event() {
    let mut values = series(2000, 5, |_| 0.0, |_| 1.0);
    // An intervention of the second half drives b.
    for t in 1000..2000 {
        values[[t, 0]] = f64::from(u8::from(t % 7 < 3));
    }
    values.column_mut(0).iter_mut().take(1000).for_each(|v| *v = 0.0);
    // Its effect goes on through b's own past, and to c.
    let mut added = 0.0;
    for t in 1001..2000 {
        values[[t, 2]] += 0.5 * added;
        added = 3.0 * values[[t - 1, 0]] + 0.4 * added;
        values[[t, 1]] += added;
    }
    let mut detector = Detector::new(names(), 1, &["a".into()], Levels::default()).unwrap();
    let reported = detector.read_in_parts(values.view(), &[], 200, &Control::default()).unwrap();
    assert!(reported.iter().all(|event| event.status != Status::Confirmed), "{reported:?}");
}

/// An intervention that begins with a part and lasts says nothing of what it touches, so nothing is compared with it.
#[test]
fn an_announced_intervention_that_is_constant_within_each_part_is_no_event() {
    let values = series(2400, 5, |t| if (1000..1600).contains(&t) { 0.0 } else { 0.8 }, |_| 1.0);
    let mut wider = Array2::zeros((2400, 4));
    wider.slice_mut(ndarray::s![.., ..3]).assign(&values);
    let mut named = names();
    named.push("do_stop".into());
    let reported = |wider: &Array2<f64>| {
        let mut detector = Detector::new(named.clone(), 1, &["do_stop".into()], Levels::default()).unwrap();
        detector.read_in_parts(wider.view(), &[], 200, &Control::default()).unwrap()
    };
    let confirmed = |events: &[ChangeEvent]| events.iter().any(|event| event.status == Status::Confirmed);
    assert!(confirmed(&reported(&wider)), "it is a change if nobody announces it");
    wider.column_mut(3).iter_mut().skip(1000).take(600).for_each(|v| *v = 1.0);
    assert!(!confirmed(&reported(&wider)));
    // A detector that first hears of it with the part in which it begins tells the same.
    let mut late = Detector::new(names(), 1, &[], Levels::default()).unwrap();
    let mut events = Vec::new();
    for part in 0..12 {
        let rows = ndarray::s![part * 200..(part + 1) * 200, ..];
        if part == 5 {
            late.add_exogenous("do_stop");
        }
        let part_of = |all: &Array2<f64>| all.slice(rows).to_owned();
        let part = if part < 5 { part_of(&values) } else { part_of(&wider) };
        events.extend(late.read(&part, &Control::default()).unwrap());
    }
    assert!(!confirmed(&events), "{events:?}");
}

#[test]
fn a_detector_that_was_written_and_read_back_between_any_two_parts_tells_the_same() {
    let values = series(3000, 4, |t| if t < 1500 { 0.7 } else { -0.3 }, |_| 1.0);
    let whole = reported(&values);
    assert!(whole.iter().any(|event| event.status == Status::Confirmed), "{whole:?}");
    let mut detector = Detector::new(names(), 1, &[], Levels::default()).unwrap();
    let mut restored = detector.clone();
    let (mut events, mut after_each) = (Vec::new(), Vec::new());
    for part in 0..15 {
        let rows = values.slice(ndarray::s![part * 200..(part + 1) * 200, ..]).to_owned();
        events.extend(detector.read(&rows, &Control::default()).unwrap());
        after_each.extend(restored.read(&rows, &Control::default()).unwrap());
        restored = serde_json::from_str(&serde_json::to_string(&restored).unwrap()).unwrap();
        assert_eq!(restored, detector, "part {part}");
    }
    assert_eq!(events, after_each);
}

/// A fifth of the rows lack a value, here and there, as where messages are lost: no batch has a long complete stretch.
#[test]
fn a_change_is_seen_although_values_are_missing_everywhere_and_a_detector_written_meanwhile_goes_on() {
    let mut values = series(4000, 3, |t| if t < 2000 { 0.8 } else { -0.4 }, |_| 1.0);
    let mut rng = Rng::new(9);
    for t in 0..4000 {
        if rng.unit() < 0.2 {
            values[[t, (3.0 * rng.unit()) as usize]] = f64::NAN;
        }
    }
    let mut detector = Detector::new(names(), 1, &[], Levels::default()).unwrap();
    let mut events = Vec::new();
    for part in 0..10 {
        let rows = values.slice(ndarray::s![part * 400..(part + 1) * 400, ..]).to_owned();
        events.extend(detector.read(&rows, &Control::default()).unwrap());
        let restored: Detector = serde_json::from_str(&serde_json::to_string(&detector).unwrap()).unwrap();
        assert_eq!(restored, detector, "part {part}");
        detector = restored;
    }
    let confirmed: Vec<&ChangeEvent> =
        events.iter().filter(|event| event.status == Status::Confirmed).collect();
    let [event] = confirmed.as_slice() else { panic!("{events:?}") };
    assert_eq!((event.cause.as_str(), event.effect.as_str(), event.kind), ("a", "b", Kind::Reversed));
    let [from, to] = event.changed_between.unwrap();
    assert!(from <= 2040 && to >= 1980 && to - from < 200, "{event:?}");
}

#[test]
fn a_change_is_seen_although_each_batch_lacks_its_first_value_and_some_rows() {
    let values = series(2000, 3, |t| if t < 1000 { 0.8 } else { -0.4 }, |_| 1.0);
    let mut detector = Detector::new(names(), 1, &[], Levels::default()).unwrap();
    let mut events = Vec::new();
    for batch in 0..10 {
        let mut rows = values.slice(ndarray::s![batch * 200..(batch + 1) * 200, ..]).to_owned();
        rows[[0, 2]] = f64::NAN;
        rows[[180, 0]] = f64::NAN;
        events.extend(detector.read(&rows, &Control::default()).unwrap());
    }
    let confirmed: Vec<&ChangeEvent> =
        events.iter().filter(|event| event.status == Status::Confirmed).collect();
    let [event] = confirmed.as_slice() else { panic!("{events:?}") };
    assert_eq!((event.cause.as_str(), event.effect.as_str(), event.kind), ("a", "b", Kind::Reversed));
    let [from, to] = event.changed_between.unwrap();
    assert!(from <= 1040 && to >= 980 && to - from < 200, "{event:?}");
    assert_eq!(detector.rows(), 2000);
}

/// `a` drives `b` by its size, whatever its sign: no slope shows it.
fn bent(n: usize, seed: u64, strength: impl Fn(usize) -> f64, noise: impl Fn(usize) -> f64) -> Array2<f64> {
    let mut rng = Rng::new(seed);
    let mut normal = || (0..12).map(|_| rng.unit()).sum::<f64>() - 6.0;
    let mut x = Array2::zeros((n, 3));
    for t in 1..n {
        let size: f64 = x[[t - 1, 0]];
        x[[t, 0]] = 0.3 * size + noise(t) * normal();
        x[[t, 1]] = 0.3 * x[[t - 1, 1]] + strength(t) * size.abs() + 0.5 * normal();
        x[[t, 2]] = 0.5 * x[[t - 1, 1]] + normal();
    }
    x
}

#[test]
fn slopes_say_where_a_dependence_is_a_curve_and_tell_no_change_of_it() {
    let read = |values: &Array2<f64>| {
        let mut detector = Detector::new(names(), 1, &[], Levels::default()).unwrap();
        let events = detector.read_in_parts(values.view(), &[], 200, &Control::default()).unwrap();
        (events.iter().filter(|event| event.status == Status::Confirmed).count(), detector.misfit())
    };
    let mut told = 0;
    for seed in 1..=10 {
        let (confirmed, misfit) = read(&bent(3000, seed, |_| 0.8, |_| 1.0));
        told += confirmed;
        assert!(misfit.as_ref().is_some_and(|misfit| misfit.contains("(b on a)")), "seed {seed}: {misfit:?}");
        assert_eq!(read(&series(3000, seed, |_| 0.6, |_| 1.0)).1, None, "seed {seed}: lines");
    }
    assert!(told <= 1, "{told} of 10 recordings in which nothing changes");
}

#[test]
fn a_mechanism_that_is_no_line_is_seen_by_curves_and_a_noise_that_changes_is_no_event() {
    let reported = |values: &Array2<f64>| {
        let detector = Detector::new(names(), 1, &[], Levels::default()).unwrap();
        let mut detector = detector.of_form(Form::of_test("gpdc"));
        let reported = detector.read_in_parts(values.view(), &[], 200, &Control::default()).unwrap();
        reported.into_iter().filter(|event| event.status == Status::Confirmed).collect::<Vec<_>>()
    };
    for (after, kind) in [(0.0, Kind::Vanished), (-0.8, Kind::Reversed)] {
        let events = reported(&bent(1200, 2, |t| if t < 600 { 0.8 } else { after }, |_| 1.0));
        let [event] = events.as_slice() else { panic!("{events:?}") };
        assert_eq!((event.cause.as_str(), event.effect.as_str(), event.kind), ("a", "b", kind), "{event:?}");
        let [from, to] = event.changed_between.unwrap();
        assert!(from <= 640 && to >= 560 && to - from < 300, "{event:?}");
    }
    assert_eq!(reported(&bent(1200, 3, |_| 0.8, |t| if t < 600 { 1.0 } else { 1.8 })), []);
}

#[test]
fn a_mechanism_that_changes_only_in_masked_rows_is_no_event() {
    let masked: Vec<bool> = (0..4000).map(|t| t % 4 != 0).collect();
    let values = series(4000, 6, |t| if t >= 2000 && masked[t] { -0.8 } else { 0.8 }, |_| 1.0);
    let reported = |masked: &[bool]| {
        let mut detector = Detector::new(names(), 1, &[], Levels::default()).unwrap();
        let reported = detector.read_in_parts(values.view(), masked, 400, &Control::default()).unwrap();
        let restored: Detector = serde_json::from_str(&serde_json::to_string(&detector).unwrap()).unwrap();
        assert_eq!(restored, detector);
        reported.into_iter().filter(|event| event.status == Status::Confirmed).collect::<Vec<_>>()
    };
    let without = reported(&[]);
    assert!(without.iter().any(|event| event.cause == "a" && event.effect == "b"), "{without:?}");
    assert_eq!(reported(&masked), []);
    let mut detector = Detector::new(names(), 1, &[], Levels::default()).unwrap();
    let short = detector.read_in_parts(values.view(), &masked[..3999], 400, &Control::default());
    assert!(short.unwrap_err().to_string().contains("3999 rows, and the recording has 4000"));
}

#[test]
fn what_makes_no_sense_is_refused_and_what_cannot_be_used_is_passed_over() {
    let refused = |names: Vec<String>, tau_max, levels, says: &str| {
        let error = Detector::new(names, tau_max, &[], levels).unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
    };
    refused(vec!["a".into()], 1, Levels::default(), "two variables");
    refused(names(), 0, Levels::default(), "lags from 1 on");
    refused(names(), usize::MAX, Levels::default(), "is above 100000");
    refused(names(), 1, Levels { suspect: 1.0, confirm: 0.1 }, "'suspect_level'");
    let mut detector = Detector::new(names(), 1, &[], Levels::default()).unwrap();
    let values = series(400, 1, |_| 0.6, |_| 1.0);
    let error = detector.read_in_parts(values.view(), &[], 79, &Control::default()).unwrap_err().to_string();
    assert!(error.contains("at least 80"), "{error}");
    let mut gaps = values.clone();
    (0..400).step_by(3).for_each(|t| gaps[[t, 1]] = f64::NAN);
    assert_eq!(detector.read(&gaps, &Control::default()).unwrap(), []);
    assert_eq!((detector.rows(), detector.regime()), (400, 1));
    assert!(detector.read(&Array2::zeros((400, 2)), &Control::default()).is_err());
    // Constant columns have no slope.
    assert_eq!(detector.read(&Array2::zeros((400, 3)), &Control::default()).unwrap(), []);
    assert_eq!(detector.read(&Array2::zeros((400, 3)), &Control::default()).unwrap(), []);
}
