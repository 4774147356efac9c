//! JSON and TOML that others wrote: bounds before a parser reads them, and its faults in plain words.

use std::{borrow::Borrow, collections::HashSet, fmt::Display};

use super::error::{Error, Result};

/// Deepest nesting of brackets, or of a dotted key, that is read.
pub const MOST_NESTING: usize = 64;
/// Longest step between rows, in seconds.
const LONGEST_STEP: f64 = 1e12;
/// What rounding adds to a p-value.
const ROUNDING: f64 = 1e-9;
/// Longest name in a message, in characters.
const LONGEST_NAME: usize = 80;
/// Longest reason of a parser in a message, in characters.
const LONGEST_REASON: usize = 300;

/// Refuses JSON or TOML that nests deeper than [`MOST_NESTING`], in one pass and without a stack: parsers recurse, and what they say
/// of such a text takes some of them quadratic time.
///
/// # Errors
/// Deeper nesting, with its line.
pub fn check_nesting(text: &[u8]) -> Result<()> {
    let (mut depth, mut dots, mut rest) = (0_usize, 0_usize, text);
    while let Some((&byte, after)) = rest.split_first() {
        rest = after;
        match byte {
            b'"' | b'\'' => rest = after_string(byte, after),
            b'#' => rest = after.iter().position(|b| *b == b'\n').map_or(&[][..], |end| &after[end..]),
            b'[' | b'{' => depth += 1,
            b']' | b'}' => (depth, dots) = (depth.saturating_sub(1), 0),
            b'.' => dots += 1,
            b',' | b'=' | b':' | b'\n' => dots = 0,
            _ => {}
        }
        if depth.max(dots) > MOST_NESTING {
            let line = line_of(text, text.len() - rest.len());
            return Err(Error::Data(format!("line {line} nests deeper than {MOST_NESTING} levels")));
        }
    }
    Ok(())
}

/// Refuses a file of another version than `known`.
///
/// # Errors
/// Any other schema.
pub fn check_schema(schema: &str, known: &str) -> Result<()> {
    Error::ensure_data(schema == known, || {
        let schema = quoted(schema);
        format!("its schema is {schema}; this program reads '{known}': make the file again with it")
    })
}

/// Refuses names that are empty or there twice.
///
/// # Errors
/// The first of them.
pub fn check_names<'a>(names: impl IntoIterator<Item = &'a String>) -> Result<()> {
    let mut known = HashSet::new();
    for (k, name) in names.into_iter().enumerate() {
        Error::ensure_data(!name.trim().is_empty(), || {
            format!("variable {} has no name; give each a name", k + 1)
        })?;
        Error::ensure_data(known.insert(name), || {
            format!("{} is there twice; give each variable a name of its own", quoted(name))
        })?;
    }
    Ok(())
}

/// Refuses what is not a step between rows, in seconds.
///
/// # Errors
/// A step that is not above 0, or is longer than any.
pub fn check_step(dt: Option<f64>) -> Result<()> {
    let Some(dt) = dt else { return Ok(()) };
    Error::ensure(dt > 0.0 && dt <= LONGEST_STEP, "dt", || {
        format!("{dt} is not a step between rows; give seconds above 0, up to {LONGEST_STEP}")
    })
}

/// Whether a number is a p-value or a share, up to rounding.
pub fn is_share(value: f64) -> bool {
    (0.0..=1.0 + ROUNDING).contains(&value)
}

/// The line of a byte, from 1.
pub fn line_of(text: &[u8], byte: usize) -> usize {
    text.iter().take(byte).filter(|b| **b == b'\n').count() + 1
}

/// What follows a string that `quote` opened: TOML's strings of three quotes span lines, all others end with theirs.
fn after_string(quote: u8, text: &[u8]) -> &[u8] {
    let long = text.starts_with(&[quote; 2]);
    let mut at = if long { 2 } else { 0 };
    let ends = |rest: &[u8]| match long {
        true => rest.starts_with(&[quote; 3]),
        false => matches!(rest.first(), Some(b) if *b == quote || *b == b'\n'),
    };
    while at < text.len() && !ends(&text[at..]) {
        let escapes = quote == b'"' && text[at] == b'\\' && (long || text.get(at + 1) != Some(&b'\n'));
        at += if escapes { 2 } else { 1 };
    }
    let rest = text.get(at + if long { 3 } else { 1 }..).unwrap_or_default();
    // Up to two quotes more belong to a long string.
    let more = rest.iter().take(2).take_while(|b| long && **b == quote).count();
    &rest[more..]
}

/// A name of a file in a message: in quotes, and cut where it is long.
///
/// ```
/// use roscausal_discovery::text::quoted;
///
/// assert_eq!(quoted("h_v"), "'h_v'");
/// assert_eq!(quoted(&"x".repeat(1000)).len(), 85);
/// ```
pub fn quoted(name: &str) -> String {
    format!("'{}'", short(name))
}

/// `a`, `a and b`, `a, b and c`.
#[doc(hidden)]
pub fn listed<S: Borrow<str> + Display>(parts: &[S]) -> String {
    match parts {
        [before @ .., last] if !before.is_empty() => format!("{} and {last}", before.join(", ")),
        _ => parts.join(""),
    }
}

/// The same without quotes.
pub fn short(name: &str) -> String {
    cut(name, LONGEST_NAME)
}

/// The reason of a parser in plain words, cut where it quotes much.
pub fn reason_of(error: impl Display) -> String {
    let mut reason = error.to_string().replace('\n', " ");
    for unsigned in ["expected usize", "expected u64", "expected u32"] {
        reason = reason.replace(unsigned, "expected a whole number from 0 on");
    }
    reason = reason
        .replace("expected i64", "expected a whole number")
        .replace("expected f64", "expected a number");
    cut(&reason, LONGEST_REASON)
}

fn cut(text: &str, longest: usize) -> String {
    text.char_indices()
        .nth(longest)
        .map_or_else(|| text.to_owned(), |(end, _)| format!("{}...", &text[..end]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nesting_is_bounded_wherever_it_hides() {
        let deep = |open: &str| open.repeat(MOST_NESTING + 1);
        for text in [
            deep("["),
            deep("{\"a\":"),
            format!("a = {}", deep("[")),
            format!("a = 'it\\'\nb = {}", deep("[")),
            format!("a = \"open\nb = {}", deep("[")),
            format!("a = \"open\\\nb = {}", deep("[")),
            format!("a = \"\"\"x\"\"\"\"\"\nb = {}", deep("[")),
            format!("a = [\"\"\"x\"\"\"\", {}", deep("[")),
            format!("# [[[\n{} = 1", deep("a.")),
            format!("[{}a]", deep("a.")),
        ] {
            assert!(check_nesting(text.as_bytes()).is_err(), "{text}");
        }
    }

    #[test]
    fn what_only_looks_deep_is_read() {
        let many = "[".repeat(1000);
        for text in [
            "[[[1.5, 2.5], [0.1]]]".to_owned(),
            format!("\"{many}\""),
            format!("\"\\\"{many}\""),
            format!("a = '{many}'"),
            format!("a = '''\n{many}\n'''"),
            format!("a = \"\"\"\n\"{many}\"\"\"\""),
            format!("# {many}\na = 1"),
            "[1.0],".repeat(1000),
            "0.1, ".repeat(1000),
        ] {
            assert!(check_nesting(text.as_bytes()).is_ok(), "{text}");
        }
        assert!(check_nesting(format!("\n\n{many}").as_bytes()).unwrap_err().to_string().contains("line 3"));
    }
}
