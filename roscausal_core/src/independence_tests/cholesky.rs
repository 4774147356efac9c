use super::gram::{Correlations, dot};

/// A pivot (share of a variable's variance that the variables before it leave) below this costs too many digits of
/// a correlation matrix: such tests go back to the samples.
const MIN_PIVOT: f64 = 1e-3;

/// Share of a row's norm that may be left of it when it is a linear combination of others.
const RANK_TOLERANCE: f64 = 1e-12;

/// A growing Cholesky factor. Row `i` depends only on the nodes up to `i`, so rows that the last test already
/// computed for the same leading nodes are kept: the result is the same, to the bit, as without them.
#[derive(Default)]
pub(crate) struct Factor {
    nodes: Vec<usize>,
    /// Rows of the factor, packed: row `i` has `i + 1` entries, the last one the *inverse* of the diagonal.
    rows: Vec<f64>,
}

impl Factor {
    /// Extends the factor to `nodes`; `None` when a pivot is too small.
    fn extend(&mut self, r: &Correlations, nodes: impl Iterator<Item = usize>) -> Option<()> {
        let mut shared = true;
        let mut n = 0;
        for node in nodes {
            shared = shared && self.nodes.get(n) == Some(&node);
            if !shared {
                self.nodes.truncate(n);
                self.rows.truncate(n * (n + 1) / 2);
                self.push(r, node)?;
            }
            n += 1;
        }
        self.nodes.truncate(n);
        self.rows.truncate(n * (n + 1) / 2);
        Some(())
    }

    fn push(&mut self, r: &Correlations, node: usize) -> Option<()> {
        let n = self.nodes.len();
        let start = self.rows.len();
        let correlations = r.row(node);
        let mut pivot = correlations[node];
        for j in 0..n {
            let row = j * (j + 1) / 2;
            let mut entry = correlations[self.nodes[j]];
            for k in 0..j {
                entry -= self.rows[start + k] * self.rows[row + k];
            }
            entry *= self.rows[row + j];
            pivot -= entry * entry;
            self.rows.push(entry);
        }
        if pivot < MIN_PIVOT {
            self.rows.truncate(start);
            return None;
        }
        self.rows.push(1.0 / pivot.sqrt());
        self.nodes.push(node);
        Some(())
    }

    /// Partial correlation of `x` and `y` given `z`; `None` when the matrix is too near to a singular one.
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
        // The row of x, without keeping it: entry with y, and what is left of x after z.
        let n = z.len();
        let start = self.rows.len();
        let correlations = r.row(x);
        let mut left = correlations[x];
        for j in 0..n {
            let row = j * (j + 1) / 2;
            let mut entry = correlations[self.nodes[j]];
            for k in 0..j {
                entry -= self.rows[start + k] * self.rows[row + k];
            }
            entry *= self.rows[row + j];
            left -= entry * entry;
            self.rows.push(entry);
        }
        let row = n * (n + 1) / 2;
        let mut with_y = correlations[y];
        for k in 0..n {
            with_y -= self.rows[start + k] * self.rows[row + k];
        }
        with_y *= self.rows[row + n];
        self.rows.truncate(start);
        (left >= MIN_PIVOT).then(|| (with_y / left.sqrt()).clamp(-1.0, 1.0))
    }

    /// Share of `y`'s variance that `z` leaves; `None` as above.
    pub(crate) fn residual_variance(&mut self, r: &Correlations, y: usize, z: &[usize]) -> Option<f64> {
        self.extend(r, z.iter().copied().chain([y]))?;
        self.rows.last().map(|inverse| 1.0 / (inverse * inverse))
    }
}

/// What is left of `row` after its projection on the orthonormal `basis` is taken off (twice, for the digits).
/// The row has norm 1; false, and an empty row, when nothing but rounding is left.
fn orthogonalize(row: &mut [f64], basis: &[Vec<f64>]) -> bool {
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

/// An orthonormal basis of what rows of norm 1 span; a row that depends on those before it adds nothing.
fn orthonormal_basis(rows: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
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

/// Residuals of `x` and `y` on `z` from the samples, all rows standardised (norm 1, mean 0). A residual that is
/// zero but for rounding comes as zeros.
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
