//! A row of the open batch as soon as it can no longer change: for those who do not wait for the batch.

use std::collections::BTreeSet;

use super::{recording::Recording, tracks::Values};
use crate::Time;

/// The newest row of a batch that is being recorded.
#[derive(Clone, Debug, PartialEq)]
pub struct FreshRow {
    /// The row and, where the batch has one, the row before it. Its `start` is that of the batch.
    pub tail: Recording,
    /// Place of the tail's first row in the batch.
    pub first: usize,
    /// Whether the batch so far has several people, so that its columns carry their ids.
    pub by_id: bool,
}

impl FreshRow {
    /// Stamp of the row.
    pub fn stamp(&self) -> Time {
        self.tail.stamp(self.first + self.tail.n_rows().saturating_sub(1))
    }
}

/// The newest row of `open`, and the one before it. With `nearest` (how many at most, and who) it has these people alone.
pub(super) fn fresh_row(open: &Recording, nearest: Option<&(usize, BTreeSet<u32>)>) -> FreshRow {
    let n_rows = open.n_rows();
    let first = n_rows.saturating_sub(2);
    let tail_of = |rows: &Vec<Values>| {
        (first..n_rows).map(|k| rows.get(k).copied().unwrap_or(Values::UNKNOWN)).collect()
    };
    let wanted = |id: &u32| nearest.is_none_or(|(_, who)| who.contains(id));
    let imposed =
        |rows: &Vec<Vec<f64>>| (first..n_rows).map(|k| rows.get(k).cloned().unwrap_or_default()).collect();
    let measured =
        |rows: &Vec<f64>| (first..n_rows).map(|k| rows.get(k).copied().unwrap_or(f64::NAN)).collect();
    let people = open.people.iter().filter(|(id, _)| wanted(id));
    let tail = Recording {
        start: open.start,
        dt_ns: open.dt_ns,
        frame: open.frame.clone(),
        robot: tail_of(&open.robot),
        people: people.map(|(id, rows)| (*id, tail_of(rows))).collect(),
        others: open.others.iter().map(|(name, rows)| (name.clone(), tail_of(rows))).collect(),
        context: open.context.iter().map(|(name, rows)| (name.clone(), imposed(rows))).collect(),
        signals: open.signals.iter().map(|(name, rows)| (name.clone(), measured(rows))).collect(),
        ..Recording::default()
    };
    FreshRow { tail, first, by_id: open.people.len() > 1 && nearest.is_none_or(|(number, _)| *number > 1) }
}
