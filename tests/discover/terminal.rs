//! The command in a terminal: pipes, full disks, Ctrl-C, words that are not known.

use std::{
    fs,
    io::{BufRead, BufReader},
    process::{Command, Stdio},
};

use super::{QUICK, common::roscausal, complaint, coupled, folder, has};

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
        let reported = String::from_utf8_lossy(&out.stderr);
        assert!(out.status.success() && !reported.contains("panicked"), "{reported}");
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
        let reported = String::from_utf8_lossy(&out.stderr);
        assert_eq!(out.status.code(), Some(1), "{reported}");
        has(&reported, &["error: the results cannot be written to the standard output: No space left"]);
        assert!(!reported.contains("panicked"), "{reported}");
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
        let reported = String::from_utf8_lossy(&out.stderr);
        assert_eq!(out.status.code(), Some(1), "{args:?}: {reported}");
        has(&reported, &["error: the results cannot be written to the standard output: No space left"]);
        assert_eq!(reported.lines().count(), 1, "{reported}");
        let out = run(Stdio::piped());
        assert!(out.status.success() && out.stderr.is_empty(), "{args:?}");
        assert!(out.stdout.starts_with(b"roscausal ") || out.stdout.windows(6).any(|at| at == b"Usage:"));
        assert!(!out.stdout.contains(&0x1b), "{args:?}");
    }
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
    for lag in ["1000000000", "18446744073709551615"] {
        has(&complaint(&data, &["--tau-max", lag], 2), &[&format!("--tau-max: {lag} is above 100000")]);
    }
}

/// Starts an analysis that takes a while, sends it SIGINT, and returns how it ended.
#[cfg(unix)]
#[test]
fn ctrl_c_ends_an_analysis_with_code_130_and_fitting_words() {
    let dir = folder("data.csv", &coupled(60_000));
    let mut command = Command::new(env!("CARGO_BIN_EXE_roscausal"));
    command
        .current_dir(dir.path())
        .args(["discover", "data.csv", "--method", "pcmci", "--out", "r", "--force", "--threads", "1"]);
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("starts");
    // Its own words say that it is at work.
    let mut lines = BufReader::new(child.stderr.take().expect("piped")).lines();
    let mut reported = String::new();
    while !reported.contains("this will take about") {
        reported += &lines.next().unwrap_or_else(|| panic!("it ended: {reported}")).expect("text");
    }
    let kill = Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("kill is there");
    assert!(kill.success());
    lines.map_while(Result::ok).for_each(|line| reported += &line);
    let out = child.wait_with_output().expect("ends");
    assert_eq!(out.status.code(), Some(130), "{reported}");
    has(&reported, &["ending; there is no result yet, and nothing is written"]);
    assert!(!reported.contains("recorded") && out.stdout.is_empty(), "{reported}");
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
    let (code, reported, silent) = run("mine", &[]);
    assert!(code == Some(1) && silent, "{reported}");
    has(&reported, &["there are files of others in this folder", "--force"]);
    assert!(!dir.path().join("mine/model.json").exists());
    assert_eq!(run("mine", &["--force"]).0, Some(0));
    assert!(dir.path().join("mine/thesis.txt").exists());
    // Our own folder may be written again.
    assert_eq!([run("new", &[]).0, run("new", &[]).0, run("mine", &[]).0], [Some(0); 3]);
    let (code, reported, silent) = run("data.csv", &[]);
    assert!(code == Some(1) && silent, "{reported}");
    has(&reported, &["data.csv", "no results can be written here"]);
}

#[test]
fn quiet_says_nothing_but_errors_and_no_file_gets_colours() {
    let dir = folder("data.csv", &coupled(300));
    fs::write(dir.path().join("roscausal.toml"), "tau-max = 2\n").expect("writes");
    let reported = |more: &[&str]| {
        let out = roscausal(dir.path(), &[&QUICK[..], more].concat());
        assert!(!out.stdout.contains(&0x1b) && !out.stderr.contains(&0x1b), "colours in a file");
        String::from_utf8_lossy(&out.stderr).into_owned()
    };
    has(&reported(&[]), &["settings of roscausal.toml: --tau-max=2"]);
    assert_eq!(reported(&["--quiet"]), "");
    has(&reported(&["--quiet", "--alpha", "2"]), &["error: --alpha: 2 is not a level"]);
}

#[test]
fn a_parameter_beside_the_data_that_is_not_set_is_left_out() {
    let dir = folder("data.csv", &coupled(300));
    let unset = "resamples = 0\nresampling = 'subsample'\nresample_share = 0.632\nresample_block = '1'\nf_alpha = 0.0\n\
                 pc_alpha = -1.0\nthreads = 0\ntime_budget = 0.0\nvectors = []\nacts_on = []\n";
    fs::write(dir.path().join("roscausal.toml"), format!("[discovery]\n{unset}max_lag = 2\n"))
        .expect("writes");
    let out = roscausal(dir.path(), &QUICK);
    let reported = String::from_utf8_lossy(&out.stderr).into_owned();
    assert!(out.status.success(), "{reported}");
    has(&reported, &["settings of roscausal.toml: --tau-max=2\n"]);
}

#[test]
fn shuffles_beside_the_data_are_left_out_only_where_the_named_test_draws_none() {
    let dir = folder("data.csv", &coupled(300));
    fs::write(dir.path().join("roscausal.toml"), "significance = 'shuffle'\nshuffles = 100\n")
        .expect("writes");
    let reported = |more: &[&str]| {
        let out = roscausal(dir.path(), &[&QUICK[..], more].concat());
        let reported = String::from_utf8_lossy(&out.stderr).into_owned();
        assert!(out.status.success(), "{reported}");
        reported
    };
    has(&reported(&[]), &["--shuffles=100", "--significance=shuffle"]);
    has(&reported(&["--significance", "shuffle"]), &["settings of roscausal.toml: --shuffles=100\n"]);
    assert!(!reported(&["--significance", "analytic"]).contains("--shuffles"));
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
