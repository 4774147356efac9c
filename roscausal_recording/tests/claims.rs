//! Recordings that claim more than they hold, or unpack to more than recordings do: memory follows what was read.

#![allow(clippy::expect_used, reason = "a test may panic: that is how it fails")]

use std::{io::Write, path::Path};

use roscausal_core::memory::{FREE, Memory};
use roscausal_fuzz::{Allocator, peak_of};
use roscausal_recording::Recording;

#[global_allocator]
static ALLOCATOR: Allocator = Allocator;

/// A field of a bag's record.
fn field(name: &str, value: &[u8]) -> Vec<u8> {
    sized(&[name.as_bytes(), b"=", value].concat())
}

fn sized(bytes: &[u8]) -> Vec<u8> {
    [&u32::try_from(bytes.len()).expect("short").to_le_bytes()[..], bytes].concat()
}

fn record(header: &[Vec<u8>], data: &[u8]) -> Vec<u8> {
    [sized(&header.concat()), sized(data)].concat()
}

/// A connection and a message of so many zeros, as in a chunk of a bag.
fn content(zeros: usize) -> Vec<u8> {
    let data = [
        field("type", b"std_msgs/String"),
        field("md5sum", b"992ce8a1687cec8c8bd883ec73ca41d1"),
        field("message_definition", b"string data\n"),
    ];
    let connection = [field("op", &[7]), field("conn", &[0; 4]), field("topic", b"/a")];
    let message = [field("op", &[2]), field("conn", &[0; 4]), field("time", &[1, 0, 0, 0, 0, 0, 0, 0])];
    [record(&connection, &data.concat()), record(&message, &sized(&vec![0; zeros]))].concat()
}

/// A bag without an index, of chunks that claim a size.
fn bag(chunks: &[(&[u8], &[u8], u32)]) -> Vec<u8> {
    let head = record(&[field("op", &[3]), field("index_pos", &[0; 8])], &[b' '; 64]);
    let chunk = |(data, compression, size): &(&[u8], &[u8], u32)| {
        record(
            &[field("op", &[5]), field("compression", compression), field("size", &size.to_le_bytes())],
            data,
        )
    };
    let chunks: Vec<u8> = chunks.iter().flat_map(chunk).collect();
    [b"#ROSBAG V2.0\n", &head[..], &chunks].concat()
}

fn mcap_record(opcode: u8, body: &[u8]) -> Vec<u8> {
    [&[opcode][..], &(body.len() as u64).to_le_bytes(), body].concat()
}

fn schema(text: &[u8]) -> Vec<u8> {
    mcap_record(3, &[&[1, 0][..], &sized(b"std_msgs/String"), &sized(b"ros1msg"), &sized(text)].concat())
}

fn channel(number: u16) -> Vec<u8> {
    let name = format!("/topic_{number}");
    let body = [&number.to_le_bytes()[..], &[1, 0], &sized(name.as_bytes()), &sized(b"ros1"), &[0; 4]];
    mcap_record(4, &body.concat())
}

fn message(bytes: &[u8]) -> Vec<u8> {
    message_at(9, bytes)
}

fn message_at(nanos: u8, bytes: &[u8]) -> Vec<u8> {
    let mut body = vec![0; 22];
    body[6] = nanos;
    body.extend(bytes);
    mcap_record(5, &body)
}

fn chunk(records: &[u8], claimed: u64) -> Vec<u8> {
    let packed = zstd::encode_all(records, 3).expect("packs");
    let times = [&0_u64.to_le_bytes()[..], &99_u64.to_le_bytes()].concat();
    let body =
        [&times[..], &claimed.to_le_bytes(), &[0; 4], &sized(b"zstd"), &(packed.len() as u64).to_le_bytes()];
    mcap_record(6, &[&body.concat()[..], &packed].concat())
}

/// An MCAP file without a summary.
fn mcap(records: &[u8]) -> Vec<u8> {
    const MAGIC: &[u8] = b"\x89MCAP0\r\n";
    let head = mcap_record(1, &[0; 8]);
    let end = [mcap_record(0x0f, &[0; 4]), mcap_record(2, &[0; 20])].concat();
    [MAGIC, &head, records, &end, MAGIC].concat()
}

fn bzip2(bytes: &[u8]) -> Vec<u8> {
    let mut packer = bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::best());
    packer.write_all(bytes).expect("packs");
    packer.finish().expect("packs")
}

/// Messages, what was told, and the most memory that was held.
fn read(path: &Path, content: &[u8], limit: u64) -> (usize, String, usize) {
    std::fs::write(path, content).expect("writes");
    let ((count, losses), held) = peak_of(|| {
        let mut recording = Recording::open(path).expect("opens").within(Memory::of(Some(limit)));
        let count = recording.by_ref().count();
        (count, recording.losses().join("; "))
    });
    (count, losses, held)
}

#[test]
fn chunks_that_claim_or_grow_too_much_are_left_out() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("recording");
    let zeros = content(20_000_000);
    let packed = bzip2(&zeros);
    let size = u32::try_from(zeros.len()).expect("short");
    let bombs = vec![(&packed[..], &b"bz2"[..], size); 40];
    let records = [schema(b"string data\n"), channel(0), message(&sized(&vec![0; 20_000_000]))].concat();
    let honest = [schema(b"string data\n"), channel(0), message(&sized(b"hello"))].concat();
    for (name, reported, file) in [
        ("a bag's chunk of 2 GB", "no valid size", bag(&[(&packed, b"bz2", 1 << 31)])),
        ("a bag's chunk of 1 GB", "no valid size", bag(&[(&packed, b"bz2", 1 << 30)])),
        ("chunks of a bag", "no valid size", bag(&bombs)),
        ("a chunk of 4 EB", "claims a size of", mcap(&chunk(&honest, 1 << 62))),
        (
            "chunks of an MCAP file",
            "claims a size of",
            mcap(&chunk(&records, records.len() as u64).repeat(40)),
        ),
    ] {
        let (count, losses, held) = read(&path, &file, u64::MAX);
        assert!(losses.contains(reported), "{name}: {losses}");
        assert!(count < 20 && held < 2 * FREE as usize, "{name}: {count} messages, {held} bytes");
        assert!(file.len() < 200_000, "{name}: {} bytes", file.len());
    }
    let (count, losses, held) = read(&path, &mcap(&chunk(&honest, honest.len() as u64)), u64::MAX);
    assert!(count == 1 && losses.is_empty() && held < 1 << 20, "{count}, {losses}, {held}");
}

#[test]
fn messages_that_wait_for_earlier_ones_stay_within_the_limit() {
    let dir = tempfile::tempdir().expect("a folder");
    let large = message(&sized(&vec![0; 1_000_000]));
    let records = [schema(b"string data\n"), channel(0), message_at(0, &sized(b"first")), large].concat();
    let file = mcap(&chunk(&records, records.len() as u64).repeat(60));
    let (count, losses, held) = read(&dir.path().join("a.mcap"), &file, 10_000_000);
    assert!(losses.contains("overlap in time") && (60..75).contains(&count), "{count}: {losses}");
    assert!(held < 30_000_000, "{held}");
}

#[test]
fn topics_of_one_type_share_its_definition() {
    let dir = tempfile::tempdir().expect("a folder");
    let text = [&b"# "[..], &[b'a'; 100_000], b"\nstring data\n"].concat();
    let channels: Vec<u8> = (0..2000).flat_map(channel).collect();
    let file = mcap(&[schema(&text), channels, message(&sized(b"hi"))].concat());
    let (count, _, held) = read(&dir.path().join("a.mcap"), &file, u64::MAX);
    assert!(count == 1 && held < 10_000_000, "{held} bytes for {}", file.len());
}
