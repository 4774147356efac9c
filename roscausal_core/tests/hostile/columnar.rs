//! Hostile Parquet and Arrow files.

use std::{fs, path::Path, sync::Arc};

use arrow_array::{ArrayRef, Float64Array, Int64Array, RecordBatch, StringArray};
use roscausal_core::batch::{Table, table::Reading};
use roscausal_fuzz::{Allocator, InputFile, Target};

#[global_allocator]
static ALLOCATOR: Allocator = Allocator;

fn run(name: &str, files: &[&str], more: Vec<Vec<u8>>, bytes_per_byte: usize) {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests");
    let file = |file: &&str| fs::read(tests.join("../../tests/tables").join(file)).expect("it is there");
    let target = Target {
        corpus: tests.join("corpus").join(name),
        seeds: files.iter().map(file).chain(more).collect(),
        tokens: &[b"PAR1", b"ARROW1\0\0", b"\xff\xff\xff\xff", b"\xff\xff\xff\x7f", b"\0\0\0\0\0\0\0\0"],
        bytes_per_byte,
    };
    let file = InputFile::new().expect("a file");
    // Packed parts may have 268 MB by rule, so the limit that a user sets is what is held here.
    let reading = Reading { encode: true, max_memory: Some(1 << 22), ..Reading::default() };
    target.run(|input| {
        if let Ok(table) = Table::read_as(file.with(input).expect("it is written"), &reading) {
            assert!(table.values.iter().all(|v| !v.is_infinite()));
        }
    });
}

/// A table that is not compressed: its mutations reach what a compressed one would hide.
fn batch() -> RecordBatch {
    let numbers: ArrayRef =
        Arc::new(Float64Array::from_iter((0..20).map(|v| (v != 7).then_some(f64::from(v)))));
    let times: ArrayRef = Arc::new(Int64Array::from_iter_values(0..20));
    let words: ArrayRef = Arc::new(StringArray::from_iter_values((0..20).map(|v| ["idle", "walk"][v % 2])));
    RecordBatch::try_from_iter([("time", times), ("a", numbers), ("state", words)]).expect("a table")
}

#[test]
fn a_hostile_parquet_file_is_refused_or_read() {
    let mut plain = Vec::new();
    let batch = batch();
    let mut writer =
        parquet::arrow::ArrowWriter::try_new(&mut plain, batch.schema(), None).expect("a writer");
    writer.write(&batch).expect("it is written");
    writer.close().expect("it ends");
    // Pages may legitimately expand a thousand times.
    run("parquet", &["groups.parquet", "words.parquet"], vec![plain], 20_000);
}

#[test]
fn a_hostile_arrow_file_is_refused_or_read() {
    let (mut file, mut stream) = (Vec::new(), Vec::new());
    let batch = batch();
    let mut writer = arrow_ipc::writer::FileWriter::try_new(&mut file, &batch.schema()).expect("a writer");
    writer.write(&batch).and_then(|()| writer.finish()).expect("it is written");
    drop(writer);
    let mut writer =
        arrow_ipc::writer::StreamWriter::try_new(&mut stream, &batch.schema()).expect("a writer");
    writer.write(&batch).and_then(|()| writer.finish()).expect("it is written");
    drop(writer);
    run("arrow", &["feather.arrow", "stream.arrows"], vec![file, stream], 20_000);
}
