//! Reads regressions, one JSON object `{"z": [[...], ...], "y": [...]}` a line, and writes where GPDC's search ends, alike.
//!
//! `cargo run --release -p roscausal_discovery --example gp_optima -- [--search exact] < IN > OUT`: for comparisons with other
//! programs (`tests/gpdc/optima.py`).

use std::{
    io::{self, BufRead, Write},
    process::ExitCode,
};

use roscausal_discovery::independence_tests::{GpOptimum, TestSettings};
use serde_json::{Value, json};

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let gp_search = match args.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [] => TestSettings::default().gp_search,
        ["--search", name] => name.parse()?,
        _ => return Err("usage: gp_optima [--search default|exact] < IN > OUT".into()),
    };
    let settings = TestSettings { gp_search, ..TestSettings::default() };
    let mut out = io::stdout().lock();
    for line in io::stdin().lock().lines() {
        let regression: Value = serde_json::from_str(&line?)?;
        let numbers =
            |value: &Value| value.as_array().map(|v| v.iter().filter_map(Value::as_f64).collect::<Vec<_>>());
        let (z, y) = (regression["z"].as_array(), numbers(&regression["y"]));
        let (Some(z), Some(y)) = (z, y) else { return Err("a line has no lists 'z' and 'y'".into()) };
        let z: Vec<Vec<f64>> = z.iter().filter_map(numbers).collect();
        let GpOptimum { length_scale, noise, log_likelihood } = GpOptimum::find(&y, &z, &settings)?;
        writeln!(out, "{}", json!({ "l": length_scale, "s": noise, "log_likelihood": log_likelihood }))?;
    }
    Ok(())
}
