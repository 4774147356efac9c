//! The marginal likelihood by the whole kernel matrix: exact but for rounding, `n^3` operations, two matrices of `n^2`
//! numbers in single or double precision.

use std::{marker::PhantomData, ops::Range};

use faer::{Accum, MatMut, MatRef, Par, linalg::matmul, prelude::ReborrowMut};

use super::{
    blocks::{SHARED, factorise, invert, solve},
    buffer::Buffer,
    cores::Cores,
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
    /// precision. An idle one of the `cores` takes half of it, from [`SHARED`] samples on.
    pub(super) fn new(inputs: &Inputs, theta: Theta, for_search: bool, cores: &Cores) -> Option<Self> {
        let n = inputs.len();
        let (mut factor, mut parts) =
            (Buffer::of::<T>(n * n), Buffer::of::<T>(if for_search { n * n } else { 0 }));
        let derivatives = for_search.then(|| parts.numbers_mut(n * n));
        fill::<T>(inputs, theta, factor.numbers_mut(n * n), derivatives, cores);
        let matrix = factor.numbers_mut::<T>(n * n);
        factorise(MatMut::from_column_major_slice_mut(matrix, n, n), cores)?;
        let log_determinant = 2.0 * matrix.iter().step_by(n + 1).map(|d| libm::log(d.double())).sum::<f64>();
        let of = |parts: Buffer, inverted: bool, traces: Traces| Self {
            n,
            parts,
            inverted,
            log_determinant,
            traces,
            precision: PhantomData,
        };
        if !for_search {
            return Some(of(factor, false, Traces::default()));
        }
        let inverse = parts.numbers_mut::<T>(n * n);
        invert(
            MatMut::from_column_major_slice_mut(inverse, n, n),
            MatRef::from_column_major_slice(matrix, n, n),
            cores,
        );
        let square = |(j, column): (usize, &[T])| T::dot(&column[j..], &column[j..]);
        let (derivative, squared) = traces_of_products(inverse, n, cores);
        let traces =
            Traces { inverse: inverse.chunks_exact(n).enumerate().map(square).sum(), squared, derivative };
        Some(of(parts, true, traces))
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
        if self.inverted {
            half = self.half(&half);
            let columns = self.view().chunks_exact(n).enumerate();
            return columns.map(|(j, column)| T::dot(&column[j..], &half[j..])).collect();
        }
        solve(MatRef::from_column_major_slice(self.view(), n, n), &mut half);
        half.into_iter().map(T::double).collect()
    }
}

/// Writes `A` on and below the diagonal of `factor`, and `dK / d ln l` above the diagonal of `parts`.
fn fill<T: Real>(inputs: &Inputs, theta: Theta, factor: &mut [T], parts: Option<&mut [T]>, cores: &Cores) {
    let n = inputs.len();
    // Half of the triangle is in these columns.
    let half = if n < SHARED { n } else { (n as f64 * (1.0 - 0.5_f64.sqrt())) as usize };
    let (left, right) = factor.split_at_mut(half * n);
    let rows = parts.map(|parts| parts.chunks_exact_mut(n).map(|column| column.split_at_mut(half)).unzip());
    let (upper, lower): (Option<Vec<_>>, Option<Vec<_>>) = rows.unzip();
    cores.both(
        || fill_columns(inputs, theta, 0, left, upper),
        || fill_columns(inputs, theta, half, right, lower),
    );
}

/// The columns of `A` from `start` on that `columns` has room for, and those rows of `dK / d ln l`, of which `rows` has each column.
fn fill_columns<T: Real>(
    inputs: &Inputs,
    theta: Theta,
    start: usize,
    columns: &mut [T],
    mut rows: Option<Vec<&mut [T]>>,
) {
    let n = inputs.len();
    let end = start + columns.len() / n;
    let mut derivatives = vec![T::zeroed(); LINE * n];
    for first in (start..end).step_by(LINE) {
        let height = n - first;
        let lines = LINE.min(end - first);
        for (k, derivative) in derivatives.chunks_exact_mut(n).take(lines).enumerate() {
            let j = first + k;
            let derivative = if rows.is_some() { &mut derivative[..height] } else { &mut [] };
            let kernel = &mut columns[(j - start) * n + first..(j - start + 1) * n];
            T::column(inputs, theta.l, j, first, kernel, derivative);
            kernel[k] = T::from_double(1.0 + theta.s);
        }
        let Some(rows) = rows.as_deref_mut() else { continue };
        for i in first + 1..n {
            let line = &mut rows[i][first - start..][..lines.min(i - first)];
            line.iter_mut().enumerate().for_each(|(k, value)| *value = derivatives[k * n + i - first]);
        }
    }
}

/// `tr(A^-1 D)` and `tr(A^-2)`, where `A^-1 = L^-T L^-1`, from the lower triangle `L^-1` and the symmetric `D` above the
/// diagonal of `parts`.
fn traces_of_products<T: Real>(parts: &[T], n: usize, cores: &Cores) -> (f64, f64) {
    if n < SHARED {
        return traces_of_rows(parts, n, 0..n);
    }
    // The upper rows are short and have much below them, the lower ones the other way round: as much in sum.
    let half = n / 2 / BLOCK * BLOCK;
    let (mut upper, mut lower) = ((0.0, 0.0), (0.0, 0.0));
    cores.both(|| upper = traces_of_rows(parts, n, 0..half), || lower = traces_of_rows(parts, n, half..n));
    (upper.0 + lower.0, upper.1 + lower.1)
}

/// What these rows of `A^-1` add to the traces, block by block; they begin with a whole block.
fn traces_of_rows<T: Real>(parts: &[T], n: usize, rows: Range<usize>) -> (f64, f64) {
    let inverse = MatRef::from_column_major_slice(parts, n, n);
    let (mut product, mut diagonal) = (vec![T::zeroed(); BLOCK * BLOCK], vec![T::zeroed(); BLOCK * BLOCK]);
    let one = T::from_double(1.0);
    let (mut trace, mut squared) = (0.0, 0.0);
    for row in rows.clone().step_by(BLOCK) {
        let height = BLOCK.min(rows.end - row);
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

#[cfg(test)]
mod tests {
    use super::{super::cores::ONE, *};

    const N: usize = 650;
    const THETA: Theta = Theta { l: 0.3, s: 0.2 };

    fn inputs() -> Inputs {
        let noise = |i: usize| ((12.9898 * i as f64).sin() * 43_758.545_3).rem_euclid(1.0) * 4.0 - 2.0;
        Inputs::new(&[0, 1].map(|k| (0..N).map(|i| noise(2 * i + k)).collect::<Vec<_>>()))
    }

    #[test]
    fn an_idle_core_changes_no_byte() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
        let y: Vec<f64> = (0..N).map(|i| (0.1 * i as f64).sin()).collect();
        let numbers = |cores: &Cores| {
            let at = Dense::<f64>::new(&inputs(), THETA, true, cores).unwrap();
            let (Traces { inverse, squared, derivative }, solution) = (at.traces(), at.solve(&y));
            let found = vec![at.log_determinant(), inverse, squared, derivative, solution.derivative];
            [found, solution.alpha].concat().into_iter().map(f64::to_bits).collect::<Vec<_>>()
        };
        assert_eq!(pool.install(|| numbers(&Cores::of_pool())), numbers(&ONE));
    }

    #[test]
    fn traces_of_halves_are_derivatives_of_the_determinant() {
        let at = |theta| Dense::<f64>::new(&inputs(), theta, true, &ONE).unwrap();
        let step = 1e-4;
        let longer = |by: f64| at(Theta { l: THETA.l * by.exp(), ..THETA });
        let noisier = |by: f64| at(Theta { s: THETA.s + by, ..THETA });
        let difference = |above: f64, below: f64| (above - below) / (2.0 * step);
        let Traces { inverse, squared, derivative } = at(THETA).traces();
        let by_l = difference(longer(step).log_determinant, longer(-step).log_determinant);
        assert!((by_l / derivative - 1.0).abs() < 1e-5, "{by_l} {derivative}");
        let (above, below) = (noisier(step), noisier(-step));
        let by_s = difference(above.log_determinant, below.log_determinant);
        assert!((by_s / inverse - 1.0).abs() < 1e-5, "{by_s} {inverse}");
        let twice = difference(above.traces.inverse, below.traces.inverse);
        assert!((-twice / squared - 1.0).abs() < 1e-5, "{twice} {squared}");
    }
}
