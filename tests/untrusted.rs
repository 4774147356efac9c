//! Files of others, as every command reads them: models, evidence, graphs, and what is known of links. Each that is not whole is one
//! sentence on stderr.

#![allow(clippy::expect_used, clippy::panic, reason = "a test may panic: that is how it fails")]

mod common;

use std::{
    fs,
    path::Path,
    time::{Duration, Instant},
};

use common::roscausal;
use roscausal_fuzz::unit;
use serde_json::{Value, json};
use tempfile::TempDir;

/// A folder with data in which `a` drives `b` and `b` drives `c`, and a model of it.
fn folder() -> (TempDir, Value) {
    let dir = tempfile::tempdir().expect("a temporary folder");
    let mut state = 7_u64;
    let mut noise = || unit(&mut state) - 0.5;
    let (mut a, mut b) = (0.0, 0.0);
    let mut csv = "a,b,c\n".to_owned();
    for _ in 0..300 {
        let c = 0.8 * b + noise();
        (b, a) = (0.7 * a + noise(), 0.3 * a + noise());
        csv += &format!("{a},{b},{c}\n");
    }
    fs::write(dir.path().join("ok.csv"), csv).expect("writes");
    let args =
        ["discover", "ok.csv", "--method", "pcmci", "--test", "parcorr", "--out", "o", "--format", "json"];
    let out = roscausal(dir.path(), &args);
    (dir, serde_json::from_slice(&out.stdout).expect("a model"))
}

/// Runs the command, which is to refuse its input, and gives what it says.
fn refused(dir: &Path, args: &[&str]) -> String {
    let out = roscausal(dir, args);
    let stated = String::from_utf8_lossy(&out.stderr).into_owned();
    assert!(matches!(out.status.code(), Some(1 | 2)), "{args:?}: {stated}");
    assert_eq!(stated.lines().count(), 1, "{args:?}: {stated}");
    assert!(stated.len() < 1000 && !stated.contains("panicked"), "{args:?}: {stated}");
    stated
}

#[test]
fn every_command_checks_a_model_and_says_the_same() {
    let (dir, model) = folder();
    let dir = dir.path();
    let commands: [&[&str]; 8] = [
        &["show", "m.json"],
        &["report", "m.json"],
        &["compare", "o/model.json", "m.json"],
        &["compare", "m.json", "o/model.json"],
        &["predict", "m.json", "--data", "ok.csv"],
        &["whatif", "m.json", "--data", "ok.csv", "--action", "up: a=0.2"],
        &["effect", "m.json", "--data", "ok.csv", "--cause", "a", "--effect", "b"],
        &["explain", "m.json", "--data", "ok.csv", "--variable", "b"],
    ];
    let with = |field: &str, value: Value| {
        let mut model = model.clone();
        model[field] = value;
        model.to_string()
    };
    for (reported, text) in [
        ("this program reads 'roscausal/model/2'", with("schema", json!("roscausal/model/3"))),
        ("1000000000 is above 100000", with("tau_max", json!(1_000_000_000))),
        ("expected a whole number from 0 on", with("tau_max", json!(-1))),
        ("'a' is there twice", with("features", json!(["a", "a", "c"]))),
        ("val_matrix is not of the size", with("val_matrix", json!([]))),
        ("links has it not", with("links", json!([]))),
        ("number out of range", model.to_string().replacen("\"alpha\":0.05", "\"alpha\":1e999", 1)),
        ("nests deeper than 64", format!("{{\"schema\": {}", "[".repeat(100_000))),
    ] {
        fs::write(dir.join("m.json"), text).expect("writes");
        for command in commands {
            let stated = refused(dir, command);
            assert!(stated.contains(reported) && stated.contains("m.json"), "{command:?}: {stated}");
        }
    }
    // Models of other variables and lags can still be compared.
    let args = [
        "discover", "ok.csv", "--columns", "a,b", "--tau-max", "3", "--method", "pcmci", "--test", "parcorr",
    ];
    assert!(roscausal(dir, &[&args[..], &["--out", "two"]].concat()).status.success());
    let out = roscausal(dir, &["compare", "o/model.json", "two/model.json", "--out", "differences"]);
    assert!(
        out.status.success() && String::from_utf8_lossy(&out.stdout).contains("lags: 1..1, 1..3"),
        "{out:?}"
    );
}

#[test]
fn a_report_checks_the_evidence_beside_a_model() {
    let (dir, _) = folder();
    let evidence = dir.path().join("o/evidence.json");
    fs::write(&evidence, "{\"schema\": \"roscausal/evidence/2\"}").expect("writes");
    let stated = refused(dir.path(), &["report", "o/model.json"]);
    assert!(stated.contains("evidence.json") && stated.contains("'roscausal/evidence/1'"), "{stated}");
}

#[test]
fn a_graph_of_a_person_is_checked_as_a_model_is() {
    let (dir, _) = folder();
    let ab = r#"{"cause": "a", "effect": "b", "lag": 1}"#;
    for (reported, graph) in [
        ("there twice", format!("{{\"links\": [{ab}, {ab}]}}")),
        ("has no name", r#"{"links": [{"cause": "", "effect": "b", "lag": 1}]}"#.to_owned()),
        ("there twice", format!("{{\"variables\": [\"a\", \"b\", \"a\"], \"links\": [{ab}]}}")),
        ("too large", r#"{"links": [{"cause": "a", "effect": "b", "lag": 4611686018427387904}]}"#.to_owned()),
        ("from 0 on", r#"{"links": [{"cause": "a", "effect": "b", "lag": -1}]}"#.to_owned()),
        ("'<->' at lag 1", r#"{"links": [{"cause": "a", "effect": "b", "lag": 1, "mark": "<->"}]}"#.to_owned()),
        ("circle", r#"{"links": [{"cause": "a", "effect": "b", "lag": 0}, {"cause": "b", "effect": "a", "lag": 0}]}"#.to_owned()),
        ("there twice", r#"{"links": [{"cause": "a", "effect": "b", "lag": 0}, {"cause": "b", "effect": "a", "lag": 0, "mark": "o-o"}]}"#.to_owned()),
        ("above 0", format!("{{\"dt\": 1e300, \"links\": [{ab}]}}")),
        ("units has 'z'", format!("{{\"units\": {{\"z\": \"m\"}}, \"links\": [{ab}]}}")),
        ("unknown field", format!("{{\"nodes\": 3, \"links\": [{ab}]}}")),
        ("nests deeper than 64", format!("{{\"links\": {}", "[".repeat(100_000))),
    ] {
        fs::write(dir.path().join("g.json"), &graph).expect("writes");
        let stated = refused(dir.path(), &["effect", "g.json", "--data", "ok.csv", "--cause", "a", "--effect", "b"]);
        assert!(stated.contains(reported) && stated.contains("g.json"), "{graph}: {stated}");
    }
}

/// One rule of a file of links.
fn rule(cause: &str, effect: &str, lags: &str, is: &str) -> String {
    let lags = if lags.is_empty() { String::new() } else { format!("lags = {lags}\n") };
    format!("[[link]]\ncause = \"{cause}\"\neffect = \"{effect}\"\n{lags}is = \"{is}\"\n")
}

#[test]
fn knowledge_that_cannot_be_is_refused_with_its_lines_at_once() {
    let (dir, _) = folder();
    let dir = dir.path();
    let two = |one: [&str; 4], other: [&str; 4]| {
        rule(one[0], one[1], one[2], one[3]) + &rule(other[0], other[1], other[2], other[3])
    };
    let (lines, no): (&[&str], &[&str]) = (&["line 1", "line 6"], &[]);
    let cases: Vec<(&str, &[&str], String, &[&str])> = vec![
        ("forbidden", lines, two(["a", "b", "[1]", "required"], ["a", "b", "[1]", "forbidden"]), no),
        ("forbidden", lines, two(["a", "b", "[1]", "forbidden"], ["a", "b", "[1]", "required"]), no),
        (
            "forbidden",
            &["line 1", "line 5"],
            two(["a", "b", "", "required"], ["*", "b", "", "forbidden"]),
            no,
        ),
        ("forbidden", lines, two(["a", "b", "[1]", "allowed"], ["a", "b", "[1]", "forbidden"]), no),
        ("forbidden", lines, two(["a", "b", "[1]", "required"], ["b", "a", "[1]", "directed"]), no),
        (
            "circle",
            lines,
            two(["a", "b", "[0]", "required"], ["b", "a", "[0]", "required"]),
            &["--tau-min", "0"],
        ),
        ("exogenous", &["line 1"], rule("a", "c", "[1]", "required"), &["--exogenous", "c"]),
        ("no variable 'd'", &["line 1"], rule("a", "d", "[1]", "required"), no),
        ("lags are 1, 2, ...", &["line 1"], rule("a", "b", "[-1]", "required"), no),
        ("lag 3 is not among the lags 1 to 1", &["line 1"], rule("a", "b", "[3]", "required"), no),
        ("expected a whole number", &["line 4"], rule("a", "b", "[1.5]", "required"), no),
        ("unknown variant `maybe`", &["line 5"], rule("a", "b", "[1]", "maybe"), no),
        ("unknown field `when`", &["line"], rule("a", "b", "[1]", "required") + "when = 3\n", no),
        ("missing field `is`", &["line"], "[[link]]\ncause = \"a\"\neffect = \"b\"\n".to_owned(), no),
        ("nests deeper than 64", &["line 1"], format!("a={}", "[".repeat(100_000)), no),
        ("nests deeper than 64", &["line 1"], format!("a={}", "{a=".repeat(100_000)), no),
        ("nests deeper than 64", &["line 1"], format!("{}a = 1", "a.".repeat(100_000)), no),
        ("nests deeper than 64", &["line 1"], format!("[{}a]", "a.".repeat(100_000)), no),
        ("larger than 1 MB", no, "# \n".repeat(1 << 20), no),
        ("not text", no, String::new(), no),
    ];
    for (reported, where_, text, flags) in cases {
        let bytes = if reported == "not text" { vec![0xff; 9] } else { text.clone().into_bytes() };
        fs::write(dir.join("links.toml"), bytes).expect("writes");
        let method = if flags.contains(&"0") { "pcmciplus" } else { "pcmci" };
        let start = ["discover", "ok.csv", "--method", method, "--test", "parcorr", "--links", "links.toml"];
        let began = Instant::now();
        let stated = refused(dir, &[&start[..], flags].concat());
        let shown = text.get(..200).unwrap_or(&text);
        let names_it = stated.contains("links.toml") || stated.contains("--links");
        assert!(stated.contains(reported) && names_it, "{shown}: {stated}");
        assert!(where_.iter().all(|word| stated.contains(word)), "{shown}: {stated}");
        assert!(began.elapsed() < Duration::from_secs(5), "{shown}: {:?}", began.elapsed());
    }
}
