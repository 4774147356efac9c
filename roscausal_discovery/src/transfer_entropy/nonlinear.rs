//! Sources that a linear estimator cannot see: the second look of the filter.
//!
//! For each target, after the Gaussian selection:
//!
//! 1. The selected variables are regressed out of the target and of each candidate that was left out (least squares).
//! 2. What remains of both becomes ranks; their distance correlation is held against that of independent series.
//! 3. A candidate whose p-value is below the level joins the sources.
//!
//! Distance correlation is 0 only for independent series, so the look misses no pair that GPDC would see. It asks about each
//! candidate alone and without a correction for many tests: a filter that lets too much through costs time, one that lets too
//! little through costs links. Example: with `b(t) = a(t-1)^2 + noise` the correlation is 0, the distance correlation 0.5.
//!
//! Source of the statistic: Székely, Rizzo and Bakirov 2007, doi:10.1214/009053607000000505.

use super::{
    result::{Selected, TargetSelection},
    window::Window,
};
use crate::{
    independence_tests::{dependence, residuals},
    numeric::rows::standardize,
    types::{Control, Node, Result},
};

/// The second look at all targets of one run.
pub(super) struct SecondLook<'a> {
    /// All variables at lags `0..=max_lag`, standardised, by lag and variable.
    rows: Vec<Vec<f64>>,
    n_vars: usize,
    lags: std::ops::RangeInclusive<usize>,
    alpha: f64,
    control: &'a Control,
}

impl<'a> SecondLook<'a> {
    pub(super) fn new(
        window: &Window,
        lags: std::ops::RangeInclusive<usize>,
        alpha: f64,
        control: &'a Control,
    ) -> Self {
        let n_vars = window.n_vars();
        let row = |k: usize| {
            let mut row = window.column_of_tests(Node::new(k % n_vars, k / n_vars));
            // A constant becomes zeros.
            standardize(&mut row);
            row
        };
        Self { rows: (0..n_vars * (lags.end() + 1)).map(row).collect(), n_vars, lags, alpha, control }
    }

    /// Adds to `found` the sources that depend on its target beyond what it has.
    pub(super) fn add_to(&self, found: &mut TargetSelection) -> Result<()> {
        let known: Vec<Node> = found.selected().map(|selected| selected.source).collect();
        let z: Vec<Vec<f64>> = known.iter().map(|&node| self.row(node)).collect();
        let candidates =
            (0..self.n_vars).flat_map(|var| self.lags.clone().map(move |lag| Node::new(var, lag)));
        for source in candidates.filter(|node| !known.contains(node)) {
            self.control.check()?;
            let (x, y) = residuals(self.row(source), self.row(Node::new(found.target, 0)), z.clone());
            let (value, p_value) = dependence(&x, &y);
            if p_value < self.alpha {
                found.beyond.push(Selected { source, value, p_value });
            }
        }
        Ok(())
    }

    fn row(&self, node: Node) -> Vec<f64> {
        self.rows[node.lag * self.n_vars + node.var].clone()
    }
}
