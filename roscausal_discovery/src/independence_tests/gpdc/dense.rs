//! The marginal likelihood by the whole kernel matrix: exact but for rounding, `n^3` operations, two matrices of `n^2`
//! numbers in single or double precision.

use std::marker::PhantomData;

use faer::{
    Accum, MatMut, MatRef, Par,
    dyn_stack::{MemBuffer, MemStack},
    linalg::{
        cholesky::llt,
        matmul, triangular_inverse,
        triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place},
    },
    prelude::ReborrowMut,
};

use super::{
    buffer::Buffer,
    factorisation::{Factorisation, Solution, Traces},
    kernel::Inputs,
    real::{Real, lower_times},
    theta::Theta,
};

/// Columns that are multiplied at a time.
const BLOCK: usize = 48;
/// Columns that are transposed at a time: one cache line.
const LINE: usize = 8;

/// `A = K + s I = L L'` in precision `T`.
pub(super) struct Dense<T> {
    n: usize,
    /// For a search: below and on the diagonal `L^-1`; above it `dK / d ln l`, whose diagonal is 0. Else `L`.
    parts: Buffer,
    inverted: bool,
    log_determinant: f64,
    /// 0 unless for a search.
    traces: Traces,
    precision: PhantomData<T>,
}

impl<T: Real> Dense<T> {
    /// Bytes that `n` samples take at the most.
    pub(super) fn bytes(n: usize) -> usize {
        2 * n * n * size_of::<T>()
    }

    /// The factorisation at `theta`, for a search with its gradient; `None` where `A` is not positive definite in this
    /// precision.
    pub(super) fn new(inputs: &Inputs, theta: Theta, for_search: bool) -> Option<Self> {
        let n = inputs.len();
        let (mut factor, mut parts) =
            (Buffer::of::<T>(n * n), Buffer::of::<T>(if for_search { n * n } else { 0 }));
        fill::<T>(inputs, theta, factor.numbers_mut(n * n), for_search.then(|| parts.numbers_mut(n * n)));
        let matrix = factor.numbers_mut::<T>(n * n);
        let scratch = llt::factor::cholesky_in_place_scratch::<T>(n, Par::Seq, Default::default());
        llt::factor::cholesky_in_place(
            MatMut::from_column_major_slice_mut(matrix, n, n),
            Default::default(),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
            Default::default(),
        )
        .ok()?;
        let log_determinant = 2.0 * matrix.iter().step_by(n + 1).map(|d| d.double().ln()).sum::<f64>();
        if !for_search {
            let traces = Traces::default();
            return Some(Self {
                n,
                parts: factor,
                inverted: false,
                log_determinant,
                traces,
                precision: PhantomData,
            });
        }
        let inverse = parts.numbers_mut::<T>(n * n);
        triangular_inverse::invert_lower_triangular(
            MatMut::from_column_major_slice_mut(inverse, n, n),
            MatRef::from_column_major_slice(matrix, n, n),
            Par::Seq,
        );
        let square = |(j, column): (usize, &[T])| T::dot(&column[j..], &column[j..]);
        let (derivative, squared) = traces_of_products(inverse, n);
        let traces =
            Traces { inverse: inverse.chunks_exact(n).enumerate().map(square).sum(), squared, derivative };
        Some(Self { n, parts, inverted: true, log_determinant, traces, precision: PhantomData })
    }

    fn view(&self) -> &[T] {
        self.parts.numbers(self.n * self.n)
    }

    /// `L^-1 y`, of a factorisation for a search.
    fn half(&self, y: &[T]) -> Vec<T> {
        lower_times(self.view(), y)
    }
}

impl<T: Real> Factorisation for Dense<T> {
    fn log_determinant(&self) -> f64 {
        self.log_determinant
    }

    fn traces(&self) -> Traces {
        self.traces
    }

    fn solve(&self, y: &[f64]) -> Solution {
        let alpha = self.alpha(y);
        let (parts, weights) = (self.view(), alpha.iter().map(|&a| T::from_double(a)).collect::<Vec<T>>());
        let column = |(j, column): (usize, &[T])| alpha[j] * T::dot(&column[..j], &weights[..j]);
        let derivative = 2.0 * parts.chunks_exact(self.n).enumerate().map(column).sum::<f64>();
        let half = self.half(&weights);
        Solution { alpha, squared: T::dot(&half, &half), derivative }
    }

    fn alpha(&self, y: &[f64]) -> Vec<f64> {
        let n = self.n;
        let mut half: Vec<T> = y.iter().map(|&y| T::from_double(y)).collect();
        let right = || MatRef::from_column_major_slice(self.view(), n, n);
        if self.inverted {
            half = self.half(&half);
            let columns = self.view().chunks_exact(n).enumerate();
            return columns.map(|(j, column)| T::dot(&column[j..], &half[j..])).collect();
        }
        let mut solution = MatMut::from_column_major_slice_mut(&mut half, n, 1);
        solve_lower_triangular_in_place(right(), solution.rb_mut(), Par::Seq);
        solve_upper_triangular_in_place(right().transpose(), solution, Par::Seq);
        half.into_iter().map(T::double).collect()
    }
}

/// Writes `A` on and below the diagonal of `factor`, and `dK / d ln l` above the diagonal of `parts`.
fn fill<T: Real>(inputs: &Inputs, theta: Theta, factor: &mut [T], mut parts: Option<&mut [T]>) {
    let n = inputs.len();
    let mut derivatives = vec![T::zeroed(); LINE * n];
    for first in (0..n).step_by(LINE) {
        let height = n - first;
        let lines = LINE.min(height);
        for (k, derivative) in derivatives.chunks_exact_mut(n).take(lines).enumerate() {
            let j = first + k;
            let derivative = if parts.is_some() { &mut derivative[..height] } else { &mut [] };
            let kernel = &mut factor[j * n + first..(j + 1) * n];
            T::column(inputs, theta.l, j, first, kernel, derivative);
            kernel[k] = T::from_double(1.0 + theta.s);
        }
        let Some(parts) = parts.as_deref_mut() else { continue };
        for i in first + 1..n {
            let line = &mut parts[i * n + first..][..lines.min(i - first)];
            line.iter_mut().enumerate().for_each(|(k, value)| *value = derivatives[k * n + i - first]);
        }
    }
}

/// `tr(A^-1 D)` and `tr(A^-2)`, where `A^-1 = L^-T L^-1`, from the lower triangle `L^-1` and the symmetric `D` above the
/// diagonal of `parts`, block by block.
fn traces_of_products<T: Real>(parts: &[T], n: usize) -> (f64, f64) {
    let inverse = MatRef::from_column_major_slice(parts, n, n);
    let (mut product, mut diagonal) = (vec![T::zeroed(); BLOCK * BLOCK], vec![T::zeroed(); BLOCK * BLOCK]);
    let one = T::from_double(1.0);
    let (mut trace, mut squared) = (0.0, 0.0);
    for row in (0..n).step_by(BLOCK) {
        let height = BLOCK.min(n - row);
        let below = inverse.subrows(row + height, n - row - height);
        // The block of L^-1 on the diagonal, without the part of D above it.
        for (k, column) in diagonal.chunks_exact_mut(height).take(height).enumerate() {
            let start = (row + k) * n + row;
            column[..k].fill(T::zeroed());
            column[k..].copy_from_slice(&parts[start + k..start + height]);
        }
        let diagonal = MatRef::from_column_major_slice(&diagonal[..height * height], height, height);
        for column in (0..=row).step_by(BLOCK) {
            let width = BLOCK.min(n - column);
            let beside = if column == row { diagonal } else { inverse.submatrix(row, column, height, width) };
            // The transposed block of A^-1, so that both it and D above the diagonal are read down their columns.
            let mut block =
                MatMut::from_column_major_slice_mut(&mut product[..width * height], width, height);
            matmul::matmul(block.rb_mut(), Accum::Replace, beside.transpose(), diagonal, one, Par::Seq);
            let far = below.subcols(column, width).transpose();
            matmul::matmul(block, Accum::Add, far, below.subcols(row, height), one, Par::Seq);
            let block = &product[..width * height];
            squared += if column == row { 1.0 } else { 2.0 } * T::dot(block, block);
            for k in 0..height {
                let above = if column == row { k } else { width };
                let start = (row + k) * n + column;
                trace += T::dot(&parts[start..start + above], &product[k * width..k * width + above]);
            }
        }
    }
    (2.0 * trace, squared)
}
