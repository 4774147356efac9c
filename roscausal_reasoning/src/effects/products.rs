//! Sums of products of columns: what every linear regression among them follows from, for all rows or for a bootstrap's.

use roscausal_discovery::dot;

use crate::{
    linear::{CONSTANT, Factor},
    random,
};

/// Columns with mean 0, row by row.
pub(crate) struct Products {
    m: usize,
    /// Number of rows.
    pub(crate) n: usize,
    /// Means of the columns.
    pub(crate) means: Vec<f64>,
    columns: Vec<Vec<f64>>,
}

/// The sums of some rows: those of the columns, then those of their products, `a >= b`.
#[derive(Clone)]
pub(crate) struct Sums {
    m: usize,
    rows: f64,
    sums: Vec<f64>,
}

/// Sums of the rows before each row, so that those of a block are a difference.
pub(crate) struct Prefix {
    m: usize,
    width: usize,
    sums: Vec<f64>,
}

fn cell(a: usize, b: usize) -> usize {
    let (a, b) = (a.max(b), a.min(b));
    a * (a + 1) / 2 + b
}

impl Products {
    /// Of columns of the same length.
    pub(crate) fn new(mut columns: Vec<Vec<f64>>) -> Self {
        let n = columns.first().map_or(0, Vec::len);
        let centre = |column: &mut Vec<f64>| {
            let mean = column.iter().sum::<f64>() / n.max(1) as f64;
            column.iter_mut().for_each(|v| *v -= mean);
            // What rounding leaves of a constant is no variance.
            if column.iter().all(|v| v.abs() <= CONSTANT * mean.abs()) {
                column.fill(0.0);
            }
            mean
        };
        Self { m: columns.len(), n, means: columns.iter_mut().map(centre).collect(), columns }
    }

    /// Of all rows.
    pub(crate) fn whole(&self) -> Sums {
        let mut sums: Vec<f64> = self.columns.iter().map(|column| column.iter().sum()).collect();
        for a in 0..self.m {
            for b in 0..=a {
                sums.push(dot(&self.columns[a], &self.columns[b]));
            }
        }
        Sums { m: self.m, rows: self.n as f64, sums }
    }

    /// Of the rows up to each.
    pub(crate) fn prefix(&self) -> Prefix {
        let width = self.m + self.m * (self.m + 1) / 2;
        let mut sums = vec![0.0; (self.n + 1) * width];
        let mut row = vec![0.0; self.m];
        for t in 0..self.n {
            row.iter_mut().zip(&self.columns).for_each(|(cell, column)| *cell = column[t]);
            let (before, after) = sums.split_at_mut((t + 1) * width);
            let (before, after) = (&before[t * width..], &mut after[..width]);
            (0..self.m).for_each(|a| after[a] = before[a] + row[a]);
            let mut at = self.m;
            for a in 0..self.m {
                for b in 0..=a {
                    after[at] = row[a].mul_add(row[b], before[at]);
                    at += 1;
                }
            }
        }
        Prefix { m: self.m, width, sums }
    }
}

impl Prefix {
    /// The sums of a moving-block bootstrap of `stretches` of rows.
    pub(crate) fn resampled(&self, seed: u64, stretches: &[usize]) -> Sums {
        let block = random::block_length(stretches.iter().sum());
        let (mut sums, mut rows) = (vec![0.0; self.width], 0);
        for (start, length) in random::blocks(seed, stretches, block) {
            let (first, last) = (start * self.width, (start + length) * self.width);
            let difference =
                self.sums[last..last + self.width].iter().zip(&self.sums[first..first + self.width]);
            sums.iter_mut().zip(difference).for_each(|(sum, (after, before))| *sum += after - before);
            rows += length;
        }
        Sums { m: self.m, rows: rows as f64, sums }
    }
}

impl Sums {
    /// The covariance of two columns, times the rows.
    fn centred(&self, a: usize, b: usize) -> f64 {
        self.sums[self.m + cell(a, b)] - self.sums[a] * self.sums[b] / self.rows
    }

    /// Standard deviation of a column, by `n`.
    pub(crate) fn deviation(&self, column: usize) -> f64 {
        (self.centred(column, column) / self.rows).max(0.0).sqrt()
    }

    /// The coefficients of `target` on `columns`, and the sum of squared residuals; 0 for a column that earlier ones explain.
    pub(crate) fn regress(&self, target: usize, columns: &[usize]) -> (Vec<f64>, f64) {
        let norms: Vec<f64> = columns.iter().map(|&c| self.centred(c, c).max(0.0).sqrt()).collect();
        let scale = |k: usize| if norms[k] > 0.0 { 1.0 / norms[k] } else { 0.0 };
        let factor =
            Factor::new(columns.len(), |a, b| self.centred(columns[a], columns[b]) * scale(a) * scale(b));
        let solved = factor.solve(|k| self.centred(columns[k], target) * scale(k));
        let mut coefficients = vec![0.0; columns.len()];
        let mut explained = 0.0;
        for (&k, value) in factor.kept.iter().zip(solved) {
            coefficients[k] = value * scale(k);
            explained += coefficients[k] * self.centred(columns[k], target);
        }
        (coefficients, (self.centred(target, target) - explained).max(0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::{least_squares, weighted};

    fn columns() -> Vec<Vec<f64>> {
        let number = |i: usize| roscausal_discovery::mix(i as u64) as f64 / u64::MAX as f64;
        (0..4).map(|k| (0..90).map(|i| number(4 * i + k) + 3.0).collect()).collect()
    }

    #[test]
    fn regressions_from_sums_are_least_squares() {
        let columns = columns();
        let products = Products::new(columns.clone());
        let (coefficients, rss) = products.whole().regress(3, &[0, 2]);
        let fit = least_squares(&columns[3], &[&columns[0], &columns[2]]);
        coefficients.iter().zip(&fit.coefficients).for_each(|(a, b)| assert!((a - b).abs() < 1e-12));
        assert!((rss / 87.0 - fit.variance).abs() < 1e-12);
    }

    #[test]
    fn a_bootstrap_from_sums_is_that_of_the_rows() {
        let columns = columns();
        let (coefficients, _) =
            Products::new(columns.clone()).prefix().resampled(5, &[50, 40]).regress(3, &[1]);
        let counts = random::block_counts(5, &[50, 40], random::block_length(90));
        let fit = weighted(&columns[3], &[&columns[1]], Some(&counts));
        assert!((coefficients[0] - fit.coefficients[0]).abs() < 1e-12);
    }
}
