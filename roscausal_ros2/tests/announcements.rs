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

/// What a busy machine may take for an announcement.
const PATIENCE: Duration = Duration::from_secs(20);
/// What has been replaced is cleared every six seconds.
const CLEARED: Duration = Duration::from_secs(8);

fn participant() -> DomainParticipant {
    let domain = 100 + (std::process::id() % 100) as u16;
    DomainParticipantBuilder::new(domain)
        .with_only_networks([IpAddr::V4(Ipv4Addr::LOCALHOST)])
        .build()
        .expect("a participant")
}

/// How often this participant hears of a writer on the topic within `time`, or up to `enough` times.
fn heard(participant: &DomainParticipant, topic: &str, time: Duration, enough: usize) -> usize {
    let events = participant.status_listener();
    let end = Instant::now() + time;
    let mut heard = 0;
    while Instant::now() < end && heard < enough {
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
    let second = Duration::from_secs(1);
    let speaker = participant();
    let topic =
        speaker.create_topic(name.clone(), "Kind".to_owned(), &qos, TopicKind::NoKey).expect("a topic");
    let publisher = speaker.create_publisher(&qos).expect("a publisher");
    let _writer = publisher.create_datawriter_no_key_cdr::<u8>(&topic, None).expect("a writer");

    let listener = participant();
    assert!(heard(&listener, &name, PATIENCE, 1) > 0, "not announced");
    let mut others = Vec::new();
    for _ in 0..3 {
        // One announcement is told once or twice.
        heard(&listener, &name, second, usize::MAX);
        others.push(participant());
        assert!(heard(&listener, &name, PATIENCE, 1) > 0, "not announced again");
    }

    // Who comes late hears what holds now, not all the four that were said before.
    let late = (0..3).find(|_| {
        sleep(CLEARED);
        let late = participant();
        let first = heard(&late, &name, PATIENCE, 1);
        let all = first + heard(&late, &name, second, usize::MAX);
        others.push(late);
        (1..4).contains(&all)
    });
    assert!(late.is_some(), "what was said before is not forgotten");
}
