//! `roscausal report` as its users run it: from data, from a model, from a folder; strangers' texts stay texts.

#![allow(clippy::expect_used, clippy::panic, reason = "a test may panic: that is how it fails")]

mod common;

use std::{fs, path::Path};

use common::roscausal;
use roscausal_fuzz::unit;
use serde_json::Value;

const QUICK: [&str; 4] = ["--method", "pcmci", "--test", "parcorr"];
/// Names that would run, if a browser took them for HTML.
const HOSTILE: [&str; 3] =
    ["<script>alert(1)</script>", "\"><img src=x onerror=alert(2)>", "</title></style></svg><iframe src=x>&"];

/// Three variables, each driven by the one before it one step earlier.
fn chain(names: [&str; 3], rows: usize) -> String {
    let mut state = 11_u64;
    let mut noise = || unit(&mut state) - 0.5;
    let quoted: Vec<String> = names.iter().map(|name| format!("\"{}\"", name.replace('"', "\"\""))).collect();
    let mut csv = format!("time,{}\n", quoted.join(","));
    let [mut a, mut b] = [0.0; 2];
    for row in 0..rows {
        let c = 0.8 * b + noise();
        (a, b) = (0.5 * a + noise(), 0.8 * a + noise());
        csv += &format!("{},{a},{b},{c}\n", row as f64 * 0.5);
    }
    csv
}

fn report(dir: &Path, args: &[&str]) -> String {
    let all: Vec<&str> = ["report"].iter().chain(args).copied().collect();
    let out = roscausal(dir, &all);
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    fs::read_to_string(dir.join("report.html")).expect("a report")
}

#[test]
fn data_give_a_report_with_each_link_its_evidence_and_the_way_to_it_again() {
    let dir = tempfile::tempdir().expect("a folder");
    fs::write(dir.path().join("data.csv"), chain(["a", "b", "c"], 300)).expect("writes");
    let html =
        report(dir.path(), &[&["data.csv", "--latex", "t.tex", "--tikz", "g.tex"][..], &QUICK].concat());
    let out = roscausal(dir.path(), &[&["discover", "data.csv", "--format", "json"][..], &QUICK].concat());
    let model: Value = serde_json::from_slice(&out.stdout).expect("a model");
    let links = model["links"].as_array().expect("links");
    assert!(links.len() >= 3, "{links:?}");
    for (place, link) in links.iter().enumerate() {
        let id = format!("link-{}", place + 1);
        assert_eq!(html.matches(&format!("id=\"{id}\"")).count(), 1, "{id} has one card");
        assert!(
            html.matches(&format!("href=\"#{id}\"")).count() >= 2,
            "{id} is reached from table and graph"
        );
        let value = format!("<dd>{:.4}</dd>", link["value"].as_f64().expect("a value"));
        assert!(html.contains(&value), "{value}");
    }
    assert_eq!(html.matches("Strength at each lag").count(), links.len());
    assert!(html.contains("To cite: roscausal"), "how to cite");
    for words in
        ["Data check", "Caveats", "roscausal discover data.csv --method pcmci --test parcorr", "--seed 42"]
    {
        assert!(html.contains(words), "{words}");
    }
    let tex = fs::read_to_string(dir.path().join("t.tex")).expect("a table");
    assert_eq!(tex.matches("\\\\\n").count(), links.len() + 1);
    assert_eq!(
        fs::read_to_string(dir.path().join("g.tex")).expect("a graph").matches("edge[").count(),
        links.len()
    );
    // The same again, byte for byte; and nothing is loaded or run.
    let again = report(dir.path(), &[&["data.csv"][..], &QUICK].concat());
    assert_eq!(strip_time(&html), strip_time(&again));
    for forbidden in ["<script", "http://", "https://", "src=", "url(", "@import"] {
        let inside = html.replace("http://www.w3.org/2000/svg", "");
        assert!(!inside.contains(forbidden), "{forbidden}");
    }
}

/// Without the run time in the headline.
fn strip_time(html: &str) -> String {
    let (before, rest) = html.split_once(", found in ").expect("a run time");
    before.to_owned() + rest.split_once('.').expect("its end").1.trim_start_matches(|c: char| c != '<')
}

#[test]
fn where_the_filter_lets_nothing_through_there_is_a_report_too() {
    let dir = tempfile::tempdir().expect("a folder");
    fs::write(dir.path().join("data.csv"), chain(["a", "b", "c"], 300)).expect("writes");
    let strict = ["--method", "fpcmci", "--test", "parcorr", "--f-alpha", "1e-300", "--out", "res"];
    assert!(roscausal(dir.path(), &[&["discover", "data.csv"][..], &strict].concat()).status.success());
    let html = report(dir.path(), &["res"]);
    assert!(html.contains("No causal link found") && html.contains("Rows of each recording: 300"), "{html}");
}

#[test]
fn the_arrows_of_a_strength_without_a_sign_are_seen_in_the_dark() {
    let dir = tempfile::tempdir().expect("a folder");
    fs::write(dir.path().join("data.csv"), chain(["a", "b", "c"], 150)).expect("writes");
    let html = report(dir.path(), &["data.csv", "--method", "pcmci", "--test", "gpdc"]);
    for part in ["stroke", "fill"] {
        // The picture has the colour, and the style says what it is on dark ground.
        let colour = format!("{part}=\"#475569\"");
        assert!(
            html.contains(&format!(" {colour}")) && html.contains(&format!("svg [{colour}]")),
            "{colour}"
        );
    }
}

#[test]
fn the_command_in_a_report_has_no_flag_that_its_method_refuses() {
    let dir = tempfile::tempdir().expect("a folder");
    fs::write(dir.path().join("data.csv"), chain(["a", "b", "c"], 300)).expect("writes");
    for (method, reads) in [("granger", false), ("pcmci", true)] {
        let html = report(dir.path(), &["data.csv", "--method", method, "--test", "parcorr"]);
        assert_eq!(html.contains("--pc-alpha"), reads, "{method}");
    }
}

#[test]
fn the_command_in_a_report_has_the_resamples() {
    let dir = tempfile::tempdir().expect("a folder");
    fs::write(dir.path().join("DATA.csv"), chain(["a", "b", "c"], 200)).expect("writes");
    let asked = ["--resamples", "20", "--resampling", "bootstrap", "--block", "5", "--out", "res"];
    let out = roscausal(dir.path(), &[&["discover", "DATA.csv"][..], &QUICK, &asked].concat());
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let html = report(dir.path(), &["res"]);
    let (_, line) = html.split_once("roscausal discover DATA.csv").expect("a command");
    let mut again: Vec<&str> = line.split_once('<').expect("its end").0.split_whitespace().collect();
    again.splice(0..0, ["discover", "DATA.csv", "--out", "again"]);
    assert!(roscausal(dir.path(), &again).status.success(), "{again:?}");
    let model = |of: &str| fs::read(dir.path().join(of).join("model.json")).expect("a model");
    assert_eq!(model("res"), model("again"));
}

#[test]
fn a_folder_a_model_and_the_data_give_the_same_evidence() {
    let dir = tempfile::tempdir().expect("a folder");
    fs::write(dir.path().join("data.csv"), chain(["a", "b", "c"], 300)).expect("writes");
    let out = roscausal(dir.path(), &[&["discover", "data.csv", "--out", "res"][..], &QUICK].concat());
    assert!(out.status.success());
    let cards = |html: &str| {
        let (_, rest) = html.split_once("id=\"evidence\"").expect("evidence");
        rest.split_once("</section>").expect("its end").0.to_owned()
    };
    let of_data = cards(&report(dir.path(), &[&["data.csv"][..], &QUICK].concat()));
    assert!(of_data.contains("class=\"dots\""));
    assert_eq!(of_data, cards(&report(dir.path(), &["res"])));
    assert_eq!(of_data, cards(&report(dir.path(), &["res/model.json"])));
    fs::remove_file(dir.path().join("res/evidence.json")).expect("removes");
    assert!(report(dir.path(), &["res"]).contains("No evidence was kept beside this model."));
}

#[test]
fn names_from_strangers_stay_text() {
    let dir = tempfile::tempdir().expect("a folder");
    let file = "<b onclick=alert(3)>.csv";
    fs::write(dir.path().join(file), chain(HOSTILE, 300)).expect("writes");
    let html = report(dir.path(), &[&[file, "--latex", "t.tex"][..], &QUICK].concat());
    for forbidden in ["<script", "<img", "<iframe", "<b ", "</svg><i"] {
        assert!(!html.contains(forbidden), "{forbidden} is in the report");
    }
    assert_eq!(html.matches("</style>").count(), 1);
    assert!(html.contains("&lt;script&gt;alert(1)&lt;/script&gt;"));
    assert!(html.contains("&lt;b onclick=alert(3)&gt;.csv"));
    // What a model says is no more trusted than its names.
    let out = roscausal(dir.path(), &[&["discover", file, "--format", "json"][..], &QUICK].concat());
    let mut model: Value = serde_json::from_slice(&out.stdout).expect("a model");
    for field in ["method", "cond_ind_test", "status", "fdr"] {
        model[field] = HOSTILE[0].into();
    }
    model["status"] = format!("partial: {}", HOSTILE[0]).into();
    model["warnings"] = vec![HOSTILE[1]].into();
    fs::write(dir.path().join("model.json"), model.to_string()).expect("writes");
    let html = report(dir.path(), &["model.json"]);
    for forbidden in ["<script", "<img", "<iframe"] {
        assert!(!html.contains(forbidden), "{forbidden} is in the report");
    }
    // What is not a mark is not a model.
    model["links"][0]["mark"] = HOSTILE[2].into();
    fs::write(dir.path().join("model.json"), model.to_string()).expect("writes");
    let out = roscausal(dir.path(), &["report", "model.json"]);
    assert!(
        !out.status.success() && String::from_utf8_lossy(&out.stderr).contains("is not a mark"),
        "{out:?}"
    );
}

#[test]
fn what_is_no_model_is_one_sentence() {
    let dir = tempfile::tempdir().expect("a folder");
    fs::write(dir.path().join("data.csv"), chain(["a", "b", "c"], 100)).expect("writes");
    let out = roscausal(dir.path(), &[&["discover", "data.csv", "--format", "json"][..], &QUICK].concat());
    let model: Value = serde_json::from_slice(&out.stdout).expect("a model");
    let complaint = |json: Value, words: &str| {
        fs::write(dir.path().join("m.json"), json.to_string()).expect("writes");
        let out = roscausal(dir.path(), &["report", "m.json"]);
        let stated = String::from_utf8_lossy(&out.stderr).into_owned();
        assert!(!out.status.success() && stated.lines().count() == 1 && stated.contains(words), "{stated}");
    };
    let with = |field: &str, value: Value| {
        let mut model = model.clone();
        model[field] = value;
        model
    };
    complaint(with("tau_max", 1_000_000_000_000_u64.into()), "m.json");
    complaint(with("schema", "something/9".into()), "its schema is 'something/9'; this program reads");
    complaint(serde_json::json!({}), "m.json");
    let out = roscausal(dir.path(), &["report", "."]);
    // The folder holds no model.
    assert!(String::from_utf8_lossy(&out.stderr).contains("no model here"), "{out:?}");
}

#[test]
fn a_file_of_others_is_not_overwritten_unless_told_to_and_an_earlier_result_may_be() {
    let dir = tempfile::tempdir().expect("a folder");
    let at = |name: &str| dir.path().join(name);
    fs::write(at("data.csv"), chain(["a", "b", "c"], 200)).expect("writes");
    let run = |args: &[&str]| {
        let out = roscausal(dir.path(), args);
        (out.status.code(), String::from_utf8_lossy(&out.stderr).into_owned())
    };
    let quick = |args: &[&'static str]| [args, &QUICK].concat();
    let resampled = ["discover", "data.csv", "--resamples", "20", "--resample-out", "mine"];
    assert_eq!(run(&quick(&["discover", "data.csv", "--out", "found"])).0, Some(0));
    let predict = ["predict", "found/model.json", "--data", "data.csv", "--save", "mine"];
    let commands = [
        quick(&["report", "data.csv", "-o", "mine"]),
        quick(&["report", "data.csv", "--latex", "mine"]),
        quick(&["report", "data.csv", "--tikz", "mine"]),
        quick(&resampled),
        predict.to_vec(),
        vec!["demo", "--record", "mine"],
        vec!["replay", "no_such.mcap", "--record", "mine"],
    ];
    for command in &commands {
        // It speaks of roscausal, but is none of its files.
        fs::write(at("mine"), "my thesis on roscausal 0.1").expect("writes");
        let (code, reported) = run(command);
        assert!(
            code == Some(1) && reported.contains("mine") && reported.contains("--force"),
            "{command:?}: {reported}"
        );
        assert_eq!(fs::read(at("mine")).expect("reads"), b"my thesis on roscausal 0.1", "{command:?}");
    }
    // None has begun its work: nothing else was written.
    assert!(!at("roscausal_demo").exists() && !at("roscausal_replay").exists());
    for command in &commands[..5] {
        fs::write(at("mine"), "my thesis").expect("writes");
        let forced = [&command[..], &["--force"]].concat();
        assert_eq!(run(&forced).0, Some(0), "{command:?}");
        assert_ne!(fs::read(at("mine")).expect("reads"), b"my thesis", "{command:?}");
        assert_eq!(run(command).0, Some(0), "an earlier result gives way: {command:?}");
    }
}

#[test]
fn a_recording_may_be_made_anew_but_not_over_the_one_that_is_read() {
    let dir = tempfile::tempdir().expect("a folder");
    let run = dir.path().join("run.mcap");
    roscausal_recording::McapWriter::create(&run).and_then(|writer| writer.finish()).expect("writes");
    let before = fs::read(&run).expect("reads");
    for (read, more) in [("run.mcap", None), (".", None), ("run.mcap", Some("--force"))] {
        let args: Vec<&str> = ["replay", read, "--record", "run.mcap"].into_iter().chain(more).collect();
        let out = roscausal(dir.path(), &args);
        let reported = String::from_utf8_lossy(&out.stderr).into_owned();
        assert!(out.status.code() == Some(1) && reported.contains("read at the same time"), "{reported}");
        assert_eq!(fs::read(&run).expect("reads"), before);
    }
    // A recording of ours gives way: what fails is the scenario.
    let out = roscausal(dir.path(), &["demo", "--scenario", "no_such.toml", "--record", "run.mcap"]);
    let reported = String::from_utf8_lossy(&out.stderr).into_owned();
    assert!(reported.contains("no_such") && !reported.contains("--force"), "{reported}");
}

#[test]
fn a_folder_of_results_stands_for_its_model_and_show_writes_the_report() {
    let dir = tempfile::tempdir().expect("a folder");
    fs::write(dir.path().join("data.csv"), chain(["a", "b", "c"], 200)).expect("writes");
    let run = |args: &[&str]| {
        let out = roscausal(dir.path(), args);
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        (out.status.code(), text(&out.stdout), text(&out.stderr))
    };
    assert_eq!(run(&[&["discover", "data.csv", "--out", "found"][..], &QUICK].concat()).0, Some(0));
    let (of_folder, of_file) = (run(&["show", "found"]), run(&["show", "found/model.json"]));
    assert_eq!((of_folder.0, &of_folder.1), (Some(0), &of_file.1));
    for question in [
        &["effect", "MODEL", "--data", "data.csv", "--cause", "a", "--effect", "b"][..],
        &["whatif", "MODEL", "--data", "data.csv"],
        &["compare", "MODEL", "found"],
    ] {
        let of = |model: &str| {
            let args: Vec<&str> =
                question.iter().map(|word| if *word == "MODEL" { model } else { word }).collect();
            run(&args)
        };
        let (folder, file) = (of("found"), of("found/model.json"));
        let plain = |text: &str| text.replace("found/model.json", "found");
        assert_eq!((folder.0, folder.1.clone()), (Some(0), plain(&file.1)), "{question:?}: {folder:?}");
    }
    assert_eq!(run(&["show", "found", "--report", "a.html", "--latex", "a.tex"]).0, Some(0));
    assert_eq!(run(&["report", "found", "-o", "b.html", "--latex", "b.tex"]).0, Some(0));
    for ending in ["html", "tex"] {
        let read = |name: &str| fs::read(dir.path().join(format!("{name}.{ending}"))).expect("is written");
        assert!(read("a") == read("b") && !read("a").is_empty(), "{ending}");
    }
    let (code, _, stated) = run(&["show", "data.csv"]);
    assert!(code == Some(1) && stated.contains("'roscausal discover' makes one"), "{stated}");
    let (code, _, stated) = run(&["show", "."]);
    assert!(code == Some(1) && stated.contains("there is no model here"), "{stated}");
}
