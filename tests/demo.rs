//! `roscausal demo` as a newcomer runs it.

#![allow(clippy::expect_used, clippy::panic, reason = "a test may panic: that is how it fails")]

use std::{collections::BTreeMap, fs, path::Path, process::Output};

fn demo(dir: &Path, args: &[&str]) -> Output {
    std::process::Command::new(env!("CARGO_BIN_EXE_roscausal"))
        .arg("demo")
        .args(args)
        .current_dir(dir)
        .output()
        .expect("the command starts")
}

/// Every file below a folder, by its relative path.
fn files(dir: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut open = vec![dir.to_path_buf()];
    while let Some(folder) = open.pop() {
        for entry in fs::read_dir(&folder).expect("lists").flatten() {
            let path = entry.path();
            if path.is_dir() {
                open.push(path);
            } else {
                let name = path.strip_prefix(dir).expect("is inside").display().to_string();
                found.insert(name, fs::read(&path).expect("reads"));
            }
        }
    }
    found
}

#[test]
fn the_same_seed_gives_the_same_batches_and_models_with_any_number_of_threads() {
    let dir = tempfile::tempdir().expect("a folder");
    let run = |out: &str, threads: &str| {
        let args = ["--seed", "3", "--duration", "60", "--threads", threads, "--out", out];
        let output = demo(dir.path(), &args);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        (String::from_utf8_lossy(&output.stdout).into_owned(), files(&dir.path().join(out)))
    };
    let (text, one) = run("one", "1");
    let (again, two) = run("two", "2");
    assert!(text.contains("Beside the paper's expected model:"), "{text}");
    // Its last words: one what-if and one explanation, and the commands that give them.
    let closing = |text: &str| text[text.find("What if").expect("a what-if")..].to_owned();
    let stated = closing(&text);
    assert!(stated.contains("Why did") && stated.contains("go on: after 10 steps (3 s)"), "{stated}");
    // A command to copy is one line.
    let mut said = stated.lines().filter(|line| !line.starts_with("  roscausal "));
    assert!(said.all(|line| line.chars().count() <= 80), "{stated}");
    assert!(stated.contains("roscausal whatif one/model.json --data one/pp_pool/analysed/"), "{stated}");
    assert_eq!(stated, closing(&again).replace("two/", "one/"));
    let batches = one.keys().filter(|name| name.starts_with("pp_pool/analysed/") && name.ends_with(".csv"));
    assert_eq!(batches.count(), 2);
    assert!(one.contains_key("model.json") && one.contains_key("dag.png") && one.contains_key("dag.svg"));
    assert_eq!(one.keys().collect::<Vec<_>>(), two.keys().collect::<Vec<_>>());
    // The list of results knows in which file it is.
    for (name, bytes) in one.iter().filter(|(name, _)| *name != ".roscausal/list.json") {
        assert!(bytes == &two[name], "{name} differs");
    }
}

#[test]
fn the_pictures_in_the_readme_are_those_of_the_demo() {
    let dir = tempfile::tempdir().expect("a folder");
    let output = demo(dir.path(), &[]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs");
    for (made, shown) in [("dag.svg", "demo-dag.svg"), ("run.svg", "run.svg")] {
        let made = fs::read(dir.path().join("roscausal_demo").join(made)).expect("the demo writes it");
        let shown_now = fs::read(docs.join(shown)).expect("is there");
        assert!(made == shown_now, "docs/{shown} is stale: docs/pictures.sh demo makes it anew");
    }
}

#[test]
fn every_picture_of_the_readme_and_of_the_page_is_made_by_the_script() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let script = std::fs::read_to_string(root.join("docs/pictures.sh")).expect("the script");
    let mut seen = 0;
    for (page, folder) in [("README.md", ""), ("docs/dashboard.md", "docs/"), ("docs/simulator.md", "docs/")]
    {
        let text = std::fs::read_to_string(root.join(page)).expect("the page");
        for part in text.split("<img src=\"").skip(1) {
            let picture = format!("{folder}{}", part.split('"').next().expect("its name"));
            assert!(root.join(&picture).is_file(), "{page}: there is no {picture}");
            assert!(script.contains(&format!(" {picture}\n")), "docs/pictures.sh does not make {picture}");
            seen += 1;
        }
    }
    assert!(seen >= 3, "{seen}");
}

#[test]
fn every_built_in_scenario_ends_with_a_model() {
    let dir = tempfile::tempdir().expect("a folder");
    for scenario in roscausal_hrisim::scenario::SCENARIOS {
        let quick = ["--duration", "60", "--method", "pcmci", "--test", "parcorr", "--out", scenario];
        let output = demo(dir.path(), &[&["--scenario", scenario], &quick[..]].concat());
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{scenario}: {text}");
        assert!(dir.path().join(scenario).join("model.json").exists(), "{scenario}");
    }
}

#[test]
fn a_scenario_that_gives_no_batch_is_told_at_once() {
    let dir = tempfile::tempdir().expect("a folder");
    fs::write(dir.path().join("alone.toml"), "robots = []\n").expect("writes");
    let output = demo(dir.path(), &["--scenario", "alone.toml", "--duration", "60"]);
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert!(text.contains("gave 0 of the 2 batches of 30 s"), "{text}");
}

#[test]
fn a_folder_that_no_demo_made_is_left_alone() {
    let dir = tempfile::tempdir().expect("a folder");
    fs::create_dir_all(dir.path().join("mine/data_pool")).expect("makes");
    fs::write(dir.path().join("mine/data_pool/thesis.csv"), "a,b\n").expect("writes");
    let output = demo(dir.path(), &["--duration", "60", "--out", "mine"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("choose another --out"));
    assert!(dir.path().join("mine/data_pool/thesis.csv").exists());
}

#[test]
fn an_unknown_scenario_or_method_is_bad_usage() {
    let dir = tempfile::tempdir().expect("a folder");
    for args in [["--scenario", "thr"], ["--method", "pcmcy"], ["--duration", "-3"]] {
        let output = demo(dir.path(), &args);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{args:?}: {text}");
    }
}

#[test]
fn a_seed_that_the_nodes_cannot_hold_is_refused_before_anything_is_simulated() {
    let dir = tempfile::tempdir().expect("a folder");
    for seed in ["9000000000000001", "9223372036854775808", "18446744073709551615"] {
        let output = demo(dir.path(), &["--seed", seed]);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!((output.status.code(), output.stdout.len()), (Some(2), 0), "{text}");
        assert!(text.contains(&format!("--seed: {seed} is more than the nodes take")), "{text}");
        assert_eq!(text.trim_end().lines().count(), 1, "{text}");
    }
    assert!(!dir.path().join("roscausal_demo").exists());
}

#[test]
fn the_demo_writes_a_small_report_and_says_where() {
    let dir = tempfile::tempdir().expect("a folder");
    let output = demo(dir.path(), &["--duration", "60", "--method", "pcmci", "--test", "parcorr"]);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let last = text.lines().last().expect("a line");
    assert!(last.starts_with("Open roscausal_demo/report.html in a browser"), "{last}");
    let html = fs::read_to_string(dir.path().join("roscausal_demo/report.html")).expect("a report");
    assert!(html.len() < 1_000_000, "{} bytes", html.len());
    let model: serde_json::Value =
        serde_json::from_slice(&fs::read(dir.path().join("roscausal_demo/model.json")).expect("a model"))
            .expect("JSON");
    let links = model["links"].as_array().expect("links").len();
    assert!(links > 0 && html.matches("class=\"dots\"").count() >= links, "every link has its samples");
    assert!(html.contains("roscausal demo --scenario") && !html.contains("<script"));
}
