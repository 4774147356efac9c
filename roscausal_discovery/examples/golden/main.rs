//! Runs every case in a folder of reference results and writes our results.
//!
//! `cargo run --release -p roscausal_discovery --example golden -- DIR OUT` reads `DIR/cases/*.json`,
//! `DIR/single/*.json` and `DIR/fpcmci/*.json` with the data they name. It writes `OUT/cases/<id>.json` and so on,
//! for comparison. At the end it lists the cases that it cannot run.

mod driver;

use std::{path::Path, process::ExitCode, time::Instant};

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [dir, out] = args.as_slice() else {
        eprintln!("usage: golden DIR OUT");
        return ExitCode::from(2);
    };
    match run(Path::new(dir), Path::new(out)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("{message}");
            ExitCode::FAILURE
        }
    }
}

fn run(dir: &Path, out: &Path) -> Result<(), String> {
    let mut not_run = Vec::new();
    let mut done = 0;
    for kind in driver::KINDS {
        for file in driver::files(&dir.join(kind))? {
            let start = Instant::now();
            match driver::run_file(dir, kind, &file) {
                Ok(value) => {
                    let folder = out.join(kind);
                    std::fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
                    let path = folder.join(&file);
                    std::fs::write(&path, value.to_string())
                        .map_err(|e| format!("{}: {e}", path.display()))?;
                    println!("{kind}/{file}: {:.3} s", start.elapsed().as_secs_f64());
                    done += 1;
                }
                Err(reason) => not_run.push(format!("{kind}/{file}: {reason}")),
            }
        }
    }
    println!("{done} run, {} not run", not_run.len());
    not_run.iter().for_each(|line| println!("not run: {line}"));
    Ok(())
}
