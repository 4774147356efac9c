//! What the command prints. A reader that has gone (`| head -1`) ends nothing: the work goes on in silence, and its files are
//! complete. Any other fault, such as a full disk, is one sentence at the end, and exit code 1.
//!
//! Names and texts come from strangers' files. So everything is spelled out here ([`visible`]), and colours are put on afterwards.
//!
//! `println!` and `eprintln!` panic instead.

use std::{
    fmt,
    io::{self, ErrorKind, IsTerminal, Write},
    sync::{
        OnceLock,
        atomic::{AtomicBool, AtomicU8, Ordering},
    },
};

use roscausal_core::visible;

use crate::flags;

/// The first fault of the standard output.
static FAULT: OnceLock<String> = OnceLock::new();
/// Whether only errors are told.
static QUIET: AtomicBool = AtomicBool::new(false);

/// When to print in colours.
static COLOUR: AtomicU8 = AtomicU8::new(0);

/// When to print in colours: `--color`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Colour {
    /// Where a person reads, and NO_COLOR is not set.
    #[default]
    Auto,
    /// Also into files and pipes.
    Always,
    /// Never.
    Never,
}

impl Colour {
    /// From now on, prints so.
    pub(crate) fn choose(self) {
        COLOUR.store(self as u8, Ordering::Relaxed);
    }

    /// The choice in `--color WHEN` or `--color=WHEN`, before the command line is understood: its own faults are told in colours.
    pub(crate) fn in_line(line: &[std::ffi::OsString]) -> Self {
        let words: Vec<&str> = line.iter().filter_map(|word| word.to_str()).collect();
        let pair = words.windows(2).find(|pair| pair[0] == "--color").map(|pair| pair[1]);
        match pair.or(words.iter().find_map(|word| word.strip_prefix("--color="))) {
            Some("always") => Self::Always,
            Some("never") => Self::Never,
            _ => Self::Auto,
        }
    }

    /// The choice for the messages of the command line itself.
    pub(crate) fn for_clap(self) -> clap::ColorChoice {
        match self {
            Self::Auto => clap::ColorChoice::Auto,
            Self::Always => clap::ColorChoice::Always,
            Self::Never => clap::ColorChoice::Never,
        }
    }

    /// Whether a stream is printed in colours; NO_COLOR counts if it is not empty (no-color.org).
    fn shows(stream: &impl IsTerminal) -> bool {
        let plain = || std::env::var_os("NO_COLOR").is_some_and(|set| !set.is_empty());
        match COLOUR.load(Ordering::Relaxed) {
            choice if choice == Self::Always as u8 => true,
            choice if choice == Self::Never as u8 => false,
            _ => stream.is_terminal() && !plain(),
        }
    }
}

/// Whether the standard error is printed in colours.
pub(crate) fn is_coloured() -> bool {
    Colour::shows(&io::stderr())
}

/// A text for people on the standard output: its first line and its headings are bold, notes are yellow, where colours are shown.
pub(crate) fn print_report(text: &str) {
    if !Colour::shows(&io::stdout()) {
        return print_text(&format!("{text}\n"));
    }
    let mut painted = String::new();
    const HEADINGS: [&str; 3] = ["Conclusion", "Links, firmest first", "Next"];
    for (number, line) in visible::lines(text).lines().enumerate() {
        match number {
            _ if number == 0 || HEADINGS.contains(&line) => painted += &format!("{BOLD}{line}{PLAIN}\n"),
            _ if line.starts_with("note: ") => painted += &format!("{YELLOW}note:{PLAIN}{}\n", &line[5..]),
            _ => painted += &format!("{line}\n"),
        }
    }
    print(&painted);
}

/// A text of the command line itself, such as its help, on the standard output.
pub(crate) fn print_styled(text: &clap::builder::StyledStr) {
    if Colour::shows(&io::stdout()) { print(&text.ansi().to_string()) } else { print(&text.to_string()) }
}

/// A complaint of the command line itself on the standard error. Nothing in it may be from outside, as it has colours.
pub(crate) fn print_complaint(text: &clap::builder::StyledStr) {
    let text = if is_coloured() { text.ansi().to_string() } else { text.to_string() };
    let _ = io::stderr().lock().write_all(text.as_bytes());
}

const BOLD: &str = "\u{1b}[1m";
const YELLOW: &str = "\u{1b}[33m";
const RED: &str = "\u{1b}[1;31m";
const PLAIN: &str = "\u{1b}[0m";

/// A line on the standard output: ends of lines in it are somebody else's.
pub(crate) fn print_line(text: fmt::Arguments<'_>) {
    print(&format!("{}\n", visible::line(&text.to_string())));
}

/// A text of several lines on the standard output. What is in it from outside must be lines of this program already.
pub(crate) fn print_text(text: &str) {
    print(&visible::lines(text));
}

/// JSON on the standard output.
pub(crate) fn print_json(text: &str) {
    print(&format!("{}\n", visible::json(text.trim_end())));
}

/// Prints to the standard output, at once.
fn print(text: &str) {
    let mut out = io::stdout().lock();
    if let Err(error) = out.write_all(text.as_bytes()).and_then(|()| out.flush()).or_else(ignore_gone) {
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

/// A line on the standard error, unless it is to be quiet.
pub(crate) fn print_note(text: fmt::Arguments<'_>) {
    if !is_quiet() {
        print_error(text);
    }
}

/// A line on the standard error. If nobody can be told, nobody is.
pub(crate) fn print_error(text: fmt::Arguments<'_>) {
    let text = visible::message(&flags::spelled(&text.to_string()));
    let painted = match text.strip_prefix("error:") {
        Some(rest) if is_coloured() => format!("{RED}error:{PLAIN}{rest}\n"),
        _ => text + "\n",
    };
    let _ = io::stderr().lock().write_all(painted.as_bytes());
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
    ($($text:tt)*) => { crate::terminal::print_line(format_args!($($text)*)) };
}

/// A line on the standard error, as `eprintln!`, unless it is to be quiet.
macro_rules! tell {
    ($($text:tt)*) => { crate::terminal::print_note(format_args!($($text)*)) };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_choice_of_colours_is_known_before_the_line_is_understood() {
        let choice = |line: &str| Colour::in_line(&line.split(' ').map(Into::into).collect::<Vec<_>>());
        assert_eq!(choice("roscausal discover a.csv"), Colour::Auto);
        assert_eq!(choice("roscausal --color never discover a.csv"), Colour::Never);
        assert_eq!(choice("roscausal discover a.csv --color=always"), Colour::Always);
    }
}
