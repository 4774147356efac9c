//! Where an equation may bend: functions that the true one may be.
//!
//! Each parent has hinges between quantiles of its values, with independent weights: the prior of a cubic smoothing spline on these knots, to
//! which a line costs nothing. The intervals of such functions hold on average over the function, whatever its form (Wahba 1983, Nychka
//! 1988). What parents do only together has hinges along mixtures of them (projection pursuit: Friedman and Stuetzle 1981). How strong each
//! of these groups is, or that it is not there, is drawn from what the rows say of it, by Gibbs sampling: most equations are lines, and a
//! bend that the rows do not show costs width only as often as it may be there. A function is then the fit on rows that count as often as
//! their moments do, towards weights drawn from the prior.

use std::sync::Arc;

use ndarray::{Array1, Array2, Axis};
use rayon::prelude::*;
use roscausal_discovery::{mix, quantile};

use crate::{linear::Factor, random};

/// Hinges of a parent; mixtures of parents, and hinges of each.
const HINGES: usize = 12;
const MIXTURES: usize = 12;
const HINGES_OF_MIXTURE: usize = 4;
/// How much a group may bend: 1 moves a normal variable by 0.4 standard deviations of the noise. 0 is `STRAIGHT` times as likely as each of the others.
const STRENGTHS: [f64; 6] = [0.0, 0.25, 0.5, 1.0, 2.0, 4.0];
const STRAIGHT: f64 = 20.0;
/// Sweeps of the sampler before the first that counts.
const WARM: usize = 5;

/// Where an equation may bend.
#[derive(Debug)]
pub(crate) struct Bends {
    /// Number, mean and deviation of each parent that is read.
    parents: Vec<(usize, f64, f64)>,
    /// Direction, place and factor.
    hinges: Vec<(Vec<f64>, f64, f64)>,
}

impl Bends {
    fn place(&self, values: &[f64]) -> Vec<f64> {
        self.parents.iter().map(|&(k, mean, deviation)| (values[k] - mean) / deviation).collect()
    }

    fn at(&self, hinge: usize, place: &[f64]) -> f64 {
        let (direction, from, factor) = &self.hinges[hinge];
        factor * (along(direction, place) - from).max(0.0)
    }

    /// The sum of the hinges with these weights.
    pub(crate) fn sum(&self, weights: &[f64], values: &[f64]) -> f64 {
        let place = self.place(values);
        let some = weights.iter().enumerate().filter(|(_, weight)| **weight != 0.0);
        some.map(|(hinge, weight)| weight * self.at(hinge, &place)).sum()
    }
}

fn along(direction: &[f64], place: &[f64]) -> f64 {
    direction.iter().zip(place).map(|(a, b)| a * b).sum()
}

/// What an equation that the true one may be has beside a line.
pub(crate) struct Drawn {
    pub(crate) constant: f64,
    /// By parent.
    pub(crate) slopes: Vec<(usize, f64)>,
    pub(crate) bends: Option<(Arc<Bends>, Vec<f64>)>,
}

/// Functions of the parents `used` for what a line leaves of the rows (`target`). One for each list of how often the rows count.
pub(crate) fn draws(
    (target, columns, used): (&[f64], &[Vec<f64>], &[usize]),
    counts: Vec<Array1<f64>>,
    seed: u64,
) -> Vec<Drawn> {
    let (n, d, mut groups) = (target.len() as f64, used.len(), vec![0; used.len() + 1]);
    let scale = |&k: &usize| {
        let mean = columns[k].iter().sum::<f64>() / n;
        (k, mean, (columns[k].iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt())
    };
    let mut bends = Bends { parents: used.iter().map(scale).collect(), hinges: Vec::new() };
    let place = |i: usize| bends.place(&columns.iter().map(|column| column[i]).collect::<Vec<f64>>());
    let places: Vec<Vec<f64>> = (0..target.len()).map(place).collect();
    for group in 0..if d > 1 { d + MIXTURES } else { d } {
        let part = |k: usize| match group.checked_sub(d) {
            Some(mixture) => random::normal(random::at(!seed, mixture, k)) / (d as f64).sqrt(),
            None => f64::from(k == group),
        };
        let direction: Vec<f64> = (0..d).map(part).collect();
        let mut sorted: Vec<f64> = places.iter().map(|place| along(&direction, place)).collect();
        sorted.sort_unstable_by(f64::total_cmp);
        let (count, share) =
            if group < d { (HINGES, 1.0) } else { (HINGES_OF_MIXTURE, 1.0 / MIXTURES as f64) };
        let knot = |i: usize| quantile(&sorted, (i as f64 + 0.5) / (count + 1) as f64);
        for (low, high) in (0..count).map(|i| (knot(i), knot(i + 1))).filter(|(low, high)| low < high) {
            bends.hinges.push((direction.clone(), 0.5 * (low + high), (share * (high - low)).sqrt()));
            groups.push(group.min(d) + 1);
        }
    }
    // 1, each parent, each hinge, the target.
    let last = groups.len();
    let rows = Array2::from_shape_fn((target.len(), last + 1), |(i, column)| match column {
        0 => 1.0,
        _ if column == last => target[i],
        _ if column <= d => places[i][column - 1],
        _ => bends.at(column - d - 1, &places[i]),
    });
    let strengths = strengths(&rows.t().dot(&rows), &groups, n, (counts.len(), seed));
    let bends = Arc::new(bends);
    let draw = |(number, (counts, (factors, noise))): (usize, (Array1<f64>, Strengths))| {
        // Most draws leave most groups out; then the target.
        let mut there: Vec<usize> = (0..last).filter(|&k| factors[groups[k]] > 0.0).collect();
        let of_these: Vec<usize> = there.iter().map(|&k| groups[k]).collect();
        there.push(last);
        let rows = rows.select(Axis(1), &there);
        let products = (&rows * &counts.insert_axis(Axis(1))).t().dot(&rows);
        let Ridge { columns, factor } = Ridge::new(&products, &of_these, &factors);
        let solved = factor.solve(|i| {
            let (k, scaled, scale) = columns[i];
            let drawn = || noise * random::normal(random::at(mix(seed), number, there[k]));
            scaled * products[[k, of_these.len()]] + if of_these[k] > 0 { drawn() / scale } else { 0.0 }
        });
        let mut weights = vec![0.0; last];
        factor.kept.iter().zip(solved).for_each(|(&i, x)| weights[there[columns[i].0]] = columns[i].1 * x);
        let of_bends = weights.split_off(d + 1);
        let slopes = bends.parents.iter().zip(&weights[1..]);
        let at_zero = slopes.clone().map(|((_, mean, deviation), weight)| weight * mean / deviation);
        let constant = weights[0] - at_zero.sum::<f64>();
        let slopes = slopes.map(|(&(k, _, deviation), weight)| (k, weight / deviation)).collect();
        let is_bent = of_bends.iter().any(|weight| *weight != 0.0);
        Drawn { constant, slopes, bends: is_bent.then(|| (bends.clone(), of_bends)) }
    };
    counts.into_par_iter().zip(strengths).enumerate().map(draw).collect()
}

/// The factor of each group, and the deviation of the noise.
type Strengths = (Vec<f64>, f64);

/// Draws of the strengths.
fn strengths(
    products: &Array2<f64>,
    groups: &[usize],
    n: f64,
    (draws, seed): (usize, u64),
) -> Vec<Strengths> {
    let mut factors = vec![0.0; groups.iter().max().map_or(1, |last| last + 1)];
    factors[0] = 1.0;
    let sweep = |sweep: usize| {
        for group in 1..factors.len() {
            // The largest of the logarithms with Gumbel's noise is a draw by their chances.
            let chance = |(k, strength): (usize, &f64)| {
                factors[group] = *strength;
                let number = random::unit(random::at(seed, sweep, STRENGTHS.len() * group + k));
                let prior = if k == 0 { libm::log(STRAIGHT) } else { 0.0 };
                (
                    likelihood(products, groups, &factors, n).0 + prior - libm::log(-libm::log(number)),
                    *strength,
                )
            };
            let drawn = STRENGTHS.iter().enumerate().map(chance).max_by(|a, b| a.0.total_cmp(&b.0));
            factors[group] = drawn.map_or(0.0, |(_, strength)| strength);
        }
        (factors.clone(), likelihood(products, groups, &factors, n).1)
    };
    (0..WARM + draws).map(sweep).skip(WARM).collect()
}

/// The logarithm of the likelihood of factors of the groups, and the deviation of the noise.
fn likelihood(products: &Array2<f64>, groups: &[usize], factors: &[f64], n: f64) -> (f64, f64) {
    let free = n - groups.iter().filter(|group| **group == 0).count() as f64;
    let Ridge { columns, factor } = Ridge::new(products, groups, factors);
    let last = groups.len();
    let half = factor.half(|i| columns[i].1 * products[[columns[i].0, last]]);
    let square = (products[[last, last]] - half.iter().map(|v| v * v).sum::<f64>()).max(f64::MIN_POSITIVE);
    let scale = factor.kept.iter().map(|&i| libm::log(columns[i].2)).sum::<f64>();
    (-factor.log_diagonal() - scale - 0.5 * free * libm::log(square), (square / free).sqrt())
}

/// The equations of ridge regression, scaled to a diagonal of ones.
struct Ridge {
    /// Number of each column that is there, its factor by its scale, and the scale.
    columns: Vec<(usize, f64, f64)>,
    factor: Factor,
}

impl Ridge {
    fn new(products: &Array2<f64>, groups: &[usize], factors: &[f64]) -> Self {
        let own = |k: usize| if groups[k] == 0 { 0.0 } else { 1.0 };
        let column = |k: usize| {
            let factor = factors[groups[k]];
            let scale = (factor * factor * products[[k, k]] + own(k)).sqrt().max(f64::MIN_POSITIVE);
            (k, factor / scale, scale)
        };
        let columns: Vec<(usize, f64, f64)> =
            (0..groups.len()).map(column).filter(|(_, scaled, _)| *scaled > 0.0).collect();
        let product = |i: usize, j: usize| {
            let ((a, of_a, scale), (b, of_b, _)) = (columns[i], columns[j]);
            of_a * of_b * products[[a, b]] + if a == b { own(a) / (scale * scale) } else { 0.0 }
        };
        Self { factor: Factor::new(columns.len(), product), columns }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What draws say at places, of a target that is `truth` and noise of one standard deviation.
    fn answers(truth: impl Fn(f64) -> f64, places: &[f64]) -> Vec<Vec<f64>> {
        let x: Vec<f64> = (0..600).map(|i| random::normal(random::at(1, i, 0))).collect();
        let y: Vec<f64> = (0..600).map(|i| truth(x[i]) + random::normal(random::at(1, i, 1))).collect();
        let counts = |b: usize| (0..600).map(|i| random::below(random::at(2, i, b), 3) as f64).collect();
        let all = draws((&y, &[x], &[0]), (0..40).map(counts).collect(), 3);
        let at = |one: &Drawn, place: f64| {
            let bent = one.bends.as_ref().map_or(0.0, |(bends, weights)| bends.sum(weights, &[place]));
            one.constant + one.slopes[0].1 * place + bent
        };
        places.iter().map(|&place| all.iter().map(|one| at(one, place)).collect()).collect()
    }

    #[test]
    fn a_bend_is_found_and_the_draws_lie_around_the_truth() {
        let places = [-2.0, -1.0, -0.3, 0.2, 1.0, 2.0];
        let truths: [fn(f64) -> f64; 3] = [f64::abs, |x| (2.0 * x).sin(), |x| 0.5 * x];
        for truth in truths {
            for (place, values) in places.iter().zip(answers(truth, &places)) {
                let mean = values.iter().sum::<f64>() / 40.0;
                let spread = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 40.0).sqrt();
                assert!((mean - truth(*place)).abs() < 3.5 * spread, "{place}: {mean} {spread}");
                assert!(spread < 0.4, "{place}: {spread}");
            }
        }
    }

    #[test]
    fn a_line_stays_one_in_most_draws() {
        let ends = answers(|x| 0.5 * x, &[-1.0, 0.0, 1.0]);
        let bent = (0..40).filter(|&b| (ends[0][b] + ends[2][b] - 2.0 * ends[1][b]).abs() > 1e-9).count();
        assert!(bent < 20, "{bent} of 40");
    }
}
