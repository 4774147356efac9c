//! The summaries of the twelve studies in docs/studies, as a reader has them: with the default settings.
//!
//! `ROSCAUSAL_WRITE_DOCS=1 cargo test --test studies` writes tests/studies/*.txt anew.

#![allow(clippy::expect_used, clippy::panic, reason = "a test may panic: that is how it fails")]

mod common;

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use common::{in_a_line, roscausal};
use serde_json::Value;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/studies")
}

/// The files of each study.
fn studies() -> BTreeMap<String, Vec<String>> {
    let mut studies = BTreeMap::<String, Vec<String>>::new();
    for entry in fs::read_dir(folder()).expect("the studies") {
        let path = entry.expect("an entry").path();
        if path.extension().is_some_and(|ending| ending == "csv") {
            let name = path.file_stem().expect("a name").to_string_lossy().into_owned();
            studies.entry(name[..3].to_owned()).or_default().push(format!("{name}.csv"));
        }
    }
    studies.values_mut().for_each(|files| files.sort());
    studies
}

fn printed(files: &[String], more: &[&str]) -> String {
    let files = files.iter().map(String::as_str);
    let args: Vec<&str> = ["discover"].into_iter().chain(files).chain(more.iter().copied()).collect();
    let out = roscausal(&folder(), &args);
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    String::from_utf8_lossy(&out.stdout).into_owned()
}

#[test]
fn the_summary_of_each_study_is_the_one_that_was_looked_at_and_fits_a_screen() {
    let studies = studies();
    assert_eq!(studies.len(), 12);
    for (name, files) in studies {
        let text = printed(&files, &[]);
        // The time of the run is nobody's claim.
        let (head, rest) = text.split_once("\nConclusion\n").expect("a conclusion");
        let head = in_a_line(head).split(", found in").next().expect("a headline").to_owned();
        let made = format!("{head}\nConclusion\n{rest}");
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/studies/{name}.txt"));
        if std::env::var_os("ROSCAUSAL_WRITE_DOCS").is_some() {
            fs::write(&file, &made).expect("writes");
        }
        assert_eq!(made, fs::read_to_string(&file).expect("the summary"), "{name}");
        let long: Vec<&str> = text.lines().filter(|line| line.chars().count() > 80).collect();
        assert!(
            long.is_empty() && text.lines().count() <= 24,
            "{name}: {} lines, {long:?}",
            text.lines().count()
        );
    }
}

#[test]
fn long_names_fit_a_screen_too() {
    let dir = tempfile::tempdir().expect("a folder");
    let table = fs::read_to_string(folder().join("s01.csv")).expect("a study");
    let (_, rows) = table.split_once('\n').expect("rows");
    let [cause, effect] = ["distance_to_the_nearest_person_in_front", "walking_speed_of_the_person_followed"];
    fs::write(dir.path().join("long.csv"), format!("time,{cause},{effect},hand\n{rows}")).expect("writes");
    let out = roscausal(dir.path(), &["discover", "long.csv", "--method", "pcmci", "--test", "parcorr"]);
    let text = String::from_utf8_lossy(&out.stdout);
    assert!(text.contains(&format!("\n  {cause} -->\n  {effect}\n    0.1 s later  0.")), "{text}");
    assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");
}

#[test]
fn terminal_json_and_report_have_the_same_facts() {
    let dir = tempfile::tempdir().expect("a folder");
    let files = &studies()["s02"];
    let quick = ["--method", "pcmci", "--test", "parcorr", "--tau-max", "3"];
    let model: Value =
        serde_json::from_str(&printed(files, &[&quick[..], &["--format", "json"]].concat())).expect("JSON");
    let text = in_a_line(&printed(files, &quick));
    let data = folder().join(&files[0]).display().to_string();
    let args = [&["report", data.as_str(), "-o", "r.html"][..], &quick].concat();
    assert!(roscausal(dir.path(), &args).status.success());
    let html = fs::read_to_string(dir.path().join("r.html")).expect("a report").replace("&gt;", ">");
    let summary = &model["summary"];
    let sentences = |field: &str| summary[field].as_array().expect("a list").clone();
    let spelled = |text: &str| {
        text.replace(": fdr", ": --fdr")
            .replace("method lpcmci", "--method lpcmci")
            .replace("resamples 100", "--resamples 100")
    };
    let about = Some(&summary["about_data"]).filter(|about| !about.is_null());
    for sentence in sentences("conclusion").iter().chain(about).chain(&sentences("notes")) {
        let sentence = spelled(sentence.as_str().expect("a text"));
        assert!(text.contains(&sentence) && html.contains(&sentence), "{sentence}\n{text}");
    }
    for advice in sentences("advice") {
        let advice = spelled(advice["text"].as_str().expect("a text"));
        assert!(text.contains(&advice) && html.contains(&advice), "{advice}\n{text}");
    }
    let first = &sentences("links")[0];
    assert_eq!(
        (&first["cause"], &first["effect"], &first["lag"]),
        (&"push".into(), &"turn".into(), &3.into())
    );
    assert!(text.contains("push --> turn 0.3 s later"), "{text}");
}
