//! Multinomial logistic regression: how well numbers explain a category.
//!
//! Steps: the negative log-likelihood plus a price of the squared slopes is convex; Newton's method, halving a step that does not lower
//! it. The price keeps slopes finite where categories are told apart perfectly. It is too small to matter for rows of deviation 1
//! ([`Price::None`]), or the reference's.
//!
//! Example: of 100 samples in two categories of equal size, explained by nothing, the deviance is `200 ln 2`.

/// Newton steps after which it is as good as it gets.
const MOST_STEPS: usize = 50;
/// Weight of the squared constants, which only their differences would determine, in the reference.
const CONSTANTS: f64 = 1e-6;
/// Weight of each square for each sample, if none is wanted: for rows of deviation 1 it changes the deviance by less than 1e-6 of the
/// samples, even where categories are told apart perfectly.
const NONE: f64 = 1e-10;
/// Smallest decrease that is worth another step, as a part of the value.
const ENOUGH: f64 = 1e-12;

/// What squared slopes cost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Price {
    /// As good as nothing.
    None,
    /// Half their sum, in the units of the rows: the reference's.
    Reference,
}

/// Twice the negative log-likelihood of `category` (`0..n_categories` for each sample) explained by the rows of `on`.
pub(super) fn deviance(category: &[usize], n_categories: usize, on: &[Vec<f64>], price: Price) -> f64 {
    let (of_constants, of_slopes) = match price {
        Price::None => (NONE * category.len() as f64, NONE * category.len() as f64),
        Price::Reference => (CONSTANTS, 1.0),
    };
    let fit = Fit { category, n_categories, on, width: on.len() + 1, of_constants, of_slopes };
    let mut slopes = vec![0.0; n_categories * fit.width];
    let mut value = fit.value(&slopes);
    for _ in 0..MOST_STEPS {
        let Some(step) = fit.step(&slopes) else { break };
        let moved = |share: f64| -> Vec<f64> {
            slopes.iter().zip(&step).map(|(slope, step)| slope - share * step).collect()
        };
        let shares = (0..30).map(|k| 0.5_f64.powi(k));
        let Some((next, lower)) =
            shares.map(|share| (moved(share), fit.value(&moved(share)))).find(|(_, next)| *next < value)
        else {
            break;
        };
        let gain = value - lower;
        (slopes, value) = (next, lower);
        if gain < ENOUGH * value.abs() {
            break;
        }
    }
    2.0 * fit.likelihood(&slopes)
}

struct Fit<'a> {
    category: &'a [usize],
    n_categories: usize,
    on: &'a [Vec<f64>],
    /// The constant and the rows.
    width: usize,
    of_constants: f64,
    of_slopes: f64,
}

impl Fit<'_> {
    fn input(&self, row: usize, sample: usize) -> f64 {
        if row == 0 { 1.0 } else { self.on[row - 1][sample] }
    }

    fn penalty(&self, place: usize) -> f64 {
        if place.is_multiple_of(self.width) { self.of_constants } else { self.of_slopes }
    }

    /// Probabilities of the categories in a sample, and the logarithm of their sum before scaling.
    fn probabilities(&self, slopes: &[f64], sample: usize, into: &mut [f64]) -> f64 {
        for (k, p) in into.iter_mut().enumerate() {
            let of = &slopes[k * self.width..(k + 1) * self.width];
            *p = of.iter().enumerate().map(|(row, slope)| slope * self.input(row, sample)).sum();
        }
        let most = into.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let own = into[self.category[sample]];
        into.iter_mut().for_each(|p| *p = libm::exp(*p - most));
        let sum: f64 = into.iter().sum();
        into.iter_mut().for_each(|p| *p /= sum);
        most + libm::log(sum) - own
    }

    /// Negative log-likelihood.
    fn likelihood(&self, slopes: &[f64]) -> f64 {
        let mut p = vec![0.0; self.n_categories];
        (0..self.category.len()).map(|sample| self.probabilities(slopes, sample, &mut p)).sum()
    }

    fn value(&self, slopes: &[f64]) -> f64 {
        let squares = slopes.iter().enumerate().map(|(place, v)| self.penalty(place) * v * v);
        self.likelihood(slopes) + 0.5 * squares.sum::<f64>()
    }

    /// Newton's step; `None` where the curvature has no Cholesky factor.
    fn step(&self, slopes: &[f64]) -> Option<Vec<f64>> {
        let (n, width) = (slopes.len(), self.width);
        let mut gradient: Vec<f64> =
            slopes.iter().enumerate().map(|(place, v)| self.penalty(place) * v).collect();
        let mut curvature = vec![vec![0.0; n]; n];
        (0..n).for_each(|place| curvature[place][place] = self.penalty(place));
        let mut p = vec![0.0; self.n_categories];
        for sample in 0..self.category.len() {
            self.probabilities(slopes, sample, &mut p);
            for (a, of_a) in curvature.iter_mut().enumerate() {
                let (k, input) = (a / width, self.input(a % width, sample));
                let own = f64::from(self.category[sample] == k);
                gradient[a] += (p[k] - own) * input;
                for (b, entry) in of_a.iter_mut().enumerate().take(a + 1) {
                    let l = b / width;
                    let together = p[k] * (f64::from(k == l) - p[l]);
                    *entry += together * input * self.input(b % width, sample);
                }
            }
        }
        solve(curvature, gradient)
    }
}

/// Solves a symmetric positive system, of which the lower half is given, by Cholesky.
fn solve(mut a: Vec<Vec<f64>>, mut b: Vec<f64>) -> Option<Vec<f64>> {
    let n = b.len();
    for i in 0..n {
        for j in 0..=i {
            let sum: f64 = (0..j).map(|k| a[i][k] * a[j][k]).sum();
            let rest = a[i][j] - sum;
            if i == j && rest <= 0.0 {
                return None;
            }
            a[i][j] = if i == j { rest.sqrt() } else { rest / a[j][j] };
        }
        let sum: f64 = (0..i).map(|k| a[i][k] * b[k]).sum();
        b[i] = (b[i] - sum) / a[i][i];
    }
    for i in (0..n).rev() {
        let sum: f64 = (i + 1..n).map(|k| a[k][i] * b[k]).sum();
        b[i] = (b[i] - sum) / a[i][i];
    }
    Some(b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_anything_to_explain_it_the_deviance_is_that_of_the_shares() {
        let category: Vec<usize> = (0..100).map(|i| usize::from(i % 4 == 0)).collect();
        let expected = -2.0 * (25.0 * 0.25_f64.ln() + 75.0 * 0.75_f64.ln());
        for price in [Price::None, Price::Reference] {
            assert!((deviance(&category, 2, &[], price) - expected).abs() < 1e-6);
        }
    }

    #[test]
    fn categories_that_are_told_apart_perfectly_have_a_small_and_finite_deviance() {
        let row: Vec<f64> = (0..60).map(|i| f64::from(i % 3) * 10.0).collect();
        let category: Vec<usize> = (0..60).map(|i| i % 3).collect();
        let left = deviance(&category, 3, std::slice::from_ref(&row), Price::Reference);
        assert!(left > 0.0 && left < 20.0, "{left}");
        let left = deviance(&category, 3, &[row], Price::None);
        assert!((0.0..1e-4).contains(&left), "{left}");
    }
}
