//! Gaussian process regression with the kernel `RBF(l) + White(s)` (Rasmussen and Williams 2006, chapters 2 and 5).

use std::sync::{Arc, OnceLock};

use super::{
    cubic_model::foretell,
    dense::Dense,
    incomplete::Incomplete,
    kernel::Inputs,
    lbfgsb::{Bounds, Exactness, Point, Tolerances, minimize},
    likelihood::{Factorisation, Likelihood, Purpose, Value},
    low_rank::LowRank,
    memory::Memory,
    refine,
    search::{ROUNDING, Search, max_rank},
};
use crate::ground::{Error, Result};

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

/// Natural logarithm of 1e5.
const FAR: f64 = 11.512_925_464_970_229;
/// Bounds of the logarithms of both hyperparameters.
const BOUNDS: Bounds<2> = Bounds { lower: [-FAR; 2], upper: [FAR; 2] };
/// Shares of the noise variance that the kernel matrix may lack at the start: first one, then the other.
const START_SHARES: [f64; 2] = [1e-3, 1e-6];
/// What the kernel matrix may lack on its diagonal, as a share of the noise variance, for residuals by a factorisation of
/// low rank, which is one below this share of the samples.
const EXACT: f64 = 1e-11;
const LOW: usize = 16;
/// Samples above which matrices are large: then they are counted, and that of the start is not kept.
pub(super) const LARGE: usize = 2000;

/// A regression on given conditions, for any number of targets.
pub(super) struct GaussianProcess {
    inputs: Inputs,
    /// Every search starts at the same point: its factorisation is shared. A loose one, and one as exact as any, for
    /// targets that the first is too loose for.
    starts: [OnceLock<Option<Likelihood>>; 2],
    memory: Arc<Memory>,
}

/// A fit at the optimum.
pub(super) struct Fit {
    /// Log marginal likelihood there.
    pub(super) log_likelihood: f64,
    /// Target minus the mean of the process, per sample.
    pub(super) residuals: Vec<f64>,
}

impl GaussianProcess {
    /// A regression on `conditions`: one row of samples per dimension, standardised.
    pub(super) fn new(conditions: &[Vec<f64>], memory: &Arc<Memory>) -> Self {
        Self { inputs: Inputs::new(conditions), starts: Default::default(), memory: memory.clone() }
    }

    /// Bytes that fits on `n` samples need at the least, on any number of `threads`.
    pub(super) fn bytes(n: usize, threads: usize) -> usize {
        let one = Dense::<f64>::bytes(n).max(LowRank::<f64, f64>::bytes(n, max_rank(n)));
        // Of few samples each thread keeps the factorisations of the start.
        if n > LARGE { one } else { 2 * one * threads }
    }

    /// Fits the standardised `target`: the maximum of the marginal likelihood that L-BFGS-B reaches from `l = s = 1`.
    /// `check` is called before each evaluation.
    ///
    /// The search works with likelihoods as exact as its gradient asks for; the optimum moves by less than the
    /// search's own tolerance. The residuals are exact at the optimum.
    ///
    /// # Errors
    /// Those of `check`.
    pub(super) fn fit(&self, target: &[f64], check: &dyn Fn() -> Result<()>) -> Result<Fit> {
        let (optimum, search) = self.optimum(target, check)?;
        let theta = Theta::from_logarithms(optimum.x);
        let alpha = self.alpha(target, theta, search).ok_or_else(|| {
            Error::Data("a Gaussian process has no positive definite covariance on these samples".into())
        })?;
        // y - K (K + s I)^-1 y = s (K + s I)^-1 y
        let residuals = alpha.iter().map(|a| theta.s * a).collect();
        Ok(Fit { log_likelihood: -optimum.value, residuals })
    }

    /// The optimum in `(ln l, ln s)`, with minus the log marginal likelihood there.
    fn optimum(&self, target: &[f64], check: &dyn Fn() -> Result<()>) -> Result<(Point<2>, Search)> {
        let mut search = Search::new(target.len(), START_SHARES[1]);
        let optimum = minimize(
            |logarithms, exactness| {
                check()?;
                let theta = Theta::from_logarithms(logarithms);
                let value = self.evaluate(target, theta, exactness, &mut search);
                let Value { value, gradient, uncertainty, errors, curvature, .. } =
                    value.unwrap_or(Value::NONE);
                Ok(Point { x: logarithms, value, gradient, uncertainty, errors, curvature: Some(curvature) })
            },
            foretell,
            [0.0; 2],
            &BOUNDS,
            &Tolerances::default(),
        )?;
        Ok((optimum, search))
    }

    /// `(K + s I)^-1 y`, exact.
    fn alpha(&self, y: &[f64], theta: Theta, mut search: Search) -> Option<Vec<f64>> {
        let n = y.len();
        let nearest = search.last.take();
        if let Some(pivots) = nearest.as_ref().and_then(Likelihood::pivots)
            && pivots.len() <= n / LOW
        {
            // A little more rank, and the factorisation is as good as exact.
            let tolerance = (EXACT * theta.s.min(1.0)).max(ROUNDING);
            let mut factor = Incomplete::<f64>::new(n, n / 4, pivots);
            if factor.extend(&self.inputs, theta.l, tolerance, n / 4).is_some()
                && let Some(end) = LowRank::<f64, f64>::new(&self.inputs, theta, factor, None)
            {
                return Some(end.alpha(y));
            }
        }
        let start = || self.starts[search.start].get()?.as_ref();
        if let Some(nearest) = nearest.as_ref().or_else(start) {
            let refined = refine::solve(&self.inputs, theta, y, |rest| nearest.alpha(rest));
            if refined.is_some() {
                return refined;
            }
        }
        drop(nearest);
        let end = Likelihood::new(&self.inputs, theta, Purpose::Residuals, &mut search, &self.memory)?;
        Some(end.alpha(y))
    }

    /// Minus the log marginal likelihood, with a gradient as exact as that, if it is foretold.
    fn evaluate(
        &self,
        y: &[f64],
        theta: Theta,
        exactness: Option<Exactness>,
        search: &mut Search,
    ) -> Option<Value> {
        search.last = None;
        let n = y.len();
        let likelihood =
            |search: &mut Search| Likelihood::new(&self.inputs, theta, Purpose::Search, search, &self.memory);
        if theta == Theta::START && n <= LARGE {
            return self.starts.iter().zip(START_SHARES).enumerate().find_map(|(number, (start, share))| {
                search.start = number;
                let mut first = Search::new(n, share);
                // Asked before: what is recorded is the same whoever made the shared start.
                let at = (theta.l, first.plan(&self.inputs, theta).tolerance);
                let start = start.get_or_init(|| likelihood(&mut first)).as_ref()?;
                let result = start.evaluate(y);
                search.share = share;
                let too_loose = search.learn(&result, n, theta.s, start.plan(), 0.0);
                match start.pivots() {
                    Some(_) if number == 0 && too_loose => return None,
                    Some(pivots) => search.hints = Some((pivots.to_vec(), at)),
                    None => search.too_high_rank = Some(at),
                }
                Some(result)
            });
        }
        search.allow(exactness.map(|exactness| exactness.error));
        let least = exactness.map_or(0.0, |exactness| exactness.least);
        let mut at = likelihood(search)?;
        let mut result = at.evaluate(y);
        if search.learn(&result, n, theta.s, at.plan(), least) {
            search.allow(exactness.map(|exactness| exactness.after(result.steepness())));
            at = at.tightened(&self.inputs, search, &self.memory)?;
            result = at.evaluate(y);
            search.learn(&result, n, theta.s, at.plan(), least);
        }
        if n <= LARGE {
            search.last = Some(at);
        }
        Some(result)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::{
        super::{
            likelihood::Form,
            low_rank::Derivative,
            real::Real,
            residuals::standardized,
            search::{CONSISTENT_SHARES, Plan, Precision, single_serves},
        },
        *,
    };

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

    fn dense(inputs: &Inputs, theta: Theta, for_search: bool) -> Likelihood {
        Likelihood::of(theta, Form::Dense(Dense::new(inputs, theta, for_search).unwrap()), None)
    }

    fn low_rank(
        inputs: &Inputs,
        theta: Theta,
        tolerance: f64,
        derivative: Derivative,
        precision: Precision,
    ) -> Likelihood {
        fn of<F: Real, P: Real>(inputs: &Inputs, theta: Theta, plan: Plan) -> LowRank<F, P> {
            let mut factor = Incomplete::new(inputs.len(), inputs.len(), &[]);
            factor.extend(inputs, theta.l, plan.tolerance, inputs.len()).unwrap();
            LowRank::new(inputs, theta, factor, plan.derivative).unwrap()
        }
        let plan = Plan { tolerance, derivative: Some(derivative), precision };
        let form = match precision {
            Precision::Double => Form::LowRank(of(inputs, theta, plan)),
            Precision::Mixed => Form::LowRankMixed(of(inputs, theta, plan)),
            Precision::Single => Form::LowRankSingle(of(inputs, theta, plan)),
        };
        Likelihood::of(theta, form, Some(plan))
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
            let at = |l: f64, s: f64| by_definition(&rows, &y, Theta { l: theta.l * l.exp(), s: theta.s * s.exp() });
            let expected_gradient = [(at(h, 0.0) - at(-h, 0.0)) / (2.0 * h), (at(0.0, h) - at(0.0, -h)) / (2.0 * h)];
            let tolerance = (1e-10 * theta.s.min(1.0) / theta.l.max(1.0).powi(2)).max(ROUNDING);
            let dense_form = dense(&inputs, theta, true);
            let Value { value, gradient, curvature, .. } = dense_form.evaluate(&y);
            let alpha = dense(&inputs, theta, false).alpha(&y);
            prop_assert!((value - expected).abs() < 1e-9 * expected.abs().max(1.0));
            let h = 1e-3;
            let expected_curvature = (at(0.0, h) - 2.0 * expected + at(0.0, -h)) / (h * h);
            let limit = 1e-3 * expected_curvature.abs().max(0.001 * expected.abs()).max(1.0);
            prop_assert!((curvature - expected_curvature).abs() < limit, "{curvature} {expected_curvature}");
            for (got, expected) in gradient.iter().zip(expected_gradient) {
                prop_assert!((got - expected).abs() < 1e-5 * expected.abs().max(1.0), "{got} {expected}");
            }
            let low_rank =
                low_rank(&inputs, theta, tolerance, Derivative::Interpolated, Precision::Double);
            let Value { value: low_value, gradient: low_gradient, curvature: low_curvature, .. } =
                low_rank.evaluate(&y);
            let low_alpha = low_rank.alpha(&y);
            prop_assert!((curvature - low_curvature).abs() < 1e-5 * curvature.abs().max(expected.abs()).max(1.0));
            prop_assert!((value - low_value).abs() < 1e-8 * value.abs().max(1.0), "{value} {low_value}");
            for (dense, low) in gradient.iter().zip(low_gradient) {
                prop_assert!((dense - low).abs() < 1e-5 * dense.abs().max(1.0), "{dense} {low}");
            }
            for (dense, low) in alpha.iter().zip(&low_alpha) {
                prop_assert!((dense - low).abs() < 1e-7 / theta.s, "{dense} {low}");
            }
            // Single precision, where the search would use it.
            if single_serves(n, theta) {
                let form = Form::DenseSingle(Dense::new(&inputs, theta, true).unwrap());
                let Value { value: single_value, gradient: single_gradient, .. } =
                    Likelihood::of(theta, form, None).evaluate(&y);
                let limit = 1e-5 * (1.0 + 0.01 / theta.s) * value.abs().max(1.0);
                prop_assert!((value - single_value).abs() < limit, "{value} {single_value}");
                for (dense, single) in gradient.iter().zip(single_gradient) {
                    prop_assert!((dense - single).abs() < 100.0 * limit, "{dense} {single}");
                }
            }
        }

        /// At the tightest tolerance, whose share of the noise variance times the samples is the unit of both errors.
        #[test]
        fn the_consistent_derivative_is_exact_enough(
            d in 1usize..5, n in 20usize..120, seed in 0u64..1000, log_l in -1.0f64..2.0, log_s in -4.0f64..1.0,
        ) {
            let (rows, y) = samples(n, d, seed);
            let (rows, y) = (rows.iter().map(|row| standardized(row)).collect::<Vec<_>>(), standardized(&y));
            let theta = Theta { l: log_l.exp(), s: log_s.exp() };
            let inputs = Inputs::new(&rows);
            let exact = dense(&inputs, theta, true).evaluate(&y);
            for (share, precision) in [(CONSISTENT_SHARES[0], Precision::Mixed), (1e-3, Precision::Single)] {
                let tolerance = share * theta.s.min(1.0);
                let low = low_rank(&inputs, theta, tolerance, Derivative::Consistent, precision).evaluate(&y);
                let unit = n as f64 * share / theta.s.min(1.0);
                prop_assert!((exact.value - low.value).abs() < 5.0 * unit, "{} {}", exact.value, low.value);
                for (exact, low) in exact.gradient.iter().zip(low.gradient) {
                    prop_assert!((exact - low).abs() < 25.0 * unit, "{exact} {low}");
                }
            }
        }
    }

    /// Where the search ends with exact likelihoods in double precision, no value of the function distrusted and no step
    /// foretold.
    fn exact_optimum(rows: &[Vec<f64>], y: &[f64]) -> Point<2> {
        let inputs = Inputs::new(rows);
        let exact = |x: [f64; 2], _| {
            let theta = Theta::from_logarithms(x);
            let at = Dense::<f64>::new(&inputs, theta, true)
                .map(|at| Likelihood::of(theta, Form::Dense(at), None));
            let Value { value, gradient, .. } = at.map_or(Value::NONE, |at| at.evaluate(y));
            let (uncertainty, errors, curvature) = (0.0, [0.0; 2], None);
            Ok::<_, Error>(Point { x, value, gradient, uncertainty, errors, curvature })
        };
        minimize(exact, |_: &[_], _| None, [0.0; 2], &BOUNDS, &Tolerances::default()).unwrap()
    }

    /// Where a likelihood is flat, as with pure noise, the end is any; so it is the likelihood that is compared.
    #[test]
    fn the_search_ends_where_an_exact_one_does() {
        for seed in 0..60 {
            let (n, d) = (20 + (37 * seed as usize) % 180, 1 + seed as usize % 3);
            let (rows, signal) = samples(n, d, seed);
            let (noise, _) = samples(n, 1, 1000 + seed);
            let strength = [0.0, 0.3, 1.0, 4.0, 20.0][seed as usize / 3 % 5];
            let y: Vec<f64> = signal.iter().zip(&noise[0]).map(|(y, e)| strength * y + e).collect();
            let rows: Vec<_> = rows.iter().map(|row| standardized(row)).collect();
            let y = standardized(&y);
            let process = GaussianProcess::new(&rows, &Memory::new(0));
            let (found, _) = process.optimum(&y, &|| Ok(())).unwrap();
            let exact = exact_optimum(&rows, &y);
            let reached = by_definition(&rows, &y, Theta::from_logarithms(found.x));
            let lost = reached - exact.value;
            assert!(lost < 2e-3, "{seed}: {n} samples, {d} conditions, {found:?} {exact:?} {lost}");
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
