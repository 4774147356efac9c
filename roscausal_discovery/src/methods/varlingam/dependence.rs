//! Whether series depend on each other, for all pairs of several: the distance correlation of their ranks in its lowest
//! frequencies.
//!
//! The distance covariance of two series of ranks `u`, `v` in `[0, 1]` is a sum over frequencies, because `cos(k pi u)` are the
//! eigenfunctions of the distances on `[0, 1]`: `(n - 1) dCor^2 = sum over j, k of w_jk Z_jk^2` with
//! `Z_jk = 2 / sqrt(n) sum of cos(j pi u) cos(k pi v)` and `w_jk = 90 / (pi^4 j^2 k^2)`. Six frequencies have four fifths of its mean,
//! and most of what dependence that a reader would see adds to it; they cost a few products, where sorting costs much and a table of
//! random series far more. If the series are independent the `Z` are standard normal, and the p-value is that of the gamma
//! distribution with the first three cumulants of the sum (Buckley and Eagleson 1988).
//!
//! Source: Székely, Rizzo and Bakirov 2007, Annals of Statistics 35:2769, theorem 5.
//!
//! Example: `y` is the square of `x`. Their correlation is 0; `Z_21` is large.

use std::f64::consts::PI;

use rayon::prelude::*;
use statrs::function::gamma::checked_gamma_ur;

use crate::numeric::rows::{dot, sum};

/// Frequencies of each series.
const FREQUENCIES: usize = 6;
/// The normal law of the sums takes so many samples.
pub(super) const FEWEST: usize = 100;

/// Writes the cosines of the ranks of a series, one column of mean 0 for each frequency. Equal values share the middle of their ranks.
/// `cosines[m]` is `cos(pi m / 2n)`.
fn write_waves(values: &[f64], cosines: &[f64], waves: &mut [f64]) {
    let n = values.len();
    let mut order: Vec<(f64, usize)> = values.iter().copied().zip(0..).collect();
    order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let mut rank = 0;
    for equal in order.chunk_by(|a, b| a.0 == b.0) {
        let first = cosines[2 * rank + equal.len()];
        rank += equal.len();
        // cos((k + 1) a) = 2 cos(a) cos(k a) - cos((k - 1) a)
        let (mut before, mut now) = (1.0, first);
        for column in waves.chunks_exact_mut(n) {
            equal.iter().for_each(|&(_, at)| column[at] = now);
            (before, now) = (now, 2.0 * first * now - before);
        }
    }
    for column in waves.chunks_exact_mut(n.max(1)) {
        let mean = sum(column) / n as f64;
        column.iter_mut().for_each(|v| *v -= mean);
    }
}

/// The p-values that the pairs are independent.
pub(super) fn p_values(series: &[Vec<f64>], pairs: &[(usize, usize)]) -> Vec<f64> {
    let n = series.first().map_or(0, Vec::len);
    let mut waves = vec![0.0; n * series.len() * FREQUENCIES];
    let cosines: Vec<f64> = (0..=2 * n).map(|m| libm::cos(0.5 * PI * m as f64 / n as f64)).collect();
    let rooms = waves.par_chunks_exact_mut((n * FREQUENCIES).max(1));
    rooms.zip(series).for_each(|(room, values)| write_waves(values, &cosines, room));
    let wave = |x: usize, k: usize| &waves[(x * FREQUENCIES + k) * n..][..n];
    let statistic = |&(x, y): &(usize, usize)| {
        let frequencies = (0..FREQUENCIES).flat_map(|j| (0..FREQUENCIES).map(move |k| (j, k)));
        let part = |(j, k): (usize, usize)| weight(j + 1, k + 1) * dot(wave(x, j), wave(y, k)).powi(2);
        4.0 / n.max(1) as f64 * frequencies.map(part).sum::<f64>()
    };
    pairs.par_iter().map(|pair| survival(statistic(pair))).collect()
}

fn weight(j: usize, k: usize) -> f64 {
    90.0 / (PI.powi(4) * ((j * j * k * k) as f64))
}

/// Probability that the weighted sum of squares of independent standard normal variables exceeds `x`.
fn survival(x: f64) -> f64 {
    let sum_of = |power: i32| -> f64 {
        let of_one: f64 = (1..=FREQUENCIES).map(|k| (k as f64).powi(-2 * power)).sum();
        weight(1, 1).powi(power) * of_one * of_one
    };
    let (mean, squares, cubes) = (sum_of(1), sum_of(2), sum_of(3));
    let dof = squares.powi(3) / cubes.powi(2);
    let scaled = (x - mean) * (dof / squares).sqrt() + dof;
    if scaled > 0.0 { checked_gamma_ur(0.5 * dof, 0.5 * scaled).unwrap_or(0.0) } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::Rng;

    fn noise(n: usize, rng: &mut Rng) -> Vec<f64> {
        (0..n).map(|_| (rng.unit() - 0.5).powi(3)).collect()
    }

    #[test]
    fn independent_series_have_p_values_below_a_level_as_often_as_it_says() {
        let mut rng = Rng::new(5);
        let series: Vec<Vec<f64>> = (0..160).map(|_| noise(FEWEST, &mut rng)).collect();
        let pairs: Vec<_> = (0..160).flat_map(|i| (i + 1..160).map(move |j| (i, j))).collect();
        let p = p_values(&series, &pairs);
        // Pairs share series, so the counts vary somewhat more than binomial ones.
        for (level, width) in [(0.2, 0.02), (0.05, 0.01), (0.01, 0.004), (0.001, 0.001)] {
            let share = p.iter().filter(|&&p| p < level).count() as f64 / p.len() as f64;
            assert!((share - level).abs() < width, "{level}: {share}");
        }
    }

    #[test]
    fn a_square_and_a_circle_are_dependent() {
        let mut rng = Rng::new(7);
        let x = noise(300, &mut rng);
        let square: Vec<f64> = x.iter().map(|v| v * v + 0.002 * rng.unit()).collect();
        let angle: Vec<f64> = x.iter().map(|_| 2.0 * PI * rng.unit()).collect();
        let circle: [Vec<f64>; 2] = [f64::sin, f64::cos].map(|f| angle.iter().map(|&a| f(a)).collect());
        let [sine, cosine] = circle;
        let p = p_values(&[x, square, sine, cosine], &[(0, 1), (2, 3), (0, 2)]);
        assert!(p[0] < 1e-6 && p[1] < 1e-4 && p[2] > 0.01, "{p:?}");
    }

    #[test]
    fn equal_values_say_nothing_of_their_order() {
        let mut rng = Rng::new(3);
        // Each stands still half of the time.
        let mut still = || (0..2000).map(|_| (2.0 * rng.unit()).max(1.0)).collect::<Vec<_>>();
        let (x, y) = (still(), still());
        let p = p_values(&[x, y, vec![3.0; 2000]], &[(0, 1), (0, 2)]);
        assert!(p[0] > 0.01 && p[1] == 1.0, "{p:?}");
    }

    #[test]
    fn the_order_of_the_samples_and_their_units_do_not_matter() {
        let mut rng = Rng::new(9);
        let (x, y) = (noise(150, &mut rng), noise(150, &mut rng));
        let turned = |v: &[f64]| v.iter().rev().map(|v| 1e6 * v + 3.0).collect::<Vec<_>>();
        let [a, b] =
            [[x.clone(), y.clone()], [turned(&x), turned(&y)]].map(|two| p_values(&two, &[(0, 1)])[0]);
        assert!((a - b).abs() < 1e-9, "{a} {b}");
    }
}
