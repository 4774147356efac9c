//! `roscausal predict|whatif|effect|explain` as their users run them: what they print, exit codes, errors.

#![allow(clippy::expect_used, clippy::panic, reason = "a test may panic: that is how it fails")]

mod common;

use std::{fs, process::Output};

use common::{in_a_line, roscausal};
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
    let has_m = in_a_line(&out).contains(" m (");
    assert!(out.lines().any(|line| line.starts_with("   4  ")) && has_m, "{out}");
}

#[test]
fn answers_fit_80_columns_and_a_table_that_does_not_goes_on_below() {
    let dir = folder();
    let long = "distance_to_the_nearest_person_in_front";
    let table = fs::read_to_string(dir.path().join("run.csv")).expect("reads");
    fs::write(dir.path().join("long.csv"), table.replacen("r_v,d,", &format!("r_v,{long},"), 1))
        .expect("writes");
    fs::write(dir.path().join("long.json"), GRAPH.replace("\"d\"", &format!("\"{long}\""))).expect("writes");
    for (model, data, d) in [("graph.json", "run.csv", "d"), ("long.json", "long.csv", long)] {
        for question in [
            &["predict"][..],
            &[
                "whatif", "--action", "stop: r_v=0", "--action", "race: r_v=9", "--action", "go on",
                "--cost", "h_v",
            ],
            &["effect", "--cause", "r_v", "--effect", "h_v"],
            &["explain", "--variable", "h_v", "--from", "100", "--to", "101"],
        ] {
            let args = [&[question[0], model, "--data", data][..], &question[1..]].concat();
            let (code, out, err) = run(&dir, &args);
            assert_eq!(code, Some(0), "{err}");
            let too_long: Vec<&str> = out.lines().filter(|line| line.chars().count() > 80).collect();
            assert!(too_long.is_empty() && out.contains(d), "{args:?}: {too_long:?}");
        }
    }
    // Each variable has its column, beside the others or below them.
    let (_, out, _) = run(&dir, &["predict", "long.json", "--data", "long.csv"]);
    let heads: Vec<&str> = out.lines().filter(|line| line.starts_with("step")).collect();
    assert_eq!(in_a_line(&heads.join(" ")), format!("step r_v step {long} step h_v"), "{out}");
    assert_eq!(out.lines().filter(|line| line.starts_with("  10 ")).count(), 3, "{out}");
}

#[test]
fn actions_are_ranked_by_cost_within_limits() {
    let dir = folder();
    let args = [
        "--action", "stop: r_v=0", "--action", "back: r_v=-0.5", "--action", "go on", "--cost", "d:-1",
        "--format", "json",
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
    // A guess is printed where it is asked for, and is no answer all the same.
    let (code, out, _) = asked(&dir, "whatif", &["--action", "race: r_v=9", "--allow-extrapolation"]);
    assert!(code == Some(3) && out.contains("race: mean (interval)"), "{out}");
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
    let out = in_a_line(&out);
    assert!(
        out.contains("A pulse of one unit of r_v moves h_v the most 3 steps (0.75 s) later: by -0.5"),
        "{out}"
    );
    assert!(out.contains("through d") && out.contains("note: r_v was never imposed"), "{out}");
    let (code, out, _) = asked(&dir, "explain", &["--variable", "h_v", "--from", "100", "--to", "101"]);
    assert_eq!(code, Some(0));
    let out = in_a_line(&out);
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
    assert!(code == Some(1) && err.contains("not JSON"), "{err}");
    let other = r#"{"schema": "roscausal/structural_model/2"}"#;
    fs::write(dir.path().join("other.json"), other).expect("writes");
    let (code, _, err) = run(&dir, &["predict", "other.json"]);
    assert!(code == Some(1) && err.contains("structural_model/2'; fit it anew"), "{err}");
}

/// The numbers of all paths of a class in a picture, path by path.
fn paths(svg: &str, class: &str) -> Vec<Vec<f64>> {
    let of_class = svg.lines().filter(|line| line.contains(&format!("class=\"{class}\"")));
    let numbers = |line: &str| {
        let d = line.split_once(" d=\"").and_then(|(_, rest)| rest.split_once('"')).expect("a path").0;
        d.split_whitespace().filter_map(|word| word.parse().ok()).collect()
    };
    of_class.map(numbers).collect()
}

#[test]
fn fan_charts_show_each_candidate_with_past_bands_and_action() {
    let dir = folder();
    let args = [
        "--action", "go on", "--action", "stop: r_v=0@1..4", "--action", "race: r_v=9", "--at", "100",
        "--horizon", "6", "--units", "r_v=m/s", "--out", "fans",
    ];
    let (code, _, err) = asked(&dir, "whatif", &args);
    assert_eq!(code, Some(0), "{err}");
    let read = |name: &str| fs::read(dir.path().join("fans").join(name)).expect(name);
    let svg = String::from_utf8(read("whatif.svg")).expect("text");
    for words in [
        "go on", "stop", "race", "do not reach", "m/s", ">m<", "time from now in s", "50 %", "90 %",
        "observed",
    ] {
        assert!(svg.contains(words), "{words}: {svg}");
    }
    // Two actions are answered, three variables each; the one with a speed that was never seen is not.
    assert_eq!(["inner", "outer", "median"].map(|class| paths(&svg, class).len()), [6, 6, 6]);
    assert_eq!(svg.matches("class=\"action\"").count(), 2 * 3);
    // The picture is what the answer says: the higher the value, the smaller its y.
    let answer = json(&String::from_utf8(read("whatif.json")).expect("text"));
    let median: Vec<f64> = answer["outlooks"][0]["forecasts"][1]["median"]
        .as_array()
        .expect("a list")
        .iter()
        .map(|value| value.as_f64().expect("a number"))
        .collect();
    let drawn: Vec<f64> = paths(&svg, "median")[1].chunks(2).skip(1).map(|point| point[1]).collect();
    assert_eq!(median.len(), drawn.len());
    for k in 1..median.len() {
        assert!((median[k] - median[k - 1]) * (drawn[k] - drawn[k - 1]) <= 0.01, "{median:?} {drawn:?}");
    }
    assert!(read("whatif.png").starts_with(b"\x89PNG") && read("whatif.pdf").starts_with(b"%PDF"));
    // Again into its own folder, and beside it a prediction; never among files of others.
    assert_eq!(asked(&dir, "whatif", &args).0, Some(0));
    assert_eq!(asked(&dir, "predict", &["--out", "fans"]).0, Some(0));
    let svg = String::from_utf8(read("predict.svg")).expect("text");
    assert_eq!((paths(&svg, "median").len(), svg.matches("class=\"action\"").count()), (3, 0));
    assert!(!svg.contains("observed"), "nothing follows the last row");
    let (code, _, err) = asked(&dir, "predict", &["--out", "."]);
    assert!(code == Some(1) && err.contains("--force"), "{err}");
}

#[test]
fn units_are_those_given_or_of_the_batch_and_a_wrong_one_is_named() {
    let dir = folder();
    let columns = r#"{"columns": [{"name": "r_v", "unit": "m/s"}, {"name": "d", "unit": "km"}, {"name": "x", "unit": "s"}]}"#;
    fs::write(dir.path().join("run.json"), columns).expect("writes");
    let (_, out, _) = asked(&dir, "predict", &["--units", "h_v=furlongs"]);
    let first = in_a_line(out.split("\n\n").next().unwrap_or_default());
    // The graph's own unit goes before that of the file.
    assert!(first.contains(" m/s (") && first.contains(" m (") && first.contains(" furlongs ("), "{first}");
    let (code, _, err) = asked(&dir, "predict", &["--units", "speed=m"]);
    assert!(code == Some(2) && err.contains("variables: r_v, d, h_v"), "{err}");
}
