//! The correlation matrix of all lagged variables of a run.

use crate::{
    numeric::rows::{dot, is_constant, standardize},
    types::{Error, Node, Result, Samples},
};

/// Most entries that the matrix of a run may have (1 GB).
const MAX_ENTRIES: usize = 1 << 27;

/// What is below this share of a variable is what rounding leaves of it.
pub(super) const ROUNDING: f64 = 1e-10;

/// Correlations of all lagged variables of a run, over its samples.
///
/// Lagged covariances share most of their sums. `sum_t x_i(t-a) x_j(t-b)` over the samples is a core that depends
/// only on `b - a`, plus a few products at both ends of each recording. So it takes `N^2 lags` sums instead of `N^2
/// lags^2`. All parts are added and none is subtracted, so an outlier at an end costs no digits.
pub(crate) struct Correlations {
    n_lags: usize,
    n_nodes: usize,
    /// `n_nodes x n_nodes`, row-major; zero rows for constants.
    r: Vec<f64>,
    constant: Vec<bool>,
}

impl Correlations {
    /// Whether the matrix of these samples stays within the limit.
    pub(crate) fn fits(samples: &Samples<'_>) -> bool {
        let n_nodes = samples.data().n_vars().saturating_mul(samples.cut_off() + 1);
        n_nodes.saturating_mul(n_nodes) <= MAX_ENTRIES
    }

    /// Correlations of the untransformed lagged variables. No value may be missing.
    pub(crate) fn lagged(samples: &Samples<'_>) -> Result<Self> {
        if samples.are_listed() {
            return Self::of_transformed(samples, |_| ());
        }
        let Sums { products, mut sums } = Sums::new(samples, &standardized_columns(samples))?;
        let n = samples.len() as f64;
        sums.iter_mut().for_each(|sum| *sum /= n);
        Ok(Self::normalized(samples.cut_off() + 1, products, &sums, n, constant_windows(samples)))
    }

    /// Correlations within recordings: the mean of each recording is taken off, which is to regress on which recording a sample is
    /// of. What leaves nothing is constant. No value may be missing, and no sample listed.
    pub(crate) fn within_recordings(samples: &Samples<'_>) -> Result<Self> {
        let mut columns = standardized_columns(samples);
        // Off whole columns first: then little is left to take off windows, and no digits are lost.
        for column in columns.iter_mut().flatten().filter(|column| !column.is_empty()) {
            for _ in 0..2 {
                let mean = column.iter().sum::<f64>() / column.len() as f64;
                column.iter_mut().for_each(|v| *v -= mean);
            }
        }
        let n_nodes = samples.data().n_vars() * (samples.cut_off() + 1);
        let mut all = vec![0.0; n_nodes * n_nodes];
        for recording in columns {
            let len = recording.first().map_or(0, |column| column.len().saturating_sub(samples.cut_off()));
            if len == 0 {
                continue;
            }
            let Sums { products, sums } = Sums::new(samples, &vec![recording])?;
            for i in 0..n_nodes {
                let mean = sums[i] / len as f64;
                for j in i..n_nodes {
                    all[i * n_nodes + j] += products[i * n_nodes + j] - mean * sums[j];
                }
            }
        }
        let n = samples.len() as f64;
        let constant = (0..n_nodes).map(|i| all[i * n_nodes + i] < ROUNDING * ROUNDING * n).collect();
        Ok(Self::normalized(samples.cut_off() + 1, all, &vec![0.0; n_nodes], n, constant))
    }

    /// Correlations of the lagged variables, each row transformed on its own: those of two lags share no sums.
    pub(crate) fn of_transformed(samples: &Samples<'_>, transform: impl Fn(&mut [f64])) -> Result<Self> {
        let n_lags = samples.cut_off() + 1;
        let mut rows = Vec::with_capacity(samples.data().n_vars() * n_lags);
        for var in 0..samples.data().n_vars() {
            for lag in 0..n_lags {
                samples.control().check_cancelled()?;
                let mut row = samples.values(Node::new(var, lag));
                transform(&mut row);
                // A constant row stays as it is; it is recognised by its equal values.
                standardize(&mut row);
                rows.push(row);
            }
        }
        Ok(Self::of_rows(&rows, n_lags))
    }

    /// A matrix whose nodes are 0, 1, ... at lag 0. None is constant.
    pub(crate) fn of_matrix(r: Vec<f64>, n_nodes: usize) -> Self {
        Self { n_lags: 1, n_nodes, r, constant: vec![false; n_nodes] }
    }

    /// Correlations of transformed rows, one per node in the order of [`Correlations::index`].
    pub(crate) fn of_rows(rows: &[Vec<f64>], n_lags: usize) -> Self {
        let n_nodes = rows.len();
        let n = rows.first().map_or(0, Vec::len) as f64;
        let means: Vec<f64> = rows.iter().map(|row| row.iter().sum::<f64>() / n).collect();
        let constant = rows.iter().map(|row| is_constant(row)).collect();
        let mut sums = vec![0.0; n_nodes * n_nodes];
        for i in 0..n_nodes {
            dots(&rows[i], &rows[i..], |k, sum| sums[i * n_nodes + i + k] = sum);
        }
        Self::normalized(n_lags, sums, &means, n, constant)
    }

    /// Turns the upper triangle of sums of products into correlations.
    fn normalized(n_lags: usize, mut r: Vec<f64>, means: &[f64], n: f64, constant: Vec<bool>) -> Self {
        let n_nodes = means.len();
        let scale: Vec<f64> = (0..n_nodes)
            .map(|i| {
                let variance = r[i * n_nodes + i] - n * means[i] * means[i];
                if constant[i] || variance <= 0.0 { 0.0 } else { 1.0 / variance.sqrt() }
            })
            .collect();
        for i in 0..n_nodes {
            for j in i..n_nodes {
                let value = (r[i * n_nodes + j] - n * means[i] * means[j]) * scale[i] * scale[j];
                r[i * n_nodes + j] = value;
                r[j * n_nodes + i] = value;
            }
            r[i * n_nodes + i] = if scale[i] == 0.0 { 0.0 } else { 1.0 };
        }
        Self { n_lags, n_nodes, r, constant: scale.iter().map(|&s| s == 0.0).collect() }
    }

    /// Row of a node.
    pub(crate) fn index(&self, node: Node) -> Result<usize> {
        if node.lag >= self.n_lags {
            return Err(Error::param("tau_max", format!("lag {} is beyond the samples' cut-off", node.lag)));
        }
        Ok(node.var * self.n_lags + node.lag)
    }

    /// Whether a node is constant.
    pub(crate) fn is_constant(&self, index: usize) -> bool {
        self.constant[index]
    }

    /// Puts the indices of the nodes that vary into a list.
    pub(crate) fn varying(&self, nodes: &[Node], indices: &mut Vec<usize>) -> Result<()> {
        indices.clear();
        for &node in nodes {
            let index = self.index(node)?;
            if !self.is_constant(index) {
                indices.push(index);
            }
        }
        Ok(())
    }

    /// Correlations of one node with all nodes.
    pub(crate) fn row(&self, index: usize) -> &[f64] {
        &self.r[index * self.n_nodes..(index + 1) * self.n_nodes]
    }
}

/// Sums of products of `a` with each row, passed to `put(k, sum)`. Four rows at a time share the loads of `a`.
pub(super) fn dots<R: AsRef<[f64]>>(a: &[f64], rows: &[R], mut put: impl FnMut(usize, f64)) {
    let (fours, rest) = rows.as_chunks::<4>();
    for (k, four) in fours.iter().enumerate() {
        let sums = dot4(a, four.each_ref().map(|row| row.as_ref()));
        sums.iter().enumerate().for_each(|(m, &sum)| put(4 * k + m, sum));
    }
    rest.iter().enumerate().for_each(|(m, row)| put(4 * fours.len() + m, dot(a, row.as_ref())));
}

fn dot4(a: &[f64], rows: [&[f64]; 4]) -> [f64; 4] {
    let mut lanes = [[0.0; 2]; 4];
    let (a2, a_rest) = a.as_chunks::<2>();
    let [r0, r1, r2, r3] = rows.map(|row| row[..a.len()].as_chunks::<2>().0);
    for ((((x, y0), y1), y2), y3) in a2.iter().zip(r0).zip(r1).zip(r2).zip(r3) {
        for k in 0..2 {
            lanes[0][k] += x[k] * y0[k];
            lanes[1][k] += x[k] * y1[k];
            lanes[2][k] += x[k] * y2[k];
            lanes[3][k] += x[k] * y3[k];
        }
    }
    let mut sums = lanes.map(|l| l[0] + l[1]);
    if let [last] = a_rest {
        sums.iter_mut().zip(rows).for_each(|(sum, row)| *sum += last * row[a.len() - 1]);
    }
    sums
}

/// Columns of each recording, `[recording][var][t]`.
pub(super) type Columns = Vec<Vec<Vec<f64>>>;

/// Sums over the samples of a run.
pub(super) struct Sums {
    /// Upper triangle of the sums of products of two nodes, `n_nodes x n_nodes`, row-major.
    pub(super) products: Vec<f64>,
    /// Sum of each node.
    pub(super) sums: Vec<f64>,
}

impl Sums {
    /// Of nodes whose samples lie side by side.
    pub(super) fn of_nodes(recordings: &Columns, n_nodes: usize) -> Self {
        let mut of = Self { products: vec![0.0; n_nodes * n_nodes], sums: vec![0.0; n_nodes] };
        recordings.iter().for_each(|rows| of.add(rows));
        of
    }

    /// Adds samples of the nodes.
    pub(super) fn add(&mut self, rows: &[Vec<f64>]) {
        let n_nodes = rows.len();
        for (i, row) in rows.iter().enumerate() {
            self.sums[i] += row.iter().sum::<f64>();
            dots(row, &rows[i..], |k, sum| self.products[i * n_nodes + i + k] += sum);
        }
    }

    pub(super) fn new(samples: &Samples<'_>, columns: &Columns) -> Result<Self> {
        let (n_vars, n_lags) = (samples.data().n_vars(), samples.cut_off() + 1);
        let mut gram = Gram { n_vars, n_lags, sums: vec![0.0; (n_vars * n_lags).pow(2)] };
        let mut sums = vec![0.0; n_vars * n_lags];
        for recording in columns {
            samples.control().check_cancelled()?;
            gram.add(recording, samples.cut_off());
            for (var, column) in recording.iter().enumerate() {
                for lag in 0..n_lags {
                    if let Some(window) = window(column, n_lags - 1, lag) {
                        sums[var * n_lags + lag] += window.iter().sum::<f64>();
                    }
                }
            }
        }
        Ok(Self { products: gram.sums, sums })
    }
}

/// Each variable with mean 0 and standard deviation 1 over all recordings. Missing values stay missing.
pub(super) fn standardized_columns(samples: &Samples<'_>) -> Columns {
    let recordings = samples.data().recordings();
    let n_vars = samples.data().n_vars();
    let mut columns: Columns =
        recordings.iter().map(|r| (0..n_vars).map(|var| r.column(var).to_vec()).collect()).collect();
    for var in 0..n_vars {
        let sum_of = |columns: &Columns, f: fn(f64) -> f64| {
            columns.iter().flat_map(|r| &r[var]).filter(|v| !v.is_nan()).map(|&v| f(v)).sum::<f64>()
        };
        let count = sum_of(&columns, |_| 1.0);
        for _ in 0..2 {
            let mean = sum_of(&columns, |v| v) / count;
            columns.iter_mut().flat_map(|r| &mut r[var]).for_each(|v| *v -= mean);
        }
        let largest = columns.iter().flat_map(|r| &r[var]).fold(0.0_f64, |m, v| m.max(v.abs()));
        if largest > 0.0 {
            columns.iter_mut().flat_map(|r| &mut r[var]).for_each(|v| *v /= largest);
            let deviation = (sum_of(&columns, |v| v * v) / count).sqrt();
            columns.iter_mut().flat_map(|r| &mut r[var]).for_each(|v| *v /= deviation);
        }
    }
    columns
}

/// The values of a column at `t - lag` for the samples `t = cut_off..T`.
pub(super) fn window(column: &[f64], cut_off: usize, lag: usize) -> Option<&[f64]> {
    (column.len() > cut_off).then(|| &column[cut_off - lag..column.len() - lag])
}

/// For each node: whether it is constant over the windows of all recordings.
fn constant_windows(samples: &Samples<'_>) -> Vec<bool> {
    let cut_off = samples.cut_off();
    let recordings = samples.data().recordings();
    let mut constant = Vec::with_capacity(samples.data().n_vars() * (cut_off + 1));
    for var in 0..samples.data().n_vars() {
        for lag in 0..=cut_off {
            let mut values = recordings.iter().filter(|r| r.nrows() > cut_off).flat_map(|r| {
                let (start, end) = (cut_off - lag, r.nrows() - lag);
                (start..end).map(move |t| r[[t, var]])
            });
            let first = values.next();
            constant.push(first.is_none_or(|first| values.all(|v| v == first)));
        }
    }
    constant
}

/// Upper triangle (by node index, see below) of the sums of products of lagged variables.
struct Gram {
    n_vars: usize,
    n_lags: usize,
    sums: Vec<f64>,
}

impl Gram {
    /// Adds one recording, `columns[var][t]`, samples `cut_off..T`.
    fn add(&mut self, columns: &[Vec<f64>], cut_off: usize) {
        let len = columns.first().map_or(0, Vec::len);
        if len <= cut_off {
            return;
        }
        // The core `u = cut_off .. len - cut_off` is in the window of every lag.
        if len < 2 * cut_off + 1 {
            return self.add_short(columns, cut_off);
        }
        let (start, end) = (cut_off, len - cut_off);
        let n_lags = self.n_lags;
        for i in 0..self.n_vars {
            for d in 0..n_lags {
                let older: Vec<&[f64]> = columns.iter().map(|c| &c[start - d..end - d]).collect();
                let first = if d == 0 { i } else { 0 };
                dots(&columns[i][start..end], &older[first..], |k, core| {
                    self.add_diagonal(columns, cut_off, (i, first + k, d), core);
                });
            }
        }
    }

    /// Adds `x_i(t-a) x_j(t-a-d)` for all `a`, given the sum over the core.
    fn add_diagonal(
        &mut self,
        columns: &[Vec<f64>],
        cut_off: usize,
        (i, j, d): (usize, usize, usize),
        core: f64,
    ) {
        let (x, y) = (&columns[i], &columns[j]);
        let len = x.len();
        let last = cut_off - d;
        // Tail of a: u = len - cut_off .. len - a, the longest for a = 0.
        let mut tail = 0.0;
        for u in len - cut_off..len - last {
            tail += x[u] * y[u - d];
        }
        for a in (0..=last).rev() {
            self.put((i, a), (j, a + d), tail);
            if a > 0 {
                let u = len - a;
                tail += x[u] * y[u - d];
            }
        }
        let mut head = core;
        for a in 0..=last {
            if a > 0 {
                let u = cut_off - a;
                head += x[u] * y[u - d];
            }
            self.put((i, a), (j, a + d), head);
        }
    }

    /// For a recording with fewer samples than lags: the sums one by one.
    fn add_short(&mut self, columns: &[Vec<f64>], cut_off: usize) {
        for i in 0..self.n_vars {
            for j in 0..self.n_vars {
                for a in 0..self.n_lags {
                    for b in a..self.n_lags {
                        if a == b && j < i {
                            continue;
                        }
                        if let (Some(x), Some(y)) =
                            (window(&columns[i], cut_off, a), window(&columns[j], cut_off, b))
                        {
                            self.put((i, a), (j, b), dot(x, y));
                        }
                    }
                }
            }
        }
    }

    fn put(&mut self, (i, a): (usize, usize), (j, b): (usize, usize), value: f64) {
        let (x, y) = (i * self.n_lags + a, j * self.n_lags + b);
        let (low, high) = if x <= y { (x, y) } else { (y, x) };
        self.sums[low * self.n_vars * self.n_lags + high] += value;
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;
    use proptest::prelude::*;

    use super::*;
    use crate::{numeric::random::Rng, types::DataFrame};

    /// Correlations computed directly from their definition.
    fn by_definition(samples: &Samples<'_>, x: Node, y: Node) -> f64 {
        let mut arrays = samples.arrays(x, y, &[]);
        if !standardize(&mut arrays.x) || !standardize(&mut arrays.y) {
            return 0.0;
        }
        arrays.x.iter().zip(&arrays.y).map(|(a, b)| a * b).sum()
    }

    proptest! {
        #[test]
        fn shared_sums_give_the_correlations_of_the_definition(
            lengths in prop::collection::vec(1_usize..40, 1..4),
            n_vars in 1_usize..4,
            cut_off in 0_usize..7,
            seed in any::<u64>(),
        ) {
            let mut rng = Rng::new(seed);
            let mut next = || rng.unit() - 0.3;
            let recordings: Vec<_> =
                lengths.iter().map(|&len| Array2::from_shape_simple_fn((len, n_vars), &mut next)).collect();
            let names = (0..n_vars).map(|v| format!("X{v}")).collect();
            let data = DataFrame::new(recordings, names).unwrap();
            let samples = Samples::new(&data, cut_off);
            prop_assume!(samples.len() > 2);
            let correlations = Correlations::lagged(&samples).unwrap();
            let nodes: Vec<Node> =
                (0..n_vars).flat_map(|v| (0..=cut_off).map(move |lag| Node::new(v, lag))).collect();
            for &x in &nodes {
                for &y in &nodes {
                    let ours = correlations.row(correlations.index(x).unwrap())[correlations.index(y).unwrap()];
                    let theirs = by_definition(&samples, x, y);
                    prop_assert!((ours - theirs).abs() < 1e-12, "{x:?} {y:?} {ours} {theirs}");
                }
            }
        }
    }
}
