//! What the command prints. A reader that has gone (`| head -1`) ends nothing: the work goes on in silence, and its files are
//! complete. Any other fault, such as a full disk, is one sentence at the end, and exit code 1.
//!
//! `println!` and `eprintln!` panic instead.

use std::{
    fmt,
    io::{self, ErrorKind, Write},
    sync::{
        OnceLock,
        atomic::{AtomicBool, Ordering},
    },
};

/// The first fault of the standard output.
static FAULT: OnceLock<String> = OnceLock::new();
/// Whether only errors are told.
static QUIET: AtomicBool = AtomicBool::new(false);

/// Prints to the standard output, at once.
pub(crate) fn print(text: fmt::Arguments<'_>) {
    let mut out = io::stdout().lock();
    let done = out.write_fmt(text).and_then(|()| out.flush());
    if let Err(error) = done.or_else(ignore_gone) {
        let _ = FAULT.set(error.to_string());
    }
}

/// From now on only errors are told on the standard error.
pub(crate) fn be_quiet() {
    QUIET.store(true, Ordering::Relaxed);
}

/// Whether only errors are told.
pub(crate) fn is_quiet() -> bool {
    QUIET.load(Ordering::Relaxed)
}

/// Prints to the standard error, unless it is to be quiet.
pub(crate) fn print_note(text: fmt::Arguments<'_>) {
    if !is_quiet() {
        print_error(text);
    }
}

/// Prints to the standard error. If nobody can be told, nobody is.
pub(crate) fn print_error(text: fmt::Arguments<'_>) {
    let _ = io::stderr().lock().write_fmt(text);
}

/// Why the standard output could not be written, if so.
pub(crate) fn fault() -> Option<&'static str> {
    FAULT.get().map(String::as_str)
}

fn ignore_gone(error: io::Error) -> io::Result<()> {
    if error.kind() == ErrorKind::BrokenPipe { Ok(()) } else { Err(error) }
}

/// A line on the standard output, as `println!`.
macro_rules! say {
    ($($text:tt)*) => { crate::terminal::print(format_args!("{}\n", format_args!($($text)*))) };
}

/// A line on the standard error, as `eprintln!`, unless it is to be quiet.
macro_rules! tell {
    ($($text:tt)*) => { crate::terminal::print_note(format_args!("{}\n", format_args!($($text)*))) };
}

pub(crate) use {say, tell};
