//! Runs all targets with many inputs, and prints a table:
//! `cargo run --release -p roscausal_fuzz --example fuzz -- 20000 [NAME]`.
//!
//! A target is a test with `hostile` in its name, in the crate of its reader: some readers are not public. They are built as all
//! tests are, with the checks of a debug build. A target ends after ten minutes at the latest.

use std::{
    env,
    io::{BufRead, BufReader},
    process::{Command, ExitCode, Stdio},
};

use roscausal_fuzz::TOLD;

const SECONDS: &str = "600";

fn main() -> ExitCode {
    let mut args = env::args().skip(1);
    let inputs = args.next().unwrap_or_else(|| "20000".to_owned());
    if inputs.parse::<u64>().is_err() {
        eprintln!("'{inputs}' is not a number of inputs; give one, such as 20000");
        return ExitCode::from(2);
    }
    let name = args.next().unwrap_or_else(|| "hostile".to_owned());
    let cargo = env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned());
    let child = Command::new(cargo)
        .args([
            "test", "--profile", "checked", "--workspace", "--exclude", "roscausal_py", "--locked", "--tests",
        ])
        .args(["--features", "roscausal_core/columnar", "--no-fail-fast", &name, "--"])
        .args(["--nocapture", "--test-threads=1"])
        .envs([("ROSCAUSAL_FUZZ_INPUTS", inputs.as_str()), ("ROSCAUSAL_FUZZ_SECONDS", SECONDS)])
        .stdout(Stdio::piped())
        .spawn();
    let mut child = match child {
        Ok(child) => child,
        Err(error) => {
            eprintln!("cargo does not start: {error}");
            return ExitCode::FAILURE;
        }
    };
    println!("| target | inputs | seconds | slowest input, ms |\n|---|---|---|---|");
    let lines =
        child.stdout.take().into_iter().flat_map(|out| BufReader::new(out).lines().map_while(Result::ok));
    let mut findings = Vec::new();
    for line in lines {
        // The name of a test may stand before it.
        if let Some((_, reported)) = line.split_once(TOLD) {
            println!("| {reported}");
        } else if line.contains("finding: ") || line.ends_with("FAILED") {
            findings.push(line);
        }
    }
    let whole = child.wait().is_ok_and(|status| status.success());
    findings.iter().for_each(|finding| println!("{finding}"));
    if whole { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
