//! Solutions with the whole kernel matrix by conjugate gradients, from an approximate factorisation nearby: a few
//! products of matrix and vector instead of another factorisation.

use faer::{Accum, MatMut, MatRef, Par, linalg::matmul};

use super::{
    buffer::Buffer,
    gp::Theta,
    kernel::{Inputs, dot},
};

/// Residual norm, as a share of that of the right-hand side, at which a solution is exact enough.
const EXACT: f64 = 1e-10;
/// Products after which the factorisation is too far away.
const MOST_PRODUCTS: usize = 25;

/// `(K + s I)^-1 y` at `theta`; `approximate` solves nearly the same equations. `None` where it is too far away.
pub(super) fn solve(
    inputs: &Inputs,
    theta: Theta,
    y: &[f64],
    approximate: impl Fn(&[f64]) -> Vec<f64>,
) -> Option<Vec<f64>> {
    let n = y.len();
    let mut matrix = Buffer::any(n * n);
    for (j, column) in matrix.chunks_exact_mut(n).enumerate() {
        inputs.column(theta.l, j, 0, column, &mut []);
        column[j] += theta.s;
    }
    let matrix = MatRef::from_column_major_slice(&matrix[..n * n], n, n);
    let times = |x: &[f64]| {
        let mut product = vec![0.0; n];
        let to = MatMut::from_column_major_slice_mut(&mut product, n, 1);
        let x = MatRef::from_column_major_slice(x, n, 1);
        matmul::matmul(to, Accum::Replace, matrix, x, 1.0, Par::Seq);
        product
    };
    let enough = EXACT * EXACT * dot(y, y);
    let mut solution = approximate(y);
    let mut rest: Vec<f64> = y.iter().zip(times(&solution)).map(|(y, ax)| y - ax).collect();
    let mut direction = approximate(&rest);
    let mut fit = dot(&rest, &direction);
    for _ in 0..MOST_PRODUCTS {
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
        for i in 0..80 {
            let kernel = |j: usize| (-0.5 * (row[i] - row[j]).powi(2)).exp();
            let product = (0..80).map(|j| kernel(j) * solution[j]).sum::<f64>() + 0.5 * solution[i];
            assert!((product - y[i]).abs() < 1e-8);
        }
        assert!(solve(&inputs, Theta { l: 0.3, s: 1e-9 }, &y, <[f64]>::to_vec).is_none());
    }
}
