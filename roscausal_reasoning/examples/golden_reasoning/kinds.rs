//! Each kind of case, and who answers it.

#[path = "answers.rs"]
mod answers;
#[path = "case.rs"]
pub(crate) mod case;
#[path = "effects.rs"]
mod effects;
#[path = "gaussian.rs"]
mod gaussian;
#[path = "linear.rs"]
mod linear;
#[path = "moments.rs"]
mod moments;

use case::{Answer, Case};
use serde_json::Value;

/// Our answer to a case.
pub(crate) fn answer(case: &Case) -> Answer<Value> {
    match case.kind.as_str() {
        "adjustment" => effects::adjustment_sets(case),
        "total_effect" => effects::total_effects(case),
        "mediation" => effects::mediation(case),
        "ambiguous" => effects::ambiguous(case),
        "linear" => linear::questions(case),
        "nonlinear" => answers::nonlinear(case),
        "experiment" => answers::experiment(case),
        "gp" => gaussian::equation(case, &case.expected),
        "support" => gaussian::support(case),
        "prediction" => linear::prediction(case),
        other => Err(format!("kind '{other}' is not part of this engine")),
    }
}
