//! What we write can be read back: by ourselves here, by other software in `tests/recordings.sh`.
#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test, in helpers too")]

use std::{fs, path::Path};

use roscausal_core::{
    Time,
    loopback::Loopback,
    middleware::{Middleware, Publish, Qos},
};
use roscausal_msgs::{
    CausalModel, HumanState, Humans, Message,
    geometry_msgs::{Point, Pose2D},
    sensor_msgs::Image,
    std_msgs::Header,
    tf2_msgs::TFMessage,
    types,
    visualization_msgs::{Marker, MarkerArray, Ros2MarkerArray},
};
use roscausal_recording::{McapWriter, Player, Recorder, Recording};

fn header(seconds: f64) -> Header {
    Header { stamp: Time::from_secs_f64(seconds), frame_id: "map".into() }
}

fn humans(number: u32) -> Humans {
    let seconds = 100.0 + f64::from(number) * 0.1;
    let human = HumanState {
        header: header(seconds),
        id: 1000,
        pose2d: Pose2D { x: f64::from(number), y: -0.5, theta: 0.25 },
        goal: Point { x: 3.0, ..Point::default() },
        ..HumanState::default()
    };
    Humans { header: header(seconds), humans: vec![human; number as usize % 3] }
}

fn model() -> CausalModel {
    let mut model = CausalModel {
        header: header(101.0),
        features: vec!["h_v".into(), "h_dg".into()],
        original_shape: vec![1, 2, 2],
        ..CausalModel::default()
    };
    model.causal_structure.data = vec![0, 1, 1, 0];
    model.val_matrix.data = vec![0.0, 0.5, -0.25, 0.0];
    model
}

fn markers() -> MarkerArray {
    let marker =
        Marker { header: header(101.0), ns: "people".into(), text: "1000".into(), ..Marker::default() };
    MarkerArray { markers: vec![marker] }
}

/// What `tests/recordings/read.py` expects: 50 messages of people, a model, an image, markers.
fn write(path: &Path) {
    let mut writer = McapWriter::create(path).unwrap();
    for number in 0..50 {
        let humans = humans(number);
        writer.write("/roscausal/humans", humans.header.stamp, &humans).unwrap();
    }
    writer.write("/roscausal/causal_model", Time::from_secs_f64(105.0), &model()).unwrap();
    let image = Image {
        header: header(101.0),
        height: 2,
        width: 3,
        encoding: "rgb8".into(),
        step: 9,
        data: (0..18).collect(),
        ..Image::default()
    };
    writer.write("/roscausal/dag", Time::from_secs_f64(105.0), &image).unwrap();
    let markers = Ros2MarkerArray::from(markers());
    writer.write("/roscausal/markers", Time::from_secs_f64(105.0), &markers).unwrap();
    assert_eq!(writer.messages(), 53);
    writer.finish().unwrap();
}

#[test]
fn a_file_written_reads_back_equal() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    write(&path);
    let mut recording = Recording::open(&path).unwrap();
    let mut number = 0;
    let (topics, mut count) = (recording.topics().to_vec(), 0);
    for record in recording.by_ref() {
        let topic = &topics[record.topic];
        count += 1;
        match topic.name.as_str() {
            "/roscausal/humans" => {
                assert_eq!(topic.decode::<Humans>(&record.bytes).unwrap(), humans(number));
                assert_eq!(record.stamp, humans(number).header.stamp);
                number += 1;
            }
            "/roscausal/causal_model" => {
                assert_eq!(topic.decode::<CausalModel>(&record.bytes).unwrap(), model());
            }
            _ => assert!(topic.known_type().is_some(), "{topic:?}"),
        }
    }
    assert_eq!((count, number), (53, 50));
    assert_eq!(recording.losses(), &[] as &[String]);
    if let Some(folder) = std::env::var_os("ROSCAUSAL_RECORDINGS") {
        fs::copy(&path, Path::new(&folder).join("ours.mcap")).unwrap();
    }
}

#[test]
fn the_same_messages_give_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let [first, second] = ["first.mcap", "second.mcap"].map(|name| {
        let path = folder.path().join(name);
        write(&path);
        fs::read(path).unwrap()
    });
    assert!(first == second);
}

#[test]
fn every_type_can_be_recorded() {
    let folder = tempfile::tempdir().unwrap();
    let bus = Loopback::lockstep();
    for definition in types() {
        let path = folder.path().join("one.mcap");
        let mut recorder = Recorder::new(&bus.node("recorder"), McapWriter::create(&path).unwrap());
        recorder.record("/topic", definition).unwrap();
        assert_eq!(recorder.finish().unwrap(), 0, "{}", definition.type_name());
    }
}

#[test]
fn what_is_published_is_recorded_and_played_again() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let bus = Loopback::lockstep();
    bus.advance_to(Time::from_secs_f64(100.0));
    let node = bus.node("node");
    let people = node.advertise::<Humans>("/roscausal/humans", Qos::Volatile(10)).unwrap();
    let latched = node.advertise::<TFMessage>("/tf_static", Qos::Latched).unwrap();
    let shapes = node.advertise::<MarkerArray>("/roscausal/markers", Qos::Volatile(10)).unwrap();
    latched.publish(&TFMessage::default()).unwrap();
    let mut recorder = Recorder::new(&bus.node("recorder"), McapWriter::create(&path).unwrap());
    recorder.watch().unwrap();
    recorder.watch().unwrap();
    for number in 0..20 {
        bus.advance_to(humans(number).header.stamp);
        people.publish(&humans(number)).unwrap();
        shapes.publish(&markers()).unwrap();
    }
    bus.settle();
    assert_eq!(recorder.finish().unwrap(), 41);

    let recording = Recording::open(&path).unwrap();
    let index = recording.topic("/roscausal/markers", None).unwrap();
    assert_eq!(*recording.topics()[index].definition, *Ros2MarkerArray::definition().ros2_definition());
    let bus = Loopback::lockstep();
    bus.advance_to(recording.span().unwrap().0);
    let (heard, listener) =
        (std::sync::Arc::<std::sync::Mutex<Vec<Humans>>>::default(), bus.node("listener"));
    let hears = heard.clone();
    let hear = move |message| hears.lock().unwrap().push(message);
    let _subscription = listener.subscribe("/roscausal/humans", Qos::Volatile(10), hear).unwrap();
    let mut player = Player::new(&bus.node("player"), &recording, |topic| Some(topic.playable())).unwrap();
    let topics = recording.topics().to_vec();
    for record in recording {
        bus.advance_to(record.stamp);
        player.publish(&topics[record.topic], &record).unwrap();
    }
    bus.settle();
    assert_eq!(*heard.lock().unwrap(), (0..20).map(humans).collect::<Vec<_>>());
}
