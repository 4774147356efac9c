//! The nearest-neighbour estimator: dependence of any form, with permutation surrogates.

use super::{estimator::Estimator, window::Window};
use crate::{
    independence_tests::cmiknn::Estimator as Neighbours,
    numeric::{random::Rng, rows::moments},
    types::{Control, Node},
};

/// Neighbours that set the scale (Kraskov et al. 2004 recommend 2 to 4).
const K: usize = 4;
/// Surrogates of the maximum statistic.
const N_MAX: usize = 200;
/// Surrogates of the other statistics.
const N_PERM: usize = 500;

/// Smallest p-value that the surrogates of every test can give.
pub(super) const SMALLEST_P: f64 = 1.0 / (N_MAX + 1) as f64;

/// Conditional mutual information in nats from k = 4 nearest neighbours in the maximum norm, of standardised
/// variables (Kraskov, Stoegbauer and Grassberger 2004, algorithm 1, doi:10.1103/PhysRevE.69.066138; conditional
/// form by Frenzel and Pompe 2007).
///
/// Surrogates permute the samples of a source at random; p-values are `(count + 1) / (surrogates + 1)`. All
/// surrogates of a source share the distances among target and conditions.
pub(super) struct Kraskov<'a> {
    /// Standardised samples of each variable at each lag, ordered by lag, then variable.
    columns: Vec<Vec<f64>>,
    n_vars: usize,
    seed: u64,
    control: &'a Control,
}

impl<'a> Kraskov<'a> {
    pub(super) fn new(window: &Window, seed: u64, control: &'a Control) -> Self {
        let n_vars = window.n_vars();
        let columns = (0..n_vars * (window.max_lag + 1))
            .map(|i| {
                let node = Node::new(i % n_vars, i / n_vars);
                let mut column = window.column(node);
                standardize(&mut column, &mut Rng::for_test(seed, node, node, &[]));
                column
            })
            .collect();
        Self { columns, n_vars, seed, control }
    }

    fn column(&self, node: Node) -> &[f64] {
        &self.columns[node.lag * self.n_vars + node.var]
    }

    /// Information of `sources` together, then that of `surrogates` joint permutations of them. Empty if the
    /// control stops the run; the caller asks the control.
    fn information(&self, target: Node, sources: &[Node], z: &[Node], surrogates: usize) -> Vec<f64> {
        let z_rows: Vec<Vec<f64>> = z.iter().map(|&node| self.column(node).to_vec()).collect();
        let n = self.column(target).len();
        let mut rows: Vec<Vec<f64>> = sources.iter().map(|&node| self.column(node).to_vec()).collect();
        let first = sources.first().copied().unwrap_or(target);
        let mut rng = Rng::for_test(self.seed, first, target, z);
        let mut order: Vec<usize> = (0..n).collect();
        for _ in 0..surrogates {
            rng.shuffle(&mut order);
            for (row, &source) in rows.iter_mut().zip(sources) {
                let column = self.column(source);
                row.extend(order.iter().map(|&i| column[i]));
            }
        }
        let rows: Vec<&[f64]> = rows.iter().map(Vec::as_slice).collect();
        let neighbours = Neighbours { k: K, y: &[self.column(target)], z: &z_rows, control: self.control };
        neighbours.information(&rows).unwrap_or_else(|_| vec![0.0; surrogates + 1])
    }

    /// The surrogates of each source: given `z`, and with `given_others` also given the other sources.
    fn nulls(
        &self,
        target: Node,
        sources: &[Node],
        z: &[Node],
        n: usize,
        given_others: bool,
    ) -> Vec<Vec<f64>> {
        let of = |&source: &Node| {
            let others = sources.iter().filter(|&&other| given_others && other != source);
            let z: Vec<Node> = z.iter().chain(others).copied().collect();
            self.information(target, &[source], &z, n).split_off(1)
        };
        sources.iter().map(of).collect()
    }
}

impl Estimator for Kraskov<'_> {
    fn cmi(&self, target: Node, sources: &[Node], z: &[Node]) -> f64 {
        self.information(target, sources, z, 0)[0]
    }

    fn p_max(&self, value: f64, target: Node, candidates: &[Node], z: &[Node]) -> f64 {
        let nulls = self.nulls(target, candidates, z, N_MAX, false);
        share((0..N_MAX).map(|s| nulls.iter().map(|of| of[s]).fold(f64::NEG_INFINITY, f64::max)), value)
    }

    fn p_min(&self, value: f64, target: Node, sources: &[Node], past: &[Node]) -> f64 {
        let nulls = self.nulls(target, sources, past, N_PERM, true);
        share((0..N_PERM).map(|s| nulls.iter().map(|of| of[s]).fold(f64::INFINITY, f64::min)), value)
    }

    fn p_joint(&self, value: f64, target: Node, sources: &[Node], z: &[Node]) -> f64 {
        share(self.information(target, sources, z, N_PERM).into_iter().skip(1), value)
    }

    fn p_sequential(&self, values: &[f64], target: Node, sources: &[Node], past: &[Node]) -> Vec<f64> {
        let nulls = self.nulls(target, sources, past, N_PERM, true);
        let ranked: Vec<Vec<f64>> = (0..N_PERM)
            .map(|s| {
                let mut of_surrogate: Vec<f64> = nulls.iter().map(|of| of[s]).collect();
                of_surrogate.sort_by(|a, b| b.total_cmp(a));
                of_surrogate
            })
            .collect();
        values.iter().enumerate().map(|(k, &v)| share(ranked.iter().map(|of| of[k]), v)).collect()
    }
}

/// `(count + 1) / (surrogates + 1)`, where `count` is the number of surrogates that are not below `value`.
fn share(nulls: impl Iterator<Item = f64>, value: f64) -> f64 {
    let (mut count, mut all) = (0_usize, 0_usize);
    for null in nulls {
        all += 1;
        count += usize::from(null >= value);
    }
    (count + 1) as f64 / (all + 1) as f64
}

/// Standardises to mean 0 and standard deviation 1, with noise of 1e-8 that breaks ties. A constant row becomes
/// pure noise, which carries no information.
fn standardize(row: &mut [f64], rng: &mut Rng) {
    const NOISE: f64 = 1e-8;
    let (mean, deviation) = moments(row);
    let scale = if deviation > 0.0 { deviation.recip() } else { 0.0 };
    for v in row {
        *v = (*v - mean) * scale + NOISE * (rng.unit() - 0.5);
    }
}
