//! `roscausal predict|whatif|effect|explain` as their users run them: what they print, exit codes, errors.

#![allow(clippy::expect_used, clippy::panic, reason = "a test may panic: that is how it fails")]

mod common;

use std::{fs, process::Output};

use common::roscausal;
use roscausal_fuzz::unit;
use serde_json::Value;
use tempfile::TempDir;

const GRAPH: &str = r#"{"units": {"d": "m"}, "links": [
    {"cause": "r_v", "effect": "r_v", "lag": 1}, {"cause": "d", "effect": "d", "lag": 1},
    {"cause": "r_v", "effect": "d", "lag": 1}, {"cause": "d", "effect": "h_v", "lag": 1}]}"#;

/// The distance shrinks with the robot's speed, the person's speed with the distance.
fn folder() -> TempDir {
    let dir = tempfile::tempdir().expect("a temporary folder");
    let mut state = 7_u64;
    let mut noise = || unit(&mut state) - 0.5;
    let (mut r, mut d) = (0.0, 0.0);
    let mut csv = "time,r_v,d,h_v\n".to_owned();
    for row in 0..500 {
        let h = 0.8 * d + 0.3 * noise();
        (r, d) = (0.7 * r + noise(), 0.5 * d - 0.6 * r + 0.3 * noise());
        csv += &format!("{},{r},{d},{h}\n", row as f64 * 0.25);
    }
    fs::write(dir.path().join("run.csv"), csv).expect("writes");
    fs::write(dir.path().join("graph.json"), GRAPH).expect("writes");
    dir
}

fn run(dir: &TempDir, args: &[&str]) -> (Option<i32>, String, String) {
    let Output { status, stdout, stderr } = roscausal(dir.path(), args);
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let (out, err) = (text(&stdout), text(&stderr));
    assert!(!err.contains("panicked"), "{err}");
    (status.code(), out, err)
}

fn asked(dir: &TempDir, command: &str, args: &[&str]) -> (Option<i32>, String, String) {
    let start = [command, "graph.json", "--data", "run.csv"];
    run(dir, &start.iter().chain(args).copied().collect::<Vec<_>>())
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).expect("one JSON object")
}

#[test]
fn a_prediction_is_sentences_a_table_and_notes() {
    let dir = folder();
    let (code, out, err) = asked(&dir, "predict", &["--horizon", "4"]);
    assert_eq!((code, err.as_str()), (Some(0), ""));
    assert!(out.starts_with("go on: after 4 steps (1 s) r_v "), "{out}");
    assert!(out.lines().any(|line| line.starts_with("   4  ")) && out.contains(" m ("), "{out}");
}

#[test]
fn actions_are_ranked_by_cost_within_limits() {
    let dir = folder();
    let args = [
        "--action",
        "stop: r_v=0",
        "--action",
        "back: r_v=-0.5",
        "--action",
        "go on",
        "--cost",
        "d:-1",
        "--format",
        "json",
    ];
    let (code, out, _) = asked(&dir, "whatif", &args);
    let answer = json(&out);
    assert_eq!((code, &answer["status"]), (Some(0), &Value::from("OK")));
    // Backwards makes the distance grow, which is cheap.
    assert_eq!(answer["ranking"][0], 1);
    assert_eq!(answer["outlooks"][0]["forecasts"][0]["mean"][9], 0.0);
}

#[test]
fn what_the_data_do_not_carry_ends_with_code_3_and_says_what_was_seen() {
    let dir = folder();
    let (code, out, err) = asked(&dir, "whatif", &["--action", "race: r_v=9"]);
    assert_eq!(code, Some(3));
    assert!(err.contains("not supported by the data") && err.contains("seen: r_v from"), "{err}");
    assert!(out.contains("race: not answered"), "{out}");
    let (code, out, _) = asked(&dir, "whatif", &["--action", "race: r_v=9", "--format", "json"]);
    assert_eq!((code, &json(&out)["status"]), (Some(3), &Value::from("NOT_SUPPORTED")));
    assert_eq!(asked(&dir, "whatif", &["--action", "race: r_v=9", "--allow-extrapolation"]).0, Some(0));
}

#[test]
fn a_structural_model_in_a_file_answers_the_same_without_the_data() {
    let dir = folder();
    let question = ["--action", "stop: r_v=0", "--format", "json"];
    let with: Vec<&str> = question.iter().chain(&["--save", "structural.json"]).copied().collect();
    let (code, first, _) = asked(&dir, "whatif", &with);
    assert_eq!(code, Some(0));
    let again: Vec<&str> = ["whatif", "structural.json"].iter().chain(&question).copied().collect();
    let (code, second, _) = run(&dir, &again);
    assert_eq!((code, json(&first)), (Some(0), json(&second)));
}

#[test]
fn effects_and_explanations_are_told_in_sentences() {
    let dir = folder();
    let (code, out, _) = asked(&dir, "effect", &["--cause", "r_v", "--effect", "h_v"]);
    assert_eq!(code, Some(0));
    assert!(
        out.contains("A pulse of one unit of r_v moves h_v the most 3 steps (0.75 s) later: by -0.5"),
        "{out}"
    );
    assert!(out.contains("through d") && out.contains("note: r_v was never imposed"), "{out}");
    let (code, out, _) = asked(&dir, "explain", &["--variable", "h_v", "--from", "100", "--to", "101"]);
    assert_eq!(code, Some(0));
    assert!(out.starts_with("h_v ") && out.contains("between 100 and 101 s (4 steps (1 s))"), "{out}");
}

#[test]
fn had_i_asks_about_rows_that_were_observed() {
    let dir = folder();
    let args = ["--action", "stop: r_v=0", "--had", "--at", "100"];
    let (code, out, _) = asked(&dir, "whatif", &args);
    assert_eq!(code, Some(0));
    assert!(out.starts_with("stop, had it been done: after 10 steps"), "{out}");
    let (code, out, err) = asked(&dir, "whatif", &["--action", "stop: r_v=0", "--had"]);
    assert_eq!((code, out.as_str()), (Some(1), ""));
    assert!(err.contains("earlier time"), "{err}");
}

#[test]
fn a_bad_question_is_one_sentence_and_code_2() {
    let dir = folder();
    for (args, words) in [
        (&["--action", "stop: r_w=0"][..], "did you mean 'r_v'"),
        (&["--action", "stop: r_v"], "r_v=0@1..10"),
        (&["--action", "stop:"], "go on"),
        (&["--action", "go on", "--horizon", "1000000000"], "1 to 1000"),
        (&["--action", "go on", "--cost", "d:x"], "h_risk:2"),
        (&["--action", "go on", "--limit", "d"], "d>1.5"),
    ] {
        let (code, out, err) = asked(&dir, "whatif", args);
        assert_eq!((code, out.as_str()), (Some(2), ""), "{err}");
        assert!(err.contains(words) && err.lines().count() == 1, "{err}");
    }
    let (code, _, err) = asked(&dir, "predict", &["--at", "1e9"]);
    assert!(code == Some(1) && err.contains("from 0 to 124.75 s"), "{err}");
    let (code, _, err) = run(&dir, &["predict", "graph.json"]);
    assert!(code == Some(2) && err.contains("CSV files"), "{err}");
    let (code, _, err) = run(&dir, &["predict", "run.csv", "--data", "run.csv"]);
    assert!(code == Some(1) && err.contains("no JSON"), "{err}");
}
