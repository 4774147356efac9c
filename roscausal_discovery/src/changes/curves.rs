//! The comparison for mechanisms of any smooth form.
//!
//! 1. The inputs of an effect are its own past and every cause that it depends on at 0.2 (distance correlation of ranks), before
//!    or after.
//! 2. Rows after whose inputs lie beyond those before are left out: nobody knows the curve there, so a wider spread is not a change.
//! 3. One Gaussian process of the effect on its inputs, over the rows before and after together. Its hyperparameters are those of
//!    at most 400 of the rows.
//! 4. For each cause the score test of a curve that only the rows after have (`score.rs`).
//!
//! What became of a link follows from the curve that it had: the slope `b` of what the other inputs leave of the effect on
//! that curve is 1 if nothing changed, 0 if the link is gone, and negative if it is reversed.
//!
//! Sources: Szekely, Rizzo and Bakirov 2007 (distance correlation), Rasmussen and Williams 2006, Runge et al. 2019.

use super::{
    batch::{Batch, column},
    event::Kind,
    place::Place,
    score::Score,
    terms::{Comparison, Difference, Mechanisms},
};
use crate::{
    independence_tests::{GpOptimum, GpRegression, TestSettings, tail_dependence},
    numeric::{
        normal::normal_quantile,
        rows::{centred, quantile},
        slope::{Slope, dot},
    },
    types::{Node, Result},
};

/// Level at which a cause is an input.
const INPUT: f64 = 0.2;
/// Level at which there is a link.
const LINK: f64 = 0.05;
/// Smallest p-value that is told from others.
const SMALLEST: f64 = 1e-300;
/// Rows that choose the hyperparameters.
const SEARCHED: usize = 400;
/// Share of the rows before beyond which, at either end, rows after are left out; and fewest rows that must be left of them.
const OUTER: f64 = 0.01;
const FEWEST: usize = 40;
/// Most rows of a regression, the newest ones, and how many of them may be rows after.
const MOST: usize = 1200;
const MOST_AFTER: usize = 600;

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
        all.push(comparison.nodes().filter(|&node| node.var == effect || depends(node)).collect());
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
    let of = |node: Node| column(&together, node, comparison.past());
    // Each batch is centred by itself, so the rows after are the last ones of all.
    let mut y = of(Node::new(first.effect, 0));
    let n_before = column(before, Node::new(first.effect, 0), comparison.past()).len();
    let mut x: Vec<Vec<f64>> = mechanisms.inputs(first.effect).iter().map(|&node| of(node)).collect();
    let known = known_rows(&x, n_before);
    let n_after = known.iter().filter(|t| **t >= n_before).count();
    if n_after < FEWEST {
        return Ok(Vec::new());
    }
    // Of a long part every so many rows, and the newest ones before it.
    let (known_before, known_after) = known.split_at(known.len() - n_after);
    let known_after: Vec<usize> = known_after.iter().step_by(n_after.div_ceil(MOST_AFTER)).copied().collect();
    let n_after = known_after.len();
    let begin = known_before.len().saturating_sub(MOST - n_after);
    let chosen: Vec<usize> = known_before[begin..].iter().chain(&known_after).copied().collect();
    let pick = |values: &Vec<f64>| chosen.iter().map(|&t| values[t]).collect::<Vec<f64>>();
    y = pick(&y);
    x.iter_mut().for_each(|row| *row = pick(row));
    let Some(regression) = fitted(&y, &x) else { return Ok(Vec::new()) };
    comparison.control.check()?;
    let score = Score::new(&regression, n_after)?;
    let none = Slope { value: 0.0, variance: 1.0 };
    let difference = |at: &Place| {
        let p = score.p_value(&pick(&of(Node::new(at.cause, at.lag))));
        let z = -normal_quantile(0.5 * p.max(SMALLEST));
        Difference { at: *at, before: none, after: none, kind: Kind::Weaker, z, p: 1.0, q: 1.0 }
    };
    Ok(places.iter().map(difference).collect())
}

/// The rows before, and those after whose inputs all lie between the outer [`OUTER`] of the ones before: beyond them nobody knows
/// the curve that there was.
fn known_rows(inputs: &[Vec<f64>], n_before: usize) -> Vec<usize> {
    let ends = |values: &Vec<f64>| {
        let mut sorted = values[..n_before].to_vec();
        sorted.sort_unstable_by(f64::total_cmp);
        [OUTER, 1.0 - OUTER].map(|q| quantile(&sorted, q))
    };
    let ranges: Vec<[f64; 2]> = inputs.iter().map(ends).collect();
    let within = |t: usize| {
        inputs.iter().zip(&ranges).all(|(values, [low, high])| (*low..=*high).contains(&values[t]))
    };
    let n = inputs.first().map_or(0, Vec::len);
    (0..n).filter(|&t| t < n_before || within(t)).collect()
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
        let now = curve(&x_after, &y_after).map_or(0.0, |curve| size(&part_of(&x_after, &curve)));
        return Some((sized(0.0), sized(now), Kind::Appeared));
    }
    let shape = shape?;
    let (then, now) = (part_of(&x_before, &shape), part_of(&x_after, &shape));
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

/// The part of an effect that follows a curve, without its mean.
pub(super) fn part_of(x: &[f64], curve: &GpRegression) -> Vec<f64> {
    centred(x.iter().map(|x| curve.mean(&[*x])).collect())
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
