//! How exact a likelihood is to be, and by which form: the plan of one evaluation.

use super::{kernel::Inputs, resources::LARGE, theta::Theta};

/// Fractions of the noise variance that the truncation may leave on the diagonal of the kernel matrix: tightest, loosest.
const FRACTIONS: [f64; 2] = [1e-13, 1e-2];
/// The same for the residuals at the end.
const FRACTION_AT_THE_END: f64 = 1e-8;
/// How much longer the consistent derivative takes at the same rank.
const CONSISTENT_COST: f64 = 1.25;
/// Error of a likelihood, for each sample, where the truncation leaves the whole noise variance: until a likelihood has shown
/// it, and bounds of what is taken from one to the next.
const ERROR_PER_FRACTION: f64 = 0.15;
const ERRORS_PER_FRACTION: [f64; 2] = [0.02, 0.5];
/// How many times the error of the likelihood that of its gradient by `ln l` is (measured beside whole matrices, the
/// median): for the derivative of the truncated matrix, and for the interpolated one, which grows with the length scale.
const CONSISTENT_ERROR: f64 = 100.0;
const INTERPOLATED_ERROR: f64 = 1000.0;
const LONG: f64 = 5.0;
/// Ranks below which the time is spent elsewhere.
const LOW_RANK: f64 = 40.0;
/// Rounding of a remainder.
pub(super) const ROUNDING: f64 = 4e-15;
/// Error of a gradient by the rounding of a factor in single precision, times the tolerance (measured alike).
const SINGLE_ERROR: f64 = 5e-7;
/// The same of the whole matrix in single precision, for each sample and divided by the noise variance.
const WHOLE_SINGLE_ERROR: f64 = 3e-7;
/// The rank grows by this power, times the number of conditions, of the inverse length scale and of the tolerance's
/// logarithm: from one evaluation to the next, within a tenth.
const RANK_GROWTH: f64 = 0.4;
/// Ratio of samples to noise variance up to which single precision serves.
const WELL_CONDITIONED: f64 = 1e5;

/// A derivative of a truncated kernel matrix by `ln l`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Derivative {
    /// That of the kernel matrix, interpolated.
    Interpolated,
    /// That of the truncated matrix itself.
    Consistent,
}

/// Precision of a likelihood of low rank.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Precision {
    Double,
    Single,
}

/// How a likelihood of low rank is computed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plan {
    /// Largest remainder on the diagonal.
    pub(super) tolerance: f64,
    /// Its derivative by `ln l`, for a search.
    pub(super) derivative: Option<Derivative>,
    pub(super) precision: Precision,
}

impl Plan {
    /// Error of the gradient by `ln l`, from the truncation error of the likelihood.
    pub(super) fn gradient_error(&self, l: f64, truncation: f64) -> f64 {
        let rounding = if self.precision == Precision::Single { SINGLE_ERROR / self.tolerance } else { 0.0 };
        rounding + self.derivative.map_or(0.0, |derivative| truncation * gradient_factor(derivative, l))
    }

    /// For the residuals at the end.
    pub(super) fn for_residuals(theta: Theta) -> Self {
        Self {
            tolerance: (FRACTION_AT_THE_END * theta.s.min(1.0) / theta.l.max(1.0)).max(ROUNDING),
            derivative: None,
            precision: Precision::Double,
        }
    }
}

/// How many times the truncation error of a likelihood that of its gradient by `ln l` is.
fn gradient_factor(derivative: Derivative, l: f64) -> f64 {
    match derivative {
        Derivative::Consistent => CONSISTENT_ERROR,
        Derivative::Interpolated => INTERPOLATED_ERROR * l.max(1.0) * (l / LONG).max(1.0),
    }
}

/// What the likelihoods of a search so far say about the next: its error and its rank.
#[derive(Clone)]
pub(super) struct Forecast {
    /// Error of a likelihood where the truncation leaves the whole noise variance.
    error_per_fraction: f64,
    /// A length scale and a tolerance where the rank was too high: it is so for all that are shorter and tighter.
    pub(super) too_high_rank: Option<(f64, f64)>,
    /// Pivots of the last low-rank form, and its length scale and tolerance.
    pub(super) pivots: Option<(Vec<u32>, (f64, f64))>,
}

impl Forecast {
    /// Before the first likelihood on `n` samples.
    pub(super) fn new(n: usize) -> Self {
        Self { error_per_fraction: ERROR_PER_FRACTION * n as f64, too_high_rank: None, pivots: None }
    }

    /// Takes the truncation error that a plan led to at noise variance `s`.
    pub(super) fn learn(&mut self, n: usize, s: f64, plan: Plan, truncation: f64) {
        let [fewest, most] = ERRORS_PER_FRACTION.map(|per_sample| per_sample * n as f64);
        self.error_per_fraction = (truncation * s / plan.tolerance).clamp(fewest, most);
    }

    /// Whether the rank at a length scale and tolerance is known to be too high, or expected to be by that of the last
    /// low-rank form: to find it out by a factorisation may take a third of the time of the whole matrix.
    pub(super) fn expects_too_high_rank(&self, inputs: &Inputs, l: f64, tolerance: f64) -> bool {
        let max_rank = max_rank(inputs.len());
        let known = self.too_high_rank.is_some_and(|(at, than)| l <= at && tolerance <= than);
        let expected = self.pivots.as_ref().is_some_and(|(pivots, _)| {
            pivots.len() > max_rank / 2
                && self.expected_rank(inputs, l, tolerance).is_some_and(|rank| rank > max_rank as f64)
        });
        known || expected
    }

    /// The rank at a length scale and tolerance by that of the last low-rank form.
    fn expected_rank(&self, inputs: &Inputs, l: f64, tolerance: f64) -> Option<f64> {
        self.pivots.as_ref().map(|(pivots, (at, than))| {
            let growth = at / l * libm::log(tolerance) / libm::log(*than);
            pivots.len() as f64 * libm::pow(growth, RANK_GROWTH * inputs.dimensions() as f64)
        })
    }

    /// The plan of a likelihood whose gradient may have this `error`: by the derivative that takes less time, by the ranks to
    /// be expected.
    pub(super) fn plan(&self, inputs: &Inputs, theta: Theta, error: f64) -> Plan {
        let (n, unit) = (inputs.len(), theta.s.min(1.0));
        let [tightest, loosest] = FRACTIONS;
        let tolerance = |derivative: Derivative| {
            let truncation = error / gradient_factor(derivative, theta.l);
            let fraction = truncation / self.error_per_fraction * theta.s / unit;
            (fraction.clamp(tightest, loosest) * unit).max(ROUNDING)
        };
        let interpolated = tolerance(Derivative::Interpolated);
        let consistent = tolerance(Derivative::Consistent);
        let ranks = libm::pow(
            libm::log(interpolated) / libm::log(consistent),
            RANK_GROWTH * inputs.dimensions() as f64,
        );
        let low = self.expected_rank(inputs, theta.l, interpolated).is_some_and(|rank| rank < LOW_RANK);
        let (tolerance, derivative) = if interpolated <= ROUNDING || !low && ranks * ranks > CONSISTENT_COST {
            (consistent, Derivative::Consistent)
        } else {
            (interpolated, Derivative::Interpolated)
        };
        let precision = if n as f64 <= WELL_CONDITIONED * theta.s && SINGLE_ERROR / tolerance < error {
            Precision::Single
        } else {
            Precision::Double
        };
        Plan { tolerance, derivative: Some(derivative), precision }
    }
}

/// Error of a gradient by the whole matrix in single precision.
pub(super) fn single_error(n: usize, theta: Theta) -> f64 {
    if n as f64 > WELL_CONDITIONED * theta.s {
        f64::INFINITY
    } else {
        WHOLE_SINGLE_ERROR * n as f64 / theta.s.min(1.0)
    }
}

/// Samples times squared rank that a likelihood on many samples may take: some tenths of a second.
const MOST_WORK: f64 = 2.5e9;
/// A rank that is allowed on any number of samples.
const LEAST_RANK: usize = 64;

/// Rank up to which the low-rank form is the faster one; on more than [`LARGE`] samples, where there is no other form, the one that
/// can be waited for.
pub(super) fn max_rank(n: usize) -> usize {
    let faster = 2 * n / 5;
    if n <= LARGE { faster } else { faster.min(((MOST_WORK / n as f64).sqrt() as usize).max(LEAST_RANK)) }
}
