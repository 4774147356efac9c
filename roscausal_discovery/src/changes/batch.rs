//! Batches as the detector sees them: rows with their past, each batch centred by itself.

use ndarray::{Array2, Axis, s};
use serde::{Deserialize, Serialize};

use crate::{
    numeric::rows::centred,
    types::{Node, same_value},
};

/// Rows that a variable must have on either side to show what it drives.
const SHOWN: usize = 20;
/// Fewest rows of a batch of which a part is left out.
const LEFT: usize = 20;

/// A stretch of recorded rows. Its first `2 tau_max` rows serve only as the past of the others. A row counts if nothing is missing in
/// it and in its past, and if it is not masked.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Batch {
    /// `T x N`.
    #[serde(with = "rows")]
    pub(super) values: Array2<f64>,
    /// Rows read before its first counted one, over all batches.
    pub(super) first: usize,
    /// Smallest and largest value of each variable, before the mean was taken off.
    pub(super) ranges: Vec<[f64; 2]>,
    /// Whether each row is not an effect; empty: each may be one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    masked: Vec<bool>,
}

/// Missing values are equal.
impl PartialEq for Batch {
    fn eq(&self, other: &Self) -> bool {
        self.first == other.first
            && self.ranges == other.ranges
            && self.masked == other.masked
            && self.values.dim() == other.values.dim()
            && self.values.iter().zip(&other.values).all(same_value)
    }
}

impl Batch {
    /// The batch with the mean of each variable taken off: a mean that moves is not a change of a mechanism.
    pub(super) fn new(mut values: Array2<f64>, first: usize) -> Self {
        let mut ranges = Vec::with_capacity(values.ncols());
        for mut column in values.columns_mut() {
            column.iter_mut().filter(|v| !v.is_finite()).for_each(|v| *v = f64::NAN);
            let known = || column.iter().copied().filter(|v| v.is_finite());
            let fold = |pick: fn(f64, f64) -> f64| known().reduce(pick).unwrap_or_default();
            ranges.push([fold(f64::min), fold(f64::max)]);
            let mean = known().sum::<f64>() / known().count().max(1) as f64;
            column -= mean;
        }
        Self { values, first, ranges, masked: Vec::new() }
    }

    /// The batch in which these rows are not effects: one word for each row, or none.
    pub(super) fn with_masked(self, masked: Vec<bool>) -> Self {
        Self { masked, ..self }
    }

    /// Whether a row is masked.
    pub(super) fn is_masked(&self) -> bool {
        self.masked.contains(&true)
    }

    /// Which cells are masked.
    pub(super) fn mask(&self) -> Array2<bool> {
        Array2::from_shape_fn(self.values.dim(), |(t, _)| self.masked.get(t) == Some(&true))
    }

    /// What is left of it from a row on, of all rows read; `None` if that is next to nothing. It keeps its ranges, as bounds.
    pub(super) fn without_rows_before(&self, row: usize, past: usize) -> Option<Self> {
        let gone = row.saturating_sub(self.first).min(self.values.nrows());
        let left = Self {
            values: self.values.slice(s![gone.., ..]).to_owned(),
            first: self.first + gone,
            ranges: self.ranges.clone(),
            masked: self.masked.get(gone..).unwrap_or_default().to_vec(),
        };
        (left.len(past) >= LEFT).then_some(left)
    }

    /// The batch with one variable more, which was 0 all the time.
    pub(super) fn extend(&mut self) {
        let (rows, n) = self.values.dim();
        let mut wider = Array2::zeros((rows, n + 1));
        wider.slice_mut(s![.., ..n]).assign(&self.values);
        self.values = wider;
        self.ranges.push([0.0; 2]);
    }

    /// The rows that count, from 0 after the first `past` ones.
    pub(super) fn rows(&self, past: usize) -> Vec<usize> {
        let (mut rows, mut complete) = (Vec::new(), 0);
        for (t, cells) in self.values.rows().into_iter().enumerate() {
            complete = if cells.iter().all(|v| v.is_finite()) { complete + 1 } else { 0 };
            if complete > past && self.masked.get(t) != Some(&true) {
                rows.push(t - past);
            }
        }
        rows
    }

    /// How many rows count.
    pub(super) fn len(&self, past: usize) -> usize {
        self.rows(past).len()
    }

    /// Whether a variable varies in it often enough to show what it drives: in [`SHOWN`] rows it is above the middle of its
    /// range, in as many below.
    pub(super) fn varies(&self, var: usize, past: usize) -> bool {
        let column = self.values.column(var);
        let values: Vec<f64> = column.iter().skip(past).copied().filter(|v| v.is_finite()).collect();
        let end = |pick: fn(f64, f64) -> f64| values.iter().copied().reduce(pick).unwrap_or_default();
        let (low, high) = (end(f64::min), end(f64::max));
        let above = values.iter().filter(|value| **value > 0.5 * (low + high)).count();
        high - low > 1e-12 && above.min(values.len() - above) >= SHOWN
    }
}

/// One column over several batches: the values of a node, with each batch's mean taken off.
pub(super) fn column(batches: &[&Batch], node: Node, past: usize) -> Vec<f64> {
    let of_batch = |batch: &&Batch| {
        let part = batch.values.index_axis(Axis(1), node.var);
        centred(batch.rows(past).iter().map(|t| part[past - node.lag + t]).collect())
    };
    batches.iter().flat_map(of_batch).collect()
}

/// The squares of a column, with each batch's mean taken off.
pub(super) fn squares(batches: &[&Batch], node: Node, past: usize) -> Vec<f64> {
    let of_batch = |batch: &&Batch| centred(column(&[*batch], node, past).iter().map(|v| v * v).collect());
    batches.iter().flat_map(of_batch).collect()
}

/// Values as rows, for files.
mod rows {
    use ndarray::Array2;
    use serde::{Deserialize, Deserializer, Serializer, de::Error};

    /// A missing value is `null`.
    pub(super) fn serialize<S: Serializer>(values: &Array2<f64>, to: S) -> Result<S::Ok, S::Error> {
        let cell = |v: &f64| v.is_finite().then_some(*v);
        to.collect_seq(values.rows().into_iter().map(|row| row.iter().map(cell).collect::<Vec<_>>()))
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Array2<f64>, D::Error> {
        let rows = Vec::<Vec<Option<f64>>>::deserialize(from)?;
        let shape = (rows.len(), rows.first().map_or(0, Vec::len));
        let cells = rows.into_iter().flatten().map(|cell| cell.unwrap_or(f64::NAN)).collect();
        Array2::from_shape_vec(shape, cells).map_err(D::Error::custom)
    }
}
