//! The Gaussian estimator: linear dependence, with exact null distributions.

use ndarray::{Array2, ArrayView2, s};

use super::{estimator::Estimator, window::Window};
use crate::{numeric::special::chi_squared_sf, types::Node};

/// A variable adds nothing if the condition set leaves less than this fraction of its variance.
const COLLINEAR: f64 = 1e-13;

/// Gaussian conditional mutual information from one correlation matrix of the lagged variables: `CMI = 1/2
/// ln(|S_xz| |S_yz| / (|S_z| |S_xyz|))`, in nats. No test passes over the samples.
///
/// Under independence `2 n CMI` is chi-squared with one degree of freedom per source (Barnett and Bossomaier 2012,
/// doi:10.1103/PhysRevLett.109.138105). Surrogates of the hierarchical tests would be independent draws from it.
/// Their order statistics have closed forms, which are used here: the p-values are those of infinitely many
/// surrogates.
pub(super) struct Gaussian {
    correlation: Array2<f64>,
    n_vars: usize,
    n_samples: usize,
}

impl Gaussian {
    /// The correlation matrix of all variables at lags `0..=max_lag` over the window's samples.
    pub(super) fn new(window: &Window) -> Self {
        const CHUNK: usize = 2048;
        let (n_vars, times) = (window.n_vars(), &window.times);
        let n_cols = n_vars * (window.max_lag + 1);
        let node = |col: usize| Node::new(col % n_vars, col / n_vars);
        let n = times.len() as f64;
        let mean: Vec<f64> = (0..n_cols)
            .map(|col| times.iter().map(|&at| window.value(at, node(col))).sum::<f64>() / n)
            .collect();
        let mut gram = Array2::<f64>::zeros((n_cols, n_cols));
        for chunk in times.chunks(CHUNK) {
            let rows = Array2::from_shape_fn((chunk.len(), n_cols), |(row, col)| {
                window.value(chunk[row], node(col)) - mean[col]
            });
            gram += &rows.t().dot(&rows);
        }
        Self { correlation: normalised(gram.view()), n_vars, n_samples: times.len() }
    }

    fn index(&self, node: Node) -> usize {
        node.lag * self.n_vars + node.var
    }

    /// P(2 n CMI >= 2 n `value`) for one source that is independent of the target.
    fn p_of_one(&self, value: f64) -> f64 {
        chi_squared_sf(2.0 * self.n_samples as f64 * value, 1)
    }

    /// Lower Cholesky factor of the correlations of `nodes`, in their order. A node that is determined by earlier
    /// ones gets a zero column, which drops it.
    fn factor(&self, nodes: impl Iterator<Item = Node>) -> Array2<f64> {
        let index: Vec<usize> = nodes.map(|node| self.index(node)).collect();
        let m = index.len();
        let mut l = Array2::from_shape_fn((m, m), |(i, j)| self.correlation[[index[i], index[j]]]);
        for k in 0..m {
            let pivot = l[[k, k]] - l.slice(s![k, ..k]).iter().map(|v| v * v).sum::<f64>();
            let root = if pivot > COLLINEAR { pivot.sqrt() } else { 0.0 };
            l[[k, k]] = root;
            for i in k + 1..m {
                let rest = l[[i, k]] - l.slice(s![i, ..k]).dot(&l.slice(s![k, ..k]));
                l[[i, k]] = if root > 0.0 { rest / root } else { 0.0 };
            }
        }
        l
    }
}

impl Estimator for Gaussian {
    fn cmi(&self, target: Node, sources: &[Node], z: &[Node]) -> f64 {
        let order = z.iter().chain(sources).copied().chain(std::iter::once(target));
        let l = self.factor(order);
        let last = l.nrows() - 1;
        let explained = l.slice(s![last, z.len()..last]).iter().map(|v| v * v).sum::<f64>();
        // If the sources determine the target, its information is unbounded; f64 rounding bounds it.
        let left = l[[last, last]].powi(2).max(f64::EPSILON * explained);
        if explained > 0.0 { 0.5 * libm::log1p(explained / left) } else { 0.0 }
    }

    fn cmi_of_each(&self, target: Node, candidates: &[Node], z: &[Node]) -> Vec<f64> {
        // One factorisation of [z, target]; each candidate then needs one forward substitution.
        let l = self.factor(z.iter().copied().chain(std::iter::once(target)));
        let (m, t) = (z.len(), z.len());
        let z_index: Vec<usize> = z.iter().chain([&target]).map(|&node| self.index(node)).collect();
        let one = |candidate: Node| {
            let c = self.index(candidate);
            let mut w = vec![0.0; m + 1];
            for k in 0..=m {
                let rest =
                    self.correlation[[c, z_index[k]]] - (0..k.min(m)).map(|i| l[[k, i]] * w[i]).sum::<f64>();
                // The last entry is the partial covariance with the target, not yet divided.
                w[k] = if k == m {
                    rest
                } else if l[[k, k]] > 0.0 {
                    rest / l[[k, k]]
                } else {
                    0.0
                };
            }
            let variance = self.correlation[[c, c]] - w[..m].iter().map(|v| v * v).sum::<f64>();
            let target_variance = l[[t, t]].powi(2);
            if variance <= COLLINEAR || target_variance <= 0.0 {
                return 0.0;
            }
            let r2 = (w[m] * w[m] / (variance * target_variance)).min(1.0 - f64::EPSILON);
            -0.5 * libm::log1p(-r2)
        };
        candidates.iter().map(|&candidate| one(candidate)).collect()
    }

    fn p_max(&self, value: f64, _target: Node, candidates: &[Node], _z: &[Node]) -> f64 {
        -libm::expm1(candidates.len() as f64 * libm::log1p(-self.p_of_one(value)))
    }

    fn p_min(&self, value: f64, _target: Node, sources: &[Node], _past: &[Node]) -> f64 {
        libm::pow(self.p_of_one(value), sources.len() as f64)
    }

    fn p_joint(&self, value: f64, _target: Node, sources: &[Node], _z: &[Node]) -> f64 {
        chi_squared_sf(2.0 * self.n_samples as f64 * value, sources.len())
    }

    fn p_sequential(&self, values: &[f64], _target: Node, _sources: &[Node], _past: &[Node]) -> Vec<f64> {
        let ranked = values.iter().enumerate();
        ranked.map(|(k, &v)| p_of_order_statistic(self.p_of_one(v), k + 1, values.len())).collect()
    }
}

/// P(the `rank`-th largest of `m` independent draws >= v), where each draw is >= v with probability `p`: the
/// binomial tail from `rank`.
fn p_of_order_statistic(p: f64, rank: usize, m: usize) -> f64 {
    if p <= 0.0 {
        return 0.0;
    }
    if p >= 1.0 {
        return 1.0;
    }
    let ln_binomial = |j: f64| {
        let m = m as f64;
        libm::lgamma(m + 1.0) - libm::lgamma(j + 1.0) - libm::lgamma(m - j + 1.0)
    };
    let term = |j: usize| {
        let j = j as f64;
        libm::exp(ln_binomial(j) + j * libm::log(p) + (m as f64 - j) * libm::log1p(-p))
    };
    (rank..=m).map(term).sum::<f64>().min(1.0)
}

/// Correlations from a Gram matrix of centred columns; a constant column has only zeros.
fn normalised(gram: ArrayView2<f64>) -> Array2<f64> {
    let scale: Vec<f64> = gram.diag().iter().map(|v| if *v > 0.0 { v.sqrt().recip() } else { 0.0 }).collect();
    Array2::from_shape_fn(gram.dim(), |(i, j)| gram[[i, j]] * scale[i] * scale[j])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(correlation: Array2<f64>) -> Gaussian {
        Gaussian { n_vars: correlation.nrows(), correlation, n_samples: 100 }
    }

    fn node(var: usize) -> Node {
        Node::new(var, 0)
    }

    #[test]
    fn information_of_a_known_covariance() {
        let g = of(ndarray::arr2(&[[1.0, 0.6, 0.3], [0.6, 1.0, 0.5], [0.3, 0.5, 1.0]]));
        let mutual = -0.5 * (1.0_f64 - 0.36).ln();
        assert!((g.cmi(node(0), &[node(1)], &[]) - mutual).abs() < 1e-15);
        // Partial correlation r_01.2.
        let r = (0.6 - 0.3 * 0.5) / ((1.0_f64 - 0.09) * (1.0 - 0.25)).sqrt();
        let conditional = -0.5 * (1.0 - r * r).ln();
        assert!((g.cmi(node(0), &[node(1)], &[node(2)]) - conditional).abs() < 1e-15);
        assert!((g.cmi_of_each(node(0), &[node(1)], &[node(2)])[0] - conditional).abs() < 1e-15);
    }

    #[test]
    fn information_obeys_the_chain_rule() {
        let g = of(ndarray::arr2(&[
            [1.0, 0.6, 0.3, 0.1],
            [0.6, 1.0, 0.5, -0.2],
            [0.3, 0.5, 1.0, 0.4],
            [0.1, -0.2, 0.4, 1.0],
        ]));
        let both = g.cmi(node(0), &[node(1), node(2)], &[node(3)]);
        let steps = g.cmi(node(0), &[node(1)], &[node(3)]) + g.cmi(node(0), &[node(2)], &[node(3), node(1)]);
        assert!((both - steps).abs() < 1e-14);
    }

    #[test]
    fn copies_and_constants_carry_no_information_given_the_original() {
        let copy = of(ndarray::arr2(&[[1.0, 0.6, 0.6], [0.6, 1.0, 1.0], [0.6, 1.0, 1.0]]));
        assert_eq!(copy.cmi(node(0), &[node(1)], &[node(2)]), 0.0);
        assert_eq!(copy.cmi_of_each(node(0), &[node(1)], &[node(2)]), [0.0]);
        let constant = of(ndarray::arr2(&[[1.0, 0.0], [0.0, 0.0]]));
        assert_eq!(constant.cmi(node(0), &[node(1)], &[]), 0.0);
        assert_eq!(constant.cmi(node(1), &[node(0)], &[]), 0.0);
        let determined = copy.cmi(node(1), &[node(2)], &[]);
        assert!(determined.is_finite() && determined > 10.0);
    }

    #[test]
    fn order_statistics_meet_their_special_cases() {
        for p in [1e-9_f64, 0.03, 0.4, 0.99] {
            let max = 1.0 - (1.0 - p).powi(5);
            assert!((p_of_order_statistic(p, 1, 5) - max).abs() < 1e-12 * max.max(1e-9) + 1e-15);
            assert!((p_of_order_statistic(p, 5, 5) - p.powi(5)).abs() < 1e-12);
        }
    }
}
