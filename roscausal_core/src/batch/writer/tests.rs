//! Tests of the writer: files, metadata, post-processing, full disks and full pools.

use std::{
    collections::BTreeMap,
    fs,
    time::{Duration, Instant},
};

use serde_json::json;

use super::{files::seconds, work::LOOK_AGAIN, *};
use crate::{
    Time,
    batch::{EndedBy, Table, Values, postprocess::Feature, risk::RiskModel},
};

fn recording(secs: f64) -> Recording {
    let row = |v: f64| Values::from_array([3.0, 4.0, v, 0.0, 0.1, v, 0.0]);
    Recording {
        start: Time::from_secs_f64(secs),
        dt_ns: 300_000_000,
        frame: "map".into(),
        robot: vec![row(1.0), row(2.0), row(0.1)],
        people: BTreeMap::from([(5, vec![row(1.5), Values::UNKNOWN, row(1e-7)])]),
        others: BTreeMap::new(),
        context: BTreeMap::from([("do_robot_speed".to_owned(), vec![vec![], vec![0.2], vec![0.2]])]),
        signals: Vec::new(),
        complete: true,
        length_s: None,
        ended_by: Some(EndedBy::TsLength),
    }
}

pub(super) fn config(dir: &std::path::Path, processing: Processing) -> WriterConfig {
    WriterConfig {
        raw: Pool::open(dir.join("raw"), "data_").expect("opens"),
        processed: Pool::open(dir.join("pp"), "data_").expect("opens"),
        legacy_columns: false,
        delete_raw: false,
        processing,
        parameters: Map::new(),
        limits: Limits::default(),
        journal: true,
    }
}

pub(super) fn built_in() -> Processing {
    let names = ["h_v", "h_dg", "h_risk"].map(str::to_owned);
    Processing::BuiltIn(Postprocess {
        risk_model: RiskModel::V1_1,
        risk_lag: 0,
        risk_noise: 0.0,
        seed: 0,
        obs_size: 2.0,
        safe_dist: 5.0,
        obstacle: crate::batch::postprocess::Obstacle::Robot,
        features: Feature::defaults(&names).expect("the paper's"),
    })
}

pub(super) fn files(dir: &std::path::Path) -> Vec<String> {
    let entries = fs::read_dir(dir).expect("lists").map(|entry| entry.expect("an entry"));
    let mut names: Vec<String> = entries.map(|e| e.file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

#[test]
fn a_batch_is_a_csv_of_exact_numbers_with_its_facts_beside_it() {
    let dir = tempfile::tempdir().expect("a folder");
    let writer = Writer::start(config(dir.path(), Processing::None)).expect("starts");
    writer.write(recording(1_700_000_000.1), None);
    drop(writer);
    assert_eq!(files(&dir.path().join("raw")), ["data_20231114_221320.csv", "data_20231114_221320.json"]);
    let path = dir.path().join("raw/data_20231114_221320.csv");
    let text = fs::read_to_string(&path).expect("reads");
    let lines: Vec<&str> = text.lines().collect();
    assert!(lines[0].starts_with("time,r_gx,r_gy,r_x"));
    assert_eq!(lines[2], "1700000000.4,3,4,2,0,0.1,2,0,,,,,,,,0.2");
    let table = Table::read(&path, None).expect("reads");
    assert_eq!(table.values[[2, 10]], 1e-7);
    assert!(table.values[[1, 7]].is_nan());
    let facts = fs::read(dir.path().join("raw/data_20231114_221320.json")).expect("reads");
    let facts: Json = serde_json::from_slice(&facts).expect("is JSON");
    assert_eq!(facts["complete"], json!(true));
    assert_eq!(facts["ids"], json!([5]));
    assert_eq!(facts["context"], json!(["do_robot_speed"]));
    let span = json!([{ "column": "do_robot_speed", "value": [0.2], "from": 1_700_000_000.4, "to": 1_700_000_000.7 }]);
    assert_eq!(facts["interventions"], span);
    assert_eq!(facts["gaps"][0]["body"], json!("h_5"));
    assert_eq!(facts["columns"][4], json!({ "name": "r_theta", "unit": "rad" }));
}

#[test]
fn batches_of_one_second_have_names_of_their_own() {
    let dir = tempfile::tempdir().expect("a folder");
    let writer = Writer::start(config(dir.path(), built_in())).expect("starts");
    (0..3).for_each(|_| writer.write(recording(0.0), None));
    drop(writer);
    let expected = ["", "_2", "_3"].map(|end| format!("data_19700101_000000{end}"));
    let names = |folder: &str| -> Vec<String> {
        let csv = files(&dir.path().join(folder))
            .into_iter()
            .filter_map(|f| f.strip_suffix(".csv").map(str::to_owned));
        csv.collect()
    };
    assert_eq!(names("raw"), expected);
    assert_eq!(names("pp"), expected);
}

#[test]
fn the_raw_batch_goes_only_once_the_other_is_written() {
    let dir = tempfile::tempdir().expect("a folder");
    let writer =
        Writer::start(WriterConfig { delete_raw: true, ..config(dir.path(), built_in()) }).expect("starts");
    writer.write(recording(0.0), None);
    writer.write(Recording { people: BTreeMap::new(), ..recording(9.0) }, None);
    while writer.status().processed + writer.status().failed < 2 {
        thread::sleep(LOOK_AGAIN);
    }
    assert_eq!(writer.status().failed, 1);
    assert!(writer.status().last_failure.is_some_and(|t| t.contains("nobody is in the batch")));
    drop(writer);
    assert_eq!(files(&dir.path().join("raw")), ["data_19700101_000009.csv", "data_19700101_000009.json"]);
    assert_eq!(files(&dir.path().join("pp")), ["data_19700101_000000.csv", "data_19700101_000000.json"]);
}

#[test]
fn a_folder_that_is_gone_loses_no_batch_and_recording_does_not_wait() {
    let dir = tempfile::tempdir().expect("a folder");
    let writer = Writer::start(config(dir.path(), Processing::None)).expect("starts");
    let raw = dir.path().join("raw");
    fs::remove_dir(&raw).expect("removes");
    fs::write(&raw, "in the way").expect("writes");
    let start = Instant::now();
    (0..4).for_each(|i| writer.write(recording(f64::from(i)), None));
    assert!(start.elapsed() < Duration::from_millis(200));
    while writer.status().trouble.is_none() {
        thread::sleep(LOOK_AGAIN);
    }
    fs::remove_file(&raw).expect("removes");
    fs::create_dir(&raw).expect("makes");
    while writer.status().written < 4 {
        thread::sleep(LOOK_AGAIN);
    }
    assert_eq!(files(&raw).len(), 8);
}

#[test]
fn seconds_are_exact() {
    for (nanos, text) in [(0, "0"), (1_500_000_000, "1.5"), (3_300_000_000, "3.3"), (-1, "-0.000000001")] {
        assert_eq!(seconds(nanos), text);
    }
}
