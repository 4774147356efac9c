//! The marginal likelihood through an incomplete Cholesky factorisation of the kernel matrix: memory `n r` and
//! `n r^2 + r^3` operations for rank `r`.
//!
//! With `K = L L' + E`, `E` positive semidefinite and `E_ii <= tolerance`, `log det` is too small by at most
//! `tr(E) / s`, and the solution of `(K + s I) a = y` is off by at most `|E| |a| / s`.
//!
//! The derivative by `ln l` uses that the kernel at any sample is interpolated from the pivots, `K = W K_p W'` with
//! `W = L L_p^-1`, and that the same `W` interpolates `dK / d ln l`, which is a second derivative of the kernel
//! along the samples (heat equation), with an error of the order of `max(1, l^2) E`.

use faer::{
    Accum, MatMut, MatRef, Par,
    dyn_stack::{MemBuffer, MemStack},
    linalg::{
        cholesky::llt, matmul, matmul::triangular::BlockStructure, triangular_inverse, triangular_solve,
    },
    prelude::{Reborrow, ReborrowMut},
};

use super::{
    buffer::Buffer,
    gp::{Theta, Traces},
    incomplete::Incomplete,
    kernel::{Inputs, dot},
};

/// `A = L L' + s I` factorised through `M = L' L + s I`.
pub(super) struct LowRank {
    s: f64,
    factor: Incomplete,
    /// Cholesky factor of `M`, `r x r`.
    inner: Buffer,
    gradient: Option<Gradient>,
    pub(super) log_determinant: f64,
    /// 0 unless for a search.
    pub(super) traces: Traces,
}

/// What the derivative by `ln l` needs.
struct Gradient {
    /// `r x r`: rows of the factor at the pivots, `L_p`.
    at_pivots: Buffer,
    /// `dK / d ln l` between the pivots.
    derivative: Buffer,
}

fn view(square: &[f64], r: usize) -> MatRef<'_, f64> {
    MatRef::from_column_major_slice(square, r, r)
}

fn view_mut(square: &mut [f64], r: usize) -> MatMut<'_, f64> {
    MatMut::from_column_major_slice_mut(square, r, r)
}

impl LowRank {
    /// Bytes that `n` samples at rank `r` take at the most.
    pub(super) fn bytes(n: usize, r: usize) -> usize {
        Incomplete::bytes(n, r) + 8 * r * r * size_of::<f64>()
    }

    /// The factorisation at `theta`, for a search with its gradient, from a factor of the kernel matrix.
    pub(super) fn new(inputs: &Inputs, theta: Theta, factor: Incomplete, for_search: bool) -> Option<Self> {
        let (n, r) = (inputs.len(), factor.rank());
        let mut inner = Buffer::zeros(r * r);
        symmetric_product(view_mut(&mut inner, r), MatRef::from_column_major_slice(factor.factor(), n, r));
        inner.iter_mut().step_by(r + 1).for_each(|d| *d += theta.s);
        cholesky(view_mut(&mut inner, r))?;
        let log_determinant =
            (n - r) as f64 * theta.s.ln() + 2.0 * inner.iter().step_by(r + 1).map(|d| d.ln()).sum::<f64>();
        let traces = Traces::default();
        let mut at = Self { s: theta.s, factor, inner, gradient: None, log_determinant, traces };
        if for_search {
            at.differentiate(inputs, theta);
        }
        Some(at)
    }

    /// The factor of the kernel matrix.
    pub(super) fn into_factor(self) -> Incomplete {
        self.factor
    }

    /// Pivots in their order.
    pub(super) fn pivots(&self) -> &[u32] {
        self.factor.pivots()
    }

    /// The traces. With `W = L L_p^-1` and `L' A^-1 L = I - s M^-1`,
    /// `tr(A^-1 W dK_p W') = tr(X) - s tr(M^-1 X)` where `X = L_p^-1 dK_p L_p^-T`.
    fn differentiate(&mut self, inputs: &Inputs, theta: Theta) {
        let (n, r) = (inputs.len(), self.factor.rank());
        let (pivots, factor) = (self.factor.pivots(), self.factor.factor());
        let mut at_pivots = Buffer::any(r * r);
        for (j, (to, column)) in at_pivots.chunks_exact_mut(r).zip(factor.chunks_exact(n)).enumerate() {
            to[..j].fill(0.0);
            to[j..].iter_mut().zip(&pivots[j..]).for_each(|(to, &pivot)| *to = column[pivot as usize]);
        }
        let derivative = inputs.derivative_between(theta.l, pivots);

        let mut inverse = Buffer::zeros(r * r);
        triangular_inverse::invert_lower_triangular(
            view_mut(&mut inverse, r),
            view(&self.inner, r),
            Par::Seq,
        );
        let inverse = view(&inverse, r);
        let mut projected = Buffer::any(r * r);
        projected.copy_from_slice(&derivative);
        let lower = view(&at_pivots, r);
        triangular_solve::solve_lower_triangular_in_place(lower, view_mut(&mut projected, r), Par::Seq);
        // C^-1 L_p^-1 dK_p, then its product with (C^-1 L_p^-1)' needs the diagonal only.
        let mut whole = Buffer::any(r * r);
        view_mut(&mut whole, r).copy_from(view(&projected, r).transpose());
        triangular_solve::solve_lower_triangular_in_place(lower, view_mut(&mut whole, r), Par::Seq);
        let trace = whole.iter().step_by(r + 1).sum::<f64>();
        let mut of_inner = projected;
        matmul::triangular::matmul(
            view_mut(&mut of_inner, r),
            BlockStructure::TriangularLower,
            Accum::Replace,
            inverse.transpose(),
            BlockStructure::TriangularUpper,
            inverse,
            BlockStructure::TriangularLower,
            1.0,
            Par::Seq,
        );
        let columns = || of_inner.chunks_exact(r).zip(whole.chunks_exact(r)).enumerate();
        let below = columns().map(|(j, (m, x))| dot(&m[j + 1..], &x[j + 1..])).sum::<f64>();
        let on_diagonal = columns().map(|(j, (m, x))| m[j] * x[j]).sum::<f64>();
        self.traces = Traces {
            inverse: ((n - r) as f64 + theta.s * inverse.squared_norm_l2()) / theta.s,
            derivative: trace - theta.s * (on_diagonal + 2.0 * below),
        };
        self.gradient = Some(Gradient { at_pivots, derivative });
    }

    /// `A^-1 y`.
    pub(super) fn alpha(&self, y: &[f64]) -> Vec<f64> {
        self.alpha_and_weights(y).0
    }

    /// `A^-1 y`, and `a' dK a` of the solution `a`; of a factorisation for a search.
    pub(super) fn solve(&self, y: &[f64]) -> (Vec<f64>, f64) {
        let (alpha, mut weights) = self.alpha_and_weights(y);
        let Some(Gradient { at_pivots, derivative }) = &self.gradient else { return (alpha, 0.0) };
        // L' a = weights, so W' a = L_p^-T weights.
        let r = weights.len();
        let column = MatMut::from_column_major_slice_mut(&mut weights, r, 1);
        triangular_solve::solve_upper_triangular_in_place(view(at_pivots, r).transpose(), column, Par::Seq);
        let column = |(j, column): (usize, &[f64])| weights[j] * dot(&column[..j], &weights[..j]);
        (alpha, 2.0 * derivative.chunks_exact(r).enumerate().map(column).sum::<f64>())
    }

    /// `a = A^-1 y` and `L' a`.
    fn alpha_and_weights(&self, y: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let (n, r) = (y.len(), self.factor.rank());
        let factor = MatRef::from_column_major_slice(self.factor.factor(), n, r);
        let y_column = MatRef::from_column_major_slice(y, n, 1);
        let mut weights = vec![0.0; r];
        let mut column = MatMut::from_column_major_slice_mut(&mut weights, r, 1);
        matmul::matmul(column.rb_mut(), Accum::Replace, factor.transpose(), y_column, 1.0, Par::Seq);
        let inner = view(&self.inner, r);
        triangular_solve::solve_lower_triangular_in_place(inner, column.rb_mut(), Par::Seq);
        triangular_solve::solve_upper_triangular_in_place(inner.transpose(), column.rb_mut(), Par::Seq);
        let mut alpha = y.to_vec();
        let alpha_column = MatMut::from_column_major_slice_mut(&mut alpha, n, 1);
        matmul::matmul(alpha_column, Accum::Add, factor, column.rb(), -1.0, Par::Seq);
        alpha.iter_mut().for_each(|a| *a /= self.s);
        (alpha, weights)
    }
}

/// The lower triangle of `factor' factor`.
fn symmetric_product(to: MatMut<'_, f64>, factor: MatRef<'_, f64>) {
    matmul::triangular::matmul(
        to,
        BlockStructure::TriangularLower,
        Accum::Replace,
        factor.transpose(),
        BlockStructure::Rectangular,
        factor,
        BlockStructure::Rectangular,
        1.0,
        Par::Seq,
    );
}

fn cholesky(matrix: MatMut<'_, f64>) -> Option<()> {
    let scratch = llt::factor::cholesky_in_place_scratch::<f64>(matrix.nrows(), Par::Seq, Default::default());
    llt::factor::cholesky_in_place(
        matrix,
        Default::default(),
        Par::Seq,
        MemStack::new(&mut MemBuffer::new(scratch)),
        Default::default(),
    )
    .ok()
    .map(|_| ())
}
