//! Errors and exit codes: 0 done, 1 failure, 2 bad usage.

use std::process::ExitCode;

use roscausal_core::Error;

/// Prints an error as one sentence on stderr and says the exit code.
pub(crate) fn exit_code(done: Result<(), Error>) -> ExitCode {
    let Err(error) = done else { return ExitCode::SUCCESS };
    eprintln!("error: {error}");
    match error {
        Error::Param { .. } => ExitCode::from(2),
        _ => ExitCode::FAILURE,
    }
}
