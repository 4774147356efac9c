//! Runs every case of a folder of reference cases and writes our answers.
//!
//! `cargo run --release -p roscausal_reasoning --example golden_reasoning -- SET OUT` reads `SET/cases/*.json` with the data they
//! name and writes `OUT/NAME.json`, for comparison. At the end it lists the cases that it cannot run.

mod kinds;

use std::{path::Path, process::ExitCode, time::Instant};

use kinds::{
    answer,
    case::{Answer, Case, names},
};
use serde_json::json;

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [set, out] = args.as_slice() else {
        eprintln!("usage: golden_reasoning SET OUT");
        return ExitCode::from(2);
    };
    match run(Path::new(set), Path::new(out)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("{message}");
            ExitCode::FAILURE
        }
    }
}

fn run(set: &Path, out: &Path) -> Answer<()> {
    std::fs::create_dir_all(out).map_err(|e| format!("{}: {e}", out.display()))?;
    let (mut done, mut not_run) = (0, Vec::new());
    for name in names(&set.join("cases"))? {
        let start = Instant::now();
        match Case::read(set, &name).and_then(|case| answer(&case)) {
            Ok(result) => {
                let path = out.join(&name);
                std::fs::write(&path, json!({ "result": result }).to_string())
                    .map_err(|e| format!("{}: {e}", path.display()))?;
                println!("{name}: {:.3} s", start.elapsed().as_secs_f64());
                done += 1;
            }
            Err(reason) => not_run.push(format!("{name}: {reason}")),
        }
    }
    println!("{done} run, {} not run", not_run.len());
    not_run.iter().for_each(|line| println!("not run: {line}"));
    Ok(())
}
