//! Hostile messages and definitions of people: no panic, no endless work, and no allocation that the bytes do not pay for.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]

use std::sync::Arc;

use roscausal_core::{
    Message,
    middleware::{Raw, RawType},
    people::{Reader, Tracker},
    state::{human::PeopleTracker, identity::Who},
};
use roscausal_fuzz::{Allocator, Target};
use roscausal_msgs::{
    cdr,
    dynamic::Wire,
    geometry_msgs::{Pose, PoseArray},
    people_msgs::{People, Person},
    ros1,
    visualization_msgs::{Marker, MarkerArray},
};

#[global_allocator]
static ALLOCATOR: Allocator = Allocator;

fn raw<M: Message>(message: &M, wire: Wire) -> Raw {
    let (definition, bytes) = match wire {
        Wire::Ros1 => (M::ros1_definition(), ros1::to_bytes(message, 0).expect("encodes")),
        Wire::Cdr => (M::definition().ros2_definition(), cdr::to_bytes(message).expect("encodes")),
    };
    let kind = RawType { type_name: M::type_name(), definition: definition.to_owned(), wire };
    Raw { kind: Arc::new(kind), bytes }
}

fn messages() -> Vec<Raw> {
    let poses = PoseArray { poses: vec![Pose::default(); 3], ..PoseArray::default() };
    let marker = Marker { ns: "people".into(), id: 4, ..Marker::default() };
    let markers = MarkerArray { markers: vec![marker; 2] };
    let person = Person { name: "anna".into(), tags: vec!["far".into()], ..Person::default() };
    let people = People { people: vec![person; 2], ..People::default() };
    let both = [Wire::Ros1, Wire::Cdr];
    both.iter()
        .flat_map(|wire| [raw(&poses, *wire), raw(&people, *wire)])
        .chain([raw(&markers, Wire::Ros1)])
        .collect()
}

fn reader() -> Reader {
    Reader::new("/people", &["person".to_owned(), "people".to_owned()], Arc::default())
}

fn target(corpus: &str, seeds: Vec<Vec<u8>>) -> Target<'static> {
    Target {
        corpus: format!("{}/tests/corpus/{corpus}", env!("CARGO_MANIFEST_DIR")).into(),
        seeds,
        tokens: &[
            b"[]", b"[4294967295]", b"\xff\xff\xff\xff", b"===\nMSG: ", b"string ", b"float64[3] ", b"\n",
        ],
        bytes_per_byte: 1000,
    }
}

#[test]
fn hostile_bytes_of_people_neither_panic_nor_allocate_what_they_claim() {
    let known = messages();
    let seeds =
        known.iter().enumerate().map(|(place, message)| [&[place as u8], &message.bytes[..]].concat());
    target("people", seeds.collect()).run(|input| {
        let Some((place, bytes)) = input.split_first() else { return };
        let kind = known[usize::from(*place) % known.len()].kind.clone();
        reader().read(&Raw { kind, bytes: bytes.to_vec() });
    });
}

/// A tracker of places in millimetres, with things that are not people.
const BY_HAND: &str = "/people.people[*] -> id=name, x=position.x * 1 mm, y=min(position.y, 9e9) * 1 mm, only=reliability > 0.5";

#[test]
fn people_of_any_message_are_read_by_expressions_of_either_wire() {
    let person = |name: &str, x: f64, reliability: f64| {
        let mut person = Person { name: name.into(), reliability, ..Person::default() };
        (person.position.x, person.position.y) = (x, 500.0);
        person
    };
    let people =
        People { people: vec![person("anna", 1500.0, 0.9), person("chair", 7.0, 0.1)], ..People::default() };
    for wire in [Wire::Ros1, Wire::Cdr] {
        let trackers = Tracker::all(BY_HAND).expect("one");
        let seen = Reader::new(trackers[0].clone(), &[], Arc::default()).read(&raw(&people, wire));
        let [(who, sighting)] = &seen.people[..] else { panic!("{seen:?}") };
        assert_eq!(*who, Who::Name("anna".into()));
        assert_eq!((sighting.pose.position.x, sighting.pose.position.y), (1.5, 0.5));
        assert_eq!(sighting.twist, None, "its velocity follows from places");
        let tracker = Tracker::all("/people.people[*] -> x=place.x, y=place.y").expect("one");
        let refused = Reader::new(tracker[0].clone(), &[], Arc::default()).check(&raw(&people, wire).kind);
        assert!(
            refused.is_err_and(|reason| reason.contains("place")),
            "the field that is not there is named"
        );
    }
}

#[test]
fn people_whose_place_is_not_a_number_are_counted() {
    let anna = Person { name: "anna".into(), ..Person::default() };
    let mut lost = Person { name: "berta".into(), ..Person::default() };
    lost.position.x = f64::NAN;
    let seen = reader().read(&raw(&People { people: vec![anna, lost], ..People::default() }, Wire::Cdr));
    let mut tracker = PeopleTracker::new("", "", 1.0);
    tracker.message(seen.stamp, seen.people);
    assert_eq!((tracker.people(|_| None).humans.len(), tracker.not_finite), (1, 1));
}

#[test]
fn hostile_expressions_of_people_are_refused_or_read() {
    let message = raw(&People { people: vec![Person::default(); 2], ..People::default() }, Wire::Cdr);
    target("people_by_hand", vec![BY_HAND.as_bytes().to_vec()]).run(|input| {
        let Ok(trackers) = Tracker::all(&String::from_utf8_lossy(input)) else { return };
        for tracker in trackers {
            let _ = Reader::new(tracker, &[], Arc::default()).read(&message);
        }
    });
}

#[test]
fn a_hostile_definition_of_people_neither_panics_nor_allocates_what_it_claims() {
    let known = messages();
    let seeds: Vec<Vec<u8>> =
        known.iter().map(|message| message.kind.definition.clone().into_bytes()).collect();
    target("people_definition", seeds).run(|input| {
        let definition = String::from_utf8_lossy(input).into_owned();
        for message in &known {
            let RawType { type_name, wire, .. } = (*message.kind).clone();
            let kind = Arc::new(RawType { type_name, definition: definition.clone(), wire });
            reader().read(&Raw { kind, bytes: message.bytes.clone() });
        }
    });
}
