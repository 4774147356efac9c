//! `roscausal discover` as its users run it: what it prints, what it writes, and its errors.

#![allow(clippy::expect_used, clippy::panic, reason = "a test may panic: that is how it fails")]

#[path = "../common/mod.rs"]
mod common;
mod data;
mod results;
mod strangers;
mod terminal;

use std::fs;

use common::roscausal;
use roscausal_fuzz::unit;
use tempfile::TempDir;

const QUICK: [&str; 6] = ["discover", "data.csv", "--method", "pcmci", "--test", "parcorr"];

fn folder(file: &str, content: &str) -> TempDir {
    let dir = tempfile::tempdir().expect("a temporary folder");
    fs::write(dir.path().join(file), content).expect("writes");
    dir
}

/// `a` drives `b` one step later, with deterministic noise.
fn coupled(rows: usize) -> String {
    let mut state = 7_u64;
    let mut noise = || unit(&mut state) - 0.5;
    let (mut a, mut b) = (0.0, 0.0);
    let mut csv = "time,a,b\n".to_owned();
    for row in 0..rows {
        (a, b) = (0.4 * a + noise(), 0.3 * b + 0.8 * a + 0.5 * noise());
        csv += &format!("{},{a},{b}\n", row as f64 * 0.25);
    }
    csv
}

fn complaint(csv: &str, args: &[&str], code: i32) -> String {
    let dir = folder("data.csv", csv);
    let all: Vec<&str> = ["discover", "data.csv"].iter().chain(args).copied().collect();
    let out = roscausal(dir.path(), &all);
    let text = String::from_utf8_lossy(&out.stderr).into_owned();
    assert_eq!(out.status.code(), Some(code), "{text}");
    assert!(out.stdout.is_empty(), "stdout is for results");
    assert!(!text.contains("panicked"), "{text}");
    text
}

/// Whether all these are in a text, whose lines may end anywhere.
fn has(text: &str, words: &[&str]) {
    let line = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    let in_a_line = line(text);
    for word in words {
        assert!(text.contains(word) || in_a_line.contains(&line(word)), "'{word}' is missing in: {text}");
    }
}
