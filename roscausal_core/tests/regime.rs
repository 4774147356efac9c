//! The discovery node that rolls on: models of the present regime, changes of mechanisms, and random `kill -9` meanwhile.
//!
//! `ROSCAUSAL_KILLS=50 cargo test -p roscausal_core --test regime -- --nocapture` takes some minutes.

#![cfg(unix)]
#![allow(clippy::expect_used, clippy::panic, reason = "a test may panic: that is how it fails")]

mod common;

use std::{
    collections::BTreeMap,
    fs,
    path::Path,
    process::{Child, Command, Stdio},
    sync::{Arc, Mutex},
    thread,
    time::{Duration, Instant},
};

use common::names;
use roscausal_core::{
    Time,
    loopback::Loopback,
    middleware::{Middleware, Qos},
    nodes::{self, CHANGES_TOPIC},
    params::Value,
};
use roscausal_discovery::Model;
use roscausal_fuzz::unit;
use roscausal_msgs::{ModelChange, ModelChanges, diagnostic_msgs::DiagnosticArray};

const FOLDER: &str = "ROSCAUSAL_REGIME_FOLDER";
const ROWS: usize = 300;

/// Batches of 30 s in which `a` drives `b` with the strength of each batch, and `b` drives `c`. `stop`: the batches in which an
/// intervention is announced.
fn pool(dir: &Path, batches: usize, strength: impl Fn(usize) -> f64, stop: impl Fn(usize) -> bool) {
    fs::create_dir_all(dir.join("pp")).expect("makes");
    let mut state = 17;
    let mut normal = || (0..12).map(|_| unit(&mut state)).sum::<f64>() - 6.0;
    let (mut a, mut b) = (0.0, 0.0);
    for batch in 0..batches {
        let mut csv = String::from(if stop(batch) { "time,a,b,c,do_stop\n" } else { "time,a,b,c\n" });
        for row in 0..ROWS {
            let c = 0.5 * b + normal();
            b = 0.4 * b + strength(batch) * a + normal();
            a = 0.5 * a + normal();
            let time = 1000.0 + 0.1 * (batch * ROWS + row) as f64;
            csv += &format!("{time:.1},{a},{b},{c}{}\n", if stop(batch) { ",1" } else { "" });
        }
        let facts = if stop(batch) { r#"{"context": ["do_stop"]}"# } else { r#"{"context": []}"# };
        fs::write(dir.join(format!("pp/data_{batch:03}.json")), facts).expect("writes");
        fs::write(dir.join(format!("pp/data_{batch:03}.csv")), csv).expect("writes");
    }
}

/// A bus whose discovery node works on a folder.
fn bus(dir: &Path, settings: &[(&str, Value)]) -> Loopback {
    let bus = Loopback::live(|| Time::from_secs_f64(5000.0));
    let path = |name: &str| Value::Str(dir.join(name).display().to_string());
    let common = [
        ("data_dir", path("pp")),
        ("res_dir", path("models")),
        ("cd_method", Value::Str("pcmci".into())),
        ("cond_ind_test", Value::Str("parcorr".into())),
        ("threads", Value::Int(1)),
        ("max_attempts", Value::Int(1000)),
        ("window_batches", Value::Int(4)),
    ];
    for (name, value) in common.iter().chain(settings) {
        bus.set_node_param("discovery", name, value.clone());
    }
    bus
}

fn waits(dir: &Path) -> usize {
    names(&dir.join("pp"), ".csv").len()
}

/// Runs the node until no batch is left, or for good.
fn run(bus: &Loopback, dir: &Path) {
    let node = bus.node("discovery");
    let its_own = node.clone();
    let thread = thread::spawn(move || nodes::run("discovery", &its_own));
    let end = Instant::now() + Duration::from_secs(120);
    while waits(dir) > 0 {
        assert!(Instant::now() < end && !thread.is_finished(), "it does not come to an end");
        thread::sleep(Duration::from_millis(5));
    }
    node.shutdown();
    thread.join().expect("no panic").expect("ends well");
}

/// Every file that a run leaves: models, events, and the regime with its batches.
fn left(dir: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut files = BTreeMap::new();
    for folder in ["models", "models/changes", "pp/regime"] {
        for name in names(&dir.join(folder), "").into_iter().filter(|name| name.contains('.')) {
            let bytes = fs::read(dir.join(folder).join(&name)).expect("reads");
            files.insert(format!("{folder}/{name}"), bytes);
        }
    }
    files
}

fn model(dir: &Path, batch: usize) -> Model {
    let text = fs::read(dir.join(format!("models/data_{batch:03}.json"))).expect("a model");
    serde_json::from_slice(&text).expect("is one")
}

/// The strengths of a run with two changes: at batch 8, and back at batch 16.
fn twice(batch: usize) -> f64 {
    if (8..16).contains(&batch) { -0.5 } else { 0.8 }
}

#[test]
fn a_change_is_told_with_its_times_the_models_forget_what_was_before_and_a_late_listener_knows_all() {
    let dir = tempfile::tempdir().expect("a folder");
    let dir = dir.path();
    pool(dir, 24, twice, |_| false);
    let bus = bus(dir, &[]);
    let reported: Arc<Mutex<Vec<ModelChanges>>> = Arc::default();
    let takes = reported.clone();
    let take = move |message: ModelChanges| takes.lock().expect("no panic").push(message);
    let _listens = bus.node("probe").subscribe(CHANGES_TOPIC, Qos::Latched, take).expect("subscribes");
    let health: Arc<Mutex<DiagnosticArray>> = Arc::default();
    let reports = health.clone();
    let report = move |message: DiagnosticArray| *reports.lock().expect("no panic") = message;
    let _health = bus.node("nurse").subscribe("/diagnostics", Qos::Volatile(10), report).expect("subscribes");
    run(&bus, dir);

    let all = reported.lock().expect("no panic").clone();
    assert_eq!(all.len(), 24, "once per batch");
    let last = all.last().expect("messages");
    let confirmed: Vec<&ModelChange> =
        last.changes.iter().filter(|change| change.status == ModelChange::CONFIRMED).collect();
    assert_eq!(confirmed.len(), 2, "{last:?}");
    for (change, batch, kind) in [(confirmed[0], 8, "reversed"), (confirmed[1], 16, "reversed")] {
        assert_eq!((change.cause.as_str(), change.effect.as_str(), change.kind.as_str()), ("a", "b", kind));
        let at = 1000.0 + 30.0 * f64::from(batch);
        let (from, to) = (change.changed_from.as_secs_f64(), change.changed_to.as_secs_f64());
        assert!(from - 4.0 < at && at < to + 4.0 && to - from < 20.0, "{change:?}");
        let reported = change.told.as_secs_f64();
        assert!(
            reported > at && reported < at + 65.0 && change.batch_id >= format!("data_{batch:03}"),
            "{change:?}"
        );
        // A suspicion of the same id came before.
        let first = last.changes.iter().find(|other| other.id == change.id).expect("is there");
        assert!(first.status == ModelChange::SUSPECTED && first.told < change.told, "{first:?}");
    }
    assert!(confirmed[1].description.contains("as in regime 1 again"), "{:?}", confirmed[1]);
    let since = last.regime_since.as_secs_f64();
    assert!((1470.0..1500.0).contains(&since) && (7..=8).contains(&last.batches), "{last:?}");

    // Four batches make a model; after the change only those of the new regime do.
    let n = |batch| model(dir, batch).n_samples;
    assert!(n(0) < n(1) && n(1) < n(3) && n(3) == n(7) && n(7) > 4 * ROWS - 20, "{} {} {}", n(0), n(3), n(7));
    assert!(n(9) <= 2 * ROWS && n(13) == n(7), "{} {}", n(9), n(13));
    let slope = |batch: usize| {
        let model = model(dir, batch);
        let link = model.links.iter().find(|link| link.cause == "a" && link.effect == "b").expect("a -> b");
        (link.value.expect("tested"), link.since, link.seen)
    };
    let ((before, since, seen), (after, ..)) = (slope(7), slope(10));
    assert!(before > 0.4 && after < -0.3, "{before} {after}");
    assert_eq!((since, seen), (Some(1000.0), Some(8)));
    assert_eq!(names(&dir.join("models/changes"), ".json").len(), last.changes.len());
    assert_eq!(names(&dir.join("pp/regime"), ".csv").len(), 4);
    let diagnostics = health.lock().expect("no panic").clone();
    let value = |key: &str| {
        let values = &diagnostics.status[0].values;
        values.iter().find(|value| value.key == key).map(|value| value.value.clone())
    };
    assert!(value("regime").is_some() && value("changes confirmed").is_some(), "{diagnostics:?}");

    // Another process: who comes late, and even after a restart, hears of all.
    let bus = self::bus(dir, &[]);
    let node = bus.node("discovery");
    let its_own = node.clone();
    let thread = thread::spawn(move || nodes::run("discovery", &its_own));
    let late: Arc<Mutex<Option<ModelChanges>>> = Arc::default();
    let takes = late.clone();
    let take = move |message: ModelChanges| *takes.lock().expect("no panic") = Some(message);
    let _late = bus.node("late").subscribe(CHANGES_TOPIC, Qos::Latched, take).expect("subscribes");
    let end = Instant::now() + Duration::from_secs(60);
    while late.lock().expect("no panic").is_none() {
        assert!(Instant::now() < end && !thread.is_finished(), "nothing is latched");
        thread::sleep(Duration::from_millis(5));
    }
    assert_eq!(
        late.lock().expect("no panic").as_ref().map(|m| m.changes.clone()),
        Some(last.changes.clone())
    );
    node.shutdown();
    thread.join().expect("no panic").expect("ends well");
}

#[test]
fn an_announced_intervention_is_no_change_and_an_unannounced_one_is() {
    for announced in [false, true] {
        let dir = tempfile::tempdir().expect("a folder");
        let stopped = |batch: usize| (8..12).contains(&batch);
        pool(dir.path(), 14, |b| if stopped(b) { 0.0 } else { 0.8 }, |b| announced && stopped(b));
        let bus = bus(dir.path(), &[("detect_changes", Value::Str("always".into()))]);
        run(&bus, dir.path());
        let events = names(&dir.path().join("models/changes"), ".json");
        let text =
            |name: &String| fs::read_to_string(dir.path().join("models/changes").join(name)).expect("reads");
        let confirmed = events.iter().filter(|name| text(name).contains("\"confirmed\"")).count();
        assert_eq!(confirmed > 0, !announced, "announced: {announced}, {confirmed} confirmed");
    }
}

#[test]
fn a_variable_that_the_user_calls_exogenous_has_no_causes_and_no_changes() {
    let dir = tempfile::tempdir().expect("a folder");
    let dir = dir.path();
    pool(dir, 12, twice, |_| false);
    let exogenous = Value::List(vec![Value::Str("b".into())]);
    run(&bus(dir, &[("exogenous", exogenous)]), dir);
    let reported = nodes::recorded_changes(&dir.join("models")).expect("reads");
    assert!(reported.iter().all(|change| change.event.effect != "b"), "{reported:?}");
    let links = model(dir, 11).links;
    assert!(links.iter().any(|link| link.effect == "c") && links.iter().all(|link| link.effect != "b"));
}

#[test]
fn dependence_at_a_lag_that_was_not_tested_is_told_by_the_node_too() {
    let dir = tempfile::tempdir().expect("a folder");
    fs::create_dir_all(dir.path().join("pp")).expect("makes");
    let mut state = 17;
    let a: Vec<f64> = (0..600).map(|_| unit(&mut state) - 0.5).collect();
    let row = |t: usize| {
        let b = if t < 3 { 0.0 } else { a[t - 3] } + 0.3 * (unit(&mut state) - 0.5);
        format!("{:.1},{},{b}\n", 1000.0 + 0.1 * t as f64, a[t])
    };
    let csv = format!("time,a,b\n{}", (0..600).map(row).collect::<String>());
    fs::write(dir.path().join("pp/data_000.json"), "{}").expect("writes");
    fs::write(dir.path().join("pp/data_000.csv"), csv).expect("writes");
    run(&bus(dir.path(), &[]), dir.path());
    let summary = model(dir.path(), 0).summary();
    let stated = summary.conclusion.join(" ");
    assert!(stated.contains("dependence of b on a at lag 3 (0.3 s)"), "{stated}");
    assert!(summary.advice.iter().any(|advice| advice.text.contains("Test longer lags")), "{stated}");
}

#[test]
fn batches_that_do_not_fit_begin_a_new_regime_and_none_is_rejected() {
    let dir = tempfile::tempdir().expect("a folder");
    let dir = dir.path();
    pool(dir, 4, |_| 0.8, |_| false);
    for batch in 2..4 {
        let path = dir.join(format!("pp/data_{batch:03}.csv"));
        let text = fs::read_to_string(&path).expect("reads").replace("time,a,b,c", "time,a,b,other");
        fs::write(&path, text).expect("writes");
    }
    run(&bus(dir, &[("keep_batches", Value::Bool(true))]), dir);
    assert!(!dir.join("pp/rejected").exists());
    let (before, first, second) = (model(dir, 1), model(dir, 2), model(dir, 3));
    assert!(before.n_samples > first.n_samples && second.n_samples == before.n_samples);
    assert!(second.features.contains(&"other".to_owned()));
    // Kept batches stay where users look for them.
    assert_eq!(names(&dir.join("pp/analysed"), ".csv").len(), 4);
}

#[test]
fn what_cannot_go_together_is_refused() {
    let dir = tempfile::tempdir().expect("a folder");
    fs::create_dir_all(dir.path().join("pp")).expect("makes");
    let refused = |settings: &[(&str, Value)]| {
        nodes::run("discovery", &bus(dir.path(), settings).node("discovery"))
            .expect_err("refuses")
            .to_string()
    };
    let error = refused(&[("batches_per_model", Value::Int(2))]);
    assert!(error.contains("'batches_per_model'") && error.contains("set it to 1"), "{error}");
    let error = refused(&[("detect_changes", Value::Str("perhaps".into()))]);
    assert!(error.contains("auto, always, never"), "{error}");
    let lock = fs::create_dir_all(dir.path().join("pp/regime"))
        .and_then(|()| fs::File::open(dir.path().join("pp/regime")));
    let lock = lock.expect("opens");
    lock.try_lock().expect("locks");
    let error = refused(&[]);
    assert!(error.contains("another node keeps its regime"), "{error}");
}

/// Not a test: the process that is killed.
#[test]
#[ignore = "started by the other test"]
fn the_victim() {
    let dir = std::env::var(FOLDER).expect("a folder");
    run(&bus(Path::new(&dir), &[]), Path::new(&dir));
}

fn victim(dir: &Path) -> Child {
    let mut command = Command::new(std::env::current_exe().expect("this program"));
    command.args(["--exact", "the_victim", "--ignored", "--nocapture"]).env(FOLDER, dir);
    command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("starts")
}

#[test]
fn after_random_kills_no_event_is_lost_and_none_is_told_twice() {
    let kills: u32 = std::env::var("ROSCAUSAL_KILLS").ok().and_then(|n| n.parse().ok()).unwrap_or(6);
    let whole = tempfile::tempdir().expect("a folder");
    pool(whole.path(), 20, twice, |_| false);
    run(&bus(whole.path(), &[]), whole.path());
    let wanted = left(whole.path());
    let events = wanted.keys().filter(|name| name.contains("/changes/")).count();
    assert!(events >= 4, "{events} events");

    let (mut random, mut killed) = (1, 0);
    while killed < kills {
        let dir = tempfile::tempdir().expect("a folder");
        let dir = dir.path();
        pool(dir, 20, twice, |_| false);
        while waits(dir) > 0 {
            let mut child = victim(dir);
            if killed < kills {
                // Within the work on the next batch or the one after it, whatever the machine is at.
                let before = waits(dir);
                while waits(dir) >= before && waits(dir) > 0 {
                    thread::sleep(Duration::from_millis(1));
                }
                thread::sleep(Duration::from_secs_f64(0.06 * unit(&mut random)));
                killed += u32::from(child.try_wait().expect("asks").is_none());
                child.kill().expect("kills");
            }
            child.wait().expect("ends");
        }
        // A last life completes what is left.
        assert!(victim(dir).wait().expect("ends").success());
        let found = left(dir);
        for (name, bytes) in &wanted {
            assert!(found.get(name) == Some(bytes), "after {killed} kills {name} differs");
        }
        assert_eq!(found.len(), wanted.len(), "after {killed} kills there are other files");
    }
    println!("{killed} kills: {events} events in each life's end, none lost, none twice");
}
