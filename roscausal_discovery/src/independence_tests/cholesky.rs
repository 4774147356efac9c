//! Linear algebra of the partial-correlation tests: a Cholesky factor that grows from test to test, and residuals
//! from the samples.

use super::gram::Correlations;
use crate::numeric::rows::dot;

/// Smallest pivot. A pivot is the fraction of a variable's variance that the earlier variables leave. A smaller one
/// would cost too many digits of a correlation matrix, so such tests use the samples instead.
const MIN_PIVOT: f64 = 1e-3;

/// Largest fraction of a row's norm that rounding may leave if the row is a linear combination of others.
const RANK_TOLERANCE: f64 = 1e-12;

/// A growing Cholesky factor. Row `i` depends only on the nodes up to `i`. So rows that the previous test computed
/// for the same leading nodes are reused, and the result is bitwise the same as without reuse.
#[derive(Default)]
pub(crate) struct Factor {
    nodes: Vec<usize>,
    /// The factor by columns, each of `capacity` entries. Forward substitution then runs along columns and need not
    /// wait for a sum at each entry.
    columns: Vec<f64>,
    capacity: usize,
    /// Inverses of the diagonal.
    inverse: Vec<f64>,
    /// The row being computed.
    row: Vec<f64>,
}

impl Factor {
    /// Extends the factor to `nodes`; `None` if a pivot is too small.
    fn extend(&mut self, r: &Correlations, nodes: impl Iterator<Item = usize>) -> Option<()> {
        let mut shared = true;
        let mut n = 0;
        for node in nodes {
            shared = shared && self.nodes.get(n) == Some(&node);
            if !shared {
                self.truncate(n);
                self.push(r, node)?;
            }
            n += 1;
        }
        self.truncate(n);
        Some(())
    }

    fn truncate(&mut self, n: usize) {
        self.nodes.truncate(n);
        self.inverse.truncate(n);
    }

    /// Computes in `row` the entries of `node` for the first `n` columns. The entries after them are its
    /// covariances with the other nodes, given those `n`. Returns the remaining variance of the node.
    fn substitute(&mut self, r: &Correlations, node: usize, n: usize) -> f64 {
        let correlations = r.row(node);
        self.row.clear();
        self.row.extend(self.nodes.iter().map(|&other| correlations[other]));
        let mut left = correlations[node];
        let end = self.nodes.len();
        // Four columns at a time: one pass over the rest of the row subtracts all four.
        let mut j = 0;
        while j < n {
            let width = if j + 4 <= n { 4 } else { 1 };
            let mut entries = [0.0; 4];
            for (a, solved) in entries.iter_mut().enumerate().take(width) {
                let entry = self.row[j + a] * self.inverse[j + a];
                self.row[j + a] = entry;
                *solved = entry;
                left -= entry * entry;
                for b in a + 1..width {
                    self.row[j + b] -= entry * self.columns[(j + a) * self.capacity + j + b];
                }
            }
            let column =
                |a: usize| &self.columns[(j + a) * self.capacity + j + width..(j + a) * self.capacity + end];
            let rest = &mut self.row[j + width..];
            if width == 4 {
                let (c0, c1, c2, c3) = (column(0), column(1), column(2), column(3));
                for ((((value, x0), x1), x2), x3) in rest.iter_mut().zip(c0).zip(c1).zip(c2).zip(c3) {
                    *value -= (entries[0] * x0 + entries[1] * x1) + (entries[2] * x2 + entries[3] * x3);
                }
            } else {
                for (value, factor) in rest.iter_mut().zip(column(0)) {
                    *value -= entries[0] * factor;
                }
            }
            j += width;
        }
        left
    }

    fn push(&mut self, r: &Correlations, node: usize) -> Option<()> {
        let n = self.nodes.len();
        let pivot = self.substitute(r, node, n);
        if pivot < MIN_PIVOT {
            return None;
        }
        if n >= self.capacity {
            self.grow();
        }
        for (j, &entry) in self.row.iter().enumerate() {
            self.columns[j * self.capacity + n] = entry;
        }
        self.inverse.push(1.0 / pivot.sqrt());
        self.nodes.push(node);
        Some(())
    }

    fn grow(&mut self) {
        let capacity = (2 * self.capacity).max(32);
        let mut columns = vec![0.0; capacity * capacity];
        for j in 0..self.nodes.len() {
            let old = &self.columns[j * self.capacity..(j + 1) * self.capacity];
            columns[j * capacity..j * capacity + self.capacity].copy_from_slice(old);
        }
        self.columns = columns;
        self.capacity = capacity;
    }

    /// Partial correlation of `x` and `y` given `z`; `None` if the matrix is too close to singular.
    pub(crate) fn partial_correlation(
        &mut self,
        r: &Correlations,
        x: usize,
        y: usize,
        z: &[usize],
    ) -> Option<f64> {
        if z.is_empty() {
            return Some(r.row(x)[y].clamp(-1.0, 1.0));
        }
        self.extend(r, z.iter().copied().chain([y]))?;
        // The row of x for the nodes in z. Its entry for y is then the covariance of x and y given z.
        let left = self.substitute(r, x, z.len());
        let with_y = self.row[z.len()] * self.inverse[z.len()];
        (left >= MIN_PIVOT).then(|| (with_y / left.sqrt()).clamp(-1.0, 1.0))
    }

    /// The factor of `nodes`; `None` as above.
    pub(crate) fn set(&mut self, r: &Correlations, nodes: &[usize]) -> Option<()> {
        self.extend(r, nodes.iter().copied())
    }

    /// Solves the lower triangle of the nodes for a right side: products of another row with the nodes become its products with
    /// what each node has beyond the earlier ones, of norm 1.
    pub(crate) fn forward(&mut self, right: impl Iterator<Item = f64>) -> &[f64] {
        self.row.clear();
        self.row.extend(right);
        for j in 0..self.nodes.len() {
            let entry = self.row[j] * self.inverse[j];
            self.row[j] = entry;
            let column = &self.columns[j * self.capacity + j + 1..j * self.capacity + self.nodes.len()];
            self.row[j + 1..].iter_mut().zip(column).for_each(|(value, factor)| *value -= entry * factor);
        }
        &self.row
    }

    /// Fraction of `y`'s variance that remains given `z`; `None` as above.
    pub(crate) fn residual_variance(&mut self, r: &Correlations, y: usize, z: &[usize]) -> Option<f64> {
        self.extend(r, z.iter().copied().chain([y]))?;
        self.inverse.last().map(|inverse| 1.0 / (inverse * inverse))
    }
}

/// Subtracts from `row` its projection on the orthonormal `basis` (twice, for accuracy). The row has norm 1. If
/// nothing but rounding remains, the row becomes zero and the result is false.
pub(crate) fn orthogonalize(row: &mut [f64], basis: &[Vec<f64>]) -> bool {
    for _ in 0..2 {
        for q in basis {
            let along = dot(row, q);
            row.iter_mut().zip(q).for_each(|(v, q)| *v -= along * q);
        }
    }
    let norm = dot(row, row).sqrt();
    if norm < RANK_TOLERANCE {
        row.fill(0.0);
        return false;
    }
    true
}

/// An orthonormal basis of the span of rows of norm 1. A row that depends on earlier ones adds nothing.
pub(crate) fn orthonormal_basis(rows: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let mut basis: Vec<Vec<f64>> = Vec::with_capacity(rows.len());
    for mut row in rows {
        if orthogonalize(&mut row, &basis) {
            let norm = dot(&row, &row).sqrt();
            row.iter_mut().for_each(|v| *v /= norm);
            basis.push(row);
        }
    }
    basis
}

/// Residuals of `x` and `y` on `z`, computed from the samples. All rows are standardised (norm 1, mean 0). A
/// residual that is zero up to rounding is returned as zeros.
pub(crate) fn residuals(mut x: Vec<f64>, mut y: Vec<f64>, z: Vec<Vec<f64>>) -> (Vec<f64>, Vec<f64>) {
    let basis = orthonormal_basis(z);
    orthogonalize(&mut x, &basis);
    orthogonalize(&mut y, &basis);
    (x, y)
}

/// Correlation of two rows of mean 0; 0 when one of them is zero.
pub(crate) fn correlation(x: &[f64], y: &[f64]) -> f64 {
    let norms = (dot(x, x) * dot(y, y)).sqrt();
    if norms > 0.0 { (dot(x, y) / norms).clamp(-1.0, 1.0) } else { 0.0 }
}
