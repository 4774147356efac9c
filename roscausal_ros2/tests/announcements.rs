//! Endpoints are announced more than once: a participant may miss the first time, as Fast DDS does when several nodes start at once
//! (`third_party/README.md`). On real DDS over the loopback interface.
#![allow(clippy::expect_used, reason = "a participant that cannot be made fails the test")]

use std::{
    net::{IpAddr, Ipv4Addr},
    thread::sleep,
    time::{Duration, Instant},
};

use rustdds::{
    DomainParticipant, DomainParticipantBuilder, QosPolicyBuilder, StatusEvented as _, TopicKind,
    dds::statusevents::DomainParticipantStatusEvent::WriterDetected,
};

/// Announced again after this long without a new participant.
const AGAIN: Duration = Duration::from_secs(2);
/// What has been replaced is cleared every six seconds.
const CLEARED: Duration = Duration::from_secs(8);

fn participant() -> DomainParticipant {
    let domain = 100 + (std::process::id() % 100) as u16;
    DomainParticipantBuilder::new(domain)
        .with_only_networks([IpAddr::V4(Ipv4Addr::LOCALHOST)])
        .build()
        .expect("a participant")
}

/// How often this participant hears of a writer on the topic within `time`.
fn announcements(participant: &DomainParticipant, topic: &str, time: Duration) -> usize {
    let events = participant.status_listener();
    let end = Instant::now() + time;
    let mut heard = 0;
    while Instant::now() < end {
        while let Some(event) = events.try_recv_status() {
            heard += usize::from(matches!(event, WriterDetected { writer } if writer.topic_name == topic));
        }
        sleep(Duration::from_millis(5));
    }
    heard
}

#[test]
fn endpoints_are_announced_again_when_participants_appeared_and_what_was_said_before_is_forgotten() {
    let (name, qos) = ("announced".to_owned(), QosPolicyBuilder::new().build());
    let speaker = participant();
    let topic =
        speaker.create_topic(name.clone(), "Kind".to_owned(), &qos, TopicKind::NoKey).expect("a topic");
    let publisher = speaker.create_publisher(&qos).expect("a publisher");
    let _writer = publisher.create_datawriter_no_key_cdr::<u8>(&topic, None).expect("a writer");

    let listener = participant();
    assert!(announcements(&listener, &name, AGAIN / 2) > 0, "not announced");
    let mut passers_by = Vec::new();
    for _ in 0..3 {
        assert!(announcements(&listener, &name, AGAIN + AGAIN / 2) > 0, "not announced again");
        passers_by.push(participant());
    }
    assert!(announcements(&listener, &name, AGAIN + AGAIN / 2) > 0, "not announced again");

    sleep(CLEARED);
    let late = participant();
    let heard = announcements(&late, &name, AGAIN / 2);
    // One announcement is told once or twice; there have been five.
    assert!(
        (1..4).contains(&heard),
        "one who comes late hears what holds now, not all that was said before: {heard} times"
    );
}
