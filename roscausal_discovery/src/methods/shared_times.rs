//! How many samples count where recordings are of one time, such as those of the people of one batch.
//!
//! What people share at a time (the robot's columns, and whatever moves them all) is there once for each of them. A test between a
//! column that all share and one that they share in part would take chance for a link. The variance of a regression's slope grows by
//! `1 + (m - 1) r_x r_y` where `m` samples are of one time and `r` is the correlation of two people's residuals at a time (Moulton 1986,
//! Journal of Econometrics 32:385; Kish 1965, "Survey Sampling", the design effect). So a test has as many samples as it has rows,
//! divided by that. It is 1 where people are independent in X or in Y, and `m` where both columns are the same for all.

use crate::{
    numeric::{normal::normal_scores, rows::dot},
    types::{Node, Samples},
};

/// A conditioning variable of which less than this share is left by the others adds nothing.
const ROUNDING: f64 = 1e-9;

/// The columns of recordings of one time, and their sums over these recordings.
pub(super) struct SharedTimes {
    cut_off: usize,
    vars: Vec<Var>,
}

/// One variable: its normal scores, a missing value as their mean.
struct Var {
    /// By recording.
    own: Vec<Vec<f64>>,
    /// By set of recordings of one time: the sums over them.
    sums: Vec<Vec<f64>>,
    /// Values at a time of a sample, on average.
    together: f64,
}

impl SharedTimes {
    /// `None`: no two recordings are of one time.
    pub(super) fn of(samples: &Samples<'_>) -> Option<Self> {
        let firsts = samples.data().shared_times()?;
        let recordings = samples.data().recordings();
        let var = |var: usize| {
            let values = recordings.iter().flat_map(|of| of.column(var).to_vec());
            let mut scores: Vec<f64> = values.filter(|value| !value.is_nan()).collect();
            normal_scores(&mut scores);
            let mut scores = scores.into_iter();
            let mut filled = |value: &f64| if value.is_nan() { 0.0 } else { scores.next().unwrap_or(0.0) };
            let own: Vec<Vec<f64>> =
                recordings.iter().map(|of| of.column(var).iter().map(&mut filled).collect()).collect();
            let (mut sums, mut present) = (Vec::new(), [0.0; 2]);
            for set in (0..firsts.len()).filter(|&k| firsts[k] == k) {
                let members = || (set..firsts.len()).filter(|&k| firsts[k] == set);
                let n_rows = members().map(|k| own[k].len()).max().unwrap_or(0);
                let (mut sum, mut count) = (vec![0.0; n_rows], vec![0.0_f64; n_rows]);
                for k in members() {
                    sum.iter_mut().zip(&own[k]).for_each(|(sum, value)| *sum += value);
                    let are = recordings[k].column(var);
                    count.iter_mut().zip(are).for_each(|(n, value)| *n += f64::from(!value.is_nan()));
                }
                present[0] += count.iter().sum::<f64>();
                present[1] += dot(&count, &count);
                sums.push(sum);
            }
            Var { own, sums, together: present[1] / present[0].max(1.0) }
        };
        Some(Self { cut_off: samples.cut_off(), vars: (0..samples.data().n_vars()).map(var).collect() })
    }

    /// By how much the rows of a test are to be divided; at least 1. Nodes beyond the variables, such as dummies, do not count.
    pub(super) fn effect(&self, x: Node, y: Node, z: &[Node]) -> f64 {
        let is_var = |node: &Node| node.var < self.vars.len() && node.lag <= self.cut_off;
        if !is_var(&x) || !is_var(&y) {
            return 1.0;
        }
        let z: Vec<Node> = z.iter().copied().filter(is_var).collect();
        let share = |node: Node| {
            let together = self.vars[node.var].together;
            if together > 1.0 { ((self.inflation(node, &z) - 1.0) / (together - 1.0)).min(1.0) } else { 0.0 }
        };
        let together = self.vars[x.var].together.min(self.vars[y.var].together);
        (1.0 + (together - 1.0).max(0.0) * share(x) * share(y)).max(1.0)
    }

    /// Variance of the sum of what `z` leaves of a node at a time, over that of as many independent values.
    fn inflation(&self, node: Node, z: &[Node]) -> f64 {
        // Residuals as combinations of the nodes: each of `z` given those before it, then the node given all of them.
        let nodes: Vec<Node> = z.iter().copied().chain([node]).collect();
        let product = |lists: fn(&Var) -> &Vec<Vec<f64>>, a: Node, b: Node| -> f64 {
            let [of_a, of_b] = [a, b].map(|node| lists(&self.vars[node.var]));
            let window = |list: &'_ [f64], lag: usize| {
                let from = (self.cut_off - lag).min(list.len());
                from..list.len().saturating_sub(lag).max(from)
            };
            let pairs = of_a.iter().zip(of_b);
            pairs.map(|(a_in, b_in)| dot(&a_in[window(a_in, a.lag)], &b_in[window(b_in, b.lag)])).sum()
        };
        let own: Vec<Vec<f64>> =
            nodes.iter().map(|a| nodes.iter().map(|b| product(|var| &var.own, *a, *b)).collect()).collect();
        let form = |matrix: &[Vec<f64>], a: &[f64], b: &[f64]| -> f64 {
            a.iter().zip(matrix).map(|(a, row)| a * b.iter().zip(row).map(|(b, v)| b * v).sum::<f64>()).sum()
        };
        let mut basis: Vec<(Vec<f64>, f64)> = Vec::with_capacity(nodes.len());
        let mut last = Vec::new();
        for place in 0..nodes.len() {
            let mut left = vec![0.0; nodes.len()];
            left[place] = 1.0;
            for (other, norm) in &basis {
                let along = form(&own, &left, other) / norm;
                left.iter_mut().zip(other).for_each(|(v, o)| *v -= along * o);
            }
            let norm = form(&own, &left, &left);
            if norm > ROUNDING * own[place][place] {
                basis.push((left.clone(), norm));
                last = if place + 1 == nodes.len() { left } else { last };
            }
        }
        let Some((_, norm)) = basis.last().filter(|_| !last.is_empty()) else { return 1.0 };
        let sums: Vec<Vec<f64>> =
            nodes.iter().map(|a| nodes.iter().map(|b| product(|var| &var.sums, *a, *b)).collect()).collect();
        form(&sums, &last, &last) / norm
    }
}
