//! Methods for several people and for interventions, as users of the command run them.

#![allow(clippy::expect_used, clippy::panic, reason = "a test may panic: that is how it fails")]

mod common;

use std::{fs, path::Path};

use common::roscausal;
use roscausal_fuzz::unit;
use serde_json::{Value, json};

/// Rows of two variables that do not depend on each other, both `higher` than noise, and the person's age.
fn person(seed: u64, higher: f64, age: u32) -> String {
    let mut state = seed;
    let mut row = |_| format!("{},{},{age}\n", unit(&mut state) + higher, unit(&mut state) + higher);
    format!("speed,distance,age\n{}", (0..200).map(&mut row).collect::<String>())
}

fn two_people(dir: &Path) {
    fs::write(dir.join("a.csv"), person(3, 0.0, 30)).expect("writes");
    fs::write(dir.join("b.csv"), person(4, 0.5, 70)).expect("writes");
}

fn model(dir: &Path, args: &[&str]) -> Value {
    let out = roscausal(dir, &[args, &["--format", "json"]].concat());
    assert!(out.status.success(), "{args:?}: {}", String::from_utf8_lossy(&out.stderr));
    serde_json::from_slice(&out.stdout).expect("JSON")
}

fn complaint(dir: &Path, args: &[&str]) -> String {
    let out = roscausal(dir, args);
    let text = String::from_utf8_lossy(&out.stderr).into_owned();
    assert!(!out.status.success() && out.stdout.is_empty() && !text.contains("panicked"), "{args:?}: {text}");
    text
}

#[test]
fn people_who_differ_are_pooled_by_one_command_and_the_dummy_is_told() {
    let dir = tempfile::tempdir().expect("a folder");
    two_people(dir.path());
    let pooled = ["discover", "a.csv", "b.csv", "--columns", "speed,distance", "--method"];
    let blind =
        model(dir.path(), &[&pooled[..], &["pcmciplus", "--test", "parcorr", "--levels", "keep"]].concat());
    assert_ne!(blind["graph"][0][1][0], "", "pooled blindly, the people's difference looks like a link");
    // It knows its test.
    let found = model(dir.path(), &[&pooled[..], &["jpcmciplus"]].concat());
    assert_eq!((&found["cond_ind_test"], &found["graph"][0][1][0]), (&json!("parcorr"), &json!("")));
    assert_eq!(found["features"], json!(["speed", "distance"]));
    assert!(found["warnings"].to_string().contains("the recordings differ in speed, distance"));
}

#[test]
fn a_column_that_is_constant_in_each_file_is_a_context() {
    let dir = tempfile::tempdir().expect("a folder");
    two_people(dir.path());
    let found = model(dir.path(), &["discover", "a.csv", "b.csv", "--method", "jpcmciplus"]);
    assert_eq!(found["features"], json!(["speed", "distance", "age"]));
    let reported = found["warnings"].to_string();
    assert!(reported.contains("taken as contexts, which drive and are not driven: age"), "{reported}");
    assert!(found["links"].as_array().expect("links").iter().all(|link| link["effect"] != "age"));
}

#[test]
fn the_flag_says_what_an_intervention_acts_on() {
    let dir = tempfile::tempdir().expect("a folder");
    let mut state = 9;
    let mut before = 0.0;
    let mut csv = "speed,gap,push\n".to_owned();
    for row in 0..300 {
        let push = if row % 4 == 0 { 2.0 } else { 0.0 };
        let speed = push + unit(&mut state);
        csv += &format!("{speed},{},{push}\n", 0.9 * before + 0.5 * unit(&mut state));
        before = speed;
    }
    fs::write(dir.path().join("data.csv"), csv).expect("writes");
    let args = ["discover", "data.csv", "--method", "candoit", "--test", "parcorr"];
    let found = model(dir.path(), &[&args[..], &["--acts-on", "push=speed"]].concat());
    assert_eq!(
        (&found["graph"][2][0][0], &found["graph"][0][1][1]),
        (&json!("-->"), &json!("-->")),
        "{found}"
    );
    // The rule that contexts join their variables as conditions shows in the p-values.
    let plain =
        model(dir.path(), &[&args[..], &["--acts-on", "push=speed", "--no-extra-conditions"]].concat());
    assert!(plain["graph"][0][1][1] == "-->" && plain["p_matrix"] != found["p_matrix"], "{plain}");
    // One set of each size: no fewer links.
    let few = model(dir.path(), &[&args[..], &["--acts-on", "push=speed", "--max-sets", "1"]].concat());
    assert_eq!(few["graph"][0][1][1], "-->", "{few}");
    for (more, says) in [
        (&["--acts-on", "push"][..], "--acts-on: 'push' is not a pair"),
        (&["--acts-on", "pull=speed"], "--acts-on: pull=speed: there is no column 'pull'"),
        (&[], "--acts-on: candoit needs interventions, and no column holds one"),
        (&["--acts-on", "push=speed", "--tau-min", "1"], "--tau-min: 1: interventions act at lag 0"),
        (&["--acts-on", "push=speed", "--tau-max", "400"], "record longer or lower --tau-max"),
    ] {
        let text = complaint(dir.path(), &[&args[..], more].concat());
        assert!(text.contains(says), "{more:?}: {text}");
    }
}

#[test]
fn what_jpcmciplus_cannot_answer_is_one_sentence() {
    let dir = tempfile::tempdir().expect("a folder");
    two_people(dir.path());
    for (args, says) in [
        (&["a.csv"][..], "jpcmciplus compares recordings and there is one"),
        (&["a.csv", "b.csv", "--test", "gpdc"], "take parcorr"),
        (&["a.csv", "b.csv", "--exogenous", "speed"], "'speed' varies within recording 1"),
        (&["a.csv", "b.csv", "--pc-alpha", "auto"], "no score that chooses a level"),
        (&["a.csv", "b.csv", "--tau-max", "150"], "record longer or lower --tau-max"),
    ] {
        let text = complaint(dir.path(), &[&["discover", "--method", "jpcmciplus"], args].concat());
        assert!(text.contains(says) && text.trim_end().lines().count() == 1, "{args:?}: {text}");
    }
}

#[test]
fn the_demo_takes_interventions_with_candoit_and_pools_its_batches_with_jpcmciplus() {
    let dir = tempfile::tempdir().expect("a folder");
    for (method, more) in [("candoit", &["--do", "robot.off@20..40"][..]), ("jpcmciplus", &[])] {
        let usual = ["demo", "--duration", "120", "--method", method, "--test", "parcorr", "--out", method];
        let out = roscausal(dir.path(), &[&usual[..], more].concat());
        assert!(out.status.success(), "{method}: {}", String::from_utf8_lossy(&out.stderr));
        let text = fs::read(dir.path().join(method).join("model.json")).expect("a model");
        let model: Value = serde_json::from_slice(&text).expect("JSON");
        assert_eq!(model["method"], method);
        let has_column = model["features"].to_string().contains("do_robot_off");
        assert_eq!(has_column, method == "candoit", "{model}");
    }
}

#[test]
fn auto_says_what_it_would_take_and_why_and_does_it_only_when_asked() {
    let dir = tempfile::tempdir().expect("a folder");
    two_people(dir.path());
    let args = ["discover", "a.csv", "b.csv", "--columns", "speed,distance", "--method", "auto"];
    let out = roscausal(dir.path(), &args);
    let text = String::from_utf8_lossy(&out.stdout).into_owned();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    for words in [
        "I would take jpcmciplus with parcorr",
        "differ in the level of speed, distance",
        "Nothing was analysed",
    ] {
        assert!(text.contains(words), "{words}: {text}");
    }
    let found = model(dir.path(), &[&args[..], &["--take-it"]].concat());
    assert_eq!(found["method"], "jpcmciplus");
    let text = complaint(dir.path(), &["discover", "a.csv", "--method", "pcmci", "--take-it"]);
    assert!(text.contains("--take-it: it is for --method auto"), "{text}");
    let text = complaint(dir.path(), &["demo", "--method", "auto"]);
    assert!(text.contains("there is no method 'auto'") || text.contains("unknown"), "{text}");
}

/// `x` and `y` of a place, of which `y` drives `speed` one step later; `speed` drives the square of itself into `risk`.
fn walk() -> String {
    let (mut state, mut csv) = (5, "x,y,speed,risk\n".to_owned());
    let (mut y_before, mut speed_before) = (0.0, 0.0);
    for _ in 0..250 {
        let y = unit(&mut state) - 0.5;
        let speed: f64 = 0.9 * y_before + 0.4 * (unit(&mut state) - 0.5);
        let risk = 2.0 * speed_before * speed_before + 0.05 * unit(&mut state);
        csv += &format!("{},{y},{speed},{risk}\n", unit(&mut state));
        (y_before, speed_before) = (y, speed);
    }
    csv
}

#[test]
fn columns_that_belong_together_are_one_variable() {
    let dir = tempfile::tempdir().expect("a folder");
    fs::write(dir.path().join("data.csv"), walk()).expect("writes");
    let args =
        ["discover", "data.csv", "--columns", "x,y,speed", "--vector", "place=x+y", "--method", "pcmci"];
    let found = model(dir.path(), &[&args[..], &["--test", "parcorrmult"]].concat());
    assert_eq!(found["features"], json!(["place", "speed"]));
    assert_eq!((&found["graph"][0][1][1], &found["graph"][1][0][1]), (&json!("-->"), &json!("")), "{found}");
    for (more, says) in [
        (&["--test", "parcorr"][..], "takes each variable for one column; choose --test parcorrmult"),
        (&["--method", "granger"], "takes each variable for one column; choose --test parcorrmult"),
        (&["--vector", "place"], "--vector: 'place' is not a vector; write it like place=x+y"),
        (&["--vector", "place=x+z"], "there is no column 'z'"),
        (&["--vector", "place=x+x"], "named twice"),
    ] {
        let args: Vec<&str> = match more[0] {
            "--vector" => [&args[..4], more, &["--method", "pcmci", "--test", "parcorrmult"]].concat(),
            "--method" => [&args[..6], more].concat(),
            _ => [&args[..], more].concat(),
        };
        let text = complaint(dir.path(), &args);
        assert!(text.contains(says) && text.trim_end().lines().count() == 1, "{more:?}: {text}");
    }
}

#[test]
fn gpdc_takes_null_distributions_that_are_given() {
    let dir = tempfile::tempdir().expect("a folder");
    fs::write(dir.path().join("data.csv"), walk()).expect("writes");
    // All values above what distance correlation can be: nothing is a link.
    fs::write(dir.path().join("null.csv"), "248\n2\n3\n").expect("writes");
    let args = ["discover", "data.csv", "--columns", "y,speed", "--method", "pcmci"];
    let own = model(dir.path(), &args);
    let given = model(dir.path(), &[&args[..], &["--null-dist", "null.csv"]].concat());
    assert_eq!((&own["graph"][0][1][1], &given["graph"][0][1][1]), (&json!("-->"), &json!("")));
    let text =
        complaint(dir.path(), &[&args[..], &["--null-dist", "null.csv", "--test", "parcorr"]].concat());
    assert!(text.contains("it applies to the test gpdc"), "{text}");
    let granger = ["discover", "data.csv", "--method", "granger", "--null-dist", "null.csv"];
    assert!(complaint(dir.path(), &granger).contains("granger uses no independence test"));
    fs::write(dir.path().join("null.csv"), "many\n2\n").expect("writes");
    let text = complaint(dir.path(), &[&args[..], &["--null-dist", "null.csv"]].concat());
    assert!(text.contains("'many' is not a number of samples"), "{text}");
}

#[test]
fn timino_sees_a_square_and_tsfci_the_marks_of_lpcmci() {
    let dir = tempfile::tempdir().expect("a folder");
    fs::write(dir.path().join("data.csv"), walk()).expect("writes");
    let timino = ["discover", "data.csv", "--columns", "speed,risk", "--method", "timino"];
    let found = model(dir.path(), &timino);
    assert_eq!(
        (&found["cond_ind_test"], &found["graph"][0][1][1]),
        (&json!("gpdc"), &json!("-->")),
        "{found}"
    );
    let line = model(dir.path(), &[&timino[..], &["--test", "parcorr"]].concat());
    assert!(line["warnings"].to_string().contains("undecided: speed, risk"), "{line}");
    for (more, says) in [
        (&["--test", "cmiknn"][..], "cmiknn is not a regression; take parcorr for linear effects"),
        (&["--fdr"], "timino has no p-values of single tests to correct"),
        (&["--tau-min", "0", "--tau-max", "0"], "0 leaves timino no past"),
    ] {
        let text = complaint(dir.path(), &[&timino[..], more].concat());
        assert!(text.contains(says) && text.trim_end().lines().count() == 1, "{more:?}: {text}");
    }
    let tsfci = ["discover", "data.csv", "--columns", "x,y,speed", "--method", "tsfci", "--test", "parcorr"];
    let found = model(dir.path(), &tsfci);
    assert_eq!(found["graph"][1][2][1], "o->", "{found}");
}

#[test]
fn a_setting_that_a_method_does_not_read_is_refused_with_the_methods_that_do() {
    let dir = tempfile::tempdir().expect("a folder");
    fs::write(dir.path().join("data.csv"), walk()).expect("writes");
    let orients = "it applies to pcmciplus and jpcmciplus";
    for (more, says) in [
        (&["--method", "lpcmci", "--collider-rule", "none"][..], orients),
        (&["--method", "granger", "--first-orientation"], orients),
        (
            &["--method", "granger", "--max-conds", "2"],
            "--max-conds: granger chooses no conditions; it applies to fpcmci, pcmci, ",
        ),
        (
            &["--method", "pcmci", "--max-sets", "2"],
            "--max-sets: pcmci has no such limit; it applies to lpcmci and candoit",
        ),
        (
            &["--method", "granger", "--pc-alpha", "0.1"],
            "--pc-alpha: granger chooses no conditions; it applies to fpcmci, pcmci, ",
        ),
        (&["--method", "pcmci", "--f-alpha", "0.1"], "--f-alpha: pcmci has no filter; it applies to fpcmci"),
        (&["--method", "pcmci", "--te-estimator", "gaussian"], "--te-estimator: pcmci has no filter"),
        (
            &["--method", "lpcmci", "--acts-on", "x=speed"],
            "--acts-on: lpcmci knows of no interventions; it applies to candoit",
        ),
        (
            &["--method", "pcmci", "--gp-restarts", "2"],
            "--gp-restarts: parcorr fits no Gaussian process; it applies to the test gpdc",
        ),
        (&["--method", "auto", "--take-it", "--f-alpha", "0.1"], "--f-alpha: lpcmci has no filter"),
        (&["--method", "lpcmci", "--max-sets", "0"], "--max-sets: 0 tests nothing"),
        (&["--method", "pcmci", "--shuffle-stop", "5"], "--shuffle-stop: parcorr has no such end"),
        (
            &["--method", "lpcmci", "--no-extra-conditions"],
            "--no-extra-conditions: lpcmci has no contexts of interventions; it applies to candoit",
        ),
    ] {
        let text = complaint(dir.path(), &[&["discover", "data.csv", "--test", "parcorr"], more].concat());
        assert!(text.contains(says) && text.trim_end().lines().count() == 1, "{more:?}: {text}");
    }
}

#[test]
fn settings_beside_the_data_are_taken_as_given_unless_the_user_names_a_method_that_does_not_read_them() {
    let dir = tempfile::tempdir().expect("a folder");
    fs::write(dir.path().join("data.csv"), walk()).expect("writes");
    let settings = "te-estimator = 'gaussian'\npc-alpha = 0.1\ngp-restarts = 1\nshuffles = 50\nsignificance = 'shuffle'\nalpha = 0.01\n";
    fs::write(dir.path().join("roscausal.toml"), settings).expect("writes");
    let args = ["discover", "data.csv", "--method", "granger", "--test", "parcorr"];
    assert_eq!(model(dir.path(), &args)["alpha"], 0.01);
    let out = roscausal(dir.path(), &args);
    let reported = String::from_utf8_lossy(&out.stderr).into_owned();
    assert!(reported.contains("settings of roscausal.toml: --alpha=0.01\n"), "{reported}");
    let settings = format!("method = 'granger'\n{settings}");
    fs::write(dir.path().join("roscausal.toml"), settings).expect("writes");
    let text = complaint(dir.path(), &["discover", "data.csv"]);
    assert!(text.contains("--pc-alpha: granger chooses no conditions"), "{text}");
}

#[test]
fn the_table_of_methods_is_printed() {
    let out = roscausal(Path::new("."), &["methods"]);
    let text = String::from_utf8_lossy(&out.stdout).into_owned();
    assert!(out.status.success() && out.stderr.is_empty(), "{text}");
    for method in ["fpcmci", "lpcmci", "tsfci", "timino"] {
        assert!(text.contains(&format!("{method}\n  says:  ")), "{method}: {text}");
    }
}
