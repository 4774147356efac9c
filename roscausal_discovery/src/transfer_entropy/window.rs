//! The samples that all estimates of a filter share.

use crate::{
    numeric::rows::units,
    types::{DataFrame, Error, Node, Result},
};

/// Fewest complete samples from which transfer entropy is estimated.
const MIN_SAMPLES: usize = 10;

/// The samples of a filter: the times at which every variable is present at every lag `0..=max_lag`. All estimates
/// use the same samples, so they are comparable. No sample spans two recordings. Of a data frame that lists its times, those
/// times.
pub(super) struct Window<'a> {
    data: &'a DataFrame,
    pub(super) max_lag: usize,
    /// Recording and row of each sample.
    pub(super) times: Vec<(usize, usize)>,
    /// Times left out because a value was missing.
    pub(super) n_lost: usize,
    /// Powers of two by which values are multiplied, so that no square overflows or vanishes.
    units: Vec<f64>,
}

impl<'a> Window<'a> {
    pub(super) fn new(data: &'a DataFrame, max_lag: usize) -> Result<Self> {
        let mut times = Vec::new();
        let mut n_total = 0;
        for (k, recording) in data.recordings().iter().enumerate() {
            let mut complete_rows = 0;
            let mut complete = Vec::with_capacity(recording.nrows());
            for row in recording.rows() {
                complete_rows = if row.iter().any(|v| v.is_nan()) { 0 } else { complete_rows + 1 };
                complete.push(complete_rows > max_lag);
            }
            let mut take = |t: usize| {
                n_total += 1;
                if complete[t] {
                    times.push((k, t));
                }
            };
            match data.times(k) {
                Some(listed) => listed.iter().filter(|&&t| t >= max_lag).for_each(|&t| take(t)),
                None => (max_lag..recording.nrows()).for_each(take),
            }
        }
        if times.len() < MIN_SAMPLES {
            return Err(Error::Data(format!(
                "the transfer-entropy filter finds {} complete samples for max_lag = {max_lag}; it needs at least \
                 {MIN_SAMPLES}: record longer, lower max_lag or fill the missing values",
                times.len()
            )));
        }
        Ok(Self { data, max_lag, n_lost: n_total - times.len(), times, units: units(data) })
    }

    pub(super) fn n_vars(&self) -> usize {
        self.data.n_vars()
    }

    /// A value, in units of a power of two.
    pub(super) fn value(&self, (recording, row): (usize, usize), node: Node) -> f64 {
        self.units[node.var] * self.data.recordings()[recording][[row - node.lag, node.var]]
    }

    /// The samples of one node that conditional tests have, whose window is twice as long.
    pub(super) fn column_of_tests(&self, node: Node) -> Vec<f64> {
        let times = self.times.iter().filter(|(_, row)| *row >= 2 * self.max_lag);
        times.map(|&at| self.value(at, node)).collect()
    }

    /// The samples of one node.
    pub(super) fn column(&self, node: Node) -> Vec<f64> {
        self.times.iter().map(|&at| self.value(at, node)).collect()
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;

    #[test]
    fn samples_cross_no_recording_and_no_gap() {
        let recording = |n: usize| Array2::from_shape_fn((n, 2), |(t, i)| (10 * t + i) as f64);
        let mut second = recording(12);
        second[[5, 1]] = f64::NAN;
        let data =
            DataFrame::new(vec![recording(8), second], vec!["a".into(), "b".into()]).expect("is a frame");
        let window = Window::new(&data, 2).expect("is long enough");
        assert_eq!((window.times.len(), window.n_lost), (6 + 7, 3));
        assert!(window.times.iter().all(|&(k, t)| t >= 2 && (k == 0 || !(5..=7).contains(&t))));
        assert_eq!(window.value((1, 9), Node::new(1, 2)), 71.0 * window.units[1]);
    }

    #[test]
    fn too_few_samples_are_an_error() {
        let data = DataFrame::new(vec![Array2::zeros((11, 1))], vec!["a".into()]).expect("is a frame");
        assert!(Window::new(&data, 2).is_err());
        assert!(Window::new(&data, 1).is_ok());
    }
}
