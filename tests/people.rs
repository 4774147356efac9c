//! People of trackers that this program has no types for: whole recordings that other software wrote, through the command and
//! through the nodes.
//!
//! `tests/recordings/people.py` wrote them: two people and a robot, seen by a dozen trackers, in another order in each message,
//! with chairs between them, once with nobody, and by a camera that turns with the robot.

#![allow(
    clippy::expect_used,
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test may panic: that is how it fails"
)]

mod common;

use std::{path::Path, process::Output, sync::Arc};

use common::{csv_files, roscausal};
use roscausal_core::{
    Time,
    loopback::Loopback,
    middleware::Raw,
    nodes,
    params::Value,
    people::Reader,
    state::{human::PeopleTracker, identity::Gates},
};
use roscausal_msgs::tf2_msgs::TFMessage;
use roscausal_recording::{Player, Recording};

const RECORDINGS: [&str; 2] = ["people.bag", "people_mcap"];
const GATES: Gates = Gates { metres: 0.8, keep_s: 1.0, rejoin_s: 0.0 };

/// A recording; `ROSCAUSAL_PEOPLE` names the folder of newly written ones.
fn file(name: &str) -> String {
    if let Ok(folder) = std::env::var("ROSCAUSAL_PEOPLE") {
        return format!("{folder}/{name}");
    }
    format!("{}/tests/recordings/people/{name}", env!("CARGO_MANIFEST_DIR"))
}

fn said(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

/// Where each of the two is, and how fast, `t` seconds after the beginning.
fn truth(person: usize, t: f64) -> (f64, f64, f64) {
    if person == 0 { (2.0 + 0.8 * t, 1.0, 0.8) } else { (9.0 - 0.6 * t, -1.0, -0.6) }
}

/// The people that a topic has, in the map, message by message.
fn seen(recording: &str, topic: &str) -> Vec<(f64, Vec<roscausal_msgs::HumanState>)> {
    let mut recording = Recording::open(Path::new(&file(recording))).expect("opens");
    let topics = recording.topics().to_vec();
    recording.select(|of| of.name == topic || of.name.starts_with("/tf"));
    let classes = ["person".to_owned()];
    let mut reader = Reader::new(topic, &classes, Arc::default());
    let mut tracker = PeopleTracker::new("map", "map", 1.0).with(GATES, 0.05);
    let (mut begin, mut all) = (None, Vec::new());
    for record in recording.by_ref() {
        let of = &topics[record.topic];
        if of.name.starts_with("/tf") {
            tracker.transforms(
                &of.decode::<TFMessage>(&record.bytes).expect("transforms"),
                of.name == "/tf_static",
            );
            continue;
        }
        let begin = *begin.get_or_insert(Time { nanosec: 0, ..record.stamp });
        let kind = Arc::new(of.raw_type().expect("a type"));
        let message = reader.read(&Raw { kind, bytes: record.bytes.clone() });
        tracker.message(message.stamp, message.people);
        all.push((message.stamp.secs_since(begin), tracker.people(|_| None).humans));
    }
    assert_eq!((reader.unreadable(), reader.trouble()), (0, None), "{topic}");
    all
}

#[test]
fn people_of_every_tracker_are_where_they_were_with_one_id_each_and_their_speed() {
    for recording in RECORDINGS {
        for (topic, ids) in [
            ("/detections", [1, 2]),
            ("/untracked", [0, 1]),
            ("/zed/objects", [1, 2]),
            ("/people_tracked", [1, 2]),
            ("/leg_measurements", [1, 2]),
            ("/human_states", [1, 2]),
            ("/carla/objects", [1, 2]),
            ("/tracking", [1, 2]),
            ("/pedestrians", [1, 2]),
            ("/poses", [0, 1]),
        ] {
            let all = seen(recording, topic);
            assert_eq!(all.len(), 30, "{recording} {topic}");
            for (t, people) in &all {
                let found: Vec<u32> = people.iter().map(|person| person.id).collect();
                assert_eq!(found, ids, "{recording} {topic} at {t}");
                for (place, person) in people.iter().enumerate() {
                    // Where nobody was seen, they are where they were last.
                    let t = if (t - 1.0).abs() < 1e-6 { 0.8 } else { *t };
                    let (x, y, vx) = truth(place, t);
                    let close = |a: f64, b: f64| (a - b).abs() < 1e-5;
                    assert!(
                        close(person.pose2d.x, x) && close(person.pose2d.y, y),
                        "{recording} {topic} {t}: {person:?}"
                    );
                    let v = person.twist.linear;
                    assert!(
                        t < 0.1 || (close(v.x, vx) && close(v.y, 0.0)),
                        "{recording} {topic} {t}: {person:?}"
                    );
                }
            }
        }
    }
}

fn replayed(dir: &Path, recording: &str, flags: &[&str]) -> (Output, Vec<(String, String)>) {
    let quick = ["--method", "pcmci", "--test", "parcorr", "--ts-length", "0"];
    let recording = file(recording);
    let output = roscausal(dir, &[&["replay", &recording, "--out", "out"][..], &quick, flags].concat());
    let folder = dir.join("out").join("data_pool");
    (output, if folder.is_dir() { csv_files(&folder) } else { Vec::new() })
}

#[test]
fn ros4hri_people_are_those_on_the_list_and_keep_small_numbers() {
    let dir = tempfile::tempdir().expect("a folder");
    let (output, tables) = replayed(dir.path(), "people_mcap", &["--people", "ros4hri", "--person", "all"]);
    let header =
        tables.first().unwrap_or_else(|| panic!("{}", said(&output))).1.lines().next().unwrap().to_owned();
    assert!(header.contains("h_1_x") && header.contains("h_2_x"), "{header}");
    assert!(!header.contains("h_3_x"), "person_ghost is a frame that nobody tracks: {header}");
    assert!(said(&output).contains("/humans/persons/tracked"), "{}", said(&output));
    assert!(said(&output).contains("people: 1 = anna, 2 = berta"), "it says who is who: {}", said(&output));
}

#[test]
fn a_person_is_chosen_by_her_name() {
    for (recording, people) in
        [("people_mcap", "ros4hri"), ("people.bag", "/pedestrians"), ("people.bag", "tf:person_*")]
    {
        let column = |who: &str| {
            let dir = tempfile::tempdir().expect("a folder");
            let (output, tables) = replayed(dir.path(), recording, &["--people", people, "--person", who]);
            let table = tables.into_iter().next().unwrap_or_else(|| panic!("{}", said(&output))).1;
            let mut lines = table.lines().map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
            let header = lines.next().expect("a header");
            let place = header.iter().position(|name| name.starts_with("h_") && name.ends_with("_y"));
            let place = place.unwrap_or_else(|| panic!("{header:?}"));
            let ys: Vec<f64> = lines.filter_map(|row| row[place].parse().ok()).collect();
            assert!(ys.len() >= 40, "{recording} {people} {who}: {}", ys.len());
            ys.iter().sum::<f64>() / ys.len() as f64
        };
        // Berta is not the first whom the tracker tells of.
        for (who, y) in [("anna", 1.0), ("berta", -1.0)] {
            assert!((column(who) - y).abs() < 1e-3, "{recording} {people} {who}: {}", column(who));
        }
        let dir = tempfile::tempdir().expect("a folder");
        let (output, _) = replayed(dir.path(), recording, &["--people", people, "--person", "ana"]);
        for part in ["nobody called 'ana'", "did you mean 'anna'?", "anna, berta"] {
            assert!(said(&output).contains(part), "{part}: {}", said(&output));
        }
    }
    let dir = tempfile::tempdir().expect("a folder");
    let (output, _) =
        replayed(dir.path(), "people.bag", &["--people", "/people_tracked", "--person", "anna"]);
    assert!(said(&output).contains("nobody in it has a name; choose by number"), "{}", said(&output));
}

#[test]
fn velocity_engagement_and_gaze_of_ros4hri_are_variables_of_the_person_by_name() {
    let dir = tempfile::tempdir().expect("a folder");
    let signals = [
        "--signal",
        "engaged = /humans/persons/{person}/engagement_status.level == 3",
        "--signal",
        "vx = /humans/bodies/{body}/velocity.twist.linear.x",
        "--signal",
        "looks = only(/humans/interactions/gaze.receiver == \"robot\", /humans/interactions/gaze.sender == \"{person}\")",
    ];
    let flags = [&["--people", "ros4hri", "--person", "berta"][..], &signals].concat();
    let (output, tables) = replayed(dir.path(), "people_mcap", &flags);
    let table = &tables.first().unwrap_or_else(|| panic!("{}", said(&output))).1;
    let mut lines = table.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let header = lines.next().expect("a header");
    let column = |name: &str| {
        let place = header.iter().position(|other| *other == name);
        place.unwrap_or_else(|| panic!("no {name} in {header:?}"))
    };
    let (time, engaged, vx, looks) = (column("time"), column("engaged"), column("vx"), column("looks"));
    let rows: Vec<[f64; 4]> = lines
        .map(|row| [time, engaged, vx, looks].map(|place| row[place].parse().unwrap_or(f64::NAN)))
        .collect();
    assert!(rows.len() >= 40, "{}", rows.len());
    let begin = rows[0][0].floor();
    for [time, engaged, vx, looks] in &rows {
        // Between two messages, of which there are five in a second; berta is number 2.
        let tenths = ((time - begin) * 10.0).round() as i64;
        let i = tenths / 2;
        if tenths % 2 == 0 || i < 1 {
            continue;
        }
        let expected = [u8::from((i + 2) % 4 < 2), u8::from((i + 2) % 6 < 3)].map(f64::from);
        assert_eq!([*engaged, *looks], expected, "at {time}");
        assert!((vx + 0.6).abs() < 1e-9, "at {time}: {vx}");
    }
    let (output, _) = replayed(dir.path(), "people_mcap", &[&["--people", "ros4hri"][..], &signals].concat());
    assert!(said(&output).contains("stand for one person; name her"), "{}", said(&output));
}

#[test]
fn one_topic_per_person_and_frames_by_pattern_are_people() {
    for (people, says) in [
        ("/person_1/pose,/person_2/pose", "/person_2/pose (geometry_msgs/PoseStamped)"),
        ("tf:person_*", "TF frames person_*"),
    ] {
        let dir = tempfile::tempdir().expect("a folder");
        let (output, tables) = replayed(dir.path(), "people.bag", &["--people", people, "--person", "2"]);
        assert!(said(&output).contains(says), "{}", said(&output));
        let table = &tables.first().unwrap_or_else(|| panic!("{}", said(&output))).1;
        assert!(table.starts_with("time,r_gx,r_gy,r_x,r_y,r_theta,r_v,r_omega,h_2_x"), "{table}");
        assert!(table.lines().count() >= 55, "{}", table.lines().count());
    }
}

#[test]
fn several_topics_of_people_are_named_and_a_topic_without_people_is_refused() {
    let dir = tempfile::tempdir().expect("a folder");
    let (output, _) = replayed(dir.path(), "people.bag", &[]);
    assert!(said(&output).contains("several topics can be people"), "{}", said(&output));
    assert!(said(&output).contains("/zed/objects (zed_msgs/ObjectsStamped)"), "{}", said(&output));
    let (output, _) = replayed(dir.path(), "people.bag", &["--people", "/tf"]);
    assert!(said(&output).contains("there is no topic /tf that can be people"), "{}", said(&output));
    let (output, _) = replayed(dir.path(), "people.bag", &["--people", "/detection"]);
    assert!(said(&output).contains("did you mean /detections?"), "{}", said(&output));
    assert!(said(&output).contains("vision_msgs/Detection3DArray"), "{}", said(&output));
}

/// The raw batches that the nodes record from the messages as they come.
fn live(dir: &Path, topic: &str) -> Vec<(String, String)> {
    let bus = Loopback::lockstep();
    let text =
        |node: &str, name: &str, value: &str| bus.set_node_param(node, name, Value::Str(value.to_owned()));
    for (name, folder) in [("data_dir", "raw"), ("pp_data_dir", "pp")] {
        text("data", name, &dir.join(folder).display().to_string());
    }
    for (node, name, value) in [
        ("robot", "odom_topic", "/odom"),
        ("robot", "pose_topic", ""),
        ("robot", "source_frame", "base_link"),
        ("robot", "goal_topic", ""),
        ("human", "auto_people_topic", ""),
        ("human", "teleop_people_topic", ""),
        ("human", "people_topic", topic),
        ("human", "people_type", "auto"),
        ("human", "goal_topic", ""),
        ("data", "sel_agent", "all"),
    ] {
        text(node, name, value);
    }
    bus.set_node_param("data", "ts_length", Value::Double(0.0));
    let mut recording = Recording::open(Path::new(&file("people_mcap"))).expect("opens");
    let (start, _) = recording.span().expect("has messages");
    bus.advance_to(Time { nanosec: 0, ..start });
    let robot = bus.start_task("robot", async |mw| nodes::run_task("robot", &mw).await);
    let human = bus.start_task("human", async |mw| nodes::run_task("human", &mw).await);
    let data = bus.start("data", |mw| nodes::data(&mw)).expect("starts");
    let driver = bus.node("driver");
    let topics = recording.topics().to_vec();
    let kinds: Vec<_> = topics.iter().map(|topic| topic.raw_type().map(Arc::new)).collect();
    recording.select(|of| of.name == topic || of.name == "/odom" || of.name.starts_with("/tf"));
    let mut player =
        Player::new(&driver, &recording, |of| of.name != topic && of.known_type().is_some()).expect("plays");
    for record in recording.by_ref() {
        bus.advance_to(record.stamp);
        let of = &topics[record.topic];
        match kinds[record.topic].clone().filter(|_| of.name == topic) {
            Some(kind) => {
                driver.publish_raw(topic, Raw { kind, bytes: record.bytes.clone() }).expect("is sent")
            }
            None => player.publish(of, &record).expect("is sent"),
        }
        bus.settle();
    }
    bus.shutdown();
    robot.end().expect("no panic").expect("ends well");
    human.end().expect("no panic").expect("ends well");
    data.join().expect("ends").expect("records");
    csv_files(&dir.join("raw"))
}

#[test]
fn a_replay_of_any_trackers_people_gives_what_the_nodes_record_to_the_byte() {
    for topic in ["/detections", "/untracked"] {
        let dir = tempfile::tempdir().expect("a folder");
        let live = live(dir.path(), topic);
        let flags = ["--people", topic, "--person", "all", "--robot-odom", "/odom"];
        let same = ["--param", "robot.pose_topic=", "--param", "robot.source_frame=base_link"];
        let (output, again) = replayed(dir.path(), "people_mcap", &[&flags[..], &same].concat());
        assert!(!again.is_empty(), "{}", said(&output));
        assert_eq!(live, again, "{topic}");
        assert!(live[0].1.lines().count() > 50, "{}", live[0].1.lines().count());
    }
}
