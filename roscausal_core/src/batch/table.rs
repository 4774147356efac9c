//! Reads any CSV with a header into columns of numbers. Every error names line and column.
//!
//! The csv crate reads the cells. Which character separates them is our one rule, the header line, because a user can
//! foresee it; `csv-sniffer` 0.3 guesses from statistics of the first rows, and a wrong guess has no line to point at.

use std::{fmt, fs::File, io::Read, path::Path};

use csv::{ByteRecord, ReaderBuilder};
use ndarray::Array2;

use roscausal_discovery::{DataFrame, names};

use super::header;
use crate::{Error, Result, content::not_data};

/// Names of the column of sample times (seconds), which is not a variable.
const TIME_NAMES: [&str; 4] = ["time", "t", "timestamp", "stamp"];

/// A CSV file as numbers, `n_rows x n_columns`. Missing cells are NaN.
#[derive(Clone, Debug)]
pub struct Table {
    /// Names of the variables, as in the header (repaired if a TAB split them).
    pub names: Vec<String>,
    /// Samples, time in rows, one column per variable.
    pub values: Array2<f64>,
    /// Sample times in seconds, if the file has them.
    pub time: Option<Vec<f64>>,
    /// What a reader of the data should know.
    pub notes: Vec<Note>,
}

/// What the reader of a table should know of a column; as text, one sentence.
#[derive(Clone, Debug, PartialEq)]
pub enum Note {
    /// It has no number at all.
    Empty {
        /// Its name.
        column: String,
    },
    /// Some of its cells have no number.
    Missing {
        /// Its name.
        column: String,
        /// How many have none.
        missing: usize,
        /// How many cells it has.
        cells: usize,
    },
    /// All its numbers are the same.
    Constant {
        /// Its name.
        column: String,
        /// That number.
        value: f64,
    },
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Empty { column } => {
                write!(f, "column '{column}' has no number at all; leave it out with --columns")
            }
            Self::Missing { column, missing, cells } => write!(
                f,
                "column '{column}': {missing} of {cells} cells are empty or NaN; samples that need them are left out"
            ),
            Self::Constant { column, value } => {
                write!(f, "column '{column}' is constant ({value}): it can be neither cause nor effect")
            }
        }
    }
}

/// The step between samples that recordings of one system share, seconds; `None` where none has times.
///
/// # Errors
/// A recording whose step differs by more than 1 % from that of one before it: a lag would mean two things.
pub fn common_step<'a>(recordings: impl IntoIterator<Item = (&'a Path, &'a Table)>) -> Result<Option<f64>> {
    let mut first: Option<(&Path, f64)> = None;
    for (path, table) in recordings {
        match (first, table.dt()) {
            (Some((other, step)), Some(dt)) if (dt - step).abs() > 0.01 * step => {
                let [dt, step] = [dt, step].map(|secs| (secs * 1e6).round() / 1e6);
                let reason = format!(
                    "its step is {dt} s, that of {} is {step} s; recordings of one system need one step: resample \
                     one of them, or analyse them apart",
                    other.display()
                );
                return Err(Error::file(path, reason));
            }
            (None, Some(dt)) => first = Some((path, dt)),
            _ => {}
        }
    }
    Ok(first.map(|(_, step)| step))
}

/// What is wrong: the file, or the selection of columns.
#[derive(Debug)]
enum Complaint {
    File(String),
    Columns(String),
}

impl<S: Into<String>> From<S> for Complaint {
    fn from(reason: S) -> Self {
        Self::File(reason.into())
    }
}

impl Table {
    /// Reads a CSV file with a header line and `,`, `;` or TAB between cells. With `wanted`, only those columns are
    /// read, in that order, in any spelling; otherwise all columns except the times.
    ///
    /// # Errors
    /// With line and column: an unreadable or empty file, a header without rows, duplicate names, ragged rows, text
    /// or infinite cells, time that does not increase. Also an unknown column, with the nearest name.
    pub fn read(path: &Path, wanted: Option<&[String]>) -> Result<Self> {
        let mut bytes = Vec::new();
        File::open(path)
            .and_then(|mut file| file.read_to_end(&mut bytes))
            .map_err(|e| Error::file(path, e))?;
        Self::from_bytes(&bytes, wanted, path)
    }

    /// Reads a CSV file from memory; `path` is only used in errors.
    ///
    /// # Errors
    /// As [`Table::read`].
    pub fn from_bytes(bytes: &[u8], wanted: Option<&[String]>, path: &Path) -> Result<Self> {
        Self::parse(bytes, wanted).map_err(|complaint| match complaint {
            Complaint::File(reason) => Error::file(path, reason),
            Complaint::Columns(reason) => Error::param("columns", reason),
        })
    }

    /// Median step between samples in seconds, if the file has times.
    pub fn dt(&self) -> Option<f64> {
        let time = self.time.as_ref()?;
        let mut steps: Vec<f64> = time.windows(2).map(|pair| pair[1] - pair[0]).collect();
        steps.sort_by(f64::total_cmp);
        steps.get(steps.len() / 2).copied()
    }

    /// The table as one recording.
    ///
    /// # Errors
    /// Fewer than two variables.
    pub fn into_data_frame(self) -> Result<DataFrame> {
        Ok(DataFrame::new(vec![self.values], self.names)?)
    }

    fn parse(bytes: &[u8], wanted: Option<&[String]>) -> std::result::Result<Self, Complaint> {
        if let Some(reason) = not_data(bytes) {
            return Err(Complaint::File(reason));
        }
        let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        if bytes.iter().all(u8::is_ascii_whitespace) {
            return Err(Complaint::from("the file is empty; a header line and rows of numbers are needed"));
        }
        let mut reader = ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .delimiter(delimiter(bytes))
            .from_reader(bytes);
        let mut records = reader.byte_records();
        let first = records.next().transpose().map_err(|e| e.to_string())?.unwrap_or_default();
        let (header, joined) = header::repaired(&texts(&first, 1)?);
        check_names(&header)?;
        let time_column = header.iter().position(|name| TIME_NAMES.contains(&name.to_lowercase().as_str()));
        let columns = match wanted {
            Some(wanted) => chosen(&header, wanted).map_err(Complaint::Columns)?,
            None => (0..header.len()).filter(|&column| Some(column) != time_column).collect(),
        };
        if columns.is_empty() {
            let reason =
                format!("line 1: the only column is '{}'; columns of variables are needed", header[0]);
            return Err(Complaint::File(reason));
        }

        let (mut numbers, mut time, mut lines) = (Vec::new(), Vec::new(), Vec::new());
        let mut counter = Lines { bytes, at: 0, line: 1 };
        for record in records {
            let record = record.map_err(|e| e.to_string())?;
            let line = record.position().map_or(0, |position| counter.line_of(position.byte()));
            let cells = cells(&record, header.len(), joined, line)?;
            for &column in &columns {
                numbers.push(number(&cells[column], &header[column], line)?);
            }
            if let Some(column) = time_column {
                time.push(number(&cells[column], &header[column], line)?);
            }
            lines.push(line);
        }
        if lines.is_empty() {
            return Err(Complaint::from(
                "there is only a header (line 1); rows of numbers are needed below it",
            ));
        }
        if let Some(column) = time_column {
            check_time(&time, &header[column], &lines)?;
        }
        let values =
            Array2::from_shape_vec((lines.len(), columns.len()), numbers).map_err(|e| e.to_string())?;
        let names: Vec<String> = columns.iter().map(|&column| header[column].clone()).collect();
        let notes = Self::notes_on(&names, &values);
        Ok(Self { names, values, time: time_column.map(|_| time), notes })
    }

    fn notes_on(names: &[String], values: &Array2<f64>) -> Vec<Note> {
        let mut notes = Vec::new();
        for (name, cells) in names.iter().zip(values.columns()) {
            let (column, missing) = (name.clone(), cells.iter().filter(|v| v.is_nan()).count());
            let mut present = cells.iter().copied().filter(|v| !v.is_nan());
            let Some(value) = present.next() else {
                notes.push(Note::Empty { column });
                continue;
            };
            if missing > 0 {
                notes.push(Note::Missing { column: column.clone(), missing, cells: cells.len() });
            }
            if present.all(|v| v == value) {
                notes.push(Note::Constant { column, value });
            }
        }
        notes
    }
}

/// Counts the lines of a file as an editor does, whether they end in LF, CR LF or CR. (The csv crate counts a CR LF as the next
/// record begins, and is one line behind.)
struct Lines<'a> {
    bytes: &'a [u8],
    at: usize,
    line: u64,
}

impl Lines<'_> {
    /// The line of the record that is found from byte `from` on; `from` never goes back.
    fn line_of(&mut self, from: u64) -> u64 {
        let is_end = |byte: &u8| matches!(byte, b'\r' | b'\n');
        let from = (from as usize).clamp(self.at, self.bytes.len());
        let start = from + self.bytes[from..].iter().take_while(|byte| is_end(byte)).count();
        for at in self.at..start {
            let ends = match self.bytes[at] {
                b'\n' => true,
                b'\r' => self.bytes.get(at + 1) != Some(&b'\n'),
                _ => false,
            };
            self.line += u64::from(ends);
        }
        self.at = start;
        self.line
    }
}

/// The separator of the header line: `,`, unless only another one occurs in it.
fn delimiter(bytes: &[u8]) -> u8 {
    let header = bytes.split(|&b| b == b'\n').find(|line| !line.trim_ascii().is_empty()).unwrap_or_default();
    [b',', b';', b'\t'].into_iter().find(|d| header.contains(d)).unwrap_or(b',')
}

fn texts(record: &ByteRecord, line: u64) -> std::result::Result<Vec<String>, String> {
    let text = |(column, cell): (usize, &[u8])| match std::str::from_utf8(cell) {
        Ok(text) => Ok(text.trim_matches(' ').to_owned()),
        Err(_) => {
            Err(format!("line {line}, column {}: not text in UTF-8; save the file as UTF-8 CSV", column + 1))
        }
    };
    record.iter().enumerate().map(text).collect()
}

fn check_names(names: &[String]) -> std::result::Result<(), String> {
    if names.iter().all(|name| name.parse::<f64>().is_ok()) {
        return Err(
            "line 1 holds numbers; the first line must be a header with the names of the columns".into()
        );
    }
    for (column, name) in names.iter().enumerate() {
        if name.trim().is_empty() {
            return Err(format!("line 1, column {}: the name is empty; name every column", column + 1));
        }
        if let Some(earlier) = names[..column].iter().position(|other| other == name) {
            return Err(format!(
                "line 1: '{name}' names both column {} and column {}; give every column a name of its own",
                earlier + 1,
                column + 1
            ));
        }
    }
    Ok(())
}

/// The columns of `header` that `wanted` names.
fn chosen(header: &[String], wanted: &[String]) -> std::result::Result<Vec<usize>, String> {
    let mut columns = Vec::new();
    for name in wanted {
        let Some(column) = names::position(header, name) else {
            let hint =
                names::nearest(header, name).map_or(String::new(), |near| format!("did you mean '{near}'? "));
            return Err(format!("there is no column '{name}'; {hint}columns: {}", header.join(", ")));
        };
        if columns.contains(&column) {
            return Err(format!("'{name}' is named twice; name each column once"));
        }
        columns.push(column);
    }
    Ok(columns)
}

fn cells(
    record: &ByteRecord,
    expected: usize,
    joined: usize,
    line: u64,
) -> std::result::Result<Vec<String>, String> {
    let mut cells = texts(record, line)?;
    // A header name that was split in two leaves as many empty cells at the end of each row.
    while joined > 0 && cells.len() > expected && cells.last().is_some_and(String::is_empty) {
        cells.pop();
    }
    if cells.len() == expected {
        return Ok(cells);
    }
    Err(format!(
        "line {line} has {} cells, the header has {expected} names; every row needs one cell per name (empty for a \
         missing value)",
        cells.len(),
    ))
}

fn number(cell: &str, name: &str, line: u64) -> std::result::Result<f64, String> {
    let place = format!("line {line}, column '{name}'");
    match cell.to_lowercase().as_str() {
        "" | "nan" | "na" | "null" => Ok(f64::NAN),
        lower => match lower.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            Ok(_) => Err(format!("{place}: '{cell}' is infinite; leave the cell empty or remove the row")),
            Err(_) => Err(format!(
                "{place}: '{}' is not a number; correct it, leave the cell empty, or name the columns to use with \
                 --columns",
                cell.chars().take(40).collect::<String>()
            )),
        },
    }
}

fn check_time(time: &[f64], name: &str, lines: &[u64]) -> std::result::Result<(), String> {
    if let Some(row) = time.iter().position(|t| t.is_nan()) {
        return Err(format!(
            "line {}, column '{name}': the time is missing; fill it in or remove the row",
            lines[row]
        ));
    }
    let Some(row) = time.windows(2).position(|pair| pair[1] <= pair[0]) else { return Ok(()) };
    let what = if time[row + 1] < time[row] { "goes back" } else { "stands still" };
    Err(format!(
        "line {}, column '{name}': time {what} (from {} to {}); sort the rows, or split the recordings into files \
         of their own",
        lines[row + 1],
        time[row],
        time[row + 1]
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> std::result::Result<Table, Complaint> {
        Table::parse(text.as_bytes(), None)
    }

    fn complaint(text: &str) -> String {
        match parse(text) {
            Err(Complaint::File(reason)) => reason,
            other => panic!("{text}: {other:?}"),
        }
    }

    #[test]
    fn a_file_of_the_original_with_a_broken_header_is_read() {
        let table = parse("time,r_{gx},r_{,heta},r_v\n1,2,3,4,\n1.3,2,4,4,\n").expect("reads");
        assert_eq!(table.names, ["r_{gx}", "r_{\\theta}", "r_v"]);
        assert_eq!(table.values[[1, 1]], 4.0);
        assert!((table.dt().expect("has times") - 0.3).abs() < 1e-12);
    }

    #[test]
    fn a_header_with_a_real_tab_is_read() {
        let table = parse("r_{\theta},r_v\n1,2\n3,4\n").expect("reads");
        assert_eq!(table.names, ["r_{\\theta}", "r_v"]);
    }

    #[test]
    fn separators_of_other_countries_are_found() {
        assert_eq!(parse("a;b\n1;2\n").expect("reads").names, ["a", "b"]);
        assert_eq!(parse("a\tb\n1\t2\n").expect("reads").names, ["a", "b"]);
    }

    #[test]
    fn a_complaint_names_line_column_and_the_way_out() {
        assert!(complaint("").contains("empty"));
        assert!(complaint("a,b\n").contains("only a header"));
        assert_eq!(
            complaint("a,b\n1,2\n3,fast\n"),
            "line 3, column 'b': 'fast' is not a number; correct it, leave the cell empty, or name the columns to use \
             with --columns"
        );
        assert!(complaint("a,b\n1,2\n3\n").starts_with("line 3 has 1 cells, the header has 2 names"));
        assert!(complaint("a,b\n1,2,3\n").starts_with("line 2 has 3 cells"));
        assert!(complaint("a,b,a\n1,2,3\n").contains("both column 1 and column 3"));
        assert!(complaint("a,b\n1,inf\n").contains("infinite"));
        assert!(complaint("time,b\n1,2\n0.5,2\n").starts_with("line 3, column 'time': time goes back"));
        assert!(complaint("1,2\n3,4\n").contains("header"));
    }

    #[test]
    fn missing_cells_and_constant_columns_are_told() {
        let table = parse("a,b,c\n1,,5\n2,NaN,5\n3,1,5\n").expect("reads");
        assert!(table.values[[0, 1]].is_nan());
        let missing = Note::Missing { column: "b".into(), missing: 2, cells: 3 };
        let constant = |column: &str, value| Note::Constant { column: column.into(), value };
        assert_eq!(table.notes, [missing, constant("b", 1.0), constant("c", 5.0)]);
        assert!(table.notes[0].to_string().starts_with("column 'b': 2 of 3 cells"));
        assert!(table.notes[2].to_string().starts_with("column 'c' is constant (5)"));
    }

    #[test]
    fn recordings_of_one_system_have_one_step() {
        let table = |text: &str| parse(text).expect("reads");
        let (slow, fast) = (table("time,a\n0,1\n0.3,2\n0.6,3\n"), table("time,a\n0,1\n0.1,2\n0.2,3\n"));
        let (jittery, timeless) = (table("time,a\n0,1\n0.301,2\n0.602,3\n"), table("a\n1\n2\n"));
        let step = |tables: &[&Table]| {
            common_step(
                tables.iter().zip(["x.csv", "y.csv", "z.csv"]).map(|(table, name)| (Path::new(name), *table)),
            )
        };
        assert_eq!(step(&[&timeless, &slow, &jittery]).expect("one step"), slow.dt());
        assert_eq!(step(&[&timeless]).expect("none"), None);
        let error = step(&[&slow, &timeless, &fast]).expect_err("two steps").to_string();
        assert!(
            error.contains("z.csv") && error.contains("its step is 0.1 s, that of x.csv is 0.3 s"),
            "{error}"
        );
    }

    #[test]
    fn only_the_wanted_columns_are_read() {
        let wanted = ["h_dg".to_owned(), "h_v".to_owned()];
        let table = Table::parse(b"h_v,note,h_dg\n1,fast,2\n2,slow,3\n", Some(&wanted)).expect("reads");
        assert_eq!(table.names, wanted);
        assert_eq!(table.values[[1, 0]], 3.0);
    }

    #[test]
    fn an_unknown_column_gets_the_nearest_name() {
        match Table::parse(b"h_v,h_dg\n1,2\n2,3\n", Some(&["h_gd".to_owned()])) {
            Err(Complaint::Columns(reason)) => assert!(reason.contains("did you mean 'h_dg'?"), "{reason}"),
            other => panic!("{other:?}"),
        }
    }
}
