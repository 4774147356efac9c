//! Runs the cases of a folder of reference results about confidence, and writes ours in the layout that the folder's comparison
//! reads.
//!
//! `cargo run --release -p roscausal_discovery --example golden_confidence -- SET OUT [SECTION..]`; sections: draws, boot, window,
//! calibration, changes, power; without one: all.

#[path = "../golden/csv_file.rs"]
mod csv_file;
mod sections;

use std::{path::Path, process::ExitCode, time::Instant};

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [set, out, wanted @ ..] = args.as_slice() else {
        eprintln!("usage: golden_confidence SET OUT [SECTION..]");
        return ExitCode::from(2);
    };
    for (name, run) in sections::ALL {
        if !wanted.is_empty() && !wanted.iter().any(|w| w == name) {
            continue;
        }
        let start = Instant::now();
        if let Err(message) = run(Path::new(set), Path::new(out)) {
            eprintln!("{name}: {message}");
            return ExitCode::FAILURE;
        }
        println!("{name}: {:.2} s", start.elapsed().as_secs_f64());
    }
    ExitCode::SUCCESS
}
