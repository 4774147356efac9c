//! DDS Security with a real keystore: a node without a certificate can neither read nor write. `tests/security.sh`
//! runs it; it needs the program `openssl`.
#![cfg(feature = "security")]
#![allow(clippy::expect_used, clippy::panic, reason = "a test may panic: that is how it fails")]

use std::{
    path::Path,
    process::Command,
    sync::{Arc, Mutex},
    thread::sleep,
    time::{Duration, Instant},
};

use roscausal_core::{
    Error,
    middleware::{Middleware, Publish, Qos},
};
use roscausal_msgs::std_msgs;
use roscausal_ros2::Subscription;
use roscausal_ros2::{Args, Ros2};

const DOMAIN: u32 = 10;
/// How long to wait for what must not arrive. Two nodes find each other in 0.6 s, secured ones in a few seconds.
const NEVER: Duration = Duration::from_secs(6);
const SOON: Duration = Duration::from_secs(30);

fn keystore(folder: &Path, enclaves: &[&str]) {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/security/keystore.sh");
    let made = Command::new("sh").arg(script).arg(folder).args(enclaves).status();
    assert!(made.expect("openssl").success(), "no keystore");
}

/// Arguments of a node in an enclave of a keystore, or in the clear; on the domain of one test.
fn args(name: &str, test: u32, keystore: Option<(&Path, &str)>) -> Args {
    let domain = DOMAIN + 2 * (std::process::id() % 40) + test;
    let variables = [
        ("ROS_DOMAIN_ID", domain.to_string()),
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST".to_owned()),
        ("ROS_SECURITY_ENABLE", keystore.is_some().to_string()),
        ("ROS_SECURITY_STRATEGY", "Enforce".to_owned()),
        ("ROS_SECURITY_KEYSTORE", keystore.map_or(String::new(), |(folder, _)| folder.display().to_string())),
    ];
    let env = |name: &str| Some(variables.iter().find(|(key, _)| *key == name)?.1.clone());
    let line = ["--ros-args", "-e", keystore.map_or("/", |(_, enclave)| enclave)];
    Args::parse(name, line.map(str::to_owned), env).expect("arguments")
}

type Heard = Arc<Mutex<Vec<String>>>;

fn listen(node: &Ros2, topic: &str) -> (Heard, Subscription) {
    listen_to(node, topic, Qos::Volatile(100))
}

fn listen_to(node: &Ros2, topic: &str, qos: Qos) -> (Heard, Subscription) {
    let heard = Heard::default();
    let hears = heard.clone();
    let take = move |text: std_msgs::String| hears.lock().expect("no panic").push(text.data);
    (heard, node.subscribe(topic, qos, take).expect("subscribes"))
}

fn has(heard: &Heard, from: &str) -> bool {
    heard.lock().expect("no panic").iter().any(|text| text == from)
}

/// Repeats `from` on a topic.
struct Speaker {
    stated: Arc<dyn Fn() + Send + Sync>,
}

impl Speaker {
    fn new(node: &Ros2, topic: &str, from: &str) -> Self {
        let publisher = node.advertise::<std_msgs::String>(topic, Qos::Volatile(100)).expect("advertises");
        let text = std_msgs::String { data: from.to_owned() };
        Self { stated: Arc::new(move || publisher.publish(&text).expect("publishes")) }
    }
}

fn speak(speakers: &[&Speaker], at_most: Duration, until: impl Fn() -> bool) -> bool {
    let end = Instant::now() + at_most;
    while Instant::now() < end && !until() {
        speakers.iter().for_each(|speaker| (speaker.stated)());
        sleep(Duration::from_millis(50));
    }
    until()
}

#[test]
fn a_participant_without_a_certificate_neither_reads_nor_writes() {
    let folder = tempfile::tempdir().expect("a folder");
    let (ours, theirs) = (folder.path().join("ours"), folder.path().join("theirs"));
    keystore(&ours, &["/robot", "/recorder"]);
    keystore(&theirs, &["/robot"]);
    let node = |name, keystore| Ros2::start(&args(name, 0, keystore)).expect("a node");
    let robot = node("robot", Some((&ours, "/robot")));
    let recorder = node("recorder", Some((&ours, "/recorder")));
    let clear = node("clear", None);
    let other = node("other", Some((&theirs, "/robot")));
    let clear_too = node("clear_too", None);

    let (recorder_heard, _a) = listen(&recorder, "/chat");
    let (clear_heard, _b) = listen(&clear, "/chat");
    let (other_heard, _c) = listen(&other, "/chat");
    let from_robot = Speaker::new(&robot, "/chat", "robot");
    let from_clear = Speaker::new(&clear_too, "/chat", "clear");
    let from_other = Speaker::new(&other, "/chat", "other");
    let all = [&from_robot, &from_clear, &from_other];

    assert!(speak(&all, SOON, || has(&recorder_heard, "robot")), "the secured nodes do not talk");
    assert!(speak(&all, SOON, || has(&clear_heard, "clear")), "the nodes in the clear do not talk: no proof");
    let leaks = || {
        has(&recorder_heard, "clear")
            || has(&recorder_heard, "other")
            || has(&clear_heard, "robot")
            || has(&clear_heard, "other")
            || has(&other_heard, "robot")
            || has(&other_heard, "clear")
    };
    assert!(!speak(&all, NEVER, leaks), "{recorder_heard:?} {clear_heard:?} {other_heard:?}");
    let names = |node: &Ros2| node.topics().into_iter().map(|(topic, _)| topic).collect::<Vec<_>>();
    assert!(names(&recorder).contains(&"/chat".to_owned()), "{:?}", names(&recorder));

    // A node that joins later is admitted as well.
    let late = node("late", Some((&ours, "/recorder")));
    let (late_heard, _d) = listen(&late, "/chat");
    assert!(speak(&all, SOON, || has(&late_heard, "robot")), "who comes late hears nothing");
    // Latched messages, each with its own publisher, and of every length, because encryption pads them.
    let latched = robot.advertise::<std_msgs::String>("/latched", Qos::Latched).expect("advertises");
    let (recorder_heard, _e) = listen_to(&recorder, "/latched", Qos::Latched);
    let (clear_heard, _f) = listen_to(&clear, "/latched", Qos::Latched);
    for text in ["a", "ab", "abc", "abcd"] {
        latched.publish(&std_msgs::String { data: text.to_owned() }).expect("publishes");
        assert!(speak(&[], SOON, || has(&recorder_heard, text)), "'{text}' does not arrive");
    }
    let (late_heard, _g) = listen_to(&late, "/latched", Qos::Latched);
    assert!(speak(&[], SOON, || has(&late_heard, "abcd")), "the last one does not wait for who comes late");
    assert!(clear_heard.lock().expect("no panic").is_empty());
    assert!(!has(&late_heard, "clear") && !has(&late_heard, "other"));
}

#[test]
fn an_enclave_uses_only_the_topics_it_is_granted_and_bad_files_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let store = folder.path().join("store");
    let allowed = "rt/chat,ros_discovery_info,rt/rosout,rt/parameter_events,rq/*,rr/*";
    keystore(&store, &[&format!("/limited={allowed}"), "/forged"]);
    let limited = Ros2::start(&args("limited", 1, Some((&store, "/limited")))).expect("a node");
    let publisher = limited.advertise::<std_msgs::String>("/chat", Qos::Volatile(1));
    assert!(publisher.is_ok());
    match limited.advertise::<std_msgs::String>("/cmd_vel_text", Qos::Volatile(1)) {
        Err(Error::Topic { topic, .. }) => assert_eq!(topic, "/cmd_vel_text"),
        Err(error) => panic!("{error}"),
        Ok(_) => panic!("a topic that is not granted"),
    }
    // Permissions that nobody has signed.
    let enclave = store.join("enclaves/forged");
    let signed = std::fs::read_to_string(enclave.join("permissions.p7s")).expect("reads");
    std::fs::write(enclave.join("permissions.p7s"), signed.replace("2100", "2101")).expect("writes");
    match Ros2::start(&args("forged", 1, Some((&store, "/forged")))) {
        Err(Error::File { path, .. }) => assert_eq!(path, enclave),
        Err(error) => panic!("{error}"),
        Ok(_) => panic!("forged permissions are taken"),
    }
}
