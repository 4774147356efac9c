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
#[path = "common/live.rs"]
mod live;

use std::{path::Path, process::Output, sync::Arc};

use common::{csv_files, roscausal};
use live::Live;
use roscausal_core::{
    Time,
    middleware::Raw,
    people::Reader,
    state::{human::PeopleTracker, identity::Gates},
};
use roscausal_msgs::tf2_msgs::TFMessage;
use roscausal_recording::{Recording, Topic};

const RECORDINGS: [&str; 2] = ["people.bag", "people_mcap"];
const GATES: Gates = Gates { metres: 0.8, keep_s: 1.0, rejoin_s: 0.0 };

/// A recording; `ROSCAUSAL_PEOPLE` names the folder of newly written ones.
fn file(name: &str) -> String {
    if let Ok(folder) = std::env::var("ROSCAUSAL_PEOPLE") {
        return format!("{folder}/{name}");
    }
    format!("{}/tests/recordings/people/{name}", env!("CARGO_MANIFEST_DIR"))
}

fn stated(output: &Output) -> String {
    // A note goes on in indented lines.
    let notes = String::from_utf8_lossy(&output.stdout).replace("\n  ", " ");
    format!("{notes}{}", String::from_utf8_lossy(&output.stderr))
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
    let classes = ["person", "people"].map(str::to_owned);
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
        // Markers have headers of their own; without any, the arrival counts, as in the node.
        let stamp = if message.stamp == Time::ZERO { record.stamp } else { message.stamp };
        tracker.message(stamp, message.people);
        all.push((stamp.secs_since(begin), tracker.people(|_| None).humans));
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
            ("/markers", [1, 2]),
            ("/poses", [0, 1]),
        ] {
            let all = seen(recording, topic);
            assert_eq!(all.len(), 30, "{recording} {topic}");
            for (t, people) in &all {
                let found: Vec<u32> = people.iter().map(|person| person.id).collect();
                assert_eq!(found, ids, "{recording} {topic} at {t}");
                for (place, person) in people.iter().enumerate() {
                    // Where nobody was seen, they are where they were last.
                    let t = if (t - 1.0).abs() < 1e-5 { 0.8 } else { *t };
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
        tables.first().unwrap_or_else(|| panic!("{}", stated(&output))).1.lines().next().unwrap().to_owned();
    assert!(header.contains("h_1_x") && header.contains("h_2_x"), "{header}");
    assert!(!header.contains("h_3_x"), "person_ghost is a frame that nobody tracks: {header}");
    assert!(stated(&output).contains("/humans/persons/tracked"), "{}", stated(&output));
    assert!(
        stated(&output).contains("people: 1 = anna, 2 = berta"),
        "it says who is who: {}",
        stated(&output)
    );
}

/// The columns of the batch that everybody is in, and its rows.
fn everybody(recording: &str, flags: &[&str]) -> (Vec<String>, Vec<Vec<f64>>, String) {
    let dir = tempfile::tempdir().expect("a folder");
    let (output, tables) = replayed(dir.path(), recording, &[&["--person", "all"], flags].concat());
    let reported = stated(&output);
    let Some((_, table)) = tables.first() else { return (Vec::new(), Vec::new(), reported) };
    let mut lines = table.lines().map(|line| line.split(','));
    let header = lines.next().expect("a header").map(str::to_owned).collect();
    let rows = lines.map(|row| row.map(|cell| cell.parse().unwrap_or(f64::NAN)).collect()).collect();
    (header, rows, reported)
}

#[test]
fn nobody_is_a_person_of_ros4hri_before_the_list_names_her() {
    let (header, rows, reported) = everybody("people_late", &[]);
    assert!(header.contains(&"h_2_x".to_owned()) && !header.contains(&"h_3_x".to_owned()), "{header:?}");
    assert!(reported.contains("people: 1 = anna, 2 = berta"), "{reported}");
    // Anna goes east from x = 2, 0.8 m each second; the list begins after two.
    let x = header.iter().position(|name| name == "h_1_x").expect("anna");
    let first = rows.iter().map(|row| row[x]).find(|x| x.is_finite()).expect("a place");
    assert!((3.5..3.9).contains(&first), "{first}");
}

#[test]
fn where_only_bodies_are_listed_bodies_are_the_people_and_stray_frames_of_persons_are_not() {
    let (header, rows, reported) = everybody("people_bodies", &[]);
    assert!(reported.contains("people: TF frames of those on /humans/bodies/tracked"), "{reported}");
    assert!(reported.contains("people: 1 = b17, 2 = b99") && !reported.contains("anna"), "{reported}");
    let people = header.iter().filter(|name| name.starts_with("h_") && name.ends_with("_x")).count();
    assert_eq!(people, 2, "{header:?}");
    assert!(rows.len() >= 50, "{}", rows.len());
}

#[test]
fn frames_of_persons_count_without_a_list_where_a_recording_has_none() {
    let dir = tempfile::tempdir().expect("a folder");
    let mut bag = Recording::open(Path::new(&file("people_late"))).expect("opens");
    let topics = bag.topics().to_vec();
    let mut writer = roscausal_recording::McapWriter::create(dir.path().join("frames.mcap")).expect("a file");
    for record in bag.by_ref() {
        let of = &topics[record.topic];
        match of.name.as_str() {
            "/odom" => {
                let odometry = of.decode::<roscausal_msgs::nav_msgs::Odometry>(&record.bytes).expect("reads");
                writer.write(&of.name, record.stamp, &odometry)
            }
            name if name.starts_with("/tf") => {
                writer.write(name, record.stamp, &of.decode::<TFMessage>(&record.bytes).expect("reads"))
            }
            _ => Ok(()),
        }
        .expect("writes");
    }
    writer.finish().expect("ends");
    let run = |flags: &[&str]| {
        let replay = ["replay", "frames.mcap", "--out", "out", "--ts-length", "0", "--person", "all"];
        stated(&roscausal(dir.path(), &[&replay, flags].concat()))
    };
    for flags in [&[][..], &["--people", "ros4hri"]] {
        let reported = run(flags);
        assert!(
            reported.contains("people: all TF frames person_*, since no topic says who is tracked"),
            "{reported}"
        );
        assert!(reported.contains("= anna") && reported.contains("= ghost"), "{reported}");
    }
}

#[test]
fn who_was_lost_and_found_under_another_number_is_one_person_within_the_rejoin_time() {
    let people = |flags: &[&str]| {
        let (header, rows, reported) = everybody("people_renamed", flags);
        let xs: Vec<usize> = (0..header.len())
            .filter(|i| header[*i].starts_with("h_") && header[*i].ends_with("_x"))
            .collect();
        assert!(!rows.is_empty(), "{reported}");
        (xs.iter().map(|i| header[*i].clone()).collect::<Vec<_>>(), rows[rows.len() - 2][xs[0]])
    };
    let (names, _) = people(&[]);
    assert_eq!(names, ["h_1_x", "h_77_x"]);
    let (names, last) = people(&["--param", "human.rejoin_time=1.5"]);
    assert_eq!(names, ["h_1_x"]);
    assert!(last > 6.0, "the person is there to the end, at x = 6.6: {last}");
}

#[test]
fn a_person_is_chosen_by_her_name() {
    for (recording, people) in
        [("people_mcap", "ros4hri"), ("people.bag", "/pedestrians"), ("people.bag", "tf:person_*")]
    {
        let column = |who: &str| {
            let dir = tempfile::tempdir().expect("a folder");
            let (output, tables) = replayed(dir.path(), recording, &["--people", people, "--person", who]);
            let table = tables.into_iter().next().unwrap_or_else(|| panic!("{}", stated(&output))).1;
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
            assert!(stated(&output).contains(part), "{part}: {}", stated(&output));
        }
    }
    let dir = tempfile::tempdir().expect("a folder");
    let (output, _) =
        replayed(dir.path(), "people.bag", &["--people", "/people_tracked", "--person", "anna"]);
    assert!(stated(&output).contains("nobody in it has a name; choose by number"), "{}", stated(&output));
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
    let table = &tables.first().unwrap_or_else(|| panic!("{}", stated(&output))).1;
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
    assert!(stated(&output).contains("stand for one person; name them"), "{}", stated(&output));
}

#[test]
fn one_topic_per_person_and_frames_by_pattern_are_people() {
    for (people, says) in [
        ("/person_1/pose,/person_2/pose", "/person_2/pose (geometry_msgs/PoseStamped)"),
        ("tf:person_*", "TF frames person_*"),
    ] {
        let dir = tempfile::tempdir().expect("a folder");
        let (output, tables) = replayed(dir.path(), "people.bag", &["--people", people, "--person", "2"]);
        assert!(stated(&output).contains(says), "{}", stated(&output));
        let table = &tables.first().unwrap_or_else(|| panic!("{}", stated(&output))).1;
        assert!(table.starts_with("time,r_gx,r_gy,r_x,r_y,r_theta,r_v,r_omega,h_2_x"), "{table}");
        assert!(table.lines().count() >= 55, "{}", table.lines().count());
    }
}

#[test]
fn several_topics_of_people_are_named_and_a_topic_without_people_is_refused() {
    let dir = tempfile::tempdir().expect("a folder");
    let (output, _) = replayed(dir.path(), "people.bag", &[]);
    assert!(stated(&output).contains("several topics can be people"), "{}", stated(&output));
    assert!(stated(&output).contains("/zed/objects (zed_msgs/ObjectsStamped)"), "{}", stated(&output));
    let (output, _) = replayed(dir.path(), "people.bag", &["--people", "/tf"]);
    assert!(stated(&output).contains("there is no topic /tf that can be people"), "{}", stated(&output));
    let (output, _) = replayed(dir.path(), "people.bag", &["--people", "/detection"]);
    assert!(stated(&output).contains("did you mean /detections?"), "{}", stated(&output));
    assert!(stated(&output).contains("vision_msgs/Detection3DArray"), "{}", stated(&output));
}

/// The raw batches that the nodes record from the messages as they come. `people` is what `--people` takes.
fn live(dir: &Path, recording: &str, people: &str) -> Vec<(String, String)> {
    let (kind, topics, frames) = match people.strip_prefix("tf:") {
        Some(frames) => ("ros4hri", "", frames),
        None if people == "ros4hri" => ("ros4hri", "", ""),
        None => ("auto", people, ""),
    };
    let texts = [
        ("robot", "odom_topic", "/odom"),
        ("robot", "pose_topic", ""),
        ("robot", "source_frame", "base_link"),
        ("robot", "goal_topic", ""),
        ("human", "auto_people_topic", ""),
        ("human", "teleop_people_topic", ""),
        ("human", "people_topic", topics),
        ("human", "people_type", kind),
        ("human", "people_frames", frames),
        ("human", "goal_topic", ""),
    ];
    let raw = |of: &Topic| topics.split(',').any(|topic| topic == of.name);
    let wanted = |of: &Topic| {
        raw(of) || of.name == "/odom" || of.name.starts_with("/tf") || of.type_name == "hri_msgs/IdsList"
    };
    Live { texts: &texts, signals: &[], wanted: &wanted, raw: &raw }.record(dir, &file(recording))
}

#[test]
fn every_trackers_type_is_found_by_itself_and_a_replay_gives_what_the_nodes_record_to_the_byte() {
    for (recording, people, first) in [
        ("people_mcap", "/detections", "h_1_x"),
        ("people_mcap", "/untracked", "h_0_x"),
        ("people_mcap", "/zed/objects", "h_1_x"),
        ("people_mcap", "/people_tracked", "h_1_x"),
        ("people_mcap", "/leg_measurements", "h_1_x"),
        ("people_mcap", "/human_states", "h_1_x"),
        ("people_mcap", "/carla/objects", "h_1_x"),
        ("people_mcap", "/tracking", "h_1_x"),
        ("people_mcap", "/pedestrians", "h_1_x"),
        ("people_mcap", "/markers", "h_1_x"),
        ("people_mcap", "/poses", "h_0_x"),
        ("people_mcap", "/person_1/pose,/person_2/pose", "h_1_x"),
        ("people_mcap", "ros4hri", "h_1_x"),
        ("people_mcap", "tf:person_*", "h_1_x"),
        ("people_late", "ros4hri", "h_1_x"),
        ("people_bodies", "ros4hri", "h_1_x"),
        ("people.bag", "/human_states", "h_1_x"),
        ("people.bag", "/markers", "h_1_x"),
    ] {
        let dir = tempfile::tempdir().expect("a folder");
        let live = live(dir.path(), recording, people);
        let flags = ["--people", people, "--person", "all", "--robot-odom", "/odom"];
        let same = ["--param", "robot.pose_topic=", "--param", "robot.source_frame=base_link"];
        let (output, again) = replayed(dir.path(), recording, &[&flags[..], &same].concat());
        assert!(!again.is_empty(), "{recording} {people}: {}", stated(&output));
        assert_eq!(live, again, "{recording} {people}");
        let header = live[0].1.lines().next().unwrap_or_default();
        assert!(header.split(',').any(|name| name == first), "{recording} {people}: {header}");
        assert!(live[0].1.lines().count() > 35, "{people}: {}", live[0].1.lines().count());
    }
}
