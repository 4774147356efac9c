//! Our own messages and services.

include!(concat!(env!("OUT_DIR"), "/roscausal_msgs.rs"));

impl Intervention {
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

impl Action {
    /// To act on one variable.
    pub fn one(name: impl Into<String>, intervention: Intervention) -> Self {
        Self { name: name.into(), interventions: vec![intervention] }
    }
}

/// How a question was answered; the numbers are those of the answers' field `status`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Status {
    /// Answered.
    Ok = WhatIfResponse::OK,
    /// The data do not reach as far as the question.
    NotSupported = WhatIfResponse::NOT_SUPPORTED,
    /// The direction of a link is not known, and the answer depends on it.
    Ambiguous = WhatIfResponse::AMBIGUOUS,
    /// There is no model yet.
    NoModel = WhatIfResponse::NO_MODEL,
    /// There are no samples for the question.
    NoData = WhatIfResponse::NO_DATA,
    /// The question cannot be understood.
    BadRequest = WhatIfResponse::BAD_REQUEST,
    /// There was no answer within the question's patience.
    Late = WhatIfResponse::LATE,
}
