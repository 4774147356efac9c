//! Questions: what a user may ask, in plain data, and whether it can be asked at all.

mod check;
mod text;

pub(crate) use check::{Asked, variable};
pub use text::{parse_action, parse_limit};

use serde::{Deserialize, Serialize};

/// Most steps ahead.
pub const LONGEST_HORIZON: usize = 1000;
/// Most actions in one question.
pub const MOST_ACTIONS: usize = 100;
/// Most numbers that the answer to one question holds at a time: 400 MB.
pub const MOST_NUMBERS: usize = 50_000_000;
/// The name of the action that does nothing.
pub const GO_ON: &str = "go on";

/// How a variable is acted on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// It takes the value, whatever drives it: `do(x = value)`.
    Set,
    /// The value is added to what it would have been.
    Shift,
}

/// One variable that is acted on, for some steps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Intervention {
    /// The variable.
    pub variable: String,
    /// Set or shift.
    pub kind: Kind,
    /// First step; 1 is the next sample.
    pub first_step: usize,
    /// Last step; 0: that of the horizon.
    pub last_step: usize,
    /// One value for all steps, or one for each.
    pub values: Vec<f64>,
}

impl Intervention {
    /// The variable takes the value at all steps, or one value at each. Example: `Intervention::set("r_v", [0.2]).during(1, 3)`.
    pub fn set(variable: impl Into<String>, values: impl Into<Vec<f64>>) -> Self {
        Self::new(Kind::Set, variable.into(), values.into())
    }

    /// The value is added to the variable at all steps, or one value at each.
    pub fn shift(variable: impl Into<String>, values: impl Into<Vec<f64>>) -> Self {
        Self::new(Kind::Shift, variable.into(), values.into())
    }

    fn new(kind: Kind, variable: String, values: Vec<f64>) -> Self {
        Self { variable, kind, first_step: 1, last_step: 0, values }
    }

    /// Only for these steps.
    #[must_use]
    pub fn during(self, first_step: usize, last_step: usize) -> Self {
        Self { first_step, last_step, ..self }
    }
}

/// Something that might be done.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Action {
    /// What it is called.
    pub name: String,
    /// What it acts on; nothing only under the name [`GO_ON`].
    pub interventions: Vec<Intervention>,
}

impl Action {
    /// To act on one variable.
    pub fn one(name: impl Into<String>, intervention: Intervention) -> Self {
        Self { name: name.into(), interventions: vec![intervention] }
    }

    /// To do nothing.
    pub fn go_on() -> Self {
        Self { name: GO_ON.to_owned(), interventions: Vec::new() }
    }
}

/// A part of the cost: weight x mean of a variable over the steps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CostTerm {
    /// The variable.
    pub variable: String,
    /// Its weight.
    pub weight: f64,
}

/// A bound that is to hold at every step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Limit {
    /// The variable.
    pub variable: String,
    /// It is to stay above this.
    pub above: Option<f64>,
    /// It is to stay below this.
    pub below: Option<f64>,
    /// With this probability.
    pub probability: f64,
}

roscausal_discovery::with_defaults! {
    /// What if: what will happen under each action, and which is best.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(default)]
    pub struct WhatIf {
        /// Had I: the same rows again, with the noise they had, under the actions.
        pub counterfactual: bool = false,
        /// Steps ahead.
        pub horizon: usize = 10,
        /// The actions; none: [`Action::go_on`].
        pub actions: Vec<Action> = Vec::new(),
        /// The variables of the answer; none: all.
        pub variables: Vec<String> = Vec::new(),
        /// The cost by which actions are ranked.
        pub cost: Vec<CostTerm> = Vec::new(),
        /// The bounds that an action must keep.
        pub limits: Vec<Limit> = Vec::new(),
        /// Whether to answer where the data do not reach.
        pub allow_extrapolation: bool = false,
        /// Simulated paths.
        pub paths: usize = 400,
        /// Seed of the paths.
        pub seed: u64 = 42,
    }
}

impl WhatIf {
    /// The steps that an answer has, of those that the data carry. A forecast ends there; rows that were observed go on.
    pub(crate) fn answered_steps(&self, supported: usize) -> usize {
        if self.allow_extrapolation || self.counterfactual { self.horizon } else { supported }
    }
}

/// Rows that were observed, one after the other, and the last of them that counts as known.
#[derive(Clone, Debug)]
pub struct Situation<'a> {
    /// `T x N`, the model's variables.
    pub rows: ndarray::ArrayView2<'a, f64>,
    /// Number of the row that is now.
    pub now: usize,
}

impl<'a> Situation<'a> {
    /// The end of some rows.
    pub fn newest(rows: ndarray::ArrayView2<'a, f64>) -> Self {
        let now = rows.nrows().saturating_sub(1);
        Self { rows, now }
    }

    /// The rows from `first` to `last`, one after the other.
    pub(crate) fn stretch(&self, first: usize, last: usize) -> Vec<f64> {
        self.rows.slice(ndarray::s![first..=last, ..]).iter().copied().collect()
    }
}
