//! The bytes of every message in both wire formats: equal to those of another implementation, lossless, and safe
//! against input that is not a message.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test, in helpers too")]

#[macro_use]
#[path = "wire/every_type.rs"]
mod every_type;
#[path = "wire/random.rs"]
mod random;

use std::collections::BTreeMap;

use proptest::prelude::*;
use random::Random;
use roscausal_msgs::*;

fn random_message<M: Message>(seed: u64) -> M {
    M::deserialize(&mut Random(seed)).unwrap()
}

fn round_trips<M: Message>(seed: u64) {
    let message: M = random_message(seed);
    let (ros1_bytes, cdr_bytes) = (ros1::to_bytes(&message, 77).unwrap(), cdr::to_bytes(&message).unwrap());
    let (from_ros1, seq) = ros1::from_bytes::<M>(&ros1_bytes).unwrap();
    let from_cdr: M = cdr::from_bytes(&cdr_bytes).unwrap();
    // Compared by bytes, because NaN is not equal to itself.
    for decoded in [&from_ros1, &from_cdr] {
        assert_eq!(ros1::to_bytes(decoded, 77).unwrap(), ros1_bytes, "{}", M::type_name());
        assert_eq!(cdr::to_bytes(decoded).unwrap(), cdr_bytes, "{}", M::type_name());
    }
    if let Some(seq) = seq {
        assert_eq!(seq, 77, "{}", M::type_name());
    }
}

/// Cutting the bytes anywhere, or changing any byte, gives a message or an error, never a panic.
fn survives_damage<M: Message>(seed: u64) {
    let mut random = Random(seed);
    let message: M = random_message(seed);
    for mut bytes in [ros1::to_bytes(&message, 1).unwrap(), cdr::to_bytes(&message).unwrap()] {
        for _ in 0..4 {
            let cut = random.below(bytes.len() as u64 + 1) as usize;
            let _ = ros1::from_bytes::<M>(&bytes[..cut]);
            let _ = cdr::from_bytes::<M>(&bytes[..cut]);
        }
        if !bytes.is_empty() {
            let place = random.below(bytes.len() as u64) as usize;
            bytes[place] = random.next() as u8;
            let _ = ros1::from_bytes::<M>(&bytes);
            let _ = cdr::from_bytes::<M>(&bytes);
        }
    }
}

fn decodes_or_errs<M: Message>(bytes: &[u8]) {
    let _ = ros1::from_bytes::<M>(bytes);
    let _ = cdr::from_bytes::<M>(bytes);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn random_messages_round_trip_on_both_wires(seed: u64) {
        for_every_type!(round_trips(seed));
    }

    #[test]
    fn damaged_messages_never_panic(seed: u64) {
        for_every_type!(survives_damage(seed));
    }

    #[test]
    fn random_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        for_every_type!(decodes_or_errs(&bytes));
        let mut cdr_bytes = vec![0, 1, 0, 0];
        cdr_bytes.extend(&bytes);
        for_every_type!(decodes_or_errs(&cdr_bytes));
    }
}

fn unhex(hex: &str) -> Vec<u8> {
    (0..hex.len()).step_by(2).map(|at| u8::from_str_radix(&hex[at..at + 2], 16).unwrap()).collect()
}

/// `type -> [ros1, little endian CDR, big endian CDR]`.
fn goldens() -> BTreeMap<&'static str, [Vec<u8>; 3]> {
    let mut lines = include_str!("wire/goldens.txt").lines().filter(|line| !line.starts_with('#'));
    let mut goldens = BTreeMap::new();
    while let Some(name) = lines.next() {
        let bytes = ["ros1", "le", "be"].map(|wire| {
            let (found, hex) = lines.next().unwrap().trim().split_once(' ').unwrap();
            assert_eq!(found, wire);
            unhex(hex)
        });
        goldens.insert(name, bytes);
    }
    goldens
}

fn equals_golden<M: Message + PartialEq>(message: &M, seq: u32) {
    let goldens = goldens();
    let [ros1_bytes, little, big] = &goldens[M::type_name().as_str()];
    assert_eq!(cdr::to_bytes(message).unwrap(), *little);
    assert_eq!(cdr::from_bytes::<M>(little).unwrap(), *message);
    assert_eq!(cdr::from_bytes::<M>(big).unwrap(), *message);
    let (decoded, first_seq) = ros1::from_bytes::<M>(ros1_bytes).unwrap();
    assert_eq!(decoded, *message);
    assert_eq!(ros1::to_bytes(message, seq).unwrap(), *ros1_bytes);
    assert_eq!(first_seq.unwrap_or(0), seq);
}

fn header(sec: i32, nanosec: u32, frame: &str) -> std_msgs::Header {
    std_msgs::Header { stamp: Time { sec, nanosec }, frame_id: frame.to_owned() }
}

#[test]
fn bytes_are_those_of_another_implementation() {
    use geometry_msgs::{Point, Pose2D, Twist, Vector3};
    let human = HumanState {
        header: header(1, 5, "map"),
        id: 1000,
        pose2d: Pose2D { x: 1.5, y: -2.0, theta: 0.25 },
        twist: Twist {
            linear: Vector3 { x: 0.5, ..Vector3::default() },
            angular: Vector3 { z: -1.0, ..Vector3::default() },
        },
        goal: Point { x: 3.0, y: 4.0, z: 0.0 },
    };
    equals_golden(&Humans { header: header(7, 8, "m"), humans: vec![human] }, 9);

    let dim = |label: &str, size| std_msgs::MultiArrayDimension { label: label.to_owned(), size, stride: 2 };
    let layout = std_msgs::MultiArrayLayout { dim: vec![dim("lag", 1), dim("target", 2)], data_offset: 0 };
    let empty = std_msgs::MultiArrayLayout { dim: Vec::new(), data_offset: 3 };
    let model = CausalModel {
        header: header(-1, 999_999_999, ""),
        features: vec!["h_v".to_owned(), "é".to_owned()],
        causal_structure: std_msgs::Int32MultiArray { layout: layout.clone(), data: vec![1, -2] },
        val_matrix: std_msgs::Float32MultiArray { layout, data: vec![0.5, -1.0] },
        pval_matrix: std_msgs::Float32MultiArray { layout: empty, data: Vec::new() },
        original_shape: vec![1, 2, 2],
    };
    equals_golden(&model, u32::MAX);

    let image = sensor_msgs::Image {
        header: header(2, 3, "c"),
        height: 1,
        width: 2,
        encoding: "rgb8".to_owned(),
        is_bigendian: 0,
        step: 6,
        data: (1..7).collect(),
    };
    equals_golden(&image, 1);

    let person = people_msgs::Person {
        name: "a".to_owned(),
        position: Point { x: 1.0, y: 2.0, z: 3.0 },
        velocity: Point::default(),
        reliability: 0.5,
        tagnames: vec!["t".to_owned()],
        tags: vec![String::new(), "u".to_owned()],
    };
    equals_golden(&person, 0);
    let change = ModelChange {
        id: "change-1".to_owned(),
        status: ModelChange::CONFIRMED,
        kind: "vanished".to_owned(),
        cause: "h_dg".to_owned(),
        effect: "h_v".to_owned(),
        lag: 2,
        before: 0.5,
        after: -0.25,
        p_value: 1e-9,
        told: Time { sec: 5, nanosec: 6 },
        changed_from: Time { sec: 3, nanosec: 4 },
        changed_to: Time { sec: 4, nanosec: 7 },
        batch_id: "data_1".to_owned(),
        description: "é".to_owned(),
    };
    let regime_since = Time { sec: 2, nanosec: 1 };
    equals_golden(
        &ModelChanges { header: header(8, 9, "map"), regime_since, batches: 3, changes: vec![change] },
        4,
    );
    equals_golden(&rosgraph_msgs::Clock { clock: Time { sec: 1, nanosec: 2 } }, 0);
    let position = Point { x: 1.0, ..Point::default() };
    equals_golden(&pedsim_msgs::Waypoint { name: "w".to_owned(), behavior: -1, position, radius: 0.5 }, 0);
}

#[test]
fn only_the_first_header_gets_the_seq() {
    let goal = move_base_msgs::MoveBaseActionGoal::default();
    let bytes = ros1::to_bytes(&goal, 0xdead_beef).unwrap();
    assert_eq!(bytes[..4], 0xdead_beef_u32.to_le_bytes());
    assert_eq!(bytes.windows(4).filter(|window| **window == 0xdead_beef_u32.to_le_bytes()).count(), 1);
    assert_eq!(ros1::from_bytes::<move_base_msgs::MoveBaseActionGoal>(&bytes).unwrap().1, Some(0xdead_beef));
}

#[test]
fn a_hostile_length_is_an_error_with_its_place() {
    let bytes = [0xff; 4];
    let error = ros1::from_bytes::<std_msgs::String>(&bytes).unwrap_err();
    assert_eq!(error.fault, Fault::Length { offset: 0, length: u32::MAX, left: 0 });
    assert!(error.to_string().starts_with("std_msgs/String: a length of 4294967295 at byte 0"), "{error}");
    let mut people = ros1::to_bytes(&people_msgs::People::default(), 0).unwrap();
    let end = people.len();
    people[end - 4..].copy_from_slice(&0x4000_0000_u32.to_le_bytes());
    let error = ros1::from_bytes::<people_msgs::People>(&people).unwrap_err();
    assert_eq!(error.fault, Fault::Length { offset: end - 4, length: 0x4000_0000, left: 0 });
}

#[test]
fn bytes_after_the_message_are_an_error() {
    let clock = rosgraph_msgs::Clock::default();
    let mut bytes = ros1::to_bytes(&clock, 0).unwrap();
    bytes.push(0);
    assert_eq!(
        ros1::from_bytes::<rosgraph_msgs::Clock>(&bytes).unwrap_err().fault,
        Fault::Trailing { left: 1 }
    );
    let mut bytes = cdr::to_bytes(&clock).unwrap();
    bytes.extend([0; 3]);
    assert_eq!(cdr::from_bytes::<rosgraph_msgs::Clock>(&bytes).unwrap(), clock);
    bytes.push(0);
    assert_eq!(
        cdr::from_bytes::<rosgraph_msgs::Clock>(&bytes).unwrap_err().fault,
        Fault::Trailing { left: 4 }
    );
}

#[test]
fn text_that_is_no_utf8_is_kept_as_far_as_possible() {
    let (message, _) = ros1::from_bytes::<std_msgs::String>(&[3, 0, 0, 0, b'a', 0xe9, b'b']).unwrap();
    assert_eq!(message.data, "a\u{fffd}b");
}

#[test]
fn an_unknown_representation_of_cdr_is_named() {
    let error = cdr::from_bytes::<rosgraph_msgs::Clock>(&[0, 3, 0, 0, 0, 0, 0, 0]).unwrap_err();
    assert_eq!(error.fault, Fault::Representation(3));
}
