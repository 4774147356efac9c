//! The model that an experiment finds in its own runs, which others are then tried on.

use roscausal_core::{Error, Result};
use roscausal_discovery::{Control, DataFrame, Model, Settings, analyse, methods::Method};

use crate::interrupt::Interrupt;

/// Finds the model of runs with `dt` seconds between rows.
///
/// # Errors
/// An unknown method or test, those of the analysis, or cancellation.
pub(super) fn found(
    data: &DataFrame,
    (method, test): (&str, &str),
    tau_max: usize,
    dt: f64,
    interrupt: &Interrupt,
) -> Result<Model> {
    let method: Method = method.parse()?;
    let settings = Settings {
        method,
        cond_ind_test: test.to_owned(),
        tau_min: method.info().tau_min,
        tau_max,
        ..Settings::default()
    };
    settings.check()?;
    let mut found = analyse(data, &settings, &Control::default().cancel_on(interrupt.flag()))?;
    found.dt = Some(dt);
    Ok(found)
}

/// The links between variables: `h_risk -> h_v (1), ...`.
pub(super) fn links(found: &Model) -> String {
    let others = found.links.iter().filter(|link| link.cause != link.effect);
    let all: Vec<String> =
        others.map(|link| format!("{} -> {} ({})", link.cause, link.effect, link.lag)).collect();
    all.join(", ")
}

/// Names of variables that are given as `name = expression`.
pub(super) fn names(features: &[&str]) -> Vec<String> {
    features.iter().map(|item| item.split(' ').next().unwrap_or_default().to_owned()).collect()
}

/// Checks that nothing is tried on a seed that the model was found on; `why` not.
///
/// # Errors
/// A seed that is in both.
pub(super) fn apart(train: &[u64], seeds: &[u64], why: &str) -> Result<()> {
    match seeds.iter().find(|seed| train.contains(seed)) {
        Some(seed) => Err(Error::param("seeds", format!("seed {seed} is one of --train, too; {why}"))),
        None => Ok(()),
    }
}
