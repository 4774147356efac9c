//! Recordings whose clocks, names and goals are not what they should be: the rows are those of the sound recording, or one sentence
//! says what to do.

#![allow(clippy::expect_used, clippy::panic, reason = "a test may panic: that is how it fails")]

mod common;

use std::{fs, path::Path};

use common::{csv_files, roscausal};
use roscausal_core::Time;
use roscausal_msgs::{
    geometry_msgs::{PoseWithCovarianceStamped, TransformStamped},
    nav_msgs::Odometry,
    people_msgs::{People, Person},
    std_msgs::{Header, String as Text},
    tf2_msgs::TFMessage,
};
use roscausal_recording::McapWriter;

const ANALYSIS: [&str; 7] = ["--person", "7", "--method", "pcmci", "--test", "parcorr", "--threads=1"];

/// How a recording differs from a sound one. Times are seconds after its beginning.
struct Walk<'a> {
    odom: &'a str,
    people: &'a str,
    /// When the recorder got the message of number `n`.
    recorded: &'a dyn Fn(u32) -> f64,
    robot_stamp: &'a dyn Fn(u32) -> f64,
    people_stamp: &'a dyn Fn(u32) -> f64,
    messages: u32,
    /// Which way the person walks, for message number `n`.
    phase: fn(u32) -> f64,
    /// How many messages later the recorder got the people.
    late: u32,
    /// The people are in the frame `odom`, of which every so many messages say where it is in `map`; 0: they are in `map`.
    transforms: u32,
    /// Units of a person's coordinates in a metre.
    units: f64,
}

/// 30 s at 25 Hz.
const SOUND: Walk<'_> = Walk {
    odom: "/odom",
    people: "/people",
    recorded: &step,
    robot_stamp: &step,
    people_stamp: &step,
    messages: 750,
    phase: |_| 0.0,
    late: 0,
    transforms: 0,
    units: 1.0,
};

fn step(number: u32) -> f64 {
    0.04 * f64::from(number)
}

/// Where `odom` is in `map`, metres.
fn drift(seconds: f64) -> f64 {
    0.05 * seconds
}

impl Walk<'_> {
    fn write(&self, path: &Path) {
        let at = |seconds: f64| Time::from_nanos(1_700_000_000_000_000_000 + (seconds * 1e9).round() as i64);
        let mut writer = McapWriter::create(path).expect("creates");
        let header = |stamp: f64, frame: &str| Header { stamp: at(stamp), frame_id: frame.into() };
        for number in 0..self.messages + self.late {
            let recorded = (self.recorded)(number);
            if number < self.messages {
                let stamp = (self.robot_stamp)(number);
                let (x, y) = (2.0 * (0.2 * recorded).cos(), 2.0 * (0.2 * recorded).sin());
                let mut odometry = Odometry { header: header(stamp, "odom"), ..Odometry::default() };
                odometry.twist.twist.linear.x = 0.4 + 0.1 * (1.7 * recorded).sin();
                let mut pose =
                    PoseWithCovarianceStamped { header: header(stamp, "map"), ..Default::default() };
                (pose.pose.pose.position.x, pose.pose.pose.position.y) = (x, y);
                pose.pose.pose.orientation.w = 1.0;
                writer.write(self.odom, at(recorded), &odometry).expect("writes");
                writer.write("/amcl_pose", at(recorded), &pose).expect("writes");
            }
            if self.transforms > 0 && number % self.transforms == 0 {
                let mut place =
                    TransformStamped { header: header(recorded, "map"), ..TransformStamped::default() };
                place.child_frame_id = "odom".into();
                place.transform.translation.x = drift(recorded);
                place.transform.rotation.w = 1.0;
                let message = TFMessage { transforms: vec![place] };
                writer.write("/tf", at(recorded), &message).expect("writes");
            }
            let Some(seen) = number.checked_sub(self.late) else { continue };
            let (when, phase) = ((self.recorded)(seen), (self.phase)(seen));
            let mut person = Person { name: "7".into(), reliability: 1.0, ..Person::default() };
            (person.position.x, person.position.y) = (3.0 - 0.1 * when, (0.9 * when + phase).sin());
            (person.velocity.x, person.velocity.y) = (-0.1, 0.9 * (0.9 * when + phase).cos());
            person.position.x *= self.units;
            person.position.y *= self.units;
            let frame = if self.transforms > 0 { "odom" } else { "map" };
            if self.transforms > 0 {
                person.position.x -= drift(when);
            }
            let people = People { header: header((self.people_stamp)(seen), frame), people: vec![person] };
            writer.write(self.people, at(recorded), &people).expect("writes");
        }
        writer.finish().expect("closes");
    }
}

/// What `discover` prints of a recording, whether it succeeds, and the batches that it makes.
fn discover(dir: &Path, args: &[&str]) -> (String, bool, Vec<(String, String)>) {
    let out = dir.join("out");
    let _ = fs::remove_dir_all(&out);
    let output = roscausal(dir, &[&["discover"], args, &["--out", "out"], &ANALYSIS].concat());
    let text = format!(
        "{}{}",
        String::from_utf8_lossy(&output.stdout).replace("\n  ", " "),
        String::from_utf8_lossy(&output.stderr)
    );
    let batches = if output.status.success() { csv_files(&out.join("batches")) } else { Vec::new() };
    (text, output.status.success(), batches)
}

/// The rows of the sound recording.
fn sound(dir: &Path) -> Vec<(String, String)> {
    SOUND.write(&dir.join("sound.mcap"));
    let (text, success, batches) = discover(dir, &["sound.mcap"]);
    assert!(success && batches.len() == 1, "{text}");
    batches
}

/// Rows of the first batch, without its times.
fn rows(batches: &[(String, String)]) -> Vec<String> {
    let row = |line: &str| line.split_once(',').map_or("", |(_, rest)| rest).to_owned();
    batches[0].1.lines().map(row).collect()
}

#[test]
fn a_few_mistaken_stamps_are_left_out_and_counted_however_far_they_are() {
    let dir = tempfile::tempdir().expect("a folder");
    let whole = rows(&sound(dir.path())).len();
    for far in [30.0, 3e8, -30.0] {
        let glitch = |number: u32| step(number) + if (300..306).contains(&number) { far } else { 0.0 };
        Walk { people_stamp: &glitch, ..SOUND }.write(&dir.path().join("glitch.mcap"));
        let (text, success, batches) = discover(dir.path(), &["glitch.mcap"]);
        let note = "6 of 750 messages of /people are stamped more than 1 s";
        assert!(success && text.contains(note), "{text}");
        let model = fs::read_to_string(dir.path().join("out/model.json")).expect("a model");
        assert!(model.contains(note), "{model}");
        assert!(batches.len() == 1 && rows(&batches).len() == whole, "{far}: {text}");
    }
}

#[test]
fn a_mistaken_time_of_recording_is_no_silence() {
    let dir = tempfile::tempdir().expect("a folder");
    for far in [2e6, -2e6] {
        let once = |number: u32| step(number) + if number == 300 { far } else { 0.0 };
        Walk { recorded: &once, ..SOUND }.write(&dir.path().join("once.mcap"));
        let (text, success, batches) = discover(dir.path(), &["once.mcap"]);
        assert!(success && batches.len() == 1 && !text.contains("most seconds without"), "{text}");
    }
}

#[test]
fn a_clock_that_is_mostly_wrong_is_named_and_costs_no_time() {
    let dir = tempfile::tempdir().expect("a folder");
    let often = |number: u32| step(number) + if number % 5 == 2 { 3e8 } else { 0.0 };
    Walk { people_stamp: &often, ..SOUND }.write(&dir.path().join("often.mcap"));
    let begin = std::time::Instant::now();
    let (text, success, _) = discover(dir.path(), &["often.mcap"]);
    assert!(!success && text.contains("150 of 750 messages of /people are stamped far"), "{text}");
    assert!(text.contains("--clock /people=recording uses the time"), "{text}");
    assert!(begin.elapsed().as_secs() < 30, "{text}");
    let (text, success, batches) = discover(dir.path(), &["often.mcap", "--clock", "/people=recording"]);
    assert!(success && batches == sound(dir.path()), "{text}");
}

#[test]
fn two_clocks_are_one_sentence_with_the_flag_that_mends_it() {
    let dir = tempfile::tempdir().expect("a folder");
    let expected = sound(dir.path());
    let other = |number: u32| step(number) - 1_699_999_000.0;
    Walk { people_stamp: &other, ..SOUND }.write(&dir.path().join("epoch.mcap"));
    let (text, success, _) = discover(dir.path(), &["epoch.mcap"]);
    assert!(!success && text.contains("clocks of /people and /amcl_pose differ by 1.700e9 s"), "{text}");
    assert!(text.contains("--clock /people=recording"), "{text}");
    for clock in ["recording", "/people=recording", "recording,/odom=header,/amcl_pose=header"] {
        let (text, _, batches) = discover(dir.path(), &["epoch.mcap", "--clock", clock]);
        assert_eq!(batches, expected, "{clock}: {text}");
    }
    for wrong in ["wall", "/nobody=recording"] {
        let (text, success, _) = discover(dir.path(), &["epoch.mcap", "--clock", wrong]);
        assert!(!success && text.contains("clock"), "{text}");
    }
}

#[test]
fn a_simulation_that_is_reset_is_two_recordings() {
    let dir = tempfile::tempdir().expect("a folder");
    let expected = sound(dir.path());
    let again = |number: u32| step(number % 750);
    let twice = Walk { recorded: &again, robot_stamp: &again, people_stamp: &again, messages: 1500, ..SOUND };
    // The same messages twice, as where a recording was played in a loop.
    twice.write(&dir.path().join("loop.mcap"));
    let (text, _, batches) = discover(dir.path(), &["loop.mcap"]);
    assert!(text.contains("run 2 holds the rows of an earlier one"), "{text}");
    assert_eq!(batches, expected, "{text}");
    Walk { phase: |number| f64::from(number / 750), ..twice }.write(&dir.path().join("loop.mcap"));
    let (text, success, batches) = discover(dir.path(), &["loop.mcap"]);
    assert!(success && text.contains("2 runs; each is a recording of its own"), "{text}");
    assert!(text.contains("knows the robot in 100 % of the time"), "{text}");
    assert_eq!(batches.len(), 2, "{text}");
    assert!(batches[0].1 == expected[0].1 && batches[1].1.lines().count() == expected[0].1.lines().count());
    let topics = roscausal(dir.path(), &["topics", "loop.mcap"]);
    let text = String::from_utf8_lossy(&topics.stdout).into_owned();
    assert!(text.lines().any(|line| line.starts_with("/odom") && line.contains(" 25.00 ")), "{text}");
}

#[test]
fn topics_prints_how_far_stamps_are_from_the_time_of_recording() {
    let dir = tempfile::tempdir().expect("a folder");
    let late = |number: u32| step(number) - 1.25 - if number == 99 { 50.0 } else { 0.0 };
    Walk { people_stamp: &late, ..SOUND }.write(&dir.path().join("late.mcap"));
    let output = roscausal(dir.path(), &["topics", "late.mcap"]);
    let text = String::from_utf8_lossy(&output.stdout).replace("\n  ", " ");
    let columns = |topic: &str| {
        let line = text.lines().find(|line| line.starts_with(topic)).unwrap_or_else(|| panic!("{text}"));
        line.split_whitespace().rev().take(3).map(str::to_owned).collect::<Vec<_>>()
    };
    assert_eq!(columns("/people"), ["1", "0.000", "-1.250"]);
    assert_eq!(columns("/odom"), ["0", "0.000", "0.000"]);
}

#[test]
fn names_that_ros_does_not_allow_and_names_of_two_types_are_read() {
    let dir = tempfile::tempdir().expect("a folder");
    let expected = sound(dir.path());
    for (odom, people) in [("/robot-1/odom", "/people-tracker/3d"), ("odom", "people")] {
        Walk { odom, people, ..SOUND }.write(&dir.path().join("named.mcap"));
        let (text, _, batches) = discover(dir.path(), &["named.mcap", "--people", people]);
        assert_eq!(batches, expected, "{text}");
        let signal = format!("v = /{}.twist.twist.linear.x", odom.trim_start_matches('/'));
        let (text, success, batches) = discover(dir.path(), &["named.mcap", "--signal", &signal]);
        assert!(success && batches[0].1.lines().next().is_some_and(|names| names.ends_with(",v")), "{text}");
    }
    let mut writer = McapWriter::create(dir.path().join("another.mcap")).expect("creates");
    let text = Text { data: "starts".into() };
    for topic in ["/people", "/odom"] {
        writer.write(topic, Time::from_secs_f64(1_700_000_000.5), &text).expect("writes");
    }
    writer.finish().expect("closes");
    let folder = dir.path().join("folder");
    fs::create_dir(&folder).expect("makes");
    for file in ["sound.mcap", "another.mcap"] {
        fs::copy(dir.path().join(file), folder.join(file)).expect("copies");
    }
    let (text, _, batches) = discover(dir.path(), &["folder"]);
    assert_eq!(batches, expected, "{text}");
}

#[test]
fn without_a_goal_the_distance_to_it_is_left_out_unless_it_is_named() {
    let dir = tempfile::tempdir().expect("a folder");
    sound(dir.path());
    let note = "left out, since the recording has no goal of the person (--human-goal names its topic): h_dg";
    for args in [&[][..], &["--person=nearest:1"], &["--person=all", "--several-people=joint"]] {
        let args = [&["discover", "sound.mcap", "--method", "pcmci", "--test", "parcorr"], args].concat();
        let output = roscausal(dir.path(), &args);
        let text = format!(
            "{}{}",
            String::from_utf8_lossy(&output.stdout).replace("\n  ", " "),
            String::from_utf8_lossy(&output.stderr)
        );
        assert!(
            output.status.success() && text.matches("h_dg").count() == 1 && text.contains(note),
            "{text}"
        );
    }
    let (text, success, _) = discover(dir.path(), &["sound.mcap", "--columns", "h_v,h_dg"]);
    assert!(!success && text.contains("h_dg has no value at all"), "{text}");
    let (text, success, batches) = discover(dir.path(), &["sound.mcap", "--param", "data.postprocess=none"]);
    assert!(success && batches[0].1.lines().next().is_some_and(|names| names.contains("r_theta")), "{text}");
}

/// How many rows of `found` are in `expected` within 1e-6, in each cell.
fn in_common(found: &[String], expected: &[String]) -> usize {
    let cells =
        |row: &String| -> Vec<f64> { row.split(',').map(|cell| cell.parse().unwrap_or(f64::NAN)).collect() };
    let same = |a: &[f64], b: &[f64]| {
        a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6 || (a.is_nan() && b.is_nan()))
    };
    let expected: Vec<Vec<f64>> = expected.iter().map(cells).collect();
    found.iter().map(cells).filter(|row| expected.iter().any(|other| same(row, other))).count()
}

/// Checks that a recording gives the expected rows; up to `fewer` may be missing at its ends.
fn check_rows(walk: &Walk<'_>, expected: &[String], fewer: usize) {
    let dir = tempfile::tempdir().expect("a folder");
    walk.write(&dir.path().join("walk.mcap"));
    let (text, success, batches) = discover(dir.path(), &["walk.mcap"]);
    let what = format!("{} late, transforms {}", walk.late, walk.transforms);
    assert!(success, "{what}: {text}");
    let found = rows(&batches);
    assert!(found.len() + fewer >= expected.len(), "{what}: {} rows", found.len());
    assert!(in_common(&found, expected) + 3 >= found.len(), "{what}: {:?} {:?}", &found[..3], &expected[..3]);
}

#[test]
fn what_comes_late_is_read_as_if_it_came_in_time() {
    let dir = tempfile::tempdir().expect("a folder");
    let expected = rows(&sound(dir.path()));
    for late in [5, 30, 75] {
        // The rows may begin a little later.
        check_rows(&Walk { late, ..SOUND }, &expected, late as usize / 2 + 2);
    }
}

/// The columns of the first batch, by name.
fn column(batches: &[(String, String)], name: &str) -> Vec<f64> {
    let mut lines = batches[0].1.lines();
    let place =
        lines.next().and_then(|names| names.split(',').position(|known| known == name)).expect("a column");
    lines
        .map(|line| line.split(',').nth(place).and_then(|cell| cell.parse().ok()).unwrap_or(f64::NAN))
        .collect()
}

#[test]
fn of_equal_stamps_the_first_counts_also_where_only_the_second_is_late() {
    let dir = tempfile::tempdir().expect("a folder");
    let pairs = |number: u32| step(number - number % 2);
    let walk = Walk { people_stamp: &pairs, ..SOUND };
    walk.write(&dir.path().join("pairs.mcap"));
    let (text, success, batches) = discover(dir.path(), &["pairs.mcap"]);
    assert!(success, "{text}");
    check_rows(&Walk { late: 1, ..walk }, &rows(&batches), 3);
}

#[test]
fn of_equal_stamps_the_first_counts_for_robot_and_person_alike() {
    let dir = tempfile::tempdir().expect("a folder");
    let coarse = |number: u32| (10.0 * step(number) + 1e-6).floor() / 10.0;
    Walk { robot_stamp: &coarse, people_stamp: &coarse, ..SOUND }.write(&dir.path().join("coarse.mcap"));
    let (text, success, batches) = discover(dir.path(), &["coarse.mcap", "--param", "data.postprocess=none"]);
    assert!(success, "{text}");
    let [time, robot, person] = ["time", "r_v", "h_7_v"].map(|name| column(&batches, name));
    assert!(time.len() > 280, "{text}");
    for (row, t) in time.iter().enumerate() {
        let stamp = ((t - 1_700_000_000.0) * 10.0).round() / 10.0;
        let first = (0..750).map(step).find(|t| *t > stamp - 1e-6).expect("a message");
        let walking = 0.9 * (0.9 * first).cos();
        assert!((robot[row] - 0.4 - 0.1 * (1.7 * first).sin()).abs() < 1e-6, "r_v at {stamp}");
        assert!((person[row] - walking.hypot(0.1)).abs() < 1e-6, "h_7_v at {stamp}");
    }
}

#[test]
fn every_sighting_counts_however_unevenly_they_come() {
    let dir = tempfile::tempdir().expect("a folder");
    let uneven =
        |number: u32| step(number) + 0.015 * (7919.0 * f64::from(number)).sin() * f64::from(number.min(1));
    Walk { recorded: &uneven, robot_stamp: &uneven, people_stamp: &uneven, ..SOUND }
        .write(&dir.path().join("uneven.mcap"));
    for sampling in ["linear", "hold"] {
        let rule = format!("data.sampling={sampling}");
        let (text, success, batches) =
            discover(dir.path(), &["uneven.mcap", "--param", "data.postprocess=none", "--param", &rule]);
        assert!(success, "{text}");
        let [time, speed, x] = ["time", "h_7_v", "h_7_x"].map(|name| column(&batches, name));
        assert!(time.len() > 280, "{text}");
        for (row, t) in time.iter().enumerate() {
            let t = t - 1_700_000_000.0;
            let seen: Vec<f64> = (0..750).map(uneven).collect();
            let after = seen.partition_point(|seen| *seen <= t + 1e-9);
            // What was seen last, or what lies between that and what was seen next.
            let share = match sampling {
                "hold" => 0.0,
                _ => (t - seen[after - 1]) / (seen[after.min(749)] - seen[after - 1]),
            };
            let between = |of: &dyn Fn(f64) -> f64| {
                (1.0 - share) * of(seen[after - 1]) + share * of(seen[after.min(749)])
            };
            let expected = between(&|t| (0.9 * (0.9 * t).cos()).hypot(0.1));
            assert!((speed[row] - expected).abs() < 1e-6, "{sampling} at {t}: {} for {expected}", speed[row]);
            assert!((x[row] - between(&|t| 3.0 - 0.1 * t)).abs() < 1e-6, "{sampling} at {t}");
        }
    }
}

#[test]
fn transforms_that_come_seldom_are_interpolated() {
    let dir = tempfile::tempdir().expect("a folder");
    let expected = rows(&sound(dir.path()));
    for transforms in [1, 25, 50] {
        check_rows(&Walk { transforms, ..SOUND }, &expected, 25);
    }
}

#[test]
fn a_delay_that_is_always_the_same_is_named_with_its_flag_and_one_that_changes_is_not() {
    let dir = tempfile::tempdir().expect("a folder");
    let behind = |number: u32| step(number) - 2.5;
    Walk { people_stamp: &behind, ..SOUND }.write(&dir.path().join("behind.mcap"));
    let (text, success, _) = discover(dir.path(), &["behind.mcap"]);
    assert!(
        success && text.contains("the stamps of /people are 2.50 s behind the time of recording"),
        "{text}"
    );
    assert!(text.contains("--clock /people=recording"), "{text}");
    let changing = |number: u32| step(number) - 1.2 - 0.4 * f64::from(number % 2);
    Walk { people_stamp: &changing, ..SOUND }.write(&dir.path().join("changing.mcap"));
    let (text, success, _) = discover(dir.path(), &["changing.mcap"]);
    assert!(success && !text.contains("behind the time of recording"), "{text}");
}

#[test]
fn what_is_left_out_is_counted_at_the_end_and_no_advice_is_for_a_robot_that_runs() {
    let dir = tempfile::tempdir().expect("a folder");
    // The robot's messages come in pairs, the later one first.
    Walk { robot_stamp: &|number| step(number ^ 1), ..SOUND }.write(&dir.path().join("pairs.mcap"));
    let (text, success, batches) = discover(dir.path(), &["pairs.mcap"]);
    // The stamps tell where each belongs; who plays as live has to leave out what came too late.
    assert!(success && batches.len() == 1 && !text.contains("out of order"), "{text}");
    assert!(text.contains("it knows the robot in 100 % of the time"), "{text}");
    let replay = |file: &str, length: &[&str]| {
        let quick = ["replay", file, "--person", "7", "--method", "pcmci", "--test", "parcorr"];
        String::from_utf8_lossy(&roscausal(dir.path(), &[&quick, length].concat()).stderr).into_owned()
    };
    let text = replay("pairs.mcap", &["--ts-length", "0"]);
    assert!(text.contains("robot node: out of order: "), "{text}");
    Walk { late: 200, people_stamp: &|number| step(number + 200), ..SOUND }
        .write(&dir.path().join("stops.mcap"));
    let text = replay("stops.mcap", &[]);
    assert!(text.contains("robot node: most seconds without /odom: "), "{text}");
    assert!(text.contains("its batches are shorter than --ts-length; 0 makes one of the whole"), "{text}");
    assert!(!text.contains("WARN") && !text.contains("analyse_incomplete"), "{text}");
}

#[test]
fn a_replay_says_where_both_were_once_and_that_nobody_was_recorded() {
    let dir = tempfile::tempdir().expect("a folder");
    let replay = |walk: Walk<'_>, flags: &[&str]| {
        walk.write(&dir.path().join("apart.mcap"));
        let quick = ["replay", "apart.mcap", "--ts-length", "0", "--method", "pcmci", "--test", "parcorr"];
        let output = roscausal(dir.path(), &[&quick, flags].concat());
        (String::from_utf8_lossy(&output.stderr).into_owned(), output.status.success())
    };
    let (text, _) = replay(Walk { units: 1000.0, ..SOUND }, &["--person", "7"]);
    assert_eq!(text.matches("people seem to be in millimetres").count(), 1, "{text}");
    let (text, success) = replay(SOUND, &["--person", "99", "--param", "data.postprocess=none"]);
    assert!(!success && text.contains("nobody of sel_agent has been seen"), "{text}");
}

#[test]
fn who_was_missing_or_where_both_were_is_told() {
    let dir = tempfile::tempdir().expect("a folder");
    for (walk, says) in [
        (Walk { units: 1000.0, ..SOUND }, "people seem to be in millimetres, centimetres or another frame"),
        (Walk { units: 100.0, ..SOUND }, "people seem to be in millimetres, centimetres or another frame"),
        (Walk { late: 750, people_stamp: &|number| step(number + 750), ..SOUND }, "the robot is there"),
    ] {
        walk.write(&dir.path().join("apart.mcap"));
        let (text, ..) = discover(dir.path(), &["apart.mcap"]);
        assert!(text.contains(says), "{says}: {text}");
    }
}
