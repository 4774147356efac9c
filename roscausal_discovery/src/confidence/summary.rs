//! Shares, majorities and intervals over all resamples.

use ndarray::Array3;

use crate::{
    analysis::Found,
    model::{Confidence, Model, ResamplingFacts, nested},
    numeric::rows::quantile,
    types::LinkMark,
};

/// The marks that a link may have.
const MARKS: &[LinkMark] = LinkMark::ALL.as_slice().split_at(1).1;

/// Counts over all variables of the data.
pub(super) struct Summary<'a> {
    found: &'a [Found],
    /// Resamples by mark, in the order of [`MARKS`].
    counts: Vec<Array3<usize>>,
}

impl<'a> Summary<'a> {
    pub(super) fn new(found: &'a [Found], (n_vars, tau_max): (usize, usize)) -> Self {
        let mut counts = vec![Array3::zeros((n_vars, n_vars, tau_max + 1)); MARKS.len()];
        for one in found {
            for (at, mark) in one.graph.indexed_iter() {
                if let Some(place) = MARKS.iter().position(|known| known == mark) {
                    counts[place][at] += 1;
                }
            }
        }
        Self { found, counts }
    }

    fn links(&self, at: [usize; 3]) -> usize {
        self.counts.iter().map(|of_mark| of_mark[at]).sum()
    }

    fn share(&self, count: usize) -> f64 {
        count as f64 / self.found.len() as f64
    }

    /// The mark of most resamples, if more than half have a link. Of equals the undecided one counts.
    fn majority(&self, at: [usize; 3]) -> LinkMark {
        if 2 * self.links(at) <= self.found.len() {
            return LinkMark::Absent;
        }
        let most = self.counts.iter().map(|of_mark| of_mark[at]).max().unwrap_or_default();
        let first = MARKS.iter().zip(&self.counts).filter(|(_, counts)| counts[at] == most);
        let first: Vec<LinkMark> = first.map(|(mark, _)| *mark).collect();
        match first.as_slice() {
            [one] => *one,
            several if several.contains(&LinkMark::Conflict) => LinkMark::Conflict,
            several if several.contains(&LinkMark::Unoriented) => LinkMark::Unoriented,
            _ => LinkMark::Conflict,
        }
    }

    /// The share of resamples with a link at any lag.
    fn at_any_lag(&self, i: usize, j: usize) -> f64 {
        let any = |one: &&Found| (0..one.graph.dim().2).any(|lag| one.graph[[i, j, lag]].is_link());
        self.share(self.found.iter().filter(any).count())
    }

    /// Mean and percentiles 5 and 95 of the values.
    fn values(&self, at: [usize; 3]) -> [f64; 3] {
        let mut values: Vec<f64> = self.found.iter().map(|one| one.values[at]).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        values.sort_by(f64::total_cmp);
        [mean, quantile(&values, 0.05), quantile(&values, 0.95)]
    }

    /// What is said of the model's features.
    pub(super) fn on_features(
        &self,
        names: &[String],
        features: &[String],
        resampling: ResamplingFacts,
    ) -> Confidence {
        let vars: Vec<usize> =
            features.iter().filter_map(|f| names.iter().position(|name| name == f)).collect();
        let values = nested(&vars, self.counts[0].dim().2, |at| self.values(at));
        let part = |k: usize| {
            let lags = |lags: &Vec<[f64; 3]>| lags.iter().map(|v| v[k]).collect();
            values.iter().map(|row| row.iter().map(lags).collect()).collect()
        };
        let n_lags = self.counts[0].dim().2;
        let found =
            MARKS.iter().zip(&self.counts).filter(|(_, counts)| counts.iter().any(|&count| count > 0));
        Confidence {
            resampling,
            link_frequency: nested(&vars, n_lags, |at| self.share(self.links(at))),
            mark_frequency: found
                .map(|(mark, counts)| (*mark, nested(&vars, n_lags, |at| self.share(counts[at]))))
                .collect(),
            summary_frequency: (vars.iter())
                .map(|&i| vars.iter().map(|&j| self.at_any_lag(i, j)).collect())
                .collect(),
            majority_graph: nested(&vars, n_lags, |at| self.majority(at)),
            val_mean: part(0),
            val_low: part(1),
            val_high: part(2),
            advice: Vec::new(),
        }
    }

    /// Says which variables the model leaves out although many resamples have a link of theirs.
    pub(super) fn of_dropped(&self, names: &[String], model: &Model) -> Vec<String> {
        let mut remarks = Vec::new();
        for (var, name) in names.iter().enumerate().filter(|(_, name)| !model.features.contains(name)) {
            let others = || (0..names.len()).filter(|&other| other != var);
            let most =
                others().map(|o| self.at_any_lag(var, o).max(self.at_any_lag(o, var))).fold(0.0, f64::max);
            if most >= 0.3 {
                remarks.push(format!(
                    "'{name}' is left out of the model, but has a link to another variable in {:.0} of 100 resamples",
                    100.0 * most
                ));
            }
        }
        remarks
    }
}
