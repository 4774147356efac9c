//! Errors and exit codes: 0 finished, 1 failure, 2 wrong usage, 3 a question that the data do not carry.

use std::process::ExitCode;

use roscausal_core::Error;
use roscausal_reasoning::answer::Status;

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

/// The exit code of an answer, which is printed already.
pub(crate) fn answered(done: Result<Status, Error>) -> ExitCode {
    match done {
        Err(error) => exit_code(Err(error)),
        Ok(Status::Ok | Status::Ambiguous) => exit_code(Ok(())),
        Ok(Status::NotSupported) => ExitCode::from(3),
        Ok(Status::BadRequest) => ExitCode::from(2),
        Ok(Status::NoModel | Status::NoData) => ExitCode::FAILURE,
    }
}
