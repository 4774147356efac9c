//! Hostile recordings: no panic, no endless reading, and memory proportional to the file.

#![allow(clippy::expect_used, reason = "a test may panic: that is how it fails")]

#[path = "hostile/payload.rs"]
mod payload;

use std::{fs, path::Path};

use roscausal_fuzz::{Allocator, InputFile, Target};
use roscausal_recording::Recording;

#[global_allocator]
static ALLOCATOR: Allocator = Allocator;

/// A recording of `tests/data`.
fn data(name: &str) -> Vec<u8> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    fs::read(folder.join(name)).expect("a recording is missing")
}

fn run(name: &str, files: &[&str], tokens: &[&[u8]], bytes_per_byte: usize) {
    let seeds = files.iter().map(|file| data(file)).collect();
    target(name, seeds, tokens, bytes_per_byte, |input, read| read(input));
}

/// Runs a target that makes recordings of an input and reads them.
fn target(
    name: &str,
    seeds: Vec<Vec<u8>>,
    tokens: &[&[u8]],
    bytes_per_byte: usize,
    decode: impl Fn(&[u8], &dyn Fn(&[u8])),
) {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus").join(name);
    let file = InputFile::new().expect("a temporary file");
    let target = Target { corpus, seeds, tokens, bytes_per_byte };
    target.run(|input| decode(input, &|bytes| read(file.with(bytes).expect("the file is written"))));
}

fn read(path: &Path) {
    let _ = roscausal_recording::settings(path);
    let Ok(mut recording) = Recording::open(path) else { return };
    let _ = recording.span();
    let topics = recording.topics().to_vec();
    for record in recording.by_ref() {
        let topic = &topics[record.topic];
        let _ = topic.decode::<roscausal_msgs::nav_msgs::Odometry>(&record.bytes);
        let _ = topic.decode::<roscausal_msgs::people_msgs::People>(&record.bytes);
    }
    assert!(recording.losses().iter().all(|loss| !loss.is_empty()));
}

#[test]
fn a_hostile_bag_is_refused_or_read_as_far_as_it_is_whole() {
    let tokens: [&[u8]; 7] = [
        b"op=\x05", b"conn=", b"time=", b"chunk_pos=", b"size=\xff\xff\xff\xff", b"compression=",
        b"\xff\xff\xff\xff",
    ];
    run("bag", &["plain.bag"], &tokens, 64);
}

#[test]
fn a_hostile_compressed_bag_is_refused_or_read_as_far_as_it_is_whole() {
    // Compressed data may legitimately expand a thousand times.
    run("bag_compressed", &["lz4.bag", "bz2.bag"], &[b"size=\xff\xff\xff\x3f", b"compression=none"], 20_000);
}

#[test]
fn a_hostile_mcap_file_is_refused_or_read_as_far_as_it_is_whole() {
    let tokens: [&[u8]; 7] = [
        b"\x89MCAP0\r\n",
        b"\xff\xff\xff\xff\xff\xff\xff\xff",
        b"\x06",
        b"\x05",
        b"zstd",
        b"lz4",
        b"\x02\x14\0\0\0\0\0\0\0",
    ];
    run("mcap", &["ros2_plain.mcap", "unchunked.mcap"], &tokens, 64);
}

#[test]
fn a_hostile_compressed_mcap_file_is_refused_or_read_as_far_as_it_is_whole() {
    run(
        "mcap_compressed",
        &["ros1_zstd.mcap", "ros2_lz4.mcap"],
        &[b"zstd", b"lz4", b"\0\0\0\0\0\0\0\0"],
        20_000,
    );
}

#[test]
fn a_hostile_database_is_refused_or_read_as_far_as_it_is_whole() {
    let tokens: [&[u8]; 6] =
        [b"CREATE VIEW ", b"CREATE TABLE ", b"messages", b"topics", b"\x0d\0\0\0", b"\xff\xff\xff\xff"];
    run("db3", &["ros2_db3/ros2_db3.db3"], &tokens, 64);
}

#[test]
fn a_hostile_compressed_file_is_refused_or_read_as_far_as_it_is_whole() {
    let files =
        ["ros2_mcap_by_file/ros2_mcap_by_file.mcap.zstd", "ros2_mcap_by_message/ros2_mcap_by_message.mcap"];
    run("packed", &files, &[b"\x28\xb5\x2f\xfd", b"\xff\xff\xff\xff"], 20_000);
}
