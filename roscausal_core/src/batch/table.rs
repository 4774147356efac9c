//! Reads any CSV with a header into columns of numbers. Every error names line and column.
//!
//! 1. `dialect`: unpacked, as UTF-8, header and separator found; the csv crate reads the cells.
//! 2. `columns`: which ones are wanted, and which one is the time.
//! 3. `cells`: each as a number.
//! 4. `time`: in seconds.
//!
//! `binary` reads Parquet, Arrow and NumPy files to the same end.
//!
//! `steps` then brings the rows to one step, `join` several files of one recording side by side.

pub(crate) mod binary;
mod cells;
pub(crate) mod columns;
mod derived;
mod dialect;
pub(crate) mod grid;
mod join;
mod split;
mod steps;
pub(crate) mod time;

use std::{collections::BTreeMap, fmt, io::BufRead, path::Path};

use csv::{ByteRecord, ReaderBuilder, StringRecord};
use ndarray::{Array2, Axis, ShapeBuilder};

use roscausal_discovery::{Named, names};

use self::{
    cells::{Cells, Codes},
    dialect::{Layout, Separator},
};
use super::header;
use crate::{Error, Result, ensure, memory::Memory};

pub use derived::Derived;
pub use split::is_id;
pub(crate) use steps::median;
pub use steps::{Resample, Steps};
pub use time::Unit;

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

/// How a table is read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reading {
    /// Columns to read, in that order: names in any spelling, patterns with `*` and `?`, ranges `a..c`, and `!pattern` to leave
    /// out. `None`: all except the times.
    pub columns: Option<Vec<String>>,
    /// Columns that are read besides these, each with the setting that needs it.
    pub needs: Vec<(String, &'static str)>,
    /// Numbers that stand for a missing value, such as -999.
    pub missing: Vec<f64>,
    /// Words become codes; otherwise they are an error.
    pub encode: bool,
    /// Unit of the times, if the user says it.
    pub time_unit: Option<Unit>,
    /// Name of the column of times, if it is not a usual one; `Some("none")`: there is none.
    pub time_column: Option<String>,
    /// A time may be the same as the one before: the rows are resampled.
    pub equal_times: bool,
    /// The first line is a row, whatever is in it.
    pub no_header: bool,
    /// The names of the columns, instead of those in the file.
    pub names: Option<Vec<String>>,
    /// The column that says which recording a row is of ([`Table::by_recording`]): the times need not be in order.
    pub recording: Option<String>,
    /// Only to see whose the rows are: words are codes in columns that may say so ([`is_id`]), and missing in others. Text without
    /// such a column is not read to its end.
    pub whose: bool,
    /// Bytes that reading may take; `None`: what the machine has free.
    pub max_memory: Option<u64>,
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
    /// What was made of the file.
    Read(String),
    /// Its words became codes.
    Coded {
        /// Its name.
        column: String,
        /// The words in the order of their codes, which count from 0.
        words: Vec<String>,
    },
    /// All its numbers are the same.
    Constant {
        /// Its name.
        column: String,
        /// That number.
        value: f64,
    },
}

impl Note {
    /// The column that it is about, if it is about one.
    pub fn column(&self) -> Option<&String> {
        match self {
            Self::Empty { column } | Self::Missing { column, .. } | Self::Constant { column, .. } => {
                Some(column)
            }
            Self::Read(_) | Self::Coded { .. } => None,
        }
    }

    /// Each matter once, with the numbers of the files that it is about, in order; missing cells are counted together.
    pub fn gathered<'a>(notes: impl Iterator<Item = (usize, &'a Self)>) -> Vec<(Vec<usize>, Self)> {
        let mut told: Vec<(Vec<usize>, Self)> = Vec::new();
        for (file, note) in notes {
            let Some((files, known)) = told.iter_mut().find(|(_, known)| known.is_same_matter(note)) else {
                told.push((vec![file], note.clone()));
                continue;
            };
            known.join(note);
            if files.last() != Some(&file) {
                files.push(file);
            }
        }
        told
    }

    /// What notes of one kind, each about a column, say together.
    pub fn together(notes: &[Self]) -> String {
        let each = notes.iter().map(|note| match note {
            Self::Missing { column, missing, cells } => format!("'{column}' ({missing} of {cells})"),
            Self::Constant { column, value } => format!("'{column}' ({value})"),
            other => other.to_string(),
        });
        let each = each.collect::<Vec<_>>().join(", ");
        match notes {
            [Self::Missing { .. }, _, ..] => {
                format!("cells of columns {each} are empty or NaN; samples that need them are left out")
            }
            [Self::Constant { .. }, _, ..] => {
                format!("columns {each} are constant: they can be neither cause nor effect")
            }
            [note] => note.to_string(),
            _ => each,
        }
    }

    /// Whether it says the same of one file as the other of another file.
    fn is_same_matter(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Missing { column, .. }, Self::Missing { column: of, .. }) => column == of,
            _ => self == other,
        }
    }

    /// Counts the cells of another file, too.
    fn join(&mut self, other: &Self) {
        if let (Self::Missing { missing, cells, .. }, Self::Missing { missing: more, cells: of, .. }) =
            (self, other)
        {
            *missing += more;
            *cells += of;
        }
    }
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Empty { column } => {
                let (columns, empty) = (Named("columns"), Named("drop_empty"));
                write!(f, "column '{column}' has no number at all; leave it out with {columns} or {empty}")
            }
            Self::Missing { column, missing, cells } => write!(
                f,
                "column '{column}': {missing} of {cells} cells are empty or NaN; samples that need them are left out"
            ),
            Self::Read(reported) => f.write_str(reported),
            Self::Coded { column, words } => {
                write!(f, "words of column '{column}' as codes: {}", Codes::reported(words))
            }
            Self::Constant { column, value } => {
                write!(f, "column '{column}' is constant ({value}): it can be neither cause nor effect")
            }
        }
    }
}

/// The step between samples that recordings of one system share, seconds; `None` where none has times.
///
/// # Errors
/// A recording whose step differs by more than 1 % from that of one before it, or that has times where another has none.
pub fn common_step<'a>(recordings: impl IntoIterator<Item = (&'a Path, &'a Table)>) -> Result<Option<f64>> {
    let mut known: Option<(&Path, bool)> = None;
    let mut first: Option<(&Path, f64)> = None;
    for (path, table) in recordings {
        let (other, timed) = *known.get_or_insert((path, table.time.is_some()));
        if timed != table.time.is_some() {
            let (what, other) = (if timed { "no times" } else { "times" }, other.display());
            let reason = format!(
                "it has {what}, unlike {other}; recordings of one system need one step: give all times, or none, or analyse them apart"
            );
            return Err(Error::file(path, reason));
        }
        match (first, table.dt()) {
            (Some((other, step)), Some(dt)) if (dt - step).abs() > 0.01 * step => {
                let [dt, step] = [dt, step].map(|secs| (secs * 1e6).round() / 1e6);
                let (other, flag) = (other.display(), Named("dt"));
                let reason = format!(
                    "its step is {dt} s, that of {other} is {step} s; recordings of one system need one step: resample \
                     them ({flag}), or analyse them apart"
                );
                return Err(Error::file(path, reason));
            }
            (None, Some(dt)) => first = Some((path, dt)),
            _ => {}
        }
    }
    Ok(first.map(|(_, step)| step))
}

/// What is wrong: the file, or what a setting says of its columns.
#[derive(Debug)]
enum Complaint {
    File(String),
    Setting(&'static str, String),
}

impl Complaint {
    /// The reason without its place.
    fn reason(self) -> String {
        match self {
            Self::File(reason) | Self::Setting(_, reason) => reason,
        }
    }
}

impl<S: Into<String>> From<S> for Complaint {
    fn from(reason: S) -> Self {
        Self::File(reason.into())
    }
}

type Parsed<T> = std::result::Result<T, Complaint>;

impl Table {
    /// Reads a CSV file with a header line. With `wanted`, only those columns are read, in that order; otherwise all columns
    /// except the times.
    ///
    /// # Errors
    /// With line and column: an unreadable or empty file, a header without rows, duplicate names, ragged rows, text
    /// or infinite cells, time that does not increase. Also an unknown column, with the nearest name.
    pub fn read(path: &Path, wanted: Option<&[String]>) -> Result<Self> {
        Self::read_as(path, &Reading { columns: wanted.map(<[String]>::to_vec), ..Reading::default() })
    }

    /// Reads a CSV file, which may be compressed with gzip or Zstandard. It is read once, from its beginning to its end: a pipe
    /// is a file too.
    ///
    /// # Errors
    /// As [`Table::read`].
    pub fn read_as(path: &Path, reading: &Reading) -> Result<Self> {
        Self::of_bytes(&dialect::content(path, Memory::of(reading.max_memory))?, reading, path)
    }

    /// Reads a CSV file from memory; `path` is only used in errors.
    ///
    /// # Errors
    /// As [`Table::read`].
    pub fn from_bytes(bytes: &[u8], wanted: Option<&[String]>, path: &Path) -> Result<Self> {
        let reading = Reading { columns: wanted.map(<[String]>::to_vec), ..Reading::default() };
        Self::of_bytes(bytes, &reading, path)
    }

    fn of_bytes(bytes: &[u8], reading: &Reading, path: &Path) -> Result<Self> {
        Self::parse(bytes, reading).map_err(|complaint| match complaint {
            Complaint::File(reason) => Error::file(path, reason),
            Complaint::Setting(setting, reason) => Error::param(setting, reason),
        })
    }

    /// Median step between samples in seconds, if the file has times; without the noise of the times' last digits: from a
    /// microsecond on in whole nanoseconds.
    pub fn dt(&self) -> Option<f64> {
        let step = self.time.as_deref().and_then(steps::median_step)?;
        Some(if step < 1e-6 { step } else { (step * 1e9).round() / 1e9 })
    }

    fn parse(bytes: &[u8], reading: &Reading) -> Parsed<Self> {
        let memory = Memory::of(reading.max_memory);
        if let Some(columns) = binary::columns(bytes, memory) {
            return binary::table(columns?, reading);
        }
        let (text, encoding) = dialect::text_of(bytes).map_err(Complaint::File)?;
        ensure(!text.iter().all(u8::is_ascii_whitespace), || {
            Complaint::from("the file is empty; a header line and rows of numbers are needed")
        })?;
        // The csv crate copies a line as a whole, and what stands between quotes.
        let copied = if text.contains(&b'"') { text.len() } else { longest_line(&text) };
        memory.check(text.len() as u64 + 2 * copied as u64)?;
        let layout = dialect::layout(&text, reading.no_header);
        let with_tabs =
            (layout.separator == Separator::Spaces).then(|| dialect::with_tabs(&text[layout.start..]));
        let body = with_tabs.as_deref().unwrap_or(&text[layout.start..]);
        let mut table = Rows::new(body, &layout, reading, memory)?.table()?;
        // Lines are counted from the beginning of the file, and only if an error needs one.
        let note = |encoding| Note::Read(format!("the file is taken as text in {encoding}"));
        table.notes.extend(encoding.map(note));
        Ok(table)
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

/// The rows of a file, and what is read of them.
struct Rows<'a> {
    /// From the header line on.
    body: &'a [u8],
    separator: u8,
    reading: &'a Reading,
    memory: Memory,
    cells: Cells<'a>,
    header: Vec<String>,
    /// Cells that disappeared when the names were joined.
    joined: usize,
    /// Cells before the first name: R numbers its rows without one.
    ahead: usize,
    time: Option<(usize, Option<Unit>)>,
    /// What is added to the time, and its unit in seconds: the time of day beside the date, the nanoseconds beside the seconds.
    added: Option<(usize, f64)>,
    columns: Vec<usize>,
    /// Lines before the header.
    before: u64,
    /// The first line is a row.
    nameless: bool,
}

/// What one pass over the rows gives.
enum Pass {
    Done(Box<Table>),
    /// This column has words.
    Words(usize),
}

impl<'a> Rows<'a> {
    fn new(body: &'a [u8], layout: &Layout, reading: &'a Reading, memory: Memory) -> Parsed<Self> {
        let separator = match layout.separator {
            Separator::Byte(byte) => byte,
            Separator::Spaces => b'\t',
        };
        let body = if layout.behind_hash { body.split_at(1).1 } else { body };
        // Before the csv crate holds a place for each.
        let line_ends = |byte: &&u8| !matches!(byte, b'\n' | b'\r');
        let separators = body.iter().take_while(line_ends).filter(|byte| **byte == separator).count();
        columns::check_count(separators + 1)?;
        let mut records = reader(body, separator).into_byte_records();
        let mut next = || records.next().transpose().map_err(|error| error.to_string());
        let first = next()?.unwrap_or_default();
        columns::check_count(first.len())?;
        columns::check_lengths(first.iter().map(<[u8]>::len), &format!("line {}", layout.lines_before + 1))?;
        let second = next()?.unwrap_or_default();
        let line = layout.lines_before + 1;
        let (mut header, joined) = match layout.nameless {
            true => (columns::made_up(&first, &second), 0),
            false => header::repaired(&texts(&first, line)?),
        };
        if layout.behind_hash && header.len() > 1 && header[0].is_empty() {
            header.remove(0);
        }
        if let Some(names) = &reading.names {
            if names.len() != header.len() {
                let reason = format!("{} names for {} columns", names.len(), header.len());
                return Err(Complaint::from(format!("{} gives {reason}; name each column", Named("names"))));
            }
            header.clone_from(names);
        }
        let second = if layout.nameless { first } else { second };
        let ahead = usize::from(
            second.len() == header.len() + 1
                && second.get(header.len()).is_some_and(|last| !last.is_empty())
                && joined == 0
                && row_number(&second),
        );
        let are_numbers = || header.iter().skip(1).all(|name| name.parse::<f64>().is_ok());
        columns::check_names(&header, &format!("line {line}")).map_err(|reason| {
            check_stands(are_numbers(), (1, header.len())).err().unwrap_or_else(|| Complaint::from(reason))
        })?;
        let may_say = |name: &String| is_id(name) || name == "x_0";
        ensure(!reading.whose || header.iter().any(may_say), || "no column says whose a row is")?;
        let decimal_comma = separator != b',';
        let mut this = Self {
            body,
            separator,
            reading,
            memory,
            cells: Cells { missing: &reading.missing, decimal_comma, encode: reading.encode },
            header,
            joined,
            ahead,
            time: None,
            added: None,
            columns: Vec::new(),
            before: layout.lines_before,
            nameless: layout.nameless,
        };
        this.choose(&second)?;
        Ok(this)
    }

    /// Chooses the columns and the times. A first column without a name holds row numbers, or the times if it holds dates.
    fn choose(&mut self, first_row: &ByteRecord) -> Parsed<()> {
        let index = columns::is_index(&self.header[0]).then_some(0);
        let date = |column: usize| {
            first_row.get(column + self.ahead).and_then(|cell| time::date(std::str::from_utf8(cell).ok()?))
        };
        self.time = match self.reading.time_column.as_deref() {
            Some("none") => None,
            Some(name) => {
                let column = columns::one(&self.header, name);
                Some((column.map_err(|reason| Complaint::Setting("time-column", reason))?, None))
            }
            None => columns::time_column(&self.header).or_else(|| {
                let first = index.or(self.nameless.then_some(0));
                first.filter(|&column| date(column).is_some()).map(|column| (column, None))
            }),
        };
        let is_day = |t: f64| t.abs() >= steps::DAY && t % steps::DAY == 0.0;
        let is_of_day = |t: f64| (0.0..steps::DAY).contains(&t);
        let first = |is: fn(f64) -> bool| {
            let is_it = |&column: &usize| {
                columns::time_name(&self.header[column]).is_some() && date(column).is_some_and(is)
            };
            (0..self.header.len()).find(is_it)
        };
        let (day, of_day) = (first(is_day), first(is_of_day));
        if let (None, Some(day), Some(_)) = (&self.reading.time_column, day, of_day) {
            (self.time, self.added) = (Some((day, None)), of_day.map(|column| (column, 1.0)));
        }
        if let (None, None, Some((seconds, rest))) =
            (&self.reading.time_column, self.time, columns::stamp_in_two(&self.header))
        {
            (self.time, self.added) = (Some((seconds, Some(Unit::Seconds))), Some((rest, 1e-9)));
        }
        if let Some(name) = &self.reading.recording {
            columns::one(&self.header, name).map_err(Complaint::File)?;
        }
        let time = self.time.map(|(column, _)| column);
        let last = self.header.len() - 1;
        let empty_end = (last > 0 && self.header[last].is_empty()).then_some(last);
        self.columns = columns::read(&self.header, self.reading, time)?;
        let named = self.reading.columns.is_some();
        self.columns.retain(|&column| {
            (named || (Some(column) != time && self.added.is_none_or(|(added, _)| column != added)))
                && Some(column) != index.filter(|_| !self.header[column].contains("Unnamed") || !named)
                && Some(column) != empty_end
        });
        if self.columns.is_empty() {
            let (line, only) = (self.before + 1, &self.header[0]);
            let reason = format!("line {line}: the only column is '{only}'; columns of variables are needed");
            return Err(Complaint::File(reason));
        }
        Ok(())
    }

    /// The table; with a pass more for each column of words, if they are to be encoded.
    fn table(&self) -> Parsed<Table> {
        let mut codes: BTreeMap<usize, Codes> = BTreeMap::new();
        loop {
            match self.pass(&mut codes)? {
                Pass::Done(table) => return Ok(*table),
                Pass::Words(column) => drop(codes.insert(column, Codes::default())),
            }
        }
    }

    fn pass(&self, codes: &mut BTreeMap<usize, Codes>) -> Parsed<Pass> {
        codes.values_mut().for_each(|codes| *codes = Codes::default());
        let mut numbers = vec![Vec::new(); self.columns.len()];
        let (mut time, mut places) = (Vec::new(), Vec::new());
        let mut reader = reader(self.body, self.separator);
        let (mut bytes, mut header) = (ByteRecord::new(), !self.nameless);
        while reader.read_byte_record(&mut bytes).map_err(|e| e.to_string())? {
            if std::mem::take(&mut header) {
                continue;
            }
            let place = bytes.position().map_or(0, csv::Position::byte);
            let row = StringRecord::from_byte_record_lossy(std::mem::take(&mut bytes));
            self.check_width(&row, place)?;
            if places.len() == places.capacity() {
                // It is about to double; times and numbers grow with it.
                let held = places.capacity() * (numbers.len() + 1 + usize::from(self.time.is_some()));
                self.memory.check(self.body.len() as u64 + 2 * (held * size_of::<f64>()) as u64)?;
            }
            for (&column, numbers) in self.columns.iter().zip(&mut numbers) {
                let cell = row.get(column + self.ahead).unwrap_or_default();
                if let Some(codes) = codes.get_mut(&column) {
                    let word = cell.trim();
                    let is_missing = matches!(self.cells.number(word), Ok(Some(value)) if value.is_nan());
                    numbers.push(if is_missing { f64::NAN } else { codes.of(word) });
                    continue;
                }
                match self.cells.number(cell) {
                    Ok(Some(value)) => numbers.push(value),
                    Ok(None) if self.reading.whose && !is_id(&self.header[column]) => numbers.push(f64::NAN),
                    Ok(None) if self.cells.encode || self.tells_recordings(column) => {
                        return Ok(Pass::Words(column));
                    }
                    Ok(None) => return Err(self.not_a_number(cell, column, place)),
                    Err(()) => {
                        let (place, cell) = (self.place(column, place), shortened(cell));
                        let reason =
                            format!("{place}: '{cell}' is infinite; leave the cell empty or remove the row");
                        return Err(reason.into());
                    }
                }
            }
            if let Some((column, _)) = self.time {
                let of = |column: usize| {
                    self.time_of(row.get(column + self.ahead).unwrap_or_default(), column, place)
                };
                let added =
                    self.added.map_or(Ok(0.0), |(column, unit)| Ok::<_, Complaint>(unit * of(column)?))?;
                time.push(of(column)? + added);
            }
            places.push(place);
            bytes = row.into_byte_record();
        }
        if places.is_empty() {
            let line = self.before + 1;
            let why = format!("there is only a header (line {line}); rows of numbers are needed below it");
            return Err(why.into());
        }
        self.finished(numbers, time, &places, codes).map(|table| Pass::Done(Box::new(table)))
    }

    fn finished(
        &self,
        numbers: Vec<Vec<f64>>,
        time: Vec<f64>,
        places: &[u64],
        codes: &BTreeMap<usize, Codes>,
    ) -> Parsed<Table> {
        let mut values = column_by_column(numbers, places.len())?;
        let mut names: Vec<String> = self.columns.iter().map(|&column| self.header[column].clone()).collect();
        let mut reported = Vec::new();
        for (column, codes) in codes {
            let (sorted, name) = (codes.sorted(), &self.header[*column]);
            let Some(at) = self.columns.iter().position(|other| other == column) else { continue };
            let recode = |value: f64| if value.is_nan() { value } else { sorted[value as usize] };
            values.index_axis_mut(Axis(1), at).mapv_inplace(recode);
            reported.push(Note::Coded { column: name.clone(), words: codes.words() });
        }
        check_stands(self.nameless || self.names_are_numbers(0), values.dim())?;
        let own_time = self.first_is_time(&values);
        if own_time.is_some() {
            names.remove(0);
            values.remove_index(Axis(1), 0);
            reported
                .push(Note::Read(format!("{} rises at even steps: it is taken as the time", self.header[0])));
        }
        let mut notes = Table::notes_on(&names, &values);
        reported.extend(self.on_names());
        notes.splice(0..0, reported);
        let time = match self.time {
            Some((column, unit)) => {
                self.check_time(&time, column, places)?;
                let unit = unit.or_else(|| time::unit_of_date(&self.header[column], &time));
                Some((time, unit))
            }
            None => own_time.map(|time| (time, None)),
        };
        let time = time.map(|(time, unit)| {
            let (time, reported) = time::in_seconds(time, self.reading.time_unit.or(unit));
            notes.extend(reported.map(Note::Read));
            time
        });
        Ok(Table { names, values, time, notes })
    }

    /// The first column of a file without names, if it rises at even steps that are not those of row numbers.
    fn first_is_time(&self, values: &Array2<f64>) -> Option<Vec<f64>> {
        let Reading { names, columns, time_column, .. } = self.reading;
        let is_told = self.time.is_some() || names.is_some() || columns.is_some() || time_column.is_some();
        if !self.nameless || is_told || values.ncols() < 3 || values.nrows() < 10 {
            return None;
        }
        let time = values.column(0).to_vec();
        let step = steps::median_step(&time).filter(|step| *step > 0.0 && *step != 1.0)?;
        time.windows(2).all(|pair| (pair[1] - pair[0] - step).abs() < 0.02 * step).then_some(time)
    }

    /// What to know of columns that the file does not name, or names by numbers.
    fn on_names(&self) -> Option<Note> {
        let (first, last) = (self.header.first()?, self.header.iter().rfind(|name| !name.is_empty())?);
        let (line, no_header) = (self.before + 1, Named("no_header"));
        let reported = match (self.nameless, self.names_are_numbers(0)) {
            _ if self.reading.names.is_some() => return None,
            (true, _) => format!(
                "the file has no header; its columns are called {first} to {last} ({} names them)",
                Named("names")
            ),
            (false, true) => format!("line {line} is taken as names ({no_header} reads it as a row)"),
            (false, false) => return None,
        };
        Some(Note::Read(reported))
    }

    /// Whether the names from this column on are numbers.
    fn names_are_numbers(&self, from: usize) -> bool {
        self.header.iter().skip(from).all(|name| name.is_empty() || name.parse::<f64>().is_ok())
    }

    /// Whether a column says which recording a row is of.
    fn tells_recordings(&self, column: usize) -> bool {
        let name = self.reading.recording.as_deref();
        name.is_some_and(|name| names::position(&self.header, name) == Some(column))
    }

    fn time_of(&self, cell: &str, column: usize, place: u64) -> Parsed<f64> {
        match self.cells.number(cell) {
            Ok(Some(time)) => Ok(time),
            _ => time::date(cell).ok_or_else(|| {
                let (place, cell, named) = (self.place(column, place), shortened(cell), Named("time_column"));
                let open = if cell.split('/').count() == 3 { ", or may be day or month first" } else { "" };
                Complaint::from(format!(
                    "{place}: '{cell}' is neither a number nor a date such as 2026-11-24T08:30:00.25+01:00{open}; correct it, or name \
                     another column with {named} (none: there are no times)"
                ))
            }),
        }
    }

    fn check_width(&self, row: &StringRecord, place: u64) -> Parsed<()> {
        let expected = self.header.len() + self.ahead;
        // A header name that was split in two leaves as many empty cells at the end of each row.
        let spare = row.len().saturating_sub(expected);
        let empty = || row.iter().skip(expected).all(str::is_empty);
        if row.len() == expected
            || (spare > 0 && spare <= self.joined.max(1) && empty() && (self.joined > 0 || spare == 1))
        {
            return Ok(());
        }
        Err(Complaint::from(format!(
            "line {} has {} cells, {}; every row needs as many (empty for a missing value)",
            self.line(place),
            row.len(),
            match self.nameless {
                true => format!("the first row has {expected}"),
                false => format!("the header has {expected} names"),
            }
        )))
    }

    fn not_a_number(&self, cell: &str, column: usize, place: u64) -> Complaint {
        let is_second = !self.nameless && self.line(place) == self.before + 2;
        let units = if is_second { " (units, or a second header? remove the line)" } else { "" };
        let (place, short) = (self.place(column, place), shortened(cell));
        if let (0, Err(side)) = (column, check_stands(self.names_are_numbers(1), (1, self.header.len()))) {
            return side;
        }
        let (columns, time_column) = (Named("columns"), Named("time_column"));
        if time::date(cell).is_some() {
            return Complaint::from(format!(
                "{place}: '{short}' is a date; {time_column} takes it as the time, {columns} names the columns to use"
            ));
        }
        let (encode, recording, name) = (Named("encode"), Named("recording"), &self.header[column]);
        Complaint::from(format!(
            "{place}: '{short}' is not a number{units}; correct it, leave the cell empty, name the columns to use with {columns}, turn words into \
             codes with {encode} codes, or, if they say whose a row is, make recordings of them with {recording} '{name}'"
        ))
    }

    fn check_time(&self, time: &[f64], column: usize, places: &[u64]) -> Parsed<()> {
        if let Some(row) = time.iter().position(|t| t.is_nan()) {
            let place = self.place(column, places[row]);
            return Err(format!("{place}: the time is missing; fill it in or remove the row").into());
        }
        if self.reading.recording.is_some() {
            return Ok(());
        }
        let wrong = |pair: &[f64]| pair[1] < pair[0] || (pair[1] == pair[0] && !self.reading.equal_times);
        let Some(row) = time.windows(2).position(wrong) else { return Ok(()) };
        let place = self.place(column, places[row + 1]);
        // A column that says whose row it is, or else the time itself, which begins anew.
        let id = self.header.iter().find(|name| split::is_id(name)).unwrap_or(&self.header[column]);
        Err(Complaint::from(out_of_order(&place, time[row], time[row + 1], id)))
    }

    fn place(&self, column: usize, place: u64) -> String {
        format!("line {}, column '{}'", self.line(place), self.header[column])
    }

    /// The line of the record that is found from byte `place` of the body on, as an editor counts, whether lines end in LF,
    /// CR LF or CR. (The csv crate counts a CR LF as the next record begins, and is one line behind.)
    fn line(&self, place: u64) -> u64 {
        let is_end = |byte: &u8| matches!(byte, b'\r' | b'\n');
        let from = (place as usize).min(self.body.len());
        let start = from + self.body[from..].iter().take_while(|byte| is_end(byte)).count();
        let ends = (0..start).filter(|&at| match self.body[at] {
            b'\n' => true,
            b'\r' => self.body.get(at + 1) != Some(&b'\n'),
            _ => false,
        });
        self.before + ends.count() as u64 + 1
    }
}

/// The columns as a table that has one behind the other in memory: what follows looks at a column at a time.
fn column_by_column(columns: Vec<Vec<f64>>, rows: usize) -> Parsed<Array2<f64>> {
    let shape = (rows, columns.len()).f();
    let mut numbers = Vec::with_capacity(rows * columns.len());
    // Each column's own memory is given back before the next one is copied.
    columns.into_iter().for_each(|column| numbers.extend(column));
    Array2::from_shape_vec(shape, numbers).map_err(|error| error.to_string().into())
}

/// Refuses rows without names that are far longer than there are rows.
fn check_stands(is_nameless: bool, (rows, columns): (usize, usize)) -> Parsed<()> {
    if !is_nameless || columns <= 20 || columns <= 4 * rows {
        return Ok(());
    }
    Err(Complaint::from(format!(
        "it has rows of {columns} numbers, and no names: it seems to lie on its side; a row is a time, a column a variable: transpose it, \
         such as with numpy's .T"
    )))
}

/// Bytes of the longest line.
fn longest_line(text: &[u8]) -> usize {
    let mut rest = text;
    // Reading from memory does not fail.
    std::iter::from_fn(|| rest.skip_until(b'\n').ok().filter(|read| *read > 0)).max().unwrap_or(0)
}

/// The beginning of a cell, on one line, for a message.
fn shortened(cell: &str) -> String {
    cell.chars().take(40).map(|letter| if letter.is_control() { ' ' } else { letter }).collect()
}

/// What is wrong with a time that is not after the one before it.
fn out_of_order(place: &str, before: f64, time: f64, id: &str) -> String {
    let (what, way) = match time < before {
        true => ("goes back", "sort the rows".to_owned()),
        false => ("stands still", format!("resample the rows with {}", Named("dt"))),
    };
    let (recording, format, column) = (Named("recording"), Named("format"), Named("time_column"));
    format!(
        "{place}: time {what} (from {before} to {time}); {way}; several recordings in one table: {recording} '{id}'; a row for each of \
         several people and robots: {format} trajectories; the column is no time: {column} none"
    )
}

fn reader(body: &[u8], separator: u8) -> csv::Reader<&[u8]> {
    ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .comment(Some(b'#'))
        .delimiter(separator)
        .from_reader(body)
}

/// The names of a header line.
fn texts(record: &ByteRecord, line: u64) -> std::result::Result<Vec<String>, String> {
    let text = |(column, cell): (usize, &[u8])| match std::str::from_utf8(cell) {
        Ok(text) => Ok(text.trim_matches(' ').to_owned()),
        Err(_) => {
            Err(format!("line {line}, column {}: not text in UTF-8; save the file as UTF-8 CSV", column + 1))
        }
    };
    record.iter().enumerate().map(text).collect()
}

/// Whether a row begins with a whole number, as R's rows do.
fn row_number(record: &ByteRecord) -> bool {
    let first = record.get(0).and_then(|cell| std::str::from_utf8(cell).ok());
    first.is_some_and(|cell| cell.trim().parse::<i64>().is_ok())
}

#[cfg(test)]
mod tests;
