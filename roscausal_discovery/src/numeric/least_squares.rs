//! Least squares of several targets on the same columns, with the statistics of its coefficients.
//!
//! 1. Each column is centred (if there is a constant) and scaled to norm 1, so that units do not matter.
//! 2. Householder QR of all columns and targets together gives one triangle. Its rows hold the coefficients of the targets; what
//!    is left below them holds the residuals, so that a nearly perfect fit loses no digits.
//! 3. A column that the earlier ones determine is taken out, and all columns of that combination are noted: their coefficients
//!    say nothing.
//!
//! Source: Golub and Van Loan 2013, "Matrix computations", 5.2 and 5.3. For example `y = 1 + 2 x` exactly: coefficient 2,
//! residual sum 0 but for rounding, F above 1e20.

use super::rows::{dot, is_constant, largest, sum};

/// Smallest part of a column's norm that the others leave it, if it is not determined by them.
const DETERMINED: f64 = 1e-10;
/// Norm up to which what is left of a target of norm 1 is rounding. Statistics count it as this, so that coefficients that are
/// rounding as well say nothing.
pub(crate) const ROUNDING: f64 = 1e-12;
/// Smallest part that a column has in a combination.
const INVOLVED: f64 = 1e-8;

/// A regression of targets on columns, all of the same length.
pub(crate) struct LeastSquares {
    /// Rows.
    n: usize,
    /// The columns in the triangle.
    kept: Vec<usize>,
    /// Where a column is in the triangle.
    place: Vec<Option<usize>>,
    undetermined: Vec<bool>,
    constant: bool,
    /// Norms of the columns and of the targets, after centring.
    norms: Vec<f64>,
    target_norms: Vec<f64>,
    /// Inverse of the triangle of the columns, by rows.
    inverse: Vec<Vec<f64>>,
    /// Coefficients between scaled columns, by target.
    scaled: Vec<Vec<f64>>,
    /// Residuals of the scaled targets, as a triangle: `[target][row]`.
    left: Vec<Vec<f64>>,
}

/// Centres (if there is a constant) and scales to norm 1; returns the norm, which is 0 of a constant.
fn scale(row: &mut [f64], constant: bool) -> f64 {
    if constant {
        if is_constant(row) {
            row.fill(0.0);
            return 0.0;
        }
        // Twice: the second pass subtracts what rounding left in the first.
        for _ in 0..2 {
            let mean = sum(row) / row.len() as f64;
            row.iter_mut().for_each(|v| *v -= mean);
        }
    }
    // By the largest value first: the square of a number like 1e200 is none.
    let largest = largest(row);
    if !(1.0 / largest).is_normal() {
        row.fill(0.0);
        return 0.0;
    }
    multiply(row, 1.0 / largest);
    let norm = dot(row, row).sqrt();
    multiply(row, 1.0 / norm);
    largest * norm
}

fn multiply(row: &mut [f64], factor: f64) {
    row.iter_mut().for_each(|v| *v *= factor);
}

/// Columns turned into a frame in which they are as short as they are many. All lengths and angles stay, so that every regression
/// among them has the same result and takes the time of few rows.
pub(crate) struct Compressed {
    /// Rows of the columns.
    n: usize,
    columns: Vec<Vec<f64>>,
}

impl Compressed {
    /// The centred columns, all of the same length.
    pub(crate) fn new(columns: &[&[f64]]) -> Self {
        let n = columns.first().map_or(0, |row| row.len());
        let (matrix, norms) = scaled(columns, true);
        let mut columns = triangle(matrix);
        columns.iter_mut().zip(norms).for_each(|(column, norm)| multiply(column, norm));
        Self { n, columns }
    }

    /// Number of columns.
    pub(crate) fn len(&self) -> usize {
        self.columns.len()
    }

    /// A column in the frame.
    pub(crate) fn column(&self, k: usize) -> &[f64] {
        &self.columns[k]
    }

    /// The regression of one column on others and a constant.
    pub(crate) fn regress(&self, target: usize, on: &[usize]) -> LeastSquares {
        let columns: Vec<&[f64]> = on.iter().map(|&k| self.column(k)).collect();
        let fit = LeastSquares::new(&columns, &[self.column(target)], false);
        // The columns have their mean off: the constant is in the count of degrees of freedom alone.
        LeastSquares { n: self.n, constant: true, ..fit }
    }
}

impl LeastSquares {
    /// Regresses each of `targets` on `columns`, and on a constant if asked to.
    pub(crate) fn new(columns: &[&[f64]], targets: &[&[f64]], constant: bool) -> Self {
        let n = columns.iter().chain(targets).next().map_or(0, |row| row.len());
        let mut kept: Vec<usize> = (0..columns.len()).collect();
        let mut norms = vec![0.0; columns.len()];
        let mut undetermined = vec![false; columns.len()];
        let (triangle, target_norms) = loop {
            let rows: Vec<&[f64]> = kept.iter().map(|&k| columns[k]).chain(targets.iter().copied()).collect();
            let (matrix, mut norms_now) = scaled(&rows, constant);
            let target_norms = norms_now.split_off(kept.len());
            kept.iter().zip(norms_now).for_each(|(&k, norm)| norms[k] = norm);
            let constants = kept.extract_if(.., |k| norms[*k] == 0.0).count();
            if constants > 0 {
                continue;
            }
            let triangle = triangle(matrix);
            let at =
                |i: usize, j: usize| triangle.get(j).and_then(|column| column.get(i)).copied().unwrap_or(0.0);
            let Some(dependent) = (0..kept.len()).find(|&k| at(k, k).abs() < DETERMINED) else {
                break (triangle, target_norms);
            };
            // The combination of earlier columns that gives this one.
            let mut combination = vec![0.0; dependent];
            for i in (0..dependent).rev() {
                let known: f64 = (i + 1..dependent).map(|j| at(i, j) * combination[j]).sum();
                combination[i] = (at(i, dependent) - known) / at(i, i);
            }
            kept.iter().zip(&combination).for_each(|(&k, part)| undetermined[k] |= part.abs() > INVOLVED);
            undetermined[kept.remove(dependent)] = true;
        };
        let mut place = vec![None; columns.len()];
        kept.iter().enumerate().for_each(|(at, &k)| place[k] = Some(at));
        let size = kept.len();
        let inverse = inverse_of_upper(&triangle, size);
        let scaled = triangle[size..]
            .iter()
            .map(|target| {
                inverse.iter().map(|row| row.iter().zip(target).map(|(a, b)| a * b).sum()).collect()
            })
            .collect();
        let left = triangle[size..].iter().map(|target| target.get(size..).unwrap_or(&[]).to_vec()).collect();
        Self { n, kept, place, undetermined, constant, norms, target_norms, inverse, scaled, left }
    }

    /// Degrees of freedom of the residuals; 0 where the columns fit anything.
    pub(crate) fn dof(&self) -> usize {
        self.n.saturating_sub(self.kept.len() + usize::from(self.constant))
    }

    /// Whether the coefficient of a column says nothing, because other columns determine it.
    pub(crate) fn is_undetermined(&self, column: usize) -> bool {
        self.undetermined[column]
    }

    /// Coefficient of a column for a target, in their units; 0 of a column that is taken out.
    pub(crate) fn coefficient(&self, target: usize, column: usize) -> f64 {
        match self.place[column] {
            Some(at) => self.scaled[target][at] * self.target_norms[target] / self.norms[column],
            None => 0.0,
        }
    }

    /// The coefficient between the columns scaled to one deviation.
    pub(crate) fn standardized(&self, target: usize, column: usize) -> f64 {
        self.place[column].map_or(0.0, |at| self.scaled[target][at])
    }

    /// Residual sum of squares of the scaled target.
    fn scaled_rss(&self, target: usize) -> f64 {
        self.left[target].iter().map(|v| v * v).sum()
    }

    /// Mean square of the noise of a scaled target, by the degrees of freedom.
    fn noise(&self, target: usize) -> f64 {
        self.scaled_rss(target).max(ROUNDING * ROUNDING) / self.dof() as f64
    }

    /// Residual sum of squares of a target.
    pub(crate) fn rss(&self, target: usize) -> f64 {
        self.scaled_rss(target) * self.target_norms[target].powi(2)
    }

    /// `ln det(E'E / n)` of the residuals E of all targets; minus infinity where one is determined.
    pub(crate) fn ln_det(&self) -> f64 {
        let of = |j: usize| self.left[j].get(j).map_or(0.0, |v| v.abs()) * self.target_norms[j];
        (0..self.left.len()).map(|j| 2.0 * libm::log(of(j)) - libm::log(self.n as f64)).sum()
    }

    /// The t statistic of a coefficient; 0 where it says nothing.
    pub(crate) fn t(&self, target: usize, column: usize) -> f64 {
        let Some(at) = self.place[column].filter(|_| !self.undetermined[column] && self.dof() > 0) else {
            return 0.0;
        };
        let spread = self.inverse[at].iter().map(|v| v * v).sum::<f64>() * self.noise(target);
        quotient(self.scaled[target][at], spread.sqrt())
    }

    /// The F statistics, by target, that the coefficients of `columns` vanish; 0 where one of them says nothing.
    pub(crate) fn f(&self, columns: &[usize]) -> Vec<f64> {
        let none = vec![0.0; self.scaled.len()];
        if columns.is_empty() || self.dof() == 0 || columns.iter().any(|&k| self.undetermined[k]) {
            return none;
        }
        let Some(at) = columns.iter().map(|&k| self.place[k]).collect::<Option<Vec<usize>>>() else {
            return none;
        };
        // Rows of the inverse are the columns' directions; F measures the coefficients in an orthonormal frame of them.
        let frame = triangle(at.iter().map(|&at| self.inverse[at].clone()).collect());
        let along = |target: &Vec<f64>| -> f64 {
            let mut solved = Vec::with_capacity(at.len());
            for (i, &at) in at.iter().enumerate() {
                let known: f64 = solved.iter().enumerate().map(|(j, v)| frame[i][j] * v).sum();
                solved.push((target[at] - known) / frame[i][i]);
            }
            solved.iter().map(|v| v * v).sum()
        };
        (0..self.scaled.len())
            .map(|j| quotient(along(&self.scaled[j]) / at.len() as f64, self.noise(j)))
            .collect()
    }
}

/// `a / b`, where nothing over nothing is 0.
fn quotient(a: f64, b: f64) -> f64 {
    if a == 0.0 { 0.0 } else { a / b }
}

/// Columns, each centred if there is a constant and scaled to norm 1; and their norms.
fn scaled(columns: &[&[f64]], constant: bool) -> (Vec<Vec<f64>>, Vec<f64>) {
    let mut columns: Vec<Vec<f64>> = columns.iter().map(|column| column.to_vec()).collect();
    let norms = columns.iter_mut().map(|column| scale(column, constant)).collect();
    (columns, norms)
}

/// The triangular factor of a matrix, given by its columns: `[column][row]`, as many rows as there are columns, or rows of the matrix.
/// Step k mirrors what is below row k so that column k ends there. Not by a library: its sums have as many lanes as the processor,
/// and the last digits of a model would depend on the processor.
fn triangle(mut columns: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let rows = columns.first().map_or(0, Vec::len).min(columns.len());
    for k in 0..rows {
        let (done, later) = columns.split_at_mut(k + 1);
        let axis = &mut done[k][k..];
        let end = -dot(axis, axis).sqrt().copysign(axis[0]);
        axis[0] -= end;
        let half = -end * axis[0];
        for column in later.iter_mut().filter(|_| half > 0.0) {
            let along = dot(axis, &column[k..]) / half;
            column[k..].iter_mut().zip(&*axis).for_each(|(value, part)| *value -= along * part);
        }
        axis.fill(0.0);
        axis[0] = end;
    }
    columns.iter_mut().for_each(|column| column.truncate(rows));
    columns
}

/// The inverse of the leading `size` columns of an upper triangle, by rows; entries below the diagonal are 0.
fn inverse_of_upper(triangle: &[Vec<f64>], size: usize) -> Vec<Vec<f64>> {
    let mut inverse = vec![vec![0.0; size]; size];
    for j in 0..size {
        inverse[j][j] = 1.0 / triangle[j][j];
        for i in (0..j).rev() {
            let known: f64 = (i + 1..=j).map(|k| triangle[k][i] * inverse[k][j]).sum();
            inverse[i][j] = -known / triangle[i][i];
        }
    }
    inverse
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::Rng;

    fn noise(n: usize, seed: u64) -> Vec<f64> {
        let mut rng = Rng::new(seed);
        (0..n).map(|_| rng.unit() - 0.5).collect()
    }

    #[test]
    fn a_line_through_four_points_has_the_textbooks_numbers() {
        // y = 0.65 + 0.91 x; the squares of x around their mean sum to 5.
        let (x, y) = ([1.0, 2.0, 3.0, 4.0], [2.0, 2.0, 3.0, 4.7]);
        let fit = LeastSquares::new(&[&x], &[&y], true);
        assert!((fit.coefficient(0, 0) - 0.91).abs() < 1e-12, "{}", fit.coefficient(0, 0));
        let rss: f64 = x.iter().zip(y).map(|(x, y)| (y - 0.65 - 0.91 * x).powi(2)).sum();
        assert!((fit.rss(0) - rss).abs() < 1e-12 && fit.dof() == 2);
        let t = 0.91 / (rss / 2.0 / 5.0).sqrt();
        assert!((fit.t(0, 0) - t).abs() < 1e-10 && (fit.f(&[0])[0] - t * t).abs() < 1e-9);
    }

    #[test]
    fn f_is_the_gain_of_the_columns_over_what_is_left() {
        let columns: Vec<Vec<f64>> = (0..4).map(|k| noise(40, k)).collect();
        let y: Vec<f64> = (0..40).map(|t| columns[0][t] - 0.4 * columns[2][t] + noise(40, 9)[t]).collect();
        let rows: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        let (all, some) = (LeastSquares::new(&rows, &[&y], true), LeastSquares::new(&rows[..2], &[&y], true));
        let gain = (some.rss(0) - all.rss(0)) / 2.0 / (all.rss(0) / all.dof() as f64);
        assert!((all.f(&[2, 3])[0] - gain).abs() < 1e-10 * gain);
    }

    #[test]
    fn compressed_columns_have_the_same_regressions() {
        let columns: Vec<Vec<f64>> =
            (0..4).map(|k| noise(200, k).iter().map(|v| 3.0 * v + 5.0).collect()).collect();
        let rows: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        let (short, long) = (
            Compressed::new(&rows).regress(3, &[0, 2]),
            LeastSquares::new(&[rows[0], rows[2]], &[rows[3]], true),
        );
        assert_eq!(short.dof(), long.dof());
        for k in 0..2 {
            assert!((short.coefficient(0, k) - long.coefficient(0, k)).abs() < 1e-12);
            assert!((short.t(0, k) - long.t(0, k)).abs() < 1e-10);
        }
        assert!((short.rss(0) - long.rss(0)).abs() < 1e-9);
    }

    #[test]
    fn units_change_nothing_but_the_units() {
        let columns: Vec<Vec<f64>> = (0..2).map(|k| noise(50, k)).collect();
        let y: Vec<f64> = (0..50).map(|t| columns[0][t] + noise(50, 7)[t]).collect();
        let large: Vec<f64> = columns[0].iter().map(|v| 1e6 * v - 3e8).collect();
        let (a, b) = (
            LeastSquares::new(&[&columns[0], &columns[1]], &[&y], true),
            LeastSquares::new(&[&large, &columns[1]], &[&y], true),
        );
        assert!((a.t(0, 0) - b.t(0, 0)).abs() < 1e-6 * a.t(0, 0).abs());
        assert!((a.coefficient(0, 0) - 1e6 * b.coefficient(0, 0)).abs() < 1e-6);
    }

    #[test]
    fn a_column_that_others_determine_says_nothing_and_hurts_no_other() {
        let columns: Vec<Vec<f64>> = (0..2).map(|k| noise(50, k)).collect();
        let y: Vec<f64> = (0..50).map(|t| columns[0][t] + noise(50, 7)[t]).collect();
        let copy: Vec<f64> = columns[1].iter().map(|v| 2.0 * v + 1.0).collect();
        let one = LeastSquares::new(&[&columns[0], &columns[1]], &[&y], true);
        let both = LeastSquares::new(&[&columns[0], &columns[1], &copy], &[&y], true);
        assert_eq!((both.t(0, 1), both.t(0, 2), both.f(&[2])[0]), (0.0, 0.0, 0.0));
        assert!(both.is_undetermined(1) && both.is_undetermined(2) && !both.is_undetermined(0));
        assert!((one.t(0, 0) - both.t(0, 0)).abs() < 1e-9 && one.dof() == both.dof());
    }

    #[test]
    fn a_constant_and_too_few_rows_have_defined_answers() {
        let fit = LeastSquares::new(&[&[3.0; 5], &[1.0, 2.0, 3.0, 4.0, 6.0]], &[&[7.0; 5]], true);
        assert_eq!((fit.t(0, 0), fit.f(&[0])[0], fit.f(&[1])[0], fit.dof()), (0.0, 0.0, 0.0, 3));
        let few = LeastSquares::new(&[&[1.0, 2.0], &[0.0, 5.0]], &[&[7.0, 1.0]], true);
        assert!(few.dof() == 0 && few.t(0, 0) == 0.0 && few.f(&[0])[0] == 0.0);
    }
}
