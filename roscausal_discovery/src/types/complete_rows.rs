//! All variables at all lags, without the samples in which anything is missing.

use super::node::Node;

/// The complete samples of all recordings: one column for each variable at each lag. No sample crosses recordings.
///
/// For example two variables at lags 0 and 1 are four columns; a recording of 100 rows gives 99 samples.
#[derive(Clone, Debug)]
pub(crate) struct CompleteRows {
    /// Number of variables.
    pub(crate) n_vars: usize,
    /// By lag, then variable.
    pub(super) columns: Vec<Vec<f64>>,
    /// Samples left out.
    pub(crate) n_lost: usize,
}

impl CompleteRows {
    /// Number of samples.
    pub(crate) fn len(&self) -> usize {
        self.columns.first().map_or(0, Vec::len)
    }

    /// The samples of a node; its lag is at most the cut-off of the samples.
    pub(crate) fn column(&self, node: Node) -> &[f64] {
        &self.columns[node.lag * self.n_vars + node.var]
    }
}
