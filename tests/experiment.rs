//! `roscausal experiment` and interventions from the command line.

#![allow(clippy::expect_used, clippy::panic, reason = "a test may panic: that is how it fails")]

mod common;

use std::{fs, path::Path, process::Output};

use common::roscausal;

/// A small sweep into `out`.
fn sweep(dir: &Path, out: &str, more: &[&str]) -> Output {
    let mut args =
        vec!["experiment", "--seeds", "1..3", "--lengths", "40,20", "--steps", "0.5,0.3", "--out", out];
    args.extend(["--risk-models", "v1_1", "--risk-lags", "1", "--methods", "pcmci", "--tests", "parcorr"]);
    args.extend(more);
    roscausal(dir, &args)
}

fn read(dir: &Path, name: &str) -> String {
    fs::read_to_string(dir.join(name)).expect(name)
}

#[test]
fn shards_merge_to_what_one_machine_finds_whatever_its_threads() {
    let dir = tempfile::tempdir().expect("a folder");
    let done = |output: Output| {
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    let table = done(sweep(dir.path(), "whole", &["--threads", "1"]));
    assert!(
        table.contains("| h_v -> h_dg |") && table.contains("mean structural Hamming distance"),
        "{table}"
    );
    done(sweep(dir.path(), "one", &["--shard", "1/2", "--threads", "2"]));
    done(sweep(dir.path(), "two", &["--shard", "2/2"]));
    done(roscausal(dir.path(), &["experiment", "merge", "one", "two", "--out", "joined"]));
    let whole = read(dir.path(), "whole/recall.csv");
    assert_eq!(whole, read(dir.path(), "joined/recall.csv"));
    // Three settings (the base, one other length, one other step), six possible links.
    assert_eq!(whole.lines().count(), 1 + 3 * 6);
    assert!(whole.lines().skip(1).all(|line| line.contains(",3,0.")), "{whole}");
    assert_eq!(fs::read_dir(dir.path().join("joined/runs")).expect("lists").count(), 9);
    assert!(read(dir.path(), "joined/length.svg").contains("structural Hamming distance"));
}

#[test]
fn a_sweep_goes_on_where_it_ended() {
    let dir = tempfile::tempdir().expect("a folder");
    assert!(sweep(dir.path(), "out", &[]).status.success());
    let runs = dir.path().join("out/runs");
    let mut names: Vec<_> = fs::read_dir(&runs).expect("lists").flatten().map(|entry| entry.path()).collect();
    names.sort();
    let recall = read(dir.path(), "out/recall.csv");
    // An existing run is taken as it is; a missing one is run.
    let marked =
        fs::read_to_string(&names[0]).expect("reads").replace("\"run_time_s\": ", "\"run_time_s\": 1000");
    fs::write(&names[0], marked).expect("writes");
    fs::remove_file(&names[1]).expect("removes");
    assert!(sweep(dir.path(), "out", &[]).status.success());
    assert!(names[1].exists());
    assert_eq!(recall, read(dir.path(), "out/recall.csv"));
    let run_times = read(dir.path(), "out/runs.csv");
    assert_eq!(run_times.lines().filter(|line| line.contains(",1000")).count(), 1, "{run_times}");
}

#[test]
fn an_experiment_that_makes_no_sense_is_bad_usage() {
    let dir = tempfile::tempdir().expect("a folder");
    for more in [["--shard", "3/2"], ["--risk-noise", "-1"], ["--scenarios", "thr"], ["--do", "robot.fly"]] {
        let output = sweep(dir.path(), "out", &more);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{more:?}: {text}");
    }
    let merged = roscausal(dir.path(), &["experiment", "merge", "nowhere"]);
    assert_eq!(merged.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&merged.stderr).contains("nowhere/runs"));
}

#[test]
fn an_intervention_is_recorded_and_nothing_causes_it() {
    let dir = tempfile::tempdir().expect("a folder");
    let args = ["demo", "--duration", "80", "--out", "out", "--method", "pcmci", "--test", "parcorr"];
    let output = roscausal(dir.path(), &[&args[..], &["--do", "robot.speed=0.2@10..30"]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let model: serde_json::Value =
        serde_json::from_str(&read(dir.path(), "out/model.json")).expect("is JSON");
    let features = model["features"].as_array().expect("a list");
    assert!(features.contains(&"do_robot_speed".into()), "{features:?}");
    let links = model["links"].as_array().expect("a list");
    assert!(!links.is_empty() && links.iter().all(|link| link["effect"] != "do_robot_speed"));
    let batches = dir.path().join("out/pp_pool/analysed");
    let mut facts: Vec<_> =
        fs::read_dir(batches).expect("lists").flatten().map(|entry| entry.path()).collect();
    facts.retain(|path| path.extension().is_some_and(|extension| extension == "json"));
    facts.sort();
    let first: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(&facts[0]).expect("reads")).expect("JSON");
    assert_eq!(first["interventions"][0]["column"], "do_robot_speed");
    assert_eq!(first["interventions"][0]["value"], serde_json::json!([0.2]));
}

#[test]
fn twin_runs_are_equal_until_the_action_and_their_answers_are_the_same_bytes_whatever_the_threads() {
    let dir = tempfile::tempdir().expect("a folder");
    let asked = |out: &str, threads: &str| {
        let few = ["--seeds", "101", "--starts", "60", "--equations", "linear", "--train", "1"];
        let args = [&["experiment", "reasoning", "--out", out, "--threads", threads], &few[..]].concat();
        let output = roscausal(dir.path(), &args);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    let text = asked("one", "1");
    assert!(text.contains("| too fast | 100 % | 0 |") && text.contains("by correlation"), "{text}");
    assert!(!text.contains("NaN") && !read(dir.path(), "one/figures.json").contains("null"), "{text}");
    let cases = read(dir.path(), "one/cases.csv");
    // 2 actions, 10 steps, 4 variables.
    assert_eq!(cases.lines().count(), 1 + 80);
    let cells = |start: &str| -> Vec<f64> {
        let line = cases.lines().find(|line| line.starts_with(start)).expect(start);
        line.split(',').skip(5).take(2).map(|cell| cell.parse().expect("a number")).collect()
    };
    // What came about without and with the action, as the demo records it: the newest of its three sightings a row.
    for (start, untouched, real) in [
        ("101,60,stop,1,h_v,", 0.3755, 0.3755),
        ("101,60,stop,1,r_v,", 0.8051, 0.6371),
        ("101,60,stop,10,h_v,", 1.3614, 0.1432),
        ("101,60,stop,10,d,", 4.3787, 3.2659),
        ("101,60,slow,10,d,", 4.3787, 3.7389),
    ] {
        let got = cells(start);
        assert!((got[0] - untouched).abs() < 1e-3 && (got[1] - real).abs() < 1e-3, "{start}: {got:?}");
    }
    asked("two", "2");
    assert_eq!(cases, read(dir.path(), "two/cases.csv"));
    assert_eq!(read(dir.path(), "one/figures.json"), read(dir.path(), "two/figures.json"));
}

#[test]
fn an_experiment_on_what_the_model_was_fitted_on_is_bad_usage() {
    let dir = tempfile::tempdir().expect("a folder");
    for (more, words) in [
        (["--seeds", "2..5"], "seed 2 is one of --train"),
        (["--starts", "nan"], "NaN is not a moment"),
        (["--starts", "5"], "5 is not a moment"),
        (["--threads", "0"], "--threads: 0 does nothing"),
    ] {
        let output = roscausal(dir.path(), &[&["experiment", "reasoning"], &more[..]].concat());
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{more:?}: {text}");
        assert!(text.contains(words), "{more:?}: {text}");
    }
}

#[test]
fn a_planner_that_asks_is_set_beside_fixed_speeds_with_the_same_bytes_whatever_the_threads() {
    let dir = tempfile::tempdir().expect("a folder");
    let tried = |out: &str, threads: &str| {
        let few = ["--seeds", "101..102", "--train", "1", "--legs", "1", "--equations", "linear"];
        let args = [&["experiment", "planner", "--out", out, "--threads", threads], &few[..]].concat();
        let output = roscausal(dir.path(), &args);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    let text = tried("one", "1");
    assert!(text.contains("| planner that asks what if | 2 of 2 |") && !text.contains("NaN"), "{text}");
    let trials = read(dir.path(), "one/trials.csv");
    let cells = |seed: u32, policy: &str| -> Vec<f64> {
        let start = format!("{seed},\"{policy}");
        let line = trials.lines().find(|line| line.starts_with(&start)).expect(policy);
        let after = line.rsplit_once("\",").expect("a name in quotes").1;
        after.split(',').map(|cell| cell.parse().expect("a number")).collect()
    };
    for seed in [101, 102] {
        let (slow, fast, planner) =
            (cells(seed, "always 0.2"), cells(seed, "always 0.8"), cells(seed, "planner"));
        // Sooner with more speed; the planner is neither slower than the slowest nor faster than the fastest.
        assert!(fast[0] <= planner[0] && planner[0] <= slow[0] && fast[0] < slow[0], "{trials}");
        // It asked about twice a second, and got answers that it could use.
        assert!(
            (planner[0] * 2.0 - planner[5]).abs() < 0.1 * planner[5] + 2.0 && planner[6] > 0.5 * planner[5],
            "{trials}"
        );
        assert!(slow[5] == 0.0 && slow[1] >= 1.0, "{trials}");
    }
    tried("two", "2");
    assert_eq!(trials, read(dir.path(), "two/trials.csv"));
    let output = roscausal(dir.path(), &["experiment", "planner", "--seeds", "4..9"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("seed 4 is one of --train"));
}

#[test]
fn changes_that_nobody_announced_are_told_announced_ones_are_not_and_threads_change_nothing() {
    let dir = tempfile::tempdir().expect("a folder");
    let reported = |out: &str, more: &[&str]| {
        let few = ["--seeds", "1..2", "--before", "1800", "--after", "900", "--do", "robot.off", "--waiting"];
        let args = [&["experiment", "changes", "--out", out], &few[..], more].concat();
        let output = roscausal(dir.path(), &args);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        (text, read(dir.path(), &format!("{out}/changes.csv")))
    };
    let (text, csv) = reported("one", &["--threads", "1"]);
    assert!(text.contains("robot.off not announced, 2 runs, batches of 300 s at 0.3 s, parcorr"), "{text}");
    assert!(text.contains("told in ") && text.contains("false alarms: ") && !text.contains("NaN"), "{text}");
    assert_eq!(csv.lines().next(), Some("seed,action_s,told_s,kind,cause,effect,lag,before,after,p_value"));
    let rows: Vec<Vec<&str>> = csv.lines().skip(1).map(|line| line.split(',').collect()).collect();
    let number = |cell: &str| -> f64 { cell.parse().expect("a number") };
    // Each event is of a seed, is told at the end of a batch, and has the moment at which the robot first waited after 1800 s.
    assert!(rows.iter().all(|row| ["1", "2"].contains(&row[0])), "{csv}");
    assert!(rows.iter().all(|row| (number(row[2]) % 300.0).abs() < 0.3), "{csv}");
    assert!(rows.iter().all(|row| (1795.0..2400.0).contains(&number(row[1]))), "{csv}");
    let after = |row: &&Vec<&str>| number(row[2]) > number(row[1]);
    assert!(rows.iter().any(|row| after(&row)), "nobody is told of it: {csv}");
    assert_eq!(reported("two", &["--threads", "2"]).1, csv);
    // What is announced is not a change.
    let (text, announced) = reported("announced", &["--announced"]);
    assert!(text.contains("robot.off announced"), "{text}");
    let of = |csv: &str| {
        csv.lines().skip(1).filter(|line| after(&&line.split(',').collect::<Vec<&str>>())).count()
    };
    assert_eq!(of(&announced), 0, "{announced}");
    // Without an action all that is told is a false alarm.
    let args =
        ["experiment", "changes", "--out", "none", "--seeds", "1..1", "--before", "1800", "--after", "0"];
    let output = roscausal(dir.path(), &args);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(
        output.status.success() && text.contains("unchanged") && text.contains("in 0.5 h without"),
        "{text}"
    );
}

#[test]
fn an_experiment_on_changes_that_makes_no_sense_is_bad_usage() {
    let dir = tempfile::tempdir().expect("a folder");
    for (more, words) in [
        (&["--do", "robot.off@30..60"][..], "--do: 'robot.off@30..60' has a time"),
        (&["--before", "100"], "--before: 100 is not a number of seconds from 600"),
        (&["--dt", "0"], "--dt"),
        (&["--do", "robot.off", "--after", "10"], "--after"),
        (&["--waiting"], "--do"),
        (&["--scenario", "thr"], "thr"),
    ] {
        let output = roscausal(dir.path(), &[&["experiment", "changes"], more].concat());
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{more:?}: {text}");
        assert!(text.contains(words), "{more:?}: {text}");
    }
}

#[test]
fn resamples_give_a_sweep_the_table_of_what_shares_meant_and_shards_merge_to_it() {
    let dir = tempfile::tempdir().expect("a folder");
    let done = |output: Output| {
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    let whole = done(sweep(dir.path(), "whole", &["--resamples", "20", "--threads", "1"]));
    let table = |text: &str| {
        text.split_once("What a share of resamples meant")
            .map(|(_, rest)| rest.split("\n\n").next().unwrap_or_default().to_owned())
    };
    let shown = table(&whole).expect("a table");
    assert!(shown.starts_with(", in 9 runs:"), "{shown}");
    let links: usize = shown
        .lines()
        .filter(|line| {
            line.contains("firm")
                || line.contains("likely")
                || line.contains("unsure")
                || line.contains("absent")
        })
        .map(|line| line.split('|').nth(3).expect("a cell").trim().parse::<usize>().expect("a number"))
        .sum();
    // 9 runs with 6 possible cross links.
    assert_eq!(links, 54, "{shown}");
    done(sweep(dir.path(), "one", &["--shard", "1/2", "--resamples", "20", "--threads", "2"]));
    done(sweep(dir.path(), "two", &["--shard", "2/2", "--resamples", "20"]));
    let joined = done(roscausal(dir.path(), &["experiment", "merge", "one", "two", "--out", "joined"]));
    assert_eq!(table(&joined).expect("a table"), shown);
    assert!(table(&done(sweep(dir.path(), "without", &[]))).is_none());
    // The runs without resamples are others: none is taken for one with them.
    let output = sweep(dir.path(), "bad", &["--resamples", "5"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("--resamples: 5 is not from 20"));
}

#[test]
fn days_are_recorded_analysed_and_asked_for_a_route() {
    let dir = tempfile::tempdir().expect("a folder");
    let done = |args: &[&str]| {
        let output = roscausal(dir.path(), args);
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(output.status.success(), "{args:?}: {text}{}", String::from_utf8_lossy(&output.stderr));
        text
    };
    let table = done(&["experiment", "day", "--hours", "1", "--seeds", "1..1", "--tables", "--out", "days"]);
    assert!(table.contains("causal") && table.contains("a team doubled"), "{table}");
    assert_eq!(read(dir.path(), "days/days.csv").lines().count(), 1 + 4 * 6);
    let days: Vec<String> = (1..=4).map(|day| format!("days/house_1_day_{day}.csv")).collect();
    // Of days of one hour two may be the same at the charger.
    let mut analyse = vec!["discover", &days[0]];
    analyse.extend(["--recording", "place", "--columns", "people,robot,hour", "--method", "pcmci"]);
    analyse.extend(["--test", "parcorr", "--tau-max", "1", "-o", "model"]);
    done(&analyse);
    let days = days.join(",");
    let mut ask = vec!["route", "model", "--map", "days/house_1.toml", "--data", &days];
    ask.extend(["--from", "dock_s0", "--to", "dock_n3", "--at", "8:30"]);
    let text = done(&ask);
    assert!(text.contains("people on the way") && text.contains("It rests on 4 days"), "{text}");
    let json = done(&[ask.as_slice(), &["--json", "--loaded", "--allowed", "120"]].concat());
    assert!(json.contains("\"places\":[\"dock_s0\"") && json.contains("dock_n3"), "{json}");
    // A place may be written as its name.
    let map = read(dir.path(), "days/house_1.toml");
    let names: Vec<&str> =
        map.lines().filter_map(|line| line.strip_prefix("name = \"")?.strip_suffix('"')).collect();
    for day in days.split(',') {
        let named = |line: &str| {
            let cells: Vec<&str> = line.splitn(3, ',').collect();
            let place = cells[1].parse().map_or(cells[1], |place: usize| names[place]);
            format!("{},{place},{}\n", cells[0], cells[2])
        };
        let table: String = read(dir.path(), day).lines().map(named).collect();
        fs::write(dir.path().join(day), table).expect("writes");
    }
    assert_eq!(done(&ask), text);
    for (flag, value, code) in
        [("--at", "20:00", 3), ("--to", "moon", 2), ("--now", "1,2", 2), ("--at", "8:99", 2)]
    {
        let mut wrong = ask.clone();
        match wrong.iter().position(|word| *word == flag) {
            Some(place) => wrong[place + 1] = value,
            None => wrong.extend([flag, value]),
        }
        let output = roscausal(dir.path(), &wrong);
        assert_eq!(
            output.status.code(),
            Some(code),
            "{flag} {value}: {}",
            String::from_utf8_lossy(&output.stderr)
        );
    }
}
