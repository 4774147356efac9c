//! Hostile bytes for the decoders of both wire formats: no panic, and no memory for what a length field merely
//! claims.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test, in helpers too")]

#[macro_use]
#[path = "wire/every_type.rs"]
mod every_type;
#[path = "wire/random.rs"]
mod random;

use random::Random;
use roscausal_fuzz::{Allocator, Target};
use roscausal_msgs::*;

#[global_allocator]
static ALLOCATOR: Allocator = Allocator;

/// The codec of one type: reads the bytes of a message, and makes some.
struct Codec {
    read: fn(&[u8]),
    make: fn(u64) -> Vec<u8>,
}

fn ros1_codec<M: Message>(codecs: &mut Vec<Codec>) {
    codecs.push(Codec {
        read: |bytes| drop(ros1::from_bytes::<M>(bytes)),
        make: |seed| ros1::to_bytes(&M::deserialize(&mut Random(seed)).unwrap(), 1).unwrap(),
    });
}

fn cdr_codec<M: Message>(codecs: &mut Vec<Codec>) {
    codecs.push(Codec {
        read: |bytes| drop(cdr::from_bytes::<M>(bytes)),
        make: |seed| cdr::to_bytes(&M::deserialize(&mut Random(seed)).unwrap()).unwrap(),
    });
}

/// The first byte of an input selects its type.
fn run(wire: &str, codecs: &[Codec]) {
    let seeds = codecs
        .iter()
        .enumerate()
        .flat_map(|(i, codec)| (0..3).map(move |seed| [vec![i as u8], (codec.make)(seed)].concat()));
    let target = Target {
        corpus: format!("{}/tests/corpus/{wire}", env!("CARGO_MANIFEST_DIR")).into(),
        seeds: seeds.collect(),
        tokens: &[b"\xff\xff\xff\xff", b"\x00\x00\x00\x80", b"\x00\x00\x00\x01"],
        // The worst ratio of memory to bytes on the wire: markers with empty lists.
        bytes_per_byte: 64,
    };
    target.run(|input| {
        if let Some((&first, bytes)) = input.split_first() {
            (codecs[usize::from(first) % codecs.len()].read)(bytes);
        }
    });
}

#[test]
fn hostile_bytes_of_ros1_neither_panic_nor_allocate_what_they_claim() {
    let mut codecs = Vec::new();
    for_every_type!(ros1_codec(&mut codecs));
    run("ros1", &codecs);
}

#[test]
fn hostile_bytes_of_ros2_neither_panic_nor_allocate_what_they_claim() {
    let mut codecs = Vec::new();
    for_every_type!(cdr_codec(&mut codecs));
    run("cdr", &codecs);
}
