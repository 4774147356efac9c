//! The comparison for mechanisms of any smooth form.
//!
//! 1. The inputs of an effect are its own past and every cause that it depends on at 0.2 (distance correlation of ranks), before
//!    or after.
//! 2. One Gaussian process of the effect on its inputs, over the rows before and after together. Its hyperparameters are those of
//!    at most 400 of the rows.
//! 3. Of the rows after, the residuals and the values of each cause become ranks. If the mechanism is the same, they are
//!    independent: the p-value of their distance correlation.
//!
//! The p-value is from the table of values of independent uniform series. Beyond the table, where the correction for many links
//! needs it, from a tail fitted to the table's largest quarter: `0.25 exp(-(d^2 - q^2) / s)` with its 75 % quantile `q` and the
//! mean excess `s` of the squares above it. Ranks within the rows after are robust to a cause whose spread changes.
//!
//! What became of a link follows from the curve that it had: the slope `b` of what the other inputs leave of the effect on
//! that curve is 1 if nothing changed, 0 if the link is gone, and negative if it is reversed.
//!
//! Sources: Szekely, Rizzo and Bakirov 2007 (distance correlation), Rasmussen and Williams 2006, Runge et al. 2019.

use super::{
    batch::{Batch, column},
    event::Kind,
    place::Place,
    terms::{Comparison, Difference, Mechanisms},
};
use crate::{
    ground::{Node, Result},
    independence_tests::{GpOptimum, GpRegression, TestSettings, tail_dependence},
    numeric::{
        normal::normal_quantile,
        slope::{Slope, dot},
    },
};

/// Level at which a cause is an input.
const INPUT: f64 = 0.2;
/// Level at which there is a link.
const LINK: f64 = 0.05;
/// Smallest p-value that is told from others.
const SMALLEST: f64 = 1e-300;
/// Rows that choose the hyperparameters.
const SEARCHED: usize = 400;
/// Most rows of a regression, the newest ones.
const MOST: usize = 1200;

/// The inputs of each effect.
pub(super) fn inputs(comparison: &Comparison<'_>, before: &[&Batch], after: &[&Batch]) -> Vec<Vec<Node>> {
    let n = comparison.names.len();
    let values = |group: &[&Batch], node: Node| column(group, node, comparison.past());
    let mut all = Vec::new();
    for effect in 0..n {
        let target = [before, after].map(|group| values(group, Node::new(effect, 0)));
        let depends = |node: Node| {
            [before, after]
                .iter()
                .zip(&target)
                .any(|(group, y)| tail_dependence(&values(group, node), y) <= INPUT)
        };
        let lags = 1..=comparison.tau_max;
        let nodes = (0..n).flat_map(|cause| lags.clone().map(move |lag| Node::new(cause, lag)));
        all.push(nodes.filter(|&node| node.var == effect || depends(node)).collect());
    }
    all
}

/// The p-values of the links of one effect.
pub(super) fn differences_of(
    comparison: &Comparison<'_>,
    (before, after): (&[&Batch], &[&Batch]),
    places: &[Place],
    mechanisms: &Mechanisms,
) -> Result<Vec<Difference>> {
    let Some(first) = places.first() else { return Ok(Vec::new()) };
    let together: Vec<&Batch> = before.iter().chain(after).copied().collect();
    let of = |group: &[&Batch], node: Node| column(group, node, comparison.past());
    // Each batch is centred by itself, so the rows after are the last ones of all.
    let y = of(&together, Node::new(first.effect, 0));
    let x: Vec<Vec<f64>> = mechanisms.inputs(first.effect).iter().map(|&node| of(&together, node)).collect();
    let n_after = of(after, Node::new(first.effect, 0)).len();
    let Some(left) = residuals(&y, &x, n_after) else { return Ok(Vec::new()) };
    let none = Slope { value: 0.0, variance: 1.0 };
    let difference = |at: &Place| {
        let p = tail_dependence(&left, &of(after, Node::new(at.cause, at.lag)));
        let z = -normal_quantile(0.5 * p.max(SMALLEST));
        Difference { at: *at, before: none, after: none, kind: Kind::Weaker, z, p: 1.0, q: 1.0 }
    };
    Ok(places.iter().map(difference).collect())
}

/// What the link was and is: the deviation of its part of the effect before, the same after with its sign against the curve
/// before, and what became of it.
pub(super) fn describe(
    comparison: &Comparison<'_>,
    (before, after): (&[&Batch], &[&Batch]),
    at: Place,
    mechanisms: &Mechanisms,
) -> Option<(Slope, Slope, Kind)> {
    let of = |group: &[&Batch], node: Node| column(group, node, comparison.past());
    let part = |group: &[&Batch]| {
        let y = of(group, Node::new(at.effect, 0));
        let x = of(group, Node::new(at.cause, at.lag));
        let others: Vec<Vec<f64>> = mechanisms.given(at).iter().map(|&node| of(group, node)).collect();
        let n = y.len();
        let left = if others.is_empty() { Some(y) } else { residuals(&y, &others, n) }?;
        let tail = n.saturating_sub(MOST);
        Some((x.get(tail..)?.to_vec(), left.get(left.len().checked_sub(n - tail)?..)?.to_vec()))
    };
    let ((x_before, y_before), (x_after, y_after)) = (part(before)?, part(after)?);
    let was = tail_dependence(&x_before, &y_before) <= LINK;
    let is = tail_dependence(&x_after, &y_after) <= LINK;
    let shape = curve(&x_before, &y_before);
    let size = |values: &[f64]| (dot(values, values) / values.len().max(1) as f64).sqrt();
    let sized = |value: f64| Slope { value, variance: 1.0 };
    if !was {
        let now = curve(&x_after, &y_after).map_or(0.0, |curve| size(&centred(&x_after, &curve)));
        return Some((sized(0.0), sized(now), Kind::Appeared));
    }
    let shape = shape?;
    let (then, now) = (centred(&x_before, &shape), centred(&x_after, &shape));
    let slope = dot(&now, &y_after) / dot(&now, &now).max(f64::MIN_POSITIVE);
    let kind = match slope {
        _ if !is => Kind::Vanished,
        slope if slope < 0.0 => Kind::Reversed,
        slope if slope > 1.0 => Kind::Stronger,
        _ => Kind::Weaker,
    };
    let after = if is { slope * size(&then) } else { 0.0 };
    Some((sized(size(&then)), sized(after), kind))
}

/// The curve of one cause before a change: what takes the place of the cause where a break is looked for.
pub(super) fn curve_of(
    comparison: &Comparison<'_>,
    (before, after): (&[&Batch], &[&Batch]),
    at: Place,
) -> Option<GpRegression> {
    let values = |group: &[&Batch]| {
        let of = |node: Node| column(group, node, comparison.past());
        (of(Node::new(at.cause, at.lag)), of(Node::new(at.effect, 0)))
    };
    let ((x, y), (x_after, y_after)) = (values(before), values(after));
    if tail_dependence(&x, &y) <= LINK { curve(&x, &y) } else { curve(&x_after, &y_after) }
}

fn curve(x: &[f64], y: &[f64]) -> Option<GpRegression> {
    let from = x.len().saturating_sub(MOST);
    fitted(&y[from..], &[x[from..].to_vec()])
}

fn centred(x: &[f64], curve: &GpRegression) -> Vec<f64> {
    let mut values: Vec<f64> = x.iter().map(|x| curve.mean(&[*x])).collect();
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    values.iter_mut().for_each(|value| *value -= mean);
    values
}

/// The residuals of the last `n` rows of the regression on the newest rows.
fn residuals(y: &[f64], x: &[Vec<f64>], n: usize) -> Option<Vec<f64>> {
    let from = y.len().saturating_sub(MOST.max(n));
    let x: Vec<Vec<f64>> = x.iter().map(|row| row[from..].to_vec()).collect();
    let y = &y[from..];
    let regression = fitted(y, &x)?;
    let place = |t: usize| x.iter().map(|row| row[t]).collect::<Vec<f64>>();
    Some((y.len().saturating_sub(n)..y.len()).map(|t| y[t] - regression.mean(&place(t))).collect())
}

/// A regression on all rows with the hyperparameters of some, evenly spread. `None` where a column is constant.
fn fitted(y: &[f64], x: &[Vec<f64>]) -> Option<GpRegression> {
    let every = y.len().div_ceil(SEARCHED).max(1);
    let some = |row: &[f64]| row.iter().step_by(every).copied().collect::<Vec<f64>>();
    let some_x: Vec<Vec<f64>> = x.iter().map(|row| some(row)).collect();
    let found = GpOptimum::find(&some(y), &some_x, &TestSettings::default()).ok()?;
    GpRegression::at(y, x, found.length_scale, found.noise).ok()
}
