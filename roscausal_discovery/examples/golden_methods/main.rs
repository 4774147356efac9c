//! Runs every case in a folder of reference results of the newer methods and writes our results.
//!
//! `cargo run --release -p roscausal_discovery --example golden_methods -- SET OUT [ONLY]` reads `SET/cases/*.json` with the data
//! they name and writes `OUT/cases/<id>.json`, for comparison; with `ONLY`, the cases whose name has this text. At the end it
//! lists the cases that it cannot run. One file for each family of methods.
//!
//! Where SET holds a `truth.json`, it runs the experiments on its random systems and writes `OUT/graphs_<experiment>.json`.

mod candoit;
mod cases;
mod data;
mod dynotears;
mod granger;
mod jpcmciplus;
mod lpcmci;
mod quality;
mod varlingam;

use std::{path::Path, process::ExitCode, time::Instant};

use serde_json::{Value, json};

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let (set, out, only) = match args.as_slice() {
        [set, out] => (set, out, ""),
        [set, out, only] => (set, out, only.as_str()),
        _ => {
            eprintln!("usage: golden_methods SET OUT [ONLY]");
            return ExitCode::from(2);
        }
    };
    match run(Path::new(set), Path::new(out), only) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("{message}");
            ExitCode::FAILURE
        }
    }
}

fn run(set: &Path, out: &Path, only: &str) -> Result<(), String> {
    if set.join("truth.json").exists() {
        return quality::run_all(set, out, only);
    }
    let folder = out.join("cases");
    std::fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let (mut done, mut not_run) = (0, Vec::new());
    for file in data::files(&set.join("cases"))?.iter().filter(|file| file.contains(only)) {
        let case = data::read_json(&set.join("cases").join(file))?;
        let start = Instant::now();
        match run_case(&case, set) {
            Ok(result) => {
                let path = folder.join(file);
                let text = json!({ "id": case["id"], "result": result }).to_string();
                std::fs::write(&path, text).map_err(|e| format!("{}: {e}", path.display()))?;
                println!("{file}: {:.4} s", start.elapsed().as_secs_f64());
                done += 1;
            }
            Err(reason) => not_run.push(format!("{file}: {reason}")),
        }
    }
    println!("{done} run, {} not run", not_run.len());
    not_run.iter().for_each(|line| println!("not run: {line}"));
    Ok(())
}

fn run_case(case: &Value, set: &Path) -> Result<Value, String> {
    match case["method"].as_str().unwrap_or_default() {
        "candoit" => candoit::run(case, set),
        "dynotears" => dynotears::run(case, set),
        "granger" => granger::run(case, set),
        "jpcmciplus" => jpcmciplus::run(case, set),
        "lpcmci" => lpcmci::run(case, set),
        "varlingam" => varlingam::run(case, set),
        other => Err(format!("method '{other}' is not part of this engine")),
    }
}
