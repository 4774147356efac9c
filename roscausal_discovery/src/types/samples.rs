//! The samples of a run: which rows of the data frame a test sees.

use super::{
    common::Common,
    complete_rows::CompleteRows,
    control::Control,
    dataframe::{DataFrame, MaskType},
    node::Node,
};

/// The time indices that all tests of one run use: `cut_off..T` of each recording, or those of them that the data frame lists
/// ([`DataFrame::at_times`]).
///
/// All tests of a run see the same times, so that their values compare; the first `cut_off` samples of each recording serve
/// as the past of the others.
///
/// ```
/// use ndarray::array;
/// use roscausal_discovery::{DataFrame, Node, Samples};
///
/// let data = DataFrame::new(vec![array![[1.0], [2.0], [3.0], [4.0], [5.0]]], vec!["a".into()])?;
/// let samples = Samples::new(&data, 2);
/// let arrays = samples.arrays(Node::new(0, 1), Node::new(0, 0), &[]);
/// assert_eq!((arrays.x, arrays.y), (vec![2.0, 3.0, 4.0], vec![3.0, 4.0, 5.0]));
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Samples<'a> {
    data: &'a DataFrame,
    cut_off: usize,
    control: Control,
    /// The listed times that are not before the cut-off, by recording.
    times: Option<Vec<Vec<usize>>>,
    /// Those of tests between common columns, in which each time is there once.
    once: Option<Box<Samples<'a>>>,
}

/// The lagged rows of one test, without the samples in which a node is missing or masked.
#[derive(Clone, Debug, Default)]
pub struct LaggedArrays {
    /// `n` samples of X.
    pub x: Vec<f64>,
    /// `n` samples of Y.
    pub y: Vec<f64>,
    /// One row of `n` samples per node of Z.
    pub z: Vec<Vec<f64>>,
    /// Samples left out.
    pub n_lost: usize,
}

impl<'a> Samples<'a> {
    /// The samples of a run. A run with `tau_max` uses `cut_off` = `2xtau_max`.
    pub fn new(data: &'a DataFrame, cut_off: usize) -> Self {
        let after = |times: &[usize]| times.iter().copied().filter(|&t| t >= cut_off).collect();
        let times: Option<Vec<Vec<usize>>> =
            (0..data.recordings.len()).map(|k| data.times(k).map(after)).collect();
        let all = Self { data, cut_off, control: Control::default(), times, once: None };
        let all_times = || (0..data.recordings.len()).map(|k| all.times_in(k)).collect::<Vec<_>>();
        let once = data.common().map(|common| {
            let times = common.once(&data.recordings, &all_times());
            Box::new(Self { times: Some(times), ..all.clone() })
        });
        Self { once, ..all }
    }

    /// The samples of tests between common columns ([`DataFrame::of_sources`]), if there are such columns.
    pub(crate) fn once(&self) -> Option<&Self> {
        self.once.as_deref()
    }

    /// Whether both nodes are of columns that recordings of one time have in common.
    pub(crate) fn are_common(&self, x: Node, y: Node) -> bool {
        let is_common = |of: &Common| [x, y].iter().all(|node| of.columns.get(node.var) == Some(&true));
        self.data.common().is_some_and(is_common)
    }

    /// The same samples, watched by `control`.
    #[must_use]
    pub fn with_control(self, control: Control) -> Self {
        let once = self.once.map(|once| Box::new(once.with_control(control.clone())));
        Self { control, once, ..self }
    }

    /// The control of the run. A test that takes longer than a second calls its `check` in its loops.
    pub fn control(&self) -> &Control {
        &self.control
    }

    /// The data frame that the samples come from.
    pub fn data(&self) -> &'a DataFrame {
        self.data
    }

    /// First time index used in each recording.
    pub fn cut_off(&self) -> usize {
        self.cut_off
    }

    /// Number of samples before any is left out.
    pub fn len(&self) -> usize {
        match &self.times {
            Some(lists) => lists.iter().map(Vec::len).sum(),
            None => self.data.recordings.iter().map(|r| r.nrows().saturating_sub(self.cut_off)).sum(),
        }
    }

    /// Whether the samples are listed ([`DataFrame::at_times`]), not all times from the cut-off on.
    pub fn are_listed(&self) -> bool {
        self.times.is_some()
    }

    /// The values of `node` in the order of the samples. None may be missing.
    pub(crate) fn values(&self, node: Node) -> Vec<f64> {
        let mut values = Vec::with_capacity(self.len());
        for (k, recording) in self.data.recordings.iter().enumerate() {
            let column = recording.column(node.var);
            self.each_time(k, |t| values.push(column[t - node.lag]));
        }
        values
    }

    /// For each sample of recording `k`: its time.
    pub(crate) fn times_in(&self, k: usize) -> Vec<usize> {
        let mut times = Vec::new();
        self.each_time(k, |t| times.push(t));
        times
    }

    fn each_time(&self, k: usize, f: impl FnMut(usize)) {
        match &self.times {
            Some(lists) => lists[k].iter().copied().for_each(f),
            None => (self.cut_off..self.data.recordings[k].nrows()).for_each(f),
        }
    }

    /// Whether there is no sample.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The rows of `x`, `y` and `z`, without the samples in which one of them is missing or masked. Lags go up to
    /// `cut_off`.
    pub fn arrays(&self, x: Node, y: Node, z: &[Node]) -> LaggedArrays {
        self.placed(x, y, z, |_, _| ())
    }

    /// How many samples [`Samples::arrays`] has, and those of them at these positions, which get that number. Where no sample is
    /// left out the others are not copied.
    pub(crate) fn some(
        &self,
        x: Node,
        y: Node,
        z: &[Node],
        positions: impl FnOnce(usize) -> Vec<usize>,
    ) -> (usize, LaggedArrays) {
        if self.data.is_incomplete() || self.times.is_some() {
            let all = self.arrays(x, y, z);
            let at = positions(all.x.len());
            let picked = |row: &Vec<f64>| at.iter().map(|&i| row[i]).collect();
            let z = all.z.iter().map(picked).collect();
            return (
                all.x.len(),
                LaggedArrays { x: picked(&all.x), y: picked(&all.y), z, n_lost: all.n_lost },
            );
        }
        let n = self.len();
        let place = |mut i: usize| {
            for recording in self.data.recordings.iter() {
                let length = recording.nrows().saturating_sub(self.cut_off);
                if i < length {
                    return Some((recording, self.cut_off + i));
                }
                i -= length;
            }
            None
        };
        let places: Vec<_> = positions(n).into_iter().filter_map(place).collect();
        let row = |&node: &Node| places.iter().map(|(of, t)| of[[t - node.lag, node.var]]).collect();
        (n, LaggedArrays { x: row(&x), y: row(&y), z: z.iter().map(row).collect(), n_lost: 0 })
    }

    /// As [`Samples::arrays`], and tells `place` the recording and the time of each sample that is used, in order.
    pub(crate) fn placed(
        &self,
        x: Node,
        y: Node,
        z: &[Node],
        mut place: impl FnMut(usize, usize),
    ) -> LaggedArrays {
        if !self.data.is_incomplete() {
            (0..self.data.recordings.len()).for_each(|k| self.each_time(k, |t| place(k, t)));
            let z = z.iter().map(|&node| self.values(node)).collect();
            return LaggedArrays { x: self.values(x), y: self.values(y), z, n_lost: 0 };
        }
        let n = self.len();
        let row = || Vec::with_capacity(n);
        let mut out =
            LaggedArrays { x: row(), y: row(), z: (0..z.len()).map(|_| row()).collect(), n_lost: 0 };
        for (k, recording) in self.data.recordings.iter().enumerate() {
            let dropped = self.dropped(k, x, y, z);
            self.each_time(k, |t| {
                if dropped[t - self.cut_off] {
                    out.n_lost += 1;
                    return;
                }
                let at = |node: Node| recording[[t - node.lag, node.var]];
                out.x.push(at(x));
                out.y.push(at(y));
                z.iter().zip(&mut out.z).for_each(|(&node, row)| row.push(at(node)));
                place(k, t);
            });
        }
        out
    }

    /// The samples in which no variable is missing or masked at any lag up to the cut-off, for methods that regress on
    /// everything at once. A mask counts in whatever role.
    pub(crate) fn complete(&self) -> CompleteRows {
        let (data, n_vars) = (self.data, self.data.n_vars());
        let nodes: Vec<Node> =
            (0..=self.cut_off).flat_map(|lag| (0..n_vars).map(move |var| Node::new(var, lag))).collect();
        let MaskType { x, y, z } = data.mask_type;
        let mut columns = vec![Vec::with_capacity(self.len()); nodes.len()];
        let mut n_lost = 0;
        for (k, recording) in data.recordings.iter().enumerate() {
            let excludes = |t: usize, masks: bool| {
                nodes.iter().any(|&node| data.excludes(k, t, node, masks && (x || y || z)))
            };
            let dropped = if data.is_incomplete() { self.dropped_where(k, excludes) } else { Vec::new() };
            self.each_time(k, |t| {
                if dropped.get(t - self.cut_off) == Some(&true) {
                    n_lost += 1;
                    return;
                }
                for (node, column) in nodes.iter().zip(&mut columns) {
                    column.push(recording[[t - node.lag, node.var]]);
                }
            });
        }
        CompleteRows { n_vars, columns, n_lost }
    }

    /// For each sample of recording `k`: whether this test leaves it out.
    fn dropped(&self, k: usize, x: Node, y: Node, z: &[Node]) -> Vec<bool> {
        let (data, mask) = (self.data, self.data.mask_type);
        self.dropped_where(k, |t, masks| {
            data.excludes(k, t, x, masks && mask.x)
                || data.excludes(k, t, y, masks && mask.y)
                || z.iter().any(|&node| data.excludes(k, t, node, masks && mask.z))
        })
    }

    /// For each sample of recording `k`: whether it is left out. `drops(t, masks)` says whether the sample at `t` has a missing
    /// value, or, with `masks`, a missing or masked one.
    fn dropped_where(&self, k: usize, drops: impl Fn(usize, bool) -> bool) -> Vec<bool> {
        let n_rows = self.data.recordings[k].nrows();
        let mut dropped: Vec<bool> = (self.cut_off..n_rows).map(|t| drops(t, true)).collect();
        if self.data.remove_missing_upto_maxlag {
            for t in self.cut_off..n_rows {
                if drops(t, false) {
                    let end = (t + self.cut_off + 1).min(n_rows);
                    dropped[t - self.cut_off..end - self.cut_off].fill(true);
                }
            }
        }
        if let Some(points) = &self.data.reference_points {
            (self.cut_off..n_rows).for_each(|t| dropped[t - self.cut_off] |= !points[k][t]);
        }
        dropped
    }
}
