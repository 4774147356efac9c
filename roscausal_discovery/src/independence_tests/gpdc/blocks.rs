//! Cholesky factor and inverse of a large matrix, in parts that two threads share.
//!
//! A matrix is cut in the middle of its rows and columns, and its parts again. What is done, and in which order, does not depend on
//! the number of threads, so the numbers do not either.
//!
//! With `A = [P; Q R]` (the lower triangle) and `A = L L'`, `L = [C; D E]`:
//!
//! 1. `C` is the factor of `P`.
//! 2. `D = Q C'^-1`, each half of its rows by a thread.
//! 3. `R - D D'` in four parts: one thread takes the two on the diagonal, the other that below them, which is as much.
//! 4. `E` is the factor of that.
//!
//! And with `L^-1 = [F; G H]`: a thread for `F = C^-1` and one for `H = E^-1`, then `G = - E^-1 (D F)`, by halves too.

use faer::{
    Accum, MatMut, MatRef, Par,
    dyn_stack::{MemBuffer, MemStack},
    linalg::{
        cholesky::llt,
        matmul::triangular::{
            self,
            BlockStructure::{self, Rectangular, TriangularLower},
        },
        triangular_inverse,
        triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place},
    },
    prelude::{Reborrow, ReborrowMut},
};

use super::{cores::Cores, real::Real};

/// Samples from which on a matrix is shared: with fewer, a thread costs more than it does.
pub(super) const SHARED: usize = 600;
/// Rows that are not cut again.
const WHOLE: usize = 256;

/// Writes `L` of `A = L L'` over the lower triangle of `A`; `None` where `A` is not positive definite in this precision.
pub(super) fn factorise<T: Real>(matrix: MatMut<'_, T>, cores: &Cores) -> Option<()> {
    if matrix.nrows() < SHARED { whole(matrix) } else { cut(matrix, cores) }
}

/// The same in one part.
pub(super) fn whole<T: Real>(matrix: MatMut<'_, T>) -> Option<()> {
    let scratch = llt::factor::cholesky_in_place_scratch::<T>(matrix.nrows(), Par::Seq, Default::default());
    let mut scratch = MemBuffer::new(scratch);
    let (stack, none) = (MemStack::new(&mut scratch), Default::default());
    llt::factor::cholesky_in_place(matrix, none, Par::Seq, stack, Default::default()).ok().map(drop)
}

fn cut<T: Real>(matrix: MatMut<'_, T>, cores: &Cores) -> Option<()> {
    let n = matrix.nrows();
    if n <= WHOLE {
        return whole(matrix);
    }
    let (mut first, _, mut below, mut last) = matrix.split_at_mut(n / 2, n / 2);
    cut(first.rb_mut(), cores)?;
    let first = first.rb();
    let middle = below.nrows() / 2;
    let (upper, lower) = below.rb_mut().split_at_row_mut(middle);
    cores.both(
        || solve_lower_triangular_in_place(first, upper.transpose_mut(), Par::Seq),
        || solve_lower_triangular_in_place(first, lower.transpose_mut(), Par::Seq),
    );
    let (upper, lower) = below.rb().split_at_row(middle);
    let (on, _, under, on_too) = last.rb_mut().split_at_mut(middle, middle);
    cores.both(
        || {
            subtract(on, TriangularLower, upper, upper);
            subtract(on_too, TriangularLower, lower, lower);
        },
        || subtract(under, Rectangular, lower, upper),
    );
    cut(last, cores)
}

/// Solves `L L' x = y`, and writes `x` over `y`.
pub(super) fn solve<T: Real>(factor: MatRef<'_, T>, y: &mut [T]) {
    let mut column = MatMut::from_column_major_slice_mut(y, factor.nrows(), 1);
    solve_lower_triangular_in_place(factor, column.rb_mut(), Par::Seq);
    solve_upper_triangular_in_place(factor.transpose(), column, Par::Seq);
}

/// `to -= a b'`
fn subtract<T: Real>(to: MatMut<'_, T>, part: BlockStructure, a: MatRef<'_, T>, b: MatRef<'_, T>) {
    let minus = T::from_double(-1.0);
    triangular::matmul(to, part, Accum::Add, a, Rectangular, b.transpose(), Rectangular, minus, Par::Seq);
}

/// Writes the lower triangle of `L^-1`; what is above the diagonal stays.
pub(super) fn invert<T: Real>(inverse: MatMut<'_, T>, factor: MatRef<'_, T>, cores: &Cores) {
    let n = factor.nrows();
    let alone = |inverse: MatMut<'_, T>, factor: MatRef<'_, T>| {
        triangular_inverse::invert_lower_triangular(inverse, factor, Par::Seq);
    };
    if n < SHARED {
        return alone(inverse, factor);
    }
    let (first, _, below, last) = factor.split_at(n / 2, n / 2);
    let (mut first_inverse, _, mut product, last_inverse) = inverse.split_at_mut(n / 2, n / 2);
    cores.both(|| alone(first_inverse.rb_mut(), first), || alone(last_inverse, last));
    let first_inverse = first_inverse.rb();
    let times = |product: MatMut<'_, T>, rows: MatRef<'_, T>| {
        let minus = T::from_double(-1.0);
        let (whole, lower) = (Rectangular, TriangularLower);
        triangular::matmul(
            product,
            whole,
            Accum::Replace,
            rows,
            whole,
            first_inverse,
            lower,
            minus,
            Par::Seq,
        );
    };
    let middle = product.nrows() / 2;
    let (upper_rows, lower_rows) = below.split_at_row(middle);
    let (upper, lower) = product.rb_mut().split_at_row_mut(middle);
    cores.both(|| times(upper, upper_rows), || times(lower, lower_rows));
    let middle = product.ncols() / 2;
    let (left, right) = product.split_at_col_mut(middle);
    cores.both(
        || solve_lower_triangular_in_place(last, left, Par::Seq),
        || solve_lower_triangular_in_place(last, right, Par::Seq),
    );
}

#[cfg(test)]
mod tests {
    use super::{super::cores::ONE, *};

    /// `A = K + I` with a kernel of two scales, in column-major order.
    fn matrix(n: usize) -> Vec<f64> {
        let entry = |i: usize, j: usize| {
            let apart = i.abs_diff(j) as f64;
            (-apart / 9.0).exp() + (-apart / 200.0).exp() + if i == j { 1.0 } else { 0.0 }
        };
        (0..n * n).map(|k| entry(k % n, k / n)).collect()
    }

    #[test]
    fn parts_give_the_factor_and_the_inverse_of_the_whole() {
        let n = 701;
        let a = matrix(n);
        let mut factor = a.clone();
        factorise(MatMut::from_column_major_slice_mut(&mut factor, n, n), &ONE).unwrap();
        let mut expected = a.clone();
        whole(MatMut::from_column_major_slice_mut(&mut expected, n, n)).unwrap();
        let mut inverse = vec![7.0; n * n];
        let view = MatRef::from_column_major_slice(&factor, n, n);
        invert(MatMut::from_column_major_slice_mut(&mut inverse, n, n), view, &ONE);
        let mut expected_inverse = vec![7.0; n * n];
        triangular_inverse::invert_lower_triangular(
            MatMut::from_column_major_slice_mut(&mut expected_inverse, n, n),
            MatRef::from_column_major_slice(&expected, n, n),
            Par::Seq,
        );
        for k in 0..n * n {
            let lower = k % n >= k / n;
            assert!(!lower || (factor[k] - expected[k]).abs() < 1e-12, "factor {k}");
            assert!((inverse[k] - expected_inverse[k]).abs() < 1e-12, "inverse {k}");
        }
    }

    #[test]
    fn what_is_not_positive_definite_has_no_factor() {
        let n = 640;
        let mut a = matrix(n);
        a[n * n - 1] = -1.0;
        assert!(factorise(MatMut::from_column_major_slice_mut(&mut a, n, n), &ONE).is_none());
    }
}
