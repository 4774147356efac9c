//! The adaptive lasso: which of many columns a variable needs.
//!
//! 1. All are standardised; the weight of a column is the size of its coefficient in the regression on all of them.
//! 2. The lasso's whole path on the weighted columns, by least angles: from one *knot* to the next either a column enters (as
//!    correlated with the rest as those in use) or one leaves (its coefficient passes 0).
//! 3. At each knot `BIC = n ln(2 pi s2) + RSS / s2 + ln(n) k` with `k` coefficients that are not 0, where `s2` is the residual
//!    variance of the full regression. The columns of the best knot stay.
//!
//! Sources: Zou 2006, JASA 101:1418; Efron, Hastie, Johnstone and Tibshirani 2004, Annals of Statistics 32:407.

use crate::numeric::{least_squares::Compressed, rows::dot};

/// Products between columns that were centred and scaled to norm 1.
pub(super) struct Products {
    size: usize,
    values: Vec<f64>,
}

impl Products {
    pub(super) fn new(frame: &Compressed) -> Self {
        let size = frame.len();
        let norms: Vec<f64> = (0..size).map(|k| dot(frame.column(k), frame.column(k)).sqrt()).collect();
        let mut values = vec![0.0; size * size];
        for i in (0..size).filter(|&i| norms[i] > 0.0) {
            for j in (0..=i).filter(|&j| norms[j] > 0.0) {
                let product = dot(frame.column(i), frame.column(j)) / (norms[i] * norms[j]);
                values[i * size + j] = product;
                values[j * size + i] = product;
            }
        }
        Self { size, values }
    }

    fn at(&self, i: usize, j: usize) -> f64 {
        self.values[i * self.size + j]
    }
}

/// A coefficient up to this is 0.
const ZERO: f64 = f64::EPSILON;
/// Smallest pivot of a column that is not determined by those in use.
const PIVOT: f64 = 1e-10;

/// The columns among `candidates` that `target` needs, in the order of `candidates`.
pub(super) fn support(products: &Products, target: usize, candidates: &[usize], n: usize) -> Vec<usize> {
    let full: Vec<f64> = match solve(products, candidates, |k| products.at(candidates[k], target)) {
        Some(coefficients) => coefficients,
        // Columns that determine each other: their correlations stand in.
        None => candidates.iter().map(|&k| products.at(k, target)).collect(),
    };
    // All sums of squares are in units of the target's.
    let rss_of = |coefficients: &[f64]| -> f64 {
        let mut rss = products.at(target, target);
        for (i, a) in coefficients.iter().enumerate().filter(|(_, a)| **a != 0.0) {
            let fitted: f64 = coefficients
                .iter()
                .enumerate()
                .map(|(j, b)| b * products.at(candidates[i], candidates[j]))
                .sum();
            rss += a * (fitted - 2.0 * products.at(candidates[i], target));
        }
        rss.max(0.0)
    };
    let dof = n.saturating_sub(candidates.len() + 1);
    let s2 = rss_of(&full) / dof.max(1) as f64;
    let weights: Vec<f64> = full.iter().map(|v| v.abs()).collect();
    let mut best = (f64::INFINITY, Vec::new());
    path(products, target, candidates, &weights, |weighted| {
        let coefficients: Vec<f64> = weighted.iter().zip(&weights).map(|(b, w)| b * w).collect();
        let used: Vec<usize> = (0..candidates.len()).filter(|&k| weighted[k].abs() > ZERO).collect();
        let bic = rss_of(&coefficients) / s2 + (n as f64).ln() * used.len() as f64;
        if bic < best.0 {
            best = (bic, used);
        }
    });
    best.1.into_iter().map(|k| candidates[k]).collect()
}

/// Walks the lasso path of `target` on the weighted columns; `knot` gets the coefficients at each knot.
fn path(
    products: &Products,
    target: usize,
    candidates: &[usize],
    weights: &[f64],
    mut knot: impl FnMut(&[f64]),
) {
    let size = candidates.len();
    let gram = |i: usize, j: usize| weights[i] * weights[j] * products.at(candidates[i], candidates[j]);
    let mut coefficients = vec![0.0; size];
    let mut correlations: Vec<f64> =
        (0..size).map(|k| weights[k] * products.at(candidates[k], target)).collect();
    let mut active: Vec<usize> = Vec::new();
    let mut out: Vec<bool> = weights.iter().map(|w| *w <= ZERO).collect();
    let mut dropped = None;
    knot(&coefficients);
    // Each column enters once, and leaves and comes back a few times at most.
    for _ in 0..8 * size + 8 {
        let free = (0..size).filter(|k| !out[*k] && !active.contains(k) && Some(*k) != dropped);
        let next =
            free.max_by(|&a, &b| correlations[a].abs().total_cmp(&correlations[b].abs()).then(b.cmp(&a)));
        if dropped.take().is_none() || active.is_empty() {
            let Some(next) = next else { break };
            if correlations[next].abs() <= 1e-14 {
                break;
            }
            active.push(next);
        }
        let level = active.iter().map(|&k| correlations[k].abs()).fold(0.0, f64::max);
        let signs: Vec<f64> = active.iter().map(|&k| correlations[k].signum()).collect();
        let Some(direction) = solve_by(active.len(), |i, j| gram(active[i], active[j]), |i| signs[i]) else {
            // The last column is determined by those in use.
            if let Some(last) = active.pop() {
                out[last] = true;
            }
            continue;
        };
        // Along the direction all correlations in use fall at the same rate, 1.
        let slopes: Vec<f64> =
            (0..size).map(|k| active.iter().zip(&direction).map(|(&a, d)| gram(k, a) * d).sum()).collect();
        let mut step = level;
        for k in (0..size).filter(|k| !out[*k] && !active.contains(k)) {
            for (rest, rate) in
                [(level - correlations[k], 1.0 - slopes[k]), (level + correlations[k], 1.0 + slopes[k])]
            {
                if rate > 1e-14 && rest / rate < step && rest / rate >= 0.0 {
                    step = rest / rate;
                }
            }
        }
        let leaving = active
            .iter()
            .zip(&direction)
            .map(|(&k, d)| (k, -coefficients[k] / d))
            .filter(|(_, at)| *at > 1e-14 && *at < step)
            .min_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((_, at)) = leaving {
            step = at;
        }
        active.iter().zip(&direction).for_each(|(&k, d)| coefficients[k] += step * d);
        correlations.iter_mut().zip(&slopes).for_each(|(c, slope)| *c -= step * slope);
        if let Some((gone, _)) = leaving {
            coefficients[gone] = 0.0;
            active.retain(|&k| k != gone);
            dropped = Some(gone);
        }
        knot(&coefficients);
        if step >= level {
            break;
        }
    }
}

fn solve(products: &Products, columns: &[usize], rhs: impl Fn(usize) -> f64) -> Option<Vec<f64>> {
    solve_by(columns.len(), |i, j| products.at(columns[i], columns[j]), rhs)
}

/// Solves a symmetric system by Cholesky; `None` if it is close to singular.
fn solve_by(size: usize, at: impl Fn(usize, usize) -> f64, rhs: impl Fn(usize) -> f64) -> Option<Vec<f64>> {
    let mut factor = vec![0.0; size * size];
    let mut x = vec![0.0; size];
    for i in 0..size {
        for j in 0..=i {
            let (row_i, row_j) = (&factor[i * size..i * size + j], &factor[j * size..j * size + j]);
            let rest = at(i, j) - row_i.iter().zip(row_j).map(|(a, b)| a * b).sum::<f64>();
            if i != j {
                factor[i * size + j] = rest / factor[j * size + j];
            } else if rest > PIVOT * at(i, i) {
                factor[i * size + i] = rest.sqrt();
            } else {
                return None;
            }
        }
        let known: f64 = (0..i).map(|k| factor[i * size + k] * x[k]).sum();
        x[i] = (rhs(i) - known) / factor[i * size + i];
    }
    for i in (0..size).rev() {
        let known: f64 = (i + 1..size).map(|k| factor[k * size + i] * x[k]).sum();
        x[i] = (x[i] - known) / factor[i * size + i];
    }
    Some(x)
}
