//! What is done with data: what is refused, what is told, and what the user says of them.

use std::{fs, path::Path};

use serde_json::Value;

use roscausal_fuzz::unit;

use super::{QUICK, common::roscausal, complaint, coupled, folder, has};

#[test]
fn files_with_different_steps_are_refused_and_both_are_named() {
    let dir = folder("slow.csv", &coupled(100));
    fs::write(dir.path().join("fast.csv"), "time,a,b\n0,1,2\n0.1,2,1\n0.2,1,3\n").expect("writes");
    let out = roscausal(dir.path(), &["discover", "slow.csv", "fast.csv", "--test", "parcorr"]);
    let text = String::from_utf8_lossy(&out.stderr).into_owned();
    assert_eq!(out.status.code(), Some(1), "{text}");
    has(&text, &["fast.csv: its step is 0.1 s, that of slow.csv is 0.25 s"]);
}

/// `n` rows of two columns of independent noise around a level.
fn around(level: f64, seed: u64, header: &str) -> String {
    let mut state = seed;
    let columns = header.split(',').count();
    let row = |_| {
        let cells: Vec<String> = (0..columns).map(|_| format!("{:.5}", level + unit(&mut state))).collect();
        cells.join(",") + "\n"
    };
    format!("{header}\n{}", (0..200).map(row).collect::<String>())
}

#[test]
fn recordings_with_different_columns_are_refused_in_either_order() {
    let dir = folder("quiet.csv", &around(0.0, 1, "speed,unease"));
    fs::write(dir.path().join("crowd.csv"), around(0.0, 2, "unease,noise,speed")).expect("writes");
    for files in [["quiet.csv", "crowd.csv"], ["crowd.csv", "quiet.csv"]] {
        let out = roscausal(dir.path(), &[&["discover"], &files[..], &QUICK[2..]].concat());
        assert_eq!(out.status.code(), Some(1));
        has(&String::from_utf8_lossy(&out.stderr), &["only crowd.csv has noise", "--columns"]);
        let common = ["--columns", "speed,unease"];
        let out = roscausal(dir.path(), &[&["discover"], &files[..], &common, &QUICK[2..]].concat());
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    }
}

/// Rows of four people: `at` gives frame and person.
fn of_people(header: &str, at: fn(usize) -> (usize, usize)) -> String {
    let mut state = 5;
    let row = |t: usize| {
        let (frame, person) = at(t);
        format!("{frame},P{person},{:.4},{:.4}\n", unit(&mut state), unit(&mut state))
    };
    format!("{header}\n{}", (0..200).map(row).collect::<String>())
}

#[test]
fn rows_of_several_people_are_seen_whatever_columns_are_chosen() {
    let crowd = of_people("frame,ped_id,speed,gap", |t| (t / 4, t % 4));
    let chosen = ["--columns", "speed,gap", "--method", "pcmci", "--test", "parcorr"];
    has(
        &complaint(&crowd, &chosen, 1),
        &["rows of the same frame are of several ped_id", "--recording ped_id"],
    );
    let dir = folder("crowd.csv", &crowd);
    fs::write(dir.path().join("blocks.csv"), of_people("n,ped_id,speed,gap", |t| (t % 50, t / 50)))
        .expect("writes");
    for (file, more, told) in [
        ("crowd.csv", &["--keep", "ped_id"][..], ""),
        ("blocks.csv", &[][..], "--recording ped_id makes recordings of"),
    ] {
        let out = roscausal(dir.path(), &[&["discover", file][..], more, &chosen].concat());
        let text = String::from_utf8_lossy(&[out.stdout, out.stderr].concat()).into_owned();
        assert!(out.status.success(), "{text}");
        has(&text, &[told]);
    }
}

#[test]
fn recordings_at_other_levels_make_no_link_unless_their_levels_are_kept() {
    let dir = folder("0.csv", &around(0.0, 1, "a,b"));
    let files: Vec<String> = (0..5_u32).map(|k| format!("{k}.csv")).collect();
    for k in 1..5_u32 {
        fs::write(dir.path().join(&files[k as usize]), around(f64::from(k), u64::from(k), "a,b"))
            .expect("writes");
    }
    let names: Vec<&str> = files.iter().map(String::as_str).collect();
    let text = |more: &[&str]| {
        let args = [
            &["discover"],
            &names[..],
            &["--method", "pcmci", "--test", "parcorr", "--alpha", "0.001"],
            more,
        ]
        .concat();
        String::from_utf8_lossy(&roscausal(dir.path(), &args).stdout).into_owned()
    };
    let found = text(&[]);
    has(
        &found,
        &[
            "from 5 recordings without their own levels",
            ": 0 links between",
            "the recordings differ in the level of a, b",
        ],
    );
    has(&text(&["--levels", "keep", "--all"]), &[": 2 links between", "a at t-1 drives b"]);
    assert!(!text(&["--levels", "keep"]).contains("without their own levels"));
}

#[test]
fn dependence_at_a_longer_lag_is_seen_and_told() {
    let mut state = 3;
    let mut near = [0.0; 600];
    near.iter_mut().for_each(|value| *value = unit(&mut state) - 0.5);
    let row = |t: usize| {
        let speed = if t < 2 { 0.0 } else { 0.9 * near[t - 2] } + 0.3 * (unit(&mut state) - 0.5);
        format!("{:.1},{:.5},{speed:.5}\n", 0.1 * t as f64, near[t])
    };
    let csv = format!("time,distance,speed\n{}", (0..600).map(row).collect::<String>());
    let dir = folder("data.csv", &csv);
    for method in [&[][..], &QUICK[2..]] {
        let out = roscausal(dir.path(), &[&["discover", "data.csv"], method].concat());
        let reported = String::from_utf8_lossy(&out.stdout).into_owned();
        has(
            &reported,
            &[
                "Seen, but not tested: dependence of speed on distance at lag 2 (0.2 s).",
                "Test longer lags: --tau-max 3.",
            ],
        );
        assert!(!reported.contains("may be independent"), "{reported}");
    }
    let out = roscausal(dir.path(), &[&["discover", "data.csv", "--tau-max", "3"], &QUICK[2..]].concat());
    assert!(!String::from_utf8_lossy(&out.stdout).contains("Test longer lags"));
    let auto = ["discover", "data.csv", "--tau-max", "auto"];
    let out = roscausal(dir.path(), &[&auto, &QUICK[2..]].concat());
    let reported =
        ["lags 1..3", "distance drives speed 0.2 s later (more gives more)", "the largest lag is 3"];
    has(&String::from_utf8_lossy(&out.stdout), &reported);
    let out = roscausal(dir.path(), &["roll", "data.csv", "--window", "200", "--tau-max", "auto"]);
    has(&String::from_utf8_lossy(&out.stderr), &["--tau-max"]);
    assert!(!out.status.success());
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
    for (content, reported) in [
        (lfs, "Git LFS pointer to a file of 123456 bytes, not the file; get it with 'git lfs pull'"),
        ("<!DOCTYPE html>\n<html><body>404</body></html>", "this is a web page"),
        ("PK\u{3}\u{4}", "a ZIP archive"),
    ] {
        for name in ["demo.bag", "demo.mcap", "demo.csv"] {
            let dir = folder(name, content);
            let out = roscausal(dir.path(), &["discover", name]);
            assert_eq!(out.status.code(), Some(1));
            has(&String::from_utf8_lossy(&out.stderr), &[name, reported]);
        }
    }
    let dir = folder("demo.bag", "");
    has(
        &String::from_utf8_lossy(&roscausal(dir.path(), &["discover", "demo.bag"]).stderr),
        &["the file is empty"],
    );
}

#[test]
fn missing_cells_and_constant_columns_are_told_and_survived() {
    let data = coupled(200);
    let rows: Vec<String> = data
        .lines()
        .enumerate()
        .map(|(i, line)| match i {
            0 => "time,a,b,c,d".to_owned(),
            2 => "0.25,,NaN,1,2".to_owned(),
            _ => format!("{line},1,2"),
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
    let each = ["columns 'a' (1 of 200), 'b' (1 of 200) are", "columns 'c' (1), 'd' (2) are constant"];
    has(&model["warnings"].to_string(), &each);
    assert_eq!(model["graph"][0][1][1], "-->");
    assert_eq!(model["graph"][2][1][1], "");
    assert_eq!(
        (&model["outcomes"][2][1][1], &model["p_matrix"][2][1][1]),
        (&"no_answer".into(), &Value::Null)
    );
}

#[test]
fn an_analysis_that_cannot_end_is_refused_before_it_starts_with_what_would_fit() {
    let rows: String = (0..120_000_i64).map(|i| format!("{},{}\n", i * 7 % 1013, i * i % 977)).collect();
    let reported = complaint(&format!("a,b\n{rows}"), &["--max-memory", "100"], 1);
    has(
        &reported,
        &[
            "120000 rows of 2 variables would take",
            "of memory, and 100 MB are free",
            "--test parcorr",
            "fewer rows (at most",
        ],
    );
    let long = ["--max-memory", "9000000", "--threads", "1", "--tau-max", "200", "--resamples", "1000"];
    let reported = complaint(&format!("a,b\n{rows}"), &long, 1);
    has(&reported, &["would take about", "days", "--rows"]);
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
    let reported = complaint(&flagged, &["--test", "parcorr"], 1);
    has(&reported, &["b is -999 in 10 rows", "--missing-value=-999", "--missing-value=none"]);
    let dir = folder("data.csv", &flagged);
    for value in ["-999", "none"] {
        let out =
            roscausal(dir.path(), &["discover", "data.csv", "--test", "parcorr", "--missing-value", value]);
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    }
    let copied = with(&|_, line| {
        format!("{line},{}", 2.0 * line.rsplit_once(',').map_or(0.0, |(_, b)| b.parse().unwrap_or(0.0)))
    });
    let reported = complaint(&format!("time,a,b,twice_b\n{copied}"), &["--test", "parcorr"], 1);
    has(&reported, &["b and twice_b say the same", "--columns '!twice_b'"]);
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
    assert_eq!(model["outcomes"][1][0][1], "required");
    assert_eq!((&model["p_matrix"][1][0][1], &model["pval"][0][0][1]), (&Value::Null, &1e-300.into()));
    fs::write(dir.path().join("links.toml"), rules.replace("'b'", "'c'")).expect("writes");
    let out = roscausal(dir.path(), &[&QUICK[..], &["--links", "links.toml"]].concat());
    has(&String::from_utf8_lossy(&out.stderr), &["links.toml: there is no variable 'c'", "variables: a, b"]);
    // Nothing drives what is exogenous, so a link to it cannot be known.
    fs::write(dir.path().join("links.toml"), rules).expect("writes");
    let out = roscausal(dir.path(), &[&QUICK[..], &["--links", "links.toml", "--exogenous", "a"]].concat());
    assert!(!out.status.success() && out.stdout.is_empty());
    has(
        &String::from_utf8_lossy(&out.stderr),
        &["--links: b -> a at lag 1 is required, but 'a' is exogenous"],
    );
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
fn the_threshold_of_a_value_is_the_users_alpha_whatever_the_method() {
    let dir = folder("data.csv", &coupled(300));
    for method in ["pcmci", "pcmciplus", "lpcmci"] {
        let n_links = |alpha: &str| {
            let args = ["discover", "data.csv", "--method", method, "--test", "parcorr", "--format", "json"];
            let threshold = ["--significance", "threshold", "--alpha", alpha];
            let out = roscausal(dir.path(), &[&args[..], &threshold].concat());
            assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
            let model: Value = serde_json::from_slice(&out.stdout).expect("JSON");
            model["links"].as_array().expect("links").len()
        };
        assert!(n_links("0.3") > 0, "{method}");
        assert_eq!(n_links("0.99"), 0, "{method}: no partial correlation is as high");
    }
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
fn shuffles_and_null_distributions_that_no_test_reads_are_refused() {
    let reported = |more: &[&str]| complaint(&coupled(200), &[&["--method", "pcmci"][..], more].concat(), 2);
    has(
        &reported(&["--test", "parcorr", "--shuffles", "10"]),
        &["--shuffles: parcorr draws no surrogates here", "--significance shuffle"],
    );
    let dir = folder("null.csv", "198\n0.1\n0.2\n");
    let file = dir.path().join("null.csv");
    let file = file.to_str().expect("a path of text");
    has(
        &reported(&["--test", "gpdc", "--null-dist", file, "--significance", "shuffle"]),
        &["--null-dist: the significance that is asked for takes none", "give analytic"],
    );
}

#[test]
fn more_shuffles_than_any_p_value_needs_are_refused() {
    for test in ["cmiknn", "gpdc"] {
        let args = ["--method", "pcmci", "--test", test, "--shuffles", "1000000000000"];
        has(
            &complaint(&coupled(50), &args, 2),
            &["--shuffles", "1000000000000 is not a whole number from 0 to 1000000"],
        );
    }
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
    let reported = complaint(&csv, &["--test", "parcorr", "--columns", "a,b", "--mask", "pauze"], 2);
    has(&reported, &["--mask", "there is no column 'pauze'", "did you mean 'pause'?"]);
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
    let first = roscausal(dir.path(), &[&QUICK[..], &["-o", "one", "--all"]].concat());
    let again = roscausal(dir.path(), &["show", "one/model.json", "-o", "again", "--all"]);
    let text = String::from_utf8_lossy(&again.stdout);
    has(&text, &["a at t-1 (0.25 s earlier) drives b", "About the data"]);
    let without_time = |text: &str| text.split_once("Conclusion").expect("one").1.to_owned();
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
    // A difference is called a change by the detector only.
    has(&text, &["is no proof of a change", "`roscausal roll --changes` tests what changed"]);
    let same = roscausal(dir.path(), &["compare", "one/model.json", "again/model.json"]);
    assert!(!String::from_utf8_lossy(&same.stdout).contains("change"), "nothing differs");
    let picture = |name: &str| String::from_utf8_lossy(&read(&format!("difference/{name}"))).into_owned();
    assert_ne!(picture("only_a.svg"), picture("both.svg"));
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
        let reported = complaint(&table(&noise), &["--method", "pcmci", "--test", test], 1);
        has(&reported, &[test, "'level' has 200 different values in 200 samples", "parcorr", "round(level)"]);
        assert!(!reported.contains("'light'"), "{reported}");
        assert_eq!(reported.lines().filter(|line| line.starts_with("error: ")).count(), 1, "{reported}");
    }
    // Categories that are not whole numbers are categories.
    let dir = folder("data.csv", &table(&|i| 0.25 * switch(i)));
    let out = roscausal(dir.path(), &["discover", "data.csv", "--method", "pcmci", "--test", "gsquared"]);
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
}

#[test]
fn a_step_below_that_of_the_data_is_told_and_none_at_all_is_refused() {
    for dt in ["0", "-1"] {
        has(&complaint(&coupled(100), &[&format!("--dt={dt}")], 2), &["--dt", "above 0"]);
    }
    let dir = folder("data.csv", &coupled(100));
    let model = json(dir.path(), &["--dt", "0.02", "--resample", "linear"]);
    has(&model["warnings"].to_string(), &["most rows are made up between samples"]);
}

#[test]
fn times_in_minutes_hours_and_elapsed_seconds_are_no_variables() {
    for name in ["Time [h]", "time_min", "elapsed", "seconds", "'time'"] {
        let dir = folder("data.csv", &coupled(100).replacen("time", name, 1));
        let model = json(dir.path(), &[]);
        assert_eq!(model["features"].as_array().map(Vec::len), Some(2), "{name}");
        let dt = match name {
            "Time [h]" => 900.0,
            "time_min" => 15.0,
            _ => 0.25,
        };
        assert!(
            model["dt"].as_f64().is_some_and(|found| (found - dt).abs() < 1e-9 * dt),
            "{name}: {}",
            model["dt"]
        );
    }
}

#[test]
fn a_required_link_is_not_said_to_have_been_tested() {
    let dir = folder("data.csv", &coupled(200));
    fs::write(dir.path().join("known.toml"), "[[link]]\ncause = 'b'\neffect = 'a'\nis = 'required'\n")
        .expect("writes");
    let out = roscausal(dir.path(), &[&QUICK[..], &["--links", "known.toml", "--all"]].concat());
    has(&String::from_utf8_lossy(&out.stdout), &["drives a: required, not tested"]);
}

#[test]
fn an_option_that_the_method_does_not_read_is_refused() {
    has(
        &complaint(&coupled(100), &["--method", "pcmci", "--collider-rule", "none"], 2),
        &["it applies to pcmciplus"],
    );
}

#[test]
fn words_are_understood_in_any_case() {
    let dir = folder("data.csv", &coupled(100));
    let out = roscausal(
        dir.path(),
        &[&QUICK[..], &["--fdr", "FDR_BH", "--format", "JSON", "--time-unit", "MS"]].concat(),
    );
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
}

#[test]
fn where_no_link_is_found_the_size_that_would_have_been_is_told() {
    for (test, words) in [
        ("parcorr", "A partial correlation of 0.33 would"),
        ("gpdc", "A linear effect with a partial correlation of 0.37 would"),
    ] {
        let reported = printed(&around(0.0, 11, "a,b"), test, &["--alpha", "0.0001"]);
        let reported = reported.split_whitespace().collect::<Vec<_>>().join(" ");
        has(&reported, &["No causal link found", "every pair may be independent at lag 1.", words]);
    }
}

/// Columns `a` and `b` that never have a value at the same time or one step apart, and `c` that always has one.
fn disjoint(rows: usize) -> String {
    let mut state = 5_u64;
    let mut csv = "a,b,c\n".to_owned();
    for row in 0..rows {
        let (early, noise) = (row < rows / 2 - 2, [unit(&mut state), unit(&mut state)]);
        let cell = |there: bool| if there { noise[0].to_string() } else { String::new() };
        csv += &format!("{},{},{}\n", cell(early), cell(row > rows / 2 + 2), noise[1]);
    }
    csv
}

fn printed(csv: &str, test: &str, args: &[&str]) -> String {
    let dir = folder("data.csv", csv);
    let out = roscausal(dir.path(), &[&QUICK[..5], &[test, "--all"], args].concat());
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    String::from_utf8_lossy(&out.stdout).into_owned()
}

#[test]
fn what_was_not_tested_has_no_number_and_the_reason_is_told() {
    let csv = disjoint(300);
    for test in ["parcorr", "gpdc", "cmiknn"] {
        let text = printed(&csv, test, &[]);
        let row = |cause: &str, effect: &str| {
            let is_of = |line: &&str| line.split_whitespace().take(2).eq([cause, effect]);
            text.lines().find(is_of).unwrap_or_else(|| panic!("{test}: {text}")).to_owned()
        };
        for (cause, effect) in [("a", "b"), ("b", "a")] {
            let row = row(cause, effect);
            assert!(row.contains("not tested: too few samples in common") && !row.contains("0.000"), "{row}");
        }
        has(&text, &["Pairs and lags that were not tested: ", ": too few samples in common"]);
        assert!(!text.contains("every tested pair"), "{text}");
    }
}

#[test]
fn where_nothing_was_tested_nothing_is_said_of_links() {
    let dir = folder("data.csv", &disjoint(300));
    fs::write(
        dir.path().join("l.toml"),
        "only = true\n[[link]]\ncause = \"a\"\neffect = \"b\"\nlags = [1]\nis = \"allowed\"\n",
    )
    .expect("writes");
    let out = roscausal(dir.path(), &[&QUICK[..], &["--links", "l.toml", "--all"]].concat());
    let text = String::from_utf8_lossy(&out.stdout);
    has(&text, &["on 0 of 298 samples", "No pair has a result, so nothing is known of any link."]);
    has(&text, &["not tested: it was ruled out beforehand", "8: it was ruled out beforehand"]);
}

#[test]
fn the_samples_behind_each_link_are_those_that_its_test_used() {
    let mut state = 3_u64;
    let mut csv = "a,b,k\n".to_owned();
    for row in 0..400 {
        let k = if row % 40 < 12 { unit(&mut state).to_string() } else { String::new() };
        csv += &format!("{},{},{k}\n", unit(&mut state), unit(&mut state));
    }
    let model: Value =
        serde_json::from_str(&printed(&csv, "parcorr", &["--format", "json"])).expect("a model");
    let used = |i: usize, j: usize| model["n_matrix"][i][j][1].as_u64().expect("tested");
    let all: Vec<u64> = (0..9).map(|cell| used(cell / 3, cell % 3)).collect();
    let (fewest, most) = (all.iter().min().expect("nine"), all.iter().max().expect("nine"));
    // 120 rows have a value of k, and nothing else misses any.
    assert!(*most == 398 && (0..3).all(|i| used(i, 2) < 120 && used(2, i) <= 120), "{all:?}");
    assert_eq!(model["outcomes"][0][1], serde_json::json!(["not_asked", "tested"]));
    let text = printed(&csv, "parcorr", &[]);
    has(&text, &[&format!("on {fewest} to 398 samples")]);
}

/// `a` drives `b`, of which nine values in ten are missing.
#[test]
fn a_link_that_rests_on_few_samples_says_so() {
    let seldom = coupled(600).lines().enumerate().fold(String::new(), |csv, (row, line)| {
        let keep = row == 0 || row % 40 < 6;
        csv + if keep { line } else { line.rsplit_once(',').map_or("", |(kept, _)| kept) }
            + if keep { "\n" } else { ",\n" }
    });
    let text = printed(&seldom, "parcorr", &[]);
    let link = text.lines().find(|line| line.contains("drives b:")).expect("a link");
    assert!(link.contains(" of 598 samples") && text.contains("a at t-1"), "{text}");
}

#[test]
fn a_partial_run_says_nothing_of_what_it_did_not_test() {
    let mut state = 9_u64;
    let mut csv = String::from("a,b,c,d,e\n");
    (0..1500).for_each(|_| {
        let row: Vec<String> = (0..5).map(|_| unit(&mut state).to_string()).collect();
        csv += &format!("{}\n", row.join(","));
    });
    for method in ["lpcmci", "pcmciplus", "pcmci"] {
        let dir = folder("data.csv", &csv);
        let args = [
            "--method", method, "--test", "cmiknn", "--tau-max", "3", "--time-budget", "0.4", "--threads",
            "1",
        ];
        let out = roscausal(dir.path(), &[&["discover", "data.csv", "--all"], &args[..]].concat());
        let text = String::from_utf8_lossy(&out.stdout);
        has(&text, &["not tested: the time budget ended before", "This result is partial"]);
        assert!(!text.contains("strength 1.00"), "{method}: {text}");
        let json =
            roscausal(dir.path(), &[&["discover", "data.csv", "--format", "json"], &args[..]].concat());
        let model: Value = serde_json::from_slice(&json.stdout).expect("a model");
        let cells = |field: &str| model[field].to_string().matches("null").count();
        assert!(cells("val_matrix") > 10 && cells("val_matrix") == cells("p_matrix"), "{method}");
    }
}
