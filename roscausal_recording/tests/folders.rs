//! A folder is read as one recording: each message once, and what is left out is reported.
#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test, in helpers too")]

use std::{
    fs,
    path::{Path, PathBuf},
};

use roscausal_core::Time;
use roscausal_msgs::{nav_msgs::Odometry, std_msgs::Bool};
use roscausal_recording::{McapWriter, Recording, folders_in, is_named_so, recordings_in};

fn data(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(file)
}

/// A recording of odometry at 10 Hz whose first message is number `from` of a drive.
fn part(path: &Path, from: u32, count: u32) {
    let mut writer = McapWriter::create(path).unwrap();
    for number in from..from + count {
        let mut odometry = Odometry::default();
        odometry.header.stamp = Time::from_secs_f64(100.0 + 0.1 * f64::from(number));
        odometry.pose.pose.position.x = f64::from(number);
        writer.write("/odom", odometry.header.stamp, &odometry).unwrap();
    }
    writer.finish().unwrap();
}

/// Number of messages, and what was reported.
fn read(path: &Path) -> (usize, Vec<String>) {
    let mut recording = Recording::open(path).unwrap();
    let records: Vec<_> = recording.by_ref().collect();
    assert!(records.is_sorted_by_key(|record| record.stamp));
    (records.len(), recording.losses().to_vec())
}

fn copy(file: &str, folder: &Path, name: &str) {
    fs::copy(data(file), folder.join(name)).unwrap();
}

/// Writes a bag as its recorder leaves it when it is killed.
fn unclosed(file: &str, to: &Path) {
    let mut bytes = fs::read(data(file)).unwrap();
    let place = bytes.windows(10).position(|window| window == b"index_pos=").unwrap() + 10;
    let index = u64::from_le_bytes(bytes[place..place + 8].try_into().unwrap());
    bytes.truncate(usize::try_from(index).unwrap());
    bytes[place..place + 8].fill(0);
    fs::write(to, bytes).unwrap();
}

#[test]
fn a_bag_that_was_never_closed_is_read_in_a_folder_and_alone() {
    let folder = tempfile::tempdir().unwrap();
    let active = folder.path().join("walk_1.bag.active");
    unclosed("plain.bag", &active);
    assert!(is_named_so(&active) && !is_named_so(Path::new("run.active")));
    part(&folder.path().join("walk_0.mcap"), 0, 10);
    assert_eq!(read(&active).0, 20);
    let (count, losses) = read(folder.path());
    assert_eq!(count, 30);
    assert!(losses.len() == 1 && losses[0].contains("walk_1.bag.active"), "{losses:?}");
}

#[test]
fn an_old_bag_is_named_with_what_makes_a_new_one_of_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("old.bag");
    let version = |magic: &[u8]| {
        fs::write(&path, [magic, &[0; 100]].concat()).unwrap();
        Recording::open(&path).err().unwrap().to_string()
    };
    for (magic, number) in
        [(&b"#ROSRECORD V1.2\n"[..], "1.2"), (b"#ROSRECORD V1.1\n", "1.1"), (b"#ROSBAG V1.3\n", "1.3")]
    {
        let error = version(magic);
        assert!(error.contains(&format!("old bag, of version {number}")), "{error}");
        assert!(error.contains("'rosbag fix OLD.bag NEW.bag'"), "{error}");
    }
    let error = version(b"#ROSBAG V3.0\n");
    assert!(error.contains("version 3.0") && !error.contains("fix"), "{error}");
}

#[test]
fn copies_of_one_recording_count_once_whatever_their_format() {
    let folder = tempfile::tempdir().unwrap();
    for (file, name) in
        [("plain.bag", "walk.bag"), ("ros2_plain.mcap", "walk.mcap"), ("ros2_db3/ros2_db3.db3", "walk.db3")]
    {
        copy(file, folder.path(), name);
    }
    unclosed("plain.bag", &folder.path().join("walk.orig.bag"));
    let (count, losses) = read(folder.path());
    assert_eq!(count, 20, "{losses:?}");
    let left_out = losses.iter().filter(|loss| loss.contains("so it is left out")).count();
    assert_eq!(left_out, 3, "{losses:?}");
    // What the repair left behind is no better than its result.
    let of_original = |loss: &String| loss.contains("walk.orig.bag: it holds the messages of");
    assert!(losses.iter().any(of_original), "{losses:?}");
}

#[test]
fn the_more_complete_of_two_copies_counts() {
    let folder = tempfile::tempdir().unwrap();
    part(&folder.path().join("a.mcap"), 0, 80);
    part(&folder.path().join("b.orig.mcap"), 0, 100);
    let (count, losses) = read(folder.path());
    assert_eq!(count, 100);
    assert!(losses[0].contains("a.mcap: it holds the messages of b.orig.mcap"), "{losses:?}");
}

#[test]
fn what_two_overlapping_parts_hold_counts_once() {
    for [early, late] in [["a.mcap", "b.mcap"], ["b.mcap", "a.mcap"]] {
        let folder = tempfile::tempdir().unwrap();
        part(&folder.path().join(early), 0, 100);
        part(&folder.path().join(late), 60, 100);
        let (count, losses) = read(folder.path());
        assert_eq!(count, 160, "{losses:?}");
        let note = format!("{late}: its first messages are the last ones of {early}, and count once");
        assert!(losses.len() == 1 && losses[0].ends_with(&note), "{losses:?}");
        assert_eq!(Recording::open(folder.path()).unwrap().laps(), 1);
    }
}

#[test]
fn parts_in_any_order_of_their_names_are_no_copies() {
    let folder = tempfile::tempdir().unwrap();
    part(&folder.path().join("run_10.mcap"), 50, 50);
    part(&folder.path().join("run_9.mcap"), 0, 51);
    assert_eq!(read(folder.path()), (101, Vec::new()));
    assert_eq!(Recording::open(folder.path()).unwrap().laps(), 1);
}

/// Writes runs of odometry at 10 Hz, each from the same time on, as a simulation that is reset.
fn laps(path: &Path, runs: i32, each: i32) {
    let mut writer = McapWriter::create(path).unwrap();
    for number in 0..runs * each {
        let mut odometry = Odometry::default();
        odometry.header.stamp = Time::from_secs_f64(100.0 + 0.1 * f64::from(number % each));
        odometry.pose.pose.position.y = f64::from(number / each);
        writer.write("/odom", odometry.header.stamp, &odometry).unwrap();
    }
    writer.finish().unwrap();
}

/// The run that each message says that it is of, in the order of reading.
fn told_runs(path: &Path) -> Vec<i32> {
    let mut recording = Recording::open(path).unwrap();
    let topic = recording.topics()[0].clone();
    let run = |record: roscausal_recording::Record| {
        let odometry: Odometry = topic.decode(&record.bytes).unwrap();
        assert_eq!(odometry.pose.pose.position.y, f64::from(record.lap));
        odometry.pose.pose.position.y as i32
    };
    let reported = recording.by_ref().map(run).collect();
    assert_eq!(recording.losses(), &[] as &[String]);
    reported
}

#[test]
fn a_time_of_recording_that_goes_back_begins_another_run() {
    let folder = tempfile::tempdir().unwrap();
    // One chunk, and many.
    for each in [60, 20_000] {
        let path = folder.path().join("loop.mcap");
        laps(&path, 3, each);
        assert_eq!(Recording::open(&path).unwrap().laps(), 3);
        let expected: Vec<i32> = (0..3).flat_map(|run| vec![run; each as usize]).collect();
        assert_eq!(told_runs(&path), expected);
        let mut by_run = Recording::open(&path).unwrap().by_lap();
        for run in 0..3 {
            assert_eq!(by_run.by_ref().count(), each as usize, "{run}");
            assert_eq!(by_run.next_lap(), run < 2);
        }
    }
}

#[test]
fn two_runs_of_a_simulation_in_one_folder_are_not_mixed() {
    let folder = tempfile::tempdir().unwrap();
    part(&folder.path().join("a.mcap"), 0, 100);
    let mut writer = McapWriter::create(folder.path().join("b.mcap")).unwrap();
    for number in 0..100 {
        let mut odometry = Odometry::default();
        odometry.header.stamp = Time::from_secs_f64(100.0 + 0.1 * f64::from(number));
        odometry.pose.pose.position.y = 1.0;
        writer.write("/odom", odometry.header.stamp, &odometry).unwrap();
    }
    writer.finish().unwrap();
    let expected: Vec<i32> = [[0; 100], [1; 100]].concat();
    assert_eq!(told_runs(folder.path()), expected);
}

#[test]
fn a_few_times_of_recording_far_off_are_no_other_run() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("glitch.mcap");
    let mut writer = McapWriter::create(&path).unwrap();
    for number in 0..200 {
        let mut odometry = Odometry::default();
        odometry.header.stamp = Time::from_secs_f64(100.0 + 0.1 * f64::from(number));
        let far = if (50..56).contains(&number) { 3e8 } else { 0.0 };
        writer
            .write("/odom", Time::from_secs_f64(odometry.header.stamp.as_secs_f64() + far), &odometry)
            .unwrap();
    }
    writer.finish().unwrap();
    assert_eq!(Recording::open(&path).unwrap().laps(), 1);
    assert_eq!(read(&path), (200, Vec::new()));
}

#[test]
fn a_folder_of_folders_is_read_if_one_of_them_is_a_recording_and_else_they_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let inside = |name: &str| {
        let path = folder.path().join(name);
        fs::create_dir(&path).unwrap();
        path
    };
    part(&inside("run_1").join("run_1_0.mcap"), 0, 10);
    inside("pictures");
    assert_eq!(folders_in(folder.path()).len(), 1);
    assert!(recordings_in(folder.path()).is_empty());
    assert_eq!(read(folder.path()).0, 10);
    part(&inside("run_2").join("run_2_0.mcap"), 0, 10);
    let error = Recording::open(folder.path()).err().unwrap().to_string();
    assert!(error.ends_with("name one of them: run_1, run_2"), "{error}");
    part(&folder.path().join("own.mcap"), 0, 5);
    let (count, losses) = read(folder.path());
    assert!(count == 5 && losses[0].contains("run_1, run_2"), "{losses:?}");
}

#[test]
fn what_the_metadata_list_is_checked() {
    let folder = tempfile::tempdir().unwrap();
    let metadata = |counted: u32| {
        let text = format!(
            "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n  \
             relative_file_paths:\n    - run_0.mcap\n    - run_1.mcap\n  topics_with_message_count:\n    \
             - topic_metadata:\n        name: /odom\n        type: nav_msgs/msg/Odometry\n      \
             message_count: {counted}\n"
        );
        fs::write(folder.path().join("metadata.yaml"), text).unwrap();
    };
    part(&folder.path().join("run_0.mcap"), 0, 10);
    metadata(25);
    let (count, losses) = read(folder.path());
    assert_eq!(count, 10);
    assert!(losses[0].contains("run_1.mcap, a part of the recording, is missing"), "{losses:?}");
    assert!(losses[1].ends_with("15 of 25 of /odom"), "{losses:?}");
    part(&folder.path().join("run_1.mcap"), 10, 15);
    assert_eq!(read(folder.path()), (25, Vec::new()));
    // A list may count all messages together only.
    for (counted, reported) in [(40, true), (25, false), (20, false)] {
        let text = format!("rosbag2_bagfile_information:\n  version: 5\n  message_count: {counted}\n");
        fs::write(folder.path().join("metadata.yaml"), text).unwrap();
        let (count, losses) = read(folder.path());
        let says = "15 of the 40 messages that it counts are not there";
        assert!(count == 25 && losses.iter().any(|loss| loss.ends_with(says)) == reported, "{losses:?}");
    }
    // Whatever it is, the recording is read, and a list that says nothing is named.
    for text in ["", "a: [", "- 1\n", "rosbag2_bagfile_information: 3"] {
        fs::write(folder.path().join("metadata.yaml"), text).unwrap();
        let (count, losses) = read(folder.path());
        assert!(count == 25 && losses.len() == 1 && losses[0].contains("no list of rosbag2"), "{losses:?}");
    }
}

#[test]
fn messages_outside_the_chunks_that_an_index_names_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let file = fs::File::create(&path).unwrap();
    let mut writer = mcap::WriteOptions::new().use_chunks(true).chunk_size(None).create(file).unwrap();
    let schema = writer.add_schema("std_msgs/msg/Bool", "ros2msg", b"bool data\n").unwrap();
    let channel = writer.add_channel(schema, "/on", "cdr", &Default::default()).unwrap();
    let header = |time: u64| mcap::records::MessageHeader {
        channel_id: channel,
        sequence: 0,
        log_time: time,
        publish_time: time,
    };
    let bytes = roscausal_msgs::cdr::to_bytes(&Bool { data: true }).unwrap();
    for time in 0..10 {
        writer.write_to_known_channel(&header(time), &bytes).unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    // A message between the chunk's index and the end of the data.
    let whole = fs::read(&path).unwrap();
    let mut record = vec![5];
    record.extend((22 + bytes.len() as u64).to_le_bytes());
    record.extend(channel.to_le_bytes());
    record.extend([0; 4]);
    record.extend([20u64.to_le_bytes(), 20u64.to_le_bytes()].concat());
    record.extend(&bytes);
    let end = data_end(&whole);
    let mut more = [&whole[..end], &record, &whole[end..]].concat();
    // The footer says where the summary begins.
    let footer = more.len() - 8 - 20;
    for place in [footer, footer + 8] {
        let start = u64::from_le_bytes(more[place..place + 8].try_into().unwrap());
        if start > 0 {
            more[place..place + 8].copy_from_slice(&(start + record.len() as u64).to_le_bytes());
        }
    }
    more[footer + 16..footer + 20].fill(0);
    fs::write(&path, &more).unwrap();
    assert_eq!(read(&path), (11, Vec::new()));
}

/// Where the data section of an MCAP file ends.
fn data_end(bytes: &[u8]) -> usize {
    let mut at = 8;
    while bytes[at] != 15 {
        at += 9 + usize::try_from(u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap())).unwrap();
    }
    at
}
