//! Time series for causal discovery: the data frame, and the lagged samples that tests get from it.
//!
//! A [`DataFrame`] holds recordings of the same variables. [`Samples`] are the time indices that all tests of a run
//! use. For one test `X _||_ Y | Z` they give the lagged rows ([`LaggedArrays`]), without the samples in which a
//! value is missing or masked.

use ndarray::{Array2, Axis};

use super::Control;
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

/// The roles in `X _||_ Y | Z` in which a masked value excludes a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MaskType {
    /// A masked X excludes the sample.
    pub x: bool,
    /// A masked Y excludes the sample.
    pub y: bool,
    /// A masked node of Z excludes the sample.
    pub z: bool,
}

impl std::str::FromStr for MaskType {
    type Err = Error;

    /// Reads letters such as `y` or `xyz`.
    fn from_str(text: &str) -> Result<Self> {
        let mut mask = Self::default();
        for letter in text.chars() {
            match letter {
                'x' => mask.x = true,
                'y' => mask.y = true,
                'z' => mask.z = true,
                _ => {
                    return Err(Error::param(
                        "mask_type",
                        format!("'{text}' is not made of the letters x, y, z"),
                    ));
                }
            }
        }
        Ok(mask)
    }
}

/// One or several recordings of the same variables. Missing values are NaN.
#[derive(Clone, Debug)]
pub struct DataFrame {
    recordings: Vec<Array2<f64>>,
    var_names: Vec<String>,
    masks: Option<Vec<Array2<bool>>>,
    mask_type: MaskType,
    remove_missing_upto_maxlag: bool,
    has_missing: bool,
}

impl DataFrame {
    /// A data frame of recordings, each `T x N` (time in rows), and the `N` names of the variables.
    ///
    /// # Errors
    /// No recording, no variable, shapes that do not match, or an infinite value.
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
        let has_missing = recordings.iter().any(|r| r.iter().any(|v| v.is_nan()));
        Ok(Self {
            recordings,
            var_names,
            masks: None,
            mask_type: MaskType::default(),
            remove_missing_upto_maxlag: false,
            has_missing,
        })
    }

    /// Treats every value that equals `flag` as missing.
    #[must_use]
    pub fn with_missing_flag(mut self, flag: f64) -> Self {
        self.recordings.iter_mut().for_each(|r| r.mapv_inplace(|v| if v == flag { f64::NAN } else { v }));
        self.has_missing = self.recordings.iter().any(|r| r.iter().any(|v| v.is_nan()));
        self
    }

    /// Adds masks, one per recording and of its shape (`true`: masked). A masked value excludes a sample in the
    /// roles of `mask_type`.
    ///
    /// # Errors
    /// Masks whose number or shapes differ from those of the recordings.
    pub fn with_mask(mut self, masks: Vec<Array2<bool>>, mask_type: MaskType) -> Result<Self> {
        let fits = masks.len() == self.recordings.len()
            && masks.iter().zip(&self.recordings).all(|(mask, recording)| mask.dim() == recording.dim());
        if !fits {
            return Err(Error::param("mask", "give one mask per recording, each of the recording's shape"));
        }
        self.masks = Some(masks);
        self.mask_type = mask_type;
        Ok(self)
    }

    /// With `on`, a missing value also excludes the samples up to `2xtau_max` after it.
    #[must_use]
    pub fn with_remove_missing_upto_maxlag(mut self, on: bool) -> Self {
        self.remove_missing_upto_maxlag = on;
        self
    }

    /// A data frame of the columns `vars` only, in that order.
    ///
    /// # Panics
    /// If a column does not exist.
    #[must_use]
    pub fn select(&self, vars: &[usize]) -> Self {
        let recordings: Vec<_> = self.recordings.iter().map(|r| r.select(Axis(1), vars)).collect();
        Self {
            has_missing: recordings.iter().any(|r| r.iter().any(|v| v.is_nan())),
            recordings,
            var_names: vars.iter().map(|&var| self.var_names[var].clone()).collect(),
            masks: self.masks.as_ref().map(|m| m.iter().map(|m| m.select(Axis(1), vars)).collect()),
            ..self.clone()
        }
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

    /// Whether some tests may have to leave out samples: a value is missing, or a mask applies.
    pub fn is_incomplete(&self) -> bool {
        self.has_missing || (self.masks.is_some() && self.mask_type != MaskType::default())
    }

    fn excludes(&self, recording: usize, t: usize, node: Node, mask_role: bool) -> bool {
        let at = t - node.lag;
        let masked = || self.masks.as_ref().is_some_and(|masks| masks[recording][[at, node.var]]);
        self.recordings[recording][[at, node.var]].is_nan() || (mask_role && masked())
    }
}

/// The time indices that all tests of one run use: `cut_off..T` of each recording.
#[derive(Clone, Debug)]
pub struct Samples<'a> {
    data: &'a DataFrame,
    cut_off: usize,
    control: Control,
}

/// The lagged rows of one test, without the samples in which a node is missing or masked.
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
    /// The samples of a run. A run with `tau_max` uses `cut_off` = `2xtau_max`.
    pub fn new(data: &'a DataFrame, cut_off: usize) -> Self {
        Self { data, cut_off, control: Control::default() }
    }

    /// The same samples, watched by `control`.
    #[must_use]
    pub fn with_control(mut self, control: Control) -> Self {
        self.control = control;
        self
    }

    /// The control of the run. A test that takes longer than a second calls its `check` in its loops.
    pub fn control(&self) -> &Control {
        &self.control
    }

    /// The data frame that the samples come from.
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

    /// Whether there is no sample.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The rows of `x`, `y` and `z`, without the samples in which one of them is missing or masked. Lags go up to
    /// `cut_off`.
    pub fn arrays(&self, x: Node, y: Node, z: &[Node]) -> LaggedArrays {
        let n = self.len();
        let row = || Vec::with_capacity(n);
        let mut out =
            LaggedArrays { x: row(), y: row(), z: (0..z.len()).map(|_| row()).collect(), n_lost: 0 };
        let incomplete = self.data.is_incomplete();
        for (k, recording) in self.data.recordings.iter().enumerate() {
            let dropped = if incomplete { self.dropped(k, x, y, z) } else { Vec::new() };
            for t in self.cut_off..recording.nrows() {
                if incomplete && dropped[t - self.cut_off] {
                    out.n_lost += 1;
                    continue;
                }
                let at = |node: Node| recording[[t - node.lag, node.var]];
                out.x.push(at(x));
                out.y.push(at(y));
                z.iter().zip(&mut out.z).for_each(|(&node, row)| row.push(at(node)));
            }
        }
        out
    }

    /// For each sample of recording `k`: whether this test leaves it out.
    fn dropped(&self, k: usize, x: Node, y: Node, z: &[Node]) -> Vec<bool> {
        let (data, mask) = (self.data, self.data.mask_type);
        let n_rows = data.recordings[k].nrows();
        let drops = |t: usize, x_on: bool, y_on: bool, z_on: bool| {
            data.excludes(k, t, x, x_on)
                || data.excludes(k, t, y, y_on)
                || z.iter().any(|&node| data.excludes(k, t, node, z_on))
        };
        let mut dropped: Vec<bool> =
            (self.cut_off..n_rows).map(|t| drops(t, mask.x, mask.y, mask.z)).collect();
        if data.remove_missing_upto_maxlag {
            for t in self.cut_off..n_rows {
                if drops(t, false, false, false) {
                    let end = (t + self.cut_off + 1).min(n_rows);
                    dropped[t - self.cut_off..end - self.cut_off].fill(true);
                }
            }
        }
        dropped
    }
}
