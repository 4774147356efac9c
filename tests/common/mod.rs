//! What the tests of the command share.

use std::{
    fs,
    path::Path,
    process::{Command, Output},
};

/// Runs `roscausal ARGS` in `dir` to its end.
pub(crate) fn roscausal(dir: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_roscausal"))
        .args(args)
        .current_dir(dir)
        .output()
        .expect("the command starts")
}

/// The words of a text, wherever its lines end.
#[allow(dead_code, reason = "not every file of tests reads what is wrapped")]
pub(crate) fn in_a_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Names and texts of the CSV files in a folder, such as its batches, by name.
#[allow(
    dead_code,
    clippy::panic,
    reason = "not every file of tests looks into folders; a test fails by panicking"
)]
pub(crate) fn csv_files(folder: &Path) -> Vec<(String, String)> {
    let entries = fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut found: Vec<(String, String)> = entries
        .flatten()
        .filter(|entry| entry.path().extension().is_some_and(|extension| extension == "csv"))
        .map(|entry| {
            let text = fs::read_to_string(entry.path()).expect("reads");
            (entry.file_name().to_string_lossy().into_owned(), text)
        })
        .collect();
    found.sort();
    found
}
