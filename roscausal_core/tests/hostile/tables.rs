//! Hostile tables: NumPy, packed ones, tables of trajectories, what lies beside a batch.

use std::{
    fs,
    io::{Cursor, Write},
    path::Path,
};

use roscausal_core::batch::{
    Table,
    joint::{Joint, People},
    table::Reading,
    trajectories::{Agents, TrajectoryReading},
};

use roscausal_fuzz::InputFile;

use super::{run, shared_table};

const ARRAY: &[u8] = b"\x93NUMPY\x01\x00";
const TOKENS: [&[u8]; 12] = [
    b"'shape': (",
    b"'descr': ",
    b"'fortran_order': True",
    b"[('a', '<f8'), ('b', '<f8')]",
    b"'<U0'",
    b"'|S65536'",
    b"'<M8[ns]'",
    b"'<f2'",
    b"(0, 4294967296)",
    b"(4294967296, 0)",
    b"'",
    b", ",
];
/// Headers of each kind, each with the values of the second one behind a zero byte.
const HEADERS: [&str; 6] = [
    "{'descr': '<f8', 'fortran_order': False, 'shape': (4,), }\n",
    "{'descr': '>f4', 'fortran_order': True, 'shape': (4, 2), }\n",
    "{'descr': [('t', '<i8'), ('a', '|b1'), ('b', '<u2')], 'fortran_order': False, 'shape': (2,), }\n",
    "{'descr': '<U2', 'fortran_order': False, 'shape': (4,), }\n",
    "{'descr': '|S8', 'fortran_order': False, 'shape': (2, 2), }\n",
    "{'descr': '<M8[ms]', 'fortran_order': False, 'shape': (2, 1, 2), }\n",
];

fn read(bytes: &[u8]) {
    let path = Path::new("hostile");
    if let Ok(table) = Table::from_bytes(bytes, None, path) {
        assert!(table.values.iter().all(|v| !v.is_infinite()));
        assert!(table.time.as_ref().is_none_or(|time| time.len() == table.values.nrows()));
    }
}

/// An array whose header has the length that is written before it: what is up to the first zero byte; then the values.
fn array(input: &[u8]) -> Vec<u8> {
    let end = input.iter().position(|byte| *byte == 0).unwrap_or(input.len());
    let (header, values) = input.split_at(end);
    let header = &header[..header.len().min(usize::from(u16::MAX))];
    [ARRAY, &(header.len() as u16).to_le_bytes(), header, values.get(1..).unwrap_or_default()].concat()
}

fn headers() -> Vec<Vec<u8>> {
    HEADERS.iter().map(|header| [header.as_bytes(), &[0; 33]].concat()).collect()
}

/// A `.npz` file of these arrays, with checksums.
fn archive(arrays: &[&[u8]], method: zip::CompressionMethod) -> Vec<u8> {
    let mut writer = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (number, array) in arrays.iter().enumerate() {
        let options = zip::write::SimpleFileOptions::default().compression_method(method);
        writer.start_file(format!("a{number}.npy"), options).expect("a file begins");
        writer.write_all(array).expect("it is written");
    }
    writer.finish().expect("it ends").into_inner()
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut writer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    writer.write_all(bytes).expect("it is written");
    writer.finish().expect("it ends")
}

fn zstandard(bytes: &[u8]) -> Vec<u8> {
    zstd::encode_all(bytes, 1).expect("it is packed")
}

fn slices(inputs: &[Vec<u8>]) -> Vec<&[u8]> {
    inputs.iter().map(Vec::as_slice).collect()
}

#[test]
fn a_hostile_numpy_file_is_refused_or_read() {
    let fields = shared_table("fields.npy");
    let seeds: Vec<Vec<u8>> = headers().iter().map(|input| array(input)).chain([fields]).collect();
    run("npy", &slices(&seeds), &TOKENS, 200, read);
}

#[test]
fn a_hostile_numpy_header_of_the_right_length_is_refused_or_read() {
    run("npy_header", &slices(&headers()), &TOKENS, 200, |input| read(&array(input)));
}

#[test]
fn a_hostile_npz_file_is_refused_or_read() {
    let seeds = ["named.npz", "words.npz", "matrix.npz"].map(shared_table);
    let tokens: [&[u8]; 4] = [b"PK\x03\x04", b"PK\x01\x02", b"PK\x05\x06", b".npy"];
    // Deflated data may legitimately expand a thousand times, and a word of it takes more.
    run("npz", &slices(&seeds), &tokens, 20_000, read);
}

#[test]
fn hostile_arrays_in_a_whole_npz_file_are_refused_or_read() {
    let names = array(b"{'descr': '<U1', 'fortran_order': False, 'shape': (2,), }\n\0a\0\0\0b\0\0\0");
    run("npz_arrays", &slices(&headers()), &TOKENS, 1000, |input| {
        let array = array(input);
        read(&archive(&[&array], zip::CompressionMethod::Deflated));
        read(&archive(&[&names, &array, &array], zip::CompressionMethod::Stored));
    });
}

#[test]
fn a_hostile_packed_table_is_refused_or_read() {
    let table: &[u8] = b"time,a,b\n0,1,2\n0.1,1.5,2\n0.2,,nan\n";
    let seeds = [
        gzip(table),
        zstandard(table),
        gzip(&shared_table("plain.csv")),
        [gzip(table), gzip(table)].concat(),
    ];
    let file = InputFile::new().expect("a file");
    let tokens: [&[u8]; 3] = [b"\x1f\x8b\x08\x00", b"\x28\xb5\x2f\xfd", b"\xff\xff\xff\xff"];
    run("table_packed", &slices(&seeds), &tokens, 20_000, |input| read_file(&file, input));
}

#[test]
fn a_hostile_table_in_a_whole_packed_file_is_refused_or_read() {
    let seeds = [shared_table("plain.csv"), shared_table("fields.npy"), shared_table("named.npz")];
    let tokens: [&[u8]; 5] = [b",", b"\n", b"1e999", b"\xff\xfe", b"\x1f\x8b"];
    let file = InputFile::new().expect("a file");
    run("table_payload", &slices(&seeds), &tokens, 2000, |input| {
        read_file(&file, &gzip(input));
        read_file(&file, &zstandard(input));
    });
}

fn read_file(file: &InputFile, bytes: &[u8]) {
    let reading = Reading { encode: true, ..Reading::default() };
    if let Ok(table) = Table::read_as(file.with(bytes).expect("it is written"), &reading) {
        assert!(table.values.iter().all(|v| !v.is_infinite()));
    }
}

#[test]
fn a_hostile_table_of_trajectories_is_refused_or_read() {
    let seeds: [&[u8]; 4] = [
        b"frame id x y\n0 1 0.5 1\n10 1 0.6 1\n0 2 3 4\n10 2 3 4.5\n20 1 0.7 1\n",
        b"time,id,type,x,y,vx,vy,heading\n0,1,human,0,0,1,0,0\n0.1,1,human,0.1,0,1,0,0\n0,r,robot,2,2,0,0,1\n",
        b"0 1 0.5 1\n10 1 0.6 1\n20 1 0.7 1\n",
        b"t;agent;x_mm;y_mm\n1400000000,5;1;1000;2000\n1400000001,5;1;1100;2000\n",
    ];
    let tokens: [&[u8]; 6] = [b"\n", b" ", b",", b"frame", b"1e308", b"2026-11-24T08:30:00"];
    let file = InputFile::new().expect("a file");
    run("trajectories", &seeds, &tokens, 2000, |input| {
        let path = file.with(input).expect("it is written");
        drop(Agents::read(path, &TrajectoryReading { last_is_goal: true, ..TrajectoryReading::default() }));
    });
}

#[test]
fn hostile_metadata_of_a_batch_are_ignored_or_used() {
    let seed: &[u8] =
        b"{\"complete\": true, \"frame\": \"map\", \"context\": [\"r_do\"], \"ids\": [1, 2], \"columns\": \
                        [{\"name\": \"h_1_v\", \"unit\": \"m\"}]}";
    let folder = tempfile::tempdir().expect("a folder");
    let batch = folder.path().join("data_1.csv");
    let row = |t: usize| format!("{},{},{},{},{}\n", t as f64 * 0.1, t % 3, t % 5, t % 7, t / 9);
    let rows: String = (0..60).map(row).collect();
    fs::write(&batch, format!("time,h_1_v,h_2_v,r_v,r_do\n{rows}")).expect("a batch");
    run("batch_metadata", &[seed], &[b"[", b"null", b"\"h_1_v\"", b"4294967296"], 20_000, |input| {
        fs::write(batch.with_extension("json"), input).expect("the metadata");
        if let Ok(mut joint) = Joint::read(&[&batch]) {
            let _ = (joint.announced(), joint.frame().len());
            let _ = joint.parts(People::Joint);
            let _ = joint.parts(People::Pooled);
        }
    });
}
