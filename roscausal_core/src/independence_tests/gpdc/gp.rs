//! Gaussian process regression with the kernel `RBF(l) + White(s)` (Rasmussen and Williams 2006, chapters 2 and 5).

use std::sync::{Arc, OnceLock};

use super::{
    dense::Dense,
    kernel::{Inputs, dot},
    lbfgsb::{Bounds, Tolerances, minimize},
    low_rank::LowRank,
    memory::{Held, Memory},
};
use crate::{Error, Result};

/// Length scale and noise variance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Theta {
    /// Length scale of the RBF kernel.
    pub(super) l: f64,
    /// Variance of the white noise.
    pub(super) s: f64,
}

impl Theta {
    const START: Self = Self { l: 1.0, s: 1.0 };

    fn from_logarithms([l, s]: [f64; 2]) -> Self {
        Self { l: l.exp(), s: s.exp() }
    }
}

/// Bounds of both hyperparameters.
const SMALLEST: f64 = 1e-5;
const LARGEST: f64 = 1e5;
/// What the kernel matrix may lack on its diagonal: share of the noise variance, and the rounding of a remainder.
const RELATIVE_TOLERANCE: f64 = 1e-10;
const ROUNDING: f64 = 4e-15;
/// Samples above which matrices are large: then they are counted, and that of the start is not kept.
const LARGE: usize = 2000;

/// A regression on given conditions, for any number of targets.
pub(super) struct GaussianProcess {
    inputs: Inputs,
    /// Every search starts at the same point: its factorisation is shared.
    start: OnceLock<Option<Likelihood>>,
    memory: Arc<Memory>,
}

/// A fit at the optimum.
pub(super) struct Fit {
    /// Log marginal likelihood there.
    pub(super) log_likelihood: f64,
    /// Target minus the mean of the process, per sample.
    pub(super) residuals: Vec<f64>,
}

/// What does not depend on the target.
struct Likelihood {
    form: Form,
    _held: Option<Held>,
}

enum Form {
    Dense(Dense),
    LowRank(LowRank),
}

impl GaussianProcess {
    /// A regression on `conditions`: one row of samples per dimension, standardised.
    pub(super) fn new(conditions: &[Vec<f64>], memory: &Arc<Memory>) -> Self {
        Self { inputs: Inputs::new(conditions), start: OnceLock::new(), memory: memory.clone() }
    }

    /// Bytes that fits on `n` samples need at the least, on any number of `threads`.
    pub(super) fn bytes(n: usize, threads: usize) -> usize {
        let one = Dense::bytes(n).max(LowRank::bytes(n, max_rank(n)));
        // Of few samples each thread keeps the factorisation of the start.
        if n > LARGE { one } else { 3 * one / 2 * threads }
    }

    /// Fits the standardised `target`: the maximum of the marginal likelihood that L-BFGS-B reaches from `l = s = 1`.
    /// `check` is called before each evaluation.
    ///
    /// # Errors
    /// Those of `check`.
    pub(super) fn fit(&self, target: &[f64], check: &dyn Fn() -> Result<()>) -> Result<Fit> {
        let bounds = Bounds { lower: [SMALLEST.ln(); 2], upper: [LARGEST.ln(); 2] };
        let mut best: Option<(Theta, Vec<f64>, f64)> = None;
        let mut too_high_rank = None;
        let optimum = minimize(
            |logarithms| {
                check()?;
                let theta = Theta::from_logarithms(logarithms);
                let Some((value, gradient, alpha)) = self.evaluate(target, theta, &mut too_high_rank) else {
                    return Ok((f64::INFINITY, [0.0; 2]));
                };
                if best.as_ref().is_none_or(|(_, _, least)| value <= *least) {
                    best = Some((theta, alpha, value));
                }
                Ok((value, gradient))
            },
            [0.0; 2],
            &bounds,
            &Tolerances::default(),
        )?;
        let theta = Theta::from_logarithms(optimum.x);
        let alpha = match best {
            Some((at, alpha, _)) if at == theta => Some(alpha),
            _ => self.evaluate(target, theta, &mut too_high_rank).map(|(_, _, alpha)| alpha),
        };
        let alpha = alpha.ok_or_else(|| {
            Error::Data("a Gaussian process has no positive definite covariance on these samples".into())
        })?;
        // y - K (K + s I)^-1 y = s (K + s I)^-1 y
        let residuals = alpha.iter().map(|a| theta.s * a).collect();
        Ok(Fit { log_likelihood: -optimum.value, residuals })
    }

    /// Minus the log marginal likelihood, its gradient by `(ln l, ln s)`, and `(K + s I)^-1 y`.
    fn evaluate(
        &self,
        y: &[f64],
        theta: Theta,
        too_high_rank: &mut Option<Theta>,
    ) -> Option<(f64, [f64; 2], Vec<f64>)> {
        let likelihood =
            |limit: &mut Option<Theta>| Likelihood::new(&self.inputs, theta, limit, &self.memory);
        if theta == Theta::START && y.len() <= LARGE {
            let start = self.start.get_or_init(|| likelihood(&mut None)).as_ref()?;
            if matches!(start.form, Form::Dense(_)) {
                *too_high_rank = Some(theta);
            }
            Some(start.evaluate(y, theta.s))
        } else {
            likelihood(too_high_rank).map(|at| at.evaluate(y, theta.s))
        }
    }
}

/// Largest remainder on the diagonal. The error of the derivative by `ln l` is larger than that of the kernel by
/// the factor `l^2` (of inputs of unit variance), which the tolerance makes good; the rank is low there.
fn tolerance(theta: Theta) -> f64 {
    (RELATIVE_TOLERANCE * theta.s.min(1.0) / theta.l.max(1.0).powi(2)).max(ROUNDING)
}

/// Rank up to which the low-rank form is the faster one.
fn max_rank(n: usize) -> usize {
    n / 3
}

impl Likelihood {
    /// The form that is the faster one at `theta`. `too_high_rank` is a place of the same search where the rank was
    /// too high: it is so for every shorter length scale at the same or less noise.
    fn new(
        inputs: &Inputs,
        theta: Theta,
        too_high_rank: &mut Option<Theta>,
        memory: &Arc<Memory>,
    ) -> Option<Self> {
        let n = inputs.len();
        let hold = |bytes: usize| (n > LARGE).then(|| memory.hold(bytes));
        let known = too_high_rank.is_some_and(|at| theta.l <= at.l && theta.s <= at.s);
        if !known {
            let held = hold(LowRank::bytes(n, max_rank(n)));
            if let Some(at) = LowRank::new(inputs, theta, tolerance(theta), max_rank(n)) {
                return Some(Self { form: Form::LowRank(at), _held: held });
            }
            *too_high_rank = Some(theta);
        }
        let held = hold(Dense::bytes(n));
        Dense::new(inputs, theta).map(|at| Self { form: Form::Dense(at), _held: held })
    }

    fn evaluate(&self, y: &[f64], s: f64) -> (f64, [f64; 2], Vec<f64>) {
        let (log_determinant, trace_inverse, trace_derivative, (alpha, curvature)) = match &self.form {
            Form::Dense(at) => (at.log_determinant, at.trace_inverse, at.trace_derivative, at.solve(y)),
            Form::LowRank(at) => (at.log_determinant, at.trace_inverse, at.trace_derivative, at.solve(y)),
        };
        let value =
            0.5 * (dot(y, &alpha) + log_determinant + y.len() as f64 * (2.0 * std::f64::consts::PI).ln());
        let gradient =
            [0.5 * (trace_derivative - curvature), 0.5 * s * (trace_inverse - dot(&alpha, &alpha))];
        (value, gradient, alpha)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Minus the log marginal likelihood by its definition.
    fn by_definition(rows: &[Vec<f64>], y: &[f64], theta: Theta) -> f64 {
        let n = y.len();
        let kernel = |i: usize, j: usize| {
            let square = rows.iter().map(|row| (row[i] - row[j]).powi(2)).sum::<f64>();
            (-0.5 * square / theta.l.powi(2)).exp() + if i == j { theta.s } else { 0.0 }
        };
        let factor = nalgebra::DMatrix::from_fn(n, n, kernel).cholesky().unwrap();
        let y = nalgebra::DVector::from_column_slice(y);
        let log_determinant = 2.0 * factor.l().diagonal().map(f64::ln).sum();
        0.5 * (y.dot(&factor.solve(&y)) + log_determinant + n as f64 * std::f64::consts::TAU.ln())
    }

    fn alone(form: Form) -> Likelihood {
        Likelihood { form, _held: None }
    }

    fn samples(n: usize, d: usize, seed: u64) -> (Vec<Vec<f64>>, Vec<f64>) {
        let mut rng = super::super::pcg64::Pcg64::new(seed);
        let mut row = || (0..n).map(|_| 4.0 * rng.next_f64() - 2.0).collect::<Vec<f64>>();
        let rows: Vec<Vec<f64>> = (0..d).map(|_| row()).collect();
        let noise = row();
        let y = (0..n)
            .map(|i| rows.iter().map(|row| (1.5 * row[i]).sin()).sum::<f64>() + 0.3 * noise[i])
            .collect();
        (rows, y)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        #[test]
        fn both_forms_equal_the_definition(
            d in 1usize..4, n in 5usize..60, seed in 0u64..1000, log_l in -3.0f64..3.0, log_s in -4.0f64..2.0,
        ) {
            let (rows, y) = samples(n, d, seed);
            let theta = Theta { l: log_l.exp(), s: log_s.exp() };
            let inputs = Inputs::new(&rows);
            let expected = by_definition(&rows, &y, theta);
            let h = 1e-5;
            let slope = |l: f64, s: f64| {
                let at = |sign: f64| Theta { l: theta.l * (sign * l).exp(), s: theta.s * (sign * s).exp() };
                (by_definition(&rows, &y, at(1.0)) - by_definition(&rows, &y, at(-1.0))) / (2.0 * h)
            };
            let expected_gradient = [slope(h, 0.0), slope(0.0, h)];
            let dense = Dense::new(&inputs, theta).map(Form::Dense).map(alone).unwrap();
            let low_rank = LowRank::new(&inputs, theta, tolerance(theta), 2 * n).map(Form::LowRank).map(alone).unwrap();
            let (value, gradient, alpha) = dense.evaluate(&y, theta.s);
            prop_assert!((value - expected).abs() < 1e-9 * expected.abs().max(1.0));
            for (got, expected) in gradient.iter().zip(expected_gradient) {
                prop_assert!((got - expected).abs() < 1e-5 * expected.abs().max(1.0), "{got} {expected}");
            }
            let (low_value, low_gradient, low_alpha) = low_rank.evaluate(&y, theta.s);
            prop_assert!((value - low_value).abs() < 1e-8 * value.abs().max(1.0), "{value} {low_value}");
            for (dense, low) in gradient.iter().zip(low_gradient) {
                prop_assert!((dense - low).abs() < 1e-6 * dense.abs().max(1.0), "{dense} {low}");
            }
            for (dense, low) in alpha.iter().zip(&low_alpha) {
                prop_assert!((dense - low).abs() < 1e-7 / theta.s, "{dense} {low}");
            }
        }
    }

    #[test]
    fn a_smooth_function_leaves_its_noise() {
        let (rows, _) = samples(200, 1, 1);
        let (_, noise) = samples(200, 1, 2);
        let y: Vec<f64> = rows[0].iter().zip(&noise).map(|(z, e)| (2.0 * z).sin() + 0.1 * e).collect();
        let fit = GaussianProcess::new(&rows, &Memory::new(0)).fit(&y, &|| Ok(())).unwrap();
        let left = fit.residuals.iter().zip(&noise).map(|(r, e)| (r - 0.1 * e).abs()).sum::<f64>() / 200.0;
        assert!(left < 0.03, "{left}");
    }

    #[test]
    fn a_fit_that_is_cancelled_ends() {
        let (rows, y) = samples(30, 1, 3);
        let cancelled = || Err(Error::Cancelled("now".into()));
        assert!(GaussianProcess::new(&rows, &Memory::new(0)).fit(&y, &cancelled).is_err());
    }
}
