//! Recordings through the command: a recording gives the same batches as the live run.

#![allow(clippy::expect_used, clippy::panic, reason = "a test may panic: that is how it fails")]

mod common;

use std::{fs, path::Path, process::Output, sync::OnceLock};

use common::{csv_files, roscausal};
use roscausal_core::Time;
use roscausal_msgs::{
    HumanState, Humans, RobotState,
    geometry_msgs::{Pose, Pose2D, PoseArray, PoseStamped, PoseWithCovarianceStamped, TransformStamped},
    nav_msgs::{Odometry, Path as Plan},
    std_msgs::Header,
    tf2_msgs::TFMessage,
};
use roscausal_recording::{McapWriter, Record, Recording};

fn stated(output: &Output) -> String {
    // A note goes on in indented lines.
    let notes = String::from_utf8_lossy(&output.stdout).replace("\n  ", " ");
    format!("{notes}{}", String::from_utf8_lossy(&output.stderr))
}

/// Small and quick, for tests that are not about the analysis.
const QUICK: [&str; 4] = ["--method", "pcmci", "--test", "parcorr"];

/// A folder with a live run of 60 s (`live/`), in which the robot stands still for six, and its recording (`run.mcap`).
fn recorded() -> &'static Path {
    static FOLDER: OnceLock<tempfile::TempDir> = OnceLock::new();
    let make = || {
        let dir = tempfile::tempdir().expect("a folder");
        let args = ["demo", "--seed", "3", "--duration", "60", "--out", "live", "--record", "run.mcap"];
        let intervention = ["--do", "robot.off@12..18"];
        let output = roscausal(dir.path(), &[&args[..], &intervention, &QUICK].concat());
        assert!(
            output.status.success() && stated(&output).contains("messages recorded"),
            "{}",
            stated(&output)
        );
        dir
    };
    FOLDER.get_or_init(make).path()
}

#[test]
fn a_replayed_run_gives_the_batches_of_the_live_run() {
    let dir = recorded();
    let args = ["replay", "run.mcap", "--out", "again", "--ts-length", "30", "--dt", "0.3"];
    let demo = ["--param", "data.risk_lag=1", "--param", "data.risk_noise=0.02", "--param", "data.seed=3"];
    let record = ["--record", "again.mcap"];
    let output = roscausal(dir, &[&args[..], &demo, &record, &QUICK].concat());
    assert!(output.status.success(), "{}", stated(&output));
    let live = csv_files(&dir.join("live/data_pool"));
    assert!(live.len() >= 2);
    assert_eq!(live[..2], csv_files(&dir.join("again/data_pool"))[..2]);
    let live = csv_files(&dir.join("live/pp_pool/analysed"));
    assert_eq!(live, csv_files(&dir.join("again/pp_pool/analysed")));
    assert!(stated(&output).contains("2 models"), "{}", stated(&output));
    // The recording made by the replay contains the models too.
    let recording = roscausal_recording::Recording::open(dir.join("again.mcap")).expect("opens");
    for (name, least) in [("/roscausal/causal_model", 1), ("/roscausal/dag", 1), ("/roscausal/robot", 1000)] {
        let topic = recording.topic(name, None).expect("is there");
        assert!(recording.topics()[topic].messages >= Some(least), "{name}");
    }
}

#[test]
fn a_replay_and_a_demo_draw_no_link_to_a_variable_that_is_exogenous() {
    let dir = recorded();
    let replay = ["replay", "run.mcap", "--out", "fixed", "--ts-length", "30"];
    let demo = ["demo", "--seed", "3", "--duration", "60", "--out", "simulated"];
    for (args, folder) in [(&replay[..], "fixed/cm_pool"), (&demo, "simulated/cm_pool")] {
        let output = roscausal(dir, &[args, &["--exogenous", "h_dg"], &QUICK].concat());
        assert!(output.status.success(), "{}", stated(&output));
        let files = fs::read_dir(dir.join(folder)).expect("lists").flatten().map(|entry| entry.path());
        let models = files.filter(|path| path.extension().is_some_and(|end| end == "json"));
        let read = |path: std::path::PathBuf| -> serde_json::Value {
            serde_json::from_slice(&fs::read(path).expect("reads")).expect("JSON")
        };
        let models: Vec<serde_json::Value> = models.map(read).collect();
        assert!(!models.is_empty(), "{folder}");
        for link in models.iter().flat_map(|model| model["links"].as_array().expect("links")) {
            assert_ne!(link["effect"], "h_dg", "{folder}");
        }
    }
    let html = fs::read_to_string(dir.join("simulated/report.html")).expect("a report");
    assert!(html.contains("--exogenous"), "the command that makes the run again says it");
}

#[test]
fn a_recording_is_analysed_as_one_batch_with_the_topics_found_in_it() {
    let dir = recorded();
    let output = roscausal(
        dir,
        &[&["discover", "run.mcap", "--ts-length", "0", "--out", "found"][..], &QUICK].concat(),
    );
    assert!(output.status.success(), "{}", stated(&output));
    for line in [
        "robot odometry: /mobile_base_controller/odom (nav_msgs/Odometry)",
        "people: /ped/control/teleop_persons",
    ] {
        assert!(stated(&output).contains(line), "{}", stated(&output));
    }
    assert_eq!(csv_files(&dir.join("found/batches")).len(), 1);
    let named = ["--robot-odom", "/mobile_base_controller/odom", "--people", "/ped/control/teleop_persons"];
    let args = ["discover", "run.mcap", "--ts-length=0", "--dt", "0.3", "--format", "json"];
    let again = roscausal(dir, &[&args[..], &named, &QUICK].concat());
    let model: serde_json::Value = serde_json::from_slice(&again.stdout).expect("JSON");
    assert!(model["n_samples"].as_u64().is_some_and(|n| n > 150), "{model}");
}

#[test]
fn a_wrong_or_missing_topic_tells_what_there_is() {
    let dir = recorded();
    let output = roscausal(dir, &["discover", "run.mcap", "--robot-odom", "/odometry"]);
    assert_eq!(output.status.code(), Some(1));
    let text = stated(&output);
    assert!(
        text.contains("no topic /odometry") && text.contains("/mobile_base_controller/odom (nav"),
        "{text}"
    );
    let output = roscausal(dir, &["discover", "run.mcap", "--param", "data.safe_dits=4"]);
    assert!(stated(&output).contains("did you mean 'safe_dist'?"), "{}", stated(&output));
    fs::write(dir.join("table.csv"), "a,b\n1,2\n").expect("writes");
    let output = roscausal(dir, &["discover", "table.csv", "--people", "/people"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stated(&output).contains("it is for recordings"), "{}", stated(&output));
}

#[test]
fn a_recording_cut_short_is_used_as_far_as_it_goes() {
    let dir = recorded();
    let whole = fs::read(dir.join("run.mcap")).expect("reads");
    fs::write(dir.join("cut.mcap"), &whole[..whole.len() * 2 / 3]).expect("writes");
    let output = roscausal(dir, &[&["discover", "cut.mcap", "--dt", "0.3"][..], &QUICK].concat());
    assert!(output.status.success(), "{}", stated(&output));
    assert!(
        stated(&output).contains("note: cut.mcap: the file is damaged or was not closed"),
        "{}",
        stated(&output)
    );
}

fn model(dir: &Path, args: &[&str]) -> (serde_json::Value, String) {
    let output = roscausal(dir, args);
    assert!(output.status.success(), "{}", stated(&output));
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    (serde_json::from_slice(&output.stdout).expect("JSON"), text)
}

#[test]
fn the_interventions_of_a_recording_are_columns_as_in_the_live_run() {
    let dir = recorded();
    let (model, reported) = model(dir, &["discover", "run.mcap", "--format", "json"]);
    let features = model["features"].as_array().expect("names");
    assert!(features.contains(&"do_robot_off".into()), "{features:?}");
    assert!(reported.contains("interventions: /hri/interventions"), "{reported}");
}

#[test]
fn a_recorded_demo_gives_the_demos_model_without_a_flag() {
    let dir = recorded();
    let demo: serde_json::Value =
        serde_json::from_slice(&fs::read(dir.join("live/model.json")).expect("reads")).expect("JSON");
    let (again, reported) = model(dir, &["discover", "run.mcap", "--format", "json"]);
    for field in ["method", "cond_ind_test", "n_recordings", "dt", "links", "val_matrix", "p_matrix", "graph"]
    {
        assert_eq!(again[field], demo[field], "{field}");
    }
    for words in ["--method=pcmci", "--test=parcorr", "data.dt=0.3", "data.risk_lag=1", "data.ts_length=30"] {
        assert!(reported.contains(words), "{words}: {reported}");
    }
    // Replayed, it gives the demo's batches, and a model of each.
    let output = roscausal(dir, &["replay", "run.mcap", "--out", "unasked"]);
    assert!(stated(&output).contains("2 models"), "{}", stated(&output));
    assert_eq!(
        csv_files(&dir.join("live/pp_pool/analysed")),
        csv_files(&dir.join("unasked/pp_pool/analysed"))
    );
}

#[test]
fn the_folder_of_a_demo_gives_the_demos_model() {
    let dir = recorded();
    let demo = fs::read(dir.join("live/model.json")).expect("reads");
    let demo: serde_json::Value = serde_json::from_slice(&demo).expect("JSON");
    let (again, reported) = model(dir, &["discover", "live", "--format", "json"]);
    assert!(reported.contains("live/roscausal.toml: --method=pcmci --test=parcorr"), "{reported}");
    for field in ["method", "cond_ind_test", "n_recordings", "dt", "links", "p_matrix"] {
        assert_eq!(again[field], demo[field], "{field}");
    }
    let (pool, _) = model(
        dir,
        &["discover", "live/pp_pool", "--method", "pcmci", "--test", "parcorr", "--format", "json"],
    );
    assert_eq!(pool["links"], demo["links"]);
    let nothing = tempfile::tempdir().expect("a folder");
    let output = roscausal(nothing.path(), &["discover", "."]);
    assert!(stated(&output).contains("there is nothing to analyse in this folder"), "{}", stated(&output));
}

#[test]
fn a_flag_takes_precedence_over_the_settings_of_a_recording() {
    let dir = recorded();
    let args =
        ["discover", "run.mcap", "--format", "json", "--dt", "0.2", "--ts-length", "0", "--alpha", "0.01"];
    let (model, reported) = model(dir, &[&args[..], &["--method", "bivci"]].concat());
    assert_eq!((&model["method"], &model["n_recordings"]), (&"bivci".into(), &1.into()));
    assert!((model["dt"].as_f64().expect("a step") - 0.2).abs() < 1e-9);
    assert_eq!(model["cond_ind_test"], "parcorr");
    assert!(!reported.contains("--method"), "{reported}");
}

#[test]
fn a_bag_has_its_settings_in_a_file_beside_it() {
    let dir = tempfile::tempdir().expect("a folder");
    fs::copy(recorded().join("run.mcap"), dir.path().join("walk.mcap")).expect("copies");
    let settings =
        "tau-max = 2\n[data]\ndt = 0.5\nts_length = 0\n[discovery]\ncond_ind_test = 'robustparcorr'\n";
    fs::write(dir.path().join("walk.mcap.roscausal.toml"), settings).expect("writes");
    let (model, reported) = model(dir.path(), &["discover", "walk.mcap", "--format", "json"]);
    assert_eq!(
        (&model["tau_max"], &model["cond_ind_test"], &model["dt"]),
        (&2.into(), &"robustparcorr".into(), &0.5.into())
    );
    assert!(reported.contains("settings of walk.mcap.roscausal.toml: --tau-max=2"), "{reported}");
    fs::write(dir.path().join("roscausal.toml"), "tau-mx = 3\n").expect("writes");
    let output = roscausal(dir.path(), &["discover", "walk.mcap"]);
    assert!(stated(&output).contains("did you mean 'tau-max'?"), "{}", stated(&output));
}

/// Writes 20 s of a robot that AMCL finds every 0.6 s, with a pause of 9 s, and of a person. `topics` says what is recorded.
fn write_walk(path: &Path, topics: &[&str]) {
    let mut writer = McapWriter::create(path).expect("creates");
    let header =
        |t: f64, frame: &str| Header { stamp: Time::from_secs_f64(100.0 + t), frame_id: frame.into() };
    let mut write = |topic: &str, t: f64, write: &mut dyn FnMut(&mut McapWriter, Time)| {
        if topics.contains(&topic) {
            write(&mut writer, Time::from_secs_f64(100.0 + t));
        }
    };
    for step in 0..400 {
        let t = 0.05 * f64::from(step);
        let (x, y) = (3.0 * (0.3 * t).sin(), 0.1 * (1.7 * t).sin());
        let mut transform = |parent: &str, child: &str, x: f64, y: f64| {
            let mut transform = TransformStamped {
                header: header(t, parent),
                child_frame_id: child.into(),
                ..Default::default()
            };
            (transform.transform.translation.x, transform.transform.translation.y) = (x, y);
            let message = TFMessage { transforms: vec![transform] };
            write("/tf", t, &mut |to, stamp| to.write("/tf", stamp, &message).expect("writes"));
        };
        transform("map", "odom", 0.0, 0.0);
        transform("odom", "base_link", x, y);
        let mut odometry =
            Odometry { header: header(t, "odom"), child_frame_id: "base_link".into(), ..Default::default() };
        (odometry.pose.pose.position.x, odometry.pose.pose.position.y) = (x, y);
        odometry.twist.twist.linear.x = 0.9 * (0.3 * t).cos();
        write("/odom", t, &mut |to, stamp| to.write("/odom", stamp, &odometry).expect("writes"));
        if step % 12 == 0 && !(6.0..15.0).contains(&t) {
            let mut pose = PoseWithCovarianceStamped { header: header(t, "map"), ..Default::default() };
            pose.pose.pose.position.x = x;
            write("/amcl_pose", t, &mut |to, stamp| to.write("/amcl_pose", stamp, &pose).expect("writes"));
        }
        let mut pose = PoseStamped { header: header(t, "map"), ..Default::default() };
        (pose.pose.position.x, pose.pose.position.y) = (x, y);
        write("/robot_pose", t, &mut |to, stamp| to.write("/robot_pose", stamp, &pose).expect("writes"));
        let mut people = PoseArray { header: header(t, "map"), ..Default::default() };
        people.poses = vec![Pose::default(); 2];
        people.poses[0].position.x = 2.0 + (0.8 * t).sin() + 0.2 * (5.1 * t).sin();
        people.poses[1].position.y = 6.0 + (0.5 * t).cos() + 0.2 * (3.3 * t).sin();
        // A tracker's list has no order.
        if step % 7 < 3 {
            people.poses.reverse();
        }
        for topic in ["/people", "/particlecloud"] {
            write(topic, t, &mut |to, stamp| to.write(topic, stamp, &people).expect("writes"));
        }
    }
    writer.finish().expect("ends");
}

fn discovered(topics: &[&str], more: &[&str]) -> Output {
    let dir = tempfile::tempdir().expect("a folder");
    write_walk(&dir.path().join("walk.mcap"), topics);
    roscausal(dir.path(), &[&["discover", "walk.mcap"], more, &QUICK].concat())
}

#[test]
fn the_robots_place_is_taken_from_what_knows_it_for_more_of_the_time_and_the_choice_is_told() {
    let output = discovered(&["/odom", "/tf", "/amcl_pose", "/people"], &["--drop-empty"]);
    assert!(output.status.success(), "{}", stated(&output));
    let reported = "robot pose: the pose in /odom, brought to the map by TF: it knows the robot in 100 % of the time, /amcl_pose";
    assert!(
        stated(&output).contains(reported) && stated(&output).contains("in 0 % of the time"),
        "{}",
        stated(&output)
    );
    let output = discovered(&["/odom", "/tf", "/robot_pose", "/people"], &["--drop-empty"]);
    assert!(
        stated(&output).contains("robot pose: /robot_pose (geometry_msgs/PoseStamped); it knows"),
        "{}",
        stated(&output)
    );
}

#[test]
fn a_recording_with_poses_or_transforms_only_is_analysed() {
    let output = discovered(&["/robot_pose", "/people"], &["--drop-empty", "--format", "json"]);
    assert!(
        output.status.success() && stated(&output).contains("speed follows from the poses"),
        "{}",
        stated(&output)
    );
    let output = discovered(&["/tf", "/people"], &["--drop-empty", "--format", "json"]);
    assert!(output.status.success(), "{}", stated(&output));
    assert!(stated(&output).contains("robot: the place of base_link in map by TF"), "{}", stated(&output));
    let model: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert!(model["n_samples"].as_u64().is_some_and(|n| n > 150), "{model}");
}

#[test]
fn a_recording_without_a_map_and_without_goals_is_analysed_in_the_odometrys_frame() {
    let dir = tempfile::tempdir().expect("a folder");
    let whole = dir.path().join("whole.mcap");
    write_walk(&whole, &["/odom", "/people"]);
    let mut walk = Recording::open(whole).expect("opens");
    let topics = walk.topics().to_vec();
    let mut writer = McapWriter::create(dir.path().join("walk.mcap")).expect("a file");
    for Record { topic, stamp, bytes, .. } in walk.by_ref() {
        let topic = &topics[topic];
        match topic.decode::<PoseArray>(&bytes) {
            Ok(mut people) if topic.name == "/people" => {
                people.header.frame_id = "odom".into();
                writer.write("/people", stamp, &people)
            }
            _ => writer.write("/odom", stamp, &topic.decode::<Odometry>(&bytes).expect("reads")),
        }
        .expect("writes");
    }
    writer.finish().expect("ends");
    let run = |more: &[&str]| roscausal(dir.path(), &[&["discover", "walk.mcap"], more, &QUICK].concat());
    let output = run(&[]);
    let reported = stated(&output);
    assert!(output.status.success(), "{reported}");
    for part in ["left out, since the recording has no goal", "the frame odom of /odom", "--human-goal"] {
        assert!(reported.contains(part), "{part}: {reported}");
    }
    let output = run(&["--drop-empty", "--format", "json"]);
    assert!(output.status.success(), "{}", stated(&output));
    let model: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(model["features"], serde_json::json!(["h_v", "h_risk"]));
    assert!(model["n_samples"].as_u64().is_some_and(|n| n > 150), "{model}");
}

#[test]
fn a_robot_in_a_namespace_has_the_transforms_of_its_namespace_and_its_goal_from_the_end_of_the_plan() {
    let dir = tempfile::tempdir().expect("a folder");
    write_walk(&dir.path().join("walk.mcap"), &["/odom", "/tf", "/people"]);
    let mut walk = Recording::open(dir.path().join("walk.mcap")).expect("opens");
    let topics = walk.topics().to_vec();
    let mut writer = McapWriter::create(dir.path().join("ns.mcap")).expect("a file");
    for (place, Record { topic, stamp, bytes, .. }) in walk.by_ref().enumerate() {
        let topic = &topics[topic];
        let written = match topic.name.as_str() {
            "/odom" => writer.write("/tb3_0/odom", stamp, &topic.decode::<Odometry>(&bytes).expect("reads")),
            "/tf" => writer.write("/tb3_0/tf", stamp, &topic.decode::<TFMessage>(&bytes).expect("reads")),
            _ => writer.write("/people", stamp, &topic.decode::<PoseArray>(&bytes).expect("reads")),
        };
        written.expect("writes");
        if place % 40 == 0 {
            let mut end = PoseStamped::default();
            end.pose.position.y = 5.0 + 0.01 * place as f64;
            let header = Header { stamp, frame_id: "map".into() };
            let plan = Plan { header, poses: vec![PoseStamped::default(), end] };
            writer.write("/tb3_0/plan", stamp, &plan).expect("writes");
        }
    }
    writer.finish().expect("ends");
    let flags = ["replay", "ns.mcap", "--out", "out", "--ts-length", "0", "--robot-goal", "/tb3_0/plan"];
    let output = roscausal(dir.path(), &[&flags[..], &QUICK].concat());
    for line in ["transforms: /tb3_0/tf and /tb3_0/tf_static", "robot goal: /tb3_0/plan (nav_msgs/Path)"] {
        assert!(stated(&output).contains(line), "{}", stated(&output));
    }
    let table = &csv_files(&dir.path().join("out/data_pool"))[0].1;
    let goals = table.lines().skip(10).filter_map(|row| row.split(',').nth(2)?.parse::<f64>().ok());
    let goals: Vec<f64> = goals.collect();
    assert!(goals.len() > 150, "{}", goals.len());
    assert!(
        goals[0] < 6.0 && goals[goals.len() - 1] > 10.0,
        "the goal is the end of the newest plan: {goals:?}"
    );
}

#[test]
fn everybody_is_analysed_where_nobodys_goal_is_known() {
    let output = discovered(&["/robot_pose", "/people"], &["--person", "all"]);
    assert!(output.status.success(), "{}", stated(&output));
    assert!(
        stated(&output).contains("'h_dg' is empty for everybody and is not analysed"),
        "{}",
        stated(&output)
    );
}

#[test]
fn particles_of_a_localisation_are_no_people() {
    let output = discovered(&["/robot_pose", "/particlecloud"], &[]);
    assert!(
        !output.status.success() && stated(&output).contains("nothing in it can be people"),
        "{}",
        stated(&output)
    );
    let output = discovered(&["/robot_pose", "/particlecloud", "/people"], &[]);
    assert!(stated(&output).contains("people: /people (geometry_msgs/PoseArray)"), "{}", stated(&output));
}

#[test]
fn the_topics_of_a_foreign_recording_are_listed_with_rate_and_longest_gap() {
    let bag =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/recordings/foreign/robot_localization/test2.bag");
    let output = roscausal(Path::new("."), &["topics", &bag.display().to_string()]);
    assert!(output.status.success(), "{}", stated(&output));
    let text = stated(&output);
    let line =
        text.lines().find(|line| line.starts_with("/jackal_velocity_controller/odom")).expect("its line");
    let cells: Vec<&str> = line.split_whitespace().collect();
    assert_eq!(cells[1..3], ["nav_msgs/Odometry", "3060"], "{text}");
    let [rate, gap] = [3, 4].map(|cell| cells[cell].parse::<f64>().expect("a number"));
    assert!((10.0..100.0).contains(&rate) && gap >= 1.0 / rate, "{text}");
}

#[test]
fn a_topic_whose_name_is_longer_than_a_format_can_be_wide_is_listed() {
    let dir = tempfile::tempdir().expect("a folder");
    let mut writer = McapWriter::create(dir.path().join("long.mcap")).expect("creates");
    let name = format!("/{}", "t".repeat(70_000));
    writer.write(&name, Time::from_secs_f64(1.0), &Odometry::default()).expect("writes");
    writer.finish().expect("closes");
    for flags in [vec![], vec!["--signals"]] {
        let output = roscausal(dir.path(), &[vec!["topics", "long.mcap"], flags].concat());
        assert!(output.status.success() && stated(&output).contains("/ttt"), "{}", stated(&output));
    }
}

#[test]
fn a_foreign_recording_without_people_is_refused_with_what_there_is() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/recordings/foreign");
    for (file, reported) in [
        ("robot_localization/test2.bag", "nothing in it can be people"),
        ("leg_tracker/positive_2_extracted.bag", "nothing in it can be robot odometry"),
        ("inorbit_samples/fake_sensors_sample.bag", "/my_temperature (sensor_msgs/Temperature)"),
        ("rosbag2/talker.mcap", "/topic (std_msgs/String)"),
    ] {
        let output = roscausal(Path::new("."), &["discover", &folder.join(file).display().to_string()]);
        assert!(output.status.code() == Some(1) && stated(&output).contains(reported), "{}", stated(&output));
    }
}

#[test]
fn a_recording_without_a_role_is_pointed_to_signals_and_nothing_in_it_is_called_unreadable() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/recordings/foreign");
    let bag = folder.join("inorbit_samples/fake_sensors_sample.bag").display().to_string();
    let output = roscausal(Path::new("."), &["discover", &bag]);
    assert!(!stated(&output).contains("not readable"), "{}", stated(&output));
    let hint =
        "--signal 'v = /topic.field' reads any number of any topic (roscausal topics --signals lists them)";
    assert!(stated(&output).contains(hint), "{}", stated(&output));
}

#[test]
fn a_recording_that_was_broken_off_before_its_first_message_is_called_so_with_what_was_lost() {
    let dir = tempfile::tempdir().expect("a folder");
    let people = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/recordings/people/people.bag");
    let whole = fs::read(people).expect("reads");
    fs::write(dir.path().join("cut.bag"), &whole[..4096]).expect("writes");
    fs::write(dir.path().join("empty.bag"), "#ROSBAG V2.0\n").expect("writes");
    for file in ["cut.bag", "empty.bag"] {
        for more in [&[][..], &["--signal", "v = /odom.twist.twist.linear.x"]] {
            let output = roscausal(dir.path(), &[&["discover", file], more].concat());
            assert!(output.status.code() == Some(1), "{}", stated(&output));
            let reported = format!("{file}: it holds no messages; was it broken off? (");
            assert!(stated(&output).contains(&reported), "{}", stated(&output));
            assert!(!stated(&output).contains("robot odometry"), "{}", stated(&output));
        }
    }
}

/// Two robots in namespaces and two people, which rosbags wrote (`tests/recordings/robots.py`): `fleet` with all topics, `crowd` with
/// transforms and people alone.
fn robots(which: &str) -> String {
    format!("{}/tests/recordings/robots_{which}", env!("CARGO_MANIFEST_DIR"))
}

/// The numbers in a column (`r_y`, `h_x`) of the only batch that `replay` makes of the fleet with these flags, and what it says.
fn of_fleet(flags: &[&str], column: &str) -> (Vec<f64>, String) {
    let (dir, fleet) = (tempfile::tempdir().expect("a folder"), robots("fleet"));
    let replay = ["replay", &fleet, "--out", "out", "--ts-length", "0"];
    let output = roscausal(dir.path(), &[&replay[..], flags, &QUICK].concat());
    let pool = dir.path().join("out/data_pool");
    let tables = if pool.is_dir() { csv_files(&pool) } else { Vec::new() };
    let mut lines = tables.first().map_or("", |(_, table)| table.as_str()).lines();
    let (of, what) = column.split_once('_').expect("of whom, and what");
    let is_it = |name: &str| name == column || name.starts_with(of) && name.ends_with(&format!("_{what}"));
    let Some(place) = lines.next().map(|header| header.split(',').position(is_it).expect("the column"))
    else {
        return (Vec::new(), stated(&output));
    };
    (lines.filter_map(|row| row.split(',').nth(place)?.parse().ok()).collect(), stated(&output))
}

#[test]
fn one_of_several_robots_is_chosen_by_its_name_with_all_its_topics() {
    let (none, reported) = of_fleet(&[], "r_y");
    assert!(none.is_empty(), "{reported}");
    for part in ["several topics can be robot odometry", "of the robots tb3_0, tb3_1", "--robot NAME"] {
        assert!(reported.contains(part), "{part}: {reported}");
    }
    let (_, reported) = of_fleet(&["--robot", "tb3_2"], "r_y");
    assert!(
        reported.contains("there is no robot 'tb3_2'") && reported.contains("tb3_0, tb3_1"),
        "{reported}"
    );
    for (robot, away) in [("tb3_0", 0.0), ("tb3_1", 2.5)] {
        let (ys, reported) = of_fleet(&["--robot", robot], "r_y");
        for line in [format!("robot odometry: /{robot}/odom "), format!("robot goal: /{robot}/goal_pose ")] {
            assert!(reported.contains(&line), "{line}: {reported}");
        }
        let mean = ys.iter().sum::<f64>() / ys.len() as f64;
        assert!(ys.len() > 150 && (mean - away).abs() < 0.3, "{robot}: {mean} of {} rows", ys.len());
    }
}

#[test]
fn states_of_a_robot_in_a_namespace_are_found_by_its_name() {
    let dir = tempfile::tempdir().expect("a folder");
    let mut writer = McapWriter::create(dir.path().join("states.mcap")).expect("a file");
    for step in 0..300 {
        let stamp = Time::from_secs_f64(100.0 + 0.1 * f64::from(step));
        let header = Header { stamp, frame_id: "map".into() };
        for (robot, x) in [("r1", 0.0), ("r2", 10.0)] {
            let pose2d = Pose2D { x, y: 0.01 * f64::from(step % 7), theta: 0.0 };
            let state = RobotState { header: header.clone(), pose2d, ..RobotState::default() };
            let person = HumanState { header: header.clone(), id: 1000, pose2d, ..HumanState::default() };
            let people = Humans { header: header.clone(), humans: vec![person] };
            writer.write(&format!("/{robot}/roscausal/robot"), stamp, &state).expect("is written");
            writer.write(&format!("/{robot}/roscausal/humans"), stamp, &people).expect("is written");
        }
    }
    writer.finish().expect("is complete");
    let replay = |more: &[&str]| {
        let args = ["replay", "states.mcap", "--out", "out", "--ts-length", "0"];
        stated(&roscausal(dir.path(), &[&args[..], more, &QUICK].concat()))
    };
    assert!(replay(&["--robot", "r3"]).contains("there is no robot 'r3'"), "{}", replay(&["--robot", "r3"]));
    let reported = replay(&["--robot", "r2"]);
    assert!(reported.contains("states: /r2/roscausal/robot and /r2/roscausal/humans"), "{reported}");
    let (_, table) = csv_files(&dir.path().join("out/data_pool")).remove(0);
    let mut rows = table.lines();
    let place = rows.next().and_then(|header| header.split(',').position(|name| name == "r_x"));
    let place = place.expect("a column");
    let xs: Vec<&str> = rows.filter_map(|row| row.split(',').nth(place)).collect();
    assert!(xs.len() > 250 && xs.iter().all(|x| x.parse() == Ok(10.0)), "{xs:?}");
}

#[test]
fn other_robots_may_take_the_place_of_people() {
    let (ys, reported) = of_fleet(&["--robot", "tb3_0", "--people", "robots"], "h_y");
    assert!(reported.contains("people: /tb3_1/odom (nav_msgs/Odometry)"), "{reported}");
    // It drives 2.5 m beside the robot.
    assert!(
        ys.len() > 150 && ys.iter().all(|y| (y - 2.5).abs() < 0.2),
        "{} rows: {:?}",
        ys.len(),
        ys.first()
    );
    let reported = discovered(&["/odom", "/tf", "/people"], &["--people", "robots"]);
    assert!(stated(&reported).contains("there is no other robot"), "{}", stated(&reported));
}

#[test]
fn a_fleet_that_is_only_in_tf_is_told_apart_by_the_names_of_its_frames() {
    let (dir, crowd) = (tempfile::tempdir().expect("a folder"), robots("crowd"));
    let run = |flags: &[&str]| {
        stated(&roscausal(dir.path(), &[&["discover", &crowd, "--drop-empty"], flags, &QUICK].concat()))
    };
    assert!(run(&[]).contains("TF has the robots tb3_0, tb3_1"), "{}", run(&[]));
    let reported = run(&["--robot", "tb3_1"]);
    assert!(reported.contains("robot: the place of tb3_1/base_link in map by TF"), "{reported}");
}
