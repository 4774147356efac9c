//! Minimises a smooth function plus `sum penalty_i |x_i|`.
//!
//! A step goes along the limited-memory quasi-Newton direction of the variables that are free: those that are not 0, and those
//! at 0 that the gradient pulls away harder than their penalty holds them. No variable passes 0 within a step; it stops there.
//! The end is where no component of the smallest subgradient is larger than a tolerance.
//!
//! Sources: Andrew and Gao 2007, "Scalable training of L1-regularized log-linear models"; Schmidt 2010 (the projection onto the
//! orthant). Instead of the reference's L-BFGS-B on the positive and negative parts of each weight, which has twice the
//! variables and a flat direction for each.

use std::collections::VecDeque;

use crate::numeric::rows::dot;

/// Steps that are remembered.
const MEMORY: usize = 12;
const MAX_STEPS: usize = 2000;
/// Smallest decrease that goes on, relative to the function.
const DECREASE: f64 = 1e-11;

/// The minimum near `start`. `f` gives the smooth part and its gradient.
pub(super) fn minimise(
    start: &[f64],
    penalty: &[f64],
    tolerance: f64,
    mut f: impl FnMut(&[f64]) -> (f64, Vec<f64>),
) -> Vec<f64> {
    // A held variable has an infinite penalty and stays 0.
    let penalised = |x: &[f64]| -> f64 {
        x.iter().zip(penalty).filter(|(x, _)| **x != 0.0).map(|(x, p)| p * x.abs()).sum()
    };
    let mut x = start.to_vec();
    let (smooth, mut gradient) = f(&x);
    let mut value = smooth + penalised(&x);
    let mut pairs: VecDeque<(Vec<f64>, Vec<f64>, f64)> = VecDeque::new();
    let mut small = 0;
    for _ in 0..MAX_STEPS {
        let pull = subgradient(&x, &gradient, penalty);
        if pull.iter().all(|v| v.abs() <= tolerance) {
            break;
        }
        let mut direction = newton(&pairs, &pull);
        // A direction must go down in each variable that starts from 0, or leave it there.
        for ((d, p), x) in direction.iter_mut().zip(&pull).zip(&x) {
            if *p == 0.0 || (*x == 0.0 && *d * p >= 0.0) {
                *d = 0.0;
            }
        }
        if dot(&direction, &pull) >= 0.0 {
            pairs.clear();
            direction = pull.iter().map(|v| -v).collect();
        }
        let first =
            if pairs.is_empty() { 1.0_f64.min(1.0 / pull.iter().map(|v| v.abs()).sum::<f64>()) } else { 1.0 };
        let side: Vec<f64> =
            x.iter().zip(&pull).map(|(x, p)| if *x != 0.0 { x.signum() } else { -p.signum() }).collect();
        let mut length = first;
        let found = (0..40).find_map(|_| {
            let next: Vec<f64> = x
                .iter()
                .zip(&direction)
                .zip(&side)
                .map(|((x, d), side)| {
                    let moved = x + length * d;
                    if moved * side > 0.0 { moved } else { 0.0 }
                })
                .collect();
            let (smooth, gradient) = f(&next);
            let new = smooth + penalised(&next);
            let along: f64 = next.iter().zip(&x).zip(&pull).map(|((n, x), p)| (n - x) * p).sum();
            length *= 0.5;
            (new <= value + 1e-4 * along).then_some((next, gradient, new))
        });
        let Some((next, new_gradient, new)) = found else {
            if pairs.is_empty() {
                break;
            }
            pairs.clear();
            continue;
        };
        let step: Vec<f64> = next.iter().zip(&x).map(|(n, x)| n - x).collect();
        let change: Vec<f64> = new_gradient.iter().zip(&gradient).map(|(n, g)| n - g).collect();
        let curvature = dot(&step, &change);
        if curvature > 1e-12 * dot(&change, &change).sqrt() * dot(&step, &step).sqrt() {
            if pairs.len() == MEMORY {
                pairs.pop_front();
            }
            pairs.push_back((step, change, 1.0 / curvature));
        }
        // Twice in a row: one short step says little.
        small = if value - new <= DECREASE * value.abs().max(1.0) { small + 1 } else { 0 };
        (x, gradient, value) = (next, new_gradient, new);
        if small == 2 {
            break;
        }
    }
    x
}

/// The subgradient of least size: 0 for a variable at 0 that its penalty holds.
fn subgradient(x: &[f64], gradient: &[f64], penalty: &[f64]) -> Vec<f64> {
    let of = |((x, g), p): ((&f64, &f64), &f64)| {
        if *p == f64::INFINITY {
            0.0
        } else if *x != 0.0 {
            g + p * x.signum()
        } else {
            g.signum() * (g.abs() - p).max(0.0)
        }
    };
    x.iter().zip(gradient).zip(penalty).map(of).collect()
}

/// Minus the inverse quasi-Newton matrix times `pull`, in the variables that `pull` moves (Nocedal's two loops).
fn newton(pairs: &VecDeque<(Vec<f64>, Vec<f64>, f64)>, pull: &[f64]) -> Vec<f64> {
    let mut q: Vec<f64> = pull.iter().map(|v| -v).collect();
    let mut factors = Vec::with_capacity(pairs.len());
    for (step, change, inverse) in pairs.iter().rev() {
        let a = inverse * dot(step, &q);
        q.iter_mut().zip(change).for_each(|(q, y)| *q -= a * y);
        factors.push(a);
    }
    if let Some((_, change, inverse)) = pairs.back() {
        let scale = 1.0 / (inverse * dot(change, change));
        q.iter_mut().for_each(|v| *v *= scale);
    }
    for ((step, change, inverse), a) in pairs.iter().zip(factors.iter().rev()) {
        let b = inverse * dot(change, &q);
        q.iter_mut().zip(step).for_each(|(q, s)| *q += (a - b) * s);
    }
    q
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_separable_quadratic_is_soft_thresholded() {
        let (centre, penalty) = ([3.0, -2.0, 0.3, 0.0], [1.0, 0.5, 0.5, 0.1]);
        let curvature = [1.0, 40.0, 2.0, 1.0];
        let found = minimise(&[0.0; 4], &penalty, 1e-10, |x| {
            let value = (0..4).map(|i| 0.5 * curvature[i] * (x[i] - centre[i]).powi(2)).sum();
            (value, (0..4).map(|i| curvature[i] * (x[i] - centre[i])).collect())
        });
        let exact = [2.0, -2.0 + 0.5 / 40.0, 0.3 - 0.25, 0.0];
        found.iter().zip(exact).for_each(|(a, b)| assert!((a - b).abs() < 1e-8, "{found:?}"));
        assert_eq!(found[3], 0.0);
    }

    #[test]
    fn a_held_variable_stays_0_and_a_curved_valley_is_followed() {
        let found = minimise(&[-1.2, 1.0, 0.0], &[0.0, 0.0, f64::INFINITY], 1e-8, |x| {
            let (u, v) = (x[1] - x[0] * x[0], 1.0 - x[0]);
            (100.0 * u * u + v * v + x[2], vec![-400.0 * x[0] * u - 2.0 * v, 200.0 * u, 5.0])
        });
        assert!(
            (found[0] - 1.0).abs() < 1e-5 && (found[1] - 1.0).abs() < 1e-5 && found[2] == 0.0,
            "{found:?}"
        );
    }
}
