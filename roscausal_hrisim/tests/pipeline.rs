//! Several people and robots, and interventions, from the simulator through all nodes to models.

#![allow(clippy::expect_used, clippy::panic, reason = "a test may panic: that is how it fails")]

use std::{
    fs,
    path::{Path, PathBuf},
    thread,
    time::{Duration, Instant},
};

use roscausal_core::{
    Time,
    batch::joint::{Facts, Joint, People},
    loopback::Loopback,
    middleware::Middleware,
    nodes,
    params::Value,
};
use roscausal_discovery::{Control, Model, Settings, analyse, methods::Method};
use roscausal_hrisim::{Scenario, Simulation, node::run_lockstep};

fn text(text: impl std::fmt::Display) -> Value {
    Value::Str(text.to_string())
}

/// Two robots, one scripted person and four pedestrians. Robot1 is slowed down from 40 to 60 s.
fn scenario() -> Scenario {
    let mut scenario = Scenario { duration: 84.0, ..Scenario::crowd(4, 2) };
    scenario.add_interventions(&["robot[robot1].speed=0.2@40..60".to_owned()]).expect("is one");
    scenario
}

/// Records two batches with `settings` for the data node. Returns their post-processed files.
fn record(dir: &Path, settings: &[(&str, Value)]) -> Vec<PathBuf> {
    let bus = Loopback::lockstep();
    for (node, name) in [("robot", "robot1"), ("second", "robot2"), ("human", "robot1"), ("data", "robot1")] {
        bus.set_node_param(node, "robot", text(name));
    }
    for (name, value) in [
        ("data_dir", text(dir.join("raw").display())),
        ("pp_data_dir", text(dir.join("pp").display())),
        ("other_robots", Value::List(vec![text("robot2")])),
        ("obstacle", text("nearest")),
        ("ts_length", Value::Double(39.0)),
        ("dt", Value::Double(0.3)),
    ] {
        bus.set_node_param("data", name, value);
    }
    settings.iter().for_each(|(name, value)| bus.set_node_param("data", name, value.clone()));
    let start = |name: &'static str, node: &'static str| bus.start(name, move |mw| nodes::run(node, &mw));
    let threads = [("robot", "robot"), ("second", "robot"), ("human", "human"), ("data", "data")]
        .map(|(name, node)| start(name, node).expect("starts"));
    let mut simulation = Simulation::new(&scenario(), 5).expect("is sound");
    run_lockstep(&bus, &mut simulation, 1, |_| true).expect("runs");
    bus.shutdown();
    threads.into_iter().for_each(|thread| thread.join().expect("no panic").expect("ends well"));
    let mut paths: Vec<PathBuf> =
        fs::read_dir(dir.join("pp")).expect("lists").map(|entry| entry.expect("an entry").path()).collect();
    paths.retain(|path| {
        path.extension().is_some_and(|extension| extension == "csv") && Facts::read(path).complete
    });
    paths.sort();
    paths
}

#[test]
fn everybody_is_recorded_with_goals_robots_and_interventions() {
    let dir = tempfile::tempdir().expect("a folder");
    let batches = record(dir.path(), &[("sel_agent", text("all"))]);
    assert_eq!(batches.len(), 2);
    let raw = fs::read_to_string(dir.path().join("raw").join(batches[0].file_name().expect("a name")));
    let header = raw.expect("reads").lines().next().expect("a header").to_owned();
    for column in ["r_x", "h_1_gx", "h_4_x", "h_1000_gy", "r_robot2_x", "do_robot_speed_robot1"] {
        assert!(header.split(',').any(|name| name == column), "{column}: {header}");
    }
    let facts: serde_json::Value =
        serde_json::from_slice(&fs::read(batches[1].with_extension("json")).expect("reads"))
            .expect("is JSON");
    assert_eq!(facts["ids"], serde_json::json!([1, 2, 3, 4, 1000]));
    assert_eq!(facts["context"], serde_json::json!(["do_robot_speed_robot1"]));
    let span = &facts["interventions"][0];
    assert_eq!(span["value"], serde_json::json!([0.2]));
    let (from, to) = (span["from"].as_f64().expect("a time"), span["to"].as_f64().expect("a time"));
    assert!((40.0..40.5).contains(&from) && (59.5..60.3).contains(&to), "{from} {to}");

    let mut joint = Joint::read(&batches).expect("reads");
    let pooled = joint.parts(People::Pooled).expect("fits").remove(0);
    assert_eq!(pooled.data.var_names(), ["h_v", "h_dg", "h_risk", "do_robot_speed_robot1"]);
    assert_eq!(pooled.data.recordings().len(), 2 * 5);
    let known = pooled.data.recordings().iter().flatten().filter(|value| value.is_finite()).count();
    assert_eq!(known, 2 * 5 * 130 * 4);
    let settings = Settings {
        method: Method::Pcmci,
        cond_ind_test: "parcorr".into(),
        exogenous: pooled.exogenous,
        ..Settings::default()
    };
    let model = analyse(&pooled.data, &settings, &Control::default()).expect("analyses");
    assert!(model.links.iter().all(|link| link.effect != "do_robot_speed_robot1"));
    assert!(model.links.iter().any(|link| (link.cause.as_str(), link.effect.as_str()) == ("h_dg", "h_dg")));
}

#[test]
fn the_selection_of_people_reaches_the_batches() {
    for (select, ids) in [("1000", vec![1000]), ("2,4", vec![2, 4])] {
        let dir = tempfile::tempdir().expect("a folder");
        let batches = record(dir.path(), &[("sel_agent", text(select))]);
        assert_eq!(Facts::read(&batches[0]).ids, ids);
    }
    let dir = tempfile::tempdir().expect("a folder");
    let batches = record(dir.path(), &[("sel_agent", text("nearest:2"))]);
    assert!(batches.iter().all(|batch| Facts::read(batch).ids.len() == 2));
}

#[test]
fn the_discovery_node_makes_a_model_of_each_person_and_one_of_all() {
    let dir = tempfile::tempdir().expect("a folder");
    record(dir.path(), &[("sel_agent", text("3,1000"))]);
    let bus = Loopback::live(|| Time::ZERO);
    for (name, value) in [
        ("data_dir", text(dir.path().join("pp").display())),
        ("res_dir", text(dir.path().join("models").display())),
        ("people", text("both")),
        ("cond_ind_test", text("parcorr")),
        ("cd_method", text("pcmci")),
        ("batches_per_model", Value::Int(2)),
    ] {
        bus.set_node_param("discovery", name, value);
    }
    let node = bus.node("discovery");
    let runs = node.clone();
    let thread = thread::spawn(move || nodes::run("discovery", &runs));
    let models = || -> Vec<PathBuf> {
        let entries = fs::read_dir(dir.path().join("models")).into_iter().flatten();
        let mut paths: Vec<PathBuf> = entries.map(|entry| entry.expect("an entry").path()).collect();
        paths.retain(|path| path.extension().is_some_and(|extension| extension == "json"));
        paths.sort();
        paths
    };
    let begin = Instant::now();
    while models().len() < 3 && begin.elapsed() < Duration::from_secs(60) {
        thread::sleep(Duration::from_millis(20));
    }
    node.shutdown();
    thread.join().expect("no panic").expect("ends well");
    let has = |end: &str| models().iter().any(|path| path.to_string_lossy().ends_with(end));
    assert!(models().len() == 3 && has("_person_1000.json") && has("_person_3.json"), "{:?}", models());
    for path in models() {
        let model: Model = serde_json::from_slice(&fs::read(&path).expect("reads")).expect("is a model");
        assert!(model.links.iter().all(|link| link.effect != "do_robot_speed_robot1"));
        let of_one = path.to_string_lossy().contains("_person_");
        assert_eq!(model.n_recordings, if of_one { 2 } else { 4 });
        assert!(model.features.contains(&"h_dg".to_owned()), "{:?}", model.features);
    }
}
