//! Gaussian process regression with the kernel `RBF(l) + White(s)` (Rasmussen and Williams 2006, chapters 2 and 5).

use std::sync::{Arc, OnceLock};

use super::{
    dense::Dense,
    factorisation::Factorisation,
    incomplete::Incomplete,
    kernel::Inputs,
    large,
    lbfgsb::Point,
    likelihood::{Likelihood, Value},
    local_model::Seen,
    low_rank::LowRank,
    plan::{Forecast, ROUNDING, max_rank},
    refine,
    resources::{LARGE, Resources},
    search::{Accuracy, Found, search, textbook},
    theta::Theta,
};
use crate::{
    independence_tests::settings::{GpSearch, TestSettings},
    numeric::random::Rng,
    types::{Error, Result},
};

/// Errors of the gradient, for each sample, that the shared likelihoods at the start have: first one, then the other.
const START_ERRORS: [f64; 2] = [1e-7, 1e-10];
/// A gradient whose error is so many times what was asked for is computed again.
const TOO_LOOSE: f64 = 10.0;
/// What the truncation may leave on the diagonal of the kernel matrix, as a fraction of the noise variance, for residuals by
/// a factorisation of low rank, which is one below this part of the samples.
const EXACT: f64 = 1e-11;
const LOW: usize = 16;

/// Log likelihood by which another maximum is a better one.
const BETTER: f64 = 1e-3;
/// Length scales where a better maximum is looked for, as multiples of the one found; error of the gradients there; and what a
/// better place gains at the least.
const PROBED: [f64; 4] = [0.2, 0.5, 2.0, 5.0];
const PROBE_ERROR: f64 = 0.02;
const PROBE_GAIN: f64 = 0.1;

/// How the maximum is searched for.
#[derive(Clone, Copy, Debug)]
pub(super) struct SearchSettings {
    /// With likelihoods as exact as they need be, or all exact.
    pub(super) search: GpSearch,
    /// Further searches from random places.
    pub(super) restarts: usize,
    /// Of these places.
    pub(super) seed: u64,
}

impl SearchSettings {
    pub(super) fn of(settings: &TestSettings) -> Self {
        Self { search: settings.gp_search, restarts: settings.gp_restarts, seed: settings.seed }
    }
}

/// A regression on given conditions, for any number of targets.
pub(super) struct GaussianProcess {
    inputs: Inputs,
    /// Every search starts at the same point: its factorisation is shared. A looser one, and a tighter one for targets that the
    /// first is too loose for.
    starts: [OnceLock<Option<Likelihood>>; 2],
    /// The regression on some of many samples.
    few: OnceLock<Box<Self>>,
    resources: Arc<Resources>,
}

/// A fit at the optimum.
pub(super) struct Fit {
    /// Where it is.
    pub(super) theta: Theta,
    /// Log marginal likelihood there, to about 1e-4.
    pub(super) log_likelihood: f64,
    /// Whether the search was repeated with tight likelihoods.
    pub(super) repeated: bool,
    /// Whether the maximum is that of some of the samples, because the rank of all is too high, or one of two that they lead to.
    pub(super) by_few: bool,
    /// Target minus the mean of the process, per sample.
    pub(super) residuals: Vec<f64>,
}

/// What a search carries from one likelihood to the next.
struct State {
    forecast: Forecast,
    /// Which of the shared factorisations it started with.
    start: usize,
    /// The likelihood at the last place but the start; of large matrices none is kept.
    last: Option<Likelihood>,
}

impl GaussianProcess {
    /// A regression on `conditions`: one row of samples per dimension, standardised.
    pub(super) fn new(conditions: &[Vec<f64>], resources: &Arc<Resources>) -> Self {
        Self::of(Inputs::new(conditions), resources)
    }

    fn of(inputs: Inputs, resources: &Arc<Resources>) -> Self {
        Self { inputs, starts: Default::default(), few: OnceLock::new(), resources: resources.clone() }
    }

    /// Bytes that fits on `n` samples need at the least, on any number of `threads`.
    pub(super) fn bytes(n: usize, threads: usize, search: GpSearch) -> usize {
        let low_rank = LowRank::<f64>::bytes(n, max_rank(n));
        if n > LARGE && search == GpSearch::Default {
            return low_rank;
        }
        let one = Dense::<f64>::bytes(n).max(low_rank);
        // Of few samples each thread keeps the factorisations of the start.
        if n > LARGE { one } else { 2 * one * threads }
    }

    /// Fits the standardised `target`: the maximum of the marginal likelihood that L-BFGS-B reaches from `l = s = 1`, or, with
    /// [`SearchSettings::restarts`], the best that it reaches from several places. `check` is called before each evaluation.
    ///
    /// The residuals are exact at the optimum. On more than [`LARGE`] samples the maximum is that of some of them, improved on all
    /// ([`large`]), unless [`GpSearch::Exact`] is asked for.
    ///
    /// # Errors
    /// Those of `check`.
    pub(super) fn fit(
        &self,
        target: &[f64],
        how: &SearchSettings,
        check: &dyn Fn() -> Result<()>,
    ) -> Result<Fit> {
        let _work = self.resources.work();
        if target.len() > LARGE && how.search == GpSearch::Default {
            return self.fit_many(target, how, check);
        }
        let (Found { optimum, repeated }, state) = self.best_optimum(target, how, check)?;
        let theta = Theta::from_logarithms(optimum.x);
        let alpha = self.alpha(target, theta, state).ok_or_else(no_covariance)?;
        Ok(Fit {
            theta,
            log_likelihood: -optimum.value,
            repeated,
            by_few: false,
            residuals: residuals(theta, alpha),
        })
    }

    /// Gives samples with equal conditions and equal `target` the residual of the first of them. In exact arithmetic they have one;
    /// what rounding makes of it would decide their ranks.
    pub(super) fn make_equal(&self, target: &[f64], residuals: &mut [f64]) {
        let rows = |i: usize| std::iter::once(target[i]).chain(self.inputs.values_of(i));
        let compare = |a: usize, b: usize| {
            rows(a).zip(rows(b)).map(|(a, b)| a.total_cmp(&b)).find(|order| order.is_ne())
        };
        let mut order: Vec<usize> = (0..residuals.len()).collect();
        order.sort_unstable_by(|&a, &b| compare(a, b).unwrap_or_else(|| a.cmp(&b)));
        for equal in order.chunk_by(|&a, &b| compare(a, b).is_none()).filter(|equal| equal.len() > 1) {
            let first = residuals[equal[0]];
            equal.iter().for_each(|&i| residuals[i] = first);
        }
    }

    /// The same on many samples.
    fn fit_many(&self, target: &[f64], how: &SearchSettings, check: &dyn Fn() -> Result<()>) -> Result<Fit> {
        let n = target.len();
        let chosen = large::few_of(n, false);
        let of = |chosen: &[usize]| Self::of(self.inputs.chosen(chosen), &self.resources);
        let targets = |chosen: &[usize]| chosen.iter().map(|&i| target[i]).collect::<Vec<f64>>();
        let (few, few_targets) = (self.few.get_or_init(|| Box::new(of(&chosen))), targets(&chosen));
        let (Found { optimum, repeated }, _) = few.best_optimum(&few_targets, how, check)?;
        let share = n as f64 / chosen.len() as f64;
        let climb = |start: Theta| {
            let few = large::curvatures(&few.inputs, &few_targets, start, &self.resources);
            let hessian = few.unwrap_or([[1.0, 0.0], [0.0, 1.0]]).map(|row| row.map(|of_few| share * of_few));
            large::climb(&self.inputs, target, start, hessian, &self.resources, check)
        };
        let start = Theta::from_logarithms(optimum.x);
        let mut found = climb(start)?;
        if let Some(at) = found.as_ref().filter(|at| at.theta.l > large::NOTHING_FOUND) {
            // What some samples are too few to show, all may.
            let typical = Theta { l: (self.inputs.dimensions() as f64).sqrt(), s: at.theta.s };
            if let Some((better, _)) = self.better_elsewhere(target, typical, at.log_likelihood, check)?
                && let Some(other) = climb(better)?.filter(|other| other.log_likelihood > at.log_likelihood)
            {
                found = Some(other);
            }
        }
        let mut by_few = found.is_none();
        if let Some(at) = &found {
            let between = large::few_of(n, true);
            let (other, _) = of(&between).best_optimum(&targets(&between), how, check)?;
            let other = Theta::from_logarithms(other.optimum.x);
            if !large::is_same(start, other)
                && let Some(second) = climb(other)?.filter(|second| !large::is_same(at.theta, second.theta))
            {
                by_few = true;
                if second.log_likelihood >= at.log_likelihood {
                    found = Some(second);
                }
            }
        }
        let at = found.unwrap_or_else(|| large::Maximum {
            theta: start,
            log_likelihood: -share * optimum.value,
            pivots: Vec::new(),
        });
        check()?;
        let alpha = large::solve(&self.inputs, at.theta, target, &at.pivots, &self.resources)
            .ok_or_else(no_covariance)?;
        let residuals = residuals(at.theta, alpha);
        Ok(Fit { theta: at.theta, log_likelihood: at.log_likelihood, repeated, by_few, residuals })
    }

    /// The optimum, the best of several searches if asked for, and what the search to it leaves.
    fn best_optimum(
        &self,
        target: &[f64],
        how: &SearchSettings,
        check: &dyn Fn() -> Result<()>,
    ) -> Result<(Found, State)> {
        let mut state = State { forecast: Forecast::new(target.len()), start: 0, last: None };
        let mut best = match how.search {
            GpSearch::Exact => Found { optimum: self.exact(target, Theta::START, check)?, repeated: false },
            GpSearch::Default => self.optimum(target, &mut state, check)?,
        };
        let mut rng = Rng::new(how.seed);
        for _ in 0..how.restarts {
            let found = self.exact(target, Theta::random(&mut rng), check)?;
            if found.value < best.optimum.value - BETTER {
                best = Found { optimum: found, repeated: false };
                state = State { forecast: Forecast::new(target.len()), start: 0, last: None };
            }
        }
        Ok((best, state))
    }

    /// The optimum in `(ln l, ln s)`, with minus the log marginal likelihood there.
    fn optimum(&self, target: &[f64], state: &mut State, check: &dyn Fn() -> Result<()>) -> Result<Found> {
        search(target.len(), |x, accuracy| {
            check()?;
            let value = self.evaluate(target, Theta::from_logarithms(x), accuracy, state);
            let Value { value, gradient, errors, curvature, .. } = value.unwrap_or(Value::NONE);
            Ok(Seen { point: Point { x, value, gradient }, errors, curvature: Some(curvature) })
        })
    }

    /// The same from any `start` by exact likelihoods: the textbook's search.
    fn exact(&self, target: &[f64], start: Theta, check: &dyn Fn() -> Result<()>) -> Result<Point<2>> {
        textbook(start.logarithms(), |x| {
            check()?;
            let at = Likelihood::whole(&self.inputs, Theta::from_logarithms(x), true, &self.resources);
            let Value { value, gradient, .. } = at.map_or(Value::NONE, |at| at.evaluate(target));
            Ok((value, gradient))
        })
    }

    /// The log marginal likelihood at `theta`, exact; minus infinity where there is none.
    pub(super) fn log_likelihood(&self, target: &[f64], theta: Theta) -> f64 {
        let at = Likelihood::whole(&self.inputs, theta, true, &self.resources);
        -at.map_or(Value::NONE, |at| at.evaluate(target)).value
    }

    /// A place where the likelihood is higher than at the optimum `at`, which proves a better maximum, and the log likelihood
    /// there: the best of a few length scales around, each with the noise improved by one step. What it does not find may
    /// still be there.
    ///
    /// # Errors
    /// Those of `check`.
    pub(super) fn better_elsewhere(
        &self,
        target: &[f64],
        at: Theta,
        log_likelihood: f64,
        check: &dyn Fn() -> Result<()>,
    ) -> Result<Option<(Theta, f64)>> {
        let mut forecast = Forecast::new(target.len());
        let mut look = |theta: Theta| {
            check()?;
            let at = Likelihood::for_search(&self.inputs, theta, PROBE_ERROR, &mut forecast, &self.resources);
            Ok::<_, Error>(at.map_or(Value::NONE, |at| at.evaluate(target)))
        };
        let mut best: Option<(Theta, f64)> = None;
        for factor in PROBED {
            let mut theta = Theta { l: (at.l * factor).clamp(1e-3, 1e3), s: at.s };
            for _ in 0..2 {
                let value = look(theta)?;
                let reached = -value.value - value.truncation - PROBE_ERROR;
                if reached > best.map_or(log_likelihood, |(_, best)| best) + PROBE_GAIN {
                    best = Some((theta, reached));
                }
                if value.curvature <= 0.0 {
                    break;
                }
                theta.s *= libm::exp((-value.gradient[1] / value.curvature).clamp(-2.0, 2.0));
            }
        }
        Ok(best)
    }

    /// `(K + s I)^-1 y`, exact.
    fn alpha(&self, y: &[f64], theta: Theta, mut state: State) -> Option<Vec<f64>> {
        let n = y.len();
        let nearest = state.last.take();
        if let Some(pivots) = nearest.as_ref().and_then(Likelihood::pivots)
            && pivots.len() <= n / LOW
        {
            // A little more rank, and the factorisation is as good as exact.
            let tolerance = (EXACT * theta.s.min(1.0)).max(ROUNDING);
            let mut factor = Incomplete::<f64>::new(n, n / 4, pivots);
            if factor.extend(&self.inputs, theta.l, tolerance, n / 4).is_some()
                && let Some(end) = LowRank::<f64>::new(&self.inputs, theta, factor, None)
            {
                return Some(end.alpha(y));
            }
        }
        let start = || self.starts[state.start].get()?.as_ref();
        if let Some(nearest) = nearest.as_ref().or_else(start) {
            let refined = refine::solve(&self.inputs, theta, y, |rest| nearest.alpha(rest));
            if refined.is_some() {
                return refined;
            }
        }
        drop(nearest);
        let end = Likelihood::for_residuals(&self.inputs, theta, &mut state.forecast, &self.resources)?;
        Some(end.alpha(y))
    }

    /// Minus the log marginal likelihood, as exact as asked for.
    fn evaluate(&self, y: &[f64], theta: Theta, accuracy: Accuracy, state: &mut State) -> Option<Value> {
        state.last = None;
        let n = y.len();
        if theta == Theta::START && n <= LARGE {
            return self.at_start(y, accuracy, state);
        }
        let expected = accuracy.expected.min(0.1 * n as f64);
        let (inputs, forecast, resources) = (&self.inputs, &mut state.forecast, &self.resources);
        let mut at = Likelihood::for_search(inputs, theta, accuracy.error(expected), forecast, resources)?;
        let mut value = at.evaluate(y);
        at.plan.inspect(|plan| forecast.learn(n, theta.s, *plan, value.truncation));
        let wanted = accuracy.error(value.steepness());
        if value.error() > TOO_LOOSE * wanted && !at.is_exact() {
            at = at.tightened(inputs, wanted, forecast, resources)?;
            value = at.evaluate(y);
            at.plan.inspect(|plan| forecast.learn(n, theta.s, *plan, value.truncation));
        }
        if n <= LARGE {
            state.last = Some(at);
        }
        Some(value)
    }

    /// The likelihood at the start, from the shared factorisations.
    fn at_start(&self, y: &[f64], accuracy: Accuracy, state: &mut State) -> Option<Value> {
        let (n, theta) = (y.len(), Theta::START);
        self.starts.iter().zip(START_ERRORS).enumerate().find_map(|(number, (start, error))| {
            state.start = number;
            let mut fresh = Forecast::new(n);
            let error = error * n as f64;
            // Asked before: what is recorded is the same whoever made the shared start.
            let tolerance = fresh.plan(&self.inputs, theta, error).tolerance;
            let mut make = || Likelihood::for_search(&self.inputs, theta, error, &mut fresh, &self.resources);
            // Made before it is kept, maybe twice at the same time: a lock held meanwhile could be asked for by a test that this thread
            // is given while it waits for half a matrix.
            let start = match start.get() {
                Some(start) => start,
                None => {
                    let made = make();
                    start.get_or_init(|| made)
                }
            }
            .as_ref()?;
            let value = start.evaluate(y);
            let is_last = number + 1 == START_ERRORS.len();
            if !is_last && !start.is_exact() && value.error() > TOO_LOOSE * accuracy.error(value.steepness())
            {
                return None;
            }
            start.plan.inspect(|plan| state.forecast.learn(n, theta.s, *plan, value.truncation));
            match start.pivots() {
                Some(pivots) => state.forecast.pivots = Some((pivots.to_vec(), (theta.l, tolerance))),
                None => state.forecast.too_high_rank = Some((theta.l, tolerance)),
            }
            Some(value)
        })
    }
}

/// `y - K (K + s I)^-1 y = s (K + s I)^-1 y`.
fn residuals(theta: Theta, alpha: Vec<f64>) -> Vec<f64> {
    alpha.into_iter().map(|a| theta.s * a).collect()
}

pub(super) fn no_covariance() -> Error {
    Error::Data("a Gaussian process has no positive definite covariance on these samples".into())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::{
        super::{
            cores::ONE,
            likelihood::Form,
            plan::{Derivative, Plan, Precision, ROUNDING, single_error},
            real::Real,
        },
        *,
    };
    use crate::numeric::rows::standardized;

    const DEFAULT: SearchSettings = SearchSettings { search: GpSearch::Default, restarts: 0, seed: 42 };

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
        Likelihood::of(theta, Form::Dense(Dense::new(inputs, theta, for_search, &ONE).unwrap()), None)
    }

    fn low_rank(
        inputs: &Inputs,
        theta: Theta,
        tolerance: f64,
        derivative: Derivative,
        precision: Precision,
    ) -> Likelihood {
        fn of<T: Real>(inputs: &Inputs, theta: Theta, plan: Plan) -> LowRank<T> {
            let mut factor = Incomplete::new(inputs.len(), inputs.len(), &[]);
            factor.extend(inputs, theta.l, plan.tolerance, inputs.len()).unwrap();
            LowRank::new(inputs, theta, factor, plan.derivative).unwrap()
        }
        let plan = Plan { tolerance, derivative: Some(derivative), precision };
        let form = match precision {
            Precision::Double => Form::LowRank(of(inputs, theta, plan)),
            Precision::Single => Form::LowRankSingle(of(inputs, theta, plan)),
        };
        Likelihood::of(theta, form, Some(plan))
    }

    fn samples(n: usize, d: usize, seed: u64) -> (Vec<Vec<f64>>, Vec<f64>) {
        let mut rng = crate::numeric::pcg64::Pcg64::new(seed);
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
            if single_error(n, theta).is_finite() {
                let form = Form::DenseSingle(Dense::new(&inputs, theta, true, &ONE).unwrap());
                let Value { value: single_value, gradient: single_gradient, .. } =
                    Likelihood::of(theta, form, None).evaluate(&y);
                let limit = 1e-5 * (1.0 + 0.01 / theta.s) * value.abs().max(1.0);
                prop_assert!((value - single_value).abs() < limit, "{value} {single_value}");
                for (dense, single) in gradient.iter().zip(single_gradient) {
                    prop_assert!((dense - single).abs() < 100.0 * limit, "{dense} {single}");
                }
            }
        }

        /// At a tolerance whose share of the noise variance times the samples is the unit of both errors.
        #[test]
        fn the_consistent_derivative_is_exact_enough(
            d in 1usize..5, n in 20usize..120, seed in 0u64..1000, log_l in -1.0f64..2.0, log_s in -4.0f64..1.0,
        ) {
            let (rows, y) = samples(n, d, seed);
            let (rows, y) = (rows.iter().map(|row| standardized(row)).collect::<Vec<_>>(), standardized(&y));
            let theta = Theta { l: log_l.exp(), s: log_s.exp() };
            let inputs = Inputs::new(&rows);
            let exact = dense(&inputs, theta, true).evaluate(&y);
            for (share, precision) in [(1e-5, Precision::Double), (1e-3, Precision::Single)] {
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
            let process = GaussianProcess::new(&rows, &Resources::new(0));
            let check = || Ok(());
            let found = process.fit(&y, &DEFAULT, &check).unwrap();
            let exact = process.exact(&y, Theta::START, &check).unwrap();
            let off = found.log_likelihood + exact.value;
            assert!(
                off.abs() < 1e-4,
                "{seed}: {n} samples, {d} conditions, {:?} {exact:?} {off}",
                found.theta
            );
        }
    }

    /// A function with a coarse part and a fine one has a maximum for each: the search from `l = 1` may end in the lesser.
    #[test]
    fn restarts_find_the_better_of_two_maxima_and_a_probe_says_that_it_is_there() {
        let mut rng = crate::numeric::pcg64::Pcg64::new(9);
        let mut two_maxima = 0;
        for _ in 0..30 {
            let z: Vec<f64> = (0..120).map(|_| 4.0 * rng.next_f64() - 2.0).collect();
            let y: Vec<f64> = z.iter().map(|z| z + 0.8 * (9.0 * z).sin() + 0.3 * rng.next_f64()).collect();
            let (rows, y) = (vec![standardized(&z)], standardized(&y));
            let process = GaussianProcess::new(&rows, &Resources::new(0));
            let alone = process.fit(&y, &DEFAULT, &|| Ok(())).unwrap();
            let settings = SearchSettings { restarts: 8, ..DEFAULT };
            let best = process.fit(&y, &settings, &|| Ok(())).unwrap();
            assert!(best.log_likelihood >= alone.log_likelihood);
            let probe = process.better_elsewhere(&y, alone.theta, alone.log_likelihood, &|| Ok(())).unwrap();
            if let Some((theta, log_likelihood)) = probe {
                // It is true: the likelihood is higher there, and the restarts found it.
                let exact = -by_definition(&rows, &y, theta);
                assert!(exact > alone.log_likelihood && (exact - log_likelihood).abs() < 1.0);
                assert!(best.log_likelihood > alone.log_likelihood + 0.05);
                two_maxima += 1;
            }
        }
        assert!(two_maxima > 0);
    }

    #[test]
    fn a_smooth_function_leaves_its_noise() {
        let (rows, _) = samples(200, 1, 1);
        let (_, noise) = samples(200, 1, 2);
        let y: Vec<f64> = rows[0].iter().zip(&noise).map(|(z, e)| (2.0 * z).sin() + 0.1 * e).collect();
        let fit = GaussianProcess::new(&rows, &Resources::new(0)).fit(&y, &DEFAULT, &|| Ok(())).unwrap();
        let left = fit.residuals.iter().zip(&noise).map(|(r, e)| (r - 0.1 * e).abs()).sum::<f64>() / 200.0;
        assert!(left < 0.03, "{left}");
    }

    #[test]
    fn a_fit_that_is_cancelled_ends() {
        let (rows, y) = samples(30, 1, 3);
        let cancelled = || Err(Error::Cancelled("now".into()));
        assert!(GaussianProcess::new(&rows, &Resources::new(0)).fit(&y, &DEFAULT, &cancelled).is_err());
    }

    /// Two series of a robot and a person. From the start the likelihood of the one given the other falls to a shelf, which a model
    /// takes for a maximum, and from there on to the maximum.
    #[test]
    fn a_shelf_is_no_maximum() {
        let rows: Vec<[f64; 2]> = include_str!("../../../tests/data/shelf.csv")
            .lines()
            .map(|line| line.split_once(',').map(|(a, b)| [a, b].map(|cell| cell.parse().unwrap())).unwrap())
            .collect();
        let column = |i: usize| standardized(&rows.iter().map(|row| row[i]).collect::<Vec<_>>());
        let process = GaussianProcess::new(&[column(1)], &Resources::new(0));
        let fit = process.fit(&column(0), &DEFAULT, &|| Ok(())).unwrap();
        let exact = process.exact(&column(0), Theta::START, &|| Ok(())).unwrap();
        assert!((fit.log_likelihood + exact.value).abs() < 1e-4, "{:?} {exact:?}", fit.theta);
    }
}
