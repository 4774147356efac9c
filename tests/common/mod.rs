//! What the tests of the command share.

use std::{
    path::Path,
    process::{Command, Output},
};

/// Runs `roscausal ARGS` in `dir` to its end.
pub(crate) fn roscausal(dir: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_roscausal"))
        .args(args)
        .current_dir(dir)
        .output()
        .expect("the command starts")
}
