//! Errors and exit codes: 0 finished, 1 failure, 2 wrong usage.

use std::process::ExitCode;

use roscausal_core::Error;

/// Prints an error as one sentence on stderr and returns the exit code.
pub(crate) fn exit_code(done: Result<(), Error>) -> ExitCode {
    let Err(error) = done else { return ExitCode::SUCCESS };
    eprintln!("error: {error}");
    match error {
        Error::Param { .. } => ExitCode::from(2),
        _ => ExitCode::FAILURE,
    }
}
