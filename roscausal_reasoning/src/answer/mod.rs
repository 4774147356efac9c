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
pub use what_if::{Forecast, Outlook, WhatIfAnswer, predict, what_if};

/// How an answer is to be taken. The numbers are those of the services.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "SCREAMING_SNAKE_CASE")]
#[repr(u8)]
pub enum Status {
    /// Answered.
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
}
