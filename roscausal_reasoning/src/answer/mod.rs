//! Answers: each with a status, its caveats, and a sentence.

mod ambiguity;
pub(crate) mod caveats;
mod effect;
mod ensembles;
mod explain;
mod plan;
mod sentences;
mod what_if;

use serde::{Deserialize, Serialize};

pub use effect::{EffectAnswer, EffectQuestion, LONGEST_LAG, effect};
pub use explain::{Contribution, ExplainAnswer, ExplainQuestion, explain};
pub use what_if::{predict, what_if, what_if_until};

/// How an answer is to be taken. The numbers are those of the services.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "SCREAMING_SNAKE_CASE")]
#[repr(u8)]
pub enum Status {
    /// Answered.
    #[default]
    Ok = 0,
    /// The data do not reach where the question goes.
    NotSupported = 1,
    /// The answer depends on the direction of a link that the data leave open.
    Ambiguous = 2,
    /// There is no model for the question.
    NoModel = 3,
    /// There are no rows for the question.
    NoData = 4,
    /// The question cannot be asked like this.
    BadRequest = 5,
    /// The answer was no longer wanted before it was there.
    Late = 6,
}

/// One variable, step by step.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Forecast {
    /// The variable.
    pub variable: String,
    /// Mean at each step.
    pub mean: Vec<f64>,
    /// Lower end of the interval.
    pub lower: Vec<f64>,
    /// Upper end of the interval.
    pub upper: Vec<f64>,
    /// Median at each step.
    #[serde(default)]
    pub median: Vec<f64>,
    /// Lower end of the interval that half of the outcomes lie in; it is widened in the proportion of the other one.
    #[serde(default)]
    pub inner_lower: Vec<f64>,
    /// Upper end of it.
    #[serde(default)]
    pub inner_upper: Vec<f64>,
    /// Skill over the last value, as measured on rows that the model had not seen; null where it is set or was not measured.
    pub skill: Vec<Option<f64>>,
}

/// What one action leads to.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Outlook {
    /// The action's name.
    pub action: String,
    /// Whether the data do not carry an answer; the forecasts are empty then.
    pub refused: bool,
    /// The variables asked for. Forecasts end with the last supported step, unless extrapolation was asked for; had-I
    /// has all steps.
    pub forecasts: Vec<Forecast>,
    /// Steps for which the data carry the answer.
    pub supported_steps: usize,
    /// Mean cost over the steps that the data carry for all ranked actions; NaN where the action is refused.
    pub cost: f64,
    /// Lower end of the cost's interval.
    pub cost_lower: f64,
    /// Upper end.
    pub cost_upper: f64,
    /// Probability of keeping all limits at every step.
    pub probability_limits: f64,
    /// Probability of being the cheapest of the actions that can be taken.
    pub probability_best: f64,
    /// The same in words.
    pub text: String,
}

/// The answer to [`WhatIf`](crate::question::WhatIf).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WhatIfAnswer {
    /// How to take it.
    pub status: Status,
    /// Why not OK, in a sentence.
    pub message: String,
    /// Step in seconds, if known.
    pub dt: Option<f64>,
    /// The model that answered.
    pub model_id: String,
    /// In the order of the actions.
    pub outlooks: Vec<Outlook>,
    /// Numbers of the actions that can be taken, best first; empty if none can, or if there is nothing to rank by.
    pub ranking: Vec<usize>,
    /// One sentence each.
    pub caveats: Vec<String>,
}
