//! Tables that are not text: Parquet, Arrow and NumPy files, recognised by their first bytes.
//!
//! 1. `columnar` (Parquet, Arrow; a feature) and `numpy` give columns of numbers, words or times.
//! 2. They are chosen, encoded and checked as those of a CSV file.

#[cfg(feature = "columnar")]
mod claims;
#[cfg(feature = "columnar")]
mod columnar;
#[cfg(feature = "columnar")]
mod guard;
mod numpy;

use super::{
    Codes, Complaint, Note, Parsed, Reading, Table,
    columns::{is_index, one, read, time_column},
    time,
};
use crate::{ensure, memory::Memory};
use roscausal_discovery::Named;

/// The index that pandas writes into a file.
const PANDAS_INDEX: &str = "__index_level_0__";

/// A column of any file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Column {
    /// Missing values are NaN.
    Numbers(Vec<f64>),
    /// Seconds since 1970 or since midnight.
    Times(Vec<f64>),
    /// `None` where a word is missing.
    Words(Vec<Option<String>>),
    /// What it is instead, such as `List`.
    Other(String),
}

impl Column {
    /// Memory that its cells take, bytes.
    pub(super) fn bytes(&self) -> u64 {
        (match self {
            Self::Numbers(numbers) | Self::Times(numbers) => size_of_val(numbers.as_slice()),
            // Short words have a block of the heap each.
            Self::Words(words) => words.len() * (size_of::<Option<String>>() + size_of::<usize>()),
            Self::Other(_) => 0,
        }) as u64
    }
}

/// The columns of a file, by name; `None` if the bytes are no such file.
pub(super) fn columns(bytes: &[u8], memory: Memory) -> Option<Parsed<Vec<(String, Column)>>> {
    if bytes.starts_with(b"\x93NUMPY") {
        return Some(numpy::array_file(bytes, memory).map_err(Complaint::File));
    }
    if bytes.starts_with(b"PK\x03\x04") {
        return numpy::archive(bytes, memory).map(|read| read.map_err(Complaint::File));
    }
    #[cfg(feature = "columnar")]
    if let Some(read) = columnar::columns(bytes, memory) {
        return Some(read.map_err(Complaint::File));
    }
    None
}

/// The table of these columns.
pub(in crate::batch::table) fn table(columns: Vec<(String, Column)>, reading: &Reading) -> Parsed<Table> {
    super::columns::check_count(columns.len())?;
    ensure(!columns.is_empty(), || Complaint::from("it has no columns; columns of variables are needed"))?;
    let header: Vec<String> = columns.iter().map(|(name, _)| name.clone()).collect();
    super::columns::check_names(&header, "names").map_err(Complaint::File)?;
    let time = time_place(&columns, &header, reading)?;
    let place = time.map(|(column, _)| column);
    let named = reading.columns.is_some();
    let mut wanted = read(&header, reading, place)?;
    wanted.retain(|&column| {
        let index = header[column] == PANDAS_INDEX || is_index(&header[column]);
        named || (Some(column) != place && !index)
    });
    ensure(!wanted.is_empty(), || {
        Complaint::from("it has no columns besides the times; columns of variables are needed")
    })?;
    let mut reported = Vec::new();
    let numbers = wanted.iter().map(|&column| as_numbers(&columns[column], reading, &mut reported));
    let numbers = numbers.collect::<Parsed<Vec<_>>>()?;
    let rows = numbers.first().map_or(0, Vec::len);
    ensure(rows != 0, || Complaint::from("it has no rows; rows of numbers are needed"))?;
    let values = super::column_by_column(numbers, rows)?;
    let is_made_up = |name: &String| name.strip_prefix("x_").is_some_and(|n| n.parse::<usize>().is_ok());
    super::check_stands(header.iter().all(is_made_up), values.dim())?;
    let names: Vec<String> = wanted.iter().map(|&column| header[column].clone()).collect();
    let mut notes = Table::notes_on(&names, &values);
    notes.splice(0..0, reported);
    let time = time.map(|(column, unit)| seconds(&columns[column], reading, unit, &mut notes)).transpose()?;
    Ok(Table { names, values, time, notes })
}

/// The column of times: the one that is named so, or else the only one that holds times.
fn time_place(
    columns: &[(String, Column)],
    header: &[String],
    reading: &Reading,
) -> Parsed<Option<(usize, Option<time::Unit>)>> {
    match reading.time_column.as_deref() {
        Some("none") => return Ok(None),
        Some(name) => {
            let column = one(header, name).map_err(|reason| Complaint::Setting("time-column", reason))?;
            return Ok(Some((column, None)));
        }
        None => {}
    }
    let times: Vec<usize> =
        (0..columns.len()).filter(|&column| matches!(columns[column].1, Column::Times(_))).collect();
    Ok(time_column(header).or(match times.as_slice() {
        [only] => Some((*only, None)),
        _ => None,
    }))
}

fn as_numbers(
    (name, column): &(String, Column),
    reading: &Reading,
    reported: &mut Vec<Note>,
) -> Parsed<Vec<f64>> {
    let numbers = match column {
        Column::Numbers(numbers) | Column::Times(numbers) => numbers.clone(),
        Column::Words(words) if reading.encode => {
            let mut codes = Codes::default();
            let given: Vec<Option<f64>> =
                words.iter().map(|word| word.as_deref().map(|word| codes.of(word))).collect();
            let sorted = codes.sorted();
            reported.push(Note::Coded { column: name.clone(), words: codes.words() });
            let number = |code: Option<f64>| code.map_or(f64::NAN, |code| sorted[code as usize]);
            return Ok(given.into_iter().map(number).collect());
        }
        Column::Words(words) => {
            let row = words.iter().position(Option::is_some).unwrap_or(0);
            let word: String =
                words.get(row).cloned().flatten().unwrap_or_default().chars().take(40).collect();
            let (row, columns, encode) = (row + 1, Named("columns"), Named("encode"));
            return Err(Complaint::File(format!(
                "row {row}, column '{name}': '{word}' is not a number; name the columns to use with {columns}, or turn words into codes \
                 with {encode} codes"
            )));
        }
        Column::Other(what) => {
            let columns = Named("columns");
            return Err(Complaint::File(format!(
                "column '{name}' holds {what}, not numbers; save each part of rows and columns as a file, which is a recording, or, if \
                 there are others, leave it out with {columns} '!{name}'"
            )));
        }
    };
    if let Some(row) = numbers.iter().position(|value| value.is_infinite()) {
        return Err(Complaint::File(format!(
            "row {}, column '{name}': the value is infinite; make it missing (NaN) or remove the row",
            row + 1
        )));
    }
    let missing = |value: f64| if reading.missing.contains(&value) { f64::NAN } else { value };
    Ok(numbers.into_iter().map(missing).collect())
}

/// The times in seconds, in order.
fn seconds(
    (name, column): &(String, Column),
    reading: &Reading,
    unit: Option<time::Unit>,
    notes: &mut Vec<Note>,
) -> Parsed<Vec<f64>> {
    let (times, reported) = match column {
        Column::Times(times) => (times.clone(), None),
        Column::Numbers(numbers) => time::in_seconds(numbers.clone(), reading.time_unit.or(unit)),
        Column::Words(words) => {
            let read = |(row, word): (usize, &Option<String>)| {
                let word = word.as_deref().unwrap_or_default();
                let example = "2026-11-24T08:30:00.25+01:00";
                let place = || format!("row {}, column '{name}'", row + 1);
                time::date(word)
                    .ok_or_else(|| format!("{}: '{word}' is not a date such as {example}", place()))
            };
            (words.iter().enumerate().map(read).collect::<std::result::Result<_, _>>()?, None)
        }
        Column::Other(what) => {
            let named = Named("time_column");
            return Err(format!("column '{name}' holds {what}, not times; {named} names another").into());
        }
    };
    notes.extend(reported.map(Note::Read));
    if let Some(row) = times.iter().position(|t| !t.is_finite()) {
        let row = row + 1;
        return Err(format!("row {row}, column '{name}': the time is missing; remove the row").into());
    }
    let wrong = |pair: &[f64]| pair[1] < pair[0] || (pair[1] == pair[0] && !reading.equal_times);
    if let (Some(row), None) = (times.windows(2).position(wrong), &reading.recording) {
        let place = format!("row {}, column '{name}'", row + 2);
        return Err(super::out_of_order(&place, times[row], times[row + 1], name).into());
    }
    Ok(times)
}
