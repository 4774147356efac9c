//! The marginal likelihood at one place, in the form that is the fastest there.

use std::sync::Arc;

use super::{
    dense::Dense,
    factorisation::{Factorisation, Solution},
    incomplete::Incomplete,
    kernel::{Inputs, dot},
    low_rank::LowRank,
    plan::{Forecast, Plan, Precision, max_rank, single_error},
    real::Real,
    resources::{Held, LARGE, Resources},
    theta::Theta,
};

/// Rounding error of a gradient in double precision, for each sample and divided by the noise variance.
const DOUBLE_ERROR: f64 = 1e-14;

/// What does not depend on the target.
pub(super) struct Likelihood {
    theta: Theta,
    form: Form,
    /// That of a form of low rank.
    pub(super) plan: Option<Plan>,
    _held: Option<Held>,
}

/// What the likelihood is computed by, in double precision or in single.
pub(super) enum Form {
    Dense(Dense<f64>),
    DenseSingle(Dense<f32>),
    LowRank(LowRank<f64>),
    LowRankSingle(LowRank<f32>),
}

/// Minus the log marginal likelihood at one place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Value {
    pub(super) value: f64,
    /// By `(ln l, ln s)`.
    pub(super) gradient: [f64; 2],
    /// Error of the value that the truncation of the kernel matrix leaves.
    pub(super) truncation: f64,
    /// Errors of the gradient.
    pub(super) errors: [f64; 2],
    /// The second derivative by `ln s`.
    pub(super) curvature: f64,
}

impl Value {
    /// Largest component of the gradient.
    pub(super) fn steepness(&self) -> f64 {
        self.gradient[0].abs().max(self.gradient[1].abs())
    }

    /// Larger of the gradient's errors.
    pub(super) fn error(&self) -> f64 {
        self.errors[0].max(self.errors[1])
    }

    /// Where there is no likelihood.
    pub(super) const NONE: Self =
        Self { value: f64::INFINITY, gradient: [0.0; 2], truncation: 0.0, errors: [0.0; 2], curvature: 0.0 };
}

impl Likelihood {
    /// The form that is the fastest at `theta` for a gradient with this `error`; `None` where `K + s I` is not positive
    /// definite in double precision, and on more than [`LARGE`] samples where its rank is too high.
    pub(super) fn for_search(
        inputs: &Inputs,
        theta: Theta,
        error: f64,
        forecast: &mut Forecast,
        resources: &Arc<Resources>,
    ) -> Option<Self> {
        let n = inputs.len();
        let plan = forecast.plan(inputs, theta, error);
        if !forecast.expects_too_high_rank(inputs, theta.l, plan.tolerance) {
            let held = hold(resources, n, LowRank::<f64>::bytes(n, max_rank(n)));
            if let Some(form) = Form::of_low_rank(inputs, theta, plan, forecast, None) {
                return Some(Self { theta, form, plan: Some(plan), _held: held });
            }
        }
        if n > LARGE {
            return None;
        }
        if single_error(n, theta) <= error {
            let held = hold(resources, n, Dense::<f32>::bytes(n));
            if let Some(at) = Dense::new(inputs, theta, true, resources.cores(n)) {
                return Some(Self { theta, form: Form::DenseSingle(at), plan: None, _held: held });
            }
        }
        Self::whole(inputs, theta, true, resources)
    }

    /// One for residuals: its value and [`Likelihood::alpha`] only, exact.
    pub(super) fn for_residuals(
        inputs: &Inputs,
        theta: Theta,
        forecast: &mut Forecast,
        resources: &Arc<Resources>,
    ) -> Option<Self> {
        let (n, plan) = (inputs.len(), Plan::for_residuals(theta));
        if !forecast.expects_too_high_rank(inputs, theta.l, plan.tolerance) {
            let held = hold(resources, n, LowRank::<f64>::bytes(n, max_rank(n)));
            if let Some(form) = Form::of_low_rank(inputs, theta, plan, forecast, None) {
                return Some(Self { theta, form, plan: Some(plan), _held: held });
            }
        }
        Self::whole(inputs, theta, false, resources)
    }

    /// By the whole matrix in double precision.
    pub(super) fn whole(
        inputs: &Inputs,
        theta: Theta,
        for_search: bool,
        resources: &Arc<Resources>,
    ) -> Option<Self> {
        let n = inputs.len();
        let held = hold(resources, n, Dense::<f64>::bytes(n));
        let at = Dense::new(inputs, theta, for_search, resources.cores(n))?;
        Some(Self { theta, form: Form::Dense(at), plan: None, _held: held })
    }

    /// The same likelihood for a gradient with a smaller `error`.
    pub(super) fn tightened(
        self,
        inputs: &Inputs,
        error: f64,
        forecast: &mut Forecast,
        resources: &Arc<Resources>,
    ) -> Option<Self> {
        let plan = forecast.plan(inputs, self.theta, error);
        let Self { theta, form, plan: before, _held } = self;
        let factor = match form {
            Form::LowRank(at) => Some(at.factor),
            // One in single precision is not to be extended to what asks for more.
            Form::LowRankSingle(_) | Form::DenseSingle(_) => None,
            Form::Dense(_) => return Some(Self { theta, form, plan: before, _held }),
        };
        let too_high = forecast.expects_too_high_rank(inputs, theta.l, plan.tolerance);
        let factor = factor.filter(|_| !too_high && plan.precision == Precision::Double);
        if let Some(factor) = factor
            && let Some(form) = Form::of_low_rank(inputs, theta, plan, forecast, Some(factor))
        {
            return Some(Self { theta, form, plan: Some(plan), _held });
        }
        drop(_held);
        Self::for_search(inputs, theta, error, forecast, resources)
    }

    #[cfg(test)]
    pub(super) fn of(theta: Theta, form: Form, plan: Option<Plan>) -> Self {
        Self { theta, form, plan, _held: None }
    }

    /// Whether it is exact but for rounding in double precision.
    pub(super) fn is_exact(&self) -> bool {
        matches!(self.form, Form::Dense(_))
    }

    /// The pivots of a form of low rank.
    pub(super) fn pivots(&self) -> Option<&[u32]> {
        match &self.form {
            Form::LowRank(at) => Some(at.pivots()),
            Form::LowRankSingle(at) => Some(at.pivots()),
            Form::Dense(_) | Form::DenseSingle(_) => None,
        }
    }

    /// The value for the target `y`.
    pub(super) fn evaluate(&self, y: &[f64]) -> Value {
        let (n, form, s) = (y.len(), self.form(), self.theta.s);
        let (traces, Solution { alpha, squared, derivative }) = (form.traces(), form.solve(y));
        let by_noise = 0.5 * s * (traces.inverse - dot(&alpha, &alpha));
        let value =
            0.5 * (dot(y, &alpha) + form.log_determinant() + n as f64 * libm::log(std::f64::consts::TAU));
        let truncation = form.truncation_error(&alpha);
        let rounding = match self.form {
            Form::DenseSingle(_) => single_error(n, self.theta),
            _ => DOUBLE_ERROR * n as f64 / s.min(1.0),
        };
        let by_length = self.plan.map_or(0.0, |plan| plan.gradient_error(self.theta.l, truncation));
        Value {
            value,
            gradient: [0.5 * (traces.derivative - derivative), by_noise],
            truncation,
            errors: [rounding + by_length, rounding + truncation],
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
            Form::LowRankSingle(at) => at,
        }
    }
}

impl Form {
    /// The form of low rank as planned, from a looser factor if there is one; `forecast` learns its pivots, or that the rank is
    /// too high.
    fn of_low_rank(
        inputs: &Inputs,
        theta: Theta,
        plan: Plan,
        forecast: &mut Forecast,
        from: Option<Incomplete<f64>>,
    ) -> Option<Self> {
        match plan.precision {
            Precision::Double => low_rank(inputs, theta, plan, forecast, from).map(Self::LowRank),
            Precision::Single => low_rank(inputs, theta, plan, forecast, None).map(Self::LowRankSingle),
        }
    }
}

fn low_rank<T: Real>(
    inputs: &Inputs,
    theta: Theta,
    plan: Plan,
    forecast: &mut Forecast,
    from: Option<Incomplete<T>>,
) -> Option<LowRank<T>> {
    let max_rank = max_rank(inputs.len());
    let hints = forecast.pivots.as_ref().map_or(&[][..], |(pivots, _)| pivots);
    let mut factor = from.unwrap_or_else(|| Incomplete::new(inputs.len(), max_rank, hints));
    let extended = factor.extend(inputs, theta.l, plan.tolerance, max_rank);
    let at = extended.and_then(|()| LowRank::new(inputs, theta, factor, plan.derivative));
    match &at {
        Some(at) => forecast.pivots = Some((at.pivots().to_vec(), (theta.l, plan.tolerance))),
        None => forecast.too_high_rank = Some((theta.l, plan.tolerance)),
    }
    at
}

/// Memory for a large matrix; small ones are not counted.
fn hold(resources: &Arc<Resources>, n: usize, bytes: usize) -> Option<Held> {
    (n > LARGE).then(|| resources.hold(bytes))
}
