//! Regressions on many samples, without any matrix of all pairs of them.
//!
//! 1. Which maximum: that of the textbook's search on [`PATH_SAMPLES`] samples, evenly chosen.
//!    A second search, on as many samples between those, says whether they decide it.
//! 2. Where it is on all samples: Newton steps from there ([`climb`]), with likelihoods of low rank whose truncation is bounded. Their
//!    curvature by `ln s` is exact; the rest is that of the few samples, scaled, and corrected by each step (symmetric rank one:
//!    Nocedal and Wright 2006, chapter 6.2). The steps end where another would gain less than [`LEFT`], and the errors of the gradients cost less than that.
//! 3. Residuals ([`solve`]): by a factor of higher rank, whose error is measured on some rows of the whole matrix; where
//!    it is too large, by conjugate gradients, each row of the kernel matrix computed when it is needed.
//!
//! Where the rank would be too high for step 2 (many conditions, or a length scale far below their spread), the maximum remains that of the
//! few samples; the residuals are those of all samples in any case. `docs/gpdc.md` says what was measured.

use std::sync::Arc;

use super::{
    factorisation::Factorisation,
    incomplete::Incomplete,
    kernel::Inputs,
    likelihood::{Likelihood, Value},
    low_rank::LowRank,
    plan::{Forecast, ROUNDING, max_rank},
    preconditioner::Preconditioner,
    refine,
    resources::{Held, Resources},
    theta::{BOUNDS, Theta},
};
use crate::types::Result;

/// Samples that the path to the maximum is searched on.
const PATH_SAMPLES: usize = 1000;
/// Log likelihood that may be left to gain.
const LEFT: f64 = 2e-5;
/// Newton steps, and how far one may lead, in logarithms.
const MOST_STEPS: usize = 20;
const LONGEST: f64 = 1.0;
/// Length scale, in deviations of the conditions, from which on a regression has found next to nothing.
pub(super) const NOTHING_FOUND: f64 = 30.0;
/// How far apart two searches end, in logarithms, that found one maximum on different samples.
const SAME: f64 = 0.4;
/// Half the distance of the two places that curvatures by `ln l` are from, and the errors of gradients there.
const APART: f64 = 0.05;
const CURVATURE_ERROR: f64 = 0.02;
/// Curvature below which a direction is flat: gradients need not be more exact than there.
const FLAT: f64 = 1.0;

/// What the truncation may leave on the diagonal for residuals, as a fraction of the noise variance.
const FRACTION: f64 = 1e-8;
/// Root mean square error of the residuals, in deviations of the target, that a factor of low rank may leave; and the rows that it
/// is measured on.
const EXACT: f64 = 1e-6;
const ROWS: usize = 128;

/// Evenly chosen samples of `n`; `other`: those between them.
pub(super) fn few_of(n: usize, other: bool) -> Vec<usize> {
    let few = PATH_SAMPLES.min(n);
    let half = if other { n / few / 2 } else { 0 };
    (0..few).map(|k| k * n / few + half).collect()
}

/// Whether two searches ended near the same maximum.
pub(super) fn is_same(a: Theta, b: Theta) -> bool {
    let near = |a: f64, b: f64| libm::log(a / b).abs() <= SAME;
    near(a.l.min(NOTHING_FOUND), b.l.min(NOTHING_FOUND)) && near(a.s, b.s)
}

/// A maximum of the likelihood on all samples.
pub(super) struct Maximum {
    pub(super) theta: Theta,
    pub(super) log_likelihood: f64,
    /// Pivots of the last likelihood.
    pub(super) pivots: Vec<u32>,
}

/// Second derivatives of minus the log likelihood by `(ln l, ln s)` at a place.
pub(super) type Hessian = [[f64; 2]; 2];

/// The second derivatives on few samples; `None` where there is no likelihood.
pub(super) fn curvatures(
    inputs: &Inputs,
    y: &[f64],
    at: Theta,
    resources: &Arc<Resources>,
) -> Option<Hessian> {
    let mut forecast = Forecast::new(y.len());
    let mut look = |by: f64| {
        let theta = Theta { l: at.l * libm::exp(by), s: at.s };
        Some(Likelihood::for_search(inputs, theta, CURVATURE_ERROR, &mut forecast, resources)?.evaluate(y))
    };
    let (below, above) = (look(-APART)?, look(APART)?);
    let change = |i: usize| (above.gradient[i] - below.gradient[i]) / (2.0 * APART);
    let by_noise = 0.5 * (above.curvature + below.curvature);
    Some([[change(0), change(1)], [change(1), by_noise]])
}

/// The maximum near `start` on all samples; `None` where a likelihood's rank is too high. `hessian`: what is known of the second
/// derivatives there.
///
/// # Errors
/// Those of `check`.
pub(super) fn climb(
    inputs: &Inputs,
    y: &[f64],
    start: Theta,
    mut hessian: Hessian,
    resources: &Arc<Resources>,
    check: &dyn Fn() -> Result<()>,
) -> Result<Option<Maximum>> {
    let mut forecast = Forecast::new(y.len());
    let mut x = start.logarithms();
    let mut best: Option<([f64; 2], Value)> = None;
    let mut end = None;
    for _ in 0..MOST_STEPS {
        check()?;
        let error = (2.0 * LEFT * least_curvature(&hessian).max(FLAT)).sqrt();
        let theta = Theta::from_logarithms(x);
        let at = Likelihood::for_search(inputs, theta, error, &mut forecast, resources);
        let value = at.map(|at| {
            let value = at.evaluate(y);
            at.plan.inspect(|plan| forecast.learn(y.len(), theta.s, *plan, value.truncation));
            value
        });
        let Some(value) = value else {
            let Some((from, known)) = best else { return Ok(None) };
            (x, end) = (middle(x, from), Some((from, known.value)));
            continue;
        };
        if let Some((from, known)) = &best {
            if value.value > known.value + LEFT + value.truncation + known.truncation {
                (x, end) = (middle(x, *from), Some((*from, known.value)));
                continue;
            }
            let change = |of: [f64; 2], before: [f64; 2]| [of[0] - before[0], of[1] - before[1]];
            correct(&mut hessian, change(x, *from), change(value.gradient, known.gradient));
        }
        hessian[1][1] = value.curvature;
        best = Some((x, value));
        let (next, gain) = step(&hessian, x, value.gradient);
        end = Some((next, value.value - gain));
        if gain <= LEFT {
            break;
        }
        x = next;
    }
    let pivots = forecast.pivots.map_or_else(Vec::new, |(pivots, _)| pivots);
    Ok(end.map(|(x, value)| Maximum { theta: Theta::from_logarithms(x), log_likelihood: -value, pivots }))
}

fn middle(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [0, 1].map(|i| 0.5 * (a[i] + b[i]))
}

/// The least second derivative in any direction.
fn least_curvature([[a, b], [_, c]]: &Hessian) -> f64 {
    0.5 * (a + c) - (0.25 * (a - c) * (a - c) + b * b).sqrt()
}

/// Makes the second derivatives agree with the change of the gradient over a step.
fn correct(hessian: &mut Hessian, step: [f64; 2], change: [f64; 2]) {
    let off = [0, 1].map(|i| change[i] - hessian[i][0] * step[0] - hessian[i][1] * step[1]);
    let along = off[0] * step[0] + off[1] * step[1];
    if along.abs() > 1e-8 * libm::hypot(off[0], off[1]) * libm::hypot(step[0], step[1]) {
        (0..2).for_each(|i| (0..2).for_each(|j| hessian[i][j] += off[i] * off[j] / along));
    }
}

/// Where a Newton step leads within the bounds, and what it gains.
fn step(hessian: &Hessian, x: [f64; 2], gradient: [f64; 2]) -> ([f64; 2], f64) {
    let free = [0, 1].map(|i| {
        let outwards =
            x[i] <= BOUNDS.lower[i] && gradient[i] > 0.0 || x[i] >= BOUNDS.upper[i] && gradient[i] < 0.0;
        !outwards
    });
    let [[a, b], [_, c]] = *hessian;
    let determinant = a * c - b * b;
    let wanted = if free == [true; 2] && a > 0.0 && determinant > 0.0 {
        [(b * gradient[1] - c * gradient[0]) / determinant, (b * gradient[0] - a * gradient[1]) / determinant]
    } else {
        // Not convex, or at a bound: each for itself.
        [0, 1].map(|i| if free[i] { -gradient[i] / hessian[i][i].abs().max(f64::MIN_POSITIVE) } else { 0.0 })
    };
    let longest = wanted[0].abs().max(wanted[1].abs());
    let scale = if longest > LONGEST { LONGEST / longest } else { 1.0 };
    let next = [0, 1].map(|i| (x[i] + scale * wanted[i]).clamp(BOUNDS.lower[i], BOUNDS.upper[i]));
    let d = [next[0] - x[0], next[1] - x[1]];
    let slope = gradient[0] * d[0] + gradient[1] * d[1];
    let bend = a * d[0] * d[0] + 2.0 * b * d[0] * d[1] + c * d[1] * d[1];
    (next, -slope - 0.5 * bend.max(0.0))
}

/// `(K + s I)^-1 y` on all samples; `pivots` of a likelihood nearby.
pub(super) fn solve(
    inputs: &Inputs,
    theta: Theta,
    y: &[f64],
    pivots: &[u32],
    resources: &Arc<Resources>,
) -> Option<Vec<f64>> {
    let n = y.len();
    let most = max_rank(n);
    let _held: Held = resources.hold(Incomplete::<f64>::bytes(n, most));
    let tolerance = (FRACTION * theta.s.min(1.0)).max(ROUNDING);
    let mut factor = Incomplete::<f64>::new(n, most, pivots);
    if factor.extend(inputs, theta.l, tolerance, most).is_some() {
        let end = LowRank::new(inputs, theta, factor, None)?;
        let alpha = end.alpha(y);
        if unexplained(inputs, theta, y, &alpha) <= EXACT {
            return Some(alpha);
        }
        return refine::solve_by_rows(inputs, theta, y, |rest| end.alpha(rest));
    }
    factor.extend_to_rank(inputs, theta.l, tolerance, most);
    let near = Preconditioner::new(factor, theta)?;
    refine::solve_by_rows(inputs, theta, y, |rest| near.solve(rest))
}

/// Root mean square of `y - (K + s I) a` over some samples: what the residuals `s a` are off by.
fn unexplained(inputs: &Inputs, theta: Theta, y: &[f64], alpha: &[f64]) -> f64 {
    let n = y.len();
    let rows = ROWS.min(n);
    let square = |k: usize| {
        let i = k * n / rows;
        let fitted = inputs.weighted_sum(theta.l, &inputs.place(i), alpha);
        (y[i] - fitted - theta.s * alpha[i]).powi(2)
    };
    ((0..rows).map(square).sum::<f64>() / rows as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::{
        super::regression::{Fit, GaussianProcess, SearchSettings},
        *,
    };
    use crate::{independence_tests::settings::GpSearch, numeric::rows::standardized};

    const SETTINGS: SearchSettings = SearchSettings { search: GpSearch::Default, restarts: 0, seed: 42 };
    const N: usize = 2001;

    /// Conditions, and a target that waves along the first and bends along the second.
    fn samples(conditions: usize, seed: u64) -> (Vec<Vec<f64>>, Vec<f64>) {
        let mut rng = crate::numeric::pcg64::Pcg64::new(seed);
        let mut row = || (0..N).map(|_| 4.0 * rng.next_f64() - 2.0).collect::<Vec<f64>>();
        let rows: Vec<Vec<f64>> = (0..conditions).map(|_| row()).collect();
        let (first, last) = (&rows[0], &rows[conditions - 1]);
        let y = first.iter().zip(last).zip(row()).map(|((a, b), e)| (2.0 * a).sin() + 0.2 * b * b + 0.5 * e);
        (rows.iter().map(|row| standardized(row)).collect(), standardized(&y.collect::<Vec<f64>>()))
    }

    /// The largest difference between the residuals of a fit and those of the whole matrix there.
    fn off(whole: &Likelihood, y: &[f64], fit: &Fit) -> f64 {
        let pairs = whole.alpha(y).into_iter().zip(&fit.residuals);
        pairs.map(|(a, residual)| (fit.theta.s * a - residual).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn the_maximum_and_the_residuals_are_those_of_the_whole_matrix() {
        for conditions in 1..3 {
            let (rows, y) = samples(conditions, 7);
            let (inputs, resources) = (Inputs::new(&rows), Resources::new(usize::MAX));
            let fit = GaussianProcess::new(&rows, &resources).fit(&y, &SETTINGS, &|| Ok(())).unwrap();
            let at = |theta| Likelihood::whole(&inputs, theta, true, &resources).unwrap();
            let (whole, beside) = (at(fit.theta), at(Theta { l: fit.theta.l * APART.exp(), s: fit.theta.s }));
            let (exact, beside) = (whole.evaluate(&y), beside.evaluate(&y));
            let change = |i: usize| (beside.gradient[i] - exact.gradient[i]) / APART;
            let hessian = [[change(0), change(1)], [change(1), exact.curvature]];
            let (_, gain) = step(&hessian, fit.theta.logarithms(), exact.gradient);
            assert!(!fit.by_few && gain < 1e-4, "{conditions} conditions: gain {gain:e}");
            assert!((exact.value + fit.log_likelihood).abs() < 0.01, "{exact:?} {}", fit.log_likelihood);
            let off = off(&whole, &y, &fit);
            assert!(off < 1e-4, "{conditions} conditions: {off:e}");
        }
    }

    #[test]
    fn where_the_rank_is_too_high_the_residuals_are_exact_at_the_maximum_of_few() {
        let (rows, _) = samples(5, 8);
        // It depends on all conditions together, over short distances.
        let y: Vec<f64> = (0..N).map(|i| rows.iter().map(|row| 1.5 * row[i]).sum::<f64>().sin()).collect();
        let (y, resources) = (standardized(&y), Resources::new(usize::MAX));
        let fit = GaussianProcess::new(&rows, &resources).fit(&y, &SETTINGS, &|| Ok(())).unwrap();
        let whole = Likelihood::whole(&Inputs::new(&rows), fit.theta, false, &resources).unwrap();
        let off = off(&whole, &y, &fit);
        assert!(fit.by_few && off < 1e-4, "{off:e}");
    }

    #[test]
    fn a_newton_step_stays_within_the_bounds_and_a_correction_learns_a_change() {
        let (next, gain) = step(&[[4.0, 1.0], [1.0, 2.0]], [0.0, 0.0], [0.4, -0.2]);
        assert!(
            (4.0 * next[0] + next[1] + 0.4).abs() < 1e-12 && (next[0] + 2.0 * next[1] - 0.2).abs() < 1e-12
        );
        assert!(gain > 0.0);
        let (next, _) = step(&[[1.0, 0.0], [0.0, 1.0]], BOUNDS.upper, [-5.0, 0.5]);
        assert_eq!(next, [BOUNDS.upper[0], BOUNDS.upper[1] - 0.5]);
        let mut hessian = [[1.0, 0.0], [0.0, 1.0]];
        correct(&mut hessian, [0.1, 0.2], [0.5, 0.4]);
        for (row, change) in hessian.iter().zip([0.5, 0.4]) {
            assert!((row[0] * 0.1 + row[1] * 0.2 - change).abs() < 1e-12);
        }
    }
}
