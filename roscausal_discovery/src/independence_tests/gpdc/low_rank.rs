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
    linalg::{matmul, matmul::triangular::BlockStructure, triangular_inverse, triangular_solve},
};

use super::{
    blocks::{solve, whole},
    buffer::Buffer,
    factorisation::{Factorisation, Solution, Traces},
    incomplete::Incomplete,
    kernel::{Inputs, dot},
    plan::Derivative,
    real::{Real, add_columns, products_with_columns},
    theta::Theta,
};

/// `A = L L' + s I` factorised through `M = L' L + s I`. The factor and products over the samples are in precision
/// `T`, and what is not as long as the samples is in double.
///
/// Single precision leaves an error of its rounding in the product `L L'`, which the last columns of the factor are small
/// beside: the gradient, which divides by them, is off by the rounding divided by the tolerance.
pub(super) struct LowRank<T> {
    s: f64,
    /// The factor of the kernel matrix.
    pub(super) factor: Incomplete<T>,
    /// Cholesky factor of `M`, `r x r`.
    inner: Buffer,
    gradient: Option<Gradient>,
    log_determinant: f64,
    /// 0 unless for a search.
    traces: Traces,
}

/// What the derivative by `ln l` needs.
struct Gradient {
    /// `r x r`: rows of the factor at the pivots, `L_p`.
    at_pivots: Buffer,
    /// `dK / d ln l` between the pivots.
    between: Buffer,
    /// `n x r`: the same between all samples and the pivots, `B`, if the derivative is the consistent one.
    beside: Option<Buffer>,
}

fn view(square: &[f64], r: usize) -> MatRef<'_, f64> {
    MatRef::from_column_major_slice(square, r, r)
}

fn view_mut(square: &mut [f64], r: usize) -> MatMut<'_, f64> {
    MatMut::from_column_major_slice_mut(square, r, r)
}

impl<T: Real> LowRank<T> {
    /// Bytes that `n` samples at rank `r` take at the most.
    pub(super) fn bytes(n: usize, r: usize) -> usize {
        Incomplete::<T>::bytes(n, r) + n * r * size_of::<T>() + 10 * r * r * size_of::<f64>()
    }

    /// The factorisation at `theta` from a factor of the kernel matrix, for a search with a derivative.
    pub(super) fn new(
        inputs: &Inputs,
        theta: Theta,
        factor: Incomplete<T>,
        derivative: Option<Derivative>,
    ) -> Option<Self> {
        let (n, r) = (inputs.len(), factor.rank());
        let mut inner = symmetric_product(factor.factor(), r);
        inner.iter_mut().step_by(r + 1).for_each(|d| *d += theta.s);
        whole(view_mut(&mut inner, r))?;
        let log_determinant = (n - r) as f64 * libm::log(theta.s)
            + 2.0 * inner.iter().step_by(r + 1).map(|d| libm::log(*d)).sum::<f64>();
        let traces = Traces::default();
        let mut at = Self { s: theta.s, factor, inner, gradient: None, log_determinant, traces };
        if let Some(derivative) = derivative {
            at.differentiate(inputs, theta, derivative);
        }
        Some(at)
    }

    /// Pivots in their order.
    pub(super) fn pivots(&self) -> &[u32] {
        &self.factor.pivots
    }

    /// The traces. With `A^-1 L = L M^-1` and `L' A^-1 L = I - s M^-1`, `tr(A^-1 B W') = tr(M^-1 Y)` where
    /// `Y = L_p^-1 B' L`, and `tr(A^-1 W dK_p W') = tr(X) - s tr(M^-1 X)` where `X = L_p^-1 dK_p L_p^-T`.
    fn differentiate(&mut self, inputs: &Inputs, theta: Theta, derivative: Derivative) {
        let (n, r) = (inputs.len(), self.factor.rank());
        let (pivots, factor) = (&self.factor.pivots, self.factor.factor());
        let mut at_pivots = Buffer::any(r * r);
        for (j, (to, column)) in at_pivots.chunks_exact_mut(r).zip(factor.chunks_exact(n)).enumerate() {
            to[..j].fill(0.0);
            to[j..]
                .iter_mut()
                .zip(&pivots[j..])
                .for_each(|(to, &pivot)| *to = column[pivot as usize].double());
        }
        let between = inputs.derivative_between(theta.l, pivots);
        let mut inverse = Buffer::zeros(r * r);
        triangular_inverse::invert_lower_triangular(
            view_mut(&mut inverse, r),
            view(&self.inner, r),
            Par::Seq,
        );
        let inverse = view(&inverse, r);
        let mut projected = Buffer::any(r * r);
        projected.copy_from_slice(&between);
        let lower = view(&at_pivots, r);
        triangular_solve::solve_lower_triangular_in_place(lower, view_mut(&mut projected, r), Par::Seq);
        // C^-1 L_p^-1 dK_p, then its product with (C^-1 L_p^-1)' needs the diagonal only.
        let mut whole = Buffer::any(r * r);
        view_mut(&mut whole, r).copy_from(view(&projected, r).transpose());
        triangular_solve::solve_lower_triangular_in_place(lower, view_mut(&mut whole, r), Par::Seq);
        let trace = whole.iter().step_by(r + 1).sum::<f64>();
        let beside = (derivative == Derivative::Consistent).then(|| beside::<T>(inputs, theta.l, pivots));
        if let Some(beside) = &beside {
            let mut y = product(beside.numbers::<T>(n * r), factor, r);
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
        // Of M^-1.
        let square = |(j, m): (usize, &[f64])| m[j] * m[j] + 2.0 * dot(&m[j + 1..], &m[j + 1..]);
        let squared = of_inner.chunks_exact(r).enumerate().map(square).sum::<f64>();
        self.traces = Traces {
            inverse: ((n - r) as f64 + theta.s * inverse.squared_norm_l2()) / theta.s,
            squared: (n - r) as f64 / (theta.s * theta.s) + squared,
            derivative: match beside {
                Some(_) => on_diagonal + 2.0 * below - trace,
                None => trace - theta.s * (on_diagonal + 2.0 * below),
            },
        };
        self.gradient = Some(Gradient { at_pivots, between, beside });
    }

    /// `a = A^-1 y` and `L' a`.
    fn alpha_and_weights(&self, y: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let mut weights = products_with_columns(self.factor.factor(), y);
        solve(view(&self.inner, self.factor.rank()), &mut weights);
        let mut fitted = vec![0.0; y.len()];
        add_columns(&mut fitted, self.factor.factor(), &weights);
        let alpha = y.iter().zip(&fitted).map(|(y, fitted)| (y - fitted) / self.s).collect();
        (alpha, weights)
    }
}

impl<T: Real> Factorisation for LowRank<T> {
    fn log_determinant(&self) -> f64 {
        self.log_determinant
    }

    fn traces(&self) -> Traces {
        self.traces
    }

    fn alpha(&self, y: &[f64]) -> Vec<f64> {
        self.alpha_and_weights(y).0
    }

    fn solve(&self, y: &[f64]) -> Solution {
        let (alpha, mut weights) = self.alpha_and_weights(y);
        let Some(Gradient { at_pivots, between, beside }) = &self.gradient else {
            return Solution { alpha, squared: 0.0, derivative: 0.0 };
        };
        let r = weights.len();
        // L' a = weights, so a' A^-1 a = (a' a - weights' M^-1 weights) / s
        let mut half = weights.clone();
        let column = MatMut::from_column_major_slice_mut(&mut half, r, 1);
        triangular_solve::solve_lower_triangular_in_place(view(&self.inner, r), column, Par::Seq);
        let squared = (dot(&alpha, &alpha) - dot(&half, &half)) / self.s;
        // ... and W' a = L_p^-T weights.
        let column = MatMut::from_column_major_slice_mut(&mut weights, r, 1);
        triangular_solve::solve_upper_triangular_in_place(view(at_pivots, r).transpose(), column, Par::Seq);
        let at_pivot = |(j, column): (usize, &[f64])| weights[j] * dot(&column[..j], &weights[..j]);
        let among = between.chunks_exact(r).enumerate().map(at_pivot).sum::<f64>();
        let all = beside.as_ref().map_or(2.0 * among, |beside| {
            dot(&products_with_columns(beside.numbers::<T>(y.len() * r), &alpha), &weights)
        });
        Solution { alpha, squared, derivative: 2.0 * (all - among) }
    }

    /// For what the approximation leaves of the kernel matrix, `E`: the logarithm of the
    /// determinant is too small by at most `tr(E) / s`, `y' a` too large by about `a' E a`; so the errors are opposite.
    fn truncation_error(&self, alpha: &[f64]) -> f64 {
        let left = &self.factor.remainder;
        let (trace, fit) = left.iter().zip(alpha).fold((0.0, 0.0), |(trace, fit), (&left, a)| {
            let left = left.double().max(0.0);
            (trace + left, fit + left * a * a)
        });
        0.5 * f64::max(trace / self.s, fit)
    }
}

/// `dK / d ln l` between all samples and the pivots, `n x r`.
fn beside<T: Real>(inputs: &Inputs, l: f64, pivots: &[u32]) -> Buffer {
    let n = inputs.len();
    let mut beside = Buffer::of::<T>(n * pivots.len());
    let mut kernel = vec![T::from_double(0.0); n];
    for (column, &pivot) in beside.numbers_mut::<T>(n * pivots.len()).chunks_exact_mut(n).zip(pivots) {
        T::column(inputs, l, pivot as usize, 0, &mut kernel, column);
    }
    beside
}

/// `left' right`, `r x r`, of matrices `n x r`.
fn product<T: Real>(left: &[T], right: &[T], r: usize) -> Buffer {
    let n = left.len() / r.max(1);
    let mut product = Buffer::of::<T>(r * r);
    matmul::matmul(
        MatMut::from_column_major_slice_mut(product.numbers_mut::<T>(r * r), r, r),
        Accum::Replace,
        MatRef::from_column_major_slice(left, n, r).transpose(),
        MatRef::from_column_major_slice(right, n, r),
        T::from_double(1.0),
        Par::Seq,
    );
    T::doubles(product, r * r)
}

/// `factor' factor`, `r x r`, its lower triangle; zeros above.
pub(super) fn symmetric_product<T: Real>(factor: &[T], r: usize) -> Buffer {
    let n = factor.len() / r.max(1);
    let factor = MatRef::from_column_major_slice(factor, n, r);
    let mut product = Buffer::of::<T>(r * r);
    product.numbers_mut::<T>(r * r).fill(T::from_double(0.0));
    matmul::triangular::matmul(
        MatMut::from_column_major_slice_mut(product.numbers_mut::<T>(r * r), r, r),
        BlockStructure::TriangularLower,
        Accum::Replace,
        factor.transpose(),
        BlockStructure::Rectangular,
        factor,
        BlockStructure::Rectangular,
        T::from_double(1.0),
        Par::Seq,
    );
    T::doubles(product, r * r)
}
