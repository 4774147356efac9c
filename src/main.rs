//! The program `roscausal`: all of it is in the library, which the Python package calls as well.

use std::process::ExitCode;

fn main() -> ExitCode {
    roscausal::command(std::env::args_os()).into()
}
