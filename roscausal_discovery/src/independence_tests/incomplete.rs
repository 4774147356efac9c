//! Correlations of data with missing values, where each test has samples of its own.
//!
//! A test leaves out the samples in which one of its nodes is missing. Its sums of products are those of all samples, in which a
//! missing value counts as 0, minus those of the samples left out:
//!
//! 1. Once per run: the sums of all pairs of nodes, and a bit per node and sample that says what is missing.
//! 2. Per test: the bits of its nodes together are the samples left out.
//! 3. If these are fewer than half, their products are subtracted; otherwise the products of the others are added up.
//!
//! Example: one empty cell in 40,000 rows makes a test subtract the products of one sample. Nothing else is read.
//!
//! A difference of large sums loses digits. Where less than a thousandth of a node's sum of squares is left, the samples are
//! added up; where even that fails, the answer is `None`, and the test works on the samples themselves.

use super::gram::{Columns, Correlations, Sums, standardized_columns, window};
use crate::types::{Node, Result, Samples};

/// Smallest fraction of a sum of squares that may be left.
const SMALLEST_PART: f64 = 1e-3;
/// Samples that are gathered at a time.
const BLOCK: usize = 512;

/// The sums of a run.
pub(super) struct Incomplete {
    cut_off: usize,
    n_samples: usize,
    /// Standardised, with 0 for what is missing: one per variable, or one per node where the samples are listed.
    columns: Columns,
    listed: bool,
    all: Sums,
    /// Which samples lack a node: bits by recording, node and sample.
    missing: Vec<Vec<Vec<u64>>>,
}

/// The correlations of one test's nodes, in the order of the question.
pub(super) struct Answer {
    pub(super) correlations: Correlations,
    pub(super) n_samples: usize,
    pub(super) n_lost: usize,
}

impl Incomplete {
    pub(super) fn new(samples: &Samples<'_>) -> Result<Self> {
        let (cut_off, listed) = (samples.cut_off(), samples.are_listed());
        let mut columns = standardized_columns(samples);
        if listed {
            columns = at_listed_times(samples, &columns);
        }
        let n_nodes = samples.data().n_vars() * (cut_off + 1);
        let mut sums = Self {
            cut_off,
            n_samples: samples.len(),
            columns,
            listed,
            all: Sums::of_nodes(&Vec::new(), n_nodes),
            missing: Vec::new(),
        };
        let nodes = || (0..n_nodes).map(|i| Node::new(i / (cut_off + 1), i % (cut_off + 1)));
        let bits = |k, node| sums.window(k, node).map(missing_bits).unwrap_or_default();
        let of_recording = |k| nodes().map(|node| bits(k, node)).collect();
        sums.missing = (0..sums.columns.len()).map(of_recording).collect();
        let values = sums.columns.iter_mut().flatten().flatten();
        values.filter(|value| value.is_nan()).for_each(|value| *value = 0.0);
        sums.all =
            if listed { Sums::of_nodes(&sums.columns, n_nodes) } else { Sums::new(samples, &sums.columns)? };
        Ok(sums)
    }

    /// The samples of a node in recording `k`; `None` where the recording has none.
    fn window(&self, k: usize, node: Node) -> Option<&[f64]> {
        if self.listed {
            return Some(&self.columns[k][self.index(node)]);
        }
        window(&self.columns[k][node.var], self.cut_off, node.lag)
    }

    /// The correlations of `nodes` over the samples in which none is missing; `None` if they need the samples themselves:
    /// too few are left, or a node is nearly constant in them.
    pub(super) fn correlations(&self, nodes: &[Node]) -> Option<Answer> {
        if nodes.iter().any(|node| node.lag > self.cut_off) {
            return None;
        }
        let left_out: Vec<Vec<u64>> = (0..self.columns.len()).map(|k| self.left_out(k, nodes)).collect();
        let n_lost = left_out.iter().flatten().map(|word| word.count_ones() as usize).sum::<usize>();
        let n = self.n_samples - n_lost;
        if n < 2 {
            return None;
        }
        let by_difference = || {
            let all = self.all_sums(nodes);
            all.minus(&self.sum(nodes, &left_out, true)).normalized(n, &all)
        };
        let by_sum = || {
            let part = self.sum(nodes, &left_out, false);
            part.normalized(n, &part)
        };
        let r = if 2 * n_lost <= self.n_samples { by_difference().or_else(by_sum) } else { by_sum() }?;
        Some(Answer { correlations: Correlations::of_matrix(r, nodes.len()), n_samples: n, n_lost })
    }

    fn index(&self, node: Node) -> usize {
        node.var * (self.cut_off + 1) + node.lag
    }

    /// The samples of recording `k` in which one of the nodes is missing.
    fn left_out(&self, k: usize, nodes: &[Node]) -> Vec<u64> {
        let of = |node: &Node| &self.missing[k][self.index(*node)];
        let mut together = nodes.first().map(of).cloned().unwrap_or_default();
        for node in &nodes[1..] {
            together.iter_mut().zip(of(node)).for_each(|(all, one)| *all |= one);
        }
        together
    }

    fn all_sums(&self, nodes: &[Node]) -> Sums {
        let n_nodes = self.all.sums.len();
        let at: Vec<usize> = nodes.iter().map(|&node| self.index(node)).collect();
        let product = |a: usize, b: usize| self.all.products[at[a].min(at[b]) * n_nodes + at[a].max(at[b])];
        let k = nodes.len();
        let products = (0..k * k).map(|ab| if ab / k <= ab % k { product(ab / k, ab % k) } else { 0.0 });
        Sums { products: products.collect(), sums: at.iter().map(|&a| self.all.sums[a]).collect() }
    }

    /// Sums over the samples whose bit is `set`.
    fn sum(&self, nodes: &[Node], bits: &[Vec<u64>], set: bool) -> Sums {
        let k = nodes.len();
        let mut part = Sums::of_nodes(&Vec::new(), k);
        let mut rows = vec![Vec::with_capacity(BLOCK); k];
        for (recording, bits) in bits.iter().enumerate() {
            let windows: Option<Vec<&[f64]>> =
                nodes.iter().map(|&node| self.window(recording, node)).collect();
            let Some(windows) = windows else { continue };
            let len = windows.first().map_or(0, |window| window.len());
            for block in places(bits, set, len).chunks(BLOCK) {
                for (row, window) in rows.iter_mut().zip(&windows) {
                    row.clear();
                    row.extend(block.iter().map(|&t| window[t]));
                }
                part.add(&rows);
            }
        }
        part
    }
}

/// The columns of all nodes at the listed times, from those of the variables.
fn at_listed_times(samples: &Samples<'_>, columns: &Columns) -> Columns {
    let of_recording = |(k, columns): (usize, &Vec<Vec<f64>>)| {
        let times = samples.times_in(k);
        let at = |column: &[f64], lag: usize| times.iter().map(|&t| column[t - lag]).collect();
        let lags = |column| (0..=samples.cut_off()).map(move |lag| at(column, lag));
        columns.iter().flat_map(|column| lags(column)).collect()
    };
    columns.iter().enumerate().map(of_recording).collect()
}

impl Sums {
    fn minus(&self, other: &Self) -> Self {
        let differences = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a - b).collect();
        Self {
            products: differences(&self.products, &other.products),
            sums: differences(&self.sums, &other.sums),
        }
    }

    /// The correlations, if the variance of each node is a fair part of its sum of squares in `of`.
    fn normalized(&self, n: usize, of: &Self) -> Option<Vec<f64>> {
        let (k, n) = (self.sums.len(), n as f64);
        let covariance = |a: usize, b: usize| self.products[a * k + b] - self.sums[a] * self.sums[b] / n;
        let large_enough = |a: usize| covariance(a, a) > SMALLEST_PART * of.products[a * k + a];
        if !(0..k).all(large_enough) {
            return None;
        }
        let scale: Vec<f64> = (0..k).map(|a| covariance(a, a).sqrt()).collect();
        let mut r = vec![1.0; k * k];
        for a in 0..k {
            for b in a + 1..k {
                r[a * k + b] = covariance(a, b) / (scale[a] * scale[b]);
                r[b * k + a] = r[a * k + b];
            }
        }
        Some(r)
    }
}

/// The places below `len` whose bit is `set`.
fn places(bits: &[u64], set: bool, len: usize) -> Vec<usize> {
    let mut places = Vec::with_capacity(len);
    for (k, &word) in bits.iter().enumerate() {
        let mut word = if set { word } else { !word };
        while word != 0 {
            places.push(64 * k + word.trailing_zeros() as usize);
            word &= word - 1;
        }
    }
    // The last word may have more bits than there are samples.
    places.truncate(places.partition_point(|&place| place < len));
    places
}

/// A bit per value: whether it is missing.
fn missing_bits(window: &[f64]) -> Vec<u64> {
    let word =
        |values: &[f64]| values.iter().rev().fold(0, |word, value| word << 1 | u64::from(value.is_nan()));
    window.chunks(64).map(word).collect()
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;
    use proptest::prelude::*;

    use super::*;
    use crate::{
        numeric::{
            random::Rng,
            rows::{dot, standardize},
        },
        types::DataFrame,
    };

    proptest! {
        #[test]
        fn the_correlations_are_those_of_the_samples_in_which_nothing_is_missing(
            lengths in prop::collection::vec(1_usize..150, 1..4),
            cut_off in 0_usize..4,
            rate in 0.0_f64..0.5,
            outlier in any::<bool>(),
            seed in any::<u64>(),
        ) {
            let mut rng = Rng::new(seed);
            let mut next = || if rng.unit() < rate { f64::NAN } else { rng.unit() - 0.3 };
            let mut recordings: Vec<_> =
                lengths.iter().map(|&len| Array2::from_shape_simple_fn((len, 3), &mut next)).collect();
            if outlier {
                recordings[0][[0, 0]] = 1e9;
            }
            let data = DataFrame::new(recordings, ["a", "b", "c"].map(str::to_owned).to_vec()).unwrap();
            let samples = Samples::new(&data, cut_off);
            prop_assume!(samples.len() > 2);
            let nodes = [Node::new(0, cut_off), Node::new(1, 0), Node::new(2, cut_off / 2), Node::new(0, 0)];
            let nodes = if cut_off == 0 { &nodes[..3] } else { &nodes[..] };
            let arrays = samples.arrays(nodes[0], nodes[1], &nodes[2..]);
            let n = arrays.x.len();
            let Some(answer) = Incomplete::new(&samples).unwrap().correlations(nodes) else { return Ok(()) };
            prop_assert_eq!((answer.n_samples, answer.n_lost), (n, arrays.n_lost));
            let mut rows: Vec<Vec<f64>> = [arrays.x, arrays.y].into_iter().chain(arrays.z).collect();
            prop_assert!(rows.iter_mut().all(|row| standardize(row)));
            for a in 0..rows.len() {
                for b in 0..rows.len() {
                    let (ours, theirs) = (answer.correlations.row(a)[b], dot(&rows[a], &rows[b]));
                    prop_assert!((ours - theirs).abs() < 1e-10, "{a} {b} {ours} {theirs}");
                }
            }
        }
    }

    #[test]
    fn an_outlier_in_a_sample_that_is_left_out_costs_no_digits() {
        let mut rng = Rng::new(3);
        let mut values = Array2::from_shape_simple_fn((200, 2), || rng.unit());
        values[[50, 0]] = 1e9;
        values[[50, 1]] = f64::NAN;
        let data = DataFrame::new(vec![values], vec!["a".into(), "b".into()]).unwrap();
        let samples = Samples::new(&data, 0);
        let (x, y) = (Node::new(0, 0), Node::new(1, 0));
        let mut arrays = samples.arrays(x, y, &[]);
        standardize(&mut arrays.x);
        standardize(&mut arrays.y);
        let theirs = dot(&arrays.x, &arrays.y);
        let ours = Incomplete::new(&samples)
            .unwrap()
            .correlations(&[x, y])
            .map(|answer| answer.correlations.row(0)[1]);
        assert!(ours.is_none_or(|ours| (ours - theirs).abs() < 1e-10), "{ours:?} {theirs}");
    }
}
