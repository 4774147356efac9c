use ndarray::Array2;

use crate::{Error, Result};

/// A variable at a lag: `var` at `t - lag`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Node {
    /// Column of the data frame.
    pub var: usize,
    /// Steps into the past, 0 for the present.
    pub lag: usize,
}

impl Node {
    /// The node `var` at `t - lag`.
    pub fn new(var: usize, lag: usize) -> Self {
        Self { var, lag }
    }

    /// The node `steps` further into the past.
    pub fn shifted(self, steps: usize) -> Self {
        Self { var: self.var, lag: self.lag + steps }
    }
}

/// One or several recordings of the same variables. Missing values are NaN.
#[derive(Clone, Debug)]
pub struct DataFrame {
    recordings: Vec<Array2<f64>>,
    var_names: Vec<String>,
}

impl DataFrame {
    /// A data frame from recordings, each `T x N` (time in rows), and the `N` names of the variables.
    ///
    /// # Errors
    /// No recording, no variable, or shapes that do not fit together; an infinite value.
    pub fn new(recordings: Vec<Array2<f64>>, var_names: Vec<String>) -> Result<Self> {
        if recordings.is_empty() || var_names.is_empty() {
            return Err(Error::Data(
                "no data: give at least one recording with at least one variable".into(),
            ));
        }
        for (i, recording) in recordings.iter().enumerate() {
            if recording.ncols() != var_names.len() {
                return Err(Error::Data(format!(
                    "recording {i} has {} columns for {} variable names",
                    recording.ncols(),
                    var_names.len()
                )));
            }
            if let Some(((row, col), value)) = recording.indexed_iter().find(|(_, v)| v.is_infinite()) {
                return Err(Error::Data(format!(
                    "'{}' is {value} at row {row} of recording {i}; remove the row or leave the cell empty",
                    var_names[col]
                )));
            }
        }
        Ok(Self { recordings, var_names })
    }

    /// The recordings, each `T x N`.
    pub fn recordings(&self) -> &[Array2<f64>] {
        &self.recordings
    }

    /// Names of the variables.
    pub fn var_names(&self) -> &[String] {
        &self.var_names
    }

    /// Number of variables.
    pub fn n_vars(&self) -> usize {
        self.var_names.len()
    }
}

/// The time indices that all tests of one run use: `cut_off..T` of each recording.
#[derive(Clone, Debug)]
pub struct Samples<'a> {
    data: &'a DataFrame,
    cut_off: usize,
}

/// The rows of one test after samples with a missing node are left out.
#[derive(Clone, Debug, Default)]
pub struct LaggedArrays {
    /// `n` samples of X.
    pub x: Vec<f64>,
    /// `n` samples of Y.
    pub y: Vec<f64>,
    /// One row of `n` samples per node of Z.
    pub z: Vec<Vec<f64>>,
    /// Samples left out.
    pub n_lost: usize,
}

impl<'a> Samples<'a> {
    /// Samples for a run with `tau_max` (`cut_off` = `2xtau_max`).
    pub fn new(data: &'a DataFrame, cut_off: usize) -> Self {
        Self { data, cut_off }
    }

    /// The data frame behind.
    pub fn data(&self) -> &'a DataFrame {
        self.data
    }

    /// First time index used in each recording.
    pub fn cut_off(&self) -> usize {
        self.cut_off
    }

    /// Number of samples before any is left out.
    pub fn len(&self) -> usize {
        self.data.recordings.iter().map(|r| r.nrows().saturating_sub(self.cut_off)).sum()
    }

    /// Whether there is no sample at all.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The samples of `x`, `y` and `z` in which none of them is missing. Lags go up to `cut_off`.
    pub fn arrays(&self, x: Node, y: Node, z: &[Node]) -> LaggedArrays {
        let mut out = LaggedArrays { z: vec![Vec::with_capacity(self.len()); z.len()], ..Default::default() };
        for recording in &self.data.recordings {
            for t in self.cut_off..recording.nrows() {
                let at = |node: Node| recording[[t - node.lag, node.var]];
                if at(x).is_nan() || at(y).is_nan() || z.iter().any(|&node| at(node).is_nan()) {
                    out.n_lost += 1;
                    continue;
                }
                out.x.push(at(x));
                out.y.push(at(y));
                z.iter().zip(&mut out.z).for_each(|(&node, row)| row.push(at(node)));
            }
        }
        out
    }
}
