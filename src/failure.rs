//! Errors and exit codes: 0 finished, 1 failure, 2 wrong usage, 130 ended by Ctrl-C.

use std::process::ExitCode;

use roscausal_core::Error;

use crate::{
    flags,
    interrupt::{self, Interrupt},
    terminal,
};

/// Prints an error as one sentence on stderr and returns the exit code.
pub(crate) fn exit_code(done: Result<(), Error>, interrupt: &Interrupt) -> ExitCode {
    let Err(error) = done else {
        return match terminal::fault() {
            None => ExitCode::SUCCESS,
            Some(fault) => {
                let why = "the results cannot be written to the standard output";
                terminal::print_error(format_args!("error: {why}: {fault}\n"));
                ExitCode::FAILURE
            }
        };
    };
    match error {
        Error::Cancelled(reason) if interrupt.is_set() => {
            // That it was the user, the user knows.
            if let Some(more) = reason.strip_prefix("by the user; ") {
                terminal::tell!("{more}");
            }
            ExitCode::from(interrupt::CODE)
        }
        Error::Param { .. } => {
            tell(&error);
            ExitCode::from(2)
        }
        _ => {
            tell(&error);
            ExitCode::FAILURE
        }
    }
}

fn tell(error: &Error) {
    terminal::print_error(format_args!("error: {}\n", flags::in_the_commands_words(error)));
}
