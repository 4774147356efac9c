//! Batches as the detector sees them: rows with their past, each batch centred by itself.

use ndarray::{Array2, Axis, s};
use serde::{Deserialize, Serialize};

use crate::ground::Node;

/// Rows that a variable must have on either side to show what it drives.
const SHOWN: usize = 20;
/// Fewest rows of a batch of which a part is left out.
const LEFT: usize = 20;

/// A stretch of recorded rows. Its first `2 tau_max` rows serve only as the past of the others.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Batch {
    /// `T x N`.
    #[serde(with = "rows")]
    pub(super) values: Array2<f64>,
    /// Rows read before its first counted one, over all batches.
    pub(super) first: usize,
    /// Smallest and largest value of each variable, before the mean was taken off.
    pub(super) ranges: Vec<[f64; 2]>,
}

impl Batch {
    /// The batch with the mean of each variable taken off: a mean that moves is no change of a mechanism.
    pub(super) fn new(mut values: Array2<f64>, first: usize) -> Self {
        let range = |column: ndarray::ArrayView1<'_, f64>| {
            let fold = |pick: fn(f64, f64) -> f64| column.iter().copied().reduce(pick).unwrap_or_default();
            [fold(f64::min), fold(f64::max)]
        };
        let ranges = values.columns().into_iter().map(range).collect();
        for mut column in values.columns_mut() {
            let mean = column.mean().unwrap_or_default();
            column -= mean;
        }
        Self { values, first, ranges }
    }

    /// What is left of it from a row on, of all rows read; `None` if that is next to nothing. It keeps its ranges, as bounds.
    pub(super) fn from_row(&self, row: usize, past: usize) -> Option<Self> {
        let gone = row.saturating_sub(self.first);
        let left = self.len(past).saturating_sub(gone);
        (left >= LEFT).then(|| Self {
            values: self.values.slice(s![gone.., ..]).to_owned(),
            first: self.first + gone,
            ranges: self.ranges.clone(),
        })
    }

    /// The batch with one variable more, which was 0 all the time.
    pub(super) fn extend(&mut self) {
        let (rows, n) = self.values.dim();
        let mut wider = Array2::zeros((rows, n + 1));
        wider.slice_mut(s![.., ..n]).assign(&self.values);
        self.values = wider;
        self.ranges.push([0.0; 2]);
    }

    /// Rows that count.
    pub(super) fn len(&self, past: usize) -> usize {
        self.values.nrows().saturating_sub(past)
    }

    /// Whether a variable varies in it often enough to show what it drives: in [`SHOWN`] rows it is above the middle of its
    /// range, in as many below.
    pub(super) fn varies(&self, var: usize, past: usize) -> bool {
        let values: Vec<f64> = self.values.column(var).iter().skip(past).copied().collect();
        let end = |pick: fn(f64, f64) -> f64| values.iter().copied().reduce(pick).unwrap_or_default();
        let (low, high) = (end(f64::min), end(f64::max));
        let above = values.iter().filter(|value| **value > 0.5 * (low + high)).count();
        high - low > 1e-12 && above.min(values.len() - above) >= SHOWN
    }
}

/// One column over several batches: the values of a node, with each batch's mean taken off.
pub(super) fn column(batches: &[&Batch], node: Node, past: usize) -> Vec<f64> {
    let mut all = Vec::new();
    for batch in batches {
        let from = past - node.lag;
        let n = batch.len(past);
        let part = batch.values.index_axis(Axis(1), node.var);
        let mean = part.iter().skip(from).take(n).sum::<f64>() / n.max(1) as f64;
        all.extend(part.iter().skip(from).take(n).map(|v| v - mean));
    }
    all
}

/// Values as rows, for files.
mod rows {
    use ndarray::Array2;
    use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};

    pub(super) fn serialize<S: Serializer>(values: &Array2<f64>, to: S) -> Result<S::Ok, S::Error> {
        values.rows().into_iter().map(|row| row.to_vec()).collect::<Vec<_>>().serialize(to)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Array2<f64>, D::Error> {
        let rows = Vec::<Vec<f64>>::deserialize(from)?;
        let shape = (rows.len(), rows.first().map_or(0, Vec::len));
        Array2::from_shape_vec(shape, rows.into_iter().flatten().collect()).map_err(D::Error::custom)
    }
}
