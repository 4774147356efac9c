//! Hostile messages and definitions of people: no panic, no endless work, and no allocation that the bytes do not pay for.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]

use std::sync::Arc;

use roscausal_core::{
    Message,
    middleware::{Raw, RawType},
    people::Reader,
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
        let seen = reader().read(&Raw { kind, bytes: bytes.to_vec() });
        assert!(
            seen.people.iter().all(|(_, person)| person.pose.position.x.is_finite()),
            "a place is a number"
        );
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
