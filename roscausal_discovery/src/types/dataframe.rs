//! The data of an analysis: recordings of the same variables.

use std::{ops::Range, sync::Arc};

use ndarray::{Array2, ArrayView1, ArrayViewMut1, Axis, s};

use super::{
    common::Common,
    error::{Error, Result},
    node::Node,
    vectors::Vectors,
    words::Named,
};

/// The roles in `X _||_ Y | Z` in which a masked value excludes a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MaskType {
    /// A masked X excludes the sample.
    pub x: bool,
    /// A masked Y excludes the sample.
    pub y: bool,
    /// A masked node of Z excludes the sample.
    pub z: bool,
}

impl std::str::FromStr for MaskType {
    type Err = Error;

    /// Reads letters such as `y` or `xyz`.
    fn from_str(text: &str) -> Result<Self> {
        let mut mask = Self::default();
        for letter in text.chars() {
            match letter {
                'x' => mask.x = true,
                'y' => mask.y = true,
                'z' => mask.z = true,
                _ => {
                    let reason = format!("'{text}' is not made of the letters x, y, z");
                    return Err(Error::param("mask_type", reason));
                }
            }
        }
        Ok(mask)
    }
}

/// One or several recordings of the same variables. Missing values are NaN.
///
/// No sample crosses from one recording to the next. A test leaves out the samples in which one of its nodes is missing, or
/// masked in a role of [`MaskType`]; other tests keep them.
///
/// ```
/// use ndarray::array;
/// use roscausal_discovery::DataFrame;
///
/// let first = array![[0.1, 1.0], [0.2, f64::NAN], [0.4, 3.0]];
/// let second = array![[0.3, 2.0], [0.5, 2.5]];
/// let data = DataFrame::new(vec![first, second], vec!["speed".into(), "distance".into()])?;
/// assert!(data.is_incomplete() && data.n_vars() == 2 && data.recordings().len() == 2);
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct DataFrame {
    /// Shared by the data frames that differ in their times only.
    pub(super) recordings: Arc<Vec<Array2<f64>>>,
    var_names: Vec<String>,
    masks: Option<Arc<Vec<Array2<bool>>>>,
    pub(super) mask_type: MaskType,
    pub(super) remove_missing_upto_maxlag: bool,
    /// The times that count as samples; `None`: all.
    pub(super) reference_points: Option<Vec<Vec<bool>>>,
    has_missing: bool,
    /// The times that are samples, by recording; `None`: all.
    times: Option<Arc<Vec<Vec<usize>>>>,
    /// Tells apart the draws of times from one data frame; 0: none was drawn.
    pub(crate) draw: u64,
    /// The further components of variables; `None`: each is one column.
    vectors: Option<Vectors>,
    /// What recordings of one time have in common; `None`: nothing.
    common: Option<Common>,
}

impl DataFrame {
    /// A data frame of recordings, each `T x N` (time in rows), and the `N` names of the variables.
    ///
    /// # Errors
    /// No recording, no variable, shapes that do not match, or an infinite value.
    pub fn new(recordings: Vec<Array2<f64>>, var_names: Vec<String>) -> Result<Self> {
        let reason = "no data: give at least one recording with at least one variable";
        Error::ensure_data(!recordings.is_empty() && !var_names.is_empty(), || reason)?;
        for (i, recording) in recordings.iter().enumerate() {
            let (columns, names) = (recording.ncols(), var_names.len());
            Error::ensure_data(columns == names, || {
                format!("recording {i} has {columns} columns for {names} variable names")
            })?;
            if let Some(((row, col), value)) = recording.indexed_iter().find(|(_, v)| v.is_infinite()) {
                return Err(Error::Data(format!(
                    "'{}' is {value} at row {row} of recording {i}; remove the row or leave the cell empty",
                    var_names[col]
                )));
            }
        }
        let has_missing = recordings.iter().any(|r| r.iter().any(|v| v.is_nan()));
        Ok(Self {
            recordings: Arc::new(recordings),
            var_names,
            masks: None,
            mask_type: MaskType::default(),
            remove_missing_upto_maxlag: false,
            reference_points: None,
            has_missing,
            times: None,
            draw: 0,
            vectors: None,
            common: None,
        })
    }

    /// The same recordings, of which those with the same number in `sources` are of one time: the people of one batch. Where they hold
    /// the same columns (the robot's), a test between two of these counts each row once; other tests count as many as are independent.
    ///
    /// # Errors
    /// A number of sources that is not that of the recordings.
    pub fn of_sources(self, sources: &[usize]) -> Result<Self> {
        let (given, n) = (sources.len(), self.recordings.len());
        Error::ensure(given == n, "sources", || format!("{given} numbers for {n} recordings"))?;
        Ok(Self { common: Common::of(&self.recordings, sources), ..self })
    }

    /// Other values in the same recordings, such as their differences, or fewer recordings.
    ///
    /// # Errors
    /// As [`DataFrame::new`].
    pub fn with_recordings(&self, recordings: Vec<Array2<f64>>) -> Result<Self> {
        let common = self.common.clone().filter(|_| recordings.len() == self.recordings.len());
        Ok(Self { common, ..Self::new(recordings, self.var_names.clone())? })
    }

    /// By recording, the first one of its time; `None`: no two are of one time.
    pub(crate) fn shared_times(&self) -> Option<&[usize]> {
        self.common.as_ref().map(|common| &common.firsts[..])
    }

    /// What recordings of one time have in common.
    pub(super) fn common(&self) -> Option<&Common> {
        self.common.as_ref()
    }

    /// The same recordings, of which only these times are samples: one list per recording, each time as often as it is listed.
    /// The lags of a sample may lie before the listed times. Times that a run needs as the past of others are left out.
    ///
    /// ```
    /// use ndarray::array;
    /// use roscausal_discovery::{DataFrame, Node, Samples};
    ///
    /// let data = DataFrame::new(vec![array![[1.0], [2.0], [3.0], [4.0]]], vec!["a".into()])?;
    /// let some = data.at_times(vec![vec![3, 1, 1, 0]])?;
    /// let arrays = Samples::new(&some, 1).arrays(Node::new(0, 1), Node::new(0, 0), &[]);
    /// assert_eq!((arrays.x, arrays.y), (vec![3.0, 1.0, 1.0], vec![4.0, 2.0, 2.0]));
    /// # Ok::<(), roscausal_discovery::Error>(())
    /// ```
    ///
    /// # Errors
    /// A number of lists that is not that of the recordings, or a time beyond the end of its recording.
    pub fn at_times(&self, times: Vec<Vec<usize>>) -> Result<Self> {
        let (n, wanted) = (times.len(), self.recordings.len());
        Error::ensure(n == wanted, "times", || {
            format!("{n} lists for {wanted} recordings; give one for each")
        })?;
        for (k, (list, recording)) in times.iter().zip(self.recordings.iter()).enumerate() {
            if let Some(t) = list.iter().find(|&&t| t >= recording.nrows()) {
                let reason = format!("{t} is beyond the {} rows of recording {k}", recording.nrows());
                return Err(Error::param("times", reason));
            }
        }
        Ok(Self { times: Some(Arc::new(times)), ..self.clone() })
    }

    /// Says that the times were drawn as number `draw`, so that tests with random numbers take others than in the other draws.
    #[must_use]
    pub(crate) fn drawn(mut self, draw: u64) -> Self {
        self.draw = draw;
        self
    }

    /// The listed times of a recording; `None`: all.
    pub(crate) fn times(&self, recording: usize) -> Option<&[usize]> {
        self.times.as_ref().map(|times| times[recording].as_slice())
    }

    /// Adds masks, one per recording and of its shape (`true`: masked). A masked value excludes a sample in the
    /// roles of `mask_type`.
    ///
    /// # Errors
    /// Masks whose number or shapes differ from those of the recordings.
    pub fn with_mask(mut self, masks: Vec<Array2<bool>>, mask_type: MaskType) -> Result<Self> {
        let fits = masks.iter().map(|mask| mask.dim()).eq(self.recordings.iter().map(|of| of.dim()));
        Error::ensure(fits, "mask", || "give one mask per recording, each of the recording's shape")?;
        self.masks = Some(Arc::new(masks));
        self.mask_type = mask_type;
        Ok(self)
    }

    /// With `on`, a missing value also excludes the samples up to `2xtau_max` after it.
    #[must_use]
    pub fn with_remove_missing_upto_maxlag(mut self, on: bool) -> Self {
        self.remove_missing_upto_maxlag = on;
        self
    }

    /// Restricts the samples to the times `t` at which `points` is true, one list per recording and of its length. Their past
    /// may be any time.
    ///
    /// # Errors
    /// Lists whose number or lengths differ from those of the recordings.
    pub fn with_reference_points(mut self, points: Vec<Vec<bool>>) -> Result<Self> {
        let fits = points.iter().map(Vec::len).eq(self.recordings.iter().map(|of| of.nrows()));
        Error::ensure(fits, "reference_points", || "give one list per recording, each of its length")?;
        self.reference_points = Some(points);
        Ok(self)
    }

    /// A data frame of the columns `vars` only, in that order.
    ///
    /// # Panics
    /// If a column does not exist.
    #[must_use]
    pub fn select(&self, vars: &[usize]) -> Self {
        let recordings: Vec<_> = self.recordings.iter().map(|r| r.select(Axis(1), vars)).collect();
        let vectors = self.vectors.as_ref().map(|vectors| vectors.select(vars));
        let of_vectors = vectors.as_ref().is_some_and(Vectors::has_missing);
        Self {
            has_missing: of_vectors || recordings.iter().any(|r| r.iter().any(|v| v.is_nan())),
            vectors,
            common: self.common.as_ref().map(|common| common.select(vars)),
            recordings: Arc::new(recordings),
            var_names: vars.iter().map(|&var| self.var_names[var].clone()).collect(),
            masks: (self.masks.as_ref())
                .map(|m| Arc::new(m.iter().map(|m| m.select(Axis(1), vars)).collect())),
            ..self.clone()
        }
    }

    /// Some rows of one recording as data of their own, with what belongs to them: masks, reference points, further components of
    /// vectors. All of their times are samples.
    ///
    /// # Panics
    /// If there is no such recording, or if it does not have these rows.
    pub(crate) fn stretch(&self, recording: usize, rows: Range<usize>) -> Self {
        let Range { start, end } = rows;
        let values = self.recordings[recording].slice(s![start..end, ..]).to_owned();
        let mask_of = |masks: &Arc<Vec<Array2<bool>>>| masks[recording].slice(s![start..end, ..]).to_owned();
        let points_of = |points: &Vec<Vec<bool>>| vec![points[recording][start..end].to_vec()];
        let vectors = self.vectors.as_ref().map(|vectors| vectors.stretch(recording, start..end));
        let of_vectors = vectors.as_ref().is_some_and(Vectors::has_missing);
        Self {
            has_missing: of_vectors || values.iter().any(|v| v.is_nan()),
            recordings: Arc::new(vec![values]),
            masks: self.masks.as_ref().map(|masks| Arc::new(vec![mask_of(masks)])),
            reference_points: self.reference_points.as_ref().map(points_of),
            times: None,
            draw: 0,
            vectors,
            common: None,
            ..self.clone()
        }
    }

    /// For each row of a recording, whether it holds a value that is masked as an effect; empty if there is no such mask.
    pub fn masked_effects(&self, recording: usize) -> Vec<bool> {
        let masks = self.masks.as_ref().filter(|_| self.mask_type.y);
        let is_masked = |row: ArrayView1<'_, bool>| row.iter().any(|masked| *masked);
        let of = |mask: &Array2<bool>| mask.rows().into_iter().map(is_masked).collect();
        masks.and_then(|masks| masks.get(recording)).map_or_else(Vec::new, of)
    }

    /// The data with each variable of each recording changed.
    fn changed(&self, change: impl Fn(usize, ArrayViewMut1<'_, f64>)) -> Self {
        let mut data = self.clone();
        for recording in Arc::make_mut(&mut data.recordings) {
            recording.columns_mut().into_iter().enumerate().for_each(|(var, column)| change(var, column));
        }
        data
    }

    /// The data with `by[var]` taken off each value of a variable.
    pub(crate) fn shifted(&self, by: &[f64]) -> Self {
        self.changed(|var, mut column| column -= by[var])
    }

    /// The data with each value of a variable multiplied by `by[var]`.
    pub(crate) fn scaled(&self, by: &[f64]) -> Self {
        self.changed(|var, mut column| column *= by[var])
    }

    /// The data with the mean of each variable in each recording taken off.
    pub(crate) fn centred(&self) -> Self {
        self.changed(|_, mut column| {
            let (sum, n) = column.iter().filter(|v| !v.is_nan()).fold((0.0, 0), |(s, n), v| (s + v, n + 1));
            column.mapv_inplace(|v| v - sum / f64::from(n.max(1)));
        })
    }

    /// The recordings, each `T x N`.
    pub fn recordings(&self) -> &[Array2<f64>] {
        &self.recordings
    }

    /// The recording with the most rows; of several, that of the larger values: the same one in any order.
    pub(crate) fn longest(&self) -> &Array2<f64> {
        let size = |rows: &Array2<f64>| rows.iter().filter(|v| !v.is_nan()).map(|v| v.abs()).sum::<f64>();
        let longest = |a: &&Array2<f64>, b: &&Array2<f64>| {
            a.nrows().cmp(&b.nrows()).then_with(|| size(a).total_cmp(&size(b)))
        };
        self.recordings.iter().max_by(longest).unwrap_or(&self.recordings[0])
    }

    /// Refuses a largest lag for which no recording is long enough: the first `cut_off` rows of each only serve as the past of others.
    pub(crate) fn check_length(&self, tau_max: usize, cut_off: usize) -> Result<()> {
        let longest = self.recordings.iter().map(|recording| recording.nrows()).max().unwrap_or(0);
        let (flag, least) = (Named("tau_max"), cut_off.saturating_add(4));
        Error::ensure_data(longest > cut_off, || {
            format!(
                "the longest recording has {longest} samples; {flag} = {tau_max} needs at least {least}: record longer or lower \
                 {flag}"
            )
        })
    }

    /// Names of the variables.
    pub fn var_names(&self) -> &[String] {
        &self.var_names
    }

    /// Number of variables.
    pub fn n_vars(&self) -> usize {
        self.var_names.len()
    }

    /// The names of these variables, with commas.
    pub(crate) fn listed(&self, vars: impl IntoIterator<Item = usize>) -> String {
        vars.into_iter().map(|var| self.var_names[var].as_str()).collect::<Vec<_>>().join(", ")
    }

    /// The different values of a variable; where there are more than `most`, one more.
    pub(crate) fn different_values(&self, var: usize, most: usize) -> Vec<f64> {
        let mut seen: Vec<f64> = Vec::new();
        for value in self.recordings.iter().flat_map(|r| r.column(var)).filter(|value| !value.is_nan()) {
            if seen.len() <= most && !seen.contains(value) {
                seen.push(*value);
            }
        }
        seen
    }

    /// Whether some tests may have to leave out samples: a value is missing, a mask applies, or not every time counts.
    pub fn is_incomplete(&self) -> bool {
        let masked = self.masks.is_some() && self.mask_type != MaskType::default();
        self.has_missing || masked || self.reference_points.is_some()
    }

    /// Whether missing values are the only reason to leave out a sample, and only for the tests of their nodes.
    pub(crate) fn lacks_values_only(&self) -> bool {
        let masked = self.masks.is_some() && self.mask_type != MaskType::default();
        self.has_missing && !masked && !self.remove_missing_upto_maxlag && self.reference_points.is_none()
    }

    /// Whether the value of `node` at time `t` excludes the sample.
    pub(super) fn excludes(&self, recording: usize, t: usize, node: Node, mask_role: bool) -> bool {
        let at = t - node.lag;
        let masked = || self.masks.as_ref().is_some_and(|masks| masks[recording][[at, node.var]]);
        let in_vector = || self.vectors.as_ref().is_some_and(|of| of.is_missing(recording, at, node.var));
        self.recordings[recording][[at, node.var]].is_nan() || in_vector() || (mask_role && masked())
    }

    pub(super) fn is_masked(&self) -> bool {
        self.masks.is_some()
    }

    /// The same with other values, missing where they were; `None` for data with vectors, whose components are elsewhere.
    pub(crate) fn with_values(&self, recordings: Vec<Array2<f64>>) -> Option<Self> {
        self.vectors.is_none().then(|| Self { recordings: Arc::new(recordings), ..self.clone() })
    }

    pub(super) fn vectors(&self) -> Option<&Vectors> {
        self.vectors.as_ref()
    }

    /// The same data with names for the variables and further components of them.
    pub(super) fn of_vectors(mut self, names: Vec<String>, vectors: Vectors) -> Self {
        self.has_missing |= vectors.has_missing();
        self.var_names = names;
        self.vectors = Some(vectors);
        self
    }
}
