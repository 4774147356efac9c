//! One damaged chunk costs its own messages alone, with an index and without one.
#![allow(clippy::unwrap_used, clippy::indexing_slicing, reason = "a test may panic: that is how it fails")]

use std::{fs, path::Path};

use roscausal_recording::Recording;

/// Offset, length of the header before the data, and length of the data of each chunk.
fn chunks(file: &str, bytes: &[u8]) -> Vec<(usize, usize, usize)> {
    let number = |at: usize, size: usize| {
        bytes[at..at + size].iter().rev().fold(0, |value, byte| value << 8 | usize::from(*byte))
    };
    let (mut found, mut at) = (Vec::new(), if file.ends_with(".bag") { 13 } else { 8 });
    while at + 9 < bytes.len() {
        let (is_chunk, header, data) = if file.ends_with(".bag") {
            let header = number(at, 4);
            let is_chunk = bytes[at + 4..at + 4 + header].windows(4).any(|field| field == b"op=\x05");
            (is_chunk, 8 + header, number(at + 4 + header, 4))
        } else {
            (bytes[at] == 6, 9, number(at + 1, 8))
        };
        if is_chunk {
            found.push((at, header, data));
        }
        at += header + data;
    }
    found
}

/// The same file as if its recorder had been killed after the last chunk.
fn unclosed(file: &str, bytes: &[u8]) -> Vec<u8> {
    let (at, header, data) = *chunks(file, bytes).last().unwrap();
    let mut cut = bytes[..at + header + data].to_vec();
    if let Some(place) = bytes.windows(10).position(|window| window == b"index_pos=") {
        cut[place + 10..place + 18].fill(0);
    }
    cut
}

fn messages(folder: &Path, bytes: &[u8]) -> (usize, Vec<String>) {
    let path = folder.join("file");
    fs::write(&path, bytes).unwrap();
    let mut recording = Recording::open(&path).unwrap();
    let count = recording.by_ref().count();
    (count, recording.losses().to_vec())
}

/// Messages in the chunk that begins at `at`: those that are lost without it.
fn in_chunk(folder: &Path, file: &str, bytes: &[u8], at: usize, end: usize) -> usize {
    let whole = unclosed(file, bytes);
    messages(folder, &whole).0 - messages(folder, &[&whole[..at], &whole[end..]].concat()).0
}

#[test]
fn a_damaged_chunk_costs_that_chunk_alone_wherever_the_damage_is() {
    let folder = tempfile::tempdir().unwrap();
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    for file in ["plain.bag", "lz4.bag", "bz2.bag", "ros1_zstd.mcap", "ros2_lz4.mcap", "ros2_plain.mcap"] {
        let bytes = fs::read(data.join(file)).unwrap();
        // The first chunk of an unclosed file is the only one that names the topics.
        for (at, header, length) in chunks(file, &bytes).into_iter().skip(1) {
            let of_chunk = in_chunk(folder.path(), file, &bytes, at, at + header + length);
            let is_bag = file.ends_with(".bag");
            let length_at = if is_bag { at + header - 4 } else { at + 1 };
            let name_at = at
                + bytes[at..]
                    .windows(3)
                    .position(|w| [b"lz4", b"bz2", b"zst"].contains(&w.try_into().unwrap()))
                    .unwrap_or(0);
            for whole in [bytes.clone(), unclosed(file, &bytes)] {
                let all = messages(folder.path(), &whole).0;
                let some_more = u32::try_from(length + length / 2 + 7).unwrap().to_le_bytes().to_vec();
                // Its data, its length, its compression, its first byte, and a length that reaches into the next chunk.
                for (place, damage) in [
                    (at + header + length / 2, vec![0xff; 16]),
                    (length_at, vec![0xff; 4]),
                    (name_at, vec![0xff; 3]),
                    (at, vec![0xff]),
                    (length_at, some_more),
                ] {
                    let is_plain = file.starts_with("plain") || file.starts_with("ros2_plain");
                    if place == name_at && is_plain {
                        continue;
                    }
                    let mut damaged = whole.clone();
                    damaged[place..place + damage.len()].copy_from_slice(&damage);
                    let (kept, losses) = messages(folder.path(), &damaged);
                    let what =
                        format!("{file}, chunk at {at}, damage at {place}: {kept} of {all}, {losses:?}");
                    assert!(kept >= all - of_chunk && kept <= all, "{what}");
                    // Without compression a bag has no checksums, and an index may say what a chunk's header lacks.
                    assert!(!losses.is_empty() || kept == all, "{what}");
                }
            }
        }
    }
}

#[test]
fn topics_that_a_lost_chunk_defined_are_found_in_the_summary() {
    let folder = tempfile::tempdir().unwrap();
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    for (file, end) in [("lz4.bag", 11056), ("ros1_zstd.mcap", 6473), ("ros2_plain.mcap", 18722)] {
        let bytes = fs::read(data.join(file)).unwrap();
        let (at, header, length) = chunks(file, &bytes)[0];
        let of_chunk = in_chunk(folder.path(), file, &bytes, at, at + header + length);
        assert!(of_chunk > 0);
        let all = messages(folder.path(), &bytes).0;
        let mut damaged = bytes.clone();
        // The first chunk, and the index.
        damaged[at + header + 40..at + header + 60].fill(0xff);
        damaged[end..end + 8].fill(0xff);
        let (kept, losses) = messages(folder.path(), &damaged);
        assert!(kept >= 6 && kept < all && !losses.is_empty(), "{file}: {kept} of {all}: {losses:?}");
    }
}
