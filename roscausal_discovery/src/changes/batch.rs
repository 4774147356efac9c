//! Batches as the detector sees them: rows with their past, each batch centred by itself.

use ndarray::{Array2, Axis};

use crate::ground::Node;

/// A stretch of recorded rows. Its first `2 tau_max` rows serve only as the past of the others.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Batch {
    /// `T x N`.
    pub(super) values: Array2<f64>,
    /// Rows read before its first counted one, over all batches.
    pub(super) first: usize,
}

impl Batch {
    /// The batch with the mean of each variable taken off: a mean that moves is no change of a mechanism.
    pub(super) fn new(mut values: Array2<f64>, first: usize) -> Self {
        for mut column in values.columns_mut() {
            let mean = column.mean().unwrap_or_default();
            column -= mean;
        }
        Self { values, first }
    }

    /// Rows that count.
    pub(super) fn len(&self, past: usize) -> usize {
        self.values.nrows().saturating_sub(past)
    }

    /// Whether a variable varies in it.
    pub(super) fn varies(&self, var: usize) -> bool {
        self.values.column(var).iter().any(|v| v.abs() > 1e-12)
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
