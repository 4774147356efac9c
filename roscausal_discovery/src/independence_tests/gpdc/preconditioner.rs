//! A system near `K + s I` that is quick to solve: the factor of low rank, and what it leaves on the diagonal.

use faer::{MatMut, MatRef};

use super::{
    blocks::{solve, whole},
    buffer::Buffer,
    incomplete::Incomplete,
    low_rank::symmetric_product,
    real::{add_columns, products_with_columns},
    theta::Theta,
};

/// `L L' + D` with `D = diag(E) + s I` for `K = L L' + E` (Snelson and Ghahramani 2006 approximate a Gaussian process so): solved through
/// `M = I + L' D^-1 L`. Where the rank is as high as the matrix asks for, it is `K + s I`; where the length scale is
/// so short that no sample is near another, too.
pub(super) struct Preconditioner {
    /// `D^-1/2 L`, `n x r`.
    factor: Buffer,
    rank: usize,
    /// `D^-1/2`.
    roots: Vec<f64>,
    /// Cholesky factor of `M`.
    inner: Buffer,
}

impl Preconditioner {
    /// From a factor of the kernel matrix; `None` where `M` is not positive definite in double precision.
    pub(super) fn new(factor: Incomplete<f64>, theta: Theta) -> Option<Self> {
        let (rank, left) = (factor.rank(), &factor.remainder);
        let roots: Vec<f64> = left.iter().map(|left| 1.0 / (left.max(0.0) + theta.s).sqrt()).collect();
        let n = roots.len();
        let mut factor = factor.columns;
        for column in factor[..n * rank].chunks_exact_mut(n) {
            column.iter_mut().zip(&roots).for_each(|(value, root)| *value *= root);
        }
        let mut inner = symmetric_product(&factor[..n * rank], rank);
        inner.iter_mut().step_by(rank + 1).for_each(|d| *d += 1.0);
        whole(MatMut::from_column_major_slice_mut(&mut inner[..], rank, rank))?;
        Some(Self { factor, rank, roots, inner })
    }

    /// `(L L' + D)^-1 y`.
    pub(super) fn solve(&self, y: &[f64]) -> Vec<f64> {
        let factor = &self.factor[..y.len() * self.rank];
        let half: Vec<f64> = y.iter().zip(&self.roots).map(|(y, root)| y * root).collect();
        let mut weights = products_with_columns(factor, &half);
        let inner = MatRef::from_column_major_slice(&self.inner[..], self.rank, self.rank);
        solve(inner, &mut weights);
        let mut fitted = vec![0.0; y.len()];
        add_columns(&mut fitted, factor, &weights);
        let left = half.iter().zip(&fitted).map(|(half, fitted)| half - fitted);
        left.zip(&self.roots).map(|(left, root)| left * root).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::{
        super::{kernel::Inputs, refine},
        *,
    };

    fn row(n: u32, by: f64) -> Vec<f64> {
        (0..n).map(|i| (by * f64::from(i)).sin() * 1.7).collect()
    }

    /// By conjugate gradients with hardly any steps: it is the matrix itself.
    #[test]
    fn at_full_rank_and_where_no_sample_is_near_another_it_is_the_matrix() {
        let (rows, y) = ([row(90, 1.3), row(90, 0.7)], row(90, 2.9));
        let inputs = Inputs::new(&rows);
        for theta in [Theta { l: 2.0, s: 0.1 }, Theta { l: 1e-4, s: 0.01 }] {
            let mut factor = Incomplete::<f64>::new(90, 60, &[]);
            factor.extend_to_rank(&inputs, theta.l, 1e-12, 60);
            assert!(factor.rank() <= 60 + 16);
            let near = Preconditioner::new(factor, theta).unwrap().solve(&y);
            let exact = refine::solve_by_rows(&inputs, theta, &y, <[f64]>::to_vec).unwrap();
            for (near, exact) in near.iter().zip(&exact) {
                assert!((near - exact).abs() < 1e-5 * (1.0 + exact.abs()), "{near} {exact}");
            }
        }
    }
}
