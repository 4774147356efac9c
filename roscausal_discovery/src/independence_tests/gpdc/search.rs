//! The state of a search for the optimum: how exact the next likelihood is to be, and by which form.

use super::{
    gp::Theta,
    kernel::Inputs,
    likelihood::{Likelihood, Value},
    low_rank::Derivative,
};

/// What the kernel matrix may lack on its diagonal while nothing is foretold, as a share of the noise variance: by the gradient
/// (see [`share_for`]), within these bounds; and for the residuals at the end.
const SHARES: [f64; 2] = [1e-6, 1e-2];
const PER_GRADIENT: f64 = 1e-5;
const AT_THE_END: f64 = 1e-8;
/// The same for the consistent derivative: so many times as much, within bounds.
const CONSISTENT: f64 = 5.0;
pub(super) const CONSISTENT_SHARES: [f64; 2] = [1e-5, 1e-2];
/// How much longer the consistent derivative takes at the same rank.
const CONSISTENT_COST: f64 = 1.25;
/// How far off a likelihood is, for each sample, where the kernel matrix lacks the noise variance on its diagonal: until the
/// search knows better, and bounds of what it takes for granted.
const PER_SHARE: f64 = 0.15;
const PER_SHARES: [f64; 2] = [0.02, 0.5];
/// How many times as far off as the likelihood its gradient by `ln l` is, for what the approximation lacks (measured beside
/// whole matrices, the median): of the approximation's own derivative, and of the interpolated one, which is off the further
/// the longer the length scale is.
const CONSISTENT_ERROR: f64 = 1.0;
const INTERPOLATED_ERROR: f64 = 10.0;
const LONG: f64 = 5.0;
/// A gradient that may be further off than this share of it, where it was foretold, is computed again; else one that turns out
/// to ask for a share so many times as small.
const TOO_FAR_OFF: f64 = 0.5;
const TOO_LOOSE: f64 = 50.0;
/// Ranks below which the time is spent elsewhere.
const LOW_RANK: f64 = 40.0;
/// Rounding of a remainder.
pub(super) const ROUNDING: f64 = 4e-15;
/// What the rounding of a factor in single precision adds, divided by the tolerance (measured alike); and the tolerance down
/// to which such a factor serves.
const SINGLE_ERROR: f64 = 5e-7;
const SINGLE_TIGHTEST: f64 = 3e-5;
/// The rank grows by this power, times the number of conditions, of the inverse length scale and of the tolerance's
/// logarithm: from one evaluation to the next, within a tenth.
const RANK_GROWTH: f64 = 0.4;
/// Ratio of samples to noise variance up to which single precision serves the search.
const WELL_CONDITIONED: f64 = 1e5;

/// State of a search.
pub(super) struct Search {
    /// What the kernel matrix may lack on its diagonal, as a share of the noise variance, while nothing is foretold.
    pub(super) share: f64,
    /// Largest component of the smallest gradient so far.
    smallest_gradient: f64,
    /// How far off the next gradient may be, if it is foretold.
    error: Option<f64>,
    /// How far off a likelihood is where the kernel matrix lacks the noise variance on its diagonal.
    per_share: f64,
    /// A length scale and a tolerance where the rank was too high: it is so for all that are shorter and tighter.
    pub(super) too_high_rank: Option<(f64, f64)>,
    /// Pivots of the last low-rank form, and its length scale and tolerance.
    pub(super) hints: Option<(Vec<u32>, (f64, f64))>,
    /// Which of the shared factorisations it started with.
    pub(super) start: usize,
    /// The likelihood at the last place but the start; of large matrices none is kept.
    pub(super) last: Option<Likelihood>,
}

impl Search {
    /// A search on `n` samples whose first likelihood may lack this `share` of the noise variance.
    pub(super) fn new(n: usize, share: f64) -> Self {
        Self {
            share,
            smallest_gradient: f64::INFINITY,
            error: None,
            per_share: PER_SHARE * n as f64,
            too_high_rank: None,
            hints: None,
            start: 0,
            last: None,
        }
    }

    /// How far off the next gradient may be; `None` where nothing is foretold of it.
    pub(super) fn allow(&mut self, error: Option<f64>) {
        self.error = error;
    }

    /// Takes a result: what the plan led to, and the smaller the gradients, the more exact the next likelihood. `true` where
    /// this one, whose error was to leave `least` at the least, turns out not to be exact enough.
    pub(super) fn learn(&mut self, result: &Value, n: usize, s: f64, plan: Option<Plan>, least: f64) -> bool {
        let used = self.share;
        self.smallest_gradient = self.smallest_gradient.min(result.steepness());
        self.share = share_for(self.smallest_gradient);
        let Some(plan) = plan else { return false };
        let [fewest, most] = PER_SHARES.map(|share| share * n as f64);
        self.per_share = (result.missing * s / plan.tolerance).clamp(fewest, most);
        match self.error {
            Some(_) => result.errors[0] > (TOO_FAR_OFF * result.steepness()).max(least),
            None => used > TOO_LOOSE * self.share,
        }
    }

    /// Whether the rank at a length scale and tolerance is known to be too high, or expected to be by that of the last
    /// low-rank form: to find it out by a factorisation may take a third of the time of the whole matrix.
    pub(super) fn expects_too_high_rank(&self, inputs: &Inputs, l: f64, tolerance: f64) -> bool {
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

    /// How the next likelihood is to be computed where the rank allows: by the derivative that takes less time, by the ranks
    /// to be expected.
    pub(super) fn plan(&self, inputs: &Inputs, theta: Theta) -> Plan {
        let unit = theta.s.min(1.0);
        let foretold = |derivative: Derivative| {
            let missing = self.error.map(|error| error / times_missing(derivative, theta.l));
            missing.map(|missing| missing / self.per_share * theta.s / unit)
        };
        let [tightest, loosest] = SHARES;
        let share =
            foretold(Derivative::Interpolated).map(|share| share * theta.l.max(1.0)).unwrap_or(self.share);
        // The error of this derivative is larger than that of the kernel for long length scales, which this makes good.
        let interpolated = (share.clamp(tightest, loosest) * unit / theta.l.max(1.0)).max(ROUNDING);
        let [tightest, loosest] = CONSISTENT_SHARES;
        let share = foretold(Derivative::Consistent).unwrap_or(CONSISTENT * self.share);
        let consistent = share.clamp(tightest, loosest) * unit;
        let ranks = (interpolated.ln() / consistent.ln()).powf(RANK_GROWTH * inputs.dimensions() as f64);
        let low = self.expected_rank(inputs, theta.l, interpolated).is_some_and(|rank| rank < LOW_RANK);
        let single = single_serves(inputs.len(), theta);
        let (tolerance, derivative) = if single && !low && ranks * ranks > CONSISTENT_COST {
            (consistent, Derivative::Consistent)
        } else {
            (interpolated, Derivative::Interpolated)
        };
        let precision = match derivative {
            _ if single && tolerance >= SINGLE_TIGHTEST => Precision::Single,
            Derivative::Consistent => Precision::Mixed,
            Derivative::Interpolated => Precision::Double,
        };
        Plan { tolerance, derivative: Some(derivative), precision }
    }
}

/// The share of the noise variance that leaves an error of a few percent in a gradient of this size.
fn share_for(gradient: f64) -> f64 {
    (PER_GRADIENT * gradient * gradient.sqrt()).clamp(SHARES[0], SHARES[1])
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

/// Precision of a likelihood of low rank.
#[derive(Clone, Copy, Debug)]
pub(super) enum Precision {
    Double,
    /// A factor in double, products over the samples in single.
    Mixed,
    Single,
}

impl Plan {
    /// How far off the gradient by `ln l` is, where the likelihood is for what it lacks.
    pub(super) fn error_of_gradient(&self, l: f64, missing: f64) -> f64 {
        let rounding = match self.precision {
            Precision::Single => SINGLE_ERROR / self.tolerance,
            Precision::Mixed | Precision::Double => 0.0,
        };
        rounding + self.derivative.map_or(0.0, |derivative| missing * times_missing(derivative, l))
    }

    /// For the residuals at the end.
    pub(super) fn for_residuals(theta: Theta) -> Self {
        Self {
            tolerance: (AT_THE_END * theta.s.min(1.0) / theta.l.max(1.0)).max(ROUNDING),
            derivative: None,
            precision: Precision::Double,
        }
    }
}

/// How many times as far off as the likelihood its gradient by `ln l` is.
fn times_missing(derivative: Derivative, l: f64) -> f64 {
    match derivative {
        Derivative::Consistent => CONSISTENT_ERROR,
        Derivative::Interpolated => INTERPOLATED_ERROR * l.max(1.0) * (l / LONG).max(1.0),
    }
}

/// Whether single precision serves the search.
pub(super) fn single_serves(n: usize, theta: Theta) -> bool {
    n as f64 <= WELL_CONDITIONED * theta.s
}

/// Rank up to which the low-rank form is the faster one.
pub(super) fn max_rank(n: usize) -> usize {
    2 * n / 5
}
