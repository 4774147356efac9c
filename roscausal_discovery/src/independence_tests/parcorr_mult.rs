//! Partial correlation where a node may be a dummy: which recording, or which step, a sample is from.
//!
//! Source: Günther, Ninad and Runge 2023, UAI, "Causal discovery for time series from multiple datasets with latent contexts".
//!
//! A dummy is a vector of one column per recording (or step), 1 where a sample is from it and 0 elsewhere. The columns are never
//! built:
//!
//! 1. A dummy in Z: to regress on its columns is to subtract the mean of each recording (of each step).
//! 2. A dummy as X: each of its columns is correlated with Y, given Z. Products of such a column are sums over one recording, taken
//!    once per run. The largest correlation counts, and the p-value is multiplied by the number of columns.
//!
//! Every column takes a degree of freedom, also where a dummy is named twice, at two lags.
//!
//! Example: of two recordings one is 5 higher in `a` and `b`. Given nothing they are correlated, given the dummy they are not.

use std::sync::{Mutex, OnceLock};

use super::{
    cholesky::{Factor, correlation, orthogonalize, orthonormal_basis, residuals},
    gram::{Correlations, ROUNDING, standardized_columns, window},
};
use crate::{
    numeric::{
        rows::{dot, standardize},
        student_t::correlation_p_value,
    },
    types::{CondIndTest, Dummy, Error, LaggedArrays, Node, PreparedTest, Result, Samples, TestResult, lock},
};

/// Partial correlation for data with dummies, whose nodes come after the variables of the data.
///
/// Take it when several recordings are pooled that may differ ([`run_jpcmciplus`](crate::methods::run_jpcmciplus) does).
///
/// ```
/// use roscausal_discovery::{CondIndTest, DataFrame, Dummy, Node, Samples, independence_tests::{ParCorr, TestSettings}};
///
/// // Two recordings of independent noise that differ in their means only.
/// let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0) - 0.5;
/// let recording = |k: usize| ndarray::Array2::from_shape_fn((100, 2), |(t, v)| noise(400 * k + 2 * t + v) + 5.0 * k as f64);
/// let data = DataFrame::new(vec![recording(0), recording(1)], vec!["a".into(), "b".into()])?;
/// let samples = Samples::new(&data, 0);
/// let (a, b, which) = (Node::new(0, 0), Node::new(1, 0), Node::new(2, 0));
/// let plain = ParCorr::new(&TestSettings::default())?;
/// let test = plain.with_dummies(&[Dummy::Space])?;
/// let prepared = test.prepare(&samples)?;
/// assert!(prepared.run_test(a, b, &[])?.p_value < 1e-6);
/// assert!(prepared.run_test(a, b, &[which])?.p_value > 0.05);
/// assert!(prepared.run_test(which, b, &[])?.p_value < 1e-6);
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
pub(super) struct ParCorrMult<'p> {
    /// The test of variables alone.
    plain: &'p dyn CondIndTest,
    dummies: Vec<Dummy>,
}

impl<'p> ParCorrMult<'p> {
    /// The test that answers as `plain`, partial correlation, where no dummy is asked about. Dummies are in the order of their
    /// nodes.
    pub(super) fn new(plain: &'p dyn CondIndTest, dummies: &[Dummy]) -> Self {
        Self { plain, dummies: dummies.to_vec() }
    }
}

impl CondIndTest for ParCorrMult<'_> {
    fn name(&self) -> &'static str {
        "parcorr"
    }

    fn is_linear(&self) -> bool {
        true
    }

    fn prepare<'a>(&'a self, samples: &'a Samples<'a>) -> Result<Box<dyn PreparedTest + 'a>> {
        let lengths: Vec<usize> = samples.data().recordings().iter().map(|r| r.nrows()).collect();
        let longest = lengths.iter().copied().max().unwrap_or(0);
        Error::ensure_data(
            !self.dummies.contains(&Dummy::Space) || lengths.len() > 1,
            || "there is one recording, so there is nothing that recordings can differ in; give several",
        )?;
        let are_equal = lengths.iter().all(|&n| n == longest);
        Error::ensure_data(!self.dummies.contains(&Dummy::Time) || are_equal, || {
            format!("a time dummy needs recordings of equal length on one clock; they have {lengths:?} rows")
        })?;
        Ok(Box::new(Prepared {
            plain: self.plain.prepare(samples)?,
            samples,
            dummies: &self.dummies,
            // Steps that are only the past of others are not samples.
            columns: [longest.saturating_sub(samples.cut_off()), lengths.len()],
            absorbed: Default::default(),
        }))
    }
}

/// Which dummies a regression is on: time, space.
type Absorbs = [bool; 2];

/// Place of a dummy in [`Absorbs`].
fn place(dummy: Dummy) -> usize {
    usize::from(dummy == Dummy::Space)
}

/// The test on the samples of one run.
struct Prepared<'a> {
    plain: Box<dyn PreparedTest + 'a>,
    samples: &'a Samples<'a>,
    dummies: &'a [Dummy],
    /// Columns of a dummy, by place: those that are not 0 in all samples.
    columns: [usize; 2],
    /// Correlations of the lagged variables given each set of dummies, when first asked for.
    absorbed: [OnceLock<Absorbed>; 4],
}

/// Correlations given dummies, and the factors of previous tests on them.
struct Absorbed {
    correlations: Correlations,
    /// For each dummy that is not given: what its columns leave of themselves, and their products with the lagged variables.
    columns: [Vec<Column>; 2],
    factors: Mutex<Vec<Factor>>,
}

/// A column of a dummy: 1 in the samples of one group.
struct Column {
    /// Samples of the group.
    size: f64,
    /// Sum of squares that the constant, or the other dummy, leaves of it.
    left: f64,
    /// Products with the lagged variables, which have norm 1: their sums over the group.
    products: Vec<f64>,
}

/// The rows of one test.
struct Rows {
    x: Vec<f64>,
    y: Vec<f64>,
    z: Vec<Vec<f64>>,
    n_lost: usize,
    groups: [Groups; 2],
}

/// Which column of a dummy is 1 in each sample, and in how many samples each is.
#[derive(Default)]
struct Groups {
    of_sample: Vec<usize>,
    sizes: Vec<f64>,
}

impl Groups {
    fn new(of_sample: Vec<usize>, n_groups: usize) -> Self {
        let mut sizes = vec![0.0; n_groups];
        of_sample.iter().for_each(|&group| sizes[group] += 1.0);
        Self { of_sample, sizes }
    }

    /// Sums of a row over each group.
    fn sums(&self, row: &[f64]) -> Vec<f64> {
        let mut sums = vec![0.0; self.sizes.len()];
        self.of_sample.iter().zip(row).for_each(|(&group, value)| sums[group] += value);
        sums
    }

    /// Subtracts the mean of each group. Returns the largest.
    fn centre(&self, row: &mut [f64]) -> f64 {
        let mut means = self.sums(row);
        means.iter_mut().zip(&self.sizes).for_each(|(mean, size)| *mean /= size.max(1.0));
        row.iter_mut().zip(&self.of_sample).for_each(|(value, &group)| *value -= means[group]);
        means.iter().fold(0.0, |most: f64, mean| most.max(mean.abs()))
    }
}

/// A column of a dummy of which less than this share is left is compared by the samples.
const FEW_DIGITS: f64 = 1e-6;
/// Rounds of centring by two dummies. Where all recordings are complete, the first is exact.
const MOST_ROUNDS: usize = 1000;

/// Regresses a row on dummies and scales it to norm 1; false if nothing is left of it. Then it is zero.
fn absorb(row: &mut [f64], groups: &[Groups; 2], absorbs: Absorbs) -> bool {
    if !standardize(row) {
        row.fill(0.0);
        return false;
    }
    for _ in 0..MOST_ROUNDS {
        let changes = (0..2).filter(|&k| absorbs[k]).map(|k| groups[k].centre(row));
        if changes.fold(0.0, f64::max) < 1e-15 || absorbs != [true, true] {
            break;
        }
    }
    let norm = dot(row, row).sqrt();
    if norm < ROUNDING {
        row.fill(0.0);
        return false;
    }
    // Standardised again: rounding leaves a mean.
    standardize(row)
}

/// What is left of the square of each column of a dummy, without what the constant, or the other dummy, explains.
fn left_of_columns(dummy: Dummy, groups: &[Groups; 2], absorbs: Absorbs) -> Vec<f64> {
    let (own, other) = (&groups[place(dummy)], &groups[1 - place(dummy)]);
    let n_samples = own.of_sample.len() as f64;
    if !absorbs[1 - place(dummy)] {
        return own.sizes.iter().map(|size| size - size * size / n_samples).collect();
    }
    let mut shared = vec![vec![0.0; other.sizes.len()]; own.sizes.len()];
    own.of_sample.iter().zip(&other.of_sample).for_each(|(&g, &h)| shared[g][h] += 1.0);
    let explained =
        |row: &Vec<f64>| row.iter().zip(&other.sizes).map(|(s, n)| s * s / n.max(1.0)).sum::<f64>();
    own.sizes.iter().zip(&shared).map(|(size, row)| size - explained(row)).collect()
}

/// The columns of a dummy beside the `rows` of the lagged variables, which have norm 1; none if it is given.
fn columns(dummy: Dummy, rows: &[Vec<f64>], groups: &[Groups; 2], absorbs: Absorbs) -> Vec<Column> {
    if absorbs[place(dummy)] {
        return Vec::new();
    }
    let own = &groups[place(dummy)];
    let sums: Vec<Vec<f64>> = rows.iter().map(|row| own.sums(row)).collect();
    let left = left_of_columns(dummy, groups, absorbs);
    let column = |(group, left): (usize, f64)| Column {
        size: own.sizes[group],
        left,
        products: sums.iter().map(|sums| sums[group]).collect(),
    };
    left.into_iter().enumerate().map(column).collect()
}

impl Prepared<'_> {
    /// The dummy that a node stands for.
    fn dummy(&self, node: Node) -> Option<Dummy> {
        self.dummies.get(node.var.checked_sub(self.samples.data().n_vars())?).copied()
    }

    fn columns_of(&self, node: Node) -> usize {
        self.dummy(node).map_or(1, |dummy| self.columns[place(dummy)])
    }

    /// The samples of a test with the groups that they belong to. A dummy gives no row.
    fn rows(&self, x: Node, y: Node, z: &[Node]) -> Rows {
        let (mut steps, mut recordings) = (Vec::new(), Vec::new());
        let LaggedArrays { x, y, z, n_lost } = self.samples.placed(x, y, z, |recording, step| {
            steps.push(step - self.samples.cut_off());
            recordings.push(recording);
        });
        let groups = [Groups::new(steps, self.columns[0]), Groups::new(recordings, self.columns[1])];
        Rows { x, y, z, n_lost, groups }
    }

    /// The correlations given `absorbs`, if no sample is ever left out.
    fn absorbed(&self, absorbs: Absorbs) -> Option<&Absorbed> {
        if self.samples.data().is_incomplete() || !Correlations::fits(self.samples) {
            return None;
        }
        let slot = usize::from(absorbs[0]) + 2 * usize::from(absorbs[1]);
        Some(self.absorbed[slot].get_or_init(|| {
            if let Some(Ok(quick)) = self.of_recordings(absorbs) {
                return quick;
            }
            let n_lags = self.samples.cut_off() + 1;
            let nodes =
                (0..self.samples.data().n_vars()).flat_map(|var| (0..n_lags).map(move |lag| (var, lag)));
            let groups = self.rows(Node::new(0, 0), Node::new(0, 0), &[]).groups;
            let row = |(var, lag)| {
                let mut row = self.samples.values(Node::new(var, lag));
                absorb(&mut row, &groups, absorbs);
                row
            };
            let rows: Vec<Vec<f64>> = nodes.map(row).collect();
            Absorbed {
                correlations: Correlations::of_rows(&rows, n_lags),
                columns: [Dummy::Time, Dummy::Space].map(|dummy| match self.dummies.contains(&dummy) {
                    true => columns(dummy, &rows, &groups, absorbs),
                    false => Vec::new(),
                }),
                factors: Mutex::default(),
            }
        }))
    }

    /// The same from sums that lags share, if no dummy is of time.
    fn of_recordings(&self, absorbs: Absorbs) -> Option<Result<Absorbed>> {
        if self.dummies.contains(&Dummy::Time) || self.samples.are_listed() {
            return None;
        }
        let correlations = match absorbs {
            [_, true] => Correlations::within_recordings(self.samples),
            _ => Correlations::lagged(self.samples),
        };
        let columns = [Vec::new(), if absorbs[1] { Vec::new() } else { self.columns_of_recordings() }];
        Some(correlations.map(|correlations| Absorbed { correlations, columns, factors: Mutex::default() }))
    }

    /// The columns of the dummy of recordings, by their place.
    fn columns_of_recordings(&self) -> Vec<Column> {
        let (n_lags, n) = (self.samples.cut_off() + 1, self.samples.len() as f64);
        let values = standardized_columns(self.samples);
        let size = |recording: &Vec<Vec<f64>>| {
            recording.first().map_or(0, |column| column.len().saturating_sub(n_lags - 1)) as f64
        };
        let mut columns: Vec<Column> = values
            .iter()
            .map(|recording| Column {
                size: size(recording),
                left: size(recording) - size(recording) * size(recording) / n,
                products: Vec::new(),
            })
            .collect();
        for (var, lag) in
            (0..self.samples.data().n_vars()).flat_map(|var| (0..n_lags).map(move |lag| (var, lag)))
        {
            let of = |recording: &Vec<Vec<f64>>| {
                let values = window(&recording[var], n_lags - 1, lag).unwrap_or(&[]);
                (values.iter().sum::<f64>(), dot(values, values))
            };
            let sums: Vec<(f64, f64)> = values.iter().map(of).collect();
            let mean = sums.iter().map(|sums| sums.0).sum::<f64>() / n;
            let norm = (sums.iter().map(|sums| sums.1).sum::<f64>() - n * mean * mean).max(0.0).sqrt();
            for (column, (sum, _)) in columns.iter_mut().zip(sums) {
                column.products.push(if norm > 0.0 { (sum - column.size * mean) / norm } else { 0.0 });
            }
        }
        columns
    }

    /// Two variables given dummies and variables. `None` if it takes the samples.
    fn fast(&self, x: Node, y: Node, z: &[Node], absorbs: Absorbs) -> Result<Option<f64>> {
        let Some(Absorbed { correlations: r, factors, .. }) = self.absorbed(absorbs) else { return Ok(None) };
        let (x, y) = (r.index(x)?, r.index(y)?);
        if r.is_constant(x) || r.is_constant(y) {
            return Ok(Some(0.0));
        }
        let mut others = Vec::new();
        r.varying(z, &mut others)?;
        let mut factor = lock(factors).pop().unwrap_or_default();
        let value = factor.partial_correlation(r, x, y, &others);
        lock(factors).push(factor);
        Ok(value)
    }

    /// A dummy and a variable given variables, from sums over groups. `None` if it takes the samples.
    fn fast_vector(&self, dummy: Dummy, y: Node, z: &[Node], absorbs: Absorbs) -> Result<Option<f64>> {
        let Some(Absorbed { correlations: r, columns, factors }) = self.absorbed(absorbs) else {
            return Ok(None);
        };
        let y = r.index(y)?;
        if r.is_constant(y) {
            return Ok(Some(0.0));
        }
        let mut nodes = Vec::new();
        r.varying(z, &mut nodes)?;
        nodes.push(y);
        let mut factor = lock(factors).pop().unwrap_or_default();
        let value = factor.set(r, &nodes).and_then(|()| {
            let mut value = 0.0_f64;
            for column in columns[place(dummy)].iter().filter(|column| column.size > 0.0) {
                let (of_y, of_z) =
                    factor.forward(nodes.iter().map(|&node| column.products[node])).split_last()?;
                let left = column.left - of_z.iter().map(|v| v * v).sum::<f64>();
                // Little is left: that takes more digits.
                if left < FEW_DIGITS * column.size {
                    return None;
                }
                let of_column = (of_y / left.sqrt()).clamp(-1.0, 1.0);
                if of_column.abs() > value.abs() {
                    value = of_column;
                }
            }
            Some(value)
        });
        lock(factors).push(factor);
        Ok(value)
    }

    /// Two variables given dummies and variables.
    fn scalar(&self, x: Node, y: Node, z: &[Node], absorbs: Absorbs) -> Result<(f64, usize, usize)> {
        if let Some(value) = self.fast(x, y, z, absorbs)? {
            return Ok((value, self.samples.len(), 0));
        }
        let Rows { mut x, mut y, mut z, n_lost, groups } = self.rows(x, y, z);
        let n_samples = x.len();
        let varies = absorb(&mut x, &groups, absorbs) && absorb(&mut y, &groups, absorbs);
        z.retain_mut(|row| absorb(row, &groups, absorbs));
        let value = if varies {
            let (x, y) = residuals(x, y, z);
            correlation(&x, &y)
        } else {
            0.0
        };
        Ok((value, n_samples, n_lost))
    }

    /// A dummy and a variable given variables and, it may be, the other dummy: the largest correlation of a column.
    fn vector(&self, dummy: Dummy, y: Node, z: &[Node], absorbs: Absorbs) -> Result<(f64, usize, usize)> {
        if let Some(value) = self.fast_vector(dummy, y, z, absorbs)? {
            return Ok((value, self.samples.len(), 0));
        }
        let Rows { mut y, mut z, n_lost, groups, .. } = self.rows(y, y, z);
        let n_samples = y.len();
        if n_samples < 2 || !absorb(&mut y, &groups, absorbs) {
            return Ok((0.0, n_samples, n_lost));
        }
        z.retain_mut(|row| absorb(row, &groups, absorbs));
        let basis = orthonormal_basis(z);
        if !orthogonalize(&mut y, &basis) {
            return Ok((0.0, n_samples, n_lost));
        }
        let own = &groups[place(dummy)];
        let mut left = left_of_columns(dummy, &groups, absorbs);
        for q in &basis {
            left.iter_mut().zip(own.sums(q)).for_each(|(left, sum)| *left -= sum * sum);
        }
        let norm = dot(&y, &y).sqrt();
        let mut value = 0.0_f64;
        for ((left, sum), size) in left.iter().zip(own.sums(&y)).zip(&own.sizes) {
            let of_column =
                if *left > 1e-12 * size { (sum / (left.sqrt() * norm)).clamp(-1.0, 1.0) } else { 0.0 };
            if of_column.abs() > value.abs() {
                value = of_column;
            }
        }
        Ok((value, n_samples, n_lost))
    }
}

impl PreparedTest for Prepared<'_> {
    fn run_test(&self, x: Node, y: Node, z: &[Node]) -> Result<TestResult> {
        let (of_z, variables): (Vec<Node>, Vec<Node>) =
            z.iter().partition(|node| self.dummy(**node).is_some());
        let mut absorbs = [false; 2];
        of_z.iter().filter_map(|&node| self.dummy(node)).for_each(|dummy| absorbs[place(dummy)] = true);
        let (value, n_samples, n_lost) = match (self.dummy(x), self.dummy(y)) {
            (None, None) if of_z.is_empty() => return self.plain.run_test(x, y, z),
            (None, None) => self.scalar(x, y, &variables, absorbs)?,
            (Some(dummy), None) => self.vector(dummy, y, &variables, absorbs)?,
            (None, Some(dummy)) => self.vector(dummy, x, &variables, absorbs)?,
            // Which recording and which step a sample is from is no question to the data.
            (Some(_), Some(_)) => (0.0, self.samples.len(), 0),
        };
        let n_components = self.columns_of(x) * self.columns_of(y);
        let columns: usize = z.iter().chain([&x, &y]).map(|&node| self.columns_of(node)).sum();
        let dof = n_samples.saturating_sub(columns);
        let (value, p_value) = match dof {
            0 => (0.0, 1.0),
            _ => (value, (correlation_p_value(value, dof) * n_components as f64).min(1.0)),
        };
        Ok(TestResult::new(value, p_value, n_samples, n_lost))
    }

    fn model_selection_score(&self, target: Node, parents: &[Node]) -> Result<f64> {
        self.plain.model_selection_score(target, parents)
    }

    fn is_cheap(&self) -> bool {
        self.plain.is_cheap()
    }
}
