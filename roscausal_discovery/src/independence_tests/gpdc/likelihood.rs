//! The marginal likelihood at one place, in the form that is the fastest there.

use std::sync::Arc;

use super::{
    dense::Dense,
    gp::{LARGE, Theta},
    incomplete::Incomplete,
    kernel::{Inputs, dot},
    low_rank::LowRank,
    memory::{Held, Memory},
    real::Real,
    search::{Plan, Precision, Search, max_rank, single_serves},
};

/// Rounding errors of the likelihood's values that the search reckons with, relative to them.
const NOISE: f64 = 1e-6;

/// What does not depend on the target.
pub(super) struct Likelihood {
    theta: Theta,
    form: Form,
    /// That of a form of low rank.
    plan: Option<Plan>,
    _held: Option<Held>,
}

/// What the likelihood is computed by, in double precision, in single, or with a factor in double and products in single.
pub(super) enum Form {
    Dense(Dense<f64>),
    DenseSingle(Dense<f32>),
    LowRank(LowRank<f64, f64>),
    LowRankMixed(LowRank<f64, f32>),
    LowRankSingle(LowRank<f32, f32>),
}

impl Form {
    /// The form of low rank as planned, from a looser factor if there is one and it serves the plan's precision.
    fn of_low_rank(
        inputs: &Inputs,
        theta: Theta,
        plan: Plan,
        search: &mut Search,
        from: Option<Incomplete<f64>>,
    ) -> Option<Self> {
        match plan.precision {
            Precision::Double => low_rank(inputs, theta, plan, search, from).map(Self::LowRank),
            Precision::Mixed => low_rank(inputs, theta, plan, search, from).map(Self::LowRankMixed),
            Precision::Single => low_rank(inputs, theta, plan, search, None).map(Self::LowRankSingle),
        }
    }
}

/// A factorisation of `A = K + s I`.
pub(super) trait Factorisation {
    /// `log det A`.
    fn log_determinant(&self) -> f64;
    /// The parts of the gradient that do not depend on the target; of a factorisation for a search.
    fn traces(&self) -> Traces;
    /// `A^-1 y`.
    fn alpha(&self, y: &[f64]) -> Vec<f64>;
    /// The parts of the gradient that depend on the target `y`; of a factorisation for a search.
    fn solve(&self, y: &[f64]) -> Solution;
    /// How far off the likelihood may be, at the solution `alpha`, for what the factorisation lacks of the kernel matrix.
    fn missing(&self, _alpha: &[f64]) -> f64 {
        0.0
    }
}

/// The parts of the gradient that do not depend on the target, of `A = K + s I`.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Traces {
    /// `tr(A^-1)`.
    pub(super) inverse: f64,
    /// `tr(A^-2)`.
    pub(super) squared: f64,
    /// `tr(A^-1 dK / d ln l)`.
    pub(super) derivative: f64,
}

/// The parts that depend on it.
pub(super) struct Solution {
    /// `a = A^-1 y`.
    pub(super) alpha: Vec<f64>,
    /// `a' A^-1 a`.
    pub(super) squared: f64,
    /// `a' (dK / d ln l) a`.
    pub(super) derivative: f64,
}

/// Minus the log marginal likelihood at one place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Value {
    pub(super) value: f64,
    /// By `(ln l, ln s)`.
    pub(super) gradient: [f64; 2],
    /// How far off the value may be for what the kernel matrix lacks, and in all.
    pub(super) missing: f64,
    pub(super) uncertainty: f64,
    /// How far off the gradient may be.
    pub(super) errors: [f64; 2],
    /// The second derivative by `ln s`.
    pub(super) curvature: f64,
}

impl Value {
    /// Largest component of the gradient.
    pub(super) fn steepness(&self) -> f64 {
        self.gradient[0].abs().max(self.gradient[1].abs())
    }

    /// Where there is no likelihood.
    pub(super) const NONE: Self = Self {
        value: f64::INFINITY,
        gradient: [0.0; 2],
        uncertainty: 0.0,
        missing: 0.0,
        errors: [0.0; 2],
        curvature: 0.0,
    };
}

/// What a likelihood is computed for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Purpose {
    /// Its value and gradient.
    Search,
    /// Its value and the residuals, exact.
    Residuals,
}

impl Likelihood {
    /// The form that is the fastest at `theta`.
    pub(super) fn new(
        inputs: &Inputs,
        theta: Theta,
        purpose: Purpose,
        search: &mut Search,
        memory: &Arc<Memory>,
    ) -> Option<Self> {
        let n = inputs.len();
        let hold = |bytes: usize| (n > LARGE).then(|| memory.hold(bytes));
        let plan = match purpose {
            Purpose::Search => search.plan(inputs, theta),
            Purpose::Residuals => Plan::for_residuals(theta),
        };
        if !search.expects_too_high_rank(inputs, theta.l, plan.tolerance) {
            let _held = hold(LowRank::<f64, f64>::bytes(n, max_rank(n)));
            let form = Form::of_low_rank(inputs, theta, plan, search, None);
            if let Some(form) = form {
                return Some(Self { theta, form, plan: Some(plan), _held });
            }
        }
        let gradient = purpose == Purpose::Search;
        if gradient && single_serves(n, theta) {
            let _held = hold(Dense::<f32>::bytes(n));
            if let Some(at) = Dense::new(inputs, theta, true) {
                return Some(Self { theta, form: Form::DenseSingle(at), plan: None, _held });
            }
        }
        let _held = hold(Dense::<f64>::bytes(n));
        Dense::new(inputs, theta, gradient).map(|at| Self { theta, form: Form::Dense(at), plan: None, _held })
    }

    /// The same likelihood for the search, as exact as it asks for now.
    pub(super) fn tightened(
        self,
        inputs: &Inputs,
        search: &mut Search,
        memory: &Arc<Memory>,
    ) -> Option<Self> {
        let plan = search.plan(inputs, self.theta);
        let Self { theta, form, plan: before, _held } = self;
        let factor = match form {
            Form::LowRank(at) => Some(at.into_factor()),
            Form::LowRankMixed(at) => Some(at.into_factor()),
            // One in single precision is not to be extended to what asks for more.
            Form::LowRankSingle(_) => None,
            Form::Dense(_) | Form::DenseSingle(_) => return Some(Self { theta, form, plan: before, _held }),
        };
        let too_high = search.expects_too_high_rank(inputs, theta.l, plan.tolerance);
        let factor = factor.filter(|_| !too_high);
        let form = factor.and_then(|factor| Form::of_low_rank(inputs, theta, plan, search, Some(factor)));
        if let Some(form) = form {
            return Some(Self { theta, form, plan: Some(plan), _held });
        }
        drop(_held);
        Self::new(inputs, theta, Purpose::Search, search, memory)
    }

    #[cfg(test)]
    pub(super) fn of(theta: Theta, form: Form, plan: Option<Plan>) -> Self {
        Self { theta, form, plan, _held: None }
    }

    /// How a form of low rank was computed.
    pub(super) fn plan(&self) -> Option<Plan> {
        self.plan
    }

    /// The pivots of a form of low rank.
    pub(super) fn pivots(&self) -> Option<&[u32]> {
        match &self.form {
            Form::LowRank(at) => Some(at.pivots()),
            Form::LowRankMixed(at) => Some(at.pivots()),
            Form::LowRankSingle(at) => Some(at.pivots()),
            Form::Dense(_) | Form::DenseSingle(_) => None,
        }
    }

    /// The value for the target `y`.
    pub(super) fn evaluate(&self, y: &[f64]) -> Value {
        let (form, s) = (self.form(), self.theta.s);
        let (traces, Solution { alpha, squared, derivative }) = (form.traces(), form.solve(y));
        let by_noise = 0.5 * s * (traces.inverse - dot(&alpha, &alpha));
        let value =
            0.5 * (dot(y, &alpha) + form.log_determinant() + y.len() as f64 * std::f64::consts::TAU.ln());
        let (missing, rounding) = (form.missing(&alpha), NOISE * value.abs().max(1.0));
        let of_gradient = self.plan.map_or(0.0, |plan| plan.error_of_gradient(self.theta.l, missing));
        Value {
            value,
            gradient: [0.5 * (traces.derivative - derivative), by_noise],
            missing,
            uncertainty: rounding + missing,
            errors: [rounding + of_gradient, rounding + missing],
            curvature: by_noise + 0.5 * s * s * (2.0 * squared - traces.squared),
        }
    }

    /// `(K + s I)^-1 y`.
    pub(super) fn alpha(&self, y: &[f64]) -> Vec<f64> {
        self.form().alpha(y)
    }

    fn form(&self) -> &dyn Factorisation {
        match &self.form {
            Form::Dense(at) => at,
            Form::DenseSingle(at) => at,
            Form::LowRank(at) => at,
            Form::LowRankMixed(at) => at,
            Form::LowRankSingle(at) => at,
        }
    }
}

/// The form of low rank as planned, `from` a looser factor if there is one; the search is told its pivots, or that the rank is
/// too high.
fn low_rank<F: Real, P: Real>(
    inputs: &Inputs,
    theta: Theta,
    plan: Plan,
    search: &mut Search,
    from: Option<Incomplete<F>>,
) -> Option<LowRank<F, P>> {
    let max_rank = max_rank(inputs.len());
    let hints = search.hints.as_ref().map_or(&[][..], |(pivots, _)| pivots);
    let mut factor = from.unwrap_or_else(|| Incomplete::new(inputs.len(), max_rank, hints));
    let extended = factor.extend(inputs, theta.l, plan.tolerance, max_rank);
    let at = extended.and_then(|()| LowRank::new(inputs, theta, factor, plan.derivative));
    match &at {
        Some(at) => search.hints = Some((at.pivots().to_vec(), (theta.l, plan.tolerance))),
        None => search.too_high_rank = Some((theta.l, plan.tolerance)),
    }
    at
}
