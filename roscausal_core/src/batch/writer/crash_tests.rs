//! What a node finds when it starts after another was killed: at any moment a batch is complete or recovered.

use std::{fs, path::Path};

use roscausal_msgs::{HumanState, Humans, RobotState, std_msgs::Header};

use super::{
    tests::{built_in, config, files},
    work::LOOK_AGAIN,
    *,
};
use crate::{
    Time,
    batch::{
        Sampling, Select,
        journal::encode,
        recorder::{Recorder, RecorderConfig},
    },
};

/// A robot and person 7 for 2.5 s at 50 Hz, in batches of 1 s. Returns what was recorded and what was journalled.
fn recorded(finish: bool) -> (Vec<(Recording, Option<u64>)>, Vec<journal::Entry>) {
    let mut recorder = Recorder::new(RecorderConfig {
        dt_s: 0.1,
        ts_length_s: Some(1.0),
        max_gap_s: 0.2,
        sampling: Sampling::default(),
        select: Select::All,
    })
    .with_journal(5);
    let mut entries = Vec::new();
    for step in 0..125 {
        let t = Time::from_secs_f64(100.0 + 0.02 * f64::from(step));
        let header = Header { stamp: t, frame_id: "map".into() };
        let mut robot = RobotState { header: header.clone(), ..RobotState::default() };
        robot.pose2d.x = f64::from(step);
        recorder.robot(&robot, t);
        let mut person = HumanState { header: header.clone(), id: 7, ..HumanState::default() };
        // The tracker tells places only, and these are 2 cm off.
        person.pose2d.x = (0.1 * f64::from(step)).sin() + 0.02 * f64::from(step % 3 - 1);
        person.twist.angular.z = f64::NAN;
        person.goal.x = 9.0;
        recorder.humans(&Humans { header, humans: vec![person] }, t);
        if step % 10 == 0 {
            entries.extend(recorder.take_journal());
        }
    }
    if finish {
        recorder.finish();
    }
    entries.extend(recorder.take_journal());
    (recorder.take_numbered_batches(), entries)
}

/// The bytes of journal `number`.
fn journal_of(entries: &[journal::Entry], number: u64) -> Vec<u8> {
    let mut found = None;
    let mut samples = Vec::new();
    for entry in entries {
        match entry {
            journal::Entry::Begin(header) if header.number == number => found = Some(header.clone()),
            journal::Entry::Begin(header) if header.number > number => break,
            journal::Entry::Sample(sample) if found.is_some() => samples.push(*sample),
            _ => {}
        }
    }
    encode(&found.expect("was begun"), &samples)
}

fn put(path: &Path, bytes: &[u8]) {
    fs::create_dir_all(path.parent().expect("a folder")).expect("makes");
    fs::write(path, bytes).expect("writes");
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).expect("is there")
}

#[test]
fn the_batches_of_a_journal_are_those_that_were_recorded() {
    let (batches, entries) = recorded(true);
    assert!(batches.len() >= 2);
    for (batch, number) in &batches {
        let replayed =
            journal::replay(&journal_of(&entries, number.expect("is journalled"))).expect("a journal");
        let (found, wanted) = (&replayed[0], batch);
        assert_eq!(
            (found.start, found.complete, &found.frame),
            (wanted.start, wanted.complete, &wanted.frame)
        );
        assert_eq!(
            format!("{:?}{:?}", found.robot, found.people),
            format!("{:?}{:?}", wanted.robot, wanted.people)
        );
    }
}

#[test]
fn the_open_batch_of_a_node_that_was_killed_is_recovered_and_marked() {
    let (_, entries) = recorded(false);
    let dir = tempfile::tempdir().expect("a folder");
    let begun = |entry: &journal::Entry| matches!(entry, journal::Entry::Begin(header) if header.number == 6);
    assert!(entries.iter().any(begun), "the second batch is open");
    put(&dir.path().join("raw/.data_000000006.journal"), &journal_of(&entries, 6));
    let writer = Writer::start(config(dir.path(), built_in())).expect("starts");
    assert_eq!(writer.first_journal(), Some(7));
    drop(writer);
    let facts = |name: &str| -> Json {
        serde_json::from_str(&read(&dir.path().join("raw").join(name))).expect("JSON")
    };
    let (whole, cut) = (facts("data_19700101_000141.json"), facts("data_19700101_000142.json"));
    assert_eq!(
        (whole["recovered"].as_bool(), whole["complete"].as_bool()),
        (Some(true), Some(true)),
        "{whole}"
    );
    // Up to the last sample in the journal.
    assert_eq!((cut["n_rows"].as_u64(), cut["complete"].as_bool()), (Some(5), Some(false)), "{cut}");
    assert!(cut["ended_by"].as_str().is_some_and(|why| why.contains("recovered")), "{cut}");
    assert!(dir.path().join("pp/data_19700101_000141.csv").exists());
}

#[test]
fn a_journal_that_is_none_is_set_aside_with_a_complaint() {
    let dir = tempfile::tempdir().expect("a folder");
    put(&dir.path().join("raw/.data_000000006.journal"), &[7; 5000]);
    put(&dir.path().join("raw/.data_000000007.journal"), b"roscausal-jour");
    drop(Writer::start(config(dir.path(), built_in())).expect("starts"));
    assert_eq!(files(&dir.path().join("raw")), ["rejected"]);
    assert_eq!(files(&dir.path().join("raw/rejected")), ["data_000000006.journal"]);
}

/// The files of an undisturbed run.
fn undisturbed(dir: &Path) -> Vec<(String, String)> {
    let (batches, entries) = recorded(true);
    let writer = Writer::start(config(dir, built_in())).expect("starts");
    writer.note(entries);
    let (batch, number) = batches.into_iter().next().expect("a batch");
    writer.write(batch, number);
    drop(writer);
    contents(dir)
}

/// Names and contents of all batches below a folder, without the marks of the recovery.
fn contents(dir: &Path) -> Vec<(String, String)> {
    let mut contents = Vec::new();
    for folder in ["raw", "pp"] {
        for name in files(&dir.join(folder)).into_iter().filter(|name| !name.starts_with('.')) {
            contents.push((
                format!("{folder}/{name}"),
                read(&dir.join(folder).join(name)).replace("\"recovered\": true", "\"recovered\": false"),
            ));
        }
    }
    contents
}

#[test]
fn a_batch_comes_out_once_and_the_same_whenever_its_writer_is_killed() {
    let whole = tempfile::tempdir().expect("a folder");
    let wanted: Vec<_> = undisturbed(whole.path());
    let journal = journal_of(&recorded(true).1, 5);
    let name = "data_19700101_000140.csv";
    let (raw, processed) =
        (read(&whole.path().join("raw").join(name)), read(&whole.path().join("pp").join(name)));
    let half = &raw.as_bytes()[..raw.len() / 2];
    // The states of the folders between any two steps of `Step`, and halfway through a write.
    let states: Vec<Vec<(&str, &[u8])>> = vec![
        vec![("raw/.data_000000005.journal", &journal)],
        vec![("raw/.data_000000005.journal", &journal), ("raw/.data_19700101_000140.csv.tmp", half)],
        vec![
            ("raw/.data_000000005.journal", &journal),
            ("raw/.data_19700101_000140.csv.tmp", raw.as_bytes()),
        ],
        vec![
            ("raw/.data_19700101_000140.csv.commit", &journal),
            ("raw/.data_19700101_000140.csv.tmp", raw.as_bytes()),
        ],
        vec![
            ("raw/.data_19700101_000140.csv.commit", &journal),
            ("raw/data_19700101_000140.csv", raw.as_bytes()),
        ],
        vec![
            ("raw/.data_19700101_000140.csv.commit", &journal),
            ("raw/data_19700101_000140.csv", raw.as_bytes()),
            ("pp/.data_19700101_000140.csv.tmp", &processed.as_bytes()[..9]),
        ],
        vec![
            ("raw/.data_19700101_000140.csv.done", &journal),
            ("raw/data_19700101_000140.csv", raw.as_bytes()),
            ("pp/.data_19700101_000140.csv.tmp", processed.as_bytes()),
        ],
        vec![
            ("raw/.data_19700101_000140.csv.done", &journal),
            ("raw/data_19700101_000140.csv", raw.as_bytes()),
            ("pp/data_19700101_000140.csv", processed.as_bytes()),
        ],
    ];
    for (i, state) in states.iter().enumerate() {
        let dir = tempfile::tempdir().expect("a folder");
        let later = i > 2;
        for (name, text) in wanted.iter().filter(|(name, _)| {
            name.ends_with(".json") && (name.starts_with("raw") && later || name.starts_with("pp") && i > 5)
        }) {
            put(&dir.path().join(name), text.as_bytes());
        }
        state.iter().for_each(|(name, bytes)| put(&dir.path().join(name), bytes));
        drop(Writer::start(config(dir.path(), built_in())).expect("starts"));
        // A journal that remains may also hold the beginning of the next batch.
        let found: Vec<_> =
            contents(dir.path()).into_iter().filter(|(name, _)| name.contains("000140")).collect();
        assert_eq!(found, wanted, "state {i}");
        let hidden: Vec<_> =
            files(&dir.path().join("raw")).into_iter().filter(|n| n.starts_with('.')).collect();
        assert!(hidden.is_empty(), "state {i}: {hidden:?}");
        drop(Writer::start(config(dir.path(), built_in())).expect("starts again"));
        let again: Vec<_> =
            contents(dir.path()).into_iter().filter(|(name, _)| name.contains("000140")).collect();
        assert_eq!(again, wanted, "state {i}, started again");
    }
}

#[test]
fn a_batch_that_was_analysed_meanwhile_does_not_come_back() {
    let dir = tempfile::tempdir().expect("a folder");
    let journal = journal_of(&recorded(true).1, 5);
    // The post-processed batch got its name, and discovery took it away before the marker was removed.
    put(&dir.path().join("raw/.data_19700101_000140.csv.done"), &journal);
    drop(Writer::start(config(dir.path(), built_in())).expect("starts"));
    assert!(contents(dir.path()).is_empty());
}

#[test]
fn a_full_pool_that_may_drop_nothing_stops_recording_until_there_is_room() {
    let dir = tempfile::tempdir().expect("a folder");
    let limits = Limits { max_batches: 1, max_bytes: 0, drop_oldest: false };
    let config = WriterConfig { limits, ..config(dir.path(), Processing::None) };
    let pool = config.raw.clone();
    pool.write("data_19600101_000000.csv", b"x").expect("writes");
    let writer = Writer::start(config).expect("starts");
    let wait_until = |is_full: bool| {
        (0..500).any(|_| {
            thread::sleep(LOOK_AGAIN / 5);
            writer.is_full() == is_full
        })
    };
    let batch = recorded(true).0.remove(0).0;
    writer.write(batch, None);
    assert!(wait_until(true));
    assert!(writer.status().trouble.is_some_and(|trouble| trouble.contains("max_pool_size")));
    fs::remove_file(pool.path("data_19600101_000000.csv")).expect("somebody makes room");
    assert!(wait_until(false));
    assert_eq!((writer.status().written, writer.status().trouble), (1, None));
}

#[test]
fn a_full_pool_drops_its_oldest_batch_and_says_so() {
    let dir = tempfile::tempdir().expect("a folder");
    let limits = Limits { max_batches: 1, max_bytes: 0, drop_oldest: true };
    let config = WriterConfig { limits, ..config(dir.path(), Processing::None) };
    let pool = config.raw.clone();
    let writer = Writer::start(config).expect("starts");
    recorded(true).0.into_iter().for_each(|(batch, _)| writer.write(batch, None));
    let status = writer.status.clone();
    drop(writer);
    let status = lock(&status).clone();
    assert_eq!((status.lost, status.written - status.dropped), (0, 1));
    assert_eq!(pool.contents().expect("lists").batches.len(), 1);
}
