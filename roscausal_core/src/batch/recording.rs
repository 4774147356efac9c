//! A batch in memory.

use std::{collections::BTreeMap, fmt};

use super::tracks::{Field, Values};
use crate::Time;

/// A recorded batch: rows at a fixed step, NaN where a value is unknown.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recording {
    /// Stamp of the first row.
    pub start: Time,
    /// Step between rows, nanoseconds.
    pub dt_ns: i64,
    /// Frame of all positions.
    pub frame: String,
    /// The robot, one entry per row.
    pub robot: Vec<Values>,
    /// The people, each with one entry per row.
    pub people: BTreeMap<u32, Vec<Values>>,
    /// Other robots by name, each with one entry per row.
    pub others: BTreeMap<String, Vec<Values>>,
    /// Interventions by column, with one entry per row; empty where nothing is imposed.
    pub context: BTreeMap<String, Vec<Vec<f64>>>,
    /// Signals by name, in their order, each with one entry per row.
    pub signals: Vec<(String, Vec<f64>)>,
    /// The batch has its full length.
    pub complete: bool,
    /// Why it ended; `None` while it goes on.
    pub ended_by: Option<EndedBy>,
    /// The length that it was to have, seconds, 0: until the end; `None` if nobody said.
    pub length_s: Option<f64>,
}

/// Why a batch ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EndedBy {
    /// It had the length asked for.
    TsLength,
    /// It was asked to go on until the end, but had as many rows as a batch may have.
    MostRows,
    /// The node that records ended.
    NodeEnd,
    /// The clock jumped.
    ClockJump,
    /// The robot's frame changed.
    FrameChange,
    /// There was no room for more in the pool.
    FullPool,
    /// The node was ended by force; the batch is what its journal held.
    Recovery,
}

impl EndedBy {
    /// The reason in words.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::TsLength => "ts_length reached",
            Self::MostRows => "the most rows reached",
            Self::NodeEnd => "the node ended",
            Self::ClockJump => "the clock jumped",
            Self::FrameChange => "the robot's frame changed",
            Self::FullPool => "the pool is full",
            Self::Recovery => "the node was ended by force; recovered from its journal",
        }
    }
}

impl fmt::Display for EndedBy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

/// A column of a batch.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Name in the header.
    pub name: String,
    /// Unit, if there is one.
    pub unit: &'static str,
    /// One value per row.
    pub values: Vec<f64>,
}

impl Column {
    /// A column whose unit is not known, or which has none.
    fn without_unit(name: &str, values: Vec<f64>) -> Self {
        Self { name: name.to_owned(), unit: "", values }
    }
}

/// Consecutive rows in which one body has no value.
#[derive(Clone, Debug, PartialEq)]
pub struct Gap {
    /// `r`, or `h_<id>`.
    pub body: String,
    /// Stamp of the first row without a value, in seconds.
    pub from: f64,
    /// Stamp of the last row without a value, in seconds.
    pub to: f64,
}

/// An intervention, as a batch records it.
#[derive(Clone, Debug, PartialEq)]
pub struct Imposed {
    /// Column of the intervention.
    pub column: String,
    /// The imposed value: a number, or the coordinates of a point.
    pub value: Vec<f64>,
    /// Stamp of the first row with it, in seconds.
    pub from: f64,
    /// Stamp of the last row with it, in seconds.
    pub to: f64,
}

impl Recording {
    /// Number of rows.
    pub fn n_rows(&self) -> usize {
        self.robot.len()
    }

    /// Stamp of a row.
    pub fn stamp(&self, row: usize) -> Time {
        let steps = i64::try_from(row).unwrap_or(i64::MAX);
        Time::from_nanos(self.start.as_nanos().saturating_add(self.dt_ns.saturating_mul(steps)))
    }

    /// Whether there is nothing but signals.
    pub fn is_of_signals(&self) -> bool {
        let unknown = |values: &Values| values.to_array().iter().all(|value| value.is_nan());
        !self.signals.is_empty() && self.people.is_empty() && self.robot.iter().all(unknown)
    }

    /// The columns after `time`: the robot's, then each person's, then the signals. `legacy`: in the original's spelling.
    pub fn columns(&self, legacy: bool) -> Vec<Column> {
        let of = |prefix: &str, rows: &[Values], fields: [Field; 7]| {
            fields.map(|field| Column {
                name: format!("{prefix}_{}", if legacy { field.legacy_name() } else { field.name() }),
                unit: field.unit(),
                values: rows.iter().map(|row| row.get(field)).collect(),
            })
        };
        // A person's goal comes last.
        let mut of_person = Field::ALL;
        of_person.rotate_left(2);
        let mut columns = Vec::new();
        if !self.is_of_signals() {
            columns.extend(of("r", &self.robot, Field::ALL));
        }
        for (id, rows) in &self.people {
            columns.extend(of(&format!("h_{id}"), rows, of_person));
        }
        for (name, rows) in &self.others {
            columns.extend(of(&format!("r_{name}"), rows, Field::ALL));
        }
        columns.extend(self.signal_columns());
        columns.extend(self.context_columns());
        columns
    }

    /// The columns of signals.
    pub fn signal_columns(&self) -> Vec<Column> {
        self.signals.iter().map(|(name, values)| Column::without_unit(name, values.clone())).collect()
    }

    /// The columns of interventions: the imposed value, 1 for a point, 0 where nothing is imposed.
    pub fn context_columns(&self) -> Vec<Column> {
        let number = |imposed: &Vec<f64>| match imposed.as_slice() {
            [] => 0.0,
            [value] => *value,
            _ => 1.0,
        };
        let values = |rows: &Vec<Vec<f64>>| rows.iter().map(number).collect();
        self.context.iter().map(|(name, rows)| Column::without_unit(name, values(rows))).collect()
    }

    /// The interventions with their times, ordered by column and time.
    pub fn interventions(&self) -> Vec<Imposed> {
        let mut found: Vec<Imposed> = Vec::new();
        for (column, rows) in &self.context {
            for (row, value) in rows.iter().enumerate().filter(|(_, value)| !value.is_empty()) {
                let stamp = self.stamp(row).as_secs_f64();
                match found.last_mut() {
                    Some(last)
                        if last.column == *column
                            && last.value == *value
                            && row > 0
                            && rows[row - 1] == *value =>
                    {
                        last.to = stamp;
                    }
                    _ => found.push(Imposed {
                        column: column.clone(),
                        value: value.clone(),
                        from: stamp,
                        to: stamp,
                    }),
                }
            }
        }
        found
    }

    /// The times at which the position of a body is unknown.
    pub fn gaps(&self) -> Vec<Gap> {
        let mut gaps = Vec::new();
        if self.is_of_signals() {
            return gaps;
        }
        let people = self.people.iter().map(|(id, rows)| (format!("h_{id}"), rows));
        for (body, rows) in std::iter::once(("r".to_owned(), &self.robot)).chain(people) {
            let mut first = None;
            for row in 0..=rows.len() {
                let missing = rows.get(row).is_some_and(|values| values.x.is_nan());
                match (missing, first) {
                    (true, None) => first = Some(row),
                    (false, Some(from)) => {
                        let (from, to) = (self.stamp(from).as_secs_f64(), self.stamp(row - 1).as_secs_f64());
                        gaps.push(Gap { body: body.clone(), from, to });
                        first = None;
                    }
                    _ => {}
                }
            }
        }
        gaps
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recording() -> Recording {
        let row = |x: f64| Values::from_array([1.0, 2.0, x, 4.0, 0.5, 0.6, 0.7]);
        Recording {
            start: Time::from_secs_f64(10.0),
            dt_ns: 100_000_000,
            frame: "map".into(),
            robot: vec![row(3.0); 4],
            people: BTreeMap::from([(7, vec![row(f64::NAN), row(1.0), row(f64::NAN), row(f64::NAN)])]),
            others: BTreeMap::new(),
            context: BTreeMap::new(),
            signals: Vec::new(),
            complete: true,
            ended_by: Some(EndedBy::TsLength),
            length_s: None,
        }
    }

    #[test]
    fn columns_have_the_documented_names_and_order() {
        let names =
            |legacy| -> Vec<String> { recording().columns(legacy).into_iter().map(|c| c.name).collect() };
        let clean =
            "r_gx r_gy r_x r_y r_theta r_v r_omega h_7_x h_7_y h_7_theta h_7_v h_7_omega h_7_gx h_7_gy";
        assert_eq!(names(false).join(" "), clean);
        assert_eq!(names(true)[..5], ["r_{gx}", "r_{gy}", "r_x", "r_y", "r_{\theta}"]);
        let columns = recording().columns(false);
        assert_eq!((columns[0].values[0], columns[11].values[1], columns[12].values[1]), (1.0, 0.7, 1.0));
    }

    #[test]
    fn what_is_imposed_is_a_column_and_a_list_of_spans() {
        let (free, slow, goal) = (vec![], vec![0.2], vec![3.0, -4.0]);
        let context = BTreeMap::from([
            ("do_human_goal".to_owned(), vec![goal.clone(), free.clone(), free.clone(), free.clone()]),
            ("do_robot_speed".to_owned(), vec![free.clone(), slow.clone(), slow.clone(), free]),
        ]);
        let batch = Recording { context, ..recording() };
        let columns = batch.columns(false);
        let values: Vec<&[f64]> = columns[14..].iter().map(|column| &column.values[..]).collect();
        assert_eq!(values, [&[1.0, 0.0, 0.0, 0.0], &[0.0, 0.2, 0.2, 0.0]]);
        let span = |column: &str, value: &Vec<f64>, from, to| Imposed {
            column: column.to_owned(),
            value: value.clone(),
            from,
            to,
        };
        let expected = [span("do_human_goal", &goal, 10.0, 10.0), span("do_robot_speed", &slow, 10.1, 10.2)];
        assert_eq!(batch.interventions(), expected);
    }

    #[test]
    fn gaps_are_told_from_their_first_row_to_their_last() {
        let gap = |from, to| Gap { body: "h_7".into(), from, to };
        assert_eq!(recording().gaps(), [gap(10.0, 10.0), gap(10.2, 10.3)]);
    }
}
