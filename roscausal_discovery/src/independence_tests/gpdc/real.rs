//! What the forms of a likelihood need of a precision, single or double.

use std::ops::{MulAssign, Neg};

use faer::traits::ComplexField;
use pulp::{Arch, NullaryFnOnce};

use super::{
    buffer::Buffer,
    kernel::{Inputs, dot, dot_of_singles},
};

/// Single or double precision.
pub(super) trait Real:
    ComplexField + bytemuck::Pod + PartialOrd + Neg<Output = Self> + MulAssign
{
    const NEG_INFINITY: Self;
    fn from_double(value: f64) -> Self;
    fn double(self) -> f64;
    /// `self * factor + sum`, rounded once.
    fn mul_add(self, factor: Self, sum: Self) -> Self;
    /// Sum of products in partial sums of a fixed order.
    fn dot(a: &[Self], b: &[Self]) -> f64;
    /// [`Inputs::column`] in this precision.
    fn column(inputs: &Inputs, l: f64, j: usize, from: usize, kernel: &mut [Self], derivative: &mut [Self]);
    /// The first `n` numbers of `numbers`, which are of this precision, in double precision.
    fn doubles(numbers: Buffer, n: usize) -> Buffer {
        if size_of::<Self>() == size_of::<f64>() {
            return numbers;
        }
        let mut doubles = Buffer::any(n);
        doubles.iter_mut().zip(numbers.numbers::<Self>(n)).for_each(|(to, &from)| *to = from.double());
        doubles
    }
}

macro_rules! real {
    ($precision:ty, $dot:ident, $column:ident) => {
        impl Real for $precision {
            const NEG_INFINITY: Self = Self::NEG_INFINITY;

            #[inline(always)]
            fn from_double(value: f64) -> Self {
                value as Self
            }

            #[inline(always)]
            fn double(self) -> f64 {
                self.into()
            }

            #[inline(always)]
            fn mul_add(self, factor: Self, sum: Self) -> Self {
                self.mul_add(factor, sum)
            }

            fn dot(a: &[Self], b: &[Self]) -> f64 {
                $dot(a, b)
            }

            fn column(
                inputs: &Inputs,
                l: f64,
                j: usize,
                from: usize,
                kernel: &mut [Self],
                derivative: &mut [Self],
            ) {
                inputs.$column(l, j, from, kernel, derivative);
            }
        }
    };
}

real!(f64, dot, column);
real!(f32, dot_of_singles, column_of_singles);

/// `sums += sum over k of factors[k] columns[k]`, of columns in any precision, added up in double.
pub(super) fn add_columns<T: Real>(sums: &mut [f64], columns: &[T], factors: &[f64]) {
    Arch::new().dispatch(AddColumns { sums, columns, factors });
}

/// The products of `values` with columns in any precision, added up in double.
pub(super) fn products_with_columns<T: Real>(columns: &[T], values: &[f64]) -> Vec<f64> {
    Arch::new().dispatch(ProductsWithColumns { columns, values })
}

/// `L y`, of which `columns` have `L` below and on the diagonal, whatever stands above it.
pub(super) fn lower_times<T: Real>(columns: &[T], y: &[T]) -> Vec<T> {
    Arch::new().dispatch(LowerTimes { columns, y })
}

struct LowerTimes<'a, T> {
    columns: &'a [T],
    y: &'a [T],
}

impl<T: Real> NullaryFnOnce for LowerTimes<'_, T> {
    type Output = Vec<T>;

    #[inline(always)]
    fn call(self) -> Vec<T> {
        const AT_A_TIME: usize = 4;
        let Self { columns, y } = self;
        let n = y.len();
        let mut sums = vec![T::zeroed(); n];
        let mut blocks = columns.chunks_exact(AT_A_TIME * n.max(1));
        let mut j = 0;
        for block in blocks.by_ref() {
            // the triangle on the diagonal, then what is below it of all four columns at a time
            let below = j + AT_A_TIME;
            for (k, column) in block.chunks_exact(n).enumerate() {
                for i in j + k..below {
                    sums[i] = column[i].mul_add(y[j + k], sums[i]);
                }
            }
            let mut parts = block.chunks_exact(n).map(|column| &column[below..]);
            let (Some(a), Some(b), Some(c), Some(d)) =
                (parts.next(), parts.next(), parts.next(), parts.next())
            else {
                continue;
            };
            let (fa, fb, fc, fd) = (y[j], y[j + 1], y[j + 2], y[j + 3]);
            for ((((sum, a), b), c), d) in sums[below..].iter_mut().zip(a).zip(b).zip(c).zip(d) {
                *sum = d.mul_add(fd, c.mul_add(fc, b.mul_add(fb, a.mul_add(fa, *sum))));
            }
            j = below;
        }
        for column in blocks.remainder().chunks_exact(n.max(1)) {
            for i in j..n {
                sums[i] = column[i].mul_add(y[j], sums[i]);
            }
            j += 1;
        }
        sums
    }
}

struct AddColumns<'a, T> {
    sums: &'a mut [f64],
    columns: &'a [T],
    factors: &'a [f64],
}

impl<T: Real> NullaryFnOnce for AddColumns<'_, T> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { sums, columns, factors } = self;
        let n = sums.len();
        let (fours, factors_of_fours) = (columns.chunks_exact(4 * n), factors.chunks_exact(4));
        let (rest, rest_of_factors) = (fours.remainder(), factors_of_fours.remainder());
        for (four, f) in fours.zip(factors_of_fours) {
            let (a, four) = four.split_at(n);
            let (b, four) = four.split_at(n);
            let (c, d) = four.split_at(n);
            for ((((sum, a), b), c), d) in sums.iter_mut().zip(a).zip(b).zip(c).zip(d) {
                let two = a.double().mul_add(f[0], b.double() * f[1]);
                *sum += c.double().mul_add(f[2], d.double().mul_add(f[3], two));
            }
        }
        for (column, factor) in rest.chunks_exact(n).zip(rest_of_factors) {
            sums.iter_mut().zip(column).for_each(|(sum, a)| *sum = a.double().mul_add(*factor, *sum));
        }
    }
}

struct ProductsWithColumns<'a, T> {
    columns: &'a [T],
    values: &'a [f64],
}

impl<T: Real> NullaryFnOnce for ProductsWithColumns<'_, T> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn call(self) -> Vec<f64> {
        const LANES: usize = 32;
        let Self { columns, values } = self;
        let mut products = Vec::with_capacity(columns.len() / values.len().max(1));
        for column in columns.chunks_exact(values.len().max(1)) {
            let mut sums = [0.0; LANES];
            let (a, b) = (column.chunks_exact(LANES), values.chunks_exact(LANES));
            let last = a.remainder().iter().zip(b.remainder());
            let last = last.fold(0.0, |sum, (a, b)| a.double().mul_add(*b, sum));
            for (a, b) in a.zip(b) {
                for k in 0..LANES {
                    sums[k] = a[k].double().mul_add(b[k], sums[k]);
                }
            }
            for half in [16, 8, 4, 2, 1] {
                for k in 0..half {
                    sums[k] += sums[k + half];
                }
            }
            products.push(sums[0] + last);
        }
        products
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lower_triangle_times_a_vector_ignores_what_is_above_the_diagonal() {
        for n in 0..20 {
            let columns: Vec<f64> = (0..n * n).map(|i| ((i * 7919) % 101) as f64 - 50.0).collect();
            let y: Vec<f64> = (0..n).map(|i| i as f64 - 3.5).collect();
            let row = |i: usize| (0..=i).map(|j| columns[j * n + i] * y[j]).sum::<f64>();
            assert_eq!(lower_times(&columns, &y), (0..n).map(row).collect::<Vec<_>>(), "{n}");
        }
    }
}
