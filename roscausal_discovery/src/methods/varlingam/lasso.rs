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
/// Part of a target's variance that rounding leaves of a perfect fit.
const NOTHING: f64 = 1e-13;
/// Smallest pivot of a column that is not determined by those in use.
const PIVOT: f64 = 1e-10;

/// The columns among `candidates` that `target` needs, in the order of `candidates`.
pub(super) fn support(products: &Products, target: usize, candidates: &[usize], n: usize) -> Vec<usize> {
    let with_target: Vec<f64> = candidates.iter().map(|&k| products.at(k, target)).collect();
    // Columns that determine each other: their correlations stand in.
    let full = all_together(products, candidates, &with_target).unwrap_or_else(|| with_target.clone());
    let square = products.at(target, target);
    let dof = n.saturating_sub(candidates.len() + 1);
    let s2 = (square - explained_by_all(products, candidates, &with_target, &full)).max(NOTHING)
        / dof.max(1) as f64;
    let weights: Vec<f64> = full.iter().map(|v| v.abs()).collect();
    let mut best = (f64::INFINITY, Vec::new());
    let mut path = Path::new(products, candidates, &with_target, &weights);
    loop {
        let used: Vec<usize> = (0..candidates.len()).filter(|&k| path.coefficients[k].abs() > ZERO).collect();
        let rss = (square - path.explained()).max(0.0);
        let bic = rss / s2 + libm::log(n as f64) * used.len() as f64;
        if bic < best.0 {
            best = (bic, used);
        }
        if !path.goes_on() {
            break;
        }
    }
    best.1.into_iter().map(|k| candidates[k]).collect()
}

/// The coefficients of the regression on all columns; `None` if they are close to determining each other.
fn all_together(products: &Products, columns: &[usize], with_target: &[f64]) -> Option<Vec<f64>> {
    let mut factor = Factor::default();
    let grown = (0..columns.len()).all(|i| factor.push((0..=i).map(|j| products.at(columns[i], columns[j]))));
    grown.then(|| factor.solve(with_target))
}

/// What any coefficients take off the target's square: `2 b'X'y - b'X'X b`.
fn explained_by_all(products: &Products, columns: &[usize], with_target: &[f64], b: &[f64]) -> f64 {
    let fitted =
        |i: usize| -> f64 { columns.iter().zip(b).map(|(&j, b)| b * products.at(columns[i], j)).sum() };
    (0..columns.len()).map(|i| b[i] * (2.0 * with_target[i] - fitted(i))).sum()
}

/// The lasso's path on the weighted columns, from knot to knot.
struct Path {
    /// Products of the weighted columns, row after row.
    gram: Vec<f64>,
    /// The columns' products with the target.
    at_start: Vec<f64>,
    /// The columns' products with what is left of the target.
    correlations: Vec<f64>,
    coefficients: Vec<f64>,
    active: Vec<usize>,
    /// Columns that may still enter.
    free: Vec<bool>,
    /// The factor of the products of the columns in use.
    factor: Factor,
    dropped: Option<usize>,
    /// Each column enters once, and leaves and comes back a few times at most.
    knots_left: usize,
}

impl Path {
    fn new(products: &Products, candidates: &[usize], with_target: &[f64], weights: &[f64]) -> Self {
        let size = candidates.len();
        let row = |i: usize| {
            candidates.iter().zip(weights).map(move |(&j, w)| weights[i] * w * products.at(candidates[i], j))
        };
        let at_start: Vec<f64> = weights.iter().zip(with_target).map(|(w, c)| w * c).collect();
        Self {
            gram: (0..size).flat_map(row).collect(),
            correlations: at_start.clone(),
            at_start,
            coefficients: vec![0.0; size],
            active: Vec::new(),
            factor: Factor::default(),
            free: weights.iter().map(|w| *w > ZERO).collect(),
            dropped: None,
            knots_left: 8 * size + 8,
        }
    }

    fn row(&self, k: usize) -> &[f64] {
        let size = self.coefficients.len();
        &self.gram[k * size..(k + 1) * size]
    }

    /// What the coefficients take off the target's square: `b'(X'y + c)`, where `c = X'(y - X b)` are the correlations.
    fn explained(&self) -> f64 {
        let with_rest = self.at_start.iter().zip(&self.correlations).map(|(y, c)| y + c);
        self.coefficients.iter().zip(with_rest).map(|(b, c)| b * c).sum()
    }

    /// Takes a column into use; false if those in use determine it, which leaves it out for good.
    fn enter(&mut self, k: usize) -> bool {
        self.free[k] = false;
        let products: Vec<f64> = self.active.iter().chain([&k]).map(|&a| self.row(k)[a]).collect();
        let grown = self.factor.push(products.into_iter());
        if grown {
            self.active.push(k);
        }
        grown
    }

    /// Takes a column out of use. The columns after it are factorised anew.
    fn leave(&mut self, k: usize) {
        let place = self.active.iter().position(|&a| a == k).unwrap_or(self.active.len());
        self.factor.truncate(place);
        for later in self.active.split_off(place).into_iter().skip(1) {
            self.enter(later);
        }
        self.free[k] = true;
    }

    /// Walks to the next knot; false at the end.
    fn goes_on(&mut self) -> bool {
        let size = self.coefficients.len();
        let dropped = self.dropped.take();
        let mut must_enter = dropped.is_none() || self.active.is_empty();
        while must_enter {
            let free = (0..size).filter(|&k| self.free[k] && Some(k) != dropped);
            let size_of = |k: usize| self.correlations[k].abs();
            let Some(next) = free.max_by(|&a, &b| size_of(a).total_cmp(&size_of(b)).then(b.cmp(&a))) else {
                return false;
            };
            if size_of(next) <= 1e-14 {
                return false;
            }
            must_enter = !self.enter(next);
        }
        if self.knots_left == 0 {
            return false;
        }
        self.knots_left -= 1;
        let level = self.active.iter().map(|&k| self.correlations[k].abs()).fold(0.0, f64::max);
        let signs: Vec<f64> = self.active.iter().map(|&k| self.correlations[k].signum()).collect();
        let direction = self.factor.solve(&signs);
        // Along the direction all correlations in use fall at the same rate, 1.
        let mut slopes = vec![0.0; size];
        for (&a, d) in self.active.iter().zip(&direction) {
            slopes.iter_mut().zip(self.row(a)).for_each(|(slope, product)| *slope += product * d);
        }
        let mut step = level;
        for k in (0..size).filter(|&k| self.free[k]) {
            let (correlation, slope) = (self.correlations[k], slopes[k]);
            for (rest, rate) in [(level - correlation, 1.0 - slope), (level + correlation, 1.0 + slope)] {
                if rate > 1e-14 && rest >= 0.0 && rest < step * rate {
                    step = rest / rate;
                }
            }
        }
        let zeros = self.active.iter().zip(&direction).map(|(&k, d)| (k, -self.coefficients[k] / d));
        let on_the_way = zeros.filter(|(_, at)| *at > 1e-14 && *at < step);
        let leaving = on_the_way.min_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((_, at)) = leaving {
            step = at;
        }
        self.active.iter().zip(&direction).for_each(|(&k, d)| self.coefficients[k] += step * d);
        self.correlations.iter_mut().zip(&slopes).for_each(|(c, slope)| *c -= step * slope);
        if let Some((gone, _)) = leaving {
            self.coefficients[gone] = 0.0;
            self.leave(gone);
            self.dropped = Some(gone);
        }
        if step >= level {
            self.knots_left = 0;
        }
        true
    }
}

/// The Cholesky factor of a symmetric matrix that grows by rows at its end.
#[derive(Default)]
struct Factor {
    /// The lower triangle, row after row: row `i` has `i + 1` entries.
    rows: Vec<f64>,
    size: usize,
}

impl Factor {
    fn row(&self, i: usize) -> &[f64] {
        let from = i * (i + 1) / 2;
        &self.rows[from..=from + i]
    }

    /// Adds a row, given up to the diagonal; false, and nothing changes, if the matrix would be close to singular.
    fn push(&mut self, row: impl Iterator<Item = f64>) -> bool {
        let from = self.rows.len();
        self.rows.extend(row);
        let (known, new) = self.rows.split_at_mut(from);
        let mut start = 0;
        for j in 0..self.size {
            let above = &known[start..=start + j];
            new[j] = (new[j] - dot(&new[..j], &above[..j])) / above[j];
            start += j + 1;
        }
        let diagonal = new[self.size];
        let rest = diagonal - dot(&new[..self.size], &new[..self.size]);
        let free = rest > PIVOT * diagonal;
        if free {
            new[self.size] = rest.sqrt();
            self.size += 1;
        } else {
            self.rows.truncate(from);
        }
        free
    }

    /// Keeps the first rows.
    fn truncate(&mut self, size: usize) {
        self.size = self.size.min(size);
        self.rows.truncate(self.size * (self.size + 1) / 2);
    }

    /// Solves the system for a right-hand side of as many entries as there are rows.
    fn solve(&self, rhs: &[f64]) -> Vec<f64> {
        let mut x = rhs.to_vec();
        for i in 0..self.size {
            let row = self.row(i);
            x[i] = (x[i] - dot(&row[..i], &x[..i])) / row[i];
        }
        for i in (0..self.size).rev() {
            let row = self.row(i);
            x[i] /= row[i];
            let (before, now) = x.split_at_mut(i);
            before.iter_mut().zip(row).for_each(|(v, factor)| *v -= factor * now[0]);
        }
        x
    }
}
