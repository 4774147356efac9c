//! From sensor topics to batch files, over the loopback bus with simulated time.

#![allow(clippy::expect_used, clippy::panic, reason = "a test may panic: that is how it fails")]

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    thread::{self, JoinHandle},
    time::Duration,
};

use roscausal_core::{
    Message, Result, Time,
    batch::Table,
    loopback::{Loopback, LoopbackNode, LoopbackPublisher},
    middleware::{Middleware, Publish, Qos},
    nodes,
    params::Value,
};
use roscausal_msgs::{
    Features, Humans, RobotState,
    diagnostic_msgs::DiagnosticArray,
    geometry_msgs::{Point, Pose, PoseStamped, PoseWithCovarianceStamped, Quaternion},
    nav_msgs::Odometry,
    pedsim_msgs::{TrackedPerson, TrackedPersons},
    std_msgs::{Header, String as Text},
    tf2_msgs::TFMessage,
};

/// The robot, human and data nodes, and publishers that act as the sensors of a robot.
struct Bench {
    bus: Loopback,
    nodes: Vec<(LoopbackNode, JoinHandle<Result<()>>)>,
    odometry: LoopbackPublisher<Odometry>,
    pose: LoopbackPublisher<PoseWithCovarianceStamped>,
    people: LoopbackPublisher<TrackedPersons>,
    goal: LoopbackPublisher<PoseStamped>,
    dir: tempfile::TempDir,
    /// Whether localisation publishes the robot's pose.
    localised: bool,
    /// Whether the people tracker stamps its messages.
    tracker_stamps: bool,
}

impl Bench {
    fn new(settings: &[(&str, Value)]) -> Self {
        let (bus, dir) = (Loopback::lockstep(), tempfile::tempdir().expect("a folder"));
        for (name, folder) in [("data_dir", "raw"), ("pp_data_dir", "pp")] {
            bus.set_node_param("data", name, text(&dir.path().join(folder).display().to_string()));
        }
        bus.set_node_param("data", "sel_agent", text("all"));
        settings.iter().for_each(|(name, value)| bus.set_node_param("data", name, value.clone()));
        let sensors = bus.node("sensors");
        let nodes = vec![
            start::<TFMessage>(&bus, "robot", "/tf_static"),
            start::<TFMessage>(&bus, "human", "/tf_static"),
            start::<Humans>(&bus, "data", "/roscausal/humans"),
        ];
        Self {
            odometry: sensors
                .advertise("/mobile_base_controller/odom", Qos::Volatile(10))
                .expect("advertises"),
            pose: sensors.advertise("/robot_pose", Qos::Volatile(10)).expect("advertises"),
            people: sensors.advertise("/ped/control/teleop_persons", Qos::Volatile(10)).expect("advertises"),
            goal: sensors.advertise("/hri/human_goal", Qos::Volatile(10)).expect("advertises"),
            bus,
            nodes,
            dir,
            localised: true,
            tracker_stamps: true,
        }
    }

    /// Odometry at 50 Hz, pose at 10 Hz, people at 25 Hz. Clock and stamps may differ.
    fn run(&self, clock: std::ops::Range<f64>, stamp: f64, who: impl Fn(f64) -> Vec<u64>) {
        let steps = ((clock.end - clock.start) * 50.0).round() as u32;
        for step in 0..steps {
            let after = f64::from(step) * 0.02;
            self.bus.advance_to(Time::from_secs_f64(clock.start + after));
            let t = stamp + after;
            let header = |frame: &str| Header { stamp: Time::from_secs_f64(t), frame_id: frame.into() };
            let mut odometry = Odometry { header: header("odom"), ..Odometry::default() };
            odometry.twist.twist.linear.x = 0.5;
            self.odometry.publish(&odometry).expect("publishes");
            if self.localised && step % 5 == 0 {
                let mut pose = PoseWithCovarianceStamped { header: header("map"), ..Default::default() };
                pose.pose.pose = at(0.5 * t, 0.0, 0.0);
                self.pose.publish(&pose).expect("publishes");
            }
            if step % 2 == 0 {
                let tracks = who(t).into_iter().map(|id| track(id, t)).collect();
                let mut header = header("map");
                if !self.tracker_stamps {
                    header.stamp = Time::ZERO;
                }
                self.people.publish(&TrackedPersons { header, tracks }).expect("publishes");
            }
            if step % 250 == 0 {
                let goal = PoseStamped { header: header("map"), pose: at(3.0, 4.0 + t, 0.0) };
                self.goal.publish(&goal).expect("publishes");
            }
        }
        self.bus.settle();
    }

    /// The last report of a node on `/diagnostics` while `during` runs: its message and its figures.
    fn report_of(&self, node: &'static str, during: impl FnOnce()) -> (String, BTreeMap<String, String>) {
        let (send, reports) = std::sync::mpsc::channel();
        let take = move |report: DiagnosticArray| send.send(report.status).unwrap_or_default();
        let listener = self.bus.node("listener");
        let _subscription = listener.subscribe("/diagnostics", Qos::Volatile(10), take).expect("subscribes");
        during();
        let last = reports.try_iter().flatten().filter(|status| status.name == node).last();
        let last = last.expect("a report a second");
        (last.message, last.values.into_iter().map(|pair| (pair.key, pair.value)).collect())
    }

    /// Ends the nodes. Returns the folders of raw and post-processed batches.
    fn end(self) -> (tempfile::TempDir, Vec<PathBuf>, Vec<PathBuf>) {
        for (node, thread) in self.nodes.into_iter().rev() {
            node.shutdown();
            thread.join().expect("no panic").expect("ends well");
        }
        let csv = |folder: &str| {
            let mut paths: Vec<PathBuf> = files(&self.dir.path().join(folder)).into_keys().collect();
            paths.retain(|path| path.extension().is_some_and(|extension| extension == "csv"));
            paths
        };
        let (raw, processed) = (csv("raw"), csv("pp"));
        (self.dir, raw, processed)
    }
}

fn start<M: Message>(
    bus: &Loopback,
    name: &'static str,
    last_topic: &str,
) -> (LoopbackNode, JoinHandle<Result<()>>) {
    let probe = bus.node("probe").advertise::<M>(last_topic, Qos::Volatile(1)).expect("advertises");
    let (node, before) = (bus.node(name), probe.subscriber_count());
    let runs = node.clone();
    let thread = thread::spawn(move || nodes::run(name, &runs));
    while probe.subscriber_count() == before && !thread.is_finished() {
        thread::sleep(Duration::from_millis(1));
    }
    bus.settle();
    (node, thread)
}

fn at(x: f64, y: f64, yaw: f64) -> Pose {
    Pose { position: Point { x, y, z: 0.0 }, orientation: Quaternion::from_yaw(yaw) }
}

/// A person who walks along x at a varying speed.
fn track(id: u64, t: f64) -> TrackedPerson {
    let mut track = TrackedPerson { track_id: id, ..TrackedPerson::default() };
    track.pose.pose = at(id as f64 + t.sin(), 1.0, 0.0);
    track.twist.twist.linear.x = t.cos();
    track
}

fn text(text: &str) -> Value {
    Value::Str(text.to_owned())
}

fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let entries = fs::read_dir(folder).expect("lists").map(|entry| entry.expect("an entry").path());
    entries.map(|path| (path.clone(), fs::read(&path).expect("reads"))).collect()
}

fn facts(batch: &Path) -> serde_json::Value {
    serde_json::from_slice(&fs::read(batch.with_extension("json")).expect("facts")).expect("JSON")
}

const ALL: fn(f64) -> Vec<u64> = |_| vec![7];

#[test]
fn the_same_messages_make_the_same_bytes() {
    let record = || {
        let bench = Bench::new(&[("ts_length", Value::Double(2.0)), ("risk_noise", Value::Double(0.02))]);
        bench.run(10.0..17.5, 10.0, |t| if t < 14.0 { vec![7] } else { vec![7, 9] });
        let (dir, raw, processed) = bench.end();
        assert_eq!((raw.len(), processed.len()), (4, 4));
        let bytes = |folder: &str| -> Vec<(String, Vec<u8>)> {
            let name = |path: &PathBuf| path.file_name().expect("a name").to_string_lossy().into_owned();
            files(&dir.path().join(folder)).into_iter().map(|(path, bytes)| (name(&path), bytes)).collect()
        };
        (bytes("raw"), bytes("pp"))
    };
    let (first, second) = (record(), record());
    assert_eq!(
        first.0.iter().map(|(name, _)| name).collect::<Vec<_>>(),
        second.0.iter().map(|(name, _)| name).collect::<Vec<_>>()
    );
    assert!(first == second, "two runs differ");
}

#[test]
fn a_batch_tells_what_the_sensors_told() {
    // At this rate `auto` would hold, and rows be as old as a sample.
    let linear = ("sampling", Value::Str("linear".into()));
    let bench = Bench::new(&[("ts_length", Value::Double(2.0)), ("dt", Value::Double(0.3)), linear]);
    bench.run(10.0..17.5, 100.0, ALL);
    let (_dir, raw, processed) = bench.end();
    let table = Table::read(&raw[1], None).expect("reads");
    let column = |name: &str| table.names.iter().position(|known| known == name).expect(name);
    let time = table.time.as_ref().expect("has times");
    for (row, &t) in time.iter().enumerate() {
        let value = |name: &str| table.values[[row, column(name)]];
        assert!((value("r_x") - 0.5 * t).abs() < 1e-6, "r_x at {t}");
        assert!((value("h_7_x") - 7.0 - t.sin()).abs() < 2e-3, "h_7_x at {t}");
        assert!((value("h_7_v") - t.cos().abs()).abs() < 0.03, "h_7_v at {t}");
        assert!(value("r_gx").is_nan() && value("h_7_gx") == 3.0);
        assert_eq!(value("r_v"), 0.5);
    }
    assert!((table.dt().expect("a step") - 0.3).abs() < 1e-9);
    let features = Table::read(&processed[1], None).expect("reads");
    assert_eq!(features.names, ["h_v", "h_dg", "h_risk"]);
    let distance =
        (3.0 - table.values[[0, column("h_7_x")]]).hypot(table.values[[0, column("h_7_gy")]] - 1.0);
    assert!((features.values[[0, 1]] - distance).abs() < 1e-9);
    assert_eq!(facts(&processed[0])["ids"], serde_json::json!([7]));
}

/// What `/roscausal/features` said while `during` ran.
fn features_of(bench: &Bench, during: impl FnOnce()) -> Vec<Features> {
    let (send, rows) = std::sync::mpsc::channel();
    let listener = bench.bus.node("planner");
    let take = move |row: Features| send.send(row).unwrap_or_default();
    let _subscription =
        listener.subscribe(nodes::FEATURES_TOPIC, Qos::Volatile(1000), take).expect("subscribes");
    during();
    rows.try_iter().collect()
}

#[test]
fn features_say_row_by_row_what_the_batches_will_hold() {
    // With a lagged and noisy risk, which depend on the row before and on the place in the batch.
    let settings = [
        ("ts_length", Value::Double(2.0)),
        ("dt", Value::Double(0.2)),
        ("risk_lag", Value::Int(1)),
        ("risk_noise", Value::Double(0.1)),
        ("context_topic", text("/imposed")),
    ];
    let bench = Bench::new(&settings);
    let imposed = bench.bus.node("experimenter");
    let imposed = imposed.advertise::<Text>("/imposed", Qos::Latched).expect("advertises");
    let stated = features_of(&bench, || {
        bench.run(10.0..13.0, 10.0, ALL);
        let data = r#"{"stamp": 13.0, "context": {"do_robot_speed": [0.4]}}"#.to_owned();
        imposed.publish(&Text { data }).expect("publishes");
        bench.run(13.0..17.5, 13.0, ALL);
    });
    let (_dir, _, processed) = bench.end();
    assert!(processed.len() >= 3, "{}", processed.len());
    let mut compared = 0;
    for path in &processed {
        let table = Table::read(path, None).expect("reads");
        for (row, t) in table.time.as_ref().expect("times").iter().enumerate() {
            let stamp = Time::from_secs_f64(*t);
            let Some(live) = stated.iter().find(|live| live.header.stamp.secs_since(stamp).abs() < 1e-6)
            else {
                continue;
            };
            for (k, name) in table.names.iter().enumerate() {
                let written = table.values[[row, k]];
                match live.names.iter().position(|known| known == name) {
                    Some(at) => {
                        let live = live.values[at];
                        let same = (written.is_nan() && live.is_nan())
                            || (written - live).abs() <= 1e-9 * written.abs();
                        assert!(same, "{name} at {t}: {live} and {written} in the batch");
                        compared += 1;
                    }
                    // The column of an intervention begins with the first one.
                    None => assert!(name.starts_with("do_") && written == 0.0, "{name} at {t}"),
                }
            }
        }
    }
    assert!(compared > 90, "{compared} cells were compared");
    assert!(stated.iter().any(|row| row.names.iter().any(|name| name == "do_robot_speed")));
}

#[test]
fn several_people_have_their_ids_in_the_features() {
    let bench = Bench::new(&[("ts_length", Value::Double(2.0))]);
    let stated = features_of(&bench, || bench.run(10.0..14.0, 10.0, |_| vec![7, 9]));
    let last = stated.last().expect("rows");
    assert!(["h_7_v", "h_9_dg"].iter().all(|name| last.names.iter().any(|known| known == name)), "{last:?}");
    bench.end();
    let nearest = Bench::new(&[("ts_length", Value::Double(2.0)), ("sel_agent", text("nearest:1"))]);
    let stated = features_of(&nearest, || nearest.run(10.0..14.0, 10.0, |_| vec![7, 9]));
    assert_eq!(stated.last().expect("rows").names, ["h_v", "h_dg", "h_risk"]);
    nearest.end();
}

#[test]
fn a_batch_is_never_seen_half_written() {
    let bench = Bench::new(&[("ts_length", Value::Double(1.0))]);
    let (folders, over) = (["raw", "pp"].map(|f| bench.dir.path().join(f)), Arc::new(AtomicBool::new(false)));
    let ends = over.clone();
    let seen = Arc::new(AtomicU64::new(0));
    let count = seen.clone();
    let watcher = thread::spawn(move || {
        while !ends.load(Ordering::Relaxed) {
            let names = folders.iter().filter_map(|folder| fs::read_dir(folder).ok()).flatten().flatten();
            for path in names.map(|entry| entry.path()) {
                let hidden = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'));
                if hidden || path.extension().is_none_or(|extension| extension != "csv") {
                    continue;
                }
                let text = fs::read_to_string(&path).expect("reads");
                assert!(text.ends_with('\n') && text.lines().count() == 11, "{}: {text}", path.display());
                assert_eq!(facts(&path)["n_rows"], 10);
                count.fetch_add(1, Ordering::Relaxed);
            }
        }
    });
    bench.run(0.0..20.0, 50.0, ALL);
    bench.bus.settle();
    // Batches are written in the background. However slow the disk is, they appear in the end.
    let written = || fs::read_dir(bench.dir.path().join("raw")).expect("lists").count() > 20;
    // The watcher gets its turn on a busy machine, too.
    let watched = || written() && seen.load(Ordering::Relaxed) > 0;
    (0..6000).take_while(|_| !watched()).for_each(|_| thread::sleep(Duration::from_millis(10)));
    over.store(true, Ordering::Relaxed);
    watcher.join().expect("never half a batch");
    assert!(seen.load(Ordering::Relaxed) > 0);
    bench.end();
}

#[test]
fn the_end_flushes_a_short_batch_that_says_so() {
    let bench = Bench::new(&[("ts_length", Value::Double(150.0))]);
    bench.run(10.0..12.0, 10.0, ALL);
    let (_dir, raw, processed) = bench.end();
    assert_eq!((raw.len(), processed.len()), (1, 1));
    for path in [&raw[0], &processed[0]] {
        assert_eq!(facts(path)["complete"], false);
        assert_eq!(facts(path)["ended_by"], "the node ended");
        let rows = Table::read(path, None).expect("reads").values.nrows();
        assert!((18..=20).contains(&rows), "{rows} rows");
    }
}

#[test]
fn a_person_who_leaves_and_returns_is_missing_in_between() {
    let bench = Bench::new(&[("ts_length", Value::Double(6.0))]);
    bench.run(0.0..8.0, 10.0, |t| if (12.0..14.5).contains(&t) { vec![7] } else { vec![7, 9] });
    let (_dir, raw, processed) = bench.end();
    let table = Table::read(&raw[0], None).expect("reads");
    let column = table.names.iter().position(|name| name == "h_9_x").expect("is there");
    for (t, x) in table.time.as_ref().expect("has times").iter().zip(table.values.column(column)) {
        let there = !(12.0..14.5).contains(t);
        // Within a sample of their arrival or departure, either is right.
        if (t - 12.0).abs() > 0.11 && (t - 14.5).abs() > 0.11 {
            assert_eq!(x.is_finite(), there, "at {t}");
        }
    }
    let names = Table::read(&processed[0], None).expect("reads").names;
    assert_eq!(names, ["h_7_v", "h_9_v", "h_7_dg", "h_9_dg", "h_7_risk", "h_9_risk"]);
    let gaps = &facts(&raw[0])["gaps"];
    assert!(gaps.as_array().expect("a list").iter().any(|gap| gap["body"] == "h_9"), "{gaps}");
}

#[test]
fn nobody_there_is_normal_and_records_nothing() {
    let bench = Bench::new(&[("ts_length", Value::Double(1.0))]);
    bench.run(0.0..4.0, 10.0, |_| vec![]);
    let (_dir, raw, _) = bench.end();
    assert!(raw.is_empty());
}

#[test]
fn a_recording_that_starts_again_makes_batches_of_its_own() {
    let bench = Bench::new(&[("ts_length", Value::Double(2.0))]);
    bench.run(0.0..3.5, 100.0, ALL);
    bench.run(3.5..7.5, 100.0, ALL);
    let (_dir, raw, _) = bench.end();
    let complete: Vec<bool> = raw.iter().map(|path| facts(path)["complete"] == true).collect();
    assert!(complete.iter().filter(|complete| **complete).count() >= 2, "{complete:?}");
    for path in &raw {
        let table = Table::read(path, None).expect("time never goes back");
        assert!(table.values.nrows() >= 1);
    }
}

#[test]
fn a_silent_topic_is_told_by_its_name_and_its_rows_stay_empty() {
    let mut bench = Bench::new(&[("ts_length", Value::Double(20.0)), ("max_gap", Value::Double(0.5))]);
    let amcl = bench.bus.node("amcl");
    let _amcl =
        amcl.advertise::<PoseWithCovarianceStamped>("/amcl_pose", Qos::Volatile(1)).expect("advertises");
    let (stated, _) = bench.report_of("robot", || bench.run(0.0..5.0, 10.0, ALL));
    assert_eq!(stated, "running");
    bench.localised = false;
    let (stated, figures) = bench.report_of("robot", || bench.run(5.0..12.0, 15.0, ALL));
    let wanted = "no messages on /robot_pose (geometry_msgs/PoseWithCovarianceStamped) for ";
    assert!(stated.starts_with(wanted), "{stated}");
    assert!(stated.ends_with("other topics of that type: /amcl_pose"), "{stated}");
    let odometry: u32 = figures["received /mobile_base_controller/odom"].parse().expect("a number");
    assert!(odometry >= 550, "what is not silent goes on: {odometry} of 600");
    bench.localised = true;
    let (stated, _) = bench.report_of("robot", || bench.run(12.0..22.0, 22.0, ALL));
    assert_eq!(stated, "running");
    let (_dir, raw, _) = bench.end();
    let table = Table::read(&raw[0], None).expect("reads");
    let [robot, person] =
        ["r_x", "h_7_x"].map(|name| table.names.iter().position(|n| n == name).expect(name));
    for (row, t) in table.time.as_ref().expect("has times").iter().enumerate() {
        let there = !(15.0..22.0).contains(t);
        // Within a sample of the gap's ends, either is right.
        if (t - 15.0).abs() > 0.21 && (t - 22.0).abs() > 0.21 {
            assert_eq!(table.values[[row, robot]].is_finite(), there, "the robot at {t}");
        }
        assert!(table.values[[row, person]].is_finite(), "the person at {t}");
    }
}

#[test]
fn people_without_a_stamp_are_recorded_where_they_arrived_and_counted() {
    let mut bench = Bench::new(&[("ts_length", Value::Double(4.0))]);
    bench.tracker_stamps = false;
    let (_, figures) = bench.report_of("human", || bench.run(10.0..18.0, 10.0, ALL));
    let unstamped: u32 = figures["without stamp"].parse().expect("a number");
    assert!((170..=200).contains(&unstamped), "{unstamped} of 200");
    let (_dir, raw, _) = bench.end();
    let table = Table::read(&raw[0], None).expect("reads");
    let column = table.names.iter().position(|name| name == "h_7_x").expect("is there");
    assert_eq!(table.values.nrows(), 40);
    for (row, t) in table.time.as_ref().expect("has times").iter().enumerate() {
        let x = table.values[[row, column]];
        assert!((x - 7.0 - t.sin()).abs() < 0.03, "{x} at {t}");
    }
}

#[test]
fn states_have_the_sensors_stamps_and_frame() {
    let bench = Bench::new(&[]);
    let node = bench.bus.node("listener");
    let (send, states) = std::sync::mpsc::channel();
    let _robot = node.subscribe("/roscausal/robot", Qos::Volatile(10), move |state: RobotState| {
        let _ = send.send(state);
    });
    bench.run(5.0..6.0, 77.0, ALL);
    bench.end();
    let states: Vec<RobotState> = states.try_iter().collect();
    assert!(states.len() >= 9, "{} states", states.len());
    assert_eq!(states[0].header, Header { stamp: Time::from_secs_f64(77.0), frame_id: "map".into() });
    assert!(states[0].goal.x.is_nan());
}

#[test]
fn a_length_that_is_set_while_the_node_runs_is_that_of_the_next_batch() {
    let lengths = |first: f64| {
        let bench = Bench::new(&[("ts_length", Value::Double(first))]);
        bench.run(10.0..12.5, 10.0, ALL);
        let set = |length: f64| bench.bus.change_node_params("data", &[("ts_length", Value::Double(length))]);
        let error = set(0.05).expect_err("shorter than a step").to_string();
        assert!(error.contains("ts_length") && error.contains("at least dt"), "{error}");
        set(1.0).expect("takes it");
        bench.run(12.5..17.0, 12.5, ALL);
        let (_dir, raw, _) = bench.end();
        let of = |path: &PathBuf| {
            let facts = facts(path);
            (facts["n_rows"].as_u64(), facts["parameters"]["ts_length"].as_f64(), facts["complete"].as_bool())
        };
        raw[..3].iter().map(of).collect::<Vec<_>>()
    };
    let (long, short) = ((Some(20), Some(2.0), Some(true)), (Some(10), Some(1.0), Some(true)));
    assert_eq!(lengths(2.0), [long, short, short], "the open batch keeps its length");
    let until_the_end = lengths(0.0);
    assert!(until_the_end[0].0 > Some(10) && until_the_end[0].2 == Some(true), "{until_the_end:?}");
    assert_eq!(until_the_end[1..], [short, short], "nothing would follow a batch until the end");
}
