//! The newest rows of the variables: what the reasoning node fits its equations on, and what questions are about.

use std::{
    collections::{BTreeSet, VecDeque},
    path::Path,
};

use ndarray::Array2;
use roscausal_discovery::{DataFrame, names};
use roscausal_msgs::{Features, Time};
use roscausal_reasoning::answer::Status;

use crate::{Error, Result, batch::Table, ensure, grammar::Parsed};

/// Most columns that are kept.
const MOST_COLUMNS: usize = 256;
/// Going back by less than this, a row was there already; by more, the clock has jumped. Nanoseconds.
const JUMP_BACK_NS: i64 = 1_000_000_000;

/// What a question needs, or why it cannot be answered.
pub(super) type Answerable<T> = std::result::Result<T, (Status, String)>;

struct Row {
    stamp_ns: i64,
    /// Rows of one segment follow one another without a gap.
    segment: u64,
    /// In the order of the columns; columns that came later are missing at the end.
    values: Vec<f64>,
}

/// A ring of rows.
#[derive(Default)]
pub(super) struct Rows {
    columns: Vec<String>,
    rows: VecDeque<Row>,
    most: usize,
    person: String,
    segment: u64,
    /// Step between rows, once two were there.
    step_ns: Option<i64>,
    /// A step that would be another one, if it comes twice.
    other_step_ns: i64,
}

/// The rows of one segment, and the one that is asked about.
pub(super) struct Moment {
    pub(super) rows: Array2<f64>,
    pub(super) now: usize,
    pub(super) stamps: Vec<i64>,
}

impl Moment {
    /// Stamp of a row.
    pub(super) fn stamp(&self, row: usize) -> Time {
        Time::from_nanos(self.stamps.get(row).copied().unwrap_or(0))
    }
}

impl Rows {
    /// No rows yet; at most `most` will be kept. With several people, `person`'s variables count.
    pub(super) fn new(most: usize, person: &str) -> Self {
        Self { most, person: person.trim().to_owned(), ..Self::default() }
    }

    /// Number of rows.
    pub(super) fn len(&self) -> usize {
        self.rows.len()
    }

    /// Step between rows in seconds, once it is known.
    pub(super) fn step_s(&self) -> Option<f64> {
        self.step_ns.map(|step| step as f64 / 1e9)
    }

    /// Adds the rows of a batch, as a recording of its own.
    pub(super) fn add_file(&mut self, path: &Path) -> Result<()> {
        let table = Table::read(path, None)?;
        let reason = "it has no column of times, which a batch has; leave it out of 'data'";
        let times = table.time.as_ref().ok_or_else(|| Error::file(path, reason))?;
        self.segment += 1;
        for (t, row) in times.iter().zip(table.values.outer_iter()) {
            let stamp = Time::from_secs_f64(*t);
            self.push(stamp, &table.names, &row.to_vec()).map_err(|reason| Error::file(path, reason))?;
        }
        self.segment += 1;
        Ok(())
    }

    /// Adds a message. Returns whether it is a new row.
    ///
    /// # Errors
    /// A message that is none, in words.
    pub(super) fn add(&mut self, features: &Features) -> Parsed<bool> {
        let (names, values) = (features.names.len(), features.values.len());
        ensure(names == values, || format!("a message with {names} names and {values} values is left out"))?;
        self.push(features.header.stamp, &features.names, &features.values)
    }

    fn push(&mut self, stamp: Time, names: &[String], values: &[f64]) -> Parsed<bool> {
        let stamp_ns = stamp.as_nanos();
        if let Some(last) = self.rows.back().filter(|last| last.segment == self.segment) {
            let step = stamp_ns.saturating_sub(last.stamp_ns);
            if step <= 0 && step > -JUMP_BACK_NS {
                return Ok(false);
            }
            if !self.follows(step) {
                self.segment += 1;
            }
        }
        let mut row = vec![f64::NAN; self.columns.len()];
        for (name, value) in names.iter().zip(values) {
            let column = match self.columns.iter().position(|known| known == name) {
                Some(column) => column,
                None if self.columns.len() >= MOST_COLUMNS => {
                    return Err(format!("more than {MOST_COLUMNS} variables; '{name}' is left out"));
                }
                None => {
                    self.columns.push(name.clone());
                    row.push(f64::NAN);
                    row.len() - 1
                }
            };
            // As in batches: one infinite value would refuse every fit until its row is gone.
            row[column] = if value.is_finite() { *value } else { f64::NAN };
        }
        self.rows.push_back(Row { stamp_ns, segment: self.segment, values: row });
        while self.rows.len() > self.most {
            self.rows.pop_front();
        }
        Ok(true)
    }

    /// Whether a row that comes `step` after the last one follows it without a gap.
    fn follows(&mut self, step: i64) -> bool {
        let near = |a: i64, b: i64| a.abs_diff(b) <= b.unsigned_abs() / 10;
        match self.step_ns {
            _ if step <= 0 => false,
            None => {
                self.step_ns = Some(step);
                true
            }
            Some(known) if near(step, known) => {
                self.other_step_ns = 0;
                true
            }
            // A shorter step, or twice the same other one: the rows have another step now.
            Some(known) if step < known || near(step, self.other_step_ns) => {
                self.step_ns = Some(step);
                false
            }
            Some(_) => {
                self.other_step_ns = step;
                false
            }
        }
    }

    /// The columns of a model's variables.
    ///
    /// # Errors
    /// A variable that no column is, with those that there are.
    pub(super) fn columns_of(&self, variables: &[String]) -> Parsed<Vec<usize>> {
        let person = self.person_id();
        let find = |name: &String| {
            let own = person.as_ref().and_then(|id| {
                let rest = name.strip_prefix("h_")?;
                names::position(&self.columns, &format!("h_{id}_{rest}"))
            });
            own.or_else(|| names::position(&self.columns, name)).ok_or_else(|| {
                format!(
                    "the model's variable '{name}' is not on /roscausal/features, which has {}; record it (parameter features of the data \
                     node) or wait for a new model",
                    self.columns.join(", ")
                )
            })
        };
        variables.iter().map(find).collect()
    }

    /// The person whose variables count: the parameter's, or the only one with an id.
    fn person_id(&self) -> Option<String> {
        if !self.person.is_empty() {
            return Some(self.person.clone());
        }
        let id = |name: &String| {
            let (id, _) = name.strip_prefix("h_")?.split_once('_')?;
            id.bytes().all(|byte| byte.is_ascii_digit()).then(|| id.to_owned())
        };
        let ids: BTreeSet<String> = self.columns.iter().filter_map(id).collect();
        if ids.len() == 1 { ids.into_iter().next() } else { None }
    }

    /// All rows of the model's variables and of the columns `context` that are there: one recording for each segment.
    pub(super) fn data(&self, variables: &[String], context: &[String]) -> Result<DataFrame> {
        let mut columns = self.columns_of(variables).map_err(Error::Data)?;
        let mut all = variables.to_vec();
        for name in context {
            if let Some(column) = names::position(&self.columns, name) {
                columns.push(column);
                all.push(name.clone());
            }
        }
        let mut segments: Vec<Vec<&Row>> = Vec::new();
        for row in &self.rows {
            match segments.last_mut() {
                Some(last) if last[0].segment == row.segment => last.push(row),
                _ => segments.push(vec![row]),
            }
        }
        Ok(DataFrame::new(segments.iter().map(|rows| matrix(rows, &columns)).collect(), all)?)
    }

    /// The segment that has a stamp, and its last row that is not after it; without a stamp the newest row.
    ///
    /// # Errors
    /// No such row, in words.
    pub(super) fn at(&self, variables: &[String], stamp: Option<Time>) -> Answerable<Moment> {
        let columns = self.columns_of(variables).map_err(|reason| (Status::NoModel, reason))?;
        let reason = "there are no rows yet; the data node publishes them on /roscausal/features";
        let newest = self.rows.back().ok_or_else(|| (Status::NoData, reason.to_owned()))?;
        let step = self.step_ns.unwrap_or(0);
        let (row, last) = match stamp {
            None => (newest, self.rows.len() - 1),
            Some(stamp) => {
                let wanted = stamp.as_nanos();
                let has =
                    |row: &Row| row.stamp_ns <= wanted && wanted.saturating_sub(row.stamp_ns) < step.max(1);
                let found = self.rows.iter().enumerate().rev().find(|(_, row)| has(row));
                let (last, row) = found.ok_or_else(|| {
                    let [first, end] = [self.rows.front(), self.rows.back()].map(|row| row.map_or(0.0, |r| r.stamp_ns as f64 / 1e9));
                    let at = stamp.as_secs_f64();
                    (Status::NoData, format!("there is no sample at {at:.3} s; those that are kept go from {first:.3} to {end:.3} s; ask for one of them, or for 0, the newest"))
                })?;
                (row, last)
            }
        };
        let segment = row.segment;
        let before = self.rows.iter().take(last).rev().take_while(|row| row.segment == segment).count();
        let rows: Vec<&Row> =
            self.rows.iter().skip(last - before).take_while(|row| row.segment == segment).collect();
        let stamps = rows.iter().map(|row| row.stamp_ns).collect();
        Ok(Moment { rows: matrix(&rows, &columns), now: before, stamps })
    }

    /// Whether one of these columns is not 0 in the newest row.
    pub(super) fn is_imposed(&self, context: &[String]) -> bool {
        let Some(newest) = self.rows.back() else { return false };
        let mut columns = context.iter().filter_map(|name| names::position(&self.columns, name));
        columns.any(|column| newest.values.get(column).is_some_and(|value| *value != 0.0 && !value.is_nan()))
    }
}

fn matrix(rows: &[&Row], columns: &[usize]) -> Array2<f64> {
    Array2::from_shape_fn((rows.len(), columns.len()), |(row, k)| {
        rows[row].values.get(columns[k]).copied().unwrap_or(f64::NAN)
    })
}

#[cfg(test)]
mod tests {
    use roscausal_msgs::std_msgs::Header;

    use super::*;

    #[test]
    fn an_infinite_value_is_a_missing_one_and_the_rows_are_still_data() {
        let mut rows = Rows::new(10, "");
        for (t, value) in [1.0, f64::INFINITY, f64::NEG_INFINITY, 2.0].into_iter().enumerate() {
            let header = Header { stamp: Time::from_secs_f64(t as f64), frame_id: String::new() };
            let row = Features { header, names: vec!["d".into()], values: vec![value] };
            assert_eq!(rows.add(&row), Ok(true));
        }
        let data = rows.data(&["d".to_owned()], &[]).expect("rows that can be fitted on");
        let known: Vec<bool> = data.recordings()[0].iter().map(|value| value.is_finite()).collect();
        assert_eq!(known, [true, false, false, true]);
    }
}
