//! Whether a question can be asked: each fault is one sentence with the way out.

use std::collections::HashSet;

use roscausal_discovery::{ensure, names};

use super::{
    Action, CostTerm, GO_ON, Intervention, Kind, LONGEST_HORIZON, Limit, MOST_ACTIONS, MOST_NUMBERS, WhatIf,
};
use crate::model::Schedule;

/// Numbers that an action holds for each step and variable beside its paths: what it sets, and what is forecast.
const BESIDE: usize = 10;

type Checked<T> = std::result::Result<T, String>;

/// The number of a variable that a user names.
pub(crate) fn variable(all: &[String], wanted: &str) -> Checked<usize> {
    names::position(all, wanted).ok_or_else(|| {
        format!("there is no variable '{wanted}'; {}", names::instead(all, wanted, "the model has"))
    })
}

/// A question with numbers for names.
pub(crate) struct Asked {
    /// The actions, named.
    pub(crate) actions: Vec<(String, Schedule)>,
    /// Variables of the answer.
    pub(crate) variables: Vec<usize>,
    /// Variable and weight.
    pub(crate) cost: Vec<(usize, f64)>,
    /// Variable, above, below, probability.
    pub(crate) limits: Vec<(usize, f64, f64, f64)>,
}

impl Asked {
    /// What the actions are ranked by: the variables of the cost, or of the limits where there is no cost.
    pub(crate) fn targets(&self) -> Vec<usize> {
        let limits = self.limits.iter().map(|(var, ..)| *var);
        let mut targets: Vec<usize> = match self.cost.is_empty() {
            true => limits.collect(),
            false => self.cost.iter().map(|(var, _)| *var).collect(),
        };
        targets.sort_unstable();
        targets.dedup();
        targets
    }
}

impl WhatIf {
    /// Checks the question for a model of these variables, that may stand for so many `graphs` with so many `refits` each.
    pub(crate) fn checked(&self, all: &[String], graphs: usize, refits: usize) -> Checked<Asked> {
        let (horizon, actions, paths) = (self.horizon, self.actions.len(), self.paths);
        ensure((1..=LONGEST_HORIZON).contains(&horizon), || {
            format!("a horizon of {horizon} steps is not answered; ask for 1 to {LONGEST_HORIZON}")
        })?;
        if actions > MOST_ACTIONS {
            return Err(format!("{actions} actions are too many at once; ask for at most {MOST_ACTIONS}"));
        }
        ensure((20..=100_000).contains(&paths), || {
            format!("{paths} paths are not simulated; take 20 to 100000")
        })?;
        self.has_room(all.len(), graphs, refits)?;
        let go_on = [Action::go_on()];
        let asked = if self.actions.is_empty() { &go_on[..] } else { &self.actions };
        let mut known = HashSet::new();
        if let Some(Action { name, .. }) = asked.iter().find(|action| !known.insert(&action.name)) {
            return Err(format!("two actions are called '{name}'; give each a name of its own"));
        }
        let action = |action: &Action| Ok((action.name.clone(), action.schedule(all, horizon)?));
        let variables = match &self.variables[..] {
            [] => (0..all.len()).collect(),
            some => some.iter().map(|name| variable(all, name)).collect::<Checked<Vec<usize>>>()?,
        };
        let term = |CostTerm { variable: name, weight }: &CostTerm| match weight.is_finite() {
            true => Ok((variable(all, name)?, *weight)),
            false => Err(format!("the weight of {name} in the cost is {weight}; give a number")),
        };
        Ok(Asked {
            actions: asked.iter().map(action).collect::<Checked<_>>()?,
            variables,
            cost: self.cost.iter().map(term).collect::<Checked<_>>()?,
            limits: self.limits.iter().map(|limit| limit.checked(all)).collect::<Checked<_>>()?,
        })
    }

    /// Whether what is held at once fits into memory: every action's paths under every graph; of had-I these are the refits.
    fn has_room(&self, variables: usize, graphs: usize, refits: usize) -> Checked<()> {
        let paths = if self.counterfactual { refits } else { self.paths };
        let (asked, steps) = (self.actions.len().max(1), self.horizon);
        // Where graphs may disagree, going on is simulated beside the actions.
        let actions = asked + usize::from(graphs > 1);
        // A path has a number for each variable, and one for where it leaves what was seen.
        let cells = actions.saturating_mul(steps).saturating_mul(variables.saturating_add(1));
        let numbers = cells.saturating_mul(paths.saturating_mul(graphs).saturating_add(BESIDE));
        ensure(numbers <= MOST_NUMBERS, || {
            format!(
                "actions x steps x paths x variables x graphs = {asked} x {steps} x {paths} x {variables} x {graphs} need too much memory; \
                 ask for fewer actions, steps or paths"
            )
        })
    }
}

impl Limit {
    fn checked(&self, all: &[String]) -> Checked<(usize, f64, f64, f64)> {
        let Self { variable: name, above, below, probability } = self;
        let (var, is_open) = (variable(all, name)?, above.is_none() && below.is_none());
        let (above, below) = (above.unwrap_or(f64::NEG_INFINITY), below.unwrap_or(f64::INFINITY));
        ensure(!(above.is_nan() || below.is_nan() || is_open), || {
            format!("the limit of {name} has no bound; give one above or below which it is to stay")
        })?;
        ensure(above < below, || {
            format!("nothing is above {above} and below {below}; mend the limit of {name}")
        })?;
        if !(0.0..=1.0).contains(probability) {
            return Err(format!("the limit of {name} asks for a probability of {probability}; give 0 to 1"));
        }
        Ok((var, above, below, *probability))
    }
}

impl Action {
    fn schedule(&self, all: &[String], horizon: usize) -> Checked<Schedule> {
        let mut schedule = Schedule::free(all.len(), horizon);
        if self.interventions.is_empty() && self.name.trim().to_lowercase() != GO_ON {
            let (name, last) = (&self.name, all.last().map_or("x", String::as_str));
            return Err(format!(
                "action '{name}' does nothing: give it an intervention, such as {last}=0@1..{horizon}, or call it '{GO_ON}'"
            ));
        }
        self.interventions.iter().try_for_each(|one| one.enter(&self.name, all, horizon, &mut schedule))?;
        Ok(schedule)
    }
}

impl Intervention {
    fn enter(&self, action: &str, all: &[String], horizon: usize, schedule: &mut Schedule) -> Checked<()> {
        let var = variable(all, &self.variable)?;
        let (first, count) = (self.first_step, self.values.len());
        let last = if self.last_step == 0 { horizon } else { self.last_step };
        let whose = format!("action '{action}', {}", self.variable);
        ensure(first > 0, || {
            format!("{whose}: step 0 is now and cannot be changed; the next sample is step 1")
        })?;
        if last < first || last > horizon {
            return Err(format!("{whose}: steps {first}..{last} are not within 1..{horizon}, the horizon"));
        }
        let steps = last - first + 1;
        if count != 1 && count != steps {
            return Err(format!("{whose}: {count} values for {steps} steps; give one, or one for each step"));
        }
        if let Some(value) = self.values.iter().find(|value| !value.is_finite()) {
            return Err(format!("{whose}: {value} is not a value that can be set; give a finite number"));
        }
        for (step, &value) in (first..=last).zip(self.values.iter().cycle()) {
            ensure(!schedule.touches(step - 1, var), || {
                format!("{whose}: it is acted on twice at step {step}; set it or shift it, once")
            })?;
            match self.kind {
                Kind::Set => schedule.set(step - 1, var, value),
                Kind::Shift => schedule.shift(step - 1, var, value),
            }
        }
        Ok(())
    }
}
