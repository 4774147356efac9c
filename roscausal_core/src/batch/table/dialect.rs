//! What people call CSV: compressed files, other encodings, comments, separators.
//!
//! Which character separates the cells is our one rule, the header line, because a user can foresee it; `csv-sniffer` 0.3
//! guesses from statistics of the first rows, and a wrong guess has no line to point at.

use std::{
    borrow::Cow,
    io::{self, ErrorKind},
    path::Path,
};

use super::{columns::MOST_COLUMNS, time::date};
use crate::{
    Error, Result as FileResult,
    content::{not_a_table, not_data},
    memory::Memory,
};

/// The bytes of a file or a pipe, unpacked if they were compressed.
///
/// # Errors
/// A file that cannot be read, is damaged, or takes more memory than it may.
pub(super) fn content(path: &Path, memory: Memory) -> FileResult<Vec<u8>> {
    unpacked(memory.read(path)?, memory).map_err(|reason| Error::file(path, reason))
}

/// A file that was compressed with gzip or Zstandard, unpacked; any other as it is.
///
/// # Errors
/// A damaged archive, or one that grows beyond what tables do.
fn unpacked(bytes: Vec<u8>, memory: Memory) -> Result<Vec<u8>, String> {
    let length = bytes.len() as u64;
    let (what, read) = if bytes.starts_with(b"\x1f\x8b") {
        ("gzip", memory.unpack(flate2::read::MultiGzDecoder::new(bytes.as_slice()), length))
    } else if bytes.starts_with(b"\x28\xb5\x2f\xfd") {
        let decoder = zstd::Decoder::new(bytes.as_slice());
        ("Zstandard", decoder.and_then(|decoder| memory.unpack(decoder, length)))
    } else {
        return Ok(bytes);
    };
    read.map_err(|error: io::Error| match error.kind() {
        ErrorKind::FileTooLarge => format!("the file is compressed with {what}: {error}"),
        _ => format!("the file is compressed with {what}, and damaged: {error}"),
    })
}

/// The bytes as UTF-8, without a mark of their order, and the encoding if it was another one. UTF-16 is told by its mark, or by
/// zeros in every other byte; what is not UTF-8 counts as Latin-1.
pub(super) fn decoded(bytes: &[u8]) -> (Cow<'_, [u8]>, Option<&'static str>) {
    if let Some(rest) = bytes.strip_prefix(b"\xef\xbb\xbf") {
        return (Cow::Borrowed(rest), None);
    }
    let first = &bytes[..bytes.len().min(64)];
    let zeros = |odd: usize| first.len() >= 4 && first.iter().skip(odd).step_by(2).all(|&byte| byte == 0);
    type Unit = fn([u8; 2]) -> u16;
    let (little, big): (Unit, Unit) = (u16::from_le_bytes, u16::from_be_bytes);
    let utf16 = (bytes.strip_prefix(b"\xff\xfe").map(|rest| (rest, little)))
        .or_else(|| bytes.strip_prefix(b"\xfe\xff").map(|rest| (rest, big)))
        .or_else(|| zeros(1).then_some((bytes, little)))
        .or_else(|| zeros(0).then_some((bytes, big)));
    if let Some((rest, unit)) = utf16 {
        let units = rest.as_chunks::<2>().0.iter().map(|&pair| unit(pair));
        let text: String = char::decode_utf16(units).map(|c| c.unwrap_or('\u{fffd}')).collect();
        return (Cow::Owned(text.into_bytes()), Some("UTF-16"));
    }
    if std::str::from_utf8(bytes).is_err() {
        let text: String = bytes.iter().map(|&byte| char::from(byte)).collect();
        return (Cow::Owned(text.into_bytes()), Some("Latin-1"));
    }
    (Cow::Borrowed(bytes), None)
}

/// How a text is cut into cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Separator {
    /// One of these bytes.
    Byte(u8),
    /// Any number of spaces.
    Spaces,
}

/// The place of the header line, and the separator.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    /// Where the header line begins: behind comments, empty lines and a `sep=;` of spreadsheets.
    pub(super) start: usize,
    pub(super) separator: Separator,
    /// The header stands behind a `#`, as NumPy writes it.
    pub(super) behind_hash: bool,
    /// Lines before the header.
    pub(super) lines_before: u64,
    /// There is no header: the first line is a row.
    pub(super) nameless: bool,
}

/// Finds the header. Lines that begin with `#` are comments; the last one before the rows is the header if the line after it
/// holds numbers and as many cells. A first line of numbers or dates is a row, unless it counts the columns. `no_header`: it is
/// one in any case.
pub(super) fn layout(bytes: &[u8], no_header: bool) -> Layout {
    let mut reported = None;
    let mut hash: Option<(usize, &[u8])> = None;
    let count = |start: usize| lines(&bytes[..start]).count() as u64;
    for (start, line) in lines(bytes) {
        let text = line.trim_ascii();
        if matches!(text, b"" | b"#") {
            continue;
        }
        if let Some(separator) =
            text.strip_prefix(b"sep=").or(text.strip_prefix(b"SEP=")).filter(|rest| rest.len() == 1)
        {
            reported = Some(Separator::Byte(separator[0]));
            continue;
        }
        if let Some(comment) = text.strip_prefix(b"#") {
            hash = Some((start, comment.trim_ascii()));
            continue;
        }
        if hash.is_none() && is_prose(text, &bytes[start..]) {
            continue;
        }
        let next = || {
            lines(&bytes[start..]).skip(1).map(|(_, line)| line).find(|line| is_row(line)).unwrap_or_default()
        };
        if let Some((start, header)) = hash.filter(|_| !no_header) {
            let separator = reported.unwrap_or_else(|| separator(header, text));
            let same = cells(header, separator) == cells(text, separator) && cells(text, separator) > 1;
            if same && numeric(text, separator) && !numeric(header, separator) {
                let lines_before = count(start);
                return Layout { start, separator, behind_hash: true, lines_before, nameless: false };
            }
        }
        let separator = reported.unwrap_or_else(|| separator(text, next()));
        let nameless = no_header || is_nameless(text, next(), separator);
        return Layout { start, separator, behind_hash: false, lines_before: count(start), nameless };
    }
    let separator = Separator::Byte(b',');
    Layout { start: 0, separator, behind_hash: false, lines_before: 0, nameless: false }
}

/// Whether a line is prose before a header behind `#`, as KNMI writes it: another number of cells than in the header and the row below it.
fn is_prose(text: &[u8], from_here: &[u8]) -> bool {
    const FARTHEST: usize = 100;
    let mut header: Option<&[u8]> = None;
    for line in lines(from_here).skip(1).take(FARTHEST).map(|(_, line)| line.trim_ascii()) {
        match (line.strip_prefix(b"#"), header) {
            _ if matches!(line, b"" | b"#") => {}
            (Some(comment), _) => header = Some(comment.trim_ascii()),
            (None, Some(header)) => {
                let separator = separator(header, line);
                let [of_header, of_row, own] = [header, line, text].map(|line| cells(line, separator));
                let is_header = of_header == of_row && of_row > 2 && !numeric(header, separator);
                return is_header && numeric(line, separator) && own != of_row;
            }
            (None, None) if numeric(line, separator(line, line)) => return false,
            (None, None) => {}
        }
    }
    false
}

/// Whether a first line is a row: numbers and dates. Whole numbers in order from 0 or 1 are names, as pandas makes them, if the
/// line below is of another kind, or there are three and more.
fn is_nameless(first: &[u8], second: &[u8], separator: Separator) -> bool {
    // More than any table has is refused later; here each would be a word in memory.
    if cells(first, separator) > MOST_COLUMNS {
        return false;
    }
    let [first, second] = [first, second].map(|line| words(&String::from_utf8_lossy(line), separator));
    let is_value = |cell: &String| is_number(cell.as_bytes()) || date(cell).is_some();
    if first[0].is_empty() || !first.iter().all(is_value) {
        return false;
    }
    let counts = |from: usize| first.iter().enumerate().all(|(k, cell)| cell.parse() == Ok(k + from));
    let is_whole = |cell: &String| cell.parse::<i64>().is_ok();
    !(counts(0) || counts(1)) || (first.len() < 3 && second.iter().all(is_whole))
}

/// The cells of a line, without quotes.
pub(super) fn words(line: &str, separator: Separator) -> Vec<String> {
    let clean = |word: &str| word.trim().trim_matches('"').to_owned();
    match separator {
        Separator::Byte(byte) => line.split(char::from(byte)).map(clean).collect(),
        Separator::Spaces => line.split_whitespace().map(clean).collect(),
    }
}

fn is_row(line: &[u8]) -> bool {
    let text = line.trim_ascii();
    !text.is_empty() && !text.starts_with(b"#")
}

/// The lines of a text with their places, whether they end in LF, CR LF or CR.
pub(super) fn lines(bytes: &[u8]) -> impl Iterator<Item = (usize, &[u8])> {
    let mut at = 0;
    std::iter::from_fn(move || {
        let rest = bytes.get(at..).filter(|rest| !rest.is_empty())?;
        let start = at;
        let length = rest.iter().position(|byte| matches!(byte, b'\n' | b'\r')).unwrap_or(rest.len());
        at += length + if rest[length..].starts_with(b"\r\n") { 2 } else { 1 };
        Some((start, &rest[..length]))
    })
}

/// The separator of a header line: `,`, unless only another one occurs in it, or the first row below shows that the commas are
/// part of the names. A header with none of them may be separated by spaces.
fn separator(header: &[u8], row: &[u8]) -> Separator {
    let count = |line: &[u8], byte: u8| unquoted(line).filter(|&b| b == byte).count();
    let commas = count(header, b',');
    for other in [b';', b'\t'] {
        let others = count(header, other);
        let not_commas = commas != count(row, b',') || !numeric(row, Separator::Byte(b','));
        if commas > 0 && others > 0 && others == count(row, other) && not_commas {
            return Separator::Byte(other);
        }
    }
    if let Some(byte) = [b',', b';', b'\t'].into_iter().find(|&byte| count(header, byte) > 0) {
        return Separator::Byte(byte);
    }
    let words = |line: &[u8]| cells(line, Separator::Spaces);
    // R's rows begin with a number that has no name.
    let fits = words(row) == words(header) || words(row) == words(header) + 1;
    if words(header) > 1 && fits && numeric_words(row) {
        return Separator::Spaces;
    }
    if count(header, b'|') > 0 && count(header, b'|') == count(row, b'|') {
        return Separator::Byte(b'|');
    }
    Separator::Byte(b',')
}

/// The bytes outside double quotes.
fn unquoted(line: &[u8]) -> impl Iterator<Item = u8> + '_ {
    let mut inside = false;
    line.iter().copied().filter(move |&byte| {
        inside ^= byte == b'"';
        !inside
    })
}

fn cells(line: &[u8], separator: Separator) -> usize {
    match separator {
        Separator::Byte(byte) => unquoted(line).filter(|&b| b == byte).count() + 1,
        Separator::Spaces => line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()).count(),
    }
}

fn is_number(cell: &[u8]) -> bool {
    let text = std::str::from_utf8(cell).unwrap_or("x").trim().trim_matches('"');
    text.is_empty() || text.replace(',', ".").parse::<f64>().is_ok()
}

fn numeric_words(line: &[u8]) -> bool {
    line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()).any(is_number)
}

fn numeric(line: &[u8], separator: Separator) -> bool {
    match separator {
        Separator::Byte(byte) => line.split(|&b| b == byte).all(is_number),
        Separator::Spaces => line.split(u8::is_ascii_whitespace).all(is_number),
    }
}

/// A text separated by runs of spaces, with one TAB in the place of each run.
pub(super) fn with_tabs(bytes: &[u8]) -> Vec<u8> {
    let mut out = Vec::with_capacity(bytes.len());
    let mut gap = false;
    for &byte in bytes {
        match byte {
            b' ' | b'\t' => gap = true,
            _ => {
                let at_start = out.last().is_none_or(|last| matches!(last, b'\n' | b'\r'));
                if gap && !at_start && !matches!(byte, b'\n' | b'\r') {
                    out.push(b'\t');
                }
                gap = false;
                out.push(byte);
            }
        }
    }
    out
}

/// The text of a table, as [`decoded`], without a comment in the last line that no line end follows: the library takes that for a
/// row.
///
/// # Errors
/// What the bytes are, if they hold no table as text.
pub(super) fn text_of(bytes: &[u8]) -> Result<(Cow<'_, [u8]>, Option<&'static str>), String> {
    if let Some(reason) = not_data(bytes) {
        return Err(reason);
    }
    let (mut text, encoding) = decoded(bytes);
    if let Some(reason) = not_a_table(&text) {
        return Err(reason.to_owned());
    }
    let last = text.iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1);
    if last > 0 && text[last..].starts_with(b"#") {
        match &mut text {
            Cow::Borrowed(text) => *text = &text[..last],
            Cow::Owned(text) => text.truncate(last),
        }
    }
    Ok((text, encoding))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(text: &str) -> (usize, Separator, bool) {
        let Layout { start, separator, behind_hash, .. } = layout(text.as_bytes(), false);
        (start, separator, behind_hash)
    }

    #[test]
    fn the_header_line_tells_the_separator() {
        for (text, separator) in [
            ("a,b\n1,2\n", Separator::Byte(b',')),
            ("a;b\n1,5;2\n", Separator::Byte(b';')),
            ("x, m;y, m\n1,5;2,5\n", Separator::Byte(b';')),
            ("\"x;y\",b\n1,2\n", Separator::Byte(b',')),
            ("a\tb\n1\t2\n", Separator::Byte(b'\t')),
            ("a  b\n 1  2\n", Separator::Spaces),
            ("a|b\n1|2\n", Separator::Byte(b'|')),
            ("one column\n1\n", Separator::Byte(b',')),
        ] {
            assert_eq!(found(text).1, separator, "{text}");
        }
    }

    #[test]
    fn comments_and_a_header_behind_a_hash_are_told_apart() {
        assert_eq!(found("# made by hand\n\na,b\n1,2\n"), (16, Separator::Byte(b','), false));
        assert_eq!(found("# a,b\n1,2\n"), (0, Separator::Byte(b','), true));
        assert_eq!(found("# run 7\n# x y\n1.0 2.0\n"), (8, Separator::Spaces, true));
        assert_eq!(found("sep=;\r\na;b\r\n1;2\r\n"), (7, Separator::Byte(b';'), false));
    }

    #[test]
    fn a_first_line_of_numbers_is_a_row_unless_it_counts_the_columns() {
        let nameless = |text: &str| layout(text.as_bytes(), false).nameless;
        for rows in [
            "1 2\n3 4\n",
            "-0.5,1e-3\n1,2\n",
            "2024-01-01,3\n2024-01-02,4\n",
            "# made\n\n7;8\n9;1\n",
            "nan,2.5\n",
        ] {
            assert!(nameless(rows), "{rows}");
        }
        for named in ["0,1\n0.5,0.25\n", "1,2,3\n4,5,6\n", ",0,1\n0,5,6\n", "a,1\n2,3\n", "# a b\n1 2\n"] {
            assert!(!nameless(named), "{named}");
        }
        assert!(layout(b"a,b\n1,2\n", true).nameless);
    }

    #[test]
    fn every_encoding_gives_the_same_text() {
        let text = "tempo,größe\n1,2\n";
        let utf16: Vec<u16> = text.encode_utf16().collect();
        let little: Vec<u8> = utf16.iter().flat_map(|unit| unit.to_le_bytes()).collect();
        let big: Vec<u8> = utf16.iter().flat_map(|unit| unit.to_be_bytes()).collect();
        let latin: Vec<u8> = text.chars().map(|c| c as u8).collect();
        let marked = |mark: &[u8], rest: &[u8]| [mark, rest].concat();
        for bytes in [
            text.as_bytes().to_vec(),
            marked(b"\xef\xbb\xbf", text.as_bytes()),
            marked(b"\xff\xfe", &little),
            marked(b"\xfe\xff", &big),
            latin,
        ] {
            assert_eq!(String::from_utf8_lossy(&decoded(&bytes).0), text);
        }
        assert_eq!(
            decoded(&"a,b\n1,2\n".bytes().flat_map(|b| [b, 0]).collect::<Vec<_>>()).0,
            &b"a,b\n1,2\n"[..]
        );
    }

    #[test]
    fn runs_of_spaces_become_one_separator() {
        assert_eq!(with_tabs(b"  a   b \n1 \t 2\n"), b"a\tb\n1\t2\n");
    }
}
