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
    gp::{Theta, Traces},
    kernel::{Inputs, dot},
};

/// Candidates of a panel.
const PANEL: usize = 16;
/// A candidate whose remainder falls below this share of the largest one is left for a later panel.
const SHARE_OF_LARGEST: f64 = 0.3;

/// `A = L L' + s I` factorised through `M = L' L + s I`.
pub(super) struct LowRank {
    s: f64,
    /// `n x r`, columns by pivot.
    factor: Buffer,
    /// Cholesky factor of `M`.
    inner: Mat<f64>,
    gradient: Option<Gradient>,
    pub(super) log_determinant: f64,
    /// 0 unless for a search.
    pub(super) traces: Traces,
}

/// What the derivative by `ln l` needs.
struct Gradient {
    /// `r x r`: rows of the factor at the pivots, `L_p`.
    at_pivots: Mat<f64>,
    /// `dK / d ln l` between the pivots.
    derivative: Mat<f64>,
}

impl LowRank {
    /// Bytes that `n` samples at rank `r` take at the most.
    pub(super) fn bytes(n: usize, r: usize) -> usize {
        (n * r + 8 * r * r) * size_of::<f64>()
    }

    /// The factorisation at `theta`, for a search with its gradient; `None` where the rank exceeds `max_rank`, or is
    /// about to.
    pub(super) fn new(
        inputs: &Inputs,
        theta: Theta,
        tolerance: f64,
        max_rank: usize,
        for_search: bool,
    ) -> Option<Self> {
        let (columns, pivots) = incomplete_cholesky(inputs, theta.l, tolerance, max_rank)?;
        let (n, r) = (inputs.len(), pivots.len());
        let factor = MatRef::from_column_major_slice(&columns[..n * r], n, r);
        let mut inner = Mat::<f64>::zeros(r, r);
        symmetric_product(inner.as_mut(), factor);
        (0..r).for_each(|i| inner[(i, i)] += theta.s);
        cholesky(inner.as_mut())?;
        let log_determinant =
            (n - r) as f64 * theta.s.ln() + 2.0 * (0..r).map(|i| inner[(i, i)].ln()).sum::<f64>();
        let mut at = Self {
            s: theta.s,
            factor: columns,
            inner,
            gradient: None,
            log_determinant,
            traces: Traces::default(),
        };
        if for_search {
            at.differentiate(inputs, theta, &pivots);
        }
        Some(at)
    }

    /// The traces. With `W = L L_p^-1` and `L' A^-1 L = I - s M^-1`,
    /// `tr(A^-1 W dK_p W') = tr(X) - s tr(M^-1 X)` where `X = L_p^-1 dK_p L_p^-T`.
    fn differentiate(&mut self, inputs: &Inputs, theta: Theta, pivots: &[usize]) {
        let (n, r) = (inputs.len(), pivots.len());
        let at_pivots = Mat::from_fn(r, r, |i, j| if j <= i { self.factor[j * n + pivots[i]] } else { 0.0 });
        let (_, derivative) = inputs.between(theta.l, pivots);
        let derivative = MatRef::from_column_major_slice(&derivative, r, r).to_owned();

        let mut inverse = Mat::<f64>::zeros(r, r);
        triangular_inverse::invert_lower_triangular(inverse.as_mut(), self.inner.as_ref(), Par::Seq);
        let mut projected = derivative.clone();
        triangular_solve::solve_lower_triangular_in_place(at_pivots.as_ref(), projected.as_mut(), Par::Seq);
        // C^-1 L_p^-1 dK_p, then its product with (C^-1 L_p^-1)' needs the diagonal only.
        let mut whole = projected.transpose().to_owned();
        triangular_solve::solve_lower_triangular_in_place(at_pivots.as_ref(), whole.as_mut(), Par::Seq);
        let trace = (0..r).map(|i| whole[(i, i)]).sum::<f64>();
        let mut of_inner = Mat::<f64>::zeros(r, r);
        matmul::triangular::matmul(
            of_inner.as_mut(),
            BlockStructure::TriangularLower,
            Accum::Replace,
            inverse.transpose(),
            BlockStructure::TriangularUpper,
            inverse.as_ref(),
            BlockStructure::TriangularLower,
            1.0,
            Par::Seq,
        );
        let below = |j: usize| dot(&of_inner.col_as_slice(j)[j + 1..], &whole.col_as_slice(j)[j + 1..]);
        let on_diagonal = (0..r).map(|i| of_inner[(i, i)] * whole[(i, i)]).sum::<f64>();
        let weighted = on_diagonal + 2.0 * (0..r).map(below).sum::<f64>();
        self.traces = Traces {
            inverse: ((n - r) as f64 + theta.s * inverse.as_ref().squared_norm_l2()) / theta.s,
            derivative: trace - theta.s * weighted,
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
        triangular_solve::solve_upper_triangular_in_place(at_pivots.transpose(), weights.as_mut(), Par::Seq);
        let weights = weights.col_as_slice(0);
        let column = |j: usize| weights[j] * dot(&derivative.col_as_slice(j)[..j], &weights[..j]);
        (alpha, 2.0 * (0..weights.len()).map(column).sum::<f64>())
    }

    /// `a = A^-1 y` and `L' a`.
    fn alpha_and_weights(&self, y: &[f64]) -> (Vec<f64>, Mat<f64>) {
        let (n, r) = (y.len(), self.inner.nrows());
        let factor = MatRef::from_column_major_slice(&self.factor[..n * r], n, r);
        let y_column = MatRef::from_column_major_slice(y, n, 1);
        let mut weights = Mat::<f64>::zeros(r, 1);
        matmul::matmul(weights.as_mut(), Accum::Replace, factor.transpose(), y_column, 1.0, Par::Seq);
        triangular_solve::solve_lower_triangular_in_place(self.inner.as_ref(), weights.as_mut(), Par::Seq);
        triangular_solve::solve_upper_triangular_in_place(self.inner.transpose(), weights.as_mut(), Par::Seq);
        let mut alpha = y.to_vec();
        let alpha_column = MatMut::from_column_major_slice_mut(&mut alpha, n, 1);
        matmul::matmul(alpha_column, Accum::Add, factor, weights.as_ref(), -1.0, Par::Seq);
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

/// The factor and its pivots; `None` where the rank exceeds `max_rank`, or is about to.
///
/// Pivots come in panels: the largest remainders are the candidates, and of those the largest is taken again and
/// again as long as it has not fallen far below the largest at the panel's start. So most of the work is products of
/// matrices, at a rank a few percent higher than by single pivots.
fn incomplete_cholesky(
    inputs: &Inputs,
    l: f64,
    tolerance: f64,
    max_rank: usize,
) -> Option<(Buffer, Vec<usize>)> {
    let n = inputs.len();
    let arch = Arch::new();
    let mut columns = Buffer::any((max_rank + PANEL) * n);
    let mut rows = vec![0.0; (max_rank + PANEL) * PANEL];
    let mut pivots: Vec<usize> = Vec::new();
    let mut remainder = vec![1.0; n];
    loop {
        let mut candidates = candidates(&remainder, tolerance);
        let Some(&first) = candidates.first() else { break };
        let largest = remainder[first];
        let k = pivots.len();
        // Where half of the ranks have not brought half of the digits, all of them will hardly bring the rest.
        if k >= max_rank || k >= max_rank / 2 && k > 16 && largest > tolerance.sqrt() {
            return None;
        }
        let width = candidates.len();
        let (before, panel) = columns.split_at_mut(k * n);
        let panel = &mut panel[..width * n];
        for (column, &pivot) in panel.chunks_exact_mut(n).zip(&candidates) {
            inputs.column(l, pivot, 0, column, &mut []);
        }
        if k > 0 {
            let rows = &mut rows[..k * width];
            for (row, &pivot) in rows.chunks_exact_mut(k).zip(&candidates) {
                row.iter_mut().zip(before.chunks_exact(n)).for_each(|(to, column)| *to = column[pivot]);
            }
            matmul::matmul(
                MatMut::from_column_major_slice_mut(panel, n, width),
                Accum::Add,
                MatRef::from_column_major_slice(before, n, k),
                MatRef::from_column_major_slice(rows, k, width),
                -1.0,
                Par::Seq,
            );
        }
        let least = tolerance.max(SHARE_OF_LARGEST * largest);
        for taken in 0..width {
            let (best, &pivot) =
                candidates[taken..].iter().enumerate().fold(None, |best: Option<(usize, &usize)>, now| {
                    match best {
                        Some(before) if remainder[*before.1] >= remainder[*now.1] => best,
                        _ => Some(now),
                    }
                })?;
            if remainder[pivot] < least {
                break;
            }
            candidates.swap(taken, taken + best);
            if best > 0 {
                let (left, right) = panel.split_at_mut((taken + best) * n);
                left[taken * n..(taken + 1) * n].swap_with_slice(&mut right[..n]);
            }
            let (before, now) = panel.split_at_mut(taken * n);
            let diagonal = remainder[pivot].sqrt();
            arch.dispatch(NextColumn { before, now: &mut now[..n], remainder: &mut remainder, pivot });
            now[pivot] = diagonal;
            remainder[pivot] = f64::NEG_INFINITY;
            pivots.push(pivot);
        }
    }
    Some((columns, pivots))
}

/// The samples with the largest remainders above `tolerance`, the largest first, at most [`PANEL`].
fn candidates(remainder: &[f64], tolerance: f64) -> Vec<usize> {
    let mut above: Vec<usize> = (0..remainder.len()).filter(|&i| remainder[i] > tolerance).collect();
    let order = |a: &usize, b: &usize| remainder[*b].total_cmp(&remainder[*a]).then(a.cmp(b));
    if above.len() > PANEL {
        above.select_nth_unstable_by(PANEL, order);
        above.truncate(PANEL);
    }
    above.sort_unstable_by(order);
    above
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
                *value = d.mul_add(-fd, c.mul_add(-fc, b.mul_add(-fb, a.mul_add(-fa, *value))));
            }
        }
        for column in fours.remainder().chunks_exact(n) {
            let factor = column[pivot];
            for (value, c) in now.iter_mut().zip(column) {
                *value = c.mul_add(-factor, *value);
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
