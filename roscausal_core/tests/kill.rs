//! The whole chain under random `kill -9`, and what the folders hold afterwards.
//!
//! `ROSCAUSAL_KILLS=200 cargo test -p roscausal_core --test kill -- --nocapture` takes about eight minutes.

#![cfg(unix)]
#![allow(clippy::expect_used, clippy::panic, reason = "a test may panic: that is how it fails")]

#[allow(dead_code, reason = "the example uses the rest")]
#[path = "../examples/chain/chain.rs"]
mod chain;
mod common;

use std::{
    collections::BTreeMap,
    fs,
    path::Path,
    process::{Child, Command, Stdio},
    thread,
    time::Duration,
};

use chain::{Chain, person_x, robot_x, wall};
use common::names;
use roscausal_core::batch::Table;
use roscausal_fuzz::unit;

const FOLDER: &str = "ROSCAUSAL_KILL_FOLDER";
const DRAIN: &str = "ROSCAUSAL_KILL_DRAIN";
/// The most that a kill may cost in seconds: one, plus what a busy machine may need to sync a file.
const BOUND_S: f64 = 1.0 + 1.0;

/// Not a test: the process that is killed.
#[test]
#[ignore = "started by the other test"]
fn the_victim() {
    let dir = std::env::var(FOLDER).expect("a folder");
    let chain = Chain { drain: std::env::var_os(DRAIN).is_some(), ..Chain::new(Path::new(&dir)) };
    chain.run();
}

fn victim(dir: &Path, drain: bool) -> Child {
    let mut command = Command::new(std::env::current_exe().expect("this program"));
    command.args(["--exact", "the_victim", "--ignored", "--nocapture"]).env(FOLDER, dir);
    if drain {
        command.env(DRAIN, "1");
    }
    command.stdout(Stdio::null()).stderr(Stdio::inherit()).spawn().expect("starts")
}

/// Contents of all model files.
fn models(dir: &Path) -> BTreeMap<String, Vec<u8>> {
    let folder = dir.join("models");
    names(&folder, ".json")
        .into_iter()
        .map(|name| (name.clone(), fs::read(folder.join(name)).expect("reads")))
        .collect()
}

fn facts(path: &Path) -> serde_json::Value {
    serde_json::from_slice(&fs::read(path.with_extension("json")).expect("metadata")).expect("JSON")
}

#[test]
fn after_random_kills_every_batch_is_whole_and_every_model_comes_out_once() {
    let kills: u32 = std::env::var("ROSCAUSAL_KILLS").ok().and_then(|n| n.parse().ok()).unwrap_or(6);
    let dir = tempfile::tempdir().expect("a folder");
    let dir = dir.path();
    let mut random = 1;
    let mut seen = BTreeMap::<String, Vec<u8>>::new();
    let mut lives = Vec::new();
    for _ in 0..kills {
        let life = 0.2 + 2.8 * unit(&mut random);
        let mut child = victim(dir, false);
        let begin = wall();
        thread::sleep(Duration::from_secs_f64(life));
        assert!(child.try_wait().expect("asks").is_none(), "it died by itself");
        let end = wall();
        child.kill().expect("kills");
        child.wait().expect("ends");
        lives.push((begin, end));
        for (name, text) in models(dir) {
            let before = seen.entry(name.clone()).or_insert_with(|| text.clone());
            assert!(*before == text, "{name} changed");
        }
    }
    // A last run without sensors completes what is left.
    let mut last = victim(dir, true);
    let busy = || {
        !names(&dir.join("pp"), ".csv").is_empty()
            || fs::read_dir(dir.join("raw"))
                .expect("lists")
                .flatten()
                .any(|e| e.file_name().to_string_lossy().starts_with('.'))
    };
    thread::sleep(Duration::from_millis(500));
    (0..1200).take_while(|_| busy()).for_each(|_| thread::sleep(Duration::from_millis(50)));
    fs::write(dir.join("stop"), "").expect("writes");
    assert!(last.wait().expect("ends").success());
    for (name, text) in models(dir) {
        assert!(seen.entry(name.clone()).or_insert_with(|| text.clone()) == &text, "{name} changed");
    }
    account(dir, &lives);
}

/// Checks everything in the folders and prints the counts.
fn account(dir: &Path, lives: &[(f64, f64)]) {
    let raw = names(&dir.join("raw"), ".csv");
    let (mut rows, mut recovered, mut incomplete) = (0, 0, 0);
    let mut times = Vec::new();
    let mut last_end = 0.0;
    for name in &raw {
        let path = dir.join("raw").join(name);
        let (table, facts) = (Table::read(&path, None).expect("is whole"), facts(&path));
        let time = table.time.clone().expect("has times");
        assert_eq!(facts["n_rows"], time.len(), "{name}");
        assert!(time[0] > last_end, "{name} begins at {} but the one before ends at {last_end}", time[0]);
        last_end = time[time.len() - 1];
        check_values(name, &table, &time);
        rows += time.len();
        recovered += usize::from(facts["recovered"] == true);
        let complete = facts["complete"] == true;
        assert!(!complete || time.len() == 20, "{name}");
        incomplete += usize::from(!complete);
        let stem = name.trim_end_matches(".csv");
        let analysed = dir.join(format!("models/{stem}.json")).exists();
        let set_aside = dir.join("pp/incomplete").join(name).exists();
        assert!(
            analysed == complete && set_aside != complete,
            "{name}: complete {complete}, model {analysed}"
        );
        times.extend(time);
    }
    assert!(
        names(&dir.join("pp/rejected"), "").is_empty() && names(&dir.join("raw/rejected"), "").is_empty()
    );
    assert_eq!(names(&dir.join("models"), ".json").len(), raw.len() - incomplete);
    // What each run recorded and lost.
    let (mut recording, mut most) = (0, 0.0_f64);
    for (begin, end) in lives {
        let Some(last) = times.iter().copied().filter(|t| t >= begin && t <= end).reduce(f64::max) else {
            continue;
        };
        recording += 1;
        most = most.max(end - last);
    }
    println!(
        "{} kills: {recording} lives with rows, {} batches ({rows} rows, {recovered} recovered, {incomplete} cut short), \
         {} models, none changed; the most lost before a kill: {most:.2} s",
        lives.len(),
        raw.len(),
        raw.len() - incomplete
    );
    assert!(raw.len() >= lives.len() / 2 && most <= BOUND_S, "{most} s lost");
}

fn check_values(name: &str, table: &Table, time: &[f64]) {
    let column = |wanted: &str| table.names.iter().position(|name| name == wanted);
    let robot = column("r_x").expect("the robot");
    for (row, &t) in time.iter().enumerate() {
        // A row is of the moment of a sighting at most half a step away, in which they move 5 cm.
        let known = |value: f64, wanted: f64| value.is_nan() || (value - wanted).abs() < 0.08;
        assert!(known(table.values[[row, robot]], robot_x(t)), "{name}: robot at {t}");
        for id in 0..2 {
            if let Some(person) = column(&format!("h_{id}_x")) {
                assert!(known(table.values[[row, person]], person_x(id, t)), "{name}: person {id} at {t}");
            }
        }
        if row > 0 {
            assert!((t - time[row - 1] - 0.05).abs() < 1e-6, "{name}: row {row}");
        }
    }
}
