//! Signals: what expressions mean, what is refused and how, where definitions come from, and what batches hold.

#![allow(
    clippy::expect_used,
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test may panic: that is how it fails"
)]

use std::{fs, sync::Arc};

use roscausal_msgs::{
    Message, cdr,
    dynamic::Wire,
    geometry_msgs::{PoseStamped, Quaternion},
    nav_msgs::{Odometry, Path as Plan},
    people_msgs::{People, Person},
    ros1,
};

use roscausal_core::{
    Error, Time,
    batch::{
        Recording, Sampling, Select,
        journal::{self, Entry},
        recorder::{Recorder, RecorderConfig},
    },
    middleware::{Raw, RawType},
    mix,
    signal::{Definitions, How, Signal, Signals},
};
use roscausal_fuzz::{Allocator, Target};
use roscausal_msgs::{HumanState, Humans, RobotState, std_msgs::Header};

#[global_allocator]
static ALLOCATOR: Allocator = Allocator;

fn raw<M: Message>(message: &M, wire: Wire) -> Raw {
    let (definition, bytes) = match wire {
        Wire::Ros1 => (M::ros1_definition(), ros1::to_bytes(message, 0).unwrap()),
        Wire::Cdr => (M::definition().ros2_definition(), cdr::to_bytes(message).unwrap()),
    };
    let kind = RawType { type_name: M::type_name(), definition: definition.to_owned(), wire };
    Raw { kind: Arc::new(kind), bytes }
}

fn signals(texts: &[&str]) -> Signals {
    let texts: Vec<String> = texts.iter().map(|text| (*text).to_owned()).collect();
    Signals::new(Signal::parse_all(&texts, 2.0, "signals").expect("signals"), Definitions::default())
}

fn odometry(secs: f64, yaw: f64, v: f64) -> Odometry {
    let mut odometry = Odometry::default();
    odometry.header.stamp = Time::from_secs_f64(secs);
    odometry.header.frame_id = "odom".into();
    odometry.pose.pose.orientation =
        Quaternion { z: (yaw / 2.0).sin(), w: (yaw / 2.0).cos(), ..Quaternion::default() };
    odometry.twist.twist.linear.x = v;
    odometry.twist.twist.linear.y = 2.0 * v;
    odometry
}

/// The value of one signal in the last of some messages, which arrive 0.25 s after their stamps.
fn last(text: &str, messages: &[Odometry]) -> f64 {
    let mut read = Vec::new();
    for wire in [Wire::Ros1, Wire::Cdr] {
        let mut signals = signals(&[text]);
        let mut value = f64::NAN;
        for message in messages {
            let arrived = message.header.stamp.plus_secs(0.25);
            let readings = signals.heard(0, &raw(message, wire), arrived);
            assert_eq!(signals.trouble(), None);
            assert_eq!(readings[0].stamp, message.header.stamp);
            value = readings[0].value;
        }
        read.push(value);
    }
    assert!(read[0] == read[1] || read[0].is_nan() == read[1].is_nan(), "{read:?}");
    read[0]
}

#[test]
fn expressions_mean_what_the_page_says() {
    let two = [odometry(10.0, 3.0, 1.0), odometry(10.5, -3.0, -3.0)];
    let is = |text: &str, wanted: f64| {
        let value = last(text, &two);
        assert!((value - wanted).abs() < 1e-9, "{text}: {value}, not {wanted}");
    };
    is("x = /odom.twist.twist.linear.x", -3.0);
    is("x = 1 + 2 * /odom.twist.twist.linear.x / -3 - (2 - 1)", 2.0);
    is("x = norm(/odom.twist.twist.linear)", 45f64.sqrt());
    is("x = /odom.pose.pose.orientation.yaw", -3.0);
    is("x = yaw(/odom.pose.pose.orientation)", -3.0);
    is("x = roll(/odom.pose.pose.orientation)", 0.0);
    // From 3 to -3 rad is a short way through pi.
    is("x = rate(/odom.pose.pose.orientation.yaw)", (std::f64::consts::TAU - 6.0) / 0.5);
    is("x = rate(/odom.twist.twist.linear.x)", -8.0);
    is("x = hz(/odom)", 2.0);
    is("x = delay(/odom)", 0.25);
    is("x = /odom.header.stamp - 10", 0.5);
    is("x = /odom.twist.twist.linear.x < 0", 1.0);
    is("x = /odom.header.frame_id == \"odom\"", 1.0);
    is("x = /odom.header.frame_id != 'odom'", 0.0);
    is("x = count(/odom.pose.covariance)", 36.0);
    is("x = max(abs(/odom.twist.twist.linear.x), 4)", 4.0);
    is("x = hold(/odom.twist.twist.linear.x, 60)", -3.0);
    assert!(last("x = rate(/odom.twist.twist.linear.x)", &two[..1]).is_nan());
    assert!(last("x = 1 / (/odom.twist.twist.linear.z)", &two).is_nan(), "no division by zero");
}

#[test]
fn arrays_of_people_are_counted_and_joined() {
    let person = |reliability: f64| Person { reliability, ..Person::default() };
    let people = People { people: vec![person(0.5), person(0.75)], ..People::default() };
    let texts = [
        "n = count(/people.people)",
        "best = max(/people.people[*].reliability)",
        "first = /people.people[0].reliability",
        "third = /people.people[2].reliability",
    ];
    let mut signals = signals(&texts);
    assert_eq!(signals.topics(), ["/people"]);
    let now = Time::from_secs_f64(7.0);
    let readings = signals.heard(0, &raw(&people, Wire::Cdr), now);
    let values: Vec<f64> = readings.iter().map(|reading| reading.value).collect();
    assert_eq!(values[..3], [2.0, 0.75, 0.5]);
    assert!(values[3].is_nan(), "there is no third");
    assert_eq!(readings[0].stamp, now, "a stamp of 0 is none");
}

#[test]
fn a_stamp_of_another_clock_gives_way_to_the_arrival() {
    let mut signals = signals(&["x = /odom.twist.twist.linear.x"]);
    let now = Time::from_secs_f64(1e9);
    assert_eq!(signals.heard(0, &raw(&odometry(10.0, 0.0, 1.0), Wire::Ros1), now)[0].stamp, now);
}

fn refused(text: &str) -> String {
    match Signal::parse(text, 2.0, "signals") {
        Err(error) => error.to_string(),
        Ok(signal) => {
            let signals = Signals::new(vec![signal], Definitions::default());
            let kind = raw(&Odometry::default(), Wire::Cdr).kind;
            signals.check("/odom", &kind).expect_err(text)
        }
    }
}

#[test]
fn the_length_of_a_plan_is_that_of_the_way_through_its_poses() {
    let at = |x: f64, y: f64| {
        let mut pose = PoseStamped::default();
        (pose.pose.position.x, pose.pose.position.y) = (x, y);
        pose
    };
    for (poses, length) in [
        (vec![at(0.0, 0.0), at(3.0, 4.0), at(3.0, 6.0)], 7.0),
        (vec![at(5.0, 5.0)], 0.0),
        (Vec::new(), f64::NAN),
    ] {
        for wire in [Wire::Ros1, Wire::Cdr] {
            let message = raw(&Plan { poses: poses.clone(), ..Plan::default() }, wire);
            let mut left = signals(&["left = length(/plan.poses)"]);
            let value = left.heard(0, &message, Time::from_secs_f64(1.0))[0].value;
            assert!(value == length || (value.is_nan() && length.is_nan()), "{value}, not {length}");
        }
    }
}

#[test]
fn a_bad_signal_says_what_is_wrong_and_names_the_nearest_field() {
    for (text, says) in [
        ("v = /odom.twist.twist.liner.x", "did you mean /odom.twist.twist.linear.x?"),
        ("v = /odom.twist.twist", "is a whole geometry_msgs/Twist; fields: twist.twist.linear.x"),
        ("v = /odom.pose.covariance", "has several numbers"),
        ("v = /odom.pose.covariance[36]", "has 36 elements"),
        ("v = /odom.child_frame_id", "is a text; compare it"),
        ("v = /odom.child_frame_id + 1", "a text"),
        ("v = norm(/odom.header)", "is not a vector"),
        ("v = length(/odom.pose.pose)", "is not an array of points or poses"),
        ("v = length(/odom.pose.covariance)", "is not an array of points or poses"),
        ("v = /odom.twist.twist.linear.yaw", "no field"),
        ("v", "has no '='"),
        ("2v = /odom.x", "not a valid signal name"),
        ("v = 3", "names no topic"),
        ("v = /a.x + /b.x", "reads one topic"),
        ("v = /odom.x +", "is missing"),
        ("v = foo(/odom.x)", "'foo' is not a function"),
        ("v = raet(/odom.x)", "'raet' is not a function; did you mean rate? known: count"),
        ("v = /odom.pose.pose.orientation.yaw2", "did you mean /odom.pose.pose.orientation.yaw?"),
        ("v = odom.x", "a topic begins with '/'"),
        ("v = hold(/odom.x, 0)", "more than 0"),
        ("v = /odom..x", "not a path"),
        (&format!("v = {}/odom.x", "(".repeat(60)), "too many brackets within brackets"),
    ] {
        let error = refused(text);
        assert!(error.contains(says), "{text}: {error}");
    }
    let twice = ["a = /x.y", "a = /x.z"].map(str::to_owned);
    assert!(matches!(Signal::parse_all(&twice, 2.0, "signals"), Err(Error::Param { .. })));
}

#[test]
fn a_list_that_was_cut_at_commas_is_whole_again() {
    let items = ["a = hold(/x.y", " 30)", "b = /x.z == 2", "c = min(/x.y", " 3)"].map(str::to_owned);
    let signals = Signal::parse_all(&items, 2.0, "signals").expect("three signals");
    let names: Vec<&str> = signals.iter().map(|signal| signal.name.as_str()).collect();
    assert_eq!((names, signals[0].how), (vec!["a", "b", "c"], How::Hold(30.0)));
}

#[test]
fn any_text_is_a_signal_or_an_error() {
    let mut state = 1_u64;
    let parts = [
        "/a.b", "(", ")", "[*]", "[3]", "hold(", ",", "1e", "\"", "é", "-", "*", "==", "rate(", ".", " ", "9",
    ];
    for _ in 0..20_000 {
        let mut text = "x = ".to_owned();
        for _ in 0..8 {
            state = mix(state);
            text.push_str(parts[(state % parts.len() as u64) as usize]);
        }
        let _ = Signal::parse(&text, 2.0, "signals");
    }
}

#[test]
fn definitions_come_from_folders_of_msg_files() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |package: &str, name: &str, text: &str| {
        let dir = folder.path().join("share").join(package).join("msg");
        fs::create_dir_all(&dir).expect("a folder");
        fs::write(dir.join(format!("{name}.msg")), text).expect("writes");
    };
    write("my_msgs", "Load", "std_msgs/Header header\nCell[<=4] cells # why\n");
    write("my_msgs", "Cell", "float32 volts\n");
    write("std_msgs", "Header", "builtin_interfaces/Time stamp\nstring frame_id\n");
    let definitions = Definitions::of(&folder.path().to_string_lossy());
    let kind = |name: &str| RawType { type_name: name.into(), definition: String::new(), wire: Wire::Cdr };
    let schema = definitions.schema(&kind("my_msgs/Load")).expect("is found");
    let leaves: Vec<String> = schema.leaves().iter().map(ToString::to_string).collect();
    assert_eq!(leaves, ["header.stamp", "cells[*].volts"]);
    assert!(definitions.schema(&kind("nav_msgs/Odometry")).is_ok(), "known to the program");
    let error = definitions.schema(&kind("my_msgs/None")).expect_err("is nowhere");
    assert!(error.contains("msg_path"), "{error}");
    assert!(definitions.schema(&kind("../etc/passwd")).is_err());
}

/// A feedback of Nav2's action with this much way to go, in CDR: an id of 16 bytes, a pose (stamp, frame `map`, seven numbers
/// that are aligned to 8 bytes), two durations, a count, and the distance.
fn feedback(left: f32, recoveries: i16) -> Vec<u8> {
    let mut bytes = vec![7_u8; 16];
    bytes.extend([5_i32.to_le_bytes(), 0_i32.to_le_bytes(), 4_i32.to_le_bytes()].concat());
    bytes.extend(b"map\0");
    for number in [1.0_f64, 2.0, 0.0, 0.0, 0.0, 0.0, 1.0] {
        bytes.resize(bytes.len().next_multiple_of(8), 0);
        bytes.extend(number.to_le_bytes());
    }
    bytes.extend([3_i32, 0, 9, 0].map(i32::to_le_bytes).concat());
    bytes.extend(recoveries.to_le_bytes());
    bytes.extend([0, 0]);
    bytes.extend(left.to_le_bytes());
    [&[0, 1, 0, 0][..], &bytes].concat()
}

#[test]
fn the_feedback_of_nav2s_action_is_read_without_a_definition_and_with_one_in_idl() {
    let idl =
        format!("{}\nIDL: nav2_msgs/action/NavigateToPose_FeedbackMessage\nmodule x {{}};\n", "=".repeat(80));
    for definition in [String::new(), idl] {
        let kind = RawType {
            type_name: "nav2_msgs/action/NavigateToPose_FeedbackMessage".into(),
            definition,
            wire: Wire::Cdr,
        };
        let mut signals = signals(&[
            "left = /navigate_to_pose/_action/feedback.feedback.distance_remaining",
            "since = /navigate_to_pose/_action/feedback.feedback.navigation_time",
            "again = /navigate_to_pose/_action/feedback.feedback.number_of_recoveries",
            "x = /navigate_to_pose/_action/feedback.feedback.current_pose.pose.position.x",
        ]);
        let message = Raw { kind: Arc::new(kind), bytes: feedback(6.5, 2) };
        let readings = signals.heard(0, &message, Time::from_secs_f64(5.0));
        let values: Vec<f64> = readings.iter().map(|reading| reading.value).collect();
        assert_eq!((values, signals.trouble()), (vec![6.5, 3.0, 2.0, 1.0], None));
    }
}

#[test]
fn the_feedback_of_any_action_is_defined_by_its_action_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let dir = folder.path().join("share/dock_msgs/action");
    fs::create_dir_all(&dir).expect("a folder");
    fs::write(dir.join("Dock.action"), "string dock\n---\nbool done\n---\nfloat32 charge\nState state\n")
        .expect("writes");
    fs::create_dir_all(folder.path().join("share/dock_msgs/msg")).expect("a folder");
    fs::write(folder.path().join("share/dock_msgs/msg/State.msg"), "uint8 code\n").expect("writes");
    let kind = |name: &str| RawType { type_name: name.into(), definition: String::new(), wire: Wire::Cdr };
    let definitions = Definitions::of(&folder.path().to_string_lossy());
    let schema = definitions.schema(&kind("dock_msgs/action/Dock_FeedbackMessage")).expect("is found");
    let leaves: Vec<String> = schema.leaves().iter().map(ToString::to_string).collect();
    assert_eq!(leaves, ["goal_id.uuid[*]", "feedback.charge", "feedback.state.code"]);
    for name in ["dock_msgs/action/Undock_FeedbackMessage", "dock_msgs/action/Dock", "dock_msgs/action/../x"]
    {
        assert!(definitions.schema(&kind(name)).is_err(), "{name}");
    }
}

fn with_signals(select: Select, hows: &[(&str, How)]) -> Recorder {
    let signals: Vec<_> = hows.iter().map(|(name, how)| ((*name).to_owned(), *how)).collect();
    let config = RecorderConfig {
        dt_s: 0.1,
        ts_length_s: Some(1.0),
        max_gap_s: 0.5,
        sampling: Sampling::default(),
        select,
    };
    Recorder::new(config).with_signals(&signals)
}

#[test]
fn signals_stand_beside_robot_and_people_and_are_empty_when_too_old() {
    let mut recorder = with_signals(Select::All, &[("load", How::Hold(0.35))]);
    for i in 0..40 {
        let t = 5.0 + f64::from(i) / 20.0;
        recorder.robot(&robot(t), Time::ZERO);
        recorder.humans(&humans(t, vec![person(1, t)]), Time::ZERO);
        if i == 4 {
            recorder.signal(0, Time::from_secs_f64(t), 7.0, Time::from_secs_f64(t));
        }
    }
    recorder.finish();
    let batch = recorder.take_batches().remove(0);
    assert_eq!(batch.start, Time::from_secs_f64(5.0));
    let (name, values) = &batch.signals[0];
    let known: Vec<usize> = (0..10).filter(|row| values[*row] == 7.0).collect();
    assert_eq!((name.as_str(), known, values.len()), ("load", vec![2, 3, 4, 5], 10));
    assert!(values[0].is_nan() && values[9].is_nan());
    assert_eq!(batch.columns(false).last().map(|column| column.name.clone()), Some("load".into()));
}

#[test]
fn where_nobody_is_recorded_signals_alone_make_batches() {
    let mut recorder = with_signals(Select::Nobody, &[("a", How::Hold(2.0)), ("b", How::Hold(0.5))]);
    for i in 0..60 {
        let t = Time::from_secs_f64(100.0 + f64::from(i) / 20.0);
        recorder.signal(0, t, f64::from(i), t);
        if i % 10 == 0 {
            // Stamped 0.2 s before it arrives.
            recorder.signal(1, t.plus_secs(-0.2), -1.0, t);
        }
    }
    recorder.finish();
    let batches = recorder.take_batches();
    assert!(batches[0].complete && batches[0].n_rows() == 10 && batches[0].is_of_signals());
    let names: Vec<String> = batches[0].columns(false).into_iter().map(|column| column.name).collect();
    assert_eq!(names, ["a", "b"]);
    assert_eq!(batches[0].signals[0].1[..3], [0.0, 2.0, 4.0]);
    assert_eq!(batches[0].gaps(), []);
    let rows: usize = batches.iter().map(Recording::n_rows).sum();
    assert_eq!(rows, 30);
}

#[test]
fn a_journal_keeps_signals() {
    for select in [Select::Nobody, Select::All] {
        let mut recorder = with_signals(select.clone(), &[("a", How::Hold(2.0))]).with_journal(1);
        for i in 0..30 {
            let secs = 100.0 + f64::from(i) / 20.0;
            if select == Select::All {
                recorder.robot(&robot(secs), Time::ZERO);
                recorder.humans(&humans(secs, vec![person(1, secs)]), Time::ZERO);
            }
            recorder.signal(0, Time::from_secs_f64(secs), f64::from(i), Time::from_secs_f64(secs));
        }
        let (mut header, mut samples) = (None, Vec::new());
        for entry in recorder.take_journal() {
            match entry {
                Entry::Begin(begun) => header = Some(begun),
                Entry::Sample(sample) => samples.push(sample),
                Entry::Abandon(_) => panic!("it is needed"),
            }
        }
        recorder.finish();
        let recovered =
            journal::replay(&journal::encode(&header.expect("begins"), &samples)).expect("a journal");
        let recorded = recorder.take_batches();
        assert_eq!(recovered.len(), recorded.len());
        assert_eq!(recovered[0].signals, recorded[0].signals, "{select}");
    }
}

fn header(secs: f64) -> Header {
    Header { stamp: Time::from_secs_f64(secs), frame_id: "map".into() }
}

fn robot(secs: f64) -> RobotState {
    RobotState { header: header(secs), ..RobotState::default() }
}

fn person(id: u32, secs: f64) -> HumanState {
    HumanState { header: header(secs), id, ..HumanState::default() }
}

fn humans(secs: f64, humans: Vec<HumanState>) -> Humans {
    Humans { header: header(secs), humans }
}

#[test]
fn a_hostile_signal_is_refused_or_read() {
    let seeds: [&[u8]; 4] = [
        b"v = /odom.twist.twist.linear.x",
        b"a = hold(rate(/imu.orientation.yaw) * 2 - 1, 30)",
        b"n = max(/p.people[*].reliability) >= 0.5",
        b"m = /mode.data == \"auto\"",
    ];
    let tokens: [&[u8]; 9] = [b"(", b")", b"[4294967295]", b"[*]", b"/a.b", b"rate(", b"hold(", b"==", b"-"];
    let target = Target {
        corpus: format!("{}/tests/corpus/signal", env!("CARGO_MANIFEST_DIR")).into(),
        seeds: seeds.iter().map(|seed| seed.to_vec()).collect(),
        tokens: &tokens,
        bytes_per_byte: 600,
    };
    target.run(|input| drop(Signal::parse(&String::from_utf8_lossy(input), 2.0, "signals")));
}
