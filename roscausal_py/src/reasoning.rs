//! Questions to a structural model: predict, what if, how strongly, why. Answers are the command's, as JSON and as its text.

use std::sync::Arc;

use ndarray::Array2;
use pyo3::prelude::*;
use roscausal::{effect_text, explain_text, what_if_text};
use roscausal_discovery::{DataFrame, Error, Result, names::position};
use roscausal_reasoning::{
    ActsOn, Settings, StructuralModel,
    answer::{self, EffectQuestion, ExplainQuestion, Status},
    default_intervention_targets,
    model::graph_of_json,
    question::{Action, CostTerm, Situation, WhatIf, parse_action, parse_limit},
};
use serde_json::Value;

use crate::{
    errors::{DataError, SettingError, raised},
    frame::Frame,
    settings::{Given, of_step, set},
    watched::{Means, watched},
};

/// A structural model: a graph with an equation for each variable, fitted on rows.
#[pyclass(frozen, module = "roscausal._native")]
pub(crate) struct Structural {
    model: Arc<StructuralModel>,
}

/// An answer as JSON, and in words.
type Answer = (String, String);

#[pymethods]
impl Structural {
    /// Fits the graph in the text `graph` on the rows of `frame`.
    #[staticmethod]
    fn fit(py: Python<'_>, frame: &Frame, graph: &str, settings: &str) -> PyResult<Self> {
        let mut given = Given::read(settings).map_err(raised)?;
        let threads = given.count("threads").map_err(raised)?.unwrap_or(0);
        let means = Means { threads, ..Means::all_cores() };
        let dt = of_step(&mut given).map_err(raised)?;
        let (settings, acts_on) = of_fit(&mut given).map_err(raised)?;
        given.end().map_err(raised)?;
        let (data, graph) = (frame.data.clone(), graph.to_owned());
        let model = watched(py, &means, move |_| {
            let context: Vec<String> = acts_on.iter().map(|(column, _)| column.clone()).collect();
            let (graph, mut facts) = graph_of_json(&graph, &context)?;
            facts.dt = dt.or(facts.dt);
            let data = columns(&data, graph.names(), &context)?;
            Ok(StructuralModel::fit(&data, &graph, &settings, &acts_on)?.with_facts(facts))
        })?;
        Ok(Self { model: Arc::new(model) })
    }

    /// Reads what `to_json` wrote.
    #[staticmethod]
    fn read(py: Python<'_>, text: String) -> PyResult<Self> {
        let model = watched(py, &Means::all_cores(), move |_| StructuralModel::from_json(&text))?;
        Ok(Self { model: Arc::new(model) })
    }

    /// The model's file.
    fn to_json(&self) -> String {
        self.model.to_json()
    }

    /// Names of the variables.
    fn names(&self) -> Vec<String> {
        self.model.graph().names().to_vec()
    }

    /// Number of rows of each recording.
    fn rows(&self) -> Vec<usize> {
        self.model.samples().recordings().iter().map(Array2::nrows).collect()
    }

    /// What will happen under each action, or would have happened.
    fn what_if(&self, py: Python<'_>, question: &str, recording: usize, now: usize) -> PyResult<Answer> {
        let mut given = Given::read(question).map_err(raised)?;
        let question = of_what_if(&mut given).map_err(raised)?;
        given.end().map_err(raised)?;
        let model = self.model.clone();
        let (answer, text) = watched(py, &Means::all_cores(), move |_| {
            let rows = &model.samples().recordings()[recording];
            let answer = answer::what_if(&model, &Situation { rows: rows.view(), now }, &question);
            let text = what_if_text(&answer);
            Ok((answer, text))
        })?;
        answered(answer.status, &answer.message)?;
        Ok((json(&answer), text))
    }

    /// How strongly one variable drives another.
    fn effect(
        &self,
        py: Python<'_>,
        cause: String,
        effect: String,
        max_lag: usize,
        standardised: bool,
    ) -> PyResult<Answer> {
        let question = EffectQuestion { cause, effect, max_lag, standardised };
        let model = self.model.clone();
        let answer = watched(py, &Means::all_cores(), move |_| Ok(answer::effect(&model, &question)))?;
        answered(answer.status, &answer.message)?;
        Ok((json(&answer), effect_text(&answer)))
    }

    /// Why a variable changed between two rows; without them: the largest change within the last `horizon` rows.
    #[pyo3(signature = (variable, recording, rows, horizon, seed))]
    fn explain(
        &self,
        py: Python<'_>,
        variable: String,
        recording: usize,
        rows: Option<(usize, usize)>,
        horizon: usize,
        seed: u64,
    ) -> PyResult<Answer> {
        let (from_row, to_row) = rows.unzip();
        let question = ExplainQuestion { variable, from_row, to_row, horizon, seed, start: 0.0 };
        let model = self.model.clone();
        let answer = watched(py, &Means::all_cores(), move |_| {
            let situation = Situation::newest(model.samples().recordings()[recording].view());
            Ok(answer::explain(&model, &situation, &question))
        })?;
        answered(answer.status, &answer.message)?;
        Ok((json(&answer), explain_text(&answer)))
    }
}

/// What cannot be asked, or of rows that are not there, is an exception; all else is an answer that says how to take it.
fn answered(status: Status, message: &str) -> PyResult<()> {
    match status {
        Status::BadRequest => Err(SettingError::new_err(message.to_owned())),
        Status::NoModel | Status::NoData | Status::Late => Err(DataError::new_err(message.to_owned())),
        Status::Ok | Status::NotSupported | Status::Ambiguous => Ok(()),
    }
}

fn json(answer: &impl serde::Serialize) -> String {
    // A struct of strings, numbers and lists always serialises.
    serde_json::to_string(answer).unwrap_or_default()
}

fn of_fit(given: &mut Given) -> Result<(Settings, ActsOn)> {
    let mut settings = Settings::default();
    if let Some(word) = given.take("equations") {
        settings.equations = word_of(&word).parse()?;
    }
    set(&mut settings.seed, given.count("seed")?.map(|seed| seed as u64));
    let acts_on = match given.take("acts_on") {
        Some(Value::Object(pairs)) => {
            pairs.into_iter().map(|(column, variable)| (column, word_of(&variable))).collect()
        }
        _ => default_intervention_targets(),
    };
    Ok((settings, acts_on))
}

fn word_of(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// The graph's variables and the columns of interventions, which the data may lack.
fn columns(data: &DataFrame, variables: &[String], context: &[String]) -> Result<DataFrame> {
    let place = |name: &String| position(data.var_names(), name);
    let wanted: Vec<String> =
        variables.iter().chain(context.iter().filter(|name| place(name).is_some())).cloned().collect();
    let found = |name: &String| {
        place(name).ok_or_else(|| {
            let all = data.var_names().join(", ");
            Error::Data(format!(
                "the data have no variable '{name}', which the model names; variables: {all}"
            ))
        })
    };
    let places: Vec<usize> = wanted.iter().map(found).collect::<Result<_>>()?;
    let chosen = |rows: &Array2<f64>| rows.select(ndarray::Axis(1), &places);
    DataFrame::new(data.recordings().iter().map(chosen).collect(), wanted)
}

fn of_what_if(given: &mut Given) -> Result<WhatIf> {
    let bad = |name: &'static str| move |reason: String| Error::param(name, reason);
    let action = |text: &String| parse_action(text).map_err(bad("actions"));
    let limit = |text: &String| parse_limit(text).map_err(bad("limits"));
    let mut question = WhatIf::default();
    set(&mut question.counterfactual, given.flag("had")?);
    set(&mut question.horizon, given.count("horizon")?);
    question.actions = given.words("actions")?.iter().map(action).collect::<Result<_>>()?;
    if question.actions.is_empty() {
        question.actions.push(Action::go_on());
    }
    question.variables = given.words("variables")?;
    if let Some(Value::Object(terms)) = given.take("cost") {
        let term = |(variable, weight): (String, Value)| {
            let wrong = || Error::param("cost", format!("{weight} is not a weight; give a number"));
            Ok(CostTerm { variable, weight: weight.as_f64().ok_or_else(wrong)? })
        };
        question.cost = terms.into_iter().map(term).collect::<Result<_>>()?;
    }
    question.limits = given.words("limits")?.iter().map(limit).collect::<Result<_>>()?;
    set(&mut question.allow_extrapolation, given.flag("allow_extrapolation")?);
    set(&mut question.paths, given.count("paths")?);
    set(&mut question.seed, given.count("seed")?.map(|seed| seed as u64));
    Ok(question)
}
