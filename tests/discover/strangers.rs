//! Texts from outside on their way to a terminal: wherever a name, a word or a file holds what a terminal obeys or no reader sees, it
//! is spelled out. The command's own lines and colours stay.

use std::{
    fs,
    path::Path,
    process::{Command, Output},
};

use roscausal_core::Time;
use roscausal_msgs::{
    geometry_msgs::PoseStamped,
    nav_msgs::Odometry,
    people_msgs::{People, Person},
    std_msgs::Header,
};
use roscausal_recording::McapWriter;
use serde_json::Value;
use tempfile::TempDir;

use super::{QUICK, coupled, folder};

/// What a stranger may write: a title, a cleared screen, a colour, a line of its own, a bell, a tabulator, eight-bit controls, turned
/// and hidden letters.
const EVIL: &str = "q\u{1b}]0;t\u{7}\u{1b}[2J\u{1b}[31m\r\nerror: forged\u{8}\u{9}\u{7f}\u{9b}2J\u{85}\u{202e}\u{2066}\u{200f}\u{61c}\u{200b}\u{feff}\u{e0041}\u{2028}z";

fn evil(before: &str) -> String {
    format!("{before}{EVIL}")
}

/// The same for a table: with a bell in it, it is not text.
fn evil_column(before: &str) -> String {
    evil(before).replace(['\u{7}', '\u{8}'], "")
}

/// Fails if an output holds what a terminal obeys or nobody sees, or a line that is not the command's.
fn check(what: &str, out: &Output) {
    for (name, bytes) in [("stdout", &out.stdout), ("stderr", &out.stderr)] {
        let text = std::str::from_utf8(bytes).unwrap_or_else(|error| panic!("{what}: {name}: {error}"));
        let shown: String = text.chars().take(3000).collect::<String>().escape_debug().to_string();
        let bad = |c: char| {
            (c.is_control() && c != '\n')
                || "\u{202e}\u{2066}\u{200f}\u{61c}\u{200b}\u{feff}\u{e0041}\u{2028}".contains(c)
        };
        assert!(!text.contains(bad), "{what}: {name}: {shown}");
        assert!(!text.lines().any(|line| line.starts_with("error: forged")), "{what}: {name}: {shown}");
        assert!(!text.contains("panicked"), "{what}: {name}: {shown}");
    }
    assert!(out.status.code().is_some(), "{what}: killed");
}

fn run(dir: &Path, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_roscausal"));
    command.current_dir(dir).args(args).env("RUST_LOG", "debug").output().expect("the command starts")
}

/// Runs the command and checks what it prints; returns both streams.
fn shown(dir: &Path, args: &[&str]) -> String {
    let out = run(dir, args);
    check(&format!("{args:?}"), &out);
    String::from_utf8_lossy(&[out.stdout, out.stderr].concat()).into_owned()
}

/// As [`shown`], where something of the evil text must be seen.
fn spelled(dir: &Path, args: &[&str]) {
    let text = shown(dir, args);
    assert!(text.contains("U+001B") || text.contains("\\u001b"), "{args:?}: {text}");
}

#[test]
fn arguments() {
    let dir = folder("data.csv", &coupled(50));
    let (word, flag) = (evil("x"), evil("--x"));
    for args in [
        &[word.as_str()][..],
        &[&flag],
        &["show", &flag],
        &["discover", "data.csv", "--tau-max", &word],
        &["discover", "data.csv", "--test", &word],
        &["discover", "data.csv", "--method", &word],
        &["discover", "data.csv", "--format", &word],
        &["discover", "data.csv", "--columns", &word],
        &["discover", "data.csv", "--where", &word],
        &["discover", "data.csv", "--feature", &word],
        &["discover", "data.csv", "--vector", &word],
        &["discover", "data.csv", "--exogenous", &word],
        &["discover", "data.csv", "--missing-value", &word],
        &["discover", "data.csv", "--time-column", &word],
        &["discover", "data.csv", "--links", &word],
        &["discover", "data.csv", "--null-dist", &word],
        &["discover", "data.csv", "--several-people", &word],
        &["discover", &word],
        &["roll", &word, "--window", "9"],
        &["replay", &word],
        &["topics", &word],
        &["show", &word],
        &["compare", &word, &word],
        &["report", &word],
        &["predict", &word, "--data", &word],
        &["demo", "--scenario", &word],
        &["demo", "--do", &word],
        &["experiment", "--seeds", &word],
        &["completions", &word],
    ] {
        spelled(dir.path(), args);
        if args.len() > 1 {
            // The command's own colours stay; nobody else's do.
            let out = run(dir.path(), &[args, &["--color", "always"]].concat());
            let text = String::from_utf8_lossy(&out.stderr);
            assert!(
                text.contains("\u{1b}[") && !text.contains("\u{1b}]") && !text.contains("\u{1b}[2J"),
                "{text:?}"
            );
        }
    }
}

#[test]
fn names_of_files_and_folders() {
    let dir = tempfile::tempdir().expect("a folder");
    let inner = evil("d");
    fs::create_dir(dir.path().join(&inner)).expect("makes");
    let file = |name: &str| format!("{inner}/{}", evil(name));
    let csv = format!("{}.csv", file("a"));
    fs::write(dir.path().join(&csv), coupled(300)).expect("writes");
    let out = file("out");
    shown(dir.path(), &[&["discover", &csv, "--out", &out], &QUICK[2..]].concat());
    shown(dir.path(), &["show", &format!("{out}/model.json")]);
    spelled(dir.path(), &["report", &out, "-o", &format!("{out}/r.html")]);
    shown(dir.path(), &["discover", &inner]);
    shown(dir.path(), &["roll", &csv, "--window", "100", "--test", "parcorr"]);
    for (ending, content) in [
        ("csv", "a,b\n1,x\n"),
        ("bag", "no bag"),
        ("mcap", "none"),
        ("db3", "none"),
        ("npy", "none"),
        ("json", "{}"),
        ("tsv", ""),
    ] {
        let name = format!("{}.{ending}", file("bad"));
        fs::write(dir.path().join(&name), content).expect("writes");
        for command in ["discover", "topics", "replay", "show", "roll"] {
            shown(dir.path(), &[command, &name]);
        }
    }
}

#[test]
fn tables() {
    let dir = tempfile::tempdir().expect("a folder");
    let quoted = |text: &str| format!("\"{}\"", text.replace('"', "\"\""));
    let write = |name: &str, content: &str| fs::write(dir.path().join(name), content).expect("writes");
    let named = |a: &str, b: &str| coupled(300).replacen("a,b", &format!("{},{}", quoted(a), quoted(b)), 1);
    write("data.csv", &named(&evil_column("a"), &evil_column("b")));
    for format in ["text", "json", "dot", "graphml", "csv"] {
        spelled(dir.path(), &[&QUICK[..], &["--format", format]].concat());
    }
    spelled(dir.path(), &[&QUICK[..], &["--columns", "c"]].concat());
    spelled(dir.path(), &[&QUICK[..], &["--resamples", "20", "--out", "r"]].concat());
    for format in ["text", "csv", "jsonl"] {
        spelled(
            dir.path(),
            &[
                "roll", "data.csv", "--window", "150", "--test", "parcorr", "--alpha", "0.5", "--format",
                format,
            ],
        );
    }
    shown(dir.path(), &["discover", "data.csv", "--method", "auto"]);
    for question in [
        &["predict", "r/model.json", "--data", "data.csv"][..],
        &[
            "effect",
            "r/model.json",
            "--data",
            "data.csv",
            "--cause",
            &evil_column("a"),
            "--effect",
            &evil_column("b"),
        ],
        &["explain", "r/model.json", "--data", "data.csv", "--variable", &evil_column("b")],
        &[
            "whatif",
            "r/model.json",
            "--data",
            "data.csv",
            "--action",
            &format!("{}: {}=0", evil("stop"), evil_column("a")),
            "--action",
            "go on",
        ],
        &["explain", "r/model.json", "--data", "data.csv", "--variable", "c"],
    ] {
        shown(dir.path(), question);
        shown(dir.path(), &[question, &["--format", "json"]].concat());
    }
    // JSON says the same as ever.
    let json = run(dir.path(), &["show", "r/model.json", "--format", "json"]).stdout;
    let model: Value = serde_json::from_slice(&json).expect("JSON");
    let kept = fs::read(dir.path().join("r/model.json")).expect("is there");
    assert_eq!(model["features"], serde_json::from_slice::<Value>(&kept).expect("JSON")["features"]);
    assert!(model["features"][0].as_str().is_some_and(|name| name.contains('\u{202e}')));

    let cell = quoted(&evil_column(""));
    for (name, content) in [
        ("word", format!("a,b\n1,2\n{cell},3\n")),
        ("time", format!("time,a,b\n1,2,3\n{cell},2,3\n")),
        ("twice", format!("{cell},{cell}\n1,2\n2,3\n")),
        ("constant", format!("a,{cell}\n1,2\n2,2\n3,2\n1,2\n7,2\n5,2\n1,2\n2,2\n")),
        ("ragged", format!("a,b\n1,2\n{cell}\n")),
        ("empty", format!("{cell},b\n,1\n,2\n,3\n")),
        ("endless", "a,b\n1,inf\n".to_owned()),
        ("raw", format!("{0}\n{0}\n", evil_column(""))),
    ] {
        write("bad.csv", &content);
        for more in [&[][..], &["--encode", "codes"], &["--format", "trajectories"]] {
            shown(dir.path(), &[&["discover", "bad.csv"], more].concat());
        }
        shown(dir.path(), &["report", "bad.csv"]);
        assert!(name.is_ascii());
    }
}

#[test]
fn models() {
    let dir = folder("data.csv", &coupled(300));
    run(dir.path(), &[&QUICK[..], &["--resamples", "20", "--out", "r"]].concat());
    let model: Value =
        serde_json::from_slice(&fs::read(dir.path().join("r/model.json")).expect("is there")).expect("JSON");
    let mut pointers = Vec::new();
    places(&model, String::new(), &mut pointers);
    assert!(pointers.len() > 10, "{pointers:?}");
    for pointer in pointers {
        let mut changed = model.clone();
        let text = changed.pointer_mut(&pointer).expect("a text");
        *text = evil(text.as_str().unwrap_or_default()).into();
        if pointer == "/features/0" {
            // A name is in several places.
            let (whole, name) = (model.to_string(), model["features"][0].to_string());
            changed = serde_json::from_str(&whole.replace(&name, &Value::from(evil("a")).to_string()))
                .expect("JSON");
        }
        fs::write(dir.path().join("evil.json"), changed.to_string()).expect("writes");
        for args in [
            &["show", "evil.json"][..],
            &["show", "evil.json", "--format", "dot"],
            &["show", "evil.json", "--format", "graphml"],
            &["show", "evil.json", "--format", "csv"],
            &["show", "evil.json", "--format", "json"],
            &["compare", "evil.json", "r/model.json"],
            &["effect", "evil.json", "--data", "data.csv", "--cause", "a", "--effect", "b"],
        ] {
            let out = run(dir.path(), args);
            check(&format!("{pointer}: {args:?}"), &out);
        }
    }
    // Also in what is written for other programs.
    shown(dir.path(), &["show", "evil.json", "--out", "s"]);
    fs::write(dir.path().join("broken.json"), format!("{{\"schema\": \"{EVIL}\"")).expect("writes");
    fs::write(dir.path().join("other.json"), serde_json::json!({"schema": EVIL, EVIL: 1}).to_string())
        .expect("writes");
    for file in ["broken.json", "other.json"] {
        shown(dir.path(), &["show", file]);
        shown(dir.path(), &["report", file]);
    }
}

/// The places of the texts in JSON, one of each list.
fn places(value: &Value, at: String, found: &mut Vec<String>) {
    match value {
        Value::String(_) => found.push(at),
        Value::Array(list) => {
            list.iter().take(1).enumerate().for_each(|(i, one)| places(one, format!("{at}/{i}"), found))
        }
        Value::Object(map) => map.iter().for_each(|(key, one)| places(one, format!("{at}/{key}"), found)),
        _ => {}
    }
}

#[test]
fn settings_and_scenarios() {
    let dir = folder("data.csv", &coupled(100));
    let text = |value: &str| Value::from(value).to_string();
    for content in [
        format!("{} = 1\n", text(EVIL).replace("\\u007f", "").replace(char::is_control, "")),
        format!("method = {}\n", text(EVIL)),
        format!("tau-max = {}\n", text(EVIL)),
        format!("columns = [{}]\n", text(EVIL)),
        format!("[discovery]\ncd_method = {}\n", text(EVIL)),
        format!("[{}]\na = 1\n", text(EVIL)),
        format!("tau-max = {EVIL}\n"),
        EVIL.to_owned(),
        format!("plan = {}\n", text(EVIL)),
        format!("{EVIL} = 3"),
    ] {
        fs::write(dir.path().join("roscausal.toml"), &content).expect("writes");
        shown(dir.path(), &["discover", "data.csv", "--test", "parcorr"]);
        shown(dir.path(), &["demo", "--scenario", "roscausal.toml", "--duration", "1"]);
        shown(dir.path(), &["discover", "data.csv", "--links", "roscausal.toml"]);
    }
}

/// Ten seconds of a robot and a person, each text as given.
fn walk(dir: &TempDir, [odom, people, frame, child, person]: [&str; 5]) {
    let mut writer = McapWriter::create(dir.path().join("walk.mcap")).expect("a file");
    let settings =
        [(evil("discovery."), EVIL.to_owned()), ("discovery.cd_method".to_owned(), EVIL.to_owned())];
    writer.write_settings(&settings.into()).expect("writes");
    for step in 0..100 {
        let t = 0.1 * f64::from(step);
        let stamp = Time::from_secs_f64(100.0 + t);
        let header = Header { stamp, frame_id: frame.into() };
        let mut odometry =
            Odometry { header: header.clone(), child_frame_id: child.into(), ..Default::default() };
        odometry.pose.pose.position.x = t.sin();
        writer.write(odom, stamp, &odometry).expect("writes");
        let one = Person {
            name: person.into(),
            tagnames: vec![EVIL.into()],
            tags: vec![EVIL.into()],
            ..Default::default()
        };
        writer.write(people, stamp, &People { header: header.clone(), people: vec![one] }).expect("writes");
        let mut goal = PoseStamped { header, ..Default::default() };
        goal.pose.position.y = 3.0;
        writer.write(&evil("/goal"), stamp, &goal).expect("writes");
    }
    writer.finish().expect("ends");
}

#[test]
fn recordings() {
    let plain = ["/odom", "/people", "odom", "base_link", "anna"];
    for place in 0..5 {
        let text = evil(plain[place]);
        let mut texts = plain;
        texts[place] = &text;
        let dir = tempfile::tempdir().expect("a folder");
        walk(&dir, texts);
        spelled(dir.path(), &["topics", "walk.mcap"]);
        spelled(dir.path(), &["topics", "walk.mcap", "--signals"]);
        for more in [
            &[][..],
            &["--person", "all"],
            &["--robot-odom", texts[0]],
            &["--people", texts[1]],
            &["--person", texts[4]],
            &["--signal", &format!("{} = {}.x", evil("s"), texts[0])],
        ] {
            shown(dir.path(), &[&["discover", "walk.mcap", "-vv"], &QUICK[2..], more].concat());
        }
        shown(
            dir.path(),
            &["replay", "walk.mcap", "-vv", "--out", &evil("out"), "--ts-length", "0", "--person", "all"],
        );
    }
}

#[test]
fn a_spreadsheet_runs_no_name() {
    let names =
        ["=cmd|' /C calc'!A0", "+1+cmd", "-2+3", "@SUM(A1)", "\t=1", "-0.3", "a", "a;=cmd|x", "-1;-2+cmd"];
    for name in names {
        let csv = coupled(300).replacen("a,b", &format!("\"{name}\",b"), 1);
        let dir = folder("data.csv", &csv);
        for args in [
            &[&QUICK[..], &["--format", "csv"]].concat()[..],
            &["roll", "data.csv", "--window", "150", "--test", "parcorr", "--format", "csv"],
        ] {
            let out = run(dir.path(), args);
            let mut rows = 0;
            for row in csv::ReaderBuilder::new().from_reader(&out.stdout[..]).records() {
                let row = row.expect("a row");
                // Elsewhere a semicolon separates cells.
                for cell in row.iter().flat_map(|cell| cell.split(';')) {
                    let formula = cell.starts_with(['=', '+', '@', '\t', '\r'])
                        || cell.starts_with('-') && cell.contains(char::is_alphanumeric);
                    assert!(!formula || cell.parse::<f64>().is_ok(), "{name}: {cell}");
                }
                rows += 1;
            }
            assert!(rows > 0, "{name}: {}", String::from_utf8_lossy(&out.stderr));
        }
    }
}

#[test]
fn a_long_cell_is_cut_in_the_message() {
    let long = "x y's \"z\" ".repeat(300_000);
    let cell = format!("\"{}\"", long.replace('"', "\"\""));
    for (content, args) in [
        (format!("a,b\n1,2\n{cell},3\n"), &["discover", "data.csv"][..]),
        (format!("time,a,b\n1,2,3\n{cell},2,3\n"), &["discover", "data.csv"]),
        (format!("a,b\n1,2\n{}e9999999,3\n", "9".repeat(3 << 20)), &["discover", "data.csv"]),
        (serde_json::json!({ "schema": long }).to_string(), &["show", "data.csv"]),
        (
            serde_json::json!({ "schema": "roscausal/model/1", "status": long, "method": [] }).to_string(),
            &["show", "data.csv"],
        ),
    ] {
        let dir = folder("data.csv", &content);
        let out = run(dir.path(), args);
        assert_ne!(out.status.code(), Some(0));
        assert!(out.stderr.len() < 2100, "{} bytes", out.stderr.len());
        let text = String::from_utf8_lossy(&out.stderr);
        assert!(!text.contains(&long[..100]), "{text}");
    }
}

#[test]
fn the_commands_own_texts_stay() {
    let dir = tempfile::tempdir().expect("a folder");
    for args in [
        &["completions", "bash"][..],
        &["completions", "zsh"],
        &["completions", "fish"],
        &["completions", "elvish"],
        &["methods"],
        &["discover", "--help"],
    ] {
        let out = run(dir.path(), args);
        assert!(out.status.success() && !String::from_utf8_lossy(&out.stdout).contains("<U+"), "{args:?}");
    }
}
