//! A file as columns, whatever is in them: for tables that are not one row per time. The header may be missing, or stand behind
//! lines of other facts, as in exports of motion capture.

use std::path::Path;

use super::{Cells, Separator, binary, binary::Column, columns::check_count, dialect, reader, time};
use crate::{Error, Result, ensure, grammar::Parsed, memory::Memory};

/// The first lines, among which the header is looked for.
const HEAD: usize = 200;

/// Cells after which the memory that they take is checked.
const CHECKED: usize = 1 << 20;

/// Named columns with as many rows each.
pub(crate) struct Grid {
    pub(crate) columns: Vec<(String, Column)>,
    /// Whether the file has no header; the columns are then called 1, 2, ...
    pub(crate) nameless: bool,
    /// Frames per second, if a comment before the rows says so: `# framerate: 25`.
    pub(crate) frame_rate: Option<f64>,
}

impl Grid {
    /// Reads a file. `is_header` says whether these words can be the names of the columns.
    ///
    /// # Errors
    /// A file that cannot be read, or is not a table.
    pub(crate) fn read(
        path: &Path,
        missing: &[f64],
        memory: Memory,
        is_header: impl Fn(&[String]) -> bool,
    ) -> Result<Self> {
        let fault = |reason: String| Error::file(path, reason);
        let bytes = dialect::content(path, memory)?;
        if let Some(columns) = binary::columns(&bytes, memory) {
            let columns = columns.map_err(|complaint| fault(complaint.reason()))?;
            return Ok(Self { columns, nameless: false, frame_rate: None });
        }
        dialect::text_of(&bytes)
            .and_then(|(text, _)| Self::of_text(&text, missing, memory, is_header))
            .map_err(fault)
    }

    fn of_text(
        text: &[u8],
        missing: &[f64],
        memory: Memory,
        is_header: impl Fn(&[String]) -> bool,
    ) -> Parsed<Self> {
        let lines: Vec<(usize, &[u8])> =
            dialect::lines(text).filter(|(_, line)| !line.trim_ascii().is_empty()).take(HEAD).collect();
        let separators =
            [Separator::Byte(b','), Separator::Byte(b';'), Separator::Byte(b'\t'), Separator::Spaces];
        let named = lines.iter().find_map(|(start, line)| {
            let names_columns = |separator: &Separator| is_header(&words(line, *separator));
            Some((*start, separators.into_iter().find(names_columns)?))
        });
        let (start, separator) = named.unwrap_or_else(|| {
            let first = lines.iter().find(|(_, line)| !line.trim_ascii().starts_with(b"#"));
            let most = |separator: &&Separator| first.map_or(0, |(_, line)| words(line, **separator).len());
            let best = separators.iter().rev().max_by_key(most).copied().unwrap_or(Separator::Spaces);
            (first.map_or(0, |(start, _)| *start), best)
        });
        let body = &text[start..];
        // A header behind `#`; what follows is its first name, not an empty one.
        let body = body.strip_prefix(b"#").map_or(body, |rest| {
            let spaces = rest.iter().take_while(|byte| **byte == b' ').count();
            &rest[spaces..]
        });
        let tabs = (separator == Separator::Spaces).then(|| dialect::with_tabs(body));
        let byte = if let Separator::Byte(byte) = separator { byte } else { b'\t' };
        let body = tabs.as_deref().unwrap_or(body);
        let grid = columns_of(body, byte, named.is_some(), missing, memory)?;
        Ok(Self { frame_rate: lines.iter().find_map(|(_, line)| frame_rate(line)), ..grid })
    }
}

/// The number that a comment gives as the rate of frames: `#framerate: 10`, `# frame rate = 25.00 fps`.
fn frame_rate(line: &[u8]) -> Option<f64> {
    let line = std::str::from_utf8(line).ok()?.trim().strip_prefix('#')?.to_lowercase();
    let names = ["framerate", "frame rate", "frame_rate", "fps"];
    let rest = names.iter().find_map(|name| line.trim().strip_prefix(name))?;
    let number = rest.trim_start_matches([' ', ':', '=', '\t']).split([' ', '\t']).next()?;
    let rate: f64 = number.trim_end_matches("fps").trim_end_matches("hz").parse().ok()?;
    (rate.is_finite() && rate > 0.0).then_some(rate)
}

/// The cells of one line.
fn words(line: &[u8], separator: Separator) -> Vec<String> {
    let line = String::from_utf8_lossy(line);
    let line = line.trim().trim_start_matches('#').trim_start();
    dialect::words(line, separator)
}

fn columns_of(body: &[u8], separator: u8, named: bool, missing: &[f64], memory: Memory) -> Parsed<Grid> {
    let mut records = reader(body, separator).into_byte_records();
    let mut names: Vec<String> = Vec::new();
    if named {
        let first = records.next().transpose().map_err(|error| error.to_string())?.unwrap_or_default();
        names = first.iter().map(|cell| String::from_utf8_lossy(cell).trim().to_owned()).collect();
    }
    let cells = Cells { missing, decimal_comma: separator != b',', encode: false };
    let mut columns: Vec<Column> = Vec::new();
    for (row, record) in records.enumerate() {
        let record = record.map_err(|error| error.to_string())?;
        let width = if names.is_empty() { record.len() } else { names.len() };
        if columns.is_empty() {
            check_count(width)?;
            columns = (0..width).map(|_| Column::Numbers(Vec::new())).collect();
        }
        for (place, column) in columns.iter_mut().enumerate() {
            let cell = String::from_utf8_lossy(record.get(place).unwrap_or_default());
            column.add(cell.trim(), row, &cells);
        }
        // A row may have fewer cells than the header.
        if row.saturating_mul(width) % CHECKED < width {
            let held = columns.iter().map(Column::bytes).sum();
            memory.check_growth(held, body.len() as u64)?;
        }
    }
    ensure(!columns.is_empty(), || "it has no rows")?;
    let name = |place: usize| names.get(place).cloned().unwrap_or_else(|| (place + 1).to_string());
    let columns = columns.into_iter().enumerate().map(|(place, column)| (name(place), column)).collect();
    Ok(Grid { columns, nameless: !named, frame_rate: None })
}

impl Column {
    /// Adds a cell. A column that has had numbers so far becomes one of times or words if the cell is one.
    fn add(&mut self, cell: &str, row: usize, cells: &Cells<'_>) {
        if let Self::Numbers(numbers) = self {
            match cells.number(cell) {
                Ok(Some(number)) => return numbers.push(number),
                Err(()) => return numbers.push(f64::NAN),
                Ok(None) => {}
            }
            let none_yet = numbers.iter().all(|number| number.is_nan());
            *self = match time::date(cell) {
                Some(_) if none_yet => Self::Times(vec![f64::NAN; row]),
                _ => Self::Words(
                    numbers.iter().map(|number| (!number.is_nan()).then(|| number.to_string())).collect(),
                ),
            };
        }
        match self {
            Self::Times(times) => times.push(time::date(cell).unwrap_or(f64::NAN)),
            Self::Words(words) => words.push((!cell.is_empty()).then(|| cell.to_owned())),
            Self::Numbers(_) | Self::Other(_) => {}
        }
    }

    /// The value of a row as a number; NaN if it is none.
    pub(crate) fn number(&self, row: usize) -> f64 {
        match self {
            Self::Numbers(numbers) | Self::Times(numbers) => numbers.get(row).copied().unwrap_or(f64::NAN),
            Self::Words(_) | Self::Other(_) => f64::NAN,
        }
    }

    /// The value of a row as text: 7 for 7.0; `None` if it is missing.
    pub(crate) fn text(&self, row: usize) -> Option<String> {
        match self {
            Self::Numbers(numbers) | Self::Times(numbers) => {
                numbers.get(row).filter(|number| !number.is_nan()).map(f64::to_string)
            }
            Self::Words(words) => words.get(row).cloned().flatten(),
            Self::Other(_) => None,
        }
    }

    /// How many rows it has.
    pub(crate) fn len(&self) -> usize {
        match self {
            Self::Numbers(numbers) | Self::Times(numbers) => numbers.len(),
            Self::Words(words) => words.len(),
            Self::Other(_) => 0,
        }
    }
}
