//! Runs every case of a folder of reference results of further methods and writes our results.
//!
//! `cargo run --release -p roscausal_discovery --example golden_methods -- SET OUT [TEXT]` reads `SET/cases/*.json` whose name
//! holds TEXT, with the data they name, and writes `OUT/cases/<id>.json`. At the end it lists the cases that it cannot run.
//!
//! Where SET holds a `truth.json`, it runs the experiments on its random systems and writes `OUT/graphs_<experiment>.json`.

mod candoit;
mod cases;
mod lpcmci;
mod quality;

use std::{path::Path, process::ExitCode, time::Instant};

use serde_json::{Value, json};

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let (set, out, only) = match args.as_slice() {
        [set, out] => (set, out, ""),
        [set, out, only] => (set, out, only.as_str()),
        _ => {
            eprintln!("usage: golden_methods SET OUT [TEXT]");
            return ExitCode::from(2);
        }
    };
    match run_all(Path::new(set), Path::new(out), only) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("{message}");
            ExitCode::FAILURE
        }
    }
}

fn run_all(set: &Path, out: &Path, only: &str) -> Result<(), String> {
    if set.join("truth.json").exists() {
        return quality::run_all(set, out, only);
    }
    let folder = out.join("cases");
    std::fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let mut not_run = Vec::new();
    for name in cases::names(&set.join("cases"))?.iter().filter(|name| name.contains(only)) {
        let start = Instant::now();
        let case = cases::read(&set.join("cases").join(name))?;
        match run(&case, set) {
            Ok(result) => {
                let text = json!({ "id": case["id"], "result": result }).to_string();
                std::fs::write(folder.join(name), text).map_err(|e| format!("{name}: {e}"))?;
                println!("{name}: {:.4} s", start.elapsed().as_secs_f64());
            }
            Err(reason) => not_run.push(format!("{name}: {reason}")),
        }
    }
    not_run.iter().for_each(|line| println!("not run: {line}"));
    Ok(())
}

fn run(case: &Value, set: &Path) -> Result<Value, String> {
    match case["method"].as_str().unwrap_or_default() {
        "lpcmci" => lpcmci::run(case, set),
        "candoit" => candoit::run(case, set),
        other => Err(format!("method '{other}' is not part of this engine")),
    }
}
