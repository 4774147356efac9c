//! The marginal likelihood through an incomplete Cholesky factorisation of the kernel matrix: memory `n r` and
//! `n r^2 + r^3` operations for rank `r`.
//!
//! With `K = L L' + E`, `E` positive semidefinite and `E_ii <= tolerance`, `log det` is too small by at most
//! `tr(E) / s`, and the solution of `(K + s I) a = y` is off by at most `|E| |a| / s`.
//!
//! The approximation is an interpolation from the pivots, `L L' = W K_p W'` with `W = L L_p^-1`. The derivative by `ln l`
//! is that of the approximation itself: with `B` for `dK / d ln l` between all samples and the pivots it is
//! `B W' + W B' - W dK_p W'`. Or, for four fifths of the time, `W dK_p W'`: `dK / d ln l` is a second derivative of the
//! kernel along the samples (heat equation), which the same `W` interpolates with an error of the order of
//! `max(1, l^2) E`.

use faer::{
    Accum, MatMut, MatRef, Par,
    dyn_stack::{MemBuffer, MemStack},
    linalg::{
        cholesky::llt, matmul, matmul::triangular::BlockStructure, triangular_inverse, triangular_solve,
    },
    prelude::{Reborrow, ReborrowMut},
    traits::ComplexField,
};

use super::{
    buffer::Buffer,
    gp::{Theta, Traces},
    incomplete::Incomplete,
    kernel::{Inputs, dot, dot_of_singles},
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

/// A derivative by `ln l`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Derivative {
    /// That of the kernel matrix, interpolated.
    Interpolated,
    /// That of the approximation.
    Consistent,
}

/// What the derivative by `ln l` needs.
struct Gradient {
    /// `r x r`: rows of the factor at the pivots, `L_p`.
    at_pivots: Buffer,
    /// `dK / d ln l` between the pivots.
    derivative: Buffer,
    /// `n x r`: the same between all samples and the pivots, `B`, if the derivative is the consistent one; in single
    /// precision.
    beside: Option<Buffer>,
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
        Incomplete::bytes(n, r) + (n + 10 * r) * r * size_of::<f64>()
    }

    /// The factorisation at `theta` from a factor of the kernel matrix, for a search with a derivative.
    pub(super) fn new(
        inputs: &Inputs,
        theta: Theta,
        factor: Incomplete,
        derivative: Option<Derivative>,
    ) -> Option<Self> {
        let (n, r) = (inputs.len(), factor.rank());
        let single = (derivative == Some(Derivative::Consistent)).then(|| single(factor.factor()));
        let mut inner = match &single {
            Some(single) => {
                let mut inner = Buffer::of::<f32>(r * r);
                symmetric_product(inner.numbers_mut::<f32>(r * r), single.numbers(n * r), r);
                double(inner.numbers(r * r))
            }
            None => {
                let mut inner = Buffer::zeros(r * r);
                symmetric_product(&mut inner[..], factor.factor(), r);
                inner
            }
        };
        inner.iter_mut().step_by(r + 1).for_each(|d| *d += theta.s);
        cholesky(view_mut(&mut inner, r))?;
        let log_determinant =
            (n - r) as f64 * theta.s.ln() + 2.0 * inner.iter().step_by(r + 1).map(|d| d.ln()).sum::<f64>();
        let traces = Traces::default();
        let mut at = Self { s: theta.s, factor, inner, gradient: None, log_determinant, traces };
        if derivative.is_some() {
            at.differentiate(inputs, theta, single.as_ref());
        }
        Some(at)
    }

    /// The factor of the kernel matrix.
    pub(super) fn into_factor(self) -> Incomplete {
        self.factor
    }

    /// How far off the likelihood may be for what the approximation leaves of the kernel matrix, `E`: the logarithm of the
    /// determinant is too small by at most `tr(E) / s`, `y' a` too large by about `a' E a`; so the errors are opposite.
    pub(super) fn missing(&self, alpha: &[f64]) -> f64 {
        let left = self.factor.remainder();
        let (trace, fit) = left.iter().zip(alpha).fold((0.0, 0.0), |(trace, fit), (&left, a)| {
            let left = left.max(0.0);
            (trace + left, fit + left * a * a)
        });
        0.5 * f64::max(trace / self.s, fit)
    }

    /// Pivots in their order.
    pub(super) fn pivots(&self) -> &[u32] {
        self.factor.pivots()
    }

    /// The traces. With `A^-1 L = L M^-1` and `L' A^-1 L = I - s M^-1`, `tr(A^-1 B W') = tr(M^-1 Y)` where
    /// `Y = L_p^-1 B' L`, and `tr(A^-1 W dK_p W') = tr(X) - s tr(M^-1 X)` where `X = L_p^-1 dK_p L_p^-T`.
    fn differentiate(&mut self, inputs: &Inputs, theta: Theta, single: Option<&Buffer>) {
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
        let beside = single.map(|_| beside(inputs, theta.l, pivots));
        if let Some((single, beside)) = single.zip(beside.as_ref()) {
            let mut y = single_product(beside, single, n, r);
            triangular_solve::solve_lower_triangular_in_place(lower, view_mut(&mut y, r), Par::Seq);
            // s X + Y + Y', of which the lower triangle is needed.
            view_mut(&mut projected, r).copy_from(view(&y, r).transpose());
            for ((x, y), transposed) in whole.iter_mut().zip(&*y).zip(&*projected) {
                *x = theta.s * *x + y + transposed;
            }
        }
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
            derivative: match beside {
                Some(_) => on_diagonal + 2.0 * below - trace,
                None => trace - theta.s * (on_diagonal + 2.0 * below),
            },
        };
        self.gradient = Some(Gradient { at_pivots, derivative, beside });
    }

    /// `A^-1 y`.
    pub(super) fn alpha(&self, y: &[f64]) -> Vec<f64> {
        self.alpha_and_weights(y).0
    }

    /// `A^-1 y`, and `a' dK a` of the solution `a`; of a factorisation for a search.
    pub(super) fn solve(&self, y: &[f64]) -> (Vec<f64>, f64) {
        let (alpha, mut weights) = self.alpha_and_weights(y);
        let Some(Gradient { at_pivots, derivative, beside }) = &self.gradient else { return (alpha, 0.0) };
        // L' a = weights, so W' a = L_p^-T weights.
        let r = weights.len();
        let column = MatMut::from_column_major_slice_mut(&mut weights, r, 1);
        triangular_solve::solve_upper_triangular_in_place(view(at_pivots, r).transpose(), column, Par::Seq);
        let at_pivot = |(j, column): (usize, &[f64])| weights[j] * dot(&column[..j], &weights[..j]);
        let between = derivative.chunks_exact(r).enumerate().map(at_pivot).sum::<f64>();
        let Some(beside) = beside else { return (alpha, 2.0 * between) };
        let single: Vec<f32> = alpha.iter().map(|&a| a as f32).collect();
        let columns = beside.numbers(y.len() * r).chunks_exact(y.len()).zip(&weights);
        let all = columns.map(|(column, weight)| weight * dot_of_singles(column, &single)).sum::<f64>();
        (alpha, 2.0 * (all - between))
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

/// `dK / d ln l` between all samples and the pivots, `n x r` in single precision.
fn beside(inputs: &Inputs, l: f64, pivots: &[u32]) -> Buffer {
    let n = inputs.len();
    let (mut beside, mut kernel) = (Buffer::of::<f32>(n * pivots.len()), vec![0.0; n]);
    for (column, &pivot) in beside.numbers_mut(n * pivots.len()).chunks_exact_mut(n).zip(pivots) {
        inputs.column_of_singles(l, pivot as usize, 0, &mut kernel, column);
    }
    beside
}

/// The same numbers in single precision.
fn single(numbers: &[f64]) -> Buffer {
    let mut single = Buffer::of::<f32>(numbers.len());
    let to = single.numbers_mut::<f32>(numbers.len());
    to.iter_mut().zip(numbers).for_each(|(to, &from)| *to = from as f32);
    single
}

/// The same numbers in double precision.
fn double(numbers: &[f32]) -> Buffer {
    let mut double = Buffer::any(numbers.len());
    double.iter_mut().zip(numbers).for_each(|(to, &from)| *to = from.into());
    double
}

/// `beside' factor`, `r x r`, of matrices `n x r` in single precision.
fn single_product(beside: &Buffer, factor: &Buffer, n: usize, r: usize) -> Buffer {
    let mut product = Buffer::of::<f32>(r * r);
    matmul::matmul(
        MatMut::from_column_major_slice_mut(product.numbers_mut::<f32>(r * r), r, r),
        Accum::Replace,
        MatRef::from_column_major_slice(beside.numbers::<f32>(n * r), n, r).transpose(),
        MatRef::from_column_major_slice(factor.numbers::<f32>(n * r), n, r),
        1.0,
        Par::Seq,
    );
    double(product.numbers(r * r))
}

/// The lower triangle of `factor' factor`, `r x r`.
fn symmetric_product<T: ComplexField>(to: &mut [T], factor: &[T], r: usize) {
    let factor = MatRef::from_column_major_slice(factor, factor.len() / r.max(1), r);
    matmul::triangular::matmul(
        MatMut::from_column_major_slice_mut(to, r, r),
        BlockStructure::TriangularLower,
        Accum::Replace,
        factor.transpose(),
        BlockStructure::Rectangular,
        factor,
        BlockStructure::Rectangular,
        T::one_impl(),
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
