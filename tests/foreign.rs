//! Data that this project did not make, read as they come by the commands that docs/data.md gives.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use std::{fs, path::Path};

use common::roscausal;
use serde_json::Value;

/// The commands under "Data of others" in docs/data.md.
fn documented() -> Vec<String> {
    let text = fs::read_to_string(root().join("docs/data.md")).expect("is there");
    let (_, part) = text.split_once("## Data of others").expect("the section");
    let (_, block) = part.split_once("```sh\n").expect("its commands");
    let (block, _) = block.split_once("```").expect("their end");
    block.lines().map(str::to_owned).collect()
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The words of a command, as a shell reads them: quotes, and one star in a file's name.
fn words(line: &str) -> Vec<String> {
    let mut words = Vec::new();
    for (part, text) in line.split('\'').enumerate() {
        match part % 2 {
            1 => words.push(text.to_owned()),
            _ => words.extend(text.split_whitespace().map(str::to_owned)),
        }
    }
    words.into_iter().flat_map(expanded).collect()
}

fn expanded(word: String) -> Vec<String> {
    let Some((before, after)) = word.split_once('*').filter(|(before, _)| before.contains('/')) else {
        return vec![word];
    };
    let (folder, start) = before.rsplit_once('/').expect("a folder");
    let names = fs::read_dir(root().join(folder)).expect("the folder");
    let names = names.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned());
    let mut found: Vec<String> = names
        .filter(|name| name.starts_with(start) && name.ends_with(after))
        .map(|name| format!("{folder}/{name}"))
        .collect();
    found.sort();
    assert!(!found.is_empty(), "{word}");
    found
}

/// Runs a documented command; of `discover`, its model.
fn run(line: &str) -> Result<Value, String> {
    let line = line.split("  #").next().unwrap_or(line);
    let words = words(line);
    let mut args: Vec<&str> = words.iter().skip(1).map(String::as_str).collect();
    let discovers = args.first() == Some(&"discover");
    if discovers {
        args.extend(["--format", "json"]);
    }
    let out = roscausal(root(), &args);
    if !out.status.success() {
        return Err(String::from_utf8_lossy(&out.stderr).into_owned());
    }
    match discovers {
        true => Ok(serde_json::from_slice(&out.stdout).expect("JSON")),
        false => Ok(Value::String(String::from_utf8_lossy(&out.stdout).replace("\n  ", " "))),
    }
}

fn of(file: &str) -> Value {
    let all = documented();
    let line = all.iter().find(|line| line.contains(file)).unwrap_or_else(|| panic!("no command for {file}"));
    run(line).unwrap_or_else(|reported| panic!("{line}\n{reported}"))
}

fn drives(model: &Value, cause: &str, effect: &str) -> bool {
    let links = model["links"].as_array().expect("links");
    links.iter().any(|link| link["cause"] == cause && link["effect"] == effect)
}

#[test]
fn a_cars_topics_exported_one_by_one_are_joined_by_time() {
    let model = of("bagpy");
    let names = ["cmd_vel.linear.x", "distanceEstimator-dist.data", "steering.torque.z"];
    assert_eq!(model["features"], serde_json::json!(names));
    // Stamps since 1970 have seven digits behind the point.
    assert!((model["dt"].as_f64().expect("a step") - 0.2).abs() < 1e-6, "{}", model["dt"]);
    // They share 53 s, in steps of 0.2 s; the lags take two rows.
    let samples = model["n_samples"].as_u64().expect("a number");
    assert!((240..=270).contains(&samples), "{samples}");
    assert!(names.iter().all(|name| drives(&model, name, name)), "{}", model["links"]);
    let reported = model["warnings"].to_string();
    for part in ["3 files side by side", "left out, constant: ", "cmd_vel.angular.z"] {
        assert!(reported.contains(part), "{part}: {reported}");
    }
}

#[test]
fn a_public_table_with_slashed_dates_and_words_is_read() {
    let model = of("seattle-weather");
    assert_eq!(model["features"], serde_json::json!(["precipitation", "temp_max", "temp_min", "wind"]));
    assert_eq!((&model["dt"], &model["n_samples"]), (&Value::from(86_400.0), &Value::from(1459)));
    // Yesterday's warmest hour tells of today's.
    assert!(drives(&model, "temp_max", "temp_max"), "{}", model["links"]);
}

#[test]
fn a_public_table_of_months_is_read() {
    let model = of("us-employment");
    assert_eq!(
        model["features"],
        serde_json::json!(["construction", "manufacturing", "financial_activities"])
    );
    assert_eq!(model["n_recordings"], 1);
    assert!(drives(&model, "manufacturing", "manufacturing"), "{}", model["links"]);
}

#[test]
fn a_public_table_of_an_economy_is_read() {
    let model = of("macrodata");
    assert_eq!(model["features"], serde_json::json!(["unemp", "tbilrate", "infl"]));
    assert!(drives(&model, "unemp", "unemp"), "{}", model["links"]);
}

#[test]
fn a_public_table_of_quarters_is_read() {
    let model = of("danish_data");
    assert_eq!(model["features"], serde_json::json!(["lrm", "lry", "lpy", "ibo", "ide"]));
    // 55 quarters; the first has no difference, and the lag takes one.
    assert_eq!(model["n_samples"], 53);
    // Three months.
    let step = model["dt"].as_f64().expect("a step");
    assert!((step / 86_400.0 - 91.3).abs() < 1.0, "{step}");
    assert!(model["links"].as_array().is_some_and(|links| !links.is_empty()), "{model}");
}

#[test]
fn a_robots_bag_of_another_project_is_read() {
    let model = of("robot_localization");
    assert_eq!(model["features"], serde_json::json!(["v", "gyro"]));
    assert!(model["n_samples"].as_u64().expect("a number") > 500, "{}", model["n_samples"]);
    assert!(drives(&model, "v", "v"), "{}", model["links"]);
}

#[test]
fn bags_without_anything_that_changes_are_listed() {
    assert!(of("inorbit").to_string().contains("/my_temperature.temperature"));
    assert!(of("leg_tracker").to_string().contains("geometry_msgs/PoseArray"));
}

#[test]
fn six_data_sets_and_more_are_analysed_not_only_listed() {
    let analysed = documented().iter().filter(|line| line.starts_with("roscausal discover ")).count();
    assert!(analysed >= 6, "{analysed}");
}

#[test]
fn every_documented_command_is_of_one_of_these() {
    let tested = [
        "bagpy", "seattle-weather", "us-employment", "danish_data", "macrodata", "robot_localization",
        "inorbit", "leg_tracker",
    ];
    for line in documented() {
        assert!(tested.iter().any(|name| line.contains(name)), "{line}");
    }
}
