//! When a slope changed: least squares with a break.
//!
//! 1. The effect is regressed on the cause and the conditions, with a second slope of the cause from row `s` on.
//! 2. The likelihood of `s` is `-n/2 ln RSS(s)`; its maximum tells when.
//! 3. The interval holds all `s` whose likelihood is within 4 of the largest.
//!
//! `RSS(s)` follows from one regression: a column `w` that is added takes `(w' e)^2 / (w'w - w' P w)` off the residual sum of
//! squares, with the residuals `e` and the projection `P` of the columns that are there. Both sums grow row by row.

use super::{
    batch::{Batch, column},
    curves::part_of,
    place::Place,
    terms::{Comparison, Mechanisms},
};
use crate::{
    independence_tests::GpRegression,
    numeric::slope::{Conditions, dot},
    types::Node,
};

/// How far below the largest likelihood a row may be.
const WITHIN: f64 = 4.0;
/// Rows at both ends at which no break is looked for.
const EDGE: usize = 10;

/// The rows between which the link changed, of all rows read. A `curve` takes the place of the cause.
pub(super) fn between(
    comparison: &Comparison<'_>,
    batches: &[&Batch],
    at: Place,
    mechanisms: &Mechanisms,
    curve: Option<&GpRegression>,
) -> Option<[usize; 2]> {
    let past = comparison.past();
    let of = |node: Node| column(batches, node, past);
    let (y, mut x) = (of(Node::new(at.effect, 0)), of(Node::new(at.cause, at.lag)));
    if let Some(curve) = curve {
        x = part_of(&x, curve);
    }
    let others = comparison.conditions(batches, at, mechanisms);
    let columns: Vec<&[f64]> = std::iter::once(&x).chain(&others).map(Vec::as_slice).collect();
    let there = Conditions::new(&columns)?;
    let residuals = there.residuals(&y);
    let (n, rss) = (y.len(), dot(&residuals, &residuals));
    let rows: Vec<usize> =
        (batches.iter()).flat_map(|batch| batch.rows(past).into_iter().map(|t| batch.first + t)).collect();
    let mut products = vec![0.0; columns.len()];
    let (mut squares, mut with_residuals) = (0.0, 0.0);
    let mut likelihoods = Vec::new();
    for s in (0..n).rev() {
        squares += x[s] * x[s];
        with_residuals += x[s] * residuals[s];
        products.iter_mut().zip(&columns).for_each(|(product, column)| *product += x[s] * column[s]);
        if s < EDGE || s + EDGE > n {
            continue;
        }
        let own = squares - there.explained(products.clone());
        if own > 1e-9 * squares {
            let left = (rss - with_residuals * with_residuals / own).max(f64::MIN_POSITIVE);
            likelihoods.push((rows[s], -0.5 * n as f64 * libm::log(left)));
        }
    }
    let largest = likelihoods.iter().map(|(_, l)| *l).fold(f64::NEG_INFINITY, f64::max);
    let near = || likelihoods.iter().filter(|(_, l)| *l >= largest - WITHIN).map(|(row, _)| *row);
    Some([near().min()?, near().max()?])
}
