//! The links of a table: as text, JSON, files and windows.

use std::fs;

use roscausal_fuzz::unit;
use serde_json::Value;

use super::{common::roscausal, coupled, folder, has};

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
        &[
            "cause,effect,lag,value,p_value,mark,n_lost,n_used,p,confidence,value_low,value_high\n",
            "\na,b,1,",
        ],
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
    let out = run(&["--resamples", "40", "--out", "r", "--resample-out", "graphs.jsonl", "--all"]);
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let text = String::from_utf8_lossy(&out.stdout).into_owned();
    has(
        &text,
        &[
            " drives b: strength 0.",
            "; in 40 of 40 resamples",
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
    assert!(csv.lines().nth(1).is_some_and(|row| row.split(',').nth(9) == Some("1.0")), "{csv}");
    for (more, says) in [
        (&["--resamples", "19"][..], "--resamples: 19 is not from 20 to 10000"),
        (&["--share", "0.5"], "--share: it is for --resamples"),
        (&["--resamples", "50", "--share", "1"], "--share: 1 is not between 0 and 1"),
        (&["--resamples", "50", "--share", "0"], "--share: 0 is not between 0 and 1"),
        (&["--resamples", "50", "--rows", "1..13"], "needs at least 20"),
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
    let out = run(&["--batch", "400", "--format", "jsonl", "--time-budget", "1e-9", "--out", "r", "--force"]);
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let reported = "partial: the time budget ended after 0 of 4 windows";
    has(&String::from_utf8_lossy(&out.stderr), &[reported]);
    has(&String::from_utf8_lossy(&out.stdout), &[&format!("{{\"status\":\"{reported}\"}}")]);
    let rolling = fs::read_to_string(dir.path().join("r/rolling.json")).expect("is there");
    has(&rolling, &[&format!("\"status\": \"{reported}\""), "\"windows\": []"]);
    let out = run(&["--batch", "400", "--changes", "--time-budget", "1e-9"]);
    has(&String::from_utf8_lossy(&out.stderr), &["partial: the time budget ended after"]);
    let error = String::from_utf8_lossy(&run(&["--window", "1700"]).stderr).into_owned();
    has(&error, &["--window: 1700 rows leave no window in 1600 rows"]);
    let error = String::from_utf8_lossy(&run(&["--batch", "1700"]).stderr).into_owned();
    has(&error, &["--batch: 1700 rows leave no batch in 1600 rows"]);
    let error = String::from_utf8_lossy(&run(&["--window", "2"]).stderr).into_owned();
    has(&error, &["--window: at the start of a recording 2 rows have no sample", "or a lower --tau-max"]);
    let error = String::from_utf8_lossy(&run(&["--batch", "10", "--tau-max", "5"]).stderr).into_owned();
    has(
        &error,
        &["--batch: the first batch of 10 rows has no sample", "give more than 10, or a lower --tau-max"],
    );
}

#[test]
fn roll_leaves_masked_rows_out_of_windows_resamples_and_changes() {
    // In every other row `a` drives `b`, and only in the second half.
    let mut state = 11_u64;
    let mut noise = || unit(&mut state) - 0.5;
    let (mut text, mut a) = (String::from("a,b,pause\n"), 0.0);
    for t in 0..1600 {
        let pause = t % 2;
        let b = if t >= 800 && pause == 1 { 2.0 * a } else { 0.0 } + noise();
        a = noise();
        text += &format!("{a},{b},{pause}\n");
    }
    let dir = folder("data.csv", &text);
    let usual = "roll data.csv --method pcmci --test parcorr --alpha 0.001 --columns a,b --batch 400 --changes \
                 --change-rows 160 --format jsonl";
    let found = |more: &[&str]| -> (Vec<bool>, bool) {
        let out = roscausal(dir.path(), &[&usual.split_whitespace().collect::<Vec<_>>()[..], more].concat());
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        let lines = String::from_utf8_lossy(&out.stdout).into_owned();
        let lines: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
        let windows = lines.iter().map(|line| &line["window"]).filter(|window| window.is_object());
        let links = windows.map(|window| window["graph"][0][1][1] == "-->").collect();
        (links, lines.iter().any(|line| line["event"]["status"] == "confirmed"))
    };
    assert_eq!(found(&[]), (vec![false, false, true, true], true));
    assert_eq!(found(&["--mask", "pause"]), (vec![false; 4], false));
    assert_eq!(found(&["--where", "pause < 0.5", "--resamples", "20"]), (vec![false; 4], false));
}

#[test]
fn text_says_the_link_as_a_sentence() {
    let dir = folder("data.csv", &coupled(300));
    let out = roscausal(dir.path(), &["discover", "data.csv", "--test", "parcorr", "--all"]);
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
        "model.json", "links.csv", "dag.svg", "dag.png", "dag.pdf", "tsdag.svg", "tsdag.png", "tsdag.pdf",
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
        let args = ["discover", "data.csv", "--test", test, "--fdr", "fdr_bh", "--out", "r", "--all"];
        let out = roscausal(dir.path(), &args);
        let text = String::from_utf8_lossy(&out.stdout);
        has(&text, &["corrected by fdr_bh", "<0.001"]);
        assert!(!text.contains("0.0000"), "{text}");
        let links = fs::read_to_string(dir.path().join("r/links.csv")).expect("is there");
        assert!(links.lines().skip(1).any(|line| line.contains(",<0.00")), "{links}");
    }
}

/// PCMCI+ and the methods that allow for hidden causes have one level, by either name.
#[test]
fn the_heading_names_the_level_that_decided() {
    let dir = folder("data.csv", &coupled(200));
    let args = |method| ["discover", "data.csv", "--method", method, "--test", "parcorr"];
    for (method, level) in
        [("pcmci", "(alpha 0.05,"), ("pcmci+", "(pc_alpha 0.01,"), ("lpcmci", "(pc_alpha 0.05,")]
    {
        let out = roscausal(dir.path(), &args(method));
        has(&String::from_utf8_lossy(&out.stdout), &[level]);
    }
    let with = |more: &[&str]| roscausal(dir.path(), &[&args("pcmci+")[..], more].concat());
    has(&String::from_utf8_lossy(&with(&["--alpha", "0.03"]).stdout), &["(pc_alpha 0.03,"]);
    let out = with(&["--alpha", "0.03", "--pc-alpha", "0.01"]);
    has(&String::from_utf8_lossy(&out.stderr), &["--alpha: pcmciplus has one level", "(--pc-alpha)"]);
}
