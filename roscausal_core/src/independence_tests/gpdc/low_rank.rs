//! The marginal likelihood through an incomplete Cholesky factorisation of the kernel matrix: memory `n r` and
//! `n r^2 + r^3` operations for rank `r`.
//!
//! Pivoting takes the sample with the largest remainder on the diagonal (Fine and Scheinberg 2001; Harbrecht,
//! Peters and Schneider 2012), and stops when no remainder exceeds `tolerance`: `K = L L' + E` with `E` positive
//! semidefinite, `E_ii <= tolerance`. Then `log det` is too small by at most `tr(E) / s`, and the solution of
//! `(K + s I) a = y` is off by at most `|E| |a| / s`.
//!
//! The derivative by `ln l` uses that the kernel at any sample is interpolated from the pivots, `K = W K_p W'` with
//! `W = L L_p^-1`, and that the same `W` interpolates `dK / d ln l`, which is a second derivative of the kernel
//! along the samples (heat equation), with an error of the order of `max(1, l^2) E`.

use faer::{
    Accum, Mat, MatMut, MatRef, Par,
    dyn_stack::{MemBuffer, MemStack},
    linalg::{
        cholesky::llt, matmul, matmul::triangular::BlockStructure, triangular_inverse, triangular_solve,
    },
};
use pulp::{Arch, NullaryFnOnce};

use super::{
    buffer::Buffer,
    gp::Theta,
    kernel::{Inputs, dot},
};

/// `A = L L' + s I` factorised through `M = L' L + s I`.
pub(super) struct LowRank {
    s: f64,
    /// `n x r`, columns by pivot.
    factor: Buffer,
    /// `r x r`: rows of `factor` at the pivots.
    at_pivots: Mat<f64>,
    /// Cholesky factor of `M`.
    inner: Mat<f64>,
    /// `dK / d ln l` between the pivots.
    derivative: Mat<f64>,
    pub(super) log_determinant: f64,
    /// `tr(A^-1)`.
    pub(super) trace_inverse: f64,
    /// `tr(A^-1 dK / d ln l)`.
    pub(super) trace_derivative: f64,
}

impl LowRank {
    /// Bytes that `n` samples at rank `r` take at the most.
    pub(super) fn bytes(n: usize, r: usize) -> usize {
        (n * r + 8 * r * r) * size_of::<f64>()
    }

    /// The factorisation at `theta`; `None` where the rank exceeds `max_rank`, or is about to.
    pub(super) fn new(inputs: &Inputs, theta: Theta, tolerance: f64, max_rank: usize) -> Option<Self> {
        let (columns, pivots) = incomplete_cholesky(inputs, theta.l, tolerance, max_rank)?;
        let (n, r) = (inputs.len(), pivots.len());
        let at_pivots = Mat::from_fn(r, r, |i, j| if j <= i { columns[j * n + pivots[i]] } else { 0.0 });
        let factor = MatRef::from_column_major_slice(&columns, n, r);
        let mut gram = Mat::<f64>::zeros(r, r);
        matmul::triangular::matmul(
            gram.as_mut(),
            BlockStructure::TriangularLower,
            Accum::Replace,
            factor.transpose(),
            BlockStructure::Rectangular,
            factor,
            BlockStructure::Rectangular,
            1.0,
            Par::Seq,
        );
        let mut inner = gram.clone();
        (0..r).for_each(|i| inner[(i, i)] += theta.s);
        cholesky(inner.as_mut())?;
        let log_determinant =
            (n - r) as f64 * theta.s.ln() + 2.0 * (0..r).map(|i| inner[(i, i)].ln()).sum::<f64>();

        let mut inverse = Mat::<f64>::zeros(r, r);
        triangular_inverse::invert_lower_triangular(inverse.as_mut(), inner.as_ref(), Par::Seq);
        let trace_inner = inverse.as_ref().squared_norm_l2();
        let trace_inverse = ((n - r) as f64 + theta.s * trace_inner) / theta.s;

        // W' A^-1 W = (W' W - V' M^-1 V) / s with V = L' W = L' L L_p^-1.
        for j in 0..r {
            for i in 0..j {
                gram[(i, j)] = gram[(j, i)];
            }
        }
        let mut projected = gram;
        triangular_solve::solve_upper_triangular_in_place(
            at_pivots.transpose(),
            projected.as_mut(),
            Par::Seq,
        );
        // `projected` is V' = L_p^-T G; W' W = V' L_p^-1, so its transpose is L_p^-T V.
        let mut gram_of_w = projected.transpose().to_owned();
        let mut half = gram_of_w.clone();
        triangular_solve::solve_upper_triangular_in_place(
            at_pivots.transpose(),
            gram_of_w.as_mut(),
            Par::Seq,
        );
        triangular_solve::solve_lower_triangular_in_place(inner.as_ref(), half.as_mut(), Par::Seq);
        matmul::triangular::matmul(
            gram_of_w.as_mut(),
            BlockStructure::TriangularLower,
            Accum::Add,
            half.transpose(),
            BlockStructure::Rectangular,
            half.as_ref(),
            BlockStructure::Rectangular,
            -1.0,
            Par::Seq,
        );
        let (_, derivative) = inputs.between(theta.l, &pivots);
        let derivative = Mat::from_fn(r, r, |i, j| derivative[j * r + i]);
        let column =
            |j: usize| dot(&gram_of_w.col_as_slice(j)[j + 1..], &derivative.col_as_slice(j)[j + 1..]);
        let trace_derivative = 2.0 * (0..r).map(column).sum::<f64>() / theta.s;
        Some(Self {
            s: theta.s,
            factor: columns,
            at_pivots,
            inner,
            derivative,
            log_determinant,
            trace_inverse,
            trace_derivative,
        })
    }

    /// `A^-1 y`, and `a' dK a` of the solution `a`.
    pub(super) fn solve(&self, y: &[f64]) -> (Vec<f64>, f64) {
        let (n, r) = (y.len(), self.inner.nrows());
        let factor = MatRef::from_column_major_slice(&self.factor, n, r);
        let y_column = MatRef::from_column_major_slice(y, n, 1);
        let mut weights = Mat::<f64>::zeros(r, 1);
        matmul::matmul(weights.as_mut(), Accum::Replace, factor.transpose(), y_column, 1.0, Par::Seq);
        triangular_solve::solve_lower_triangular_in_place(self.inner.as_ref(), weights.as_mut(), Par::Seq);
        triangular_solve::solve_upper_triangular_in_place(self.inner.transpose(), weights.as_mut(), Par::Seq);
        let mut alpha = y.to_vec();
        let alpha_column = MatMut::from_column_major_slice_mut(&mut alpha, n, 1);
        matmul::matmul(alpha_column, Accum::Add, factor, weights.as_ref(), -1.0, Par::Seq);
        alpha.iter_mut().for_each(|a| *a /= self.s);
        // L' a = weights, so W' a = L_p^-T weights.
        triangular_solve::solve_upper_triangular_in_place(
            self.at_pivots.transpose(),
            weights.as_mut(),
            Par::Seq,
        );
        let weights = weights.col_as_slice(0);
        let column = |j: usize| weights[j] * dot(&self.derivative.col_as_slice(j)[..j], &weights[..j]);
        (alpha, 2.0 * (0..r).map(column).sum::<f64>())
    }
}

/// The factor and its pivots; `None` where the rank exceeds `max_rank`, or is about to.
fn incomplete_cholesky(
    inputs: &Inputs,
    l: f64,
    tolerance: f64,
    max_rank: usize,
) -> Option<(Buffer, Vec<usize>)> {
    let n = inputs.len();
    let arch = Arch::new();
    let mut columns = Buffer::any(0);
    let mut pivots = Vec::new();
    let mut remainder = vec![1.0; n];
    loop {
        let (pivot, largest) = remainder
            .iter()
            .enumerate()
            .fold((0, -1.0), |best, (i, &d)| if d > best.1 { (i, d) } else { best });
        if largest <= tolerance {
            break;
        }
        let k = pivots.len();
        // Where half of the ranks have not brought half of the digits, all of them will hardly bring the rest.
        if k == max_rank || k == max_rank / 2 && k > 16 && largest > tolerance.sqrt() {
            return None;
        }
        columns.resize((k + 1) * n);
        let (before, now) = columns.split_at_mut(k * n);
        inputs.column(l, pivot, 0, now, &mut []);
        arch.dispatch(NextColumn { before, now, remainder: &mut remainder, pivot });
        now[pivot] = largest.sqrt();
        remainder[pivot] = f64::NEG_INFINITY;
        pivots.push(pivot);
    }
    Some((columns, pivots))
}

/// Turns `now`, the kernel's column at `pivot`, into the next column of the factor: takes off the products of the
/// columns `before`, scales, and takes its squares off the remainder.
struct NextColumn<'a> {
    before: &'a [f64],
    now: &'a mut [f64],
    remainder: &'a mut [f64],
    pivot: usize,
}

impl NullaryFnOnce for NextColumn<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { before, now, remainder, pivot } = self;
        let n = now.len();
        let mut fours = before.chunks_exact(4 * n);
        for four in fours.by_ref() {
            let (a, rest) = four.split_at(n);
            let (b, rest) = rest.split_at(n);
            let (c, d) = rest.split_at(n);
            let (fa, fb, fc, fd) = (a[pivot], b[pivot], c[pivot], d[pivot]);
            for ((((value, a), b), c), d) in now.iter_mut().zip(a).zip(b).zip(c).zip(d) {
                *value -= (a * fa + b * fb) + (c * fc + d * fd);
            }
        }
        for column in fours.remainder().chunks_exact(n) {
            let factor = column[pivot];
            for (value, c) in now.iter_mut().zip(column) {
                *value -= c * factor;
            }
        }
        let scale = 1.0 / remainder[pivot].sqrt();
        for (value, remainder) in now.iter_mut().zip(remainder) {
            *value *= scale;
            *remainder -= *value * *value;
        }
    }
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
