//! The evidence of each link: what its test saw, kept from the run that made the model.
//!
//! A link of the model is one sentence; this is what stands behind it. For each link: the value and p-value at every lag
//! (its lag function), the conditions that were used, the samples of cause against effect, and what is left of both after
//! the conditions. And for each variable: how many samples, how many missing, in which range.
//!
//! The size is limited: scatters are thinned evenly, the same way each time, so that all of them together have at most
//! [`MOST_POINTS`] points.

mod check;
mod conditions;
mod facts;
mod scatter;

pub use conditions::Condition;
pub(crate) use conditions::Known;
pub use facts::VariableFacts;

use serde::{Deserialize, Serialize};

use crate::{
    methods::Method,
    model::{Link, Model},
    numeric::student_t::quantile,
    types::{DataFrame, Node, Samples, names::position},
};

/// Version of the layout.
pub const EVIDENCE_SCHEMA: &str = "roscausal/evidence/1";
/// Points of all scatters together.
pub const MOST_POINTS: usize = 24_000;
/// Most points of one scatter.
const POINTS: usize = 300;
/// Fewest points of a scatter; if there are more links than that leaves room for, the strongest have scatters.
const FEWEST: usize = 100;

read_unchecked! {
    /// What stands behind a [`Model`]. Reading it checks it ([`Evidence::check`]).
    #[derive(Clone, Debug, Default, PartialEq, Serialize)]
    pub struct Evidence "Evidence" {
        /// [`EVIDENCE_SCHEMA`].
        pub schema: String,
        /// Rows of each recording.
        pub rows: Vec<usize>,
        /// The variables that were analysed, also those without a link.
        pub variables: Vec<VariableFacts>,
        /// One entry per link of the model, in the same order.
        pub links: Vec<LinkEvidence>,
    }
}

/// What stands behind one link.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LinkEvidence {
    /// Name of the cause.
    pub cause: String,
    /// Name of the effect.
    pub effect: String,
    /// Steps from cause to effect.
    pub lag: usize,
    /// Samples of its test.
    pub n_samples: usize,
    /// Confidence interval of the strength, if the test gives one.
    pub interval: Option<(f64, f64)>,
    /// What was held fixed.
    pub conditions: Vec<Condition>,
    /// What the reader should know about the conditions; empty if they are all of it.
    pub note: String,
    /// Strength and p-value of this pair at each lag that was tested, whether a link or not.
    pub lags: Vec<AtLag>,
    /// Strength from which on a test with as many samples and conditions is significant, where there is a formula.
    pub band: Option<f64>,
    /// Cause at `t - lag` and effect at `t`, in their units.
    pub scatter: Vec<[f32; 2]>,
    /// What a linear regression on the conditions leaves of both, in their units; none where strengths have no sign.
    pub residuals: Vec<[f32; 2]>,
}

/// One lag of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AtLag {
    /// Steps.
    pub lag: usize,
    /// Strength.
    pub value: f64,
    /// P-value.
    pub p_value: f64,
}

impl Evidence {
    /// As one line of JSON with a final newline.
    pub fn to_json(&self) -> String {
        // A struct of strings, numbers and lists always serialises.
        let mut json = serde_json::to_string(self).unwrap_or_default();
        json.push('\n');
        json
    }

    /// The evidence of a link.
    pub fn of(&self, link: &Link) -> Option<&LinkEvidence> {
        self.links.iter().find(|e| e.cause == link.cause && e.effect == link.effect && e.lag == link.lag)
    }

    /// Whether this is the evidence of a model: of each of its links, at its lags.
    pub fn is_of(&self, model: &Model) -> bool {
        let within = |link: &LinkEvidence| link.lags.iter().all(|at| at.lag <= model.tau_max);
        self.links.len() == model.links.len()
            && model.links.iter().all(|link| self.of(link).is_some_and(within))
    }

    /// What stands behind `model`, found by `method` in the columns of `data` that it tested (`all`: those it was given).
    pub(crate) fn gather(
        all: &DataFrame,
        data: &DataFrame,
        model: &Model,
        method: Method,
        known: &Known<'_>,
    ) -> Self {
        let share = MOST_POINTS / (2 * model.links.len().max(1));
        let points = share.clamp(FEWEST, POINTS);
        let mut strengths: Vec<f64> = model.links.iter().map(|link| link.drawn_strength().abs()).collect();
        strengths.sort_by(|a, b| b.total_cmp(a));
        let weakest = strengths.get(MOST_POINTS / (2 * FEWEST)).copied().unwrap_or(-1.0);
        let samples = Samples::new(data, 2 * model.tau_max);
        let of_link = |link: &Link| {
            let cause = position(data.var_names(), &link.cause)?;
            let effect = position(data.var_names(), &link.effect)?;
            let points = if link.drawn_strength().abs() > weakest { points } else { 0 };
            Some(gathered(&samples, model, method, known, link, [cause, effect], points))
        };
        Self { links: model.links.iter().filter_map(of_link).collect(), ..Self::of_data(all) }
    }

    /// What is known of the data where there is no link.
    pub(crate) fn of_data(all: &DataFrame) -> Self {
        let rows = all.recordings().iter().map(ndarray::ArrayBase::nrows).collect();
        Self { schema: EVIDENCE_SCHEMA.to_owned(), rows, variables: facts::facts(all), links: Vec::new() }
    }
}

fn gathered(
    samples: &Samples<'_>,
    model: &Model,
    method: Method,
    known: &Known<'_>,
    link: &Link,
    [cause, effect]: [usize; 2],
    points: usize,
) -> LinkEvidence {
    let data = samples.data();
    let (x, y) = (Node::new(cause, link.lag), Node::new(effect, 0));
    let (z, note) = known.conditions(method, x, effect, data.n_vars(), [model.tau_min, model.tau_max]);
    let mut drawn = 0;
    let (n_samples, arrays) = samples.some(x, y, &z, |n| {
        let (at, first) = scatter::positions(n, points);
        drawn = first;
        at
    });
    let linear = ["parcorr", "robustparcorr"].contains(&model.cond_ind_test.as_str());
    let dof = n_samples.saturating_sub(2 + z.len());
    let band = (linear && dof > 0).then(|| {
        let t = quantile(1.0 - model.link_level().unwrap_or(model.alpha) / 2.0, dof);
        t / (dof as f64 + t * t).sqrt()
    });
    let (scatter, residuals) = scatter::scatters(arrays, drawn);
    let at_lag = |lag: usize| {
        let (i, j) = model.places(&link.cause, &link.effect)?;
        Some(AtLag { lag, value: model.val_matrix[i][j][lag]?, p_value: model.p_matrix[i][j][lag]? })
    };
    let lags = (model.tau_min..=model.tau_max).filter_map(at_lag).collect();
    LinkEvidence {
        cause: link.cause.clone(),
        effect: link.effect.clone(),
        lag: link.lag,
        n_samples,
        interval: known.interval([cause, effect, link.lag]),
        conditions: z.iter().map(|node| Condition::new(data.var_names(), *node)).collect(),
        note,
        lags,
        band,
        scatter,
        residuals: if model.has_sign() { residuals } else { Vec::new() },
    }
}
