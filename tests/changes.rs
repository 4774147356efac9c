//! `roscausal replay --changes`: a recording in which a mechanism changes and comes back, and the same batches through a live node
//! and through `roscausal roll`.

#![allow(clippy::expect_used, clippy::panic, reason = "a test may panic: that is how it fails")]

mod common;
#[path = "common/discovery.rs"]
mod discovery;

use std::{collections::BTreeMap, fs, path::Path};

use common::roscausal;
use discovery::discover;
use roscausal_core::{
    Time,
    nodes::{RecordedChange, recorded_changes},
};
use roscausal_discovery::changes::{ChangeEvent, Status};
use roscausal_fuzz::unit;
use roscausal_msgs::geometry_msgs::{Twist, Vector3};
use roscausal_recording::McapWriter;

const BATCHES: usize = 16;
const ROWS: usize = 300;

/// Messages at 10 Hz in which `x` drives `y`, and `y` drives `z`; from batch 5 to 11 `x` drives `y` the other way.
fn record(path: &Path) {
    let mut writer = McapWriter::create(path).expect("a file");
    let mut state = 5;
    let mut normal = || (0..12).map(|_| unit(&mut state)).sum::<f64>() - 6.0;
    let (mut x, mut y) = (0.0, 0.0);
    for row in 0..BATCHES * ROWS + 20 {
        let strength = if (5 * ROWS..11 * ROWS).contains(&row) { -0.6 } else { 0.8 };
        let z = 0.5 * y + normal();
        y = 0.4 * y + strength * x + normal();
        x = 0.5 * x + normal();
        let message = Twist { linear: Vector3 { x, y, z }, ..Twist::default() };
        writer.write("/state", Time::from_secs_f64(100.0 + 0.1 * row as f64), &message).expect("writes");
    }
    writer.finish().expect("ends");
}

/// The files of a folder that end with `end`, by name.
fn files(folder: &Path, end: &str) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let named = entries.map(|entry| (entry.file_name().to_string_lossy().into_owned(), entry.path()));
    named
        .filter(|(name, _)| name.ends_with(end) && !name.starts_with('.'))
        .map(|(name, path)| (name, fs::read(path).expect("reads")))
        .collect()
}

/// Puts the batches of a replay before a live node, and waits until it has read them.
fn live(replayed: &Path, dir: &Path) {
    fs::create_dir_all(dir.join("pp")).expect("makes");
    for (name, bytes) in files(&replayed.join("pp_pool/analysed"), "") {
        fs::write(dir.join("pp").join(name), bytes).expect("writes");
    }
    discover(dir, 9000.0, 3);
}

#[test]
fn a_replay_tells_the_changes_of_a_recording_as_a_live_node_and_as_roll() {
    let dir = tempfile::tempdir().expect("a folder");
    let dir = dir.path();
    record(&dir.join("run.mcap"));
    let signals = ["x = /state.linear.x", "y = /state.linear.y", "z = /state.linear.z"];
    let mut args =
        vec!["replay", "run.mcap", "--out", "r", "--person", "nobody", "--ts-length", "30", "--dt", "0.1"];
    args.extend(signals.iter().flat_map(|signal| ["--signal", signal]));
    args.extend(["--method", "pcmci", "--test", "parcorr", "--changes", "--window-batches", "3"]);
    let output = roscausal(dir, &args);
    let stated = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{stated}{}", String::from_utf8_lossy(&output.stderr));

    let reported = recorded_changes(&dir.join("r/cm_pool")).expect("reads");
    let confirmed: Vec<&RecordedChange> =
        reported.iter().filter(|change| change.event.status == Status::Confirmed).collect();
    assert_eq!(confirmed.len(), 2, "{reported:?}");
    assert!(
        confirmed.iter().all(|change| change.event.cause == "x" && change.event.effect == "y"),
        "{reported:?}"
    );
    assert_eq!(confirmed[1].event.same_as, Some(1), "{reported:?}");
    assert!(
        stated.contains("x drives y (lag 1) in the opposite direction") && stated.contains("found in "),
        "{stated}"
    );
    let summary: serde_json::Value =
        serde_json::from_slice(&fs::read(dir.join("r/summary.json")).expect("is there")).expect("JSON");
    let in_summary: Vec<RecordedChange> =
        serde_json::from_value(summary["changes"].clone()).expect("changes");
    assert_eq!(in_summary, reported);
    let picture = fs::read_to_string(dir.join("r/strip.svg")).expect("is there");
    assert_eq!(picture.matches("class=\"change\"").count(), 2);
    assert!(picture.contains("regime 3, as 1") && picture.contains("minutes"), "{picture}");

    // The same bytes from a live node on the same batches.
    live(&dir.join("r"), &dir.join("live"));
    let changes = files(&dir.join("r/cm_pool/changes"), ".json");
    assert!(changes.len() == reported.len() && changes == files(&dir.join("live/models/changes"), ".json"));
    assert!(files(&dir.join("r/cm_pool"), ".json") == files(&dir.join("live/models"), ".json"));

    // And the same events from the tables.
    let mut args = vec!["roll".to_owned()];
    args.extend(
        files(&dir.join("r/pp_pool/analysed"), ".csv")
            .keys()
            .map(|name| format!("r/pp_pool/analysed/{name}")),
    );
    let more = "--batch 300 --changes --change-rows 300 --method pcmci --test parcorr --format jsonl";
    args.extend(more.split(' ').map(str::to_owned));
    let output = roscausal(dir, &args.iter().map(String::as_str).collect::<Vec<_>>());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let lines = String::from_utf8_lossy(&output.stdout).into_owned();
    let events: Vec<ChangeEvent> = lines
        .lines()
        .filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok()?.get("event").cloned())
        .map(|event| serde_json::from_value(event).expect("an event"))
        .collect();
    assert_eq!(events, reported.iter().map(|change| change.event.clone()).collect::<Vec<_>>());
}
