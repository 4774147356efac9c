//! Recordings from other software are read with equal contents, intact or damaged. `tests/recordings.sh` wrote
//! those in `data`, and writes fresh, longer ones for the same tests.
#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test, in helpers too")]

use std::{
    collections::HashMap,
    fs,
    io::Write,
    path::{Path, PathBuf},
    sync::OnceLock,
};

use proptest::{collection::vec, prelude::*};

use roscausal_core::Time;
use roscausal_fuzz::splitmix64;
use roscausal_msgs::{Message, nav_msgs::Odometry, people_msgs::People, std_msgs::Bool, tf2_msgs::TFMessage};
use roscausal_recording::{Encoding, Record, Recording};

const BEGIN: i64 = 1_700_000_000_000_000_000;
const STEP: i64 = 100_000_000;
const FILES: [&str; 15] = [
    "plain.bag", "lz4.bag", "bz2.bag", "ros2_db3", "ros2_mcap", "ros2_db3_by_file", "ros2_mcap_by_file",
    "ros2_db3_by_message", "ros2_mcap_by_message", "ros1_zstd.mcap", "ros2_lz4.mcap", "ros2_plain.mcap",
    "unchunked.mcap", "ros1_support.mcap", "ros2_support.mcap",
];

/// Written by ROS 1's own rosbag, if it is installed.
const REAL: [&str; 3] = ["real_none.bag", "real_bz2.bag", "real_lz4.bag"];

/// The recordings, and the number of odometry messages in each.
fn recordings() -> Vec<(PathBuf, i64)> {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    let mut folders = vec![(data, 12)];
    if let Some(fresh) = std::env::var_os("ROSCAUSAL_RECORDINGS") {
        let count = std::env::var("ROSCAUSAL_RECORDED").unwrap().parse().unwrap();
        folders.push((fresh.into(), count));
    }
    let all = |(folder, count): (PathBuf, i64)| {
        let there = |file: &&str| folder.join(file).exists();
        let files: Vec<&str> = FILES.into_iter().chain(REAL.into_iter().filter(there)).collect();
        files.into_iter().map(move |file| (folder.join(file), count)).collect::<Vec<_>>()
    };
    folders.into_iter().flat_map(all).collect()
}

/// One file of each format, in memory.
fn boundeds() -> Vec<(&'static str, Vec<u8>)> {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    [
        "plain.bag",
        "lz4.bag",
        "bz2.bag",
        "ros2_db3/ros2_db3.db3",
        "ros2_db3_by_file/ros2_db3_by_file.db3.zstd",
        "ros2_mcap_by_message/ros2_mcap_by_message.mcap",
        "ros1_zstd.mcap",
        "ros2_plain.mcap",
        "unchunked.mcap",
    ]
    .map(|file| (file, fs::read(data.join(file)).unwrap()))
    .to_vec()
}

#[test]
fn topics_are_named_with_type_encoding_count_and_latching() {
    for (path, count) in recordings() {
        let recording = Recording::open(&path).unwrap();
        assert_eq!(recording.losses(), &[] as &[String], "{}", path.display());
        let named = |ending: &str| path.display().to_string().ends_with(ending);
        let is_ros1 = named(".bag") || named("ros1_zstd.mcap") || named("ros1_support.mcap");
        // Those libraries write neither a type's sum nor whether a topic is latched.
        let by_support = named("_support.mcap");
        let mut topics: Vec<_> = recording.topics().iter().collect();
        topics.sort_by_key(|topic| &topic.name);
        let described: Vec<_> = topics
            .iter()
            .map(|topic| (topic.name.as_str(), topic.type_name.as_str(), topic.known_type().is_some()))
            .collect();
        let expected = [
            ("/odd", "custom_msgs/Odd", false),
            ("/odom", "nav_msgs/Odometry", true),
            ("/people", "people_msgs/People", true),
            ("/tf_static", "tf2_msgs/TFMessage", true),
        ];
        assert_eq!(described, expected, "{}", path.display());
        let encoding = if is_ros1 { Encoding::Ros1 } else { Encoding::Cdr };
        assert!(topics.iter().all(|topic| topic.encoding == encoding), "{}", path.display());
        let counts: Vec<_> = topics.iter().filter_map(|topic| topic.messages).collect();
        let counted = [1, count, (count + 1) / 2, 1].map(|count| u64::try_from(count).unwrap());
        assert!(counts.is_empty() || counts == counted, "{}: {counts:?}", path.display());
        if is_ros1 && !by_support {
            let odometry = &topics[1];
            assert_eq!(odometry.md5.as_deref(), Some(Odometry::ros1_md5()), "{}", path.display());
        }
        // The MCAP writer of the tests does not write profiles of ROS 2.
        let profiles = (is_ros1 || path.is_dir()) && !by_support;
        let latched: Vec<_> = topics.iter().map(|topic| topic.latched).collect();
        assert_eq!(latched, [false, false, false, profiles], "{}", path.display());
        if !path.display().to_string().contains("ros2_db3") {
            assert!(topics.iter().all(|topic| !topic.definition.is_empty()), "{}", path.display());
        }
        let (start, end) = recording.span().unwrap();
        assert_eq!((start.as_nanos(), end.as_nanos()), (BEGIN, BEGIN + (count - 1) * STEP + 1000));
    }
}

#[test]
fn messages_come_in_the_order_of_their_times_with_equal_contents() {
    for (path, count) in recordings() {
        let mut recording = Recording::open(&path).unwrap();
        let records: Vec<Record> = recording.by_ref().collect();
        assert_eq!(recording.losses(), &[] as &[String], "{}", path.display());
        assert!(recording.progress() >= 1.0);
        assert!(records.is_sorted_by_key(|record| record.stamp), "{}", path.display());
        let of = |name: &str| {
            let index = recording.topic(name, None).unwrap();
            (&recording.topics()[index], records.iter().filter(move |record| record.topic == index))
        };
        let (topic, odometry) = of("/odom");
        let mut number = 0;
        for record in odometry {
            let message: Odometry = topic.decode(&record.bytes).unwrap();
            assert_eq!(record.stamp.as_nanos(), BEGIN + number * STEP + 1000);
            assert_eq!(message.header.stamp, Time::from_nanos(BEGIN + number * STEP));
            assert_eq!(message.child_frame_id, "base_footprint");
            assert_eq!(message.pose.pose.position.x, 0.5 * number as f64);
            assert_eq!(message.twist.twist.angular.z, 0.125);
            number += 1;
        }
        assert_eq!(number, count, "{}", path.display());
        let (topic, people) = of("people");
        let mut number = 0;
        for record in people {
            let message: People = topic.decode(&record.bytes).unwrap();
            assert_eq!(record.stamp.as_nanos(), BEGIN + number * STEP);
            assert_eq!(message.people.len() as i64, number % 3);
            assert!(message.people.iter().all(|person| person.tags == ["ä", ""]));
            number += 2;
        }
        let (topic, mut transforms) = of("/tf_static");
        let message: TFMessage = topic.decode(&transforms.next().unwrap().bytes).unwrap();
        assert_eq!(message.transforms[0].transform.translation.y, 2.0);
        let (topic, mut odd) = of("/odd");
        assert!(topic.decode::<Bool>(&odd.next().unwrap().bytes).is_err());
    }
}

/// Two libraries encode the same messages, each from the definition by itself.
#[test]
fn messages_that_the_support_libraries_of_mcap_encoded_are_those_of_rosbags() {
    let bytes = |path: &Path| {
        let mut recording = Recording::open(path).unwrap();
        let mut all: Vec<_> =
            recording.by_ref().map(|record| (record.topic, record.stamp, record.bytes)).collect();
        let names: Vec<_> = recording.topics().iter().map(|topic| topic.name.clone()).collect();
        all.sort_by(|a, b| (a.1, &names[a.0]).cmp(&(b.1, &names[b.0])));
        all.into_iter().map(|(topic, stamp, bytes)| (names[topic].clone(), stamp, bytes)).collect::<Vec<_>>()
    };
    let (all, mut compared) = (recordings(), 0);
    for (path, _) in &all {
        for (support, rosbags) in
            [("ros1_support.mcap", "plain.bag"), ("ros2_support.mcap", "ros2_plain.mcap")]
        {
            if path.ends_with(support) {
                assert_eq!(bytes(path), bytes(&path.with_file_name(rosbags)), "{}", path.display());
                compared += 1;
            }
        }
    }
    assert!(compared >= 2 && compared % 2 == 0, "{compared}");
}

#[test]
fn only_selected_topics_are_given_out() {
    for (path, count) in recordings() {
        let mut recording = Recording::open(&path).unwrap();
        recording.select(|topic| topic.type_name == "nav_msgs/Odometry");
        assert_eq!(recording.count() as i64, count, "{}", path.display());
    }
}

#[test]
fn an_unknown_topic_is_an_error_that_tells_what_there_is() {
    for (path, _) in recordings() {
        let recording = Recording::open(&path).unwrap();
        let error = recording.topic("/pose", Some("nav_msgs/Odometry")).unwrap_err().to_string();
        assert!(
            error.ends_with("topics of type nav_msgs/Odometry in it: /odom (nav_msgs/Odometry)"),
            "{error}"
        );
        let error = recording.topic("/pose", Some("x/Y")).unwrap_err().to_string();
        assert!(error.contains("/people (people_msgs/People)"), "{error}");
    }
}

#[test]
fn a_broken_file_in_a_folder_costs_its_own_messages() {
    let folder = tempfile::tempdir().unwrap();
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    fs::copy(data.join("plain.bag"), folder.path().join("walk.bag")).unwrap();
    fs::write(folder.path().join("broken.mcap"), b"x").unwrap();
    let recording = Recording::open(folder.path()).unwrap();
    assert!(recording.losses()[0].contains("broken.mcap"), "{:?}", recording.losses());
    assert_eq!(recording.count(), 20);
}

#[test]
fn what_is_no_recording_is_an_error_that_names_the_file() {
    let folder = tempfile::tempdir().unwrap();
    assert!(Recording::open(folder.path()).err().unwrap().to_string().contains("no .bag, .mcap or .db3"));
    for (bytes, reason) in [(b"".as_slice(), "the file is empty"), (b"time,r_x\n", "this is not a recording")]
    {
        let path = folder.path().join("file.bag");
        fs::write(&path, bytes).unwrap();
        let error = Recording::open(&path).err().unwrap().to_string();
        assert!(error.contains("file.bag") && error.contains(reason), "{error}");
    }
    assert!(Recording::open(folder.path().join("absent")).is_err());
}

/// Records and losses of damaged bytes; `None` if they are not a recording.
fn read_damaged(folder: &Path, bytes: &[u8]) -> Option<(Vec<Record>, Vec<String>)> {
    let path = folder.join("damaged");
    fs::write(&path, bytes).unwrap();
    let mut recording = Recording::open(&path).ok()?;
    let records = recording.by_ref().collect();
    Some((records, recording.losses().to_vec()))
}

/// How often each message is there.
fn counted(records: Vec<Record>) -> HashMap<(i64, Vec<u8>), usize> {
    let mut counts = HashMap::new();
    for record in records {
        *counts.entry((record.stamp.as_nanos(), record.bytes)).or_default() += 1;
    }
    counts
}

/// At most as often as in the whole.
fn is_part(part: &HashMap<(i64, Vec<u8>), usize>, whole: &HashMap<(i64, Vec<u8>), usize>) -> bool {
    part.iter().all(|(message, count)| whole.get(message).is_some_and(|most| count <= most))
}

/// In memory if possible, because a file is written for each input.
fn quick_folder() -> tempfile::TempDir {
    let memory = Path::new("/dev/shm");
    tempfile::tempdir_in(if memory.is_dir() { memory.to_owned() } else { std::env::temp_dir() }).unwrap()
}

#[test]
fn a_file_cut_anywhere_gives_each_message_that_is_whole_once_and_says_what_is_lost() {
    let folder = quick_folder();
    for (file, bytes) in boundeds() {
        let whole = counted(read_damaged(folder.path(), &bytes).unwrap().0);
        let all: usize = whole.values().sum();
        let mut most = 0;
        for cut in 0..bytes.len() {
            let Some((records, losses)) = read_damaged(folder.path(), &bytes[..cut]) else { continue };
            assert!(records.len() == all || !losses.is_empty(), "{file} cut at {cut}");
            most = most.max(records.len());
            assert!(is_part(&counted(records), &whole), "{file} cut at {cut}");
        }
        // Zstandard unpacks blocks of 128 kB as a whole, and this file is one block.
        let enough = if file.ends_with("zstd") { 0 } else { all * 3 / 4 };
        assert!(most >= enough, "{file}: {most} of {all} messages");
    }
}

/// A database as rosbag2 makes it, written by SQLite: some messages are longer than a page.
fn long_database(path: &Path, count: i64) {
    let database = rusqlite::Connection::open(path).unwrap();
    let create = "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, \
                  serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL); \
                  CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, \
                  timestamp INTEGER NOT NULL, data BLOB NOT NULL); \
                  CREATE INDEX timestamp_idx ON messages (timestamp ASC); \
                  INSERT INTO topics VALUES (1, '/odom', 'nav_msgs/msg/Odometry', 'cdr', ''); \
                  INSERT INTO topics VALUES (2, '/image', 'sensor_msgs/msg/Image', 'cdr', ''); BEGIN;";
    database.execute_batch(create).unwrap();
    for number in 0..count {
        let (topic, length) = if number % 50 == 7 { (2, 20_000) } else { (1, 720) };
        let data: Vec<u8> = (0..length).map(|at| (at + number) as u8).collect();
        let values = (topic, BEGIN + number * STEP, data);
        database
            .execute("INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)", values)
            .unwrap();
    }
    database.execute_batch("COMMIT").unwrap();
}

#[test]
fn a_database_without_its_last_15_percent_gives_what_is_there() {
    let folder = quick_folder();
    let path = folder.path().join("long.db3");
    long_database(&path, 1500);
    let bytes = fs::read(&path).unwrap();
    let whole = counted(read_damaged(folder.path(), &bytes).unwrap().0);
    assert_eq!(whole.values().sum::<usize>(), 1500);
    for percent in [5, 15, 30, 60, 85, 95, 99] {
        let (records, losses) = read_damaged(folder.path(), &bytes[..bytes.len() * percent / 100]).unwrap();
        let least = 1500 * percent.saturating_sub(5) / 100;
        assert!(records.len() >= least, "{percent} %: {}", records.len());
        assert!(records.is_sorted_by_key(|record| record.stamp));
        assert!(losses.iter().any(|loss| loss.contains("bytes at its end are missing")), "{losses:?}");
        assert!(is_part(&counted(records), &whole), "{percent} %");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn a_database_with_lost_pages_gives_no_message_twice(cut in 0.0..1.0_f64, pages in vec(2_usize..200, 0..4)) {
        static DATABASE: OnceLock<Vec<u8>> = OnceLock::new();
        let folder = quick_folder();
        let bytes = DATABASE.get_or_init(|| {
            let path = folder.path().join("long.db3");
            long_database(&path, 600);
            fs::read(&path).unwrap()
        });
        let whole = counted(read_damaged(folder.path(), bytes).unwrap().0);
        let mut damaged = bytes[..(bytes.len() as f64 * cut) as usize].to_vec();
        for page in pages {
            damaged.iter_mut().skip(page * 4096).take(4096).for_each(|byte| *byte = 0);
        }
        if let Some((records, _)) = read_damaged(folder.path(), &damaged) {
            let stamps = |(stamp, _): &(i64, Vec<u8>)| *stamp;
            let found = counted(records);
            prop_assert!(found.values().all(|count| *count == 1));
            let mut times: Vec<i64> = found.keys().map(stamps).collect();
            times.sort_unstable();
            times.dedup();
            prop_assert_eq!(times.len(), found.len(), "a time of the recording has one message");
            prop_assert!(found.keys().all(|message| whole.keys().any(|other| stamps(other) == stamps(message))));
        }
    }
}

#[test]
fn a_compressed_file_beside_what_was_unpacked_of_it_is_not_read_twice() {
    let folder = tempfile::tempdir().unwrap();
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    fs::copy(data.join("ros2_db3_by_file/ros2_db3_by_file.db3.zstd"), folder.path().join("x.db3.zstd"))
        .unwrap();
    let packed = counted(Recording::open(folder.path()).unwrap().collect());
    fs::copy(data.join("ros2_db3/ros2_db3.db3"), folder.path().join("x.db3")).unwrap();
    assert_eq!(counted(Recording::open(folder.path()).unwrap().collect()), packed);
}

#[test]
fn a_loss_in_a_compressed_file_names_the_users_file() {
    let folder = tempfile::tempdir().unwrap();
    let plain = fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/ros2_plain.mcap")).unwrap();
    // In small blocks: what is cut is lost by whole blocks.
    let mut encoder = zstd::stream::Encoder::new(Vec::new(), 1).unwrap();
    for piece in plain.chunks(500) {
        encoder.write_all(piece).unwrap();
        encoder.flush().unwrap();
    }
    let bytes = encoder.finish().unwrap();
    let (records, losses) = read_damaged(folder.path(), &bytes[..bytes.len() / 2]).unwrap();
    assert!(!records.is_empty() && losses.len() >= 2, "{losses:?}");
    assert!(
        losses.iter().all(|loss| loss.starts_with(&format!("{}", folder.path().display()))),
        "{losses:?}"
    );
    let error = {
        let path = folder.path().join("table.csv.zst");
        fs::write(&path, zstd::encode_all(&b"a,b\n1,2\n"[..], 1).unwrap()).unwrap();
        Recording::open(path).err().unwrap().to_string()
    };
    assert!(error.contains("table.csv.zst: this is not a recording"), "{error}");
}

#[test]
fn a_changed_byte_never_panics_and_costs_little() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = 1u64;
    for (file, bytes) in boundeds() {
        let whole = read_damaged(folder.path(), &bytes).unwrap().0.len();
        let (mut opened, mut kept) = (0, 0);
        for _ in 0..300 {
            let mut damaged = bytes.clone();
            let place = splitmix64(&mut random) as usize % bytes.len();
            damaged[place] ^= 1 << (splitmix64(&mut random) & 7);
            if let Some((records, _)) = read_damaged(folder.path(), &damaged) {
                (opened, kept) = (opened + 1, kept + records.len());
            }
        }
        assert!(kept * 10 >= opened * whole * 5, "{file}: {kept} of {opened} x {whole} messages kept");
    }
}

#[test]
fn a_damaged_chunk_costs_its_own_messages_only() {
    let folder = tempfile::tempdir().unwrap();
    for (file, mut bytes) in boundeds() {
        // Without compression a bag has no checksums.
        if ["lz4.bag", "bz2.bag", "ros1_zstd.mcap"].contains(&file) {
            let whole = read_damaged(folder.path(), &bytes).unwrap().0.len();
            // Inside the data of the first chunk.
            let place = if file.ends_with(".bag") { 4096 + 100 } else { 200 };
            bytes[place..place + 8].fill(0xff);
            let (records, losses) = read_damaged(folder.path(), &bytes).unwrap();
            assert!(records.len() < whole && records.len() >= 4, "{file}: {} of {whole}", records.len());
            assert!(losses.iter().any(|loss| loss.contains("chunk at byte")), "{file}: {losses:?}");
        }
    }
}
