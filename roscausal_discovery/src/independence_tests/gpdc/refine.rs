//! Solutions with the whole kernel matrix by conjugate gradients, from an approximate factorisation nearby: a few
//! products of matrix and vector instead of another factorisation.

use pulp::{Arch, NullaryFnOnce};

use super::{
    buffer::Buffer,
    kernel::{Inputs, dot},
    theta::Theta,
};

/// Residual norm, as a share of that of the right-hand side, at which a solution is exact enough.
const EXACT: f64 = 1e-10;
/// Products after which the factorisation is too far away.
const MOST_PRODUCTS: usize = 25;
/// The same where the matrix is not kept, and there is no other factorisation to turn to.
const EXACT_BY_ROWS: f64 = 1e-7;
const MOST_PRODUCTS_BY_ROWS: usize = 1000;

/// `(K + s I)^-1 y` at `theta`; `approximate` solves nearly the same equations. `None` where it is too far away.
pub(super) fn solve(
    inputs: &Inputs,
    theta: Theta,
    y: &[f64],
    approximate: impl Fn(&[f64]) -> Vec<f64>,
) -> Option<Vec<f64>> {
    let n = y.len();
    // The columns on and below the diagonal, one after the other.
    let mut columns = Buffer::any(n * (n + 1) / 2);
    let mut rest_of_columns = &mut columns[..];
    for j in 0..n {
        let (column, rest) = rest_of_columns.split_at_mut(n - j);
        inputs.column(theta.l, j, j, column, &mut []);
        column[0] += theta.s;
        rest_of_columns = rest;
    }
    let arch = Arch::new();
    let times = |x: &[f64]| {
        let mut product = vec![0.0; n];
        arch.dispatch(SymmetricProduct { columns: &columns, first: 0, x, product: &mut product });
        product
    };
    conjugate_gradients(times, y, approximate, EXACT, MOST_PRODUCTS)
}

/// The same with memory for `n` numbers only: each column of the matrix is computed when it is needed. As exact as the ranks of the
/// residuals need it.
pub(super) fn solve_by_rows(
    inputs: &Inputs,
    theta: Theta,
    y: &[f64],
    approximate: impl Fn(&[f64]) -> Vec<f64>,
) -> Option<Vec<f64>> {
    let (n, arch) = (y.len(), Arch::new());
    let mut room = Buffer::any(n);
    let times = |x: &[f64]| {
        let mut product = vec![0.0; n];
        for j in 0..n {
            let column = &mut room[..n - j];
            inputs.column(theta.l, j, j, column, &mut []);
            column[0] += theta.s;
            arch.dispatch(SymmetricProduct { columns: column, first: j, x, product: &mut product });
        }
        product
    };
    conjugate_gradients(times, y, approximate, EXACT_BY_ROWS, MOST_PRODUCTS_BY_ROWS)
}

/// The solution with the matrix that `times` multiplies by, to a residual norm of `exact` times that of `y`.
fn conjugate_gradients(
    mut times: impl FnMut(&[f64]) -> Vec<f64>,
    y: &[f64],
    approximate: impl Fn(&[f64]) -> Vec<f64>,
    exact: f64,
    most_products: usize,
) -> Option<Vec<f64>> {
    let enough = exact * exact * dot(y, y);
    let mut solution = approximate(y);
    let mut rest: Vec<f64> = y.iter().zip(times(&solution)).map(|(y, ax)| y - ax).collect();
    let mut direction = approximate(&rest);
    let mut fit = dot(&rest, &direction);
    for _ in 0..most_products {
        if dot(&rest, &rest) <= enough {
            return Some(solution);
        }
        let product = times(&direction);
        let length = fit / dot(&direction, &product);
        add(&mut solution, &direction, length);
        add(&mut rest, &product, -length);
        let next = approximate(&rest);
        let fit_before = std::mem::replace(&mut fit, dot(&rest, &next));
        let share = fit / fit_before;
        direction.iter_mut().zip(next).for_each(|(d, next)| *d = next + share * *d);
    }
    None
}

fn add(sum: &mut [f64], values: &[f64], factor: f64) {
    sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += factor * value);
}

/// `product += A x` of a symmetric matrix by its `columns` from the diagonal down, as many as there are from the `first` on: each is
/// read once for both triangles.
struct SymmetricProduct<'a> {
    columns: &'a [f64],
    first: usize,
    x: &'a [f64],
    product: &'a mut [f64],
}

impl NullaryFnOnce for SymmetricProduct<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        const LANES: usize = 32;
        let Self { mut columns, first, x, product } = self;
        for j in first..x.len() {
            if columns.is_empty() {
                return;
            }
            let (column, rest) = columns.split_at(x.len() - j);
            columns = rest;
            let (x_j, x_below) = (x[j], &x[j + 1..]);
            let (product_j, below) = product[j..].split_at_mut(1);
            let column_below = &column[1..];
            let mut sums = [0.0; LANES];
            let whole = column_below.len() / LANES * LANES;
            let (now, last) = column_below.split_at(whole);
            let (x_now, x_last) = x_below.split_at(whole);
            let (to_now, to_last) = below.split_at_mut(whole);
            let chunks = now.chunks_exact(LANES).zip(x_now.chunks_exact(LANES));
            for ((a, x), to) in chunks.zip(to_now.chunks_exact_mut(LANES)) {
                for k in 0..LANES {
                    sums[k] = a[k].mul_add(x[k], sums[k]);
                    to[k] = a[k].mul_add(x_j, to[k]);
                }
            }
            let mut sum = column[0] * x_j + sums.iter().sum::<f64>();
            for ((a, x), to) in last.iter().zip(x_last).zip(to_last) {
                sum = a.mul_add(*x, sum);
                *to = a.mul_add(x_j, *to);
            }
            product_j[0] += sum;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_solution_solves_and_a_far_factorisation_is_refused() {
        let row: Vec<f64> = (0..80).map(|i| f64::from(i % 13) - 6.0 + 0.01 * f64::from(i)).collect();
        let y: Vec<f64> = row.iter().map(|x| x.sin()).collect();
        let inputs = Inputs::new(std::slice::from_ref(&row));
        let theta = Theta { l: 1.0, s: 0.5 };
        let solution = solve(&inputs, theta, &y, |r| r.iter().map(|r| r / 2.0).collect()).unwrap();
        let by_rows = solve_by_rows(&inputs, theta, &y, |r| r.iter().map(|r| r / 2.0).collect()).unwrap();
        assert!(solution.iter().zip(&by_rows).all(|(a, b)| (a - b).abs() < 1e-5));
        for i in 0..80 {
            let kernel = |j: usize| (-0.5 * (row[i] - row[j]).powi(2)).exp();
            let product = (0..80).map(|j| kernel(j) * solution[j]).sum::<f64>() + 0.5 * solution[i];
            assert!((product - y[i]).abs() < 1e-8);
        }
        assert!(solve(&inputs, Theta { l: 0.3, s: 1e-9 }, &y, <[f64]>::to_vec).is_none());
    }
}
