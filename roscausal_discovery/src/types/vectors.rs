//! The further columns of variables that have several.
//!
//! Example: the variable `place` is the columns `x` and `y`; `x` stands among the recordings, `y` here.

use std::{ops::Range, sync::Arc};

use ndarray::{Array2, s};

/// The further columns of vectors; the first one of each stands among the recordings of the data frame.
#[derive(Clone, Debug)]
pub(super) struct Vectors {
    /// One array per recording.
    pub(super) columns: Arc<Vec<Array2<f64>>>,
    /// For each variable the places of its further columns.
    pub(super) of: Vec<Vec<usize>>,
}

impl Vectors {
    pub(super) fn select(&self, vars: &[usize]) -> Self {
        Self { columns: self.columns.clone(), of: vars.iter().map(|&var| self.of[var].clone()).collect() }
    }

    /// Those of some rows of one recording.
    pub(super) fn stretch(&self, recording: usize, rows: Range<usize>) -> Self {
        let Range { start, end } = rows;
        let columns = self.columns[recording].slice(s![start..end, ..]).to_owned();
        Self { columns: Arc::new(vec![columns]), of: self.of.clone() }
    }

    pub(super) fn is_missing(&self, recording: usize, at: usize, var: usize) -> bool {
        self.of[var].iter().any(|&column| self.columns[recording][[at, column]].is_nan())
    }

    pub(super) fn has_missing(&self) -> bool {
        let used = |recording: &Array2<f64>| {
            self.of.iter().flatten().any(|&column| recording.column(column).iter().any(|v| v.is_nan()))
        };
        self.columns.iter().any(used)
    }
}
