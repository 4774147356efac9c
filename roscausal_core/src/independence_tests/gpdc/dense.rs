//! The marginal likelihood by the whole kernel matrix: exact, `n^3` operations, two matrices of `n^2` doubles.

use faer::{
    Accum, MatMut, MatRef, Par,
    dyn_stack::{MemBuffer, MemStack},
    linalg::{cholesky::llt, matmul, triangular_inverse},
    prelude::ReborrowMut,
};

use super::{
    buffer::Buffer,
    gp::Theta,
    kernel::{Inputs, dot},
};

/// Columns that are multiplied at a time.
const BLOCK: usize = 96;
/// Columns that are transposed at a time: one cache line.
const LINE: usize = 8;

/// `A = K + s I = L L'`.
pub(super) struct Dense {
    n: usize,
    /// Below and on the diagonal `L^-1`; above it `dK / d ln l`, whose diagonal is 0.
    parts: Buffer,
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
        let (mut factor, mut parts) = (Buffer::any(n * n), Buffer::any(n * n));
        fill(inputs, theta, &mut factor, &mut parts);
        let scratch = llt::factor::cholesky_in_place_scratch::<f64>(n, Par::Seq, Default::default());
        llt::factor::cholesky_in_place(
            MatMut::from_column_major_slice_mut(&mut factor, n, n),
            Default::default(),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
            Default::default(),
        )
        .ok()?;
        let log_determinant = 2.0 * factor.iter().step_by(n + 1).map(|d| d.ln()).sum::<f64>();
        triangular_inverse::invert_lower_triangular(
            MatMut::from_column_major_slice_mut(&mut parts, n, n),
            MatRef::from_column_major_slice(&factor, n, n),
            Par::Seq,
        );
        let square = |(j, column): (usize, &[f64])| dot(&column[j..], &column[j..]);
        let trace_inverse = parts.chunks_exact(n).enumerate().map(square).sum();
        let trace_derivative = trace_of_product(&parts, n);
        Some(Self { n, parts, log_determinant, trace_inverse, trace_derivative })
    }

    /// `A^-1 y`, and `a' dK a` of the solution `a`.
    pub(super) fn solve(&self, y: &[f64]) -> (Vec<f64>, f64) {
        let columns = || self.parts.chunks_exact(self.n).enumerate();
        let mut half = vec![0.0; self.n];
        for (j, column) in columns() {
            half[j..].iter_mut().zip(&column[j..]).for_each(|(sum, l)| *sum += l * y[j]);
        }
        let alpha: Vec<f64> = columns().map(|(j, column)| dot(&column[j..], &half[j..])).collect();
        let curvature =
            2.0 * columns().map(|(j, column)| alpha[j] * dot(&column[..j], &alpha[..j])).sum::<f64>();
        (alpha, curvature)
    }
}

/// Writes `A` on and below the diagonal of `factor`, and `dK / d ln l` above the diagonal of `parts`.
fn fill(inputs: &Inputs, theta: Theta, factor: &mut [f64], parts: &mut [f64]) {
    let n = inputs.len();
    let mut derivatives = vec![0.0; LINE * n];
    for first in (0..n).step_by(LINE) {
        let height = n - first;
        let lines = LINE.min(height);
        for (k, derivative) in derivatives.chunks_exact_mut(n).take(lines).enumerate() {
            let j = first + k;
            let column = &mut factor[j * n..(j + 1) * n];
            inputs.column(theta.l, j, first, &mut column[first..], &mut derivative[..height]);
            column[j] += theta.s;
        }
        for i in first + 1..n {
            let line = &mut parts[i * n + first..][..lines.min(i - first)];
            line.iter_mut().enumerate().for_each(|(k, value)| *value = derivatives[k * n + i - first]);
        }
    }
}

/// `tr(L^-T L^-1 D)` from the lower triangle `L^-1` and the symmetric `D` above the diagonal of `parts`, block by
/// block.
fn trace_of_product(parts: &[f64], n: usize) -> f64 {
    let inverse = MatRef::from_column_major_slice(parts, n, n);
    let (mut product, mut diagonal) = (vec![0.0; BLOCK * BLOCK], vec![0.0; BLOCK * BLOCK]);
    let mut trace = 0.0;
    for row in (0..n).step_by(BLOCK) {
        let height = BLOCK.min(n - row);
        let below = inverse.subrows(row + height, n - row - height);
        // The block of L^-1 on the diagonal, without the part of D above it.
        for (k, column) in diagonal.chunks_exact_mut(height).take(height).enumerate() {
            let start = (row + k) * n + row;
            column[..k].fill(0.0);
            column[k..].copy_from_slice(&parts[start + k..start + height]);
        }
        let diagonal = MatRef::from_column_major_slice(&diagonal[..height * height], height, height);
        for column in (0..=row).step_by(BLOCK) {
            let width = BLOCK.min(n - column);
            let beside = if column == row { diagonal } else { inverse.submatrix(row, column, height, width) };
            // The transposed block of A^-1, so that both it and D above the diagonal are read down their columns.
            let mut block =
                MatMut::from_column_major_slice_mut(&mut product[..width * height], width, height);
            matmul::matmul(block.rb_mut(), Accum::Replace, beside.transpose(), diagonal, 1.0, Par::Seq);
            let far = below.subcols(column, width).transpose();
            matmul::matmul(block, Accum::Add, far, below.subcols(row, height), 1.0, Par::Seq);
            for k in 0..height {
                let above = if column == row { k } else { width };
                let start = (row + k) * n + column;
                trace += dot(&parts[start..start + above], &product[k * width..k * width + above]);
            }
        }
    }
    2.0 * trace
}
