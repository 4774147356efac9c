//! Errors and exit codes: 0 finished, 1 failure, 2 wrong usage, 3 a question that the data do not carry, 130 ended by Ctrl-C.

use roscausal_core::Error;
use roscausal_reasoning::answer::Status;

use crate::{
    flags,
    interrupt::{self, Interrupt},
    terminal,
};

/// Prints an error as one sentence on stderr and returns the exit code.
pub(crate) fn exit_code(done: Result<(), Error>, interrupt: &Interrupt) -> u8 {
    let Err(error) = done else {
        let Some(fault) = terminal::fault() else { return 0 };
        let why = "the results cannot be written to the standard output";
        terminal::print_error(format_args!("error: {why}: {fault}"));
        return 1;
    };
    match error {
        Error::Cancelled(reason) if interrupt.is_set() => {
            // That it was the user, the user knows.
            if let Some(more) = reason.strip_prefix("by the user; ") {
                tell!("{more}");
            }
            interrupt::CODE
        }
        error => {
            terminal::print_error(format_args!("error: {}", flags::sentence(&error)));
            if matches!(error, Error::Param { .. }) { 2 } else { 1 }
        }
    }
}

/// The exit code of an answer, which is printed already.
pub(crate) fn answered(done: Result<Status, Error>, interrupt: &Interrupt) -> u8 {
    match done {
        Err(error) => exit_code(Err(error), interrupt),
        Ok(Status::Ok | Status::Ambiguous) => exit_code(Ok(()), interrupt),
        Ok(Status::NotSupported) => 3,
        Ok(Status::BadRequest) => 2,
        Ok(Status::NoModel | Status::NoData | Status::Late) => 1,
    }
}
