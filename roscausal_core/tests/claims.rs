//! Files that claim more than they hold, or unpack to more than data do: each is one sentence, and takes memory by what was read.

#![allow(clippy::expect_used, clippy::panic, reason = "a test may panic: that is how it fails")]

use std::{
    io::{Cursor, Write},
    path::Path,
};

use roscausal_core::{
    batch::{
        Table,
        table::{Reading, Steps},
        trajectories::{TrajectoryChoice, TrajectoryReading, walks},
    },
    nodes,
};
use roscausal_fuzz::{Allocator, peak_of};

#[global_allocator]
static ALLOCATOR: Allocator = Allocator;

/// What reading may take, bytes; growing lists double.
const LIMIT: u64 = 4_000_000;
const MOST_HELD: usize = 4 * LIMIT as usize;

fn npy(kind: &str, shape: &str, values: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': {kind}, 'fortran_order': True, 'shape': {shape}, }}\n");
    let length = u16::try_from(header.len()).expect("short").to_le_bytes();
    [b"\x93NUMPY\x01\x00", &length[..], header.as_bytes(), values].concat()
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut packer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    packer.write_all(bytes).expect("packs");
    packer.finish().expect("packs")
}

fn zstandard(bytes: &[u8]) -> Vec<u8> {
    zstd::encode_all(bytes, 3).expect("packs")
}

/// An archive whose central directory names the same packed array many times.
fn overlapping(array: &[u8], count: u16) -> Vec<u8> {
    let mut one = zip::ZipWriter::new(Cursor::new(Vec::new()));
    one.start_file("a0000.npy", zip::write::SimpleFileOptions::default()).expect("begins");
    one.write_all(array).expect("packs");
    let one = one.finish().expect("packs").into_inner();
    let at = |mark: &[u8]| one.windows(4).rposition(|four| four == mark).expect("is there");
    let (entries, end) = (at(b"PK\x01\x02"), at(b"PK\x05\x06"));
    let mut many = one[..entries].to_vec();
    for number in 0..count {
        let mut entry = one[entries..end].to_vec();
        entry[46..55].copy_from_slice(format!("a{number:04}.npy").as_bytes());
        many.extend(entry);
    }
    let length = u32::try_from(many.len() - entries).expect("short").to_le_bytes();
    let mut last = one[end..].to_vec();
    last[8..10].copy_from_slice(&count.to_le_bytes());
    last[10..12].copy_from_slice(&count.to_le_bytes());
    last[12..16].copy_from_slice(&length);
    [many, last].concat()
}

/// The file, what its sentence says, and the file's content.
fn cases() -> Vec<(&'static str, &'static str, Vec<u8>)> {
    let huge = "(4611686018427387904, 4611686018427387904)";
    let rows = |count: usize| [&b"a,b\n"[..], &b"0,0\n".repeat(count)].concat();
    let names = |count: usize| (0..count).map(|place| format!("c{place},")).collect::<String>().into_bytes();
    let frame = |descriptor: &[u8]| [b"\x28\xb5\x2f\xfd", descriptor, b"\x01\x00\x00"].concat();
    let long_header = [&b"\x93NUMPY\x02\x00\xff\xff\xff\xff"[..], &[b' '; 90]].concat();
    vec![
        ("huge.npy", "cut off", npy("'<f8'", huge, &[0; 64])),
        ("no_rows.npy", "no rows", npy("'<f8'", "(0, 1099511627776)", &[])),
        ("no_columns.npy", "no columns", npy("'<f8'", "(1099511627776, 0)", &[])),
        ("no_shape.npy", "of shape []", npy("'<f8'", "()", &[0; 8])),
        ("negative.npy", "not understood", npy("'<f8'", "(-1, 2)", &[0; 64])),
        ("no_size.npy", "not read", npy("'|S0'", "(1099511627776,)", &[])),
        ("large_size.npy", "not read", npy("'|S2147483648'", "(1,)", &[0; 64])),
        ("no_size_fields.npy", "not read", npy("[('a', '|S0'), ('b', '|S0')]", "(99999999,)", &[])),
        ("objects.npy", "not read", npy("'|O'", "(3,)", &[0; 64])),
        ("header.npy", "claims 4294967295 bytes", long_header),
        ("wide.npy", "200000 columns", npy("'|b1'", "(1, 200000)", &[0; 200_000])),
        ("words.npy", "max_memory", npy("'|S1'", "(500000,)", &[b'a'; 500_000])),
        ("bomb.npz", "max_memory", overlapping(&npy("'|b1'", "(9000000,)", &vec![0; 9_000_000]), 1)),
        ("overlap.npz", "max_memory", overlapping(&npy("'|b1'", "(90000,)", &vec![0; 90_000]), 900)),
        ("bomb.csv.gz", "compressed with gzip: reading it takes more than 4 MB", gzip(&rows(5_000_000))),
        ("twice.csv.gz", "compressed with gzip", gzip(&gzip(&rows(9)))),
        ("bomb.csv.zst", "compressed with Zstandard: reading it takes more", zstandard(&rows(5_000_000))),
        ("window.csv.zst", "damaged", frame(&[0x00, (31 - 10) << 3])),
        ("size.csv.zst", "Zstandard", frame(&[0xe0, 0, 0, 0, 0, 0, 0, 0, 0x40])),
        ("names.csv", "at most 100000", [names(120_000), b"\n1\n".to_vec()].concat()),
        ("rows.csv", "max_memory", rows(900_000)),
        ("short_rows.csv", "has 1 cells", [names(9000), b"\n".to_vec(), b"1\n".repeat(9000)].concat()),
        ("name.csv", "the name is 100000 bytes long", [&[b'n'; 100_000][..], b",b\n1,2\n3,4\n"].concat()),
        ("line.csv", "max_memory", [&[b'n'; 1_900_000][..], b",b\n1,2\n3,4\n"].concat()),
        ("quote.csv", "is not a number", [&b"a,b\n1,2\n3,\"4\n"[..], &b"5,6\n".repeat(99_000)].concat()),
        ("infinite.csv", "'9999999999999999999999999999999999999999' is infinite", {
            [&b"a,b\n1,2\n3,"[..], &[b'9'; 500_000], b"\n"].concat()
        }),
        ("endless.csv", "cells", [&b"a,b\n"[..], &[b'1'; 900_000]].concat()),
    ]
}

#[test]
fn a_claim_takes_no_memory_and_is_told_in_one_sentence() {
    let dir = tempfile::tempdir().expect("a folder");
    let reading = Reading { max_memory: Some(LIMIT), ..Reading::default() };
    for (name, reported, content) in cases() {
        let path = dir.path().join(name);
        std::fs::write(&path, &content).expect("writes");
        assert!(content.len() < LIMIT as usize, "{name}: the file itself would be too long");
        let (read, held) = peak_of(|| Table::read_as(&path, &reading).map_err(|error| error.to_string()));
        let error = read.expect_err(name);
        assert!(error.contains(reported), "{name}: {error}");
        assert!(error.len() < 600 && !error.trim().contains('\n'), "{name}: {} bytes", error.len());
        assert!(held < MOST_HELD, "{name}: {held} bytes for {}", content.len());
    }
}

#[test]
fn rows_shorter_than_the_header_take_memory_within_the_limit() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("walk.csv");
    let names: String = (0..5000).map(|place| format!(",c{place}")).collect();
    std::fs::write(&path, format!("id,time,x,y{names}\n{}", "1\n".repeat(90_000))).expect("writes");
    let reading = TrajectoryReading { max_memory: Some(LIMIT), ..TrajectoryReading::default() };
    let choice =
        TrajectoryChoice { who: "all".into(), obstacle: None, dt: None, max_gap: None, least_rows: 1 };
    let usual = nodes::postprocess(&[]).expect("defaults");
    let (read, held) = peak_of(|| walks(&path, &reading, &choice, &usual).map(drop));
    let error = read.expect_err("too large").to_string();
    assert!(error.contains("max_memory") && held < 8 * MOST_HELD, "{held}: {error}");
}

#[test]
fn a_step_far_below_that_of_the_samples_takes_no_memory() {
    let table =
        Table::from_bytes(b"time_s,a,b\n0,1,2\n10000000,2,1\n", None, Path::new("t.csv")).expect("reads");
    let steps = Steps { dt: Some(0.01), max_memory: Some(LIMIT), ..Steps::default() };
    let (read, held) = peak_of(|| table.at_even_steps(&steps));
    let error = read.map(|tables| tables[0].values.nrows()).expect_err("too many rows");
    assert!(error.contains("give a longer step") && held < MOST_HELD, "{held}: {error}");
}

#[test]
fn honest_files_are_read_within_a_limit_in_proportion() {
    let dir = tempfile::tempdir().expect("a folder");
    let rows: String = (0..10_000).map(|row| format!("{}.5,{row},{}\n", row, row % 7)).collect();
    let text = format!("time,a,b\n{rows}");
    let array: Vec<u8> = (0..20_000).flat_map(|value| f64::from(value).to_le_bytes()).collect();
    for (name, content) in [
        ("plain.csv", text.clone().into_bytes()),
        ("packed.csv.gz", gzip(text.as_bytes())),
        ("packed.csv.zst", zstandard(text.as_bytes())),
        ("members.csv.gz", [gzip(b"time,a,b\n"), gzip(rows.as_bytes())].concat()),
        ("constant.csv.zst", zstandard(&[&b"a,b\n"[..], &b"0,0\n".repeat(100_000)].concat())),
        ("array.npy", npy("'<f8'", "(10000, 2)", &array)),
        ("array.npz", overlapping(&npy("'<f8'", "(10000, 2)", &array), 1)),
    ] {
        let path = dir.path().join(name);
        std::fs::write(&path, content).expect("writes");
        let reading = Reading { max_memory: Some(LIMIT), ..Reading::default() };
        let table = Table::read_as(&path, &reading).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(table.values.ncols() == 2 && table.values.nrows() >= 10_000, "{name}");
    }
}
