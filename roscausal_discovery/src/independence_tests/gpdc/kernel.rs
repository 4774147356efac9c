//! The RBF kernel `exp(-|a - b|^2 / (2 l^2))` between samples, in loops that the vector units run.

use pulp::{Arch, NullaryFnOnce};

use super::buffer::Buffer;
use crate::numeric::special::exp_of_negative;

/// The conditions of a regression: `n` samples in `d` dimensions.
#[derive(Debug)]
pub(super) struct Inputs {
    n: usize,
    /// One run of `n` values per dimension.
    values: Vec<f64>,
    /// The same in single precision.
    singles: Vec<f32>,
    arch: Arch,
}

impl Inputs {
    /// Inputs from one row of samples per dimension.
    pub(super) fn new(rows: &[Vec<f64>]) -> Self {
        let n = rows.first().map_or(0, Vec::len);
        let values = rows.concat();
        let singles = values.iter().map(|&value| value as f32).collect();
        Self { n, values, singles, arch: Arch::new() }
    }

    /// Number of samples.
    pub(super) fn len(&self) -> usize {
        self.n
    }

    /// Number of dimensions.
    pub(super) fn dimensions(&self) -> usize {
        self.values.len() / self.n.max(1)
    }

    /// Writes the kernel between sample `j` and the samples from `from` on into `kernel`, as many as fit, and its
    /// derivative by `ln l` into `derivative` unless that is empty.
    pub(super) fn column(&self, l: f64, j: usize, from: usize, kernel: &mut [f64], derivative: &mut [f64]) {
        let (n, values, scale) = (self.n, &self.values, -0.5 / (l * l));
        self.arch.dispatch(Column { n, values, scale, j, from, kernel, derivative });
    }

    /// The same in single precision.
    pub(super) fn column_of_singles(
        &self,
        l: f64,
        j: usize,
        from: usize,
        kernel: &mut [f32],
        derivative: &mut [f32],
    ) {
        let (n, values, scale) = (self.n, &self.singles, (-0.5 / (l * l)) as f32);
        self.arch.dispatch(Column { n, values, scale, j, from, kernel, derivative });
    }

    /// The samples `chosen`, in that order.
    pub(super) fn chosen(&self, chosen: &[usize]) -> Self {
        let pick = |row: &[f64]| chosen.iter().map(|&i| row[i]).collect::<Vec<f64>>();
        Self::new(&self.values.chunks_exact(self.n).map(pick).collect::<Vec<_>>())
    }

    /// The place of sample `i`, one value per dimension.
    pub(super) fn place(&self, i: usize) -> Vec<f64> {
        self.values_of(i).collect()
    }

    /// The same, one after the other.
    pub(super) fn values_of(&self, i: usize) -> impl Iterator<Item = f64> + '_ {
        self.values.chunks_exact(self.n).map(move |row| row[i])
    }

    /// Writes the kernel between a place, one value per dimension, and every sample into `kernel`.
    pub(super) fn to_place(&self, l: f64, place: &[f64], kernel: &mut [f64]) {
        let scale = -0.5 / (l * l);
        for (i, k) in kernel.iter_mut().enumerate().take(self.n) {
            let rows = self.values.chunks_exact(self.n).zip(place);
            let square: f64 = rows.map(|(row, z)| (row[i] - z).powi(2)).sum();
            *k = libm::exp(scale * square);
        }
    }

    /// The sum over the samples of `weights` times the kernel between the sample and a place.
    pub(super) fn weighted_sum(&self, l: f64, place: &[f64], weights: &[f64]) -> f64 {
        let (n, values, scale) = (self.n, &self.values, -0.5 / (l * l));
        self.arch.dispatch(WeightedSum { n, values, scale, place, weights })
    }

    /// `dK / d ln l` between the samples of `chosen`: symmetric, column-major.
    pub(super) fn derivative_between(&self, l: f64, chosen: &[u32]) -> Buffer {
        let r = chosen.len();
        let pick = |row: &[f64]| chosen.iter().map(|&i| row[i as usize]).collect::<Vec<f64>>();
        let few = Self::new(&self.values.chunks_exact(self.n).map(pick).collect::<Vec<_>>());
        let (mut kernel, mut derivative) = (vec![0.0; r], Buffer::any(r * r));
        for (j, column) in derivative.chunks_exact_mut(r).enumerate() {
            few.column(l, j, 0, &mut kernel, column);
        }
        derivative
    }
}

/// One call of [`Inputs::column`]. A type and not a closure, because only what is inlined into the dispatch is
/// compiled for the vector units.
struct Column<'a, T> {
    n: usize,
    values: &'a [T],
    scale: T,
    j: usize,
    from: usize,
    kernel: &'a mut [T],
    derivative: &'a mut [T],
}

/// One call of [`Inputs::weighted_sum`].
struct WeightedSum<'a> {
    n: usize,
    values: &'a [f64],
    scale: f64,
    place: &'a [f64],
    weights: &'a [f64],
}

impl NullaryFnOnce for WeightedSum<'_> {
    type Output = f64;

    #[inline(always)]
    fn call(self) -> f64 {
        const BLOCK: usize = 32;
        let Self { n, values, scale, place, weights } = self;
        let rows = || values.chunks_exact(n).zip(place);
        let blocks = n / BLOCK * BLOCK;
        let mut sums = [0.0; BLOCK];
        for (at, weights) in (0..blocks).step_by(BLOCK).zip(weights.chunks_exact(BLOCK)) {
            let mut squares = [0.0_f64; BLOCK];
            for (row, centre) in rows() {
                let Some(row) = row[at..].first_chunk::<BLOCK>() else { continue };
                for k in 0..BLOCK {
                    let difference = row[k] - centre;
                    squares[k] = difference.mul_add(difference, squares[k]);
                }
            }
            for k in 0..BLOCK {
                sums[k] = weights[k].mul_add(exp_of_negative(scale * squares[k]), sums[k]);
            }
        }
        let last = (blocks..n).map(|i| {
            let square = rows().map(|(row, centre)| (row[i] - centre) * (row[i] - centre)).sum::<f64>();
            weights[i] * exp_of_negative(scale * square)
        });
        sum_in_lanes(&sums) + last.sum::<f64>()
    }
}

/// The columns as [`NullaryFnOnce`] of a precision, `$block` samples at a time.
macro_rules! column_in {
    ($precision:ty, $block:literal, $exp_of_negative:ident) => {
        impl NullaryFnOnce for Column<'_, $precision> {
            type Output = ();

            #[inline(always)]
            fn call(self) {
                const BLOCK: usize = $block;
                let Self { n, values, scale, j, from, kernel, derivative } = self;
                let rows = || values.chunks_exact(n).map(|row| (row[j], &row[from..]));
                let m = kernel.len();
                if m < BLOCK {
                    for (i, k) in kernel.iter_mut().enumerate() {
                        let square = |sum, (centre, row): ($precision, &[$precision])| {
                            (row[i] - centre).mul_add(row[i] - centre, sum)
                        };
                        let sum = rows().fold(0.0, square);
                        *k = $exp_of_negative(scale * sum);
                        if let Some(d) = derivative.get_mut(i) {
                            *d = -2.0 * scale * sum * *k;
                        }
                    }
                    return;
                }
                // In blocks that stay in registers; the last block overlaps the one before it.
                for at in (0..m).step_by(BLOCK) {
                    let at = at.min(m - BLOCK);
                    let mut exponents: [$precision; BLOCK] = [0.0; BLOCK];
                    for (centre, row) in rows() {
                        let Some(row) = row[at..].first_chunk::<BLOCK>() else { continue };
                        for k in 0..BLOCK {
                            let difference = row[k] - centre;
                            exponents[k] = difference.mul_add(difference, exponents[k]);
                        }
                    }
                    let mut values: [$precision; BLOCK] = [0.0; BLOCK];
                    for k in 0..BLOCK {
                        exponents[k] *= scale;
                        values[k] = $exp_of_negative(exponents[k]);
                    }
                    kernel[at..at + BLOCK].copy_from_slice(&values);
                    if !derivative.is_empty() {
                        for k in 0..BLOCK {
                            values[k] *= -2.0 * exponents[k];
                        }
                        derivative[at..at + BLOCK].copy_from_slice(&values);
                    }
                }
            }
        }
    };
}

column_in!(f64, 32, exp_of_negative);
column_in!(f32, 64, exp_of_negative_single);

/// `exp(x)` for `x <= 0` in single precision, as [`exp_of_negative`], within 2 units in the last place; 0 below -87.
#[inline(always)]
fn exp_of_negative_single(x: f32) -> f32 {
    /// 1.5 * 2^23.
    const ROUND: f32 = 12_582_912.0;
    const LN_2_HIGH: f32 = 0.693_359_4;
    const LN_2_LOW: f32 = -2.121_944_4e-4;
    let clamped = if x < -87.0 { -87.0 } else { x };
    let shifted = clamped.mul_add(std::f32::consts::LOG2_E, ROUND);
    let k = shifted - ROUND;
    let r = k.mul_add(-LN_2_LOW, k.mul_add(-LN_2_HIGH, clamped));
    // 1 + r + r^2 q(r), q of degree 4 by Chebyshev interpolation: within 2e-8.
    let mut q = 1.392_618_4e-3_f32;
    for coefficient in [8.363_179e-3, 4.166_655_5e-2, 1.666_657_7e-1, 0.5, 1.0, 1.0] {
        q = q.mul_add(r, coefficient);
    }
    let power = f32::from_bits((shifted.to_bits() << 23).wrapping_add(127 << 23));
    let value = q * power;
    if x < -87.0 { 0.0 } else { value }
}

/// Sum of products in partial sums whose order is fixed.
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    Arch::new().dispatch(Dot { a, b })
}

/// The same in single precision, its partial sums added in double.
pub(super) fn dot_of_singles(a: &[f32], b: &[f32]) -> f64 {
    Arch::new().dispatch(Dot { a, b })
}

struct Dot<'a, T> {
    a: &'a [T],
    b: &'a [T],
}

/// Partial sums, and how they are added up: in halves, so that vector units do it and no sum waits for the last one.
const LANES: usize = 8;

#[inline(always)]
fn sum_in_lanes<T: Copy + Into<f64>>(vectors: &[T]) -> f64 {
    let mut sums = [0.0_f64; LANES];
    for vector in vectors.chunks_exact(LANES) {
        for k in 0..LANES {
            sums[k] += Into::<f64>::into(vector[k]);
        }
    }
    for half in [4, 2, 1] {
        for k in 0..half {
            sums[k] += sums[k + half];
        }
    }
    sums[0]
}

/// The sum of products as [`NullaryFnOnce`] of a precision, in `$vectors` vectors of partial sums, then in one.
macro_rules! dot_in {
    ($precision:ty, $vectors:literal) => {
        impl NullaryFnOnce for Dot<'_, $precision> {
            type Output = f64;

            #[inline(always)]
            fn call(self) -> f64 {
                const WIDTH: usize = $vectors * LANES;
                let mut sums: [$precision; WIDTH] = [0.0; WIDTH];
                let (a, b) = (self.a.chunks_exact(WIDTH), self.b.chunks_exact(WIDTH));
                let rests = (a.remainder().chunks_exact(LANES), b.remainder().chunks_exact(LANES));
                for (a, b) in a.zip(b) {
                    for k in 0..WIDTH {
                        sums[k] = a[k].mul_add(b[k], sums[k]);
                    }
                }
                let last = rests.0.remainder().iter().zip(rests.1.remainder());
                let last: f64 = last.map(|(a, b)| f64::from(a * b)).sum();
                for (a, b) in rests.0.zip(rests.1) {
                    for k in 0..LANES {
                        sums[k] = a[k].mul_add(b[k], sums[k]);
                    }
                }
                sum_in_lanes(&sums) + last
            }
        }
    };
}

dot_in!(f64, 4);
dot_in!(f32, 8);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exp_is_exact_to_the_last_bits() {
        for i in 0..=708_000 {
            let x = f64::from(i) * -1e-3;
            let (got, expected) = (exp_of_negative(x), x.exp());
            assert!((got - expected).abs() <= 4.5e-16 * expected, "{x}: {got} {expected}");
        }
        for i in 0..87_000 {
            let x = i as f32 * -1e-3;
            let (got, expected) = (f64::from(exp_of_negative_single(x)), f64::from(x).exp());
            assert!((got - expected).abs() <= 2.4e-7 * expected, "{x}: {got} {expected}");
        }
        assert_eq!((exp_of_negative_single(-1e30), exp_of_negative_single(0.0)), (0.0, 1.0));
        assert_eq!(exp_of_negative(-1e300), 0.0);
        assert_eq!(exp_of_negative(f64::NEG_INFINITY), 0.0);
        assert_eq!(exp_of_negative(0.0), 1.0);
    }
}
