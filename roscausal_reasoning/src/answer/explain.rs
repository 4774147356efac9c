//! Why did it change? Each variable's surprise, in numbers and words.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{
    Status, ambiguity, caveats,
    sentences::{seconds, short, steps, with_unit},
};
use crate::{
    explain::{Parts, linear, shapley},
    model::{Directed, StructuralModel, System},
    question::{Situation, variable},
    simulate::interval_of,
};

/// Part of the change below which a contribution is not told.
const TOLD: f64 = 0.05;
/// Most steps that a change may take.
const LONGEST_CHANGE: usize = 100;

/// Why did a variable change?
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ExplainQuestion {
    /// The variable.
    pub variable: String,
    /// The row before the change; with `to_row` none: the largest fall or rise within the last `horizon` steps.
    pub from_row: Option<usize>,
    /// The row after it.
    pub to_row: Option<usize>,
    /// Steps that are looked back over.
    pub horizon: usize,
    /// Seed of the orders, with more than 10 variables.
    pub seed: u64,
    /// Time of the first row in seconds: for the sentence.
    pub start: f64,
}

/// One variable's part in a change.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Contribution {
    /// The variable.
    pub variable: String,
    /// What its surprise added.
    pub value: f64,
    /// Lower end of the interval.
    pub lower: f64,
    /// Upper end.
    pub upper: f64,
    /// The same in words.
    pub text: String,
}

/// The answer to [`ExplainQuestion`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ExplainAnswer {
    /// How to take it.
    pub status: Status,
    /// Why not OK, in a sentence.
    pub message: String,
    /// The row before the change.
    pub from_row: usize,
    /// The row after it.
    pub to_row: usize,
    /// The change.
    pub change: f64,
    /// The part that was to be expected.
    pub expected: f64,
    /// The rest, by variable, strongest first.
    pub contributions: Vec<Contribution>,
    /// All in words.
    pub text: String,
    /// One sentence each.
    pub caveats: Vec<String>,
}

/// Takes a change of a variable apart.
pub fn explain(
    model: &StructuralModel,
    situation: &Situation<'_>,
    question: &ExplainQuestion,
) -> ExplainAnswer {
    let refuse = |status, message| ExplainAnswer { status, message, ..ExplainAnswer::default() };
    let names = model.graph().names();
    let y = match variable(names, &question.variable) {
        Ok(y) => y,
        Err(message) => return refuse(Status::BadRequest, message),
    };
    if situation.rows.ncols() != names.len() {
        let (columns, names) = (situation.rows.ncols(), names.join(", "));
        let message = format!("the rows have {columns} variables and the model has {names}");
        return refuse(Status::NoModel, message);
    }
    let (from, to) = match window(model, situation, question, y) {
        Ok(window) => window,
        Err((status, message)) => return refuse(status, message),
    };
    if let Some(reason) = model.members().iter().find_map(|member| lacking(&member.model, y)) {
        return refuse(Status::NotSupported, reason);
    }
    let memory = model.graph_memory();
    let first = from + 1 - memory;
    let rows = situation.stretch(first, to);
    let all: Vec<Vec<Parts>> = model
        .members()
        .iter()
        .map(|member| parts_of(&member.model, &rows, memory - 1, y, question.seed))
        .collect();
    let count = all.len() as f64;
    // What a refit without some rows says of them is nearer to the truth than what the fit on them says.
    let mean = |members: &[Parts], of: &dyn Fn(&Parts) -> f64| {
        members.iter().map(of).sum::<f64>() / members.len() as f64
    };
    let average =
        |of: &dyn Fn(&Parts) -> f64| all.iter().map(|members| mean(members, of)).sum::<f64>() / count;
    let change = average(&|parts| parts.change);
    let sign = if change < 0.0 { -1.0 } else { 1.0 };
    let mut contributions: Vec<Contribution> = Vec::new();
    for (var, name) in names.iter().enumerate() {
        let value = average(&|parts| parts.surprises[var]);
        let (mut lower, mut upper) = (value, value);
        for members in &all {
            let values: Vec<f64> = members.iter().map(|member| member.surprises[var]).collect();
            let [low, high] = interval_of(&values, model.settings().interval);
            (lower, upper) = (low.min(lower), high.max(upper));
        }
        if value != 0.0 || lower != 0.0 || upper != 0.0 {
            let text = words(model, &rows, memory, (var, y), value * sign);
            contributions.push(Contribution { variable: name.clone(), value, lower, upper, text });
        }
    }
    contributions.sort_by(|a, b| b.value.abs().total_cmp(&a.value.abs()));
    let expected = average(&|parts| parts.expected);
    let place = |of: &Contribution| names.iter().position(|name| *name == of.variable);
    let depends = contributions.first().and_then(place).and_then(|var| {
        let effects: Vec<f64> =
            all.iter().map(|members| mean(members, &|parts| parts.surprises[var])).collect();
        ambiguity::sentence(model, &effects, TOLD * change.abs())
    });
    let other = contributions.iter().find(|c| c.variable != names[y]).and_then(place);
    let path = other.map(|other| caveats::strongest_path(model, other, y)).unwrap_or_default();
    let mut caveats = vec![
        "a surprise is what a variable did beyond its own equation; what caused the surprise itself is not in the data".to_owned(),
    ];
    caveats.extend(caveats::weakest_link(model, &path));
    caveats.extend(caveats::of_model(model));
    let (status, message) =
        depends.map_or((Status::Ok, String::new()), |message| (Status::Ambiguous, message));
    let text = sentence(model, y, (from, to, question.start), (change, expected), &contributions, &path);
    ExplainAnswer {
        status,
        message,
        from_row: from,
        to_row: to,
        change,
        expected,
        contributions,
        text,
        caveats,
    }
}

type Refusal = (Status, String);

/// The rows that the question is about.
fn window(
    model: &StructuralModel,
    situation: &Situation<'_>,
    question: &ExplainQuestion,
    y: usize,
) -> Result<(usize, usize), Refusal> {
    let (rows, memory) = (situation.rows.nrows(), model.graph_memory());
    let bad = |message: String| Err((Status::BadRequest, message));
    let (from, to) = match (question.from_row, question.to_row) {
        (Some(from), Some(to)) => (from, to),
        (None, None) => {
            if !(1..=LONGEST_CHANGE).contains(&question.horizon) {
                return bad(format!(
                    "changes within {} steps are not looked for; ask for 1 to {LONGEST_CHANGE}",
                    question.horizon
                ));
            }
            let last = situation.now.min(rows.saturating_sub(1));
            let first = last.saturating_sub(question.horizon).max(memory - 1);
            let value = |row: usize| situation.rows.get((row, y)).copied().unwrap_or(f64::NAN);
            let pairs = (first..=last).flat_map(|a| (a + 1..=last).map(move |b| (a, b)));
            let size = |&(a, b): &(usize, usize)| (value(b) - value(a)).abs();
            let largest =
                pairs.filter(|pair| size(pair).is_finite()).max_by(|a, b| size(a).total_cmp(&size(b)));
            largest.ok_or((
                Status::NoData,
                format!("there are too few rows up to row {last}; at least {} are needed", memory + 1),
            ))?
        }
        _ => return bad("give both times of the change, or none for the largest one".to_owned()),
    };
    if to <= from || to - from > LONGEST_CHANGE {
        return bad(format!(
            "a change from row {from} to row {to} is not explained; the second comes after the first, at most {LONGEST_CHANGE} later"
        ));
    }
    if to >= rows || from + 1 < memory {
        let (first, last) = (memory - 1, rows.saturating_sub(1));
        let message = format!(
            "rows {from} to {to} are not all there: the data have rows {first} to {last} with enough before them"
        );
        return Err((Status::NoData, message));
    }
    // What does not drive the variable may be missing.
    let mut needed = vec![false; model.graph().len()];
    for member in model.members() {
        crate::explain::drivers(&member.model.system, y).into_iter().for_each(|var| needed[var] = true);
    }
    let part = situation.rows.slice(ndarray::s![from + 1 - memory..=to, ..]);
    let is_gap = |var: usize, value: f64| needed[var] && !value.is_finite();
    if let Some(((row, var), _)) = part.indexed_iter().find(|((_, var), value)| is_gap(*var, **value)) {
        let name = &model.graph().names()[var];
        let message = format!(
            "{name} is missing in row {}, which the explanation needs; ask for another time",
            from + 1 - memory + row
        );
        return Err((Status::NoData, message));
    }
    Ok((from, to))
}

/// An equation on the way to `y` that could not be fitted.
fn lacking(model: &Directed, y: usize) -> Option<String> {
    crate::explain::drivers(&model.system, y).into_iter().find_map(|var| model.summaries[var].missing.clone())
}

/// The parts by each refit.
fn parts_of(model: &Directed, rows: &[f64], from: usize, y: usize, seed: u64) -> Vec<Parts> {
    let is_linear = |system: &System| system.equations.iter().flatten().all(|one| one.is_line());
    let of = |system: &System| match is_linear(system) {
        true => linear(system, rows, from, y),
        false => shapley(system, rows, from, y, seed),
    };
    model.plausible().par_iter().map(of).collect()
}

/// `0.31 because d was smaller than expected`.
fn words(
    model: &StructuralModel,
    rows: &[f64],
    memory: usize,
    (var, y): (usize, usize),
    part: f64,
) -> String {
    let amount = with_unit(model, y, part);
    if var == y {
        return format!("{amount} is its own");
    }
    let system = &model.members()[0].model.system;
    let surprise: f64 = system.noise(rows, memory).iter().skip(var).step_by(system.len()).sum();
    let how = if surprise < 0.0 { "smaller" } else { "larger" };
    format!("{amount} because {} was {how} than expected", model.graph().names()[var])
}

fn sentence(
    model: &StructuralModel,
    y: usize,
    (from, to, start): (usize, usize, f64),
    (change, expected): (f64, f64),
    contributions: &[Contribution],
    path: &[usize],
) -> String {
    let name = &model.graph().names()[y];
    let when = match model.facts.dt {
        Some(dt) => {
            format!("between {} and {} s", seconds(from as f64 * dt + start), seconds(to as f64 * dt + start))
        }
        None => format!("between row {from} and row {to}"),
    };
    let verb = if change < 0.0 { "fell" } else { "rose" };
    let sign = if change < 0.0 { -1.0 } else { 1.0 };
    let told = contributions.iter().filter(|c| c.value.abs() > TOLD * change.abs());
    let mut parts: Vec<String> = told.map(|c| c.text.clone()).collect();
    parts.push(format!("{} was to be expected", short(expected * sign)));
    let path = match path {
        [] => String::new(),
        path => format!(" Strongest path: {}.", caveats::arrows(model, path)),
    };
    let size = with_unit(model, y, change.abs());
    format!("{name} {verb} by {size} {when} ({}): {}.{path}", steps(model, to - from), parts.join(", "))
}
