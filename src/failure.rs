//! Errors and exit codes: 0 finished, 1 failure, 2 wrong usage.

use roscausal_core::Error;

use crate::terminal;

/// Prints an error as one sentence on stderr and returns the exit code.
pub(crate) fn exit_code(done: Result<(), Error>) -> u8 {
    let Err(error) = done else {
        return match terminal::fault() {
            None => 0,
            Some(fault) => {
                terminal::tell!("error: the results cannot be written to the standard output: {fault}");
                1
            }
        };
    };
    terminal::tell!("error: {error}");
    match error {
        Error::Param { .. } => 2,
        _ => 1,
    }
}
