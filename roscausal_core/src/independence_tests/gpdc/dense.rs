//! The marginal likelihood by the whole kernel matrix: exact, `n^3` operations, two matrices of `n^2` doubles.

use faer::{
    Accum, MatMut, MatRef, Par,
    dyn_stack::{MemBuffer, MemStack},
    linalg::{cholesky::llt, matmul, triangular_inverse, triangular_solve},
    prelude::ReborrowMut,
};

use super::{buffer::Buffer, gp::Theta, kernel::Inputs};

/// Columns that are multiplied at a time.
const BLOCK: usize = 96;

/// `A = K + s I` factorised.
pub(super) struct Dense {
    /// Below and on the diagonal the Cholesky factor of `A`; above it `dK / d ln l`, whose diagonal is 0.
    factor: Buffer,
    pub(super) log_determinant: f64,
    /// `tr(A^-1)`.
    pub(super) trace_inverse: f64,
    /// `tr(A^-1 dK / d ln l)`.
    pub(super) trace_derivative: f64,
}

impl Dense {
    /// Bytes that `n` samples take at the most.
    pub(super) fn bytes(n: usize) -> usize {
        2 * n * n * size_of::<f64>()
    }

    /// The factorisation at `theta`; `None` where `A` is not positive definite in double precision.
    pub(super) fn new(inputs: &Inputs, theta: Theta) -> Option<Self> {
        let n = inputs.len();
        let mut factor = Buffer::any(n * n);
        for (j, column) in factor.chunks_exact_mut(n).enumerate() {
            inputs.column(theta.l, j, j, &mut column[j..], &mut []);
            column[j] += theta.s;
        }
        let scratch = llt::factor::cholesky_in_place_scratch::<f64>(n, Par::Seq, Default::default());
        llt::factor::cholesky_in_place(
            MatMut::from_column_major_slice_mut(&mut factor, n, n),
            Default::default(),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
            Default::default(),
        )
        .ok()?;
        // The factorisation may use the upper triangle as its scratch space, so the derivative comes after it.
        let mut kernel = vec![0.0; n];
        for (j, column) in factor.chunks_exact_mut(n).enumerate() {
            inputs.column(theta.l, j, 0, &mut kernel[..j], &mut column[..j]);
        }
        let log_determinant = 2.0 * factor.iter().step_by(n + 1).map(|d| d.ln()).sum::<f64>();
        let mut inverse = Buffer::any(n * n);
        for (j, column) in inverse.chunks_exact_mut(n).enumerate() {
            // Products read the blocks on the diagonal whole.
            column[j - j % BLOCK..j].fill(0.0);
        }
        triangular_inverse::invert_lower_triangular(
            MatMut::from_column_major_slice_mut(&mut inverse, n, n),
            MatRef::from_column_major_slice(&factor, n, n),
            Par::Seq,
        );
        let square = |(j, column): (usize, &[f64])| column[j..].iter().map(|v| v * v).sum::<f64>();
        let trace_inverse = inverse.chunks_exact(n).enumerate().map(square).sum();
        let trace_derivative = trace_of_product(&inverse, &factor, n);
        Some(Self { factor, log_determinant, trace_inverse, trace_derivative })
    }

    /// `A^-1 y`, and `a' dK a` of the solution `a`.
    pub(super) fn solve(&self, y: &[f64]) -> (Vec<f64>, f64) {
        let n = y.len();
        let factor = MatRef::from_column_major_slice(&self.factor, n, n);
        let mut alpha = y.to_vec();
        let mut column = MatMut::from_column_major_slice_mut(&mut alpha, n, 1);
        triangular_solve::solve_lower_triangular_in_place(factor, column.rb_mut(), Par::Seq);
        triangular_solve::solve_upper_triangular_in_place(factor.transpose(), column, Par::Seq);
        let row = |(j, above): (usize, &[f64])| {
            alpha[j] * above[..j].iter().zip(&alpha).map(|(d, a)| d * a).sum::<f64>()
        };
        let curvature = 2.0 * self.factor.chunks_exact(n).enumerate().map(row).sum::<f64>();
        (alpha, curvature)
    }
}

/// `tr(L^-T L^-1 D)` from the lower triangle `inverse = L^-1` and the symmetric `D` above the diagonal of
/// `factor`, block by block.
fn trace_of_product(inverse: &[f64], factor: &[f64], n: usize) -> f64 {
    let inverse = MatRef::from_column_major_slice(inverse, n, n);
    let mut block = Buffer::any(BLOCK * BLOCK);
    let mut trace = 0.0;
    for row in (0..n).step_by(BLOCK) {
        let rows = row..(row + BLOCK).min(n);
        for column in (0..=row).step_by(BLOCK) {
            let columns = column..(column + BLOCK).min(n);
            let product = MatMut::from_column_major_slice_mut(
                &mut block[..columns.len() * rows.len()],
                columns.len(),
                rows.len(),
            );
            // L^-1 vanishes above its diagonal, so rows before `row` do not count. The transposed block, so that
            // both it and D above the diagonal are read down their columns.
            let below = inverse.subrows(row, n - row);
            matmul::matmul(
                product,
                Accum::Replace,
                below.subcols(column, columns.len()).transpose(),
                below.subcols(row, rows.len()),
                1.0,
                Par::Seq,
            );
            for (k, i) in rows.clone().enumerate() {
                let end = columns.len().min(i.saturating_sub(column));
                let derivative = &factor[i * n + column..i * n + column + end];
                let product = &block[k * columns.len()..k * columns.len() + end];
                trace += derivative.iter().zip(product).map(|(d, p)| d * p).sum::<f64>();
            }
        }
    }
    2.0 * trace
}
