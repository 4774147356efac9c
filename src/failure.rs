//! Errors and exit codes: 0 finished, 1 failure, 2 wrong usage.

use std::process::ExitCode;

use roscausal_core::Error;

use crate::terminal;

/// Prints an error as one sentence on stderr and returns the exit code.
pub(crate) fn exit_code(done: Result<(), Error>) -> ExitCode {
    let Err(error) = done else {
        return match terminal::fault() {
            None => ExitCode::SUCCESS,
            Some(fault) => {
                terminal::tell!("error: the results cannot be written to the standard output: {fault}");
                ExitCode::FAILURE
            }
        };
    };
    terminal::tell!("error: {error}");
    match error {
        Error::Param { .. } => ExitCode::from(2),
        _ => ExitCode::FAILURE,
    }
}
