//! `roscausal discover` as its users run it: what it prints, what it writes, and its errors.

#![allow(clippy::expect_used, clippy::panic, reason = "a test may panic: that is how it fails")]

mod common;

use std::{
    fs,
    path::Path,
    process::{Command, Stdio},
};

use common::roscausal;
use roscausal_fuzz::unit;
use serde_json::Value;
use tempfile::TempDir;

fn folder(file: &str, content: &str) -> TempDir {
    let dir = tempfile::tempdir().expect("a temporary folder");
    fs::write(dir.path().join(file), content).expect("writes");
    dir
}

/// `a` drives `b` one step later, with deterministic noise.
fn coupled(rows: usize) -> String {
    let mut state = 7_u64;
    let mut noise = || unit(&mut state) - 0.5;
    let (mut a, mut b) = (0.0, 0.0);
    let mut csv = "time,a,b\n".to_owned();
    for row in 0..rows {
        (a, b) = (0.4 * a + noise(), 0.3 * b + 0.8 * a + 0.5 * noise());
        csv += &format!("{},{a},{b}\n", row as f64 * 0.25);
    }
    csv
}

fn complaint(csv: &str, args: &[&str], code: i32) -> String {
    let dir = folder("data.csv", csv);
    let all: Vec<&str> = ["discover", "data.csv"].iter().chain(args).copied().collect();
    let out = roscausal(dir.path(), &all);
    let text = String::from_utf8_lossy(&out.stderr).into_owned();
    assert_eq!(out.status.code(), Some(code), "{text}");
    assert!(out.stdout.is_empty(), "stdout is for results");
    assert!(!text.contains("panicked"), "{text}");
    text
}

fn has(text: &str, words: &[&str]) {
    for word in words {
        assert!(text.contains(word), "'{word}' is missing in: {text}");
    }
}

#[test]
fn files_with_different_steps_are_refused_and_both_are_named() {
    let dir = folder("slow.csv", &coupled(100));
    fs::write(dir.path().join("fast.csv"), "time,a,b\n0,1,2\n0.1,2,1\n0.2,1,3\n").expect("writes");
    let out = roscausal(dir.path(), &["discover", "slow.csv", "fast.csv", "--test", "parcorr"]);
    let text = String::from_utf8_lossy(&out.stderr).into_owned();
    assert_eq!(out.status.code(), Some(1), "{text}");
    has(&text, &["fast.csv: its step is 0.1 s, that of slow.csv is 0.25 s"]);
}

#[test]
fn json_on_stdout_is_one_object_and_finds_the_link() {
    let dir = folder("data.csv", &coupled(300));
    let out = roscausal(
        dir.path(),
        &["discover", "data.csv", "--method", "pcmci", "--test", "parcorr", "--format", "json"],
    );
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let model: Value = serde_json::from_slice(&out.stdout).expect("JSON");
    assert_eq!(model["features"], serde_json::json!(["a", "b"]));
    assert_eq!(model["n_samples"], 298);
    assert_eq!(model["graph"][0][1][1], "-->");
    assert_eq!(model["graph"][1][0][1], "");
    assert_eq!(model["causal_structure"][0][1][0], 1);
    assert!((model["dt"].as_f64().expect("dt") - 0.25).abs() < 1e-9);
}

#[test]
fn the_links_come_as_dot_graphml_and_csv() {
    let dir = folder("data.csv", &coupled(300));
    let run = |format: &str| {
        let args = [
            "discover", "data.csv", "--method", "pcmci", "--test", "parcorr", "--format", format, "--out",
            "r",
        ];
        let out = roscausal(dir.path(), &args);
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        String::from_utf8_lossy(&out.stdout).into_owned()
    };
    let (dot, graphml, csv) = (run("dot"), run("graphml"), run("csv"));
    has(&dot, &["digraph causal_model {", "\"a\" -> \"b\" [label=\"1 · "]);
    has(&graphml, &["<graphml", "<node id=\"a\"/>", "source=\"a\" target=\"b\"><data key=\"lag\">1</data>"]);
    has(&csv, &["cause,effect,lag,value,p_value,mark,n_lost,p\n", "\na,b,1,"]);
    for (file, content) in [("model.dot", dot), ("model.graphml", graphml), ("links.csv", csv)] {
        assert_eq!(fs::read_to_string(dir.path().join("r").join(file)).expect("is there"), content, "{file}");
    }
}

#[test]
fn text_says_the_link_as_a_sentence() {
    let dir = folder("data.csv", &coupled(300));
    let out = roscausal(dir.path(), &["discover", "data.csv", "--test", "parcorr"]);
    has(
        &String::from_utf8_lossy(&out.stdout),
        &["a at t-1 (0.25 s earlier) drives b: strength 0.", "p < 0.001"],
    );
}

#[test]
fn out_holds_model_pictures_and_links() {
    let dir = folder("data.csv", &coupled(200));
    let out = roscausal(dir.path(), &["discover", "data.csv", "--test", "parcorr", "--out", "result"]);
    assert!(out.status.success());
    for file in ["model.json", "links.csv", "dag.svg", "dag.png", "tsdag.svg", "tsdag.png", "series_1.svg"] {
        assert!(dir.path().join("result").join(file).is_file(), "{file}");
    }
}

#[test]
fn any_number_of_threads_and_any_run_gives_the_same_bytes() {
    let dir = folder("data.csv", &coupled(150));
    let model = |out: &str, threads: &str| {
        let args = ["discover", "data.csv", "--test", "gpdc", "--out", out, "--threads", threads];
        assert!(roscausal(dir.path(), &args).status.success());
        fs::read(dir.path().join(out).join("model.json")).expect("a model")
    };
    let one = model("one", "1");
    assert_eq!(one, model("two", "2"));
    assert_eq!(one, model("again", "1"));
}

#[test]
fn a_p_value_is_never_shown_as_0_and_a_correction_is_named() {
    let dir = folder("data.csv", &coupled(300));
    for test in ["parcorr", "gpdc"] {
        let args = ["discover", "data.csv", "--test", test, "--fdr", "fdr_bh", "--out", "r"];
        let out = roscausal(dir.path(), &args);
        let text = String::from_utf8_lossy(&out.stdout);
        has(&text, &["corrected by fdr_bh", if test == "gpdc" { "<0.002" } else { "<0.001" }]);
        assert!(!text.contains("0.0000"), "{text}");
        let links = fs::read_to_string(dir.path().join("r/links.csv")).expect("is there");
        assert!(links.lines().skip(1).any(|line| line.contains(",<0.00")), "{links}");
    }
}

#[test]
fn a_result_is_printed_even_if_its_folder_cannot_be_written() {
    let dir = folder("data.csv", &coupled(300));
    fs::write(dir.path().join("taken"), "a file").expect("writes");
    let out = roscausal(dir.path(), &["discover", "data.csv", "--test", "parcorr", "--out", "taken"]);
    assert_eq!(out.status.code(), Some(1));
    has(&String::from_utf8_lossy(&out.stdout), &["drives b"]);
    has(&String::from_utf8_lossy(&out.stderr), &["taken"]);
}

#[test]
fn a_reader_that_has_gone_ends_nothing_and_hears_of_no_panic() {
    let dir = folder("data.csv", &coupled(300));
    for format in ["text", "json"] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_roscausal"));
        command.current_dir(dir.path()).args(["discover", "data.csv", "--test", "parcorr", "--out", format]);
        command.args(["--format", format]).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().expect("starts");
        drop(child.stdout.take());
        let out = child.wait_with_output().expect("ends");
        let told = String::from_utf8_lossy(&out.stderr);
        assert!(out.status.success() && !told.contains("panicked"), "{told}");
        assert!(dir.path().join(format).join("model.json").is_file());
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_behind_the_output_is_one_sentence() {
    let dir = folder("data.csv", &coupled(300));
    for format in ["text", "json"] {
        let full = fs::OpenOptions::new().write(true).open("/dev/full").expect("is there");
        let mut command = Command::new(env!("CARGO_BIN_EXE_roscausal"));
        command
            .current_dir(dir.path())
            .args(["discover", "data.csv", "--test", "parcorr", "--format", format]);
        let out = command.stdout(full).output().expect("ends");
        let told = String::from_utf8_lossy(&out.stderr);
        assert_eq!(out.status.code(), Some(1), "{told}");
        has(&told, &["error: the results cannot be written to the standard output: No space left"]);
        assert!(!told.contains("panicked"), "{told}");
    }
}

#[test]
fn bad_files_are_named_with_line_and_column_and_the_way_out() {
    has(&complaint("", &[], 1), &["data.csv", "empty"]);
    has(&complaint("a,b\n", &[], 1), &["data.csv", "only a header"]);
    has(&complaint("a,b\n1,2\nfast,3\n", &[], 1), &["line 3", "'a'", "fast", "--columns"]);
    has(&complaint("a,b\n1,2\n3\n", &[], 1), &["line 3", "1 cell"]);
    for end in ["\n", "\r\n", "\r"] {
        let text = ["a,b", "1,2", "", "1,3", "fast,3", ""].join(end);
        has(&complaint(&text, &[], 1), &["line 5", "'a'", "fast"]);
    }
    has(&complaint("a,b,a\n1,2,3\n", &[], 1), &["column 1", "column 3", "'a'"]);
    has(&complaint("time,a,b\n1,1,1\n0,1,2\n", &[], 1), &["line 3", "time goes back"]);
    has(&complaint("a,b\n1,2\n2,3\n3,1\n", &["--test", "parcorr"], 1), &["samples", "needs at least"]);
    has(&complaint("a\n1\n2\n", &[], 1), &["one variable", "two"]);
    let missing = roscausal(Path::new("."), &["discover", "no_such.csv"]);
    assert_eq!(missing.status.code(), Some(1));
    has(&String::from_utf8_lossy(&missing.stderr), &["no_such.csv"]);
}

#[test]
fn a_pointer_a_web_page_and_an_archive_are_named_whatever_their_name() {
    let lfs = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 123456\n";
    for (content, told) in [
        (lfs, "Git LFS pointer to a file of 123456 bytes, not the file; get it with 'git lfs pull'"),
        ("<!DOCTYPE html>\n<html><body>404</body></html>", "this is a web page"),
        ("PK\u{3}\u{4}", "a ZIP archive"),
    ] {
        for name in ["demo.bag", "demo.mcap", "demo.csv"] {
            let dir = folder(name, content);
            let out = roscausal(dir.path(), &["discover", name]);
            assert_eq!(out.status.code(), Some(1));
            has(&String::from_utf8_lossy(&out.stderr), &[name, told]);
        }
    }
    let dir = folder("demo.bag", "");
    has(
        &String::from_utf8_lossy(&roscausal(dir.path(), &["discover", "demo.bag"]).stderr),
        &["the file is empty"],
    );
}

#[test]
fn unknown_names_get_the_nearest_one() {
    let data = coupled(50);
    has(&complaint(&data, &["--method", "pcmcy"], 2), &["pcmcy", "did you mean 'pcmci'"]);
    has(&complaint(&data, &["--test", "parcor"], 2), &["parcor", "did you mean 'parcorr'"]);
    has(
        &complaint("speed,goal\n1,2\n2,3\n", &["--columns", "sped,goal"], 2),
        &["sped", "did you mean 'speed'"],
    );
}

#[test]
fn numbers_out_of_range_are_bad_usage() {
    let data = coupled(50);
    for args in [
        ["--alpha", "0"],
        ["--alpha", "1.5"],
        ["--alpha", "nan"],
        ["--pc-alpha", "2"],
        ["--pc-alpha", "x"],
        ["--fdr", "maybe"],
        ["--time-budget", "0"],
    ] {
        has(&complaint(&data, &args, 2), &[args[0].trim_start_matches('-')]);
    }
    has(&complaint(&data, &["--tau-min", "3", "--tau-max", "1"], 2), &["tau"]);
}

#[test]
fn missing_cells_and_constant_columns_are_told_and_survived() {
    let data = coupled(200);
    let rows: Vec<String> = data
        .lines()
        .enumerate()
        .map(|(i, line)| match i {
            0 => "time,a,b,c".to_owned(),
            2 => "0.25,,NaN,1".to_owned(),
            _ => format!("{line},1"),
        })
        .collect();
    let dir = folder("data.csv", &rows.join("\n"));
    let out = roscausal(
        dir.path(),
        &["discover", "data.csv", "--method", "pcmci", "--test", "parcorr", "--format", "json"],
    );
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let text = String::from_utf8_lossy(&out.stdout);
    let model: Value = serde_json::from_str(&text).expect("JSON");
    has(&model["warnings"].to_string(), &["'a': 1 of 200", "'c' is constant"]);
    assert_eq!(model["graph"][0][1][1], "-->");
    assert_eq!(model["graph"][2][1][1], "");
    assert_eq!(model["p_matrix"][2][1][1], 1.0);
}

#[test]
fn a_test_of_categories_says_that_measurements_are_none() {
    let dir = tempfile::tempdir().expect("a folder");
    let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0);
    let lines: String = (0..200)
        .map(|i| format!("{},{}\n", noise(2 * i), f64::from(u8::from(noise(2 * i + 1) > 0.5))))
        .collect();
    std::fs::write(dir.path().join("data.csv"), format!("level,light\n{lines}")).expect("writes");
    let output = roscausal(dir.path(), &["discover", "data.csv", "--method", "pcmci", "--test", "gsquared"]);
    let text =
        format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(text.contains("'level' has 200 different values in 200 samples"), "{text}");
    assert!(text.contains("gsquared is for categories") && !text.contains("'light' has"), "{text}");
}
