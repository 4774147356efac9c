//! The discovery node under faults: budgets, disks that refuse, a second node, a method that hangs; and on batches of people and
//! interventions.

#![cfg(unix)]
#![allow(clippy::expect_used, clippy::panic, reason = "a test may panic: that is how it fails")]

use std::{
    fs,
    os::unix::fs::PermissionsExt,
    path::Path,
    sync::{
        Arc, Mutex,
        mpsc::{Receiver, channel},
    },
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use roscausal_core::{
    Result, Time,
    loopback::{Loopback, LoopbackNode},
    middleware::{Middleware, Publish, Qos},
    nodes,
    params::Value,
};
use roscausal_fuzz::unit;
use roscausal_msgs::{
    CausalModelInfo, HumanState, Humans, RobotState, diagnostic_msgs::DiagnosticArray, std_msgs::Header,
};

fn text(text: &Path) -> Value {
    Value::Str(text.display().to_string())
}

fn word(word: &str) -> Value {
    Value::Str(word.to_owned())
}

/// A pool with `batches` batches in which b follows a.
fn pool(dir: &Path, batches: usize) {
    fs::create_dir_all(dir.join("pp")).expect("makes");
    for batch in 0..batches {
        let mut csv = String::from("time,a,b\n");
        let (mut a, mut state) = (0.0_f64, 17 + batch as u64);
        for row in 0..200 {
            let b = 0.9 * a + 0.1 * unit(&mut state);
            a = unit(&mut state);
            csv += &format!("{},{a},{b}\n", f64::from(row) * 0.1);
        }
        fs::write(dir.join(format!("pp/data_{batch}.csv")), csv).expect("writes");
    }
}

fn method(dir: &Path, script: &str) {
    let path = dir.join("methods/slow");
    fs::create_dir_all(dir.join("methods")).expect("makes");
    fs::write(&path, format!("#!/bin/sh\n{script}\n")).expect("writes");
    fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).expect("sets");
}

struct Node {
    node: LoopbackNode,
    thread: JoinHandle<Result<()>>,
}

impl Node {
    fn start(bus: &Loopback, name: &str, dir: &Path, settings: &[(&str, Value)]) -> Self {
        let common = [
            ("data_dir", text(&dir.join("pp"))),
            ("cd_method", word("pcmci")),
            ("cond_ind_test", word("parcorr")),
            ("threads", Value::Int(1)),
        ];
        for (parameter, value) in common.iter().chain(settings) {
            bus.set_node_param(name, parameter, value.clone());
        }
        let node = bus.node(name);
        let runs = node.clone();
        Self { node, thread: thread::spawn(move || nodes::run("discovery", &runs)) }
    }

    fn end(self) {
        self.node.shutdown();
        self.thread.join().expect("no panic").expect("ends well");
    }
}

fn models(bus: &Loopback) -> Receiver<String> {
    let (sender, models) = channel();
    let take = move |info: CausalModelInfo| sender.send(info.batch_id).unwrap_or_default();
    // Lives as long as the test.
    std::mem::forget(
        bus.node("probe").subscribe("/roscausal/causal_model_info", Qos::Latched, take).expect("subscribes"),
    );
    models
}

fn wait_until(what: impl Fn() -> bool) {
    let end = Instant::now() + Duration::from_secs(60);
    while !what() {
        assert!(Instant::now() < end, "it does not come");
        thread::sleep(Duration::from_millis(10));
    }
}

fn live() -> Loopback {
    let start = Instant::now();
    Loopback::live(move || Time::from_secs_f64(100.0 + start.elapsed().as_secs_f64()))
}

#[test]
fn a_time_budget_is_by_the_walls_clock_though_simulated_time_stands_still() {
    let dir = tempfile::tempdir().expect("a folder");
    pool(dir.path(), 1);
    method(dir.path(), "exec sleep 60");
    let bus = Loopback::lockstep();
    let settings = [
        ("cd_method", word("slow")),
        ("cd_method_dir", text(&dir.path().join("methods"))),
        ("time_budget", Value::Double(0.2)),
        ("max_attempts", Value::Int(2)),
    ];
    let node = Node::start(&bus, "discovery", dir.path(), &settings);
    wait_until(|| dir.path().join("pp/rejected/data_0.csv").exists());
    let reason = fs::read_to_string(dir.path().join("pp/rejected/data_0.csv.reason.txt")).expect("a reason");
    assert!(reason.contains("2 analyses"), "{reason}");
    node.end();
}

#[test]
fn an_analysis_is_nice_and_gets_no_more_memory_than_it_may() {
    let dir = tempfile::tempdir().expect("a folder");
    pool(dir.path(), 1);
    let stated = dir.path().join("said");
    method(
        dir.path(),
        &format!(
            "cat > /dev/null; sleep 0.2; (nice; ulimit -v) > {}.tmp; mv {0}.tmp {0}; exit 1",
            stated.display()
        ),
    );
    let bus = live();
    let settings = [
        ("cd_method", word("slow")),
        ("cd_method_dir", text(&dir.path().join("methods"))),
        ("nice", Value::Int(19)),
        ("max_memory", Value::Int(512)),
    ];
    let node = Node::start(&bus, "discovery", dir.path(), &settings);
    wait_until(|| stated.exists());
    assert_eq!(fs::read_to_string(&stated).expect("said"), "19\n500000\n");
    node.end();
}

#[test]
fn a_model_that_cannot_be_written_waits_until_it_can_and_its_batch_is_not_rejected() {
    let dir = tempfile::tempdir().expect("a folder");
    pool(dir.path(), 1);
    let results = dir.path().join("results");
    fs::write(&results, "a file where the folder should be").expect("writes");
    let (bus, troubles) = (live(), Arc::new(Mutex::new(String::new())));
    let reported = troubles.clone();
    let listen = move |message: DiagnosticArray| {
        reported.lock().expect("no panic").clone_from(&message.status[0].message)
    };
    let _listener =
        bus.node("listener").subscribe("/diagnostics", Qos::Volatile(10), listen).expect("subscribes");
    let models = models(&bus);
    let node = Node::start(&bus, "discovery", dir.path(), &[("res_dir", text(&results))]);
    wait_until(|| troubles.lock().expect("no panic").contains("results"));
    assert!(dir.path().join("pp/data_0.csv").exists() && !dir.path().join("pp/rejected").exists());
    fs::remove_file(&results).expect("removes");
    assert_eq!(models.recv_timeout(Duration::from_secs(60)).expect("a model"), "data_0");
    wait_until(|| results.join("data_0.json").exists() && !dir.path().join("pp/data_0.csv").exists());
    wait_until(|| *troubles.lock().expect("no panic") == "running");
    node.end();
}

#[test]
fn what_is_set_while_the_node_runs_holds_from_the_next_batch_and_nonsense_is_refused() {
    let dir = tempfile::tempdir().expect("a folder");
    pool(dir.path(), 1);
    let results = dir.path().join("models");
    let (bus, found) = (live(), dir.path().join("models"));
    let node = Node::start(&bus, "discovery", dir.path(), &[("res_dir", text(&results))]);
    let model = |name: &str| {
        let path = found.join(name);
        wait_until(|| path.exists());
        let text = fs::read_to_string(&path).expect("a model");
        serde_json::from_str::<serde_json::Value>(&text).expect("JSON")
    };
    assert_eq!(model("data_0.json")["tau_max"], 1);
    let set = |changes: &[(&str, Value)]| bus.change_node_params("discovery", changes);
    for (changes, says) in [
        (vec![("cd_method", word("nonsense"))], "'nonsense'"),
        // Each is allowed, but not with the other; the test is not changed either.
        (
            vec![
                ("cond_ind_test", word("gpdc")),
                ("pc_alpha", Value::Double(0.1)),
                ("cd_method", word("granger")),
            ],
            "pc_alpha",
        ),
        (vec![("max_lag", Value::Int(3)), ("min_lag", Value::Int(4))], "lag"),
    ] {
        let error = set(&changes).expect_err(says).to_string();
        assert!(error.starts_with("parameter '") && error.contains(says), "{error}");
    }
    set(&[("max_lag", Value::Int(3)), ("sig_alpha", Value::Double(1e-6))]).expect("takes them");
    pool(dir.path(), 2);
    let next = model("data_1.json");
    assert_eq!(
        (&next["tau_max"], &next["alpha"], &next["cond_ind_test"]),
        (&3.into(), &1e-6.into(), &"parcorr".into())
    );
    node.end();
}

#[test]
fn two_nodes_on_one_folder_analyse_each_batch_once() {
    let dir = tempfile::tempdir().expect("a folder");
    pool(dir.path(), 12);
    let bus = live();
    let models = models(&bus);
    let nodes = ["discovery", "discovery_2"].map(|name| Node::start(&bus, name, dir.path(), &[]));
    let mut found: Vec<String> =
        (0..12).map(|_| models.recv_timeout(Duration::from_secs(60)).expect("a model")).collect();
    nodes.into_iter().for_each(Node::end);
    assert!(models.try_recv().is_err(), "no model comes twice");
    found.sort();
    found.dedup();
    assert_eq!(found.len(), 12);
}

#[test]
fn recording_goes_on_while_an_analysis_hangs() {
    let dir = tempfile::tempdir().expect("a folder");
    pool(dir.path(), 1);
    method(dir.path(), "exec sleep 60");
    let bus = live();
    let settings = [("cd_method", word("slow")), ("cd_method_dir", text(&dir.path().join("methods")))];
    let node = Node::start(&bus, "discovery", dir.path(), &settings);
    wait_until(|| dir.path().join("pp/.data_0.csv.lock").exists());
    for (name, value) in [
        ("data_dir", text(&dir.path().join("raw"))),
        ("pp_data_dir", text(&dir.path().join("pp"))),
        ("ts_length", Value::Double(1.0)),
        ("max_gap", Value::Double(0.1)),
        ("sel_agent", word("all")),
    ] {
        bus.set_node_param("data", name, value);
    }
    let data = bus.start("data", |mw| nodes::run("data", &mw)).expect("a thread");
    let sensors = bus.node("sensors");
    let robot = sensors.advertise("/roscausal/robot", Qos::Volatile(10)).expect("advertises");
    let humans = sensors.advertise("/roscausal/humans", Qos::Volatile(10)).expect("advertises");
    for step in 0..300 {
        let header =
            Header { stamp: Time::from_secs_f64(100.0 + 0.02 * f64::from(step)), frame_id: "map".into() };
        robot.publish(&RobotState { header: header.clone(), ..RobotState::default() }).expect("publishes");
        let person = HumanState { header: header.clone(), id: 1, ..HumanState::default() };
        humans.publish(&Humans { header, humans: vec![person] }).expect("publishes");
        thread::sleep(Duration::from_millis(1));
    }
    let batches = || {
        fs::read_dir(dir.path().join("raw")).map_or(0, |names| {
            names.flatten().filter(|e| e.path().extension().is_some_and(|e| e == "csv")).count()
        })
    };
    wait_until(|| batches() >= 5);
    // A request to end is noticed within a second, although the analysis hangs.
    let end = Instant::now();
    node.end();
    assert!(end.elapsed() < Duration::from_secs(5));
    bus.shutdown();
    data.join().expect("no panic").expect("ends well");
}

/// A batch and its metadata.
fn batch(dir: &Path, name: &str, csv: &str, facts: &str) {
    fs::create_dir_all(dir.join("pp")).expect("makes");
    fs::write(dir.join(format!("pp/data_{name}.json")), facts).expect("writes");
    fs::write(dir.join(format!("pp/data_{name}.csv")), csv).expect("writes");
}

/// The only model that the node makes.
fn model_of(dir: &Path, settings: &[(&str, Value)]) -> serde_json::Value {
    let (bus, results) = (live(), dir.join("results"));
    let all = [&[("res_dir", text(&results)), ("min_lag", Value::Int(0))], settings].concat();
    let node = Node::start(&bus, "discovery", dir, &all);
    let found = models(&bus);
    let id = found.recv_timeout(Duration::from_secs(60)).expect("a model");
    node.end();
    let file = fs::read_dir(&results).expect("lists").flatten().map(|entry| entry.path());
    let mut files = file.filter(|path| path.extension().is_some_and(|end| end == "json"));
    let file = files.next().expect(&id);
    serde_json::from_slice(&fs::read(file).expect("reads")).expect("JSON")
}

#[test]
fn two_people_who_differ_are_pooled_and_what_they_differ_in_makes_no_link() {
    let dir = tempfile::tempdir().expect("a folder");
    let mut state = 5;
    let mut csv = "time,h_3_v,h_7_v,h_3_dg,h_7_dg\n".to_owned();
    for row in 0..300 {
        let [a, b, c, d] = std::array::from_fn(|_| unit(&mut state));
        csv += &format!("{},{a},{},{b},{}\n", f64::from(row) * 0.1, c + 0.6, d + 0.6);
    }
    batch(dir.path(), "0", &csv, r#"{"ids": [3, 7]}"#);
    let model = model_of(dir.path(), &[("cd_method", word("jpcmciplus"))]);
    assert_eq!(model["features"], serde_json::json!(["h_v", "h_dg"]));
    assert_eq!((&model["method"], &model["graph"][0][1][0]), (&"jpcmciplus".into(), &"".into()), "{model}");
    let reported = model["warnings"].to_string();
    assert!(reported.contains("the recordings differ in"), "{reported}");
}

#[test]
fn columns_that_belong_together_are_one_variable_of_the_nodes_model() {
    let dir = tempfile::tempdir().expect("a folder");
    let (mut state, mut y_before) = (5, 0.0);
    let mut csv = "time,h_x,h_y,h_v\n".to_owned();
    for row in 0..300 {
        let [x, y, noise] = std::array::from_fn(|_| unit(&mut state));
        csv += &format!("{},{x},{y},{}\n", f64::from(row) * 0.1, 0.9 * y_before + 0.4 * noise);
        y_before = y;
    }
    batch(dir.path(), "0", &csv, r#"{"ids": [1]}"#);
    let settings = [
        ("vectors", Value::List(vec![word("place=h_x+h_y")])),
        ("cd_method", word("pcmci")),
        ("cond_ind_test", word("parcorrmult")),
        ("min_lag", Value::Int(1)),
    ];
    let model = model_of(dir.path(), &settings);
    assert_eq!(model["features"], serde_json::json!(["place", "h_v"]));
    assert_eq!((&model["graph"][0][1][1], &model["graph"][1][0][1]), (&"-->".into(), &"".into()), "{model}");
}

#[test]
fn nothing_drives_what_the_node_is_told_is_exogenous() {
    let arrow = |settings: &[(&str, Value)]| {
        let dir = tempfile::tempdir().expect("a folder");
        let (mut state, mut before) = (5, 0.0);
        let mut csv = "time,h_v,h_dg\n".to_owned();
        for row in 0..300 {
            let [h_v, noise] = std::array::from_fn(|_| unit(&mut state));
            csv += &format!("{},{h_v},{}\n", f64::from(row) * 0.1, 0.9 * before + 0.4 * noise);
            before = h_v;
        }
        batch(dir.path(), "0", &csv, r#"{"ids": [1]}"#);
        let usual =
            [("cd_method", word("pcmci")), ("cond_ind_test", word("parcorr")), ("min_lag", Value::Int(1))];
        let model = model_of(dir.path(), &[&usual[..], settings].concat());
        model["graph"][0][1][1].as_str().expect("a mark").to_owned()
    };
    assert_eq!(arrow(&[]), "-->");
    assert_eq!(arrow(&[("exogenous", Value::List(vec![word("h_dg")]))]), "");
}

#[test]
fn batches_with_and_without_an_intervention_make_one_model_of_candoit() {
    let dir = tempfile::tempdir().expect("a folder");
    let mut state = 5;
    let mut rows = |off: bool| {
        let mut before = 0.0;
        let lines = (0..200).map(|row| {
            let r_v = if off { 0.0 } else { unit(&mut state) };
            let h_v = 0.8 * before + 0.3 * unit(&mut state);
            before = r_v;
            let imposed = if off { ",1" } else { "" };
            format!("{},{r_v},{h_v}{imposed}\n", f64::from(row) * 0.1)
        });
        lines.collect::<String>()
    };
    let free = format!("time,r_v,h_v\n{}", rows(false));
    batch(dir.path(), "0", &free, r#"{"ids": [1], "context": []}"#);
    let off = format!("time,r_v,h_v,do_robot_off\n{}", rows(true));
    batch(dir.path(), "1", &off, r#"{"ids": [1], "context": ["do_robot_off"]}"#);
    let model = model_of(dir.path(), &[("cd_method", word("candoit")), ("batches_per_model", Value::Int(2))]);
    assert_eq!(model["features"], serde_json::json!(["r_v", "h_v", "do_robot_off"]));
    assert_eq!((&model["graph"][2][0][0], &model["pc_alpha"]), (&"-->".into(), &0.05.into()), "{model}");
    assert_ne!(model["graph"][0][1][1], "", "{model}");
}
