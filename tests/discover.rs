//! `roscausal discover` as its users run it: what it prints, what it writes, and its errors.

#![allow(clippy::expect_used, clippy::panic, reason = "a test may panic: that is how it fails")]

mod common;

use std::{
    fs,
    io::{BufRead, BufReader},
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
    has(
        &csv,
        &["cause,effect,lag,value,p_value,mark,n_lost,p,confidence,value_low,value_high\n", "\na,b,1,"],
    );
    for (file, content) in [("model.dot", dot), ("model.graphml", graphml), ("links.csv", csv)] {
        assert_eq!(fs::read_to_string(dir.path().join("r").join(file)).expect("is there"), content, "{file}");
    }
}

#[test]
fn resamples_give_each_link_a_word_a_share_and_an_interval() {
    let dir = folder("data.csv", &coupled(300));
    let usual = ["discover", "data.csv", "--method", "pcmci", "--test", "parcorr"];
    let run = |more: &[&str]| roscausal(dir.path(), &[&usual[..], more].concat());
    let out = run(&["--resamples", "40", "--out", "r", "--resample-out", "graphs.jsonl"]);
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let text = String::from_utf8_lossy(&out.stdout).into_owned();
    has(
        &text,
        &[
            " drives b: strength 0.",
            "firm: in 40 of 40 resamples",
            "found: share of 40 subsamples",
            "hidden common cause",
        ],
    );
    let graphs = fs::read_to_string(dir.path().join("graphs.jsonl")).expect("is there");
    assert_eq!(graphs.lines().count(), 40);
    let last: Value = serde_json::from_str(graphs.lines().last().expect("a line")).expect("JSON");
    assert_eq!(
        (&last["resample"], &last["graph"][0][1][1]),
        (&serde_json::json!(39), &serde_json::json!("-->"))
    );
    let model: Value =
        serde_json::from_slice(&fs::read(dir.path().join("r/model.json")).expect("is there")).expect("JSON");
    assert_eq!(model["resampling"]["done"], 40);
    assert_eq!(model["links"][0]["confidence"], 1.0);
    let csv = fs::read_to_string(dir.path().join("r/links.csv")).expect("is there");
    assert!(csv.lines().nth(1).is_some_and(|row| row.split(',').nth(8) == Some("1.0")), "{csv}");
    for (more, says) in [
        (&["--resamples", "19"][..], "--resamples: 19 is not from 20 to 10000"),
        (&["--share", "0.5"], "--share: it is for --resamples"),
        (&["--resamples", "50", "--share", "1"], "--share: 1 is not between 0 and 1"),
        (&["--resamples", "50", "--block", "400"], "--block: blocks of 400 rows are as long as recording 1"),
    ] {
        let out = run(more);
        let error = String::from_utf8_lossy(&out.stderr).into_owned();
        assert!(!out.status.success() && error.contains(says), "{more:?}: {error}");
    }
}

#[test]
fn roll_prints_windows_and_events_as_they_come() {
    // a drives b in the first half only.
    let mut state = 7_u64;
    let mut noise = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / f64::from(1_u32 << 31) - 0.5
    };
    let (mut text, mut a) = (String::from("a,b\n"), 0.0);
    for t in 0..1600 {
        let b = if t < 800 { 0.9 * a } else { 0.0 } + noise();
        a = noise();
        text += &format!("{a},{b}\n");
    }
    let dir = folder("data.csv", &text);
    let usual = ["roll", "data.csv", "--method", "pcmci", "--test", "parcorr", "--alpha", "0.001"];
    let run = |more: &[&str]| roscausal(dir.path(), &[&usual[..], more].concat());
    let out = run(&["--batch", "400", "--changes", "--format", "jsonl", "--out", "r"]);
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let lines: Vec<Value> = String::from_utf8_lossy(&out.stdout)
        .lines()
        .map(|line| serde_json::from_str(line).expect("JSON"))
        .collect();
    assert_eq!(lines[0]["schema"], "roscausal/rolling/1");
    let confirmed: Vec<&Value> =
        lines.iter().map(|line| &line["event"]).filter(|event| event["status"] == "confirmed").collect();
    assert_eq!(confirmed.len(), 1, "{lines:?}");
    assert_eq!((&confirmed[0]["cause"], &confirmed[0]["kind"]), (&"a".into(), &"vanished".into()));
    let windows: Vec<&Value> = lines.iter().map(|line| &line["window"]).filter(|w| w.is_object()).collect();
    let has_link = |window: &&&Value| window["graph"][0][1][1] == "-->";
    assert_eq!((windows.len(), windows.iter().filter(has_link).count()), (4, 2));
    let rolling: Value =
        serde_json::from_slice(&fs::read(dir.path().join("r/rolling.json")).expect("is there"))
            .expect("JSON");
    assert_eq!((&rolling["links"][0]["found"], &rolling["links"][0]["of"]), (&2.into(), &4.into()));
    let picture = fs::read_to_string(dir.path().join("r/strip.svg")).expect("is there");
    assert!(picture.contains("class=\"change\""));
    let text = String::from_utf8_lossy(&run(&["--batch", "400"]).stdout).into_owned();
    has(&text, &["rows 0 to 400: a -> b (1)", "a -> b at lag 1: found in 2 of 4 windows"]);
    let error = String::from_utf8_lossy(&run(&["--window", "1700"]).stderr).into_owned();
    has(&error, &["1700 rows leave no window in 1600 rows"]);
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
    for file in [
        "model.json",
        "links.csv",
        "dag.svg",
        "dag.png",
        "dag.pdf",
        "tsdag.svg",
        "tsdag.png",
        "tsdag.pdf",
        "series_1.svg",
    ] {
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
fn a_result_is_printed_even_if_a_file_cannot_be_written() {
    let dir = folder("data.csv", &coupled(300));
    fs::create_dir_all(dir.path().join("taken/model.json/is/a/folder")).expect("makes");
    let out =
        roscausal(dir.path(), &["discover", "data.csv", "--test", "parcorr", "--out", "taken", "--force"]);
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

#[cfg(target_os = "linux")]
#[test]
fn help_that_cannot_be_written_is_one_sentence_and_a_failure() {
    for args in [&["--help"][..], &["discover", "--help"], &["help", "replay"], &["--version"]] {
        let run = |out: Stdio| {
            Command::new(env!("CARGO_BIN_EXE_roscausal")).args(args).stdout(out).output().expect("ends")
        };
        let full = fs::OpenOptions::new().write(true).open("/dev/full").expect("is there");
        let out = run(full.into());
        let told = String::from_utf8_lossy(&out.stderr);
        assert_eq!(out.status.code(), Some(1), "{args:?}: {told}");
        has(&told, &["error: the results cannot be written to the standard output: No space left"]);
        assert_eq!(told.lines().count(), 1, "{told}");
        let out = run(Stdio::piped());
        assert!(out.status.success() && out.stderr.is_empty(), "{args:?}");
        assert!(out.stdout.starts_with(b"roscausal ") || out.stdout.windows(6).any(|at| at == b"Usage:"));
        assert!(!out.stdout.contains(&0x1b), "{args:?}");
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
fn an_analysis_that_cannot_end_is_refused_before_it_starts_with_what_would_fit() {
    let rows: String = (0..120_000_i64).map(|i| format!("{},{}\n", i * 7 % 1013, i * i % 977)).collect();
    let told = complaint(&format!("a,b\n{rows}"), &["--max-memory", "2000"], 1);
    has(
        &told,
        &[
            "120000 rows of 2 variables would take",
            "of memory, and 2.0 GB are free",
            "--test parcorr",
            "fewer rows (at most",
        ],
    );
    let told = complaint(&format!("a,b\n{rows}"), &["--max-memory", "9000000", "--threads", "1"], 1);
    has(&told, &["would take about", "days", "--rows"]);
}

/// Starts an analysis that takes minutes, sends it SIGINT, and returns how it ended.
#[cfg(unix)]
#[test]
fn ctrl_c_ends_an_analysis_with_code_130_and_fitting_words() {
    let dir = folder("data.csv", &coupled(6000));
    let mut command = Command::new(env!("CARGO_BIN_EXE_roscausal"));
    command
        .current_dir(dir.path())
        .args(["discover", "data.csv", "--method", "pcmci", "--out", "r", "--force"]);
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("starts");
    // Its own words say that it is at work.
    let mut lines = BufReader::new(child.stderr.take().expect("piped")).lines();
    let mut told = String::new();
    while !told.contains("this will take about") {
        told += &lines.next().unwrap_or_else(|| panic!("it ended: {told}")).expect("text");
    }
    let kill = Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("kill is there");
    assert!(kill.success());
    lines.map_while(Result::ok).for_each(|line| told += &line);
    let out = child.wait_with_output().expect("ends");
    assert_eq!(out.status.code(), Some(130), "{told}");
    has(&told, &["ending; there is no result yet, and nothing is written"]);
    assert!(!told.contains("recorded") && out.stdout.is_empty(), "{told}");
}

#[test]
fn an_empty_column_is_told_first_and_left_out_when_asked() {
    let rows: String = coupled(300).lines().skip(1).map(|line| format!("{line},\n")).collect();
    let data = format!("time,a,b,h_dg\n{rows}");
    for args in [&[][..], &["--method", "pcmci", "--test", "parcorr"]] {
        has(&complaint(&data, args, 1), &["h_dg has no value at all", "--drop-empty goes on without"]);
    }
    let dir = folder("data.csv", &data);
    let args = ["discover", "data.csv", "--test", "parcorr", "--drop-empty", "--format", "json"];
    let model: Value = serde_json::from_slice(&roscausal(dir.path(), &args).stdout).expect("JSON");
    assert_eq!(model["links"][0]["cause"], "a");
    has(&model["warnings"].to_string(), &["left out, without any number: h_dg"]);
}

#[test]
fn a_window_of_rows_is_analysed() {
    let dir = folder("data.csv", &coupled(300));
    let samples = |rows: &str| {
        let args = [
            "discover", "data.csv", "--method", "pcmci", "--test", "parcorr", "--format", "json", "--rows",
            rows,
        ];
        let out = roscausal(dir.path(), &args);
        serde_json::from_slice::<Value>(&out.stdout)
            .map(|model| model["n_samples"].clone())
            .unwrap_or_default()
    };
    assert_eq!(
        [samples("101..200"), samples("..50"), samples("251..")],
        [98.into(), 48.into(), Value::from(48)]
    );
    has(&complaint(&coupled(50), &["--rows", "60.."], 2), &["--rows: there are no such rows"]);
}

#[test]
fn out_is_checked_before_the_work_and_files_of_others_are_left_alone() {
    let dir = folder("data.csv", &coupled(200));
    fs::create_dir(dir.path().join("mine")).expect("makes");
    fs::write(dir.path().join("mine/thesis.txt"), "words").expect("writes");
    let run = |out: &str, more: &[&str]| {
        let args = [&["discover", "data.csv", "--test", "parcorr", "-o", out][..], more].concat();
        let out = roscausal(dir.path(), &args);
        (out.status.code(), String::from_utf8_lossy(&out.stderr).into_owned(), out.stdout.is_empty())
    };
    let (code, told, silent) = run("mine", &[]);
    assert!(code == Some(1) && silent, "{told}");
    has(&told, &["there are files of others in this folder", "--force"]);
    assert!(!dir.path().join("mine/model.json").exists());
    assert_eq!(run("mine", &["--force"]).0, Some(0));
    assert!(dir.path().join("mine/thesis.txt").exists());
    // Our own folder may be written again.
    assert_eq!([run("new", &[]).0, run("new", &[]).0, run("mine", &[]).0], [Some(0); 3]);
    let (code, told, silent) = run("data.csv", &[]);
    assert!(code == Some(1) && silent, "{told}");
    has(&told, &["data.csv", "no results can be written here"]);
}

#[test]
fn data_that_no_analysis_should_take_are_refused_with_the_way_out() {
    let data = coupled(200);
    let with = |change: &dyn Fn(usize, &str) -> String| {
        let rows: Vec<String> = data.lines().skip(1).enumerate().map(|(i, line)| change(i, line)).collect();
        rows.join("\n")
    };
    let flagged = with(&|i, line| match (i % 20, line.rsplit_once(',')) {
        (3, Some((rest, _))) => format!("{rest},-999"),
        _ => line.to_owned(),
    });
    let flagged = format!("time,a,b\n{flagged}");
    let told = complaint(&flagged, &["--test", "parcorr"], 1);
    has(&told, &["b is -999 in 10 rows", "--missing-value=-999", "--missing-value=none"]);
    let dir = folder("data.csv", &flagged);
    for value in ["-999", "none"] {
        let out =
            roscausal(dir.path(), &["discover", "data.csv", "--test", "parcorr", "--missing-value", value]);
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    }
    let copied = with(&|_, line| {
        format!("{line},{}", 2.0 * line.rsplit_once(',').map_or(0.0, |(_, b)| b.parse().unwrap_or(0.0)))
    });
    let told = complaint(&format!("time,a,b,twice_b\n{copied}"), &["--test", "parcorr"], 1);
    has(&told, &["b and twice_b say the same", "--columns '!twice_b'"]);
    let dir = folder("data.csv", &data);
    let out = roscausal(dir.path(), &["discover", "data.csv", "./data.csv", "--test", "parcorr"]);
    assert_eq!(out.status.code(), Some(1));
    has(&String::from_utf8_lossy(&out.stderr), &["data.csv and ./data.csv hold the same rows"]);
}

#[test]
fn what_the_data_are_like_is_printed_and_stored_in_the_model() {
    let few: String = coupled(7).lines().map(|line| format!("{line}\n")).collect();
    let dir = folder("data.csv", &few);
    let quick = ["discover", "data.csv", "--method", "pcmci", "--test", "parcorr"];
    has(
        &String::from_utf8_lossy(&roscausal(dir.path(), &quick).stdout),
        &["About the data: only 5 samples", "record longer"],
    );
    let rows: Vec<String> = coupled(400)
        .lines()
        .enumerate()
        .map(|(i, line)| match i {
            0 => format!("{line},clock"),
            _ => format!("{line},{}", i as f64 * 0.37 + (i % 7) as f64),
        })
        .collect();
    let dir = folder("data.csv", &rows.join("\n"));
    let model: Value =
        serde_json::from_slice(&roscausal(dir.path(), &[&quick[..], &["--format", "json"]].concat()).stdout)
            .expect("JSON");
    has(&model["about_data"]["remarks"].to_string(), &["clock drifts"]);
    assert_eq!(model["about_data"]["variables"][0]["name"], "a");
    assert!(model["about_data"]["variables"][2]["kpss"].as_f64().is_some_and(|statistic| statistic > 1.0));
}

const QUICK: [&str; 6] = ["discover", "data.csv", "--method", "pcmci", "--test", "parcorr"];

fn json(dir: &Path, more: &[&str]) -> Value {
    let out = roscausal(dir, &[&QUICK[..], &["--format", "json"], more].concat());
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    serde_json::from_slice(&out.stdout).expect("JSON")
}

#[test]
fn what_is_known_of_links_is_kept() {
    let dir = folder("data.csv", &coupled(300));
    let rules = "[[link]]\ncause = 'a'\neffect = 'b'\nis = 'forbidden'\n[[link]]\ncause = 'b'\neffect = 'a'\nis = 'required'\n";
    fs::write(dir.path().join("links.toml"), rules).expect("writes");
    let model = json(dir.path(), &["--links", "links.toml"]);
    assert_eq!((&model["graph"][0][1][1], &model["graph"][1][0][1]), (&"".into(), &"-->".into()));
    assert_eq!(model["p_matrix"][1][0][1], 0.0);
    fs::write(dir.path().join("links.toml"), rules.replace("'b'", "'c'")).expect("writes");
    let out = roscausal(dir.path(), &[&QUICK[..], &["--links", "links.toml"]].concat());
    has(&String::from_utf8_lossy(&out.stderr), &["links.toml: there is no variable 'c'", "variables: a, b"]);
}

#[test]
fn how_a_test_decides_can_be_said() {
    let dir = folder("data.csv", &coupled(300));
    let shuffled = json(dir.path(), &["--significance", "shuffle", "--shuffles", "100"]);
    // (k + 1) / (100 + 1)
    let p = shuffled["p_matrix"][1][0][1].as_f64().expect("a p-value");
    assert!((p * 101.0 - (p * 101.0).round()).abs() < 1e-9, "{p}");
    assert_eq!(json(dir.path(), &["--max-conds", "0"])["graph"][0][1][1], "-->");
    has(
        &complaint(&coupled(50), &["--significance", "shufle"], 2),
        &["--significance", "did you mean 'shuffle'"],
    );
    has(&complaint(&coupled(50), &["--collider-rule", "maybe"], 2), &["--collider-rule", "majority"]);
}

#[test]
fn fewer_shuffles_than_the_level_needs_are_refused() {
    let few = |more: &[&str]| {
        let args = ["--test", "parcorr", "--significance", "shuffle", "--method"];
        complaint(&coupled(200), &[&args[..], more].concat(), 2)
    };
    has(
        &few(&["pcmci+", "--shuffles", "50"]),
        &["--shuffles", "0.0196", "level 0.01", "at least 100", "--pc-alpha"],
    );
    has(&few(&["pcmci", "--shuffles", "10"]), &["0.0909", "level 0.05", "at least 20", "--alpha"]);
}

#[test]
fn a_column_that_chooses_rows_need_not_be_a_variable() {
    let mut csv = "a,b,c,pause\n".to_owned();
    for (row, line) in coupled(300).lines().skip(1).enumerate() {
        let cells: Vec<&str> = line.split(',').skip(1).collect();
        csv += &format!("{},{},{}\n", cells.join(","), (row * 7 % 31), u8::from(row % 10 < 3));
    }
    let dir = folder("data.csv", &csv);
    for choice in [&["--mask", "pause"][..], &["--where", "pause < 0.5 and c >= 0"]] {
        for columns in ["a,b", "!c,!pause"] {
            let args = ["discover", "data.csv", "--method", "pcmci", "--test", "parcorr", "--format", "json"];
            let out = roscausal(dir.path(), &[&args[..], &["--columns", columns], choice].concat());
            assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
            let model: Value = serde_json::from_slice(&out.stdout).expect("JSON");
            assert_eq!(model["features"], serde_json::json!(["a", "b"]));
            has(&model["warnings"].to_string(), &["90 of 300 rows are masked"]);
        }
    }
    let told = complaint(&csv, &["--test", "parcorr", "--columns", "a,b", "--mask", "pauze"], 2);
    has(&told, &["--mask", "there is no column 'pauze'", "did you mean 'pause'?"]);
}

#[test]
fn masked_rows_are_no_effects() {
    let rows: Vec<String> = coupled(300)
        .lines()
        .enumerate()
        .map(|(i, line)| format!("{line},{}", if i == 0 { "pause".into() } else { (i / 150).to_string() }))
        .collect();
    let dir = folder("data.csv", &rows.join("\n"));
    let masked = json(dir.path(), &["--mask", "pause"]);
    assert_eq!(masked["features"], serde_json::json!(["a", "b"]));
    has(&masked["warnings"].to_string(), &["151 of 300 rows are masked"]);
    assert_eq!(masked["links"].as_array().expect("links")[0]["n_lost"], 151);
    let by_condition = json(dir.path(), &["--columns", "a,b", "--where", "a > -10 and b < 0.2"]);
    assert!(by_condition["links"][0]["n_lost"].as_u64().is_some_and(|lost| lost > 20));
    let out = roscausal(dir.path(), &[&QUICK[..], &["--where", "pausee == 0"]].concat());
    has(
        &String::from_utf8_lossy(&out.stderr),
        &["--where: there is no column 'pausee'", "did you mean 'pause'"],
    );
}

#[test]
fn a_stored_model_is_shown_as_it_was_and_compared_with_another() {
    let dir = folder("data.csv", &coupled(300));
    let first = roscausal(dir.path(), &[&QUICK[..], &["-o", "one"]].concat());
    let again = roscausal(dir.path(), &["show", "one/model.json", "-o", "again"]);
    let text = String::from_utf8_lossy(&again.stdout);
    has(&text, &["a at t-1 (0.25 s earlier) drives b", "About the data"]);
    let without_time = |text: &str| text.lines().skip(1).collect::<Vec<_>>().join("\n");
    assert_eq!(without_time(&text), without_time(&String::from_utf8_lossy(&first.stdout)));
    let read = |path: &str| fs::read(dir.path().join(path)).expect("is there");
    assert_eq!(
        (read("one/model.json"), read("one/dag.svg")),
        (read("again/model.json"), read("again/dag.svg"))
    );

    fs::write(dir.path().join("links.toml"), "[[link]]\ncause = 'a'\neffect = 'b'\nis = 'forbidden'\n")
        .expect("writes");
    roscausal(dir.path(), &[&QUICK[..], &["--links", "links.toml", "--alpha", "0.01", "-o", "two"]].concat());
    let out = roscausal(dir.path(), &["compare", "one/model.json", "two/model.json", "-o", "difference"]);
    let text = String::from_utf8_lossy(&out.stdout);
    has(&text, &["alpha: 0.05, 0.01", "1 only in one/model.json\n  a at t-1", "0 only in two/model.json"]);
    let picture = |name: &str| String::from_utf8_lossy(&read(&format!("difference/{name}"))).into_owned();
    assert_ne!(picture("only_a.svg"), picture("both.svg"));
}

#[test]
fn quiet_says_nothing_but_errors_and_no_file_gets_colours() {
    let dir = folder("data.csv", &coupled(300));
    fs::write(dir.path().join("roscausal.toml"), "tau-max = 2\n").expect("writes");
    let told = |more: &[&str]| {
        let out = roscausal(dir.path(), &[&QUICK[..], more].concat());
        assert!(!out.stdout.contains(&0x1b) && !out.stderr.contains(&0x1b), "colours in a file");
        String::from_utf8_lossy(&out.stderr).into_owned()
    };
    has(&told(&[]), &["settings of roscausal.toml: --tau-max=2"]);
    assert_eq!(told(&["--quiet"]), "");
    has(&told(&["--quiet", "--alpha", "2"]), &["error: --alpha: 2 is not a level"]);
}

#[test]
fn completions_and_manual_pages_name_every_subcommand() {
    let dir = tempfile::tempdir().expect("a folder");
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let out = roscausal(dir.path(), &["completions", shell]);
        has(&String::from_utf8_lossy(&out.stdout), &["discover", "replay", "compare", "tau-max"]);
    }
    assert!(roscausal(dir.path(), &["man", "pages"]).status.success());
    for page in ["roscausal", "roscausal-discover", "roscausal-replay", "roscausal-show"] {
        let text = fs::read_to_string(dir.path().join(format!("pages/{page}.1"))).expect(page);
        assert!(text.contains(".TH"), "{page}");
    }
}

#[test]
fn a_test_of_categories_refuses_measurements_and_names_the_way_out() {
    let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0);
    let switch = |i: usize| f64::from(u8::from(noise(i) > 0.5));
    let table = |level: &dyn Fn(usize) -> f64| {
        let rows: String = (0..200).map(|i| format!("{},{}\n", level(2 * i), switch(2 * i + 1))).collect();
        format!("level,light\n{rows}")
    };
    for test in ["gsquared", "cmisymb"] {
        let told = complaint(&table(&noise), &["--method", "pcmci", "--test", test], 1);
        has(&told, &[test, "'level' has 200 different values in 200 samples", "parcorr", "round(level)"]);
        assert!(!told.contains("'light'"), "{told}");
        assert_eq!(told.lines().filter(|line| line.starts_with("error: ")).count(), 1, "{told}");
    }
    // Categories that are not whole numbers are categories.
    let dir = folder("data.csv", &table(&|i| 0.25 * switch(i)));
    let out = roscausal(dir.path(), &["discover", "data.csv", "--method", "pcmci", "--test", "gsquared"]);
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
}
