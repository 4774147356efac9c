//! How tables are read, and which part of the data is analysed: flags, and what they do.

use std::{collections::HashSet, ops::RangeInclusive, path::PathBuf, str::FromStr};

use clap::Args as ClapArgs;
use ndarray::{Array2, ArrayView1, s};
use roscausal_core::{
    Error, Result,
    batch::{
        Table,
        table::{Derived, Note, Reading, Resample, Steps, Unit, is_id},
    },
};
use roscausal_discovery::{
    DataFrame, Named,
    names::{plain, position},
};

use crate::flags;

use super::{
    Data, Input,
    aside::{aside, interleaved},
    changes::{ChangeArgs, column},
    condition::Condition,
};

/// A column that only chooses rows, and the flag that names it.
pub(super) type Needed<'a> = (&'a str, &'static str);

/// Flags that say how tables are read.
#[derive(ClapArgs, Clone, Debug, Default)]
#[command(next_help_heading = "Data")]
pub(crate) struct ReadArgs {
    /// Columns to analyse, separated by commas: names, patterns (`h_*`), ranges (`h_v..h_risk`), `!name` to leave out. Default:
    /// all except the time.
    #[arg(long, value_delimiter = ',')]
    pub(super) columns: Option<Vec<String>>,
    /// A variable to add, such as `closing = diff(dist)`; may be given several times. Table: an expression over its columns
    /// (docs/data.md). Recording: one over person and robot (docs/parameters.md).
    #[arg(long = "feature", value_name = "NAME = EXPRESSION")]
    pub(super) features: Vec<String>,
    /// Table: numbers that stand for a missing value, such as -999, separated by commas; `none`: there are none.
    #[arg(long, value_name = "NUMBER", value_delimiter = ',', allow_hyphen_values = true)]
    pub(super) missing_value: Vec<String>,
    /// Table: turn words into codes, in alphabetical order from 0.
    #[arg(long, value_parser = ["codes"])]
    encode: Option<String>,
    /// Table: name of the column of times; `none`: there is none. Default: time, t, timestamp and the like.
    #[arg(long, value_name = "NAME")]
    time_column: Option<String>,
    /// Table: the first line is a row, although it looks like names. (Numbers and dates are rows without it.)
    #[arg(long)]
    no_header: bool,
    /// Table: the names of all columns, separated by commas, instead of those in the file.
    #[arg(long, value_delimiter = ',')]
    names: Option<Vec<String>>,
    /// Table: several recordings in one: the column that says which one a row is of; or that of the times, which begin anew in each.
    #[arg(long, value_name = "COLUMN")]
    recording: Option<String>,
    /// Table: columns that stay variables although they count the rows, or say when or whose a row is: names, or `all`.
    #[arg(long, value_name = "COLUMN", value_delimiter = ',')]
    keep: Vec<String>,
    /// Table: unit of the times: s, ms, us, ns, min, h, d. Default: by the column's name (`time_ms`), or the size of the numbers.
    #[arg(long, value_name = "UNIT", value_parser = flags::word::<Unit>)]
    time_unit: Option<Unit>,
    /// Table: with --dt, what a row holds: last (sample), mean (since the row before), linear (interpolated).
    #[arg(long, value_name = "HOW", value_parser = flags::word::<Resample>)]
    resample: Option<Resample>,
    /// Table: a longer step ends a recording, seconds. Default: five steps.
    #[arg(long, value_name = "SECONDS")]
    pub(super) max_gap: Option<f64>,
    /// Tables: the files are parts of one recording, such as a file for each topic: their columns stand side by side, joined by
    /// time, and are called FILE.COLUMN. The step is --dt, or the longest of theirs.
    #[arg(long)]
    pub(super) join: bool,
}

impl ReadArgs {
    /// Whether a column stays, whatever it says: the user names it.
    pub(super) fn keeps(&self, name: &str) -> bool {
        let named = self.keep.iter().chain(self.columns.iter().flatten());
        self.keep.iter().any(|word| word == "all") || named.clone().any(|word| plain(word) == plain(name))
    }

    /// The first flag that was given which says how the lines of a table are read, for other input.
    pub(super) fn of_lines(&self) -> Option<&'static str> {
        let flags = [
            ("no_header", self.no_header),
            ("names", self.names.is_some()),
            ("recording", self.recording.is_some()),
        ];
        flags.into_iter().find(|(_, given)| *given).map(|(flag, _)| flag)
    }

    /// The definitions of `--feature` as a parameter of the data node, which makes them beside the paper's three.
    pub(super) fn as_parameter(&self) -> Option<String> {
        (!self.features.is_empty()).then(|| format!("data.features={}", self.features.join("; ")))
    }

    /// The files as tables with the same columns in the same order, each at one step. `dt` is what tables are resampled to.
    ///
    /// # Errors
    /// A file that cannot be read, lacks a column, or has uneven steps that nobody resamples.
    ///
    /// Columns that only choose rows (`besides`) are read, too. Reading may take `max_memory` bytes.
    pub(super) fn read(
        &self,
        files: &[Input],
        dt: Option<f64>,
        besides: &[Needed<'_>],
        max_memory: Option<u64>,
    ) -> Result<Vec<(Input, Table)>> {
        let has_step = self.resample.is_none() || dt.is_some() || self.join;
        Error::ensure(has_step, "resample", || format!("{} says to which step", Named("dt")))?;
        let reason = "give a number of seconds above 0";
        Error::ensure(dt.is_none_or(|dt| dt > 0.0 && dt.is_finite()), "dt", || reason)?;
        Error::ensure(self.max_gap.is_none_or(|gap| gap > 0.0), "max-gap", || reason)?;
        // Of a recording, the node has made the variables.
        let is_table = |file: &Input| !file.is_recorded();
        let derived = match files.iter().any(is_table) {
            true => self.features.iter().map(|text| Derived::parse(text)).collect::<Result<Vec<_>>>()?,
            false => Vec::new(),
        };
        let reason = "it means one thing for tables and another for recordings; analyse them apart";
        Error::ensure(derived.is_empty() || !files.iter().any(Input::is_recorded), "feature", || reason)?;
        let mut reading = Reading {
            columns: self.wanted(&derived),
            needs: self.needs(&derived, besides),
            missing: self.missing()?,
            encode: self.encode.is_some(),
            time_unit: self.time_unit,
            time_column: self.time_column.clone(),
            equal_times: dt.is_some() || self.join,
            no_header: self.no_header,
            names: self.names.clone(),
            recording: self.recording.clone(),
            whose: false,
            max_memory,
        };
        if let (Some(flag), true) = (self.of_lines(), files.iter().all(Input::is_recorded)) {
            return Err(Error::param(flag, "it is for tables"));
        }
        if self.join {
            let reason = "it is for tables; a recording has all its topics side by side";
            Error::ensure(!files.iter().any(Input::is_recorded), "join", || reason)?;
            return self.joined(files, dt, &reading, &derived, besides);
        }
        let mut tables: Vec<(Input, Table)> = Vec::new();
        for file in files {
            let steps = Steps {
                // The batches of a recording have the step already.
                dt: dt.filter(|_| is_table(file)),
                how: self.resample.unwrap_or_default(),
                max_gap: self.max_gap,
                max_memory,
            };
            let first = tables.is_empty();
            let told = if is_table(file) { self.whose(file, &reading)? } else { None };
            let mut table = Table::read_as(&file.table, &reading).map_err(|error| match error {
                Error::Param { reason, .. } if !first => {
                    Error::file(&file.user, format!("it lacks a column of the first file: {reason}"))
                }
                other => other,
            })?;
            table.notes.extend(told);
            let mut parts = vec![(file.clone(), table)];
            if let Some(column) = &self.recording {
                let of_column = parts.remove(0).1.by_recording(column, reading.equal_times);
                let of_column = of_column.map_err(|reason| Error::file(&file.user, reason))?;
                let part = |(k, (which, table)): (usize, (String, Table))| (file.part(&which, k), table);
                parts.extend(of_column.into_iter().enumerate().map(part));
            }
            for (file, table) in parts {
                let even = table.at_even_steps(&steps).map_err(|reason| Error::file(&file.user, reason))?;
                let held: usize = even.iter().map(|table| table.values.len() * size_of::<f64>()).sum();
                reading.max_memory = reading.max_memory.map(|bytes| bytes.saturating_sub(held as u64));
                for mut table in even {
                    if let Some((first, known)) = tables.first() {
                        same_columns(&mut table, &file, known, first)?;
                    }
                    tables.push((file.clone(), table));
                }
            }
        }
        if !derived.is_empty() {
            tables.iter_mut().try_for_each(|(_, table)| self.finish(table, &derived, besides))?;
        }
        Ok(tables)
    }

    /// Adds the defined variables to a table, and leaves out what is not chosen.
    fn finish(&self, table: &mut Table, derived: &[Derived], besides: &[Needed<'_>]) -> Result<()> {
        table.derive(derived)?;
        if let Some(chosen) = self.with_derived(derived, besides) {
            table.keep(&chosen)?;
        }
        only_of_columns(table);
        Ok(())
    }

    /// Refuses rows of several people, one below the other, where only columns that are not chosen say so, or tells that they are of
    /// several, one after the other. A pipe is read once.
    fn whose(&self, file: &Input, reading: &Reading) -> Result<Option<Note>> {
        if self.columns.is_none() || self.recording.is_some() || !file.table.is_file() {
            return Ok(None);
        }
        let all = Reading { columns: None, encode: true, equal_times: true, whose: true, ..reading.clone() };
        // What cannot be read is no matter here.
        let Ok(Table { names, values, .. }) = Table::read_as(&file.table, &all) else { return Ok(None) };
        let data = DataFrame::new(vec![values], names)?;
        if let Some(reason) = interleaved(&data, |name| self.keeps(name)) {
            return Err(Error::file(&file.user, reason));
        }
        let of_several = aside(&data, |name| self.keeps(name) || !is_id(name));
        Ok(of_several.map(|(_, why)| Note::Read(format!("a column that is not chosen is {why}"))))
    }

    /// The files side by side, as one recording.
    fn joined(
        &self,
        files: &[Input],
        dt: Option<f64>,
        reading: &Reading,
        derived: &[Derived],
        besides: &[Needed<'_>],
    ) -> Result<Vec<(Input, Table)>> {
        let all = Reading { columns: None, ..reading.clone() };
        let read = |file: &Input| Ok((file.user.clone(), Table::read_as(&file.table, &all)?));
        let tables = files.iter().map(read).collect::<Result<Vec<_>>>()?;
        let how = Steps {
            dt,
            how: self.resample.unwrap_or_default(),
            max_gap: self.max_gap,
            max_memory: reading.max_memory,
        };
        let mut table = Table::side_by_side(&tables, &how).map_err(|reason| Error::param("join", reason))?;
        self.finish(&mut table, derived, besides)?;
        let whole = PathBuf::from("the files");
        let even =
            table.at_even_steps(&Steps { dt: None, ..how }).map_err(|reason| Error::file(&whole, reason))?;
        let input = Input { table: whole.clone(), user: whole, run: [0, 0] };
        Ok(even.into_iter().map(|table| (input.clone(), table)).collect())
    }

    /// The columns of the table that are wanted: a variable that is defined may be, too.
    fn wanted(&self, derived: &[Derived]) -> Option<Vec<String>> {
        Some(self.columns.as_ref()?.iter().filter(|name| !is_derived(derived, name)).cloned().collect())
    }

    /// The columns that the definitions, `besides` and the recording of a row need, and the setting of each.
    fn needs(&self, derived: &[Derived], besides: &[Needed<'_>]) -> Vec<(String, &'static str)> {
        let of_features = Derived::needed(derived).into_iter().map(|name| (name, "feature"));
        let recording = self.recording.as_deref().map(|name| (name, "recording"));
        let others = besides.iter().copied().chain(recording).filter(|(name, _)| !is_derived(derived, name));
        of_features.chain(others.map(|(name, setting)| (name.to_owned(), setting))).collect()
    }

    /// What is kept of the columns: those that are wanted, all variables that are defined, and for now those that choose rows.
    fn with_derived(&self, derived: &[Derived], besides: &[Needed<'_>]) -> Option<Vec<String>> {
        let names = derived.iter().map(Derived::name).chain(besides.iter().map(|(name, _)| *name));
        Some(self.columns.clone()?.into_iter().chain(names.map(|name| format!("+{name}"))).collect())
    }

    /// The variables among the columns that were read, if only some of the columns are wanted. `recorded`: a node has made them.
    ///
    /// # Errors
    /// A definition that is none.
    pub(super) fn variables(&self, recorded: bool) -> Result<Option<Vec<String>>> {
        let features = if recorded { &[][..] } else { &self.features[..] };
        let derived = features.iter().map(|text| Derived::parse(text)).collect::<Result<Vec<_>>>()?;
        Ok(self.with_derived(&derived, &[]))
    }

    pub(super) fn missing(&self) -> Result<Vec<f64>> {
        let reason = |text: &String| format!("'{text}' is neither a number nor 'none'");
        let number = |text: &String| text.parse().map_err(|_| Error::param("missing-value", reason(text)));
        self.missing_value.iter().filter(|text| *text != "none").map(number).collect()
    }
}

/// Keeps the notes about columns that are still there, and those about the whole table.
fn only_of_columns(Table { names, notes, .. }: &mut Table) {
    notes.retain(|note| note.column().is_none_or(|column| names.contains(column)));
}

/// Brings the columns of a table into the order of the first one's.
///
/// # Errors
/// One has a column that the other has not: what drives others must not disappear unseen.
fn same_columns(table: &mut Table, file: &Input, known: &Table, first: &Input) -> Result<()> {
    let named = |names: &[String], is: &dyn Fn(&String) -> bool| {
        names.iter().filter(|name| is(name)).map(|name| plain(name)).collect::<Vec<_>>().join(",")
    };
    let is_in = |table: &Table, name: &String| position(&table.names, name).is_some();
    let mut only = [(first, known, &*table), (file, &*table, known)]
        .map(|(file, own, other)| (file, named(&own.names, &|name| !is_in(other, name))))
        .into_iter()
        .filter(|(_, names)| !names.is_empty())
        .map(|(file, names)| format!("only {} has {names}", file.user.display()));
    let Some(reported) =
        only.next().map(|one| only.fold(one, |reported, other| format!("{reported}, {other}")))
    else {
        return table.keep(&known.names);
    };
    let common = named(&known.names, &|name| is_in(table, name));
    let way = match common.is_empty() {
        true => "analyse them apart".to_owned(),
        false => format!("{} {common} analyses what both have", Named("columns")),
    };
    Err(Error::file(&file.user, format!("recordings of one system need the same columns: {reported}; {way}")))
}

/// Flags that choose a part of the data.
#[derive(ClapArgs, Clone, Debug, Default)]
#[command(next_help_heading = "Data")]
pub(crate) struct PartArgs {
    /// Leave out columns without any number, such as the distance to a goal where no goal was recorded.
    #[arg(long)]
    drop_empty: bool,
    /// Leave out columns that hold one number only, such as the unused parts of a message.
    #[arg(long)]
    drop_constant: bool,
    /// Rows to analyse of each recording, such as `1..5000`: counted from 1, the last one included; either end may be left out.
    #[arg(long, value_name = "FROM..TO")]
    rows: Option<Rows>,
    /// A column that is not a variable: rows in which it is not 0 are not effects (they still count as the past of others).
    #[arg(long, value_name = "COLUMN")]
    mask: Option<String>,
    /// Only rows that fulfil this are effects, such as `near < 3 and r_v > 0`: columns and numbers compared by < <= > >= == !=.
    #[arg(long = "where", value_name = "CONDITION")]
    condition: Option<Condition>,
}

/// A window of rows, counted from 1.
#[derive(Clone, Debug, PartialEq)]
struct Rows(RangeInclusive<usize>);

impl FromStr for Rows {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let number = |text: &str, open: usize| match text.trim() {
            "" => Some(open),
            text => text.parse().ok().filter(|&row: &usize| row > 0),
        };
        let ends =
            text.split_once("..").and_then(|(from, to)| Some((number(from, 1)?, number(to, usize::MAX)?)));
        match ends {
            Some((from, to)) if from <= to => Ok(Self(from..=to)),
            _ => Err("give FROM..TO with FROM at least 1 and at most TO, such as 1..5000".into()),
        }
    }
}

/// Whether a variable is defined.
fn is_derived(derived: &[Derived], name: &str) -> bool {
    derived.iter().any(|derived| plain(derived.name()) == plain(name))
}

impl PartArgs {
    /// The part of `data` that these flags choose, with its values changed as asked for. Rows are chosen by their values before.
    /// `read` names columns.
    ///
    /// # Errors
    /// A column without any number, unless it may be left out; a window without rows.
    pub(super) fn part(
        &self,
        mut data: Data,
        changes: &ChangeArgs,
        variables: Option<&[String]>,
        read: &ReadArgs,
    ) -> Result<Data> {
        let named = read.columns.as_deref().unwrap_or_default();
        if let Some(Rows(rows)) = &self.rows {
            data.map_recordings(|recording| {
                let end = recording.nrows().min(*rows.end());
                recording.slice(s![(rows.start() - 1).min(end)..end, ..]).to_owned()
            })?;
        }
        let masks = self.masks(&mut data, variables)?;
        if let Some(reason) = interleaved(&data.data, |name| read.keeps(name)).filter(|_| !data.recorded) {
            return Err(Error::Data(reason));
        }
        let aside = if data.recorded { None } else { aside(&data.data, |name| read.keeps(name)) };
        changes.apply(&mut data)?;
        if let Some(masks) = masks {
            data.data = data.data.with_mask(masks, "y".parse()?)?;
        }
        if let Some((vars, why)) = aside {
            data.leave_out(&vars, &why)?;
        }
        if self.drop_constant {
            let constant = |&var: &usize| is_constant(&data.data, var);
            let gone: Vec<usize> = (0..data.data.n_vars()).filter(constant).collect();
            data.leave_out(&gone, "constant")?;
        }
        let empty: Vec<usize> = (0..data.data.n_vars()).filter(|&var| is_empty(&data.data, var)).collect();
        let names: Vec<String> = empty.iter().map(|&var| plain(&data.data.var_names()[var])).collect();
        // Which columns there are was not the user's choice, unless they are named.
        let is_unnamed = |name: &String| is_of_goal(name) && !named.contains(name);
        let why = match data.recorded && names.iter().all(is_unnamed) {
            _ if empty.is_empty() || self.drop_empty => "without any number",
            true => "since the recording has no goal of the person (--human-goal names its topic)",
            false => return Err(Error::Data(sentence(&names, data.recorded))),
        };
        data.leave_out(&empty, why)?;
        Ok(data)
    }

    /// The columns that choose rows.
    pub(super) fn columns(&self) -> Vec<Needed<'_>> {
        let of_condition = self.condition.iter().flat_map(Condition::columns).map(|name| (name, "where"));
        self.mask.as_deref().map(|name| (name, "mask")).into_iter().chain(of_condition).collect()
    }

    /// Which rows are not effects, for each recording; the column that says so is taken out of `data`, and so is what is none of the
    /// `variables`.
    fn masks(&self, data: &mut Data, variables: Option<&[String]>) -> Result<Option<Vec<Array2<bool>>>> {
        if self.mask.is_none() && self.condition.is_none() {
            return Ok(None);
        }
        let names = data.data.var_names().to_vec();
        let by = self.mask.as_deref().map(|name| column("mask", name, &names)).transpose()?;
        let on_rows = |condition: &Condition| condition.on(|name| column("where", name, &names));
        let condition = self.condition.as_ref().map(on_rows).transpose()?;
        let is_masked = |row: ArrayView1<'_, f64>| {
            by.is_some_and(|by| row[by] != 0.0) || condition.as_ref().is_some_and(|condition| !condition(row))
        };
        // What was to be left out may not have been read at all.
        let is_there = |name: &&String| {
            let pattern = name.strip_prefix('!').map(|pattern| vec![pattern.to_owned()]);
            pattern.is_none_or(|pattern| Table::places(&names, &pattern).is_ok())
        };
        let variables: Vec<String> = variables.unwrap_or_default().iter().filter(is_there).cloned().collect();
        let chosen = if variables.is_empty() { None } else { Some(Table::places(&names, &variables)?) };
        let is_kept =
            |var: &usize| Some(*var) != by && chosen.as_ref().is_none_or(|chosen| chosen.contains(var));
        let kept: Vec<usize> = (0..names.len()).filter(is_kept).collect();
        let of_recording = |recording: &Array2<f64>| {
            let rows: Vec<bool> = recording.rows().into_iter().map(is_masked).collect();
            Array2::from_shape_fn((rows.len(), kept.len()), |(row, _)| rows[row])
        };
        let masks: Vec<Array2<bool>> = data.data.recordings().iter().map(of_recording).collect();
        let masked = |mask: &Array2<bool>| mask.column(0).iter().filter(|masked| **masked).count();
        let (rows, out): (usize, usize) =
            masks.iter().map(|mask| (mask.nrows(), masked(mask))).fold((0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
        data.data = data.data.select(&kept);
        data.warnings
            .push(format!("{out} of {rows} rows are masked: they are the past of others, and no effects"));
        Ok(Some(masks))
    }
}

impl Data {
    /// Takes variables out and tells it, with what they are.
    fn leave_out(&mut self, variables: &[usize], what: &str) -> Result<()> {
        if variables.is_empty() {
            return Ok(());
        }
        let kept: Vec<usize> =
            (0..self.data.n_vars()).filter(|var| variables.binary_search(var).is_err()).collect();
        Error::ensure_data(!kept.is_empty(), || {
            format!("every column is {what}: there is nothing to analyse")
        })?;
        let names: Vec<String> = variables.iter().map(|&var| plain(&self.data.var_names()[var])).collect();
        self.data = self.data.select(&kept);
        let gone: HashSet<&str> = names.iter().map(String::as_str).collect();
        let about_one = |warning: &String| {
            let named = warning.split_once("column '").and_then(|(_, rest)| rest.split_once("' "));
            named.is_some_and(|(name, _)| gone.contains(name))
        };
        self.warnings.retain(|warning| !about_one(warning));
        self.warnings.push(format!("left out, {what}: {}", names.join(", ")));
        Ok(())
    }

    /// Replaces each recording; those without rows are left out.
    fn map_recordings(&mut self, change: impl Fn(&Array2<f64>) -> Array2<f64>) -> Result<()> {
        let changed: Vec<Array2<f64>> =
            self.data.recordings().iter().map(change).filter(|r| r.nrows() > 0).collect();
        Error::ensure(!changed.is_empty(), "rows", || "there are no such rows")?;
        self.data = self.data.with_recordings(changed)?;
        Ok(())
    }
}

/// Whether a variable has one number only; one without any is empty.
fn is_constant(data: &DataFrame, var: usize) -> bool {
    let mut present = values_of(data, var).filter(|value| !value.is_nan());
    let first = present.next();
    first.is_some() && present.all(|value| Some(value) == first)
}

fn is_empty(data: &DataFrame, var: usize) -> bool {
    values_of(data, var).all(|value| value.is_nan())
}

fn values_of(data: &DataFrame, var: usize) -> impl Iterator<Item = &f64> {
    data.recordings().iter().flat_map(move |recording| recording.column(var))
}

/// Whether a column of a recording is a goal's place or the distance to it, by its name: `h_dg`, `h_7_gx`.
fn is_of_goal(name: impl AsRef<str>) -> bool {
    let name = name.as_ref();
    name.contains("_dg") || name.contains("_g")
}

/// Why there is nothing in these columns, and what to do.
fn sentence(names: &[String], recorded: bool) -> String {
    let has = if names.len() == 1 { "has" } else { "have" };
    let cause = match recorded && names.iter().any(is_of_goal) {
        true => {
            format!(": the recording has no goal of the person ({} names its topic)", Named("human_goal"))
        }
        false => String::new(),
    };
    let drop = Named("drop_empty");
    format!("{} {has} no value at all{cause}; {drop} goes on without", names.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_window_is_two_numbers_of_which_each_may_be_left_out() {
        let rows = |text: &str| text.parse::<Rows>().map(|Rows(rows)| rows);
        assert_eq!(rows("1..500"), Ok(1..=500));
        assert_eq!(rows("..500"), Ok(1..=500));
        assert_eq!(rows("20.."), Ok(20..=usize::MAX));
        for wrong in ["0..5", "7", "9..3", "a..b", "-1..3"] {
            assert!(rows(wrong).is_err(), "{wrong}");
        }
    }
}
