//! `roscausal discover --format trajectories`, `--feature` and what changes values: the command on tables of people and of numbers.

#![allow(clippy::expect_used, clippy::panic, reason = "a test may panic: that is how it fails")]

mod common;

use std::{fs, path::Path};

use common::roscausal;
use roscausal_fuzz::unit;
use serde_json::Value;

fn model(dir: &Path, args: &[&str]) -> Result<Value, String> {
    let quick = ["--method", "pcmci", "--test", "parcorr"];
    let out = roscausal(dir, &[&["discover"], args, &quick].concat());
    let reported = String::from_utf8_lossy(&out.stderr).into_owned();
    assert!(!reported.contains("panicked"), "{reported}");
    if out.status.success() { Ok(serde_json::from_slice(&out.stdout).expect("JSON")) } else { Err(reported) }
}

/// Ten people who slow down in front of a robot, as ETH ships them: frame, person, x, y.
fn crowd() -> String {
    let mut state = 5_u64;
    let mut rows = String::new();
    for person in 1..=10_u32 {
        let (mut x, mut v, y) = (0.0, 1.0, f64::from(person) * 0.5);
        for step in 0..60_u32 {
            v = 0.5 * v + 0.3 + 0.4 * unit(&mut state);
            x += 0.4 * v;
            let frame = person * 100 + step * 10;
            rows += &format!("{frame}\t{person}\t{x:.4}\t{y:.4}\n");
        }
    }
    rows
}

#[test]
fn people_of_a_crowd_data_set_become_recordings_with_the_nodes_variables() {
    let dir = tempfile::tempdir().expect("a folder");
    fs::write(dir.path().join("walk.tsv"), crowd()).expect("writes");
    let found =
        model(dir.path(), &["walk.tsv", "--format", "trajectories,json", "--goal", "last"]).expect("a model");
    assert_eq!(found["features"], serde_json::json!(["h_v", "h_dg", "h_risk"]));
    assert_eq!((&found["n_recordings"], &found["dt"]), (&10.into(), &0.4.into()));
    let reported = found["warnings"].to_string();
    assert!(
        reported.contains("frames are taken as 25 per second") && reported.contains("10 agents"),
        "{reported}"
    );
    let args =
        ["walk.tsv", "--format", "trajectories", "--format", "json", "--agent", "3", "--obstacle", "4"];
    let found = model(dir.path(), &args).expect("a model");
    assert_eq!(found["features"], serde_json::json!(["h_v", "h_risk"]));
    assert_eq!(found["n_recordings"], 1);
    let args = [
        "walk.tsv", "--format", "trajectories,json", "--agent", "nearest:2", "--feature",
        "near = dist(h, r)", "--obstacle", "4",
    ];
    let found = model(dir.path(), &args).expect("a model");
    assert_eq!(found["features"], serde_json::json!(["h_v", "h_risk", "near"]));
}

#[test]
fn who_stands_is_there_too_briefly_or_is_a_double_is_left_out_and_named() {
    let dir = tempfile::tempdir().expect("a folder");
    let double =
        crowd().lines().filter(|line| line.split('\t').nth(1) == Some("3")).collect::<Vec<_>>().join("\n");
    let double = double.replace("\t3\t", "\t31\t");
    let stands =
        |id: u32| (0..60).map(|step| format!("{}\t{id}\t4.0\t{id}.0\n", step * 10)).collect::<String>();
    let brief = "0\t51\t1.0\t1.0\n10\t51\t1.4\t1.0\n20\t51\t1.9\t1.0\n";
    fs::write(
        dir.path().join("walk.tsv"),
        format!("{}{double}\n{}{}{brief}", crowd(), stands(41), stands(42)),
    )
    .expect("writes");
    let with = |more: &[&str]| {
        let base = ["walk.tsv", "--format", "trajectories,json", "--goal", "last", "--obstacle", "41"];
        model(dir.path(), &[&base[..], more].concat())
    };
    let found = with(&[]).expect("a model");
    let reported = found["warnings"].to_string();
    assert_eq!(found["n_recordings"], 10, "{reported}");
    for reason in [
        "stand still all the time: 42",
        "fewer than 6 rows: 51",
        "rows of another one: 31",
        "h_dg looks ahead",
    ] {
        assert!(reported.contains(reason), "{reason}: {reported}");
    }
    for (who, n) in [("!5", 9), ("2..4", 3), ("1,3..5", 4), ("!2..4,!7", 7)] {
        assert_eq!(with(&["--agent", who]).expect(who)["n_recordings"], n, "{who}");
    }
    assert!(with(&["--agent", "!77"]).expect_err("nobody").contains("'77' is nobody in this table"));
}

#[test]
fn ids_may_come_before_frames_and_a_flag_on_columns_without_names_is_heeded_or_refused() {
    let dir = tempfile::tempdir().expect("a folder");
    let swapped: String = crowd()
        .lines()
        .map(|line| {
            let cells: Vec<&str> = line.split('\t').collect();
            format!("{} {} {} {} 180\n", cells[1], cells[0], cells[2], cells[3])
        })
        .collect();
    fs::write(dir.path().join("walk.txt"), swapped).expect("writes");
    let with = |more: &[&str]| {
        model(dir.path(), &[&["walk.txt", "--format", "trajectories,json", "--goal", "last"], more].concat())
    };
    let found = with(&[]).expect("a model");
    assert_eq!((&found["n_recordings"], &found["dt"]), (&10.into(), &0.4.into()));
    let named = with(&["--trajectory-columns", "id=1,frame=2,x=3,y=4"]).expect("by number");
    assert_eq!(named["val_matrix"], found["val_matrix"]);
    let reported = with(&["--trajectory-columns", "id=nonsense,x=alsonot"]).expect_err("no such columns");
    assert!(reported.contains("no column 'nonsense'"), "{reported}");
}

#[test]
fn a_longest_gap_that_is_no_length_of_time_is_refused() {
    let dir = tempfile::tempdir().expect("a folder");
    fs::write(dir.path().join("walk.tsv"), crowd()).expect("writes");
    for gap in ["nan", "0", "-1"] {
        let flag = format!("--max-gap={gap}");
        let args = ["walk.tsv", "--format", "trajectories,json", flag.as_str()];
        let reported = model(dir.path(), &args).expect_err(gap).to_lowercase();
        assert!(
            reported.contains(&format!("--max-gap: {gap} is not a number of seconds above 0")),
            "{reported}"
        );
    }
}

#[test]
fn a_table_of_people_is_told_apart_from_one_of_numbers() {
    let dir = tempfile::tempdir().expect("a folder");
    fs::write(dir.path().join("walk.csv"), "time,id,x,y\n0,1,2,3\n0,2,2,3\n1,1,2,3\n").expect("writes");
    let reported = model(dir.path(), &["walk.csv"]).expect_err("it has several people");
    assert!(reported.contains("--format trajectories"), "{reported}");
    let mut rows: Vec<String> = crowd().lines().map(|line| line.replace('\t', ",")).collect();
    rows.sort_by_key(|row| row.split(',').next().and_then(|frame| frame.parse::<u32>().ok()));
    fs::write(dir.path().join("frames.csv"), format!("frame,ped_id,x,y\n{}\n", rows.join("\n")))
        .expect("writes");
    let reported = model(dir.path(), &["frames.csv"]).expect_err("it has several people");
    assert!(reported.contains("--format trajectories") && reported.contains("same frame"), "{reported}");
    let reported = model(dir.path(), &["walk.csv", "--agent", "1"]).expect_err("no trajectories");
    assert!(reported.contains("--format trajectories"), "{reported}");
    let reported = model(dir.path(), &["walk.csv", "--format", "trajectories", "--person", "1"])
        .expect_err("for recordings");
    assert!(reported.contains("--agent"), "{reported}");
    let reported = model(dir.path(), &["walk.csv", "--format", "text,json"]).expect_err("two");
    assert!(reported.contains("--format"), "{reported}");
}

/// `speed` changes by what `force` was one step before.
fn numbers() -> String {
    let mut state = 11_u64;
    let (mut speed, mut force) = (0.0, 0.0);
    let mut csv = "time,speed,force,label\n".to_owned();
    for row in 0..400 {
        (speed, force) = (speed + force + 0.1 * (unit(&mut state) - 0.5), unit(&mut state) - 0.5);
        csv += &format!("{},{speed:.6},{force:.6},walk\n", f64::from(row) * 0.5);
    }
    csv
}

#[test]
fn variables_are_derived_from_the_columns_of_any_table() {
    let dir = tempfile::tempdir().expect("a folder");
    fs::write(dir.path().join("data.csv"), numbers()).expect("writes");
    let args = [
        "data.csv",
        "--format",
        "json",
        "--columns",
        "force",
        "--feature",
        "acceleration = rate(speed)",
        "--feature",
        "late = lag(force, 2) * 30 deg",
    ];
    let found = model(dir.path(), &args).expect("a model");
    assert_eq!(found["features"], serde_json::json!(["force", "acceleration", "late"]));
    assert_eq!(found["graph"][0][1][1], "-->", "{}", found["links"]);
    let reported = model(dir.path(), &["data.csv", "--columns", "force", "--feature", "a = rate(sped)"])
        .expect_err("unknown");
    assert!(reported.contains("--feature") && reported.contains("sped"), "{reported}");
}

#[test]
fn values_are_differenced_detrended_and_standardised_when_asked() {
    let dir = tempfile::tempdir().expect("a folder");
    fs::write(dir.path().join("data.csv"), numbers()).expect("writes");
    let base = ["data.csv", "--format", "json", "--columns", "speed,force"];
    let found = model(dir.path(), &[&base[..], &["--difference=speed"]].concat()).expect("a model");
    assert_eq!(found["graph"][1][0][1], "-->", "{}", found["links"]);
    assert!(found["warnings"].to_string().contains("the change since the row before is analysed of speed"));
    for flag in ["--detrend", "--standardise", "--standardize"] {
        let found = model(dir.path(), &[&base[..], &[flag]].concat()).expect("a model");
        assert!(found["warnings"].to_string().contains("speed, force"), "{}", found["warnings"]);
    }
    let reported = model(dir.path(), &[&base[..], &["--detrend=sped"]].concat()).expect_err("unknown");
    assert!(reported.contains("--detrend") && reported.contains("did you mean 'speed'?"), "{reported}");
}

#[test]
fn numpy_files_give_the_model_of_the_csv_file() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/tables");
    let read = |file: &str, more: &[&str]| model(&folder, &[&[file, "--format", "json"], more].concat());
    let expected = read("plain.csv", &[]).expect("a model");
    assert_eq!(expected["graph"][0][1][1], "-->");
    for file in ["named.npz", "matrix.npz", "fields.npy"] {
        let found = read(file, &[]).unwrap_or_else(|reported| panic!("{file}: {reported}"));
        assert_eq!(found["features"], expected["features"], "{file}");
        assert_eq!(found["links"], expected["links"], "{file}");
        assert!((found["dt"].as_f64().expect("a step") - 0.25).abs() < 1e-9, "{file}");
    }
    assert!(
        read("words.npz", &[]).expect_err("words").contains("row 1, column 'state': 'idle' is not a number")
    );
    let found = read("words.npz", &["--encode", "codes"]).expect("encoded");
    assert_eq!(found["features"], serde_json::json!(["a", "b", "state"]));
    assert!(read("object.npy", &[]).expect_err("objects").contains("astype(float)"));
}

#[cfg(not(feature = "columnar"))]
#[test]
fn a_program_without_parquet_and_arrow_says_so_and_the_way_out() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/tables");
    for file in ["groups.parquet", "feather.arrow", "stream.arrows"] {
        for more in [&[][..], &["--format", "trajectories"]] {
            let reported = model(&folder, &[&[file], more].concat()).expect_err("not built in");
            assert!(reported.contains(file) && reported.contains("built without them"), "{reported}");
            assert!(reported.contains("pandas") && reported.contains("--features columnar"), "{reported}");
            assert_eq!(reported.trim().lines().count(), 1, "{reported}");
        }
    }
}

#[test]
fn a_damaged_numpy_file_is_one_sentence() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/tables");
    let dir = tempfile::tempdir().expect("a folder");
    for name in ["matrix.npz", "fields.npy"] {
        let whole = fs::read(folder.join(name)).expect("is there");
        for keep in [12, whole.len() / 3, whole.len() - 7] {
            fs::write(dir.path().join(name), &whole[..keep]).expect("writes");
            let reported = model(dir.path(), &[name]).expect_err("cut off");
            assert!(
                reported.contains(name) && reported.trim().lines().count() == 1,
                "{name} {keep}: {reported}"
            );
        }
    }
}
