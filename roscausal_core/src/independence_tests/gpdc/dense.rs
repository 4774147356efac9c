//! The marginal likelihood by the whole kernel matrix: exact, `n^3` operations, two matrices of `n^2` doubles.

use faer::{
    Accum, Mat, Par,
    dyn_stack::{MemBuffer, MemStack},
    linalg::{cholesky::llt, matmul, triangular_inverse, triangular_solve},
    prelude::ReborrowMut,
};

use super::{gp::Theta, kernel::Inputs};

/// Columns that are multiplied at a time.
const BLOCK: usize = 96;

/// `A = K + s I` factorised.
pub(super) struct Dense {
    /// Below and on the diagonal the Cholesky factor of `A`; above it `dK / d ln l`, whose diagonal is 0.
    factor: Mat<f64>,
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
        let mut factor = Mat::<f64>::zeros(n, n);
        for j in 0..n {
            inputs.column(theta.l, j, j, &mut factor.col_as_slice_mut(j)[j..], &mut []);
            factor[(j, j)] += theta.s;
        }
        let scratch = llt::factor::cholesky_in_place_scratch::<f64>(n, Par::Seq, Default::default());
        llt::factor::cholesky_in_place(
            factor.as_mut(),
            Default::default(),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
            Default::default(),
        )
        .ok()?;
        // The factorisation may use the upper triangle as its scratch space, so the derivative comes after it.
        let mut kernel = vec![0.0; n];
        for j in 0..n {
            inputs.column(theta.l, j, 0, &mut kernel[..j], &mut factor.col_as_slice_mut(j)[..j]);
        }
        let log_determinant = 2.0 * (0..n).map(|i| factor[(i, i)].ln()).sum::<f64>();
        let mut inverse = Mat::<f64>::zeros(n, n);
        triangular_inverse::invert_lower_triangular(inverse.as_mut(), factor.as_ref(), Par::Seq);
        let trace_inverse =
            (0..n).map(|j| inverse.col_as_slice(j)[j..].iter().map(|v| v * v).sum::<f64>()).sum();
        let trace_derivative = trace_of_product(&inverse, &factor);
        Some(Self { factor, log_determinant, trace_inverse, trace_derivative })
    }

    /// `A^-1 y`, and `a' dK a` of the solution `a`.
    pub(super) fn solve(&self, y: &[f64]) -> (Vec<f64>, f64) {
        let n = y.len();
        let mut alpha = Mat::from_fn(n, 1, |i, _| y[i]);
        triangular_solve::solve_lower_triangular_in_place(self.factor.as_ref(), alpha.as_mut(), Par::Seq);
        triangular_solve::solve_upper_triangular_in_place(self.factor.transpose(), alpha.as_mut(), Par::Seq);
        let alpha = alpha.col_as_slice(0).to_vec();
        let column = |j: usize| {
            let above = &self.factor.col_as_slice(j)[..j];
            alpha[j] * above.iter().zip(&alpha).map(|(d, a)| d * a).sum::<f64>()
        };
        let curvature = 2.0 * (0..n).map(column).sum::<f64>();
        (alpha, curvature)
    }
}

/// `tr(L^-T L^-1 D)` from the lower triangle `inverse = L^-1` and the symmetric `D` above the diagonal of
/// `factor`, block by block.
fn trace_of_product(inverse: &Mat<f64>, factor: &Mat<f64>) -> f64 {
    let n = inverse.nrows();
    let mut block = Mat::<f64>::zeros(BLOCK, BLOCK);
    let mut trace = 0.0;
    for row in (0..n).step_by(BLOCK) {
        let rows = row..(row + BLOCK).min(n);
        for column in (0..=row).step_by(BLOCK) {
            let columns = column..(column + BLOCK).min(n);
            let mut product = block.as_mut().submatrix_mut(0, 0, columns.len(), rows.len());
            // L^-1 vanishes above its diagonal, so rows before `row` do not count. The transposed block, so that
            // both it and D above the diagonal are read down their columns.
            let below = inverse.as_ref().subrows(row, n - row);
            matmul::matmul(
                product.rb_mut(),
                Accum::Replace,
                below.subcols(column, columns.len()).transpose(),
                below.subcols(row, rows.len()),
                1.0,
                Par::Seq,
            );
            for (k, i) in rows.clone().enumerate() {
                let end = columns.len().min(i.saturating_sub(column));
                let derivative = &factor.col_as_slice(i)[column..column + end];
                trace += (0..end).map(|m| derivative[m] * product[(m, k)]).sum::<f64>();
            }
        }
    }
    2.0 * trace
}
