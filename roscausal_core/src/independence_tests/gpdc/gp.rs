//! Gaussian process regression with the kernel `RBF(l) + White(s)` (Rasmussen and Williams 2006, chapters 2 and 5).

use std::sync::{Arc, OnceLock};

use super::{
    dense::Dense,
    incomplete::Incomplete,
    kernel::{Inputs, dot},
    lbfgsb::{Bounds, Point, Tolerances, minimize},
    low_rank::{Derivative, LowRank},
    memory::{Held, Memory},
    refine,
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

/// Natural logarithm of 1e5.
const FAR: f64 = 11.512_925_464_970_229;
/// Bounds of the logarithms of both hyperparameters.
const BOUNDS: Bounds<2> = Bounds { lower: [-FAR; 2], upper: [FAR; 2] };
/// Rounding errors of the likelihood's values that the search reckons with, relative to them.
const NOISE: f64 = 1e-6;
/// What the kernel matrix may lack on its diagonal while the search goes, as a share of the noise variance: by the
/// gradient (see [`share_for`]), within these bounds; and for the residuals at the end.
const LOOSEST: f64 = 1e-2;
const TIGHTEST: f64 = 1e-6;
const PER_GRADIENT: f64 = 1e-5;
const AT_THE_END: f64 = 1e-8;
/// The same for the consistent derivative: so many times as much, within bounds. It takes so many times as long at the same
/// rank.
const CONSISTENT: f64 = 5.0;
const CONSISTENT_TIGHTEST: f64 = 1e-5;
const CONSISTENT_COST: f64 = 1.25;
/// Ranks below which the time is spent elsewhere.
const LOW_RANK: f64 = 40.0;
/// A likelihood that turns out looser than its gradient asks for by this factor is made exact enough.
const TOO_LOOSE: f64 = 50.0;
/// Shares that the start is tried with.
const START_SHARES: [f64; 2] = [1e-3, TIGHTEST];
/// The same for residuals by a factorisation of low rank, which is one below this share of the samples.
const EXACT: f64 = 1e-11;
const LOW: usize = 16;
/// Rounding of a remainder.
const ROUNDING: f64 = 4e-15;
/// The rank grows by this power, times the number of conditions, of the inverse length scale and of the tolerance's
/// logarithm: from one evaluation to the next, within a tenth.
const RANK_GROWTH: f64 = 0.4;
/// Ratio of samples to noise variance up to which single precision serves the search.
const WELL_CONDITIONED: f64 = 1e5;
/// Samples above which matrices are large: then they are counted, and that of the start is not kept.
const LARGE: usize = 2000;

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

/// What does not depend on the target.
struct Likelihood {
    form: Form,
    _held: Option<Held>,
}

enum Form {
    Dense(Dense<f64>),
    /// In single precision.
    Single(Dense<f32>),
    LowRank(LowRank),
}

/// The parts of the gradient that do not depend on the target, of `A = K + s I`.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Traces {
    /// `tr(A^-1)`.
    pub(super) inverse: f64,
    /// `tr(A^-1 dK / d ln l)`.
    pub(super) derivative: f64,
}

impl GaussianProcess {
    /// A regression on `conditions`: one row of samples per dimension, standardised.
    pub(super) fn new(conditions: &[Vec<f64>], memory: &Arc<Memory>) -> Self {
        Self { inputs: Inputs::new(conditions), starts: Default::default(), memory: memory.clone() }
    }

    /// Bytes that fits on `n` samples need at the least, on any number of `threads`.
    pub(super) fn bytes(n: usize, threads: usize) -> usize {
        let one = Dense::<f64>::bytes(n).max(LowRank::bytes(n, max_rank(n)));
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
        let mut search = Search::new();
        let optimum = minimize(
            |logarithms| {
                check()?;
                let theta = Theta::from_logarithms(logarithms);
                Ok(self.evaluate(target, theta, &mut search).unwrap_or((f64::INFINITY, [0.0; 2], 0.0)))
            },
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
        if let Some(Likelihood { form: Form::LowRank(at), .. }) = &nearest
            && at.pivots().len() <= n / LOW
        {
            // A little more rank, and the factorisation is as good as exact.
            let tolerance = (EXACT * theta.s.min(1.0)).max(ROUNDING);
            let mut factor = Incomplete::new(n, n / 4, at.pivots());
            if factor.extend(&self.inputs, theta.l, tolerance, n / 4).is_some()
                && let Some(end) = LowRank::new(&self.inputs, theta, factor, None)
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

    /// Minus the log marginal likelihood, its gradient by `(ln l, ln s)`, and how far off the value may be.
    fn evaluate(&self, y: &[f64], theta: Theta, search: &mut Search) -> Option<(f64, [f64; 2], f64)> {
        search.last = None;
        let at_start = theta == Theta::START && y.len() <= LARGE;
        let likelihood =
            |search: &mut Search| Likelihood::new(&self.inputs, theta, Purpose::Search, search, &self.memory);
        if at_start {
            return self.starts.iter().zip(START_SHARES).enumerate().find_map(|(number, (start, share))| {
                search.start = number;
                let mut loose = Search { share, ..Search::new() };
                // Asked before: what is recorded is the same whoever made the shared start.
                let at = (theta.l, loose.plan(&self.inputs, theta).0);
                let start = start.get_or_init(|| likelihood(&mut loose)).as_ref()?;
                let result = start.evaluate(y, theta.s);
                search.learn(&result);
                match &start.form {
                    Form::LowRank(_) if share > TOO_LOOSE * search.share => return None,
                    Form::LowRank(form) => search.hints = Some((form.pivots().to_vec(), at)),
                    _ => search.too_high_rank = Some(at),
                }
                Some(result)
            });
        }
        let used = search.share;
        let mut at = likelihood(search)?;
        let mut result = at.evaluate(y, theta.s);
        search.learn(&result);
        if matches!(at.form, Form::LowRank(_)) && used > TOO_LOOSE * search.share {
            at = at.tightened(&self.inputs, theta, search, &self.memory)?;
            result = at.evaluate(y, theta.s);
            search.learn(&result);
        }
        if y.len() <= LARGE {
            search.last = Some(at);
        }
        Some(result)
    }
}

/// State of a search.
struct Search {
    /// What the kernel matrix may lack on its diagonal, as a share of the noise variance.
    share: f64,
    /// A length scale and a tolerance where the rank was too high: it is so for all that are shorter and tighter.
    too_high_rank: Option<(f64, f64)>,
    /// Largest component of the smallest gradient so far.
    smallest_gradient: f64,
    /// Pivots of the last low-rank form, and its length scale and tolerance.
    hints: Option<(Vec<u32>, (f64, f64))>,
    /// Which of the shared factorisations it started with.
    start: usize,
    /// The likelihood at the last place but the start; of large matrices none is kept.
    last: Option<Likelihood>,
}

impl Search {
    fn new() -> Self {
        Self {
            share: TIGHTEST,
            too_high_rank: None,
            smallest_gradient: f64::INFINITY,
            hints: None,
            start: 0,
            last: None,
        }
    }

    /// Takes a result: the smaller the gradients, the more exact the next likelihood.
    fn learn(&mut self, (_, gradient, _): &(f64, [f64; 2], f64)) {
        self.smallest_gradient = self.smallest_gradient.min(gradient[0].abs().max(gradient[1].abs()));
        self.share = share_for(self.smallest_gradient);
    }

    /// Whether the rank at a length scale and tolerance is known to be too high, or expected to be by that of the last
    /// low-rank form: to find it out by a factorisation may take a third of the time of the whole matrix.
    fn expects_too_high_rank(&self, inputs: &Inputs, l: f64, tolerance: f64) -> bool {
        let max_rank = max_rank(inputs.len());
        let known = self.too_high_rank.is_some_and(|(at, than)| l <= at && tolerance <= than);
        let expected = self.hints.as_ref().is_some_and(|(pivots, _)| {
            pivots.len() > max_rank / 2
                && self.expected_rank(inputs, l, tolerance).is_some_and(|rank| rank > max_rank as f64)
        });
        known || expected
    }

    /// The rank at a length scale and tolerance by that of the last low-rank form.
    fn expected_rank(&self, inputs: &Inputs, l: f64, tolerance: f64) -> Option<f64> {
        self.hints.as_ref().map(|(pivots, (at, than))| {
            let growth = at / l * tolerance.ln() / than.ln();
            pivots.len() as f64 * growth.powf(RANK_GROWTH * inputs.dimensions() as f64)
        })
    }

    /// Largest remainder on the diagonal, and the derivative that asks for it: the one that takes less time, by the ranks
    /// to be expected.
    fn plan(&self, inputs: &Inputs, theta: Theta) -> (f64, Derivative) {
        let interpolated = tolerance(self.share, theta);
        let share = (CONSISTENT * self.share).clamp(CONSISTENT_TIGHTEST, LOOSEST);
        let consistent = share * theta.s.min(1.0);
        let ranks = (interpolated.ln() / consistent.ln()).powf(RANK_GROWTH * inputs.dimensions() as f64);
        let low = self.expected_rank(inputs, theta.l, interpolated).is_some_and(|rank| rank < LOW_RANK);
        if single_serves(inputs.len(), theta) && !low && ranks * ranks > CONSISTENT_COST {
            (consistent, Derivative::Consistent)
        } else {
            (interpolated, Derivative::Interpolated)
        }
    }
}

/// Largest remainder on the diagonal for a share of the noise variance. The error of the interpolated derivative is larger
/// than that of the kernel for long length scales (of inputs of unit variance), which this makes good.
fn tolerance(share: f64, theta: Theta) -> f64 {
    (share * theta.s.min(1.0) / theta.l.max(1.0)).max(ROUNDING)
}

/// The share of the noise variance that leaves an error of a few percent in a gradient of this size.
fn share_for(gradient: f64) -> f64 {
    (PER_GRADIENT * gradient * gradient.sqrt()).clamp(TIGHTEST, LOOSEST)
}

/// Whether single precision serves the search.
fn single_serves(n: usize, theta: Theta) -> bool {
    n as f64 <= WELL_CONDITIONED * theta.s
}

/// What a likelihood is computed for.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Purpose {
    /// Its value and gradient.
    Search,
    /// Its value and the residuals, exact.
    Residuals,
}

/// Rank up to which the low-rank form is the faster one.
fn max_rank(n: usize) -> usize {
    2 * n / 5
}

impl Likelihood {
    /// The form that is the fastest at `theta`.
    fn new(
        inputs: &Inputs,
        theta: Theta,
        purpose: Purpose,
        search: &mut Search,
        memory: &Arc<Memory>,
    ) -> Option<Self> {
        let n = inputs.len();
        let hold = |bytes: usize| (n > LARGE).then(|| memory.hold(bytes));
        let gradient = purpose == Purpose::Search;
        let (tolerance, derivative) = match purpose {
            Purpose::Search => search.plan(inputs, theta),
            Purpose::Residuals => (tolerance(AT_THE_END, theta), Derivative::Interpolated),
        };
        if !search.expects_too_high_rank(inputs, theta.l, tolerance) {
            let held = hold(LowRank::bytes(n, max_rank(n)));
            let hints = search.hints.as_ref().map_or(&[][..], |(pivots, _)| pivots);
            let mut factor = Incomplete::new(n, max_rank(n), hints);
            let fits = factor.extend(inputs, theta.l, tolerance, max_rank(n)).is_some();
            if let Some(at) =
                fits.then(|| LowRank::new(inputs, theta, factor, gradient.then_some(derivative))).flatten()
            {
                search.hints = Some((at.pivots().to_vec(), (theta.l, tolerance)));
                return Some(Self { form: Form::LowRank(at), _held: held });
            }
            search.too_high_rank = Some((theta.l, tolerance));
        }
        if gradient && single_serves(n, theta) {
            let held = hold(Dense::<f32>::bytes(n));
            if let Some(at) = Dense::<f32>::new(inputs, theta, true) {
                return Some(Self { form: Form::Single(at), _held: held });
            }
        }
        let held = hold(Dense::<f64>::bytes(n));
        Dense::<f64>::new(inputs, theta, gradient).map(|at| Self { form: Form::Dense(at), _held: held })
    }

    /// The same likelihood for the search, as exact as it asks for now.
    fn tightened(
        self,
        inputs: &Inputs,
        theta: Theta,
        search: &mut Search,
        memory: &Arc<Memory>,
    ) -> Option<Self> {
        let Form::LowRank(at) = self.form else { return Some(self) };
        let mut factor = at.into_factor();
        let (tolerance, derivative) = search.plan(inputs, theta);
        if !search.expects_too_high_rank(inputs, theta.l, tolerance)
            && factor.extend(inputs, theta.l, tolerance, max_rank(inputs.len())).is_some()
            && let Some(at) = LowRank::new(inputs, theta, factor, Some(derivative))
        {
            search.hints = Some((at.pivots().to_vec(), (theta.l, tolerance)));
            return Some(Self { form: Form::LowRank(at), _held: self._held });
        }
        search.too_high_rank = Some((theta.l, tolerance));
        drop(self._held);
        Self::new(inputs, theta, Purpose::Search, search, memory)
    }

    fn evaluate(&self, y: &[f64], s: f64) -> (f64, [f64; 2], f64) {
        let (traces, (alpha, curvature)) = match &self.form {
            Form::Dense(at) => (at.traces, at.solve(y)),
            Form::Single(at) => (at.traces, at.solve(y)),
            Form::LowRank(at) => (at.traces, at.solve(y)),
        };
        let gradient =
            [0.5 * (traces.derivative - curvature), 0.5 * s * (traces.inverse - dot(&alpha, &alpha))];
        let value = self.value(y, &alpha);
        let missing = match &self.form {
            Form::LowRank(at) => at.missing(&alpha),
            _ => 0.0,
        };
        (value, gradient, NOISE * value.abs().max(1.0) + missing)
    }

    /// `(K + s I)^-1 y`.
    fn alpha(&self, y: &[f64]) -> Vec<f64> {
        match &self.form {
            Form::Dense(at) => at.alpha(y),
            Form::Single(at) => at.alpha(y),
            Form::LowRank(at) => at.alpha(y),
        }
    }

    fn value(&self, y: &[f64], alpha: &[f64]) -> f64 {
        let log_determinant = match &self.form {
            Form::Dense(at) => at.log_determinant,
            Form::Single(at) => at.log_determinant,
            Form::LowRank(at) => at.log_determinant,
        };
        0.5 * (dot(y, alpha) + log_determinant + y.len() as f64 * std::f64::consts::TAU.ln())
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::{super::residuals::standardized, *};

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

    fn low_rank(inputs: &Inputs, theta: Theta, tolerance: f64, derivative: Derivative) -> Likelihood {
        let mut factor = Incomplete::new(inputs.len(), inputs.len(), &[]);
        factor.extend(inputs, theta.l, tolerance, inputs.len()).unwrap();
        alone(Form::LowRank(LowRank::new(inputs, theta, factor, Some(derivative)).unwrap()))
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
            let tolerance = (tolerance(1e-10, theta) / theta.l.max(1.0)).max(ROUNDING);
            let dense = Dense::<f64>::new(&inputs, theta, true).map(Form::Dense).map(alone).unwrap();
            let end = Dense::<f64>::new(&inputs, theta, false).map(Form::Dense).map(alone).unwrap();
            let (value, gradient, _) = dense.evaluate(&y, theta.s);
            let alpha = end.alpha(&y);
            let value_at_end = end.value(&y, &alpha);
            prop_assert!((value - expected).abs() < 1e-9 * expected.abs().max(1.0));
            prop_assert!((value_at_end - expected).abs() < 1e-9 * expected.abs().max(1.0));
            for (got, expected) in gradient.iter().zip(expected_gradient) {
                prop_assert!((got - expected).abs() < 1e-5 * expected.abs().max(1.0), "{got} {expected}");
            }
            let low_rank = low_rank(&inputs, theta, tolerance, Derivative::Interpolated);
            let (low_value, low_gradient, _) = low_rank.evaluate(&y, theta.s);
            let low_alpha = low_rank.alpha(&y);
            prop_assert!((value - low_value).abs() < 1e-8 * value.abs().max(1.0), "{value} {low_value}");
            for (dense, low) in gradient.iter().zip(low_gradient) {
                prop_assert!((dense - low).abs() < 1e-5 * dense.abs().max(1.0), "{dense} {low}");
            }
            for (dense, low) in alpha.iter().zip(&low_alpha) {
                prop_assert!((dense - low).abs() < 1e-7 / theta.s, "{dense} {low}");
            }
            // Single precision, where the search would use it.
            if single_serves(n, theta) {
                let single = Dense::<f32>::new(&inputs, theta, true).map(Form::Single).map(alone).unwrap();
                let (single_value, single_gradient, _) = single.evaluate(&y, theta.s);
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
            let exact = alone(Form::Dense(Dense::<f64>::new(&inputs, theta, true).unwrap()));
            let low_rank = low_rank(&inputs, theta, CONSISTENT_TIGHTEST * theta.s.min(1.0), Derivative::Consistent);
            let (value, gradient, _) = exact.evaluate(&y, theta.s);
            let (low_value, low_gradient, _) = low_rank.evaluate(&y, theta.s);
            let unit = n as f64 * CONSISTENT_TIGHTEST / theta.s.min(1.0);
            prop_assert!((value - low_value).abs() < 5.0 * unit, "{value} {low_value}");
            for (exact, low) in gradient.iter().zip(low_gradient) {
                prop_assert!((exact - low).abs() < 25.0 * unit, "{exact} {low}");
            }
        }
    }

    /// Where the search ends with exact likelihoods in double precision and no value of the function distrusted.
    fn exact_optimum(rows: &[Vec<f64>], y: &[f64]) -> Point<2> {
        let inputs = Inputs::new(rows);
        let exact = |x: [f64; 2]| {
            let theta = Theta::from_logarithms(x);
            let at = Dense::<f64>::new(&inputs, theta, true).map(Form::Dense).map(alone);
            let (value, gradient, _) =
                at.map_or((f64::INFINITY, [0.0; 2], 0.0), |at| at.evaluate(y, theta.s));
            Ok::<_, Error>((value, gradient, 0.0))
        };
        minimize(exact, [0.0; 2], &BOUNDS, &Tolerances::default()).unwrap()
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
