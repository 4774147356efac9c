//! CAnDOIT: LPCMCI on observations and interventions together.
//!
//! Source: Castri, Mghames, Hanheide and Bellotto 2024, Advanced Intelligent Systems, "CAnDOIT: causal discovery with
//! observational and interventional data from time series".
//!
//! 1. Each intervened variable has a context column: the imposed value while it is imposed, else 0.
//! 2. LPCMCI runs on all columns. It knows beforehand that a context drives its variable at once, that nothing drives a context
//!    but its own past, and that contexts belong together.
//! 3. Where an intervened variable is a condition in an ancestral phase, its contexts are conditions, too.
//!
//! Example: something hidden drives `x` and `y`. Where `x` was imposed, `y` does not follow: `x` does not cause `y`.

use super::lpcmci::{LpcmciResult, LpcmciSettings, run_lpcmci};
use crate::types::{Assumption, CondIndTest, Control, DataFrame, Error, LinkAssumptions, Result};

/// A variable on which values were imposed, and the column that holds them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Intervened {
    /// Column of the variable; `None`: it was not recorded, so the context may drive any variable, and nothing drives it.
    pub variable: Option<usize>,
    /// Column of its context: the imposed value while it is imposed, else 0.
    pub context: usize,
}

/// Columns of interventions, and the variable that each sets.
pub type ActsOn = Vec<(String, String)>;

/// What the simulator's interventions act on.
///
/// ```
/// use roscausal_discovery::methods::default_intervention_targets;
///
/// assert!(default_intervention_targets().contains(&("do_robot_speed".into(), "r_v".into())));
/// ```
pub fn default_intervention_targets() -> ActsOn {
    let pairs =
        [("do_robot_speed", "r_v"), ("do_robot_off", "r_v"), ("do_human_v", "h_v"), ("do_human_stop", "h_v")];
    pairs.map(|(column, variable)| (column.to_owned(), variable.to_owned())).to_vec()
}

/// Reads what interventions act on.
///
/// ```
/// use roscausal_discovery::methods::acts_on_of;
///
/// assert_eq!(acts_on_of(&["do_x=x"])?, [("do_x".to_owned(), "x".to_owned())]);
/// assert!(acts_on_of(&["do_x=x", "do_x=y"]).is_err());
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
///
/// # Errors
/// A text that is not `COLUMN=VARIABLE`.
pub fn acts_on_of(texts: &[impl AsRef<str>]) -> Result<ActsOn> {
    let pair = |text: &str| match text.split_once('=') {
        Some((column, variable)) => Ok((column.trim().to_owned(), variable.trim().to_owned())),
        None => {
            Err(Error::param("acts_on", format!("'{text}' is not a pair; write it like do_robot_speed=r_v")))
        }
    };
    let pairs: ActsOn = texts.iter().map(|text| pair(text.as_ref())).collect::<Result<_>>()?;
    for (k, (column, variable)) in pairs.iter().enumerate() {
        let twice = pairs[..k].iter().find(|(known, other)| known == column && other != variable);
        if let Some((_, other)) = twice {
            let reason = format!("'{column}' is to set both '{other}' and '{variable}'; name one of them");
            return Err(Error::param("acts_on", reason));
        }
    }
    Ok(pairs)
}

/// CAnDOIT: [`run_lpcmci`] with one context column per intervened variable. Each batch of interventions is a recording of its
/// own, so no sample spans the start of an intervention.
///
/// Take it when something was imposed on the system in some recordings, such as a robot that stood still: it tells causes
/// from common causes. Contexts are part of the result.
///
/// `extra_conditions` is the rule of the paper that contexts join their variables as conditions. The settings' link assumptions
/// and contexts are made here and must be empty.
///
/// # Errors
/// As [`run_lpcmci`]; an intervention without its column, a column with two roles, link assumptions in the settings, or
/// `tau_max` 0.
pub fn run_candoit(
    data: &DataFrame,
    test: &dyn CondIndTest,
    settings: &LpcmciSettings,
    interventions: &[Intervened],
    extra_conditions: bool,
    control: &Control,
) -> Result<LpcmciResult> {
    check(data, settings, interventions)?;
    let links = assumptions(data.n_vars(), settings.tau_max, interventions)?;
    let pairs = interventions.iter().filter_map(|one| Some((one.variable?, one.context)));
    let settings = LpcmciSettings {
        tau_min: 0,
        link_assumptions: Some(links),
        contexts: if extra_conditions { pairs.collect() } else { Vec::new() },
        ..settings.clone()
    };
    run_lpcmci(data, test, &settings, control)
}

fn check(data: &DataFrame, settings: &LpcmciSettings, interventions: &[Intervened]) -> Result<()> {
    let fail = |reason: String| Err(Error::param("interventions", reason));
    if interventions.is_empty() {
        return fail("there is none; without interventions take lpcmci".to_owned());
    }
    Error::ensure(settings.tau_max > 0, "tau_max", || "0 leaves no past; give at least 1")?;
    if settings.link_assumptions.is_some() || !settings.contexts.is_empty() {
        return Err(Error::param("link_assumptions", "candoit makes them from the interventions; give none"));
    }
    for (k, one) in interventions.iter().enumerate() {
        let last = one.variable.map_or(one.context, |variable| variable.max(one.context));
        if last >= data.n_vars() {
            return fail(format!("column {last} does not exist"));
        }
        let twice = interventions[..k].iter().any(|other| other.context == one.context);
        if twice || interventions.iter().any(|other| other.variable == Some(one.context)) {
            let name = &data.var_names()[one.context];
            return fail(format!(
                "'{name}' has two roles; each intervened variable needs a context column of its own"
            ));
        }
    }
    data.check_length(settings.tau_max, settings.tau_max.saturating_mul(2))
}

/// What is known of contexts; the other pairs are free.
fn assumptions(n_vars: usize, tau_max: usize, interventions: &[Intervened]) -> Result<LinkAssumptions> {
    let free = LinkAssumptions::all_with_hidden_causes(n_vars, 0, tau_max);
    let is_context = |var: usize| interventions.iter().any(|one| one.context == var);
    let mut links = LinkAssumptions::none(n_vars);
    for effect in (0..n_vars).filter(|&var| !is_context(var)) {
        for (cause, assumption) in free.of_target(effect).filter(|(cause, _)| !is_context(cause.var)) {
            links.insert(cause.var, effect, cause.lag, assumption)?;
        }
    }
    for one in interventions {
        match one.variable {
            Some(variable) => links.insert(one.context, variable, 0, Assumption::Exists)?,
            // What it acts on was not recorded: it may drive what follows from that.
            None => {
                for effect in (0..n_vars).filter(|&var| !is_context(var)) {
                    (0..=tau_max)
                        .try_for_each(|lag| links.insert(one.context, effect, lag, Assumption::Test))?;
                }
            }
        }
        links.insert(one.context, one.context, 1, Assumption::Exists)?;
        for other in interventions.iter().filter(|other| other.context != one.context) {
            links.insert(other.context, one.context, 0, Assumption::ExistsHidden)?;
            for lag in 1..=tau_max {
                links.insert(other.context, one.context, lag, Assumption::TestNotBack)?;
            }
        }
    }
    Ok(links)
}
