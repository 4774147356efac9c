//! The summaries of the twelve studies in docs/studies, as a reader has them: with the default settings.
//!
//! `ROSCAUSAL_WRITE_DOCS=1 cargo test --test studies` writes tests/studies/ anew: summaries (.txt) and models (.json).

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

/// A text as it is compared: without HTML's entities, and with settings as the engine spells them.
fn plain(text: &str) -> String {
    let entities = [("&gt;", ">"), ("&lt;", "<"), ("&quot;", "\""), ("&amp;", "&"), ("--", ""), ("-", "_")];
    entities.iter().fold(in_a_line(text), |text, (from, to)| text.replace(from, to))
}

/// What is between two marks; nothing if the first is not there.
fn between<'a>(text: &'a str, from: &str, to: &str) -> &'a str {
    text.split_once(from).map_or("", |(_, rest)| rest.split_once(to).map_or(rest, |(inside, _)| inside))
}

/// The items of a list in HTML.
fn items(list: &str) -> Vec<String> {
    list.split("<li>").skip(1).map(|item| plain(item.split("</li>").next().unwrap_or_default())).collect()
}

/// The first cells of each row of a table in HTML.
fn rows<const N: usize>(html: &str, label: &str) -> Vec<[String; N]> {
    let table = between(html, label, "</table>");
    let cells = |row: &str| -> Vec<String> {
        row.split("</td>").map(|cell| plain(cell.trim_start_matches("<td>"))).collect()
    };
    let rows = table.split("<tr>").filter(|row| row.starts_with("<td>")).map(cells);
    rows.map(|row| std::array::from_fn(|k| row[k].clone())).collect()
}

fn list<'a>(of: &'a Value, name: &str) -> &'a [Value] {
    of[name].as_array().expect("a list")
}

fn texts(of: &Value, name: &str) -> Vec<String> {
    list(of, name)
        .iter()
        .map(|one| plain(one.as_str().unwrap_or_else(|| one["text"].as_str().expect("a text"))))
        .collect()
}

/// Cause, effect, lag, value and p-value of a link.
fn facts(link: &Value) -> (&str, &str, u64, f64, f64) {
    let (text, number) = (|name: &str| link[name].as_str(), |name: &str| link[name].as_f64());
    let names = text("cause").zip(text("effect")).expect("names");
    let numbers = number("value").zip(number("p_value")).expect("numbers");
    (names.0, names.1, link["lag"].as_u64().expect("a lag"), numbers.0, numbers.1)
}

#[test]
fn terminal_json_and_report_have_the_same_facts_of_each_study() {
    let dir = tempfile::tempdir().expect("a folder");
    let quick = ["--method", "pcmci", "--test", "parcorr", "--tau-max", "3"];
    for (name, files) in studies() {
        for (kind, settings) in [("default", &[][..]), ("quick", &quick[..])] {
            let out = dir.path().join(format!("{name}_{kind}")).display().to_string();
            let text = printed(&files, &[settings, &["--out", &out]].concat());
            let json = fs::read_to_string(format!("{out}/model.json")).expect("a model");
            let report = format!("{out}.html");
            assert!(roscausal(dir.path(), &["show", &out, "--report", &report]).status.success());
            let html = fs::read_to_string(&report).expect("a report");
            // The models are also what the page and Python are compared with.
            let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/studies/{name}.json"));
            if kind == "default" && std::env::var_os("ROSCAUSAL_WRITE_DOCS").is_some() {
                fs::write(&file, &json).expect("writes");
            }
            assert!(kind == "quick" || json == fs::read_to_string(&file).expect("the model"), "{name}");
            let model: Value = serde_json::from_str(&json).expect("JSON");
            let summary = &model["summary"];

            // The sentences.
            assert_eq!(
                items(between(&html, "<ul class=\"conclusion\">", "</ul>")),
                texts(summary, "conclusion"),
                "{name}"
            );
            assert_eq!(items(between(&html, "<h3>Next</h3>", "</ol>")), texts(summary, "advice"), "{name}");
            let notes = texts(summary, "notes");
            let caveats = items(between(&html, "<h2 id=\"caveats\">", "</ul>"));
            assert!(notes.iter().all(|note| caveats.contains(note)), "{name}: {notes:?} {caveats:?}");
            let in_text = plain(&text);
            for sentence in texts(summary, "conclusion").iter().chain(&texts(summary, "advice")).chain(&notes)
            {
                assert!(in_text.contains(sentence), "{name}: {sentence}\n{text}");
            }

            // The links: all in the report, and those between two variables in the terminal.
            let linked = rows::<6>(&html, "Table of links");
            assert_eq!(linked.len(), list(&model, "links").len(), "{name}");
            for (link, row) in list(&model, "links").iter().zip(&linked) {
                let (cause, effect, lag, value, p) = facts(link);
                let p = if p < 0.001 { "<0.001".to_owned() } else { format!("{p:.4}") };
                let is_it = |of: &&Value| facts(of).0 == cause && facts(of).1 == effect && facts(of).2 == lag;
                let sure = list(summary, "links")
                    .iter()
                    .find(is_it)
                    .map_or("own past", |of| of["sure"].as_str().expect("a word"));
                let expected = [cause, effect, &lag.to_string(), &format!("{value:.3}"), &p, sure].map(plain);
                assert_eq!(*row, expected, "{name}");
            }
            let shown: Vec<String> = text.lines().map(plain).collect();
            for link in list(summary, "links").iter().take(6) {
                let (cause, effect, lag, value, p) = facts(link);
                let p = if p < 0.001 { "p < 0.001".to_owned() } else { format!("p = {p:.3}") };
                let start = plain(&format!(
                    "{cause} {} {effect} {:.1} s later {value:.2} {p} ",
                    link["mark"].as_str().expect("a mark"),
                    0.1 * lag as f64
                ));
                let row = shown
                    .iter()
                    .find(|line| line.starts_with(&start))
                    .unwrap_or_else(|| panic!("{name}: {start}\n{text}"));
                assert!(row.contains(&plain(link["sure"].as_str().expect("a word"))), "{name}: {row}");
            }

            // All tests, folded at the end.
            let tests = rows::<7>(&html, "Table of all tests");
            let tested = model["p_matrix"]
                .to_string()
                .split([',', '[', ']'])
                .filter(|cell| cell.parse::<f64>().is_ok())
                .count();
            assert_eq!(tests.len(), tested, "{name}");
            let (_, end) = html.rsplit_once("<h2 ").expect("a section");
            assert!(
                tests.is_empty() || end.contains(&format!("<details><summary>All {tested} tests</summary>")),
                "{name}"
            );
            assert_eq!(tests.iter().filter(|row| !row[6].is_empty()).count(), linked.len(), "{name}");
        }
    }
}
