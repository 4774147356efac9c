//! Parquet and Arrow files (feature `columnar`), written by pyarrow, pandas and polars with `tests/tables/write.py`.

#![allow(clippy::expect_used, clippy::panic, reason = "a test may panic: that is how it fails")]

#[path = "hostile/columnar.rs"]
mod hostile;

use std::{
    fs,
    path::{Path, PathBuf},
};

use roscausal_core::batch::{Table, table::Reading};

fn tables() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/tables")
}

fn read(path: &Path, encode: bool) -> Result<Table, String> {
    Table::read_as(path, &Reading { encode, ..Reading::default() }).map_err(|error| error.to_string())
}

#[test]
fn parquet_and_arrow_files_are_the_table_of_the_csv_file() {
    let expected = read(&tables().join("plain.csv"), false).expect("a table");
    for file in ["stamps.parquet", "groups.parquet", "feather.arrow", "stream.arrows"] {
        let found = read(&tables().join(file), false).unwrap_or_else(|reported| panic!("{file}: {reported}"));
        assert_eq!(found.names, expected.names, "{file}");
        assert_eq!(found.values.dim(), expected.values.dim(), "{file}");
        let pairs = found.values.iter().zip(&expected.values);
        assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-12), "{file}");
        let step = found.dt().expect("times");
        assert!((step - 0.25).abs() < 1e-9, "{file}: {step}");
    }
    let found =
        read(&tables().join("index.parquet"), false).expect("row numbers of pandas are not variables");
    assert_eq!(found.names, expected.names);
}

#[test]
fn words_of_a_parquet_file_are_refused_by_column_or_encoded() {
    let reported = read(&tables().join("words.parquet"), false).expect_err("words");
    assert!(reported.contains("column 'state': 'idle' is not a number"), "{reported}");
    let found = read(&tables().join("words.parquet"), true).expect("encoded");
    assert_eq!(found.names, ["a", "b", "state", "flag", "n"]);
}

#[test]
fn a_damaged_parquet_or_arrow_file_is_one_sentence() {
    let dir = tempfile::tempdir().expect("a folder");
    for name in ["groups.parquet", "feather.arrow", "stream.arrows"] {
        let whole = fs::read(tables().join(name)).expect("is there");
        for keep in [12, whole.len() / 3, whole.len() - 40] {
            let path = dir.path().join(name);
            fs::write(&path, &whole[..keep]).expect("writes");
            let reported = read(&path, false).expect_err("cut off");
            assert!(
                reported.contains(name) && reported.trim().lines().count() == 1,
                "{name} {keep}: {reported}"
            );
        }
    }
    // The library panics at the one, and allocates what the other claims.
    for name in ["parquet/no_dictionary.parquet", "arrow/long_body.arrows"] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus").join(name);
        let reported = read(&path, true).expect_err("damaged");
        assert!(reported.contains("damaged") && reported.trim().lines().count() == 1, "{reported}");
    }
}
