//! The slope of an effect on one cause, given conditions, with a variance that allows for any noise.
//!
//! By the theorem of Frisch, Waugh and Lovell the slope is that of `y` on the part `r` of `x` that the conditions do not
//! explain. Its variance is HC3 (MacKinnon and White 1985), `sum r^2 e^2 / (1 - h)^2 / (sum r^2)^2` with the residuals `e` and
//! the leverages `h`, so noise whose size depends on the cause does not pass for a change.
//!
//! Written out here, because the least squares of `numeric` keep sums only, and HC3 needs each sample's leverage.

use serde::{Deserialize, Serialize};

/// A slope and the variance of its estimate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Slope {
    pub(crate) value: f64,
    pub(crate) variance: f64,
}

impl Slope {
    /// P-value of the slope 0.
    pub(crate) fn p_value(self) -> f64 {
        two_sided(self.value / self.variance.sqrt())
    }

    /// How far two slopes are apart, in standard deviations of their difference; 0 where that is not a number.
    pub(crate) fn z_of_same(self, other: Self) -> f64 {
        let z = (self.value - other.value) / (self.variance + other.variance).sqrt();
        if z.is_nan() { 0.0 } else { z }
    }
}

/// `P(|N(0, 1)| > |z|)`; 1 where `z` is not a number.
pub(crate) fn two_sided(z: f64) -> f64 {
    if z.is_nan() { 1.0 } else { libm::erfc(z.abs() / std::f64::consts::SQRT_2) }
}

/// What the conditions leave of other columns.
pub(crate) struct Conditions<'a> {
    columns: &'a [&'a [f64]],
    /// Lower triangle of the Cholesky factor of their products.
    factor: Vec<Vec<f64>>,
}

impl<'a> Conditions<'a> {
    /// Columns whose means are taken off; `None` if one is (nearly) a sum of the others.
    pub(crate) fn new(columns: &'a [&'a [f64]]) -> Option<Self> {
        let mut factor: Vec<Vec<f64>> = Vec::with_capacity(columns.len());
        for (i, column) in columns.iter().enumerate() {
            let mut row = Vec::with_capacity(i + 1);
            for j in 0..=i {
                let product = dot(column, columns[j]);
                let known =
                    |upto: &[f64], other: &[f64]| -> f64 { upto.iter().zip(other).map(|(a, b)| a * b).sum() };
                if j < i {
                    let rest = product - known(&row, &factor[j][..j]);
                    row.push(rest / factor[j][j]);
                } else {
                    let rest = product - known(&row, &row);
                    if rest.is_nan() || rest <= 1e-10 * product {
                        return None;
                    }
                    row.push(rest.sqrt());
                }
            }
            factor.push(row);
        }
        Some(Self { columns, factor })
    }

    /// Solves `G b = sums` with the products `G` of the conditions.
    fn solve(&self, mut sums: Vec<f64>) -> Vec<f64> {
        self.forward(&mut sums);
        for i in (0..sums.len()).rev() {
            let rest: f64 = (i + 1..sums.len()).map(|k| self.factor[k][i] * sums[k]).sum();
            sums[i] = (sums[i] - rest) / self.factor[i][i];
        }
        sums
    }

    fn forward(&self, sums: &mut [f64]) {
        for i in 0..sums.len() {
            let rest: f64 = self.factor[i][..i].iter().zip(&sums[..i]).map(|(a, b)| a * b).sum();
            sums[i] = (sums[i] - rest) / self.factor[i][i];
        }
    }

    /// The residuals of a column on the conditions.
    pub(crate) fn residuals(&self, of: &[f64]) -> Vec<f64> {
        let slopes = self.solve(self.columns.iter().map(|column| dot(column, of)).collect());
        let mut left = of.to_vec();
        for (column, slope) in self.columns.iter().zip(slopes) {
            left.iter_mut().zip(*column).for_each(|(l, c)| *l -= slope * c);
        }
        left
    }

    /// `w' G^-1 w` for the products `w` of some column with the conditions.
    pub(crate) fn explained(&self, mut products: Vec<f64>) -> f64 {
        self.forward(&mut products);
        products.iter().map(|v| v * v).sum()
    }

    /// The leverage of each sample.
    fn leverages(&self) -> Vec<f64> {
        let n = self.columns.first().map_or(0, |column| column.len());
        (0..n).map(|t| self.explained(self.columns.iter().map(|column| column[t]).collect())).collect()
    }
}

/// The slope of `y` on `x` given conditions. `n_means` means were taken off the columns. `None` if `x` does not vary beyond the
/// conditions, or there are too few samples.
pub(crate) fn slope(y: &[f64], x: &[f64], conditions: &[&[f64]], n_means: usize) -> Option<Slope> {
    let n = y.len();
    if n < conditions.len() + n_means + 10 {
        return None;
    }
    let given = Conditions::new(conditions)?;
    let (r, left) = (given.residuals(x), given.residuals(y));
    let varies = dot(&r, &r);
    if varies.is_nan() || varies <= 1e-10 * dot(x, x) {
        return None;
    }
    let value = dot(&r, &left) / varies;
    let leverages = if conditions.is_empty() { vec![0.0; n] } else { given.leverages() };
    let of_means = n_means as f64 / n as f64;
    let mut sum = 0.0;
    for ((r, left), leverage) in r.iter().zip(&left).zip(leverages) {
        let e = left - value * r;
        let h = (of_means + leverage + r * r / varies).min(0.999);
        sum += (r * e / (1.0 - h)).powi(2);
    }
    let variance = sum / (varies * varies);
    (variance > 0.0).then_some(Slope { value, variance })
}

pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::Rng;

    fn centred(mut column: Vec<f64>) -> Vec<f64> {
        let mean = column.iter().sum::<f64>() / column.len() as f64;
        column.iter_mut().for_each(|v| *v -= mean);
        column
    }

    #[test]
    fn the_slope_is_that_of_the_conditions_and_the_cause_together() {
        let mut rng = Rng::new(3);
        let n = 400;
        let z = centred((0..n).map(|_| rng.unit()).collect());
        let x = centred(z.iter().map(|z| 0.5 * z + rng.unit()).collect());
        let y =
            centred(x.iter().zip(&z).map(|(x, z)| 0.7 * x - 0.4 * z + 0.01 * (rng.unit() - 0.5)).collect());
        let found = slope(&y, &x, &[&z], 1).unwrap();
        assert!((found.value - 0.7).abs() < 0.005 && found.p_value() < 1e-9, "{found:?}");
        // A copy of a condition says nothing beyond it.
        assert_eq!(slope(&y, &z, &[&z], 1), None);
        assert!(Conditions::new(&[&z, &z]).is_none());
    }

    #[test]
    fn its_variance_is_that_of_many_repetitions_also_if_the_noise_grows_with_the_cause() {
        let mut rng = Rng::new(8);
        let mut normal = || (0..12).map(|_| rng.unit()).sum::<f64>() - 6.0;
        let found: Vec<Slope> = (0..400)
            .map(|_| {
                let x: Vec<f64> = (0..80).map(|_| normal()).collect();
                let y = centred(x.iter().map(|x| x * normal()).collect());
                slope(&y, &centred(x), &[], 1).unwrap()
            })
            .collect();
        let spread = found.iter().map(|s| s.value * s.value).sum::<f64>() / 400.0;
        let reported = found.iter().map(|s| s.variance).sum::<f64>() / 400.0;
        assert!((0.7..1.6).contains(&(reported / spread)), "{reported} {spread}");
    }
}
