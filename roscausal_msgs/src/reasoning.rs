//! Messages and services of reasoning on a causal model. `msg/*.msg` and `srv/*.srv` document their fields.

use serde::{Deserialize, Serialize};

use crate::{Time, std_msgs::Header};

/// The variables of one moment, as they go into the batches: those of one person, or of several with their ids (`h_7_v`).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Features {
    /// Stamp and frame.
    pub header: Header,
    /// Names of the variables.
    pub names: Vec<String>,
    /// Values.
    pub values: Vec<f64>,
}
message!(own Features uses [Header]);

/// What is done to one variable.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Intervention {
    /// Name of the variable.
    pub variable: String,
    /// [`Intervention::SET`] or [`Intervention::SHIFT`].
    #[serde(rename = "type")]
    pub kind: u8,
    /// The first step, from 1.
    pub first_step: u32,
    /// The last step; 0: the end of the question.
    pub last_step: u32,
    /// Values.
    pub values: Vec<f64>,
}
message!(own Intervention uses []);

impl Intervention {
    /// The variable has this value.
    pub const SET: u8 = 0;
    /// The variable is moved by this value.
    pub const SHIFT: u8 = 1;

    /// The variable has the value from the next sample to the end of the question, or one value at each of these steps.
    pub fn set(variable: impl Into<String>, values: impl Into<Vec<f64>>) -> Self {
        Self {
            variable: variable.into(),
            kind: Self::SET,
            first_step: 1,
            last_step: 0,
            values: values.into(),
        }
    }

    /// The variable is moved by the value from the next sample to the end of the question.
    pub fn shift(variable: impl Into<String>, values: impl Into<Vec<f64>>) -> Self {
        Self { kind: Self::SHIFT, ..Self::set(variable, values) }
    }
}

/// Something that the robot could do.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Action {
    /// A name for the answer.
    pub name: String,
    /// What is done.
    pub interventions: Vec<Intervention>,
}
message!(own Action uses [Intervention]);

impl Action {
    /// To act on one variable.
    pub fn one(name: impl Into<String>, intervention: Intervention) -> Self {
        Self { name: name.into(), interventions: vec![intervention] }
    }
}

/// What one variable is expected to do, step by step.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Forecast {
    /// Name of the variable.
    pub variable: String,
    /// Expected values.
    pub mean: Vec<f64>,
    /// Lower ends of the intervals.
    pub lower: Vec<f64>,
    /// Upper ends of the intervals.
    pub upper: Vec<f64>,
    /// Gain over "it stays as it is"; 1 is perfect.
    pub skill: Vec<f64>,
}
message!(own Forecast uses []);

/// One part of the cost of an action.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CostTerm {
    /// Name of the variable.
    pub variable: String,
    /// Its weight.
    pub weight: f64,
}
message!(own CostTerm uses []);

/// What must not happen.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Limit {
    /// Name of the variable.
    pub variable: String,
    /// The value must be above this; NaN: none.
    pub above: f64,
    /// The value must be below this; NaN: none.
    pub below: f64,
    /// The probability with which it must hold.
    pub probability: f64,
}
message!(own Limit uses []);

/// What one action leads to.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Outlook {
    /// The action's name.
    pub action: String,
    /// One for each variable.
    pub forecasts: Vec<Forecast>,
    /// For how many steps data like this has been seen.
    pub supported_steps: u32,
    /// The cost.
    pub cost: f64,
    /// Its lower end.
    pub cost_lower: f64,
    /// Its upper end.
    pub cost_upper: f64,
    /// Probability that all limits hold.
    pub probability_limits: f64,
    /// Probability that this action is the best.
    pub probability_best: f64,
    /// The same in a sentence.
    pub text: String,
}
message!(own Outlook uses [Forecast]);

/// What one variable's surprise has added to a change.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Contribution {
    /// Name of the variable.
    pub variable: String,
    /// How much.
    pub value: f64,
    /// Lower ends of the intervals.
    pub lower: f64,
    /// Upper ends of the intervals.
    pub upper: f64,
    /// The same in a sentence.
    pub text: String,
}
message!(own Contribution uses []);

/// What happens next if nobody intervenes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Prediction {
    /// Stamp and frame.
    pub header: Header,
    /// Time between two samples, seconds.
    pub dt: f64,
    /// The structural model that was used.
    pub model_id: String,
    /// One for each variable.
    pub forecasts: Vec<Forecast>,
    /// Share of recent samples that fell into their interval.
    pub coverage: f64,
}
message!(own Prediction uses [Header, Forecast]);

/// How a question was answered; the numbers are those of the answers' field `status`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Status {
    /// Answered.
    Ok = 0,
    /// The data do not reach as far as the question.
    NotSupported = 1,
    /// The direction of a link is not known, and the answer depends on it.
    Ambiguous = 2,
    /// There is no model yet.
    NoModel = 3,
    /// There are no samples for the question.
    NoData = 4,
    /// The question cannot be understood.
    BadRequest = 5,
}

/// What happens if the robot does this, or that?
#[derive(Clone, Copy, Debug)]
pub struct WhatIf;

/// The question of [`WhatIf`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WhatIfRequest {
    /// The sample from which it looks ahead; 0: the newest.
    pub stamp: Time,
    /// Whether the surprises that did happen are kept.
    pub counterfactual: bool,
    /// How many samples ahead.
    pub horizon: u32,
    /// What the robot could do; none: it goes on.
    pub actions: Vec<Action>,
    /// Whose forecasts to give; none: all.
    pub variables: Vec<String>,
    /// The cost.
    pub cost: Vec<CostTerm>,
    /// What must not happen.
    pub limits: Vec<Limit>,
    /// Answer even where no such data has been seen.
    pub allow_extrapolation: bool,
}
/// The answer of [`WhatIf`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WhatIfResponse {
    /// One of the constants of the answer.
    pub status: u8,
    /// What is wrong and the way out; empty if nothing is.
    pub message: String,
    /// The sample from which it looks ahead; 0: the newest.
    pub stamp: Time,
    /// Time between two samples, seconds.
    pub dt: f64,
    /// The structural model that was used.
    pub model_id: String,
    /// One for each action, in the order of the question.
    pub outlooks: Vec<Outlook>,
    /// Numbers of the actions, best first.
    pub ranking: Vec<i32>,
    /// What the answer rests on, and when not to believe it.
    pub caveats: Vec<String>,
}
service!(WhatIf: WhatIfRequest uses [Action, CostTerm, Limit], WhatIfResponse uses [Outlook]);

/// Why did a variable change?
#[derive(Clone, Copy, Debug)]
pub struct Explain;

/// The question of [`Explain`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ExplainRequest {
    /// Name of the variable.
    pub variable: String,
    /// The earlier sample.
    pub from_time: Time,
    /// The later sample.
    pub to_time: Time,
}
/// The answer of [`Explain`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ExplainResponse {
    /// One of the constants of the answer.
    pub status: u8,
    /// What is wrong and the way out; empty if nothing is.
    pub message: String,
    /// The earlier sample.
    pub from_time: Time,
    /// The later sample.
    pub to_time: Time,
    /// How much it changed.
    pub change: f64,
    /// How much of that was to be expected.
    pub expected: f64,
    /// What the surprises added, strongest first.
    pub contributions: Vec<Contribution>,
    /// The same in a sentence.
    pub text: String,
    /// What the answer rests on, and when not to believe it.
    pub caveats: Vec<String>,
}
service!(Explain: ExplainRequest uses [], ExplainResponse uses [Contribution]);

/// By how much does one variable drive another?
#[derive(Clone, Copy, Debug)]
pub struct Effect;

/// The question of [`Effect`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EffectRequest {
    /// The driving variable.
    pub cause: String,
    /// The driven variable.
    pub effect: String,
    /// Largest lag, samples; 0: the model's.
    pub max_lag: u32,
    /// In standard deviations instead of the variables' units.
    pub standardised: bool,
}
/// The answer of [`Effect`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EffectResponse {
    /// One of the constants of the answer.
    pub status: u8,
    /// What is wrong and the way out; empty if nothing is.
    pub message: String,
    /// Effect over all paths, by lag.
    pub total: Vec<f64>,
    /// Lower ends of the intervals.
    pub lower: Vec<f64>,
    /// Upper ends of the intervals.
    pub upper: Vec<f64>,
    /// Effect of the direct link, by lag.
    pub direct: Vec<f64>,
    /// The variables in between.
    pub mediators: Vec<String>,
    /// How much of the largest total effect goes through each.
    pub mediated: Vec<f64>,
    /// What has to be held fixed, such as `h_dg(t-2)`.
    pub adjustment_set: Vec<String>,
    /// The strength that an unrecorded common cause needs to undo the effect.
    pub robustness: f64,
    /// The same in a sentence.
    pub text: String,
    /// What the answer rests on, and when not to believe it.
    pub caveats: Vec<String>,
}
service!(Effect: EffectRequest uses [], EffectResponse uses []);
