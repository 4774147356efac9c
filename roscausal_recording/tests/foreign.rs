//! Recordings of other projects are read with the messages that other software (rosbags, mcap, sqlite3) counts in them.
#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test, in helpers too")]

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use roscausal_msgs::{geometry_msgs::PoseArray, nav_msgs::Odometry, std_msgs::String as Text};
use roscausal_recording::Recording;

fn path(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/recordings/foreign").join(file)
}

/// File, and topic, type and number of messages of each topic.
type Expected = (&'static str, &'static [(&'static str, &'static str, usize)]);

const TEXT: &str = "std_msgs/String";
const FILES: [Expected; 13] = [
    (
        "inorbit_samples/fake_sensors_sample.bag",
        &[
            ("/my_magnetic_field", "sensor_msgs/MagneticField", 10),
            ("/my_temperature", "sensor_msgs/Temperature", 10),
        ],
    ),
    (
        "leg_tracker/positive_2_extracted.bag",
        &[
            ("/leg_cluster_positions", "geometry_msgs/PoseArray", 83),
            ("/training_scan", "sensor_msgs/LaserScan", 83),
            ("/visualization_marker_array", "visualization_msgs/MarkerArray", 83),
        ],
    ),
    (
        "robot_localization/test2.bag",
        &[
            ("/imu/data", "sensor_msgs/Imu", 3061),
            ("/jackal_velocity_controller/odom", "nav_msgs/Odometry", 3060),
        ],
    ),
    ("rosbag2/multiple_files_0.db3", &[("/chatter", TEXT, 1324)]),
    ("rosbag2/multiple_files_0.mcap", &[("/chatter", TEXT, 1324)]),
    ("rosbag2/multiple_files_1.db3", &[("/chatter", TEXT, 1324)]),
    ("rosbag2/multiple_files_1.mcap", &[("/chatter", TEXT, 1324)]),
    (
        "rosbag2/rewriter_b_0.db3",
        &[("a_empty", "test_msgs/Empty", 25), ("c_strings", "test_msgs/Strings", 50)],
    ),
    ("rosbag2/talker.mcap", &[("/rosout", "rcl_interfaces/Log", 10), ("/topic", TEXT, 10)]),
    (
        "rosbag2/wbag_0.mcap",
        &[
            ("AAA", TEXT, 174),
            ("BBB", TEXT, 145),
            ("CCC", TEXT, 157),
            ("DDD", TEXT, 163),
            ("EEE", TEXT, 147),
            ("FFF", TEXT, 171),
            ("GGG", TEXT, 141),
            ("HHH", TEXT, 148),
        ],
    ),
    (
        "rosbag2_bag_v2/test_bag.bag",
        &[("/rosout", "rosgraph_msgs/Log", 3), ("/test_topic", TEXT, 1), ("/test_topic2", TEXT, 1)],
    ),
    (
        "rosbag2_bag_v2/test_bag_end_to_end.bag",
        &[("int_topic", "std_msgs/Int32", 3), ("rosout", "rosgraph_msgs/Log", 5), ("string_topic", TEXT, 3)],
    ),
    (
        "rosbag2_bag_v2/test_bag_multiple_connections.bag",
        &[
            ("/int_test_topic", "std_msgs/Int32", 2),
            ("/rosout", "rosgraph_msgs/Log", 2),
            ("/test_topic", TEXT, 2),
        ],
    ),
];

#[test]
fn recordings_of_other_projects_have_the_messages_that_other_software_counts() {
    for (file, expected) in FILES {
        let mut recording = Recording::open(path(file)).unwrap();
        let topics = recording.topics().to_vec();
        let mut counts = BTreeMap::new();
        for record in recording.by_ref() {
            let topic = &topics[record.topic];
            *counts.entry((topic.name.clone(), topic.type_name.clone())).or_insert(0) += 1;
            if topic.type_name == TEXT {
                topic.decode::<Text>(&record.bytes).unwrap();
            }
        }
        assert_eq!(recording.losses(), &[] as &[String], "{file}");
        let counts: Vec<(&str, &str, usize)> =
            counts.iter().map(|((name, kind), count)| (name.as_str(), kind.as_str(), *count)).collect();
        assert_eq!(counts, expected, "{file}");
    }
}

#[test]
fn every_foreign_recording_is_tested_and_has_its_source_and_licence() {
    let readme = std::fs::read_to_string(path("README.md")).unwrap();
    let (mut files, mut projects) = (Vec::new(), 0);
    for project in std::fs::read_dir(path("")).unwrap().map(|entry| entry.unwrap()) {
        if !project.file_type().unwrap().is_dir() {
            continue;
        }
        projects += 1;
        let name = project.file_name().to_string_lossy().into_owned();
        assert!(readme.contains(&format!("`{name}/")), "README.md does not name the source of {name}");
        assert!(project.path().join("LICENSE").is_file(), "{name}");
        let recordings = std::fs::read_dir(project.path()).unwrap().map(|entry| entry.unwrap().file_name());
        let recordings = recordings.filter(|file| file != "LICENSE");
        files.extend(recordings.map(|file| format!("{name}/{}", file.to_string_lossy())));
    }
    files.sort();
    assert_eq!(files, FILES.map(|(file, _)| file.to_owned()));
    assert!(files.len() >= 8 && projects >= 4, "{} files of {projects} projects", files.len());
}

#[test]
fn a_robots_odometry_and_a_trackers_clusters_are_decoded() {
    let values = |file: &str, name: &str, value: &dyn Fn(&roscausal_recording::Topic, &[u8]) -> f64| {
        let mut recording = Recording::open(path(file)).unwrap();
        let topic = recording.topic(name, None).unwrap();
        let of = recording.topics()[topic].clone();
        recording.select(|topic| topic.name == name);
        recording.map(|record| value(&of, &record.bytes)).collect::<Vec<f64>>()
    };
    let speeds =
        values("robot_localization/test2.bag", "/jackal_velocity_controller/odom", &|topic, bytes| {
            topic.decode::<Odometry>(bytes).unwrap().twist.twist.linear.x
        });
    assert!(speeds.len() == 3060 && speeds.iter().all(|speed| speed.abs() < 3.0));
    assert!(speeds.iter().any(|speed| speed.abs() > 0.1), "the robot drives");
    let clusters =
        values("leg_tracker/positive_2_extracted.bag", "/leg_cluster_positions", &|topic, bytes| {
            topic.decode::<PoseArray>(bytes).unwrap().poses.len() as f64
        });
    assert!(clusters.len() == 83 && clusters.iter().any(|count| *count > 0.0));
}

#[test]
fn a_split_recording_is_one_whatever_the_storage() {
    let folder = tempfile::tempdir().unwrap();
    let count = |ending: &str| {
        for part in 0..2 {
            let name = format!("multiple_files_{part}.{ending}");
            std::fs::copy(path("rosbag2").join(&name), folder.path().join(&name)).unwrap();
        }
        let records: Vec<_> = Recording::open(folder.path()).unwrap().collect();
        assert!(records.is_sorted_by_key(|record| record.stamp));
        records.len()
    };
    assert_eq!(count("mcap"), 2 * 1324);
    // The same recording in another format: a copy.
    assert_eq!(count("db3"), 2 * 1324);
}

#[test]
fn a_real_recording_cut_anywhere_gives_each_message_once() {
    let folder = tempfile::tempdir().unwrap();
    for file in ["rosbag2/multiple_files_0.db3", "rosbag2/wbag_0.mcap", "rosbag2_bag_v2/test_bag.bag"] {
        let bytes = std::fs::read(path(file)).unwrap();
        let read = |bytes: &[u8]| {
            let path = folder.path().join("cut");
            std::fs::write(&path, bytes).unwrap();
            Recording::open(path).ok().map(|recording| {
                let mut found: Vec<_> =
                    recording.map(|record| (record.stamp, record.topic, record.bytes)).collect();
                found.sort();
                found
            })
        };
        let whole = read(&bytes).unwrap();
        let least = whole.windows(2).filter(|pair| pair[0] == pair[1]).count();
        for cut in (1..60).map(|part| bytes.len() * part / 60) {
            let Some(found) = read(&bytes[..cut]) else { continue };
            assert!(
                found.windows(2).filter(|pair| pair[0] == pair[1]).count() <= least,
                "{file} cut at {cut}"
            );
            assert!(found.len() <= whole.len(), "{file} cut at {cut}");
        }
        let most = read(&bytes[..bytes.len() * 85 / 100]).map_or(0, |found| found.len());
        assert!(most * 2 >= whole.len() || whole.len() < 10, "{file}: {most} of {}", whole.len());
    }
}
