//! Signals of any topic through the command: recordings of other projects become tables, a replay gives what the node
//! records, and mistakes name the way out.

#![allow(
    clippy::expect_used,
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test may panic: that is how it fails"
)]

mod common;
#[path = "common/live.rs"]
mod live;

use std::{
    path::{Path, PathBuf},
    process::Output,
};

use common::{csv_files, roscausal};
use live::Live;
use roscausal_core::{
    Time,
    loopback::Loopback,
    middleware::{Middleware, Publish, Qos},
    nodes,
    params::Value,
};
use roscausal_msgs::{geometry_msgs::Twist, nav_msgs::Odometry};
use roscausal_recording::{McapWriter, Topic};

const QUICK: [&str; 4] = ["--method", "pcmci", "--test", "parcorr"];

fn stated(output: &Output) -> String {
    // A note goes on in indented lines.
    let notes = String::from_utf8_lossy(&output.stdout).replace("\n  ", " ");
    format!("{notes}{}", String::from_utf8_lossy(&output.stderr))
}

fn foreign(file: &str) -> String {
    format!("{}/tests/recordings/foreign/{file}", env!("CARGO_MANIFEST_DIR"))
}

/// Replays a recording and returns its raw batches.
fn replayed(dir: &Path, recording: &str, out: &str, flags: &[&str]) -> (Output, Vec<(String, String)>) {
    let output = roscausal(dir, &[&["replay", recording, "--out", out][..], flags, &QUICK].concat());
    let folder = dir.join(out).join("data_pool");
    let found = if folder.is_dir() { csv_files(&folder) } else { Vec::new() };
    (output, found)
}

/// The share of cells of a column that are numbers.
fn known(table: &str, column: &str) -> f64 {
    let mut lines = table.lines();
    let place = lines.next().and_then(|header| header.split(',').position(|name| name == column));
    let place = place.unwrap_or_else(|| panic!("no column {column} in {}", table.lines().next().unwrap()));
    let cells: Vec<bool> = lines
        .map(|line| {
            line.split(',').nth(place).is_some_and(|cell| cell.parse::<f64>().is_ok_and(f64::is_finite))
        })
        .collect();
    cells.iter().filter(|known| **known).count() as f64 / cells.len().max(1) as f64
}

/// The value of a column in the row of this time.
fn at(table: &str, time: f64, column: &str) -> f64 {
    let mut lines = table.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let header = lines.next().expect("a header");
    let place =
        header.iter().position(|name| *name == column).unwrap_or_else(|| panic!("{column}: {header:?}"));
    let row = lines.find(|row| (row[0].parse::<f64>().expect("a time") - time).abs() < 1e-6);
    row.unwrap_or_else(|| panic!("no row at {time}"))[place].parse().expect("a number")
}

#[test]
fn signals_of_another_projects_robot_become_a_table() {
    let dir = tempfile::tempdir().expect("a folder");
    let bag = foreign("robot_localization/test2.bag");
    let signals = [
        "--signal",
        "v = /jackal_velocity_controller/odom.twist.twist.linear.x",
        "--signal",
        "gyro = /imu/data.angular_velocity.z",
        "--signal",
        "force = norm(/imu/data.linear_acceleration)",
        "--signal",
        "turn = rate(/imu/data.orientation.yaw)",
    ];
    let (output, tables) = replayed(dir.path(), &bag, "out", &[&signals[..], &["--ts-length", "0"]].concat());
    assert!(output.status.success(), "{}", stated(&output));
    assert!(stated(&output).contains("only signals are read"), "{}", stated(&output));
    let table = &tables[0].1;
    assert!(table.starts_with("time,v,gyro,force,turn\n"), "{}", &table[..80]);
    assert!(table.lines().count() > 600, "{}", table.lines().count());
    for name in ["v", "gyro", "force", "turn"] {
        assert!(known(table, name) > 0.98, "{name}: {}", known(table, name));
    }
    // As a few lines of Python read the same bytes.
    for (name, value) in [
        ("v", 1.980_893_884_704_222_1),
        ("gyro", -0.013_383_370_917_927_646),
        ("force", 9.748_868_739_861_003),
    ] {
        assert!((at(table, 60.0, name) - value).abs() < 1e-9, "{name}: {}", at(table, 60.0, name));
    }
}

#[test]
fn signals_of_another_projects_sensors_become_a_table() {
    let dir = tempfile::tempdir().expect("a folder");
    let bag = foreign("inorbit_samples/fake_sensors_sample.bag");
    let output = roscausal(dir.path(), &["topics", &bag, "--signals"]);
    assert!(output.status.success(), "{}", stated(&output));
    let types = |output: &Output, name: &str| {
        let text = stated(output);
        let line = text.lines().find(|line| line.split_whitespace().next() == Some(name));
        let line = line.unwrap_or_else(|| panic!("{name}: {text}"));
        line.split_whitespace().nth(1).expect("a type").to_owned()
    };
    for (name, kind) in [
        ("signal", "type"),
        ("/my_temperature.temperature", "float64"),
        ("/my_temperature.header.stamp", "time"),
        ("/my_magnetic_field.magnetic_field.x", "float64"),
        ("/my_magnetic_field.magnetic_field_covariance[*]", "float64[9]"),
    ] {
        assert_eq!(types(&output, name), kind, "{}", stated(&output));
    }
    let signals = [
        "--signal",
        "warm = hold(/my_temperature.temperature, 5)",
        "--signal",
        "field = norm(/my_magnetic_field.magnetic_field)",
        "--signal",
        "often = hz(/my_temperature)",
    ];
    // Both are constant, so no model comes of it; the table does.
    let (output, tables) = replayed(dir.path(), &bag, "out", &[&signals[..], &["--ts-length", "0"]].concat());
    let table = &tables.first().unwrap_or_else(|| panic!("no table: {}", stated(&output))).1;
    assert!(table.lines().count() > 180, "{}", table.lines().count());
    let time = 1_626_720_950.0;
    assert_eq!(at(table, time, "warm"), 41.0);
    assert!((at(table, time, "field") - 2.36_f64.sqrt()).abs() < 1e-12);
    assert!((at(table, time, "often") - 0.5).abs() < 1e-3);
    assert!(known(table, "warm") > 0.9, "{}", known(table, "warm"));
}

/// Commands at 20 Hz, odometry at 50 Hz: 20 s of them.
fn messages() -> Vec<(Time, Result<Twist, Odometry>)> {
    let mut all = Vec::new();
    for i in 0..2000_u32 {
        let secs = 1000.0 + f64::from(i) / 100.0;
        let now = Time::from_secs_f64(secs);
        let wave = (f64::from(i) * 0.013).sin();
        if i % 5 == 0 {
            let mut twist = Twist::default();
            twist.linear.x = wave + 0.01 * f64::from(i * 7919 % 13);
            all.push((now, Ok(twist)));
        }
        if i % 2 == 0 {
            let mut odometry = Odometry::default();
            odometry.header.stamp = Time::from_secs_f64(secs - 0.02);
            odometry.twist.twist.linear.x = wave;
            odometry.pose.pose.orientation.w = 1.0;
            all.push((now, Err(odometry)));
        }
    }
    all
}

const SIGNALS: [&str; 4] = [
    "v_cmd = /cmd_vel.linear.x",
    "v = average(/odom.twist.twist.linear.x)",
    "lag = delay(/odom)",
    "accel = rate(/odom.twist.twist.linear.x)",
];

/// The raw batches that the data node records from the messages as they come.
fn live(dir: &Path) -> Vec<(String, String)> {
    let bus = Loopback::lockstep();
    let set = |name: &str, value: Value| bus.set_node_param("data", name, value);
    for (name, folder) in [("data_dir", "raw"), ("pp_data_dir", "pp")] {
        set(name, Value::Str(dir.join(folder).display().to_string()));
    }
    set("signals", Value::List(SIGNALS.map(|text| Value::Str(text.to_owned())).to_vec()));
    set("sel_agent", Value::Str("nobody".into()));
    set("ts_length", Value::Double(5.0));
    bus.advance_to(Time::from_secs_f64(1000.0));
    let thread = bus.start("data", |mw| nodes::data(&mw)).expect("starts");
    let driver = bus.node("driver");
    let twist = driver.advertise::<Twist>("/cmd_vel", Qos::Volatile(10)).expect("a topic");
    let odometry = driver.advertise::<Odometry>("/odom", Qos::Volatile(10)).expect("a topic");
    for (now, message) in messages() {
        bus.advance_to(now);
        match message {
            Ok(message) => twist.publish(&message).expect("is sent"),
            Err(message) => odometry.publish(&message).expect("is sent"),
        }
        bus.settle();
    }
    bus.shutdown();
    thread.join().expect("ends").expect("records");
    csv_files(&dir.join("raw"))
}

fn recorded(path: PathBuf) {
    let mut writer = McapWriter::create(path).expect("a file");
    for (now, message) in messages() {
        match message {
            Ok(message) => writer.write("/cmd_vel", now, &message).expect("writes"),
            Err(message) => writer.write("/odom", now, &message).expect("writes"),
        }
    }
    writer.finish().expect("ends");
}

#[test]
fn a_replay_of_signals_gives_what_the_node_records_to_the_byte() {
    let dir = tempfile::tempdir().expect("a folder");
    let live = live(dir.path());
    assert!(live.len() >= 4, "{} batches", live.len());
    recorded(dir.path().join("run.mcap"));
    let flags: Vec<&str> =
        SIGNALS.iter().flat_map(|text| ["--signal", text]).chain(["--ts-length", "5"]).collect();
    let (output, again) = replayed(dir.path(), "run.mcap", "again", &flags);
    assert!(output.status.success(), "{}", stated(&output));
    assert_eq!(live, again);
    for name in ["v_cmd", "v", "lag", "accel"] {
        assert!(known(&again[1].1, name) > 0.99, "{name}");
    }
}

#[test]
fn mistakes_in_signals_name_what_there_is() {
    let dir = tempfile::tempdir().expect("a folder");
    recorded(dir.path().join("run.mcap"));
    for (signal, says) in [
        ("v = /cmd_vell.linear.x", "did you mean '/cmd_vel'?"),
        ("v = /cmd_vel.linear.xx", "did you mean /cmd_vel.linear.x?"),
        ("v = /cmd_vel.linear", "fields: linear.x, linear.y, linear.z"),
        ("v : /cmd_vel.linear.x", "has no '='"),
        ("v = raet(/cmd_vel.linear.x)", "'raet' is not a function; did you mean rate?"),
        ("v = /odom.pose.pose.orientation.yaw2", "did you mean /odom.pose.pose.orientation.yaw?"),
        ("yaw = yaw(/odom.pose.pose.orientatoin)", "did you mean /odom.pose.pose.orientation"),
    ] {
        let output = roscausal(dir.path(), &["discover", "run.mcap", "--signal", signal]);
        assert!(!output.status.success(), "{signal}: {}", stated(&output));
        assert!(stated(&output).contains(says), "{signal}: {}", stated(&output));
    }
}

#[test]
fn a_signal_has_the_name_of_a_robots_column_where_only_signals_are_read_and_is_refused_by_its_flag_beside_a_robot()
 {
    let dir = tempfile::tempdir().expect("a folder");
    recorded(dir.path().join("run.mcap"));
    let signal = ["--signal", "r_v = /odom.twist.twist.linear.x", "--ts-length", "0"];
    let (output, tables) = replayed(dir.path(), "run.mcap", "out", &signal);
    assert!(!tables.is_empty(), "{}", stated(&output));
    assert!(
        tables[0].1.starts_with("time,r_v\n") && known(&tables[0].1, "r_v") > 0.99,
        "{}",
        stated(&output)
    );
    let people = format!("{}/tests/recordings/people/people.bag", env!("CARGO_MANIFEST_DIR"));
    let output =
        roscausal(dir.path(), &["discover", &people, "--people", "/pedestrians", signal[0], signal[1]]);
    let reported = "--signal: 'r_v' is a column of the batch already";
    assert!(!output.status.success() && stated(&output).contains(reported), "{}", stated(&output));
}

const NAV2: [&str; 3] = [
    "left = length(/tb3_0/plan.poses)",
    "to_go = /tb3_0/navigate_to_pose/_action/feedback.feedback.distance_remaining",
    "v_cmd = /tb3_0/cmd_vel.twist.linear.x",
];

/// The raw batches that the nodes record of a robot under Nav2, from the messages that `tests/recordings/robots.py` wrote.
fn live_of_nav2(dir: &Path, recording: &str) -> Vec<(String, String)> {
    let texts = [
        ("robot", "odom_topic", "/tb3_0/odom"),
        ("robot", "pose_topic", ""),
        ("robot", "source_frame", "base_link"),
        ("robot", "tf_topic", "/tb3_0/tf"),
        ("robot", "goal_topic", "/tb3_0/plan"),
        ("robot", "goal_type", "Path"),
        ("human", "tf_topic", "/tb3_0/tf"),
        ("human", "auto_people_topic", ""),
        ("human", "teleop_people_topic", ""),
        ("human", "people_topic", "/people"),
        ("human", "people_type", "geometry_msgs/PoseArray"),
        ("human", "goal_topic", ""),
    ];
    let raw = |of: &Topic| of.known_type().is_none();
    Live { texts: &texts, signals: &NAV2, wanted: &|_| true, raw: &raw }.record(dir, recording)
}

#[test]
fn a_replay_of_a_robot_under_nav2_gives_what_the_nodes_record_to_the_byte() {
    let dir = tempfile::tempdir().expect("a folder");
    let recording = format!("{}/tests/recordings/robots_nav2", env!("CARGO_MANIFEST_DIR"));
    let live = live_of_nav2(dir.path(), &recording);
    let signals = NAV2.iter().flat_map(|text| ["--signal", text]);
    let flags = ["--robot-goal", "/tb3_0/plan", "--person", "all", "--ts-length", "0"];
    let same = ["--param", "robot.pose_topic=", "--param", "robot.source_frame=base_link"];
    let flags: Vec<&str> = flags.into_iter().chain(same).chain(signals).collect();
    let (output, again) = replayed(dir.path(), &recording, "again", &flags);
    assert!(!again.is_empty(), "{}", stated(&output));
    assert_eq!(live, again);
    for name in ["r_x", "r_gx", "left", "to_go", "v_cmd"] {
        assert!(known(&live[0].1, name) > 0.97, "{name}: {}", known(&live[0].1, name));
    }
    let time =
        live[0].1.lines().nth(100).and_then(|row| row.split(',').next()?.parse().ok()).expect("a time");
    let of = |column: &str| at(&live[0].1, time, column);
    // The plan is a line from the robot to its goal, 14 m ahead.
    assert!((of("left") - of("to_go")).abs() < 1e-5 && (of("left") - (14.0 - of("r_x"))).abs() < 0.1);
}
