//! `roscausal whatif|effect|explain`: questions to a causal model and data, without ROS.

mod closing;
mod inputs;
mod picture;
mod text;

use std::path::PathBuf;

use clap::Args as ClapArgs;
use roscausal_core::{Error, Result};
use roscausal_reasoning::{
    answer::{self, EffectQuestion, ExplainQuestion, Status},
    question::{Action, CostTerm, WhatIf, parse_action, parse_limit},
};
use serde::Serialize;

use crate::results::Results;
pub(crate) use closing::closing;
use inputs::{Format, Ready, SourceArgs};
pub use text::{effect as effect_text, explain as explain_text, what_if as what_if_text};

/// How far, and what to show.
#[derive(ClapArgs)]
struct AheadArgs {
    /// Time of the last row that counts as known, as in the file's column of times (row number, from 0, in a file without);
    /// default: the last row.
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    at: Option<f64>,
    /// Steps ahead.
    #[arg(long, default_value_t = 10)]
    horizon: usize,
    /// Variables to show, separated by commas; default: all.
    #[arg(long, value_delimiter = ',')]
    variables: Vec<String>,
    /// Simulated paths.
    #[arg(long, default_value_t = 400)]
    paths: usize,
    /// Folder for fan charts (SVG, PNG and PDF) and the answer as JSON, named as the command.
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// Arguments of `roscausal whatif`.
#[derive(ClapArgs)]
pub(crate) struct WhatIfArgs {
    #[command(flatten)]
    source: SourceArgs,
    #[command(flatten)]
    ahead: AheadArgs,
    /// An action, such as 'stop: r_v=0@1..10' (set), 'slower: r_v+=-0.2' (shift), 'ramp: r_v=0.6|0.4|0.2@1..3', 'go on'. Give it
    /// again for each action; without any: what happens if nobody acts.
    #[arg(long = "action", value_name = "ACTION")]
    actions: Vec<String>,
    /// What an action costs: a variable's mean over the steps, with a weight if wanted (`h_risk` or `h_risk:2`). Give it again for
    /// each term.
    #[arg(long = "cost", value_name = "VARIABLE[:WEIGHT]", allow_hyphen_values = true)]
    costs: Vec<String>,
    /// A bound to keep at every step, with a probability: 'd>1.5:0.95'. Give it again for each.
    #[arg(long = "limit", value_name = "LIMIT")]
    limits: Vec<String>,
    /// Had it been done: the rows after --at again, with the noise that they had.
    #[arg(long, requires = "actions")]
    had: bool,
    /// Answer also where the data do not reach, and say so.
    #[arg(long)]
    allow_extrapolation: bool,
}

/// Arguments of `roscausal effect`.
#[derive(ClapArgs)]
pub(crate) struct EffectArgs {
    #[command(flatten)]
    source: SourceArgs,
    /// The cause.
    #[arg(long)]
    cause: String,
    /// The effect.
    #[arg(long)]
    effect: String,
    /// Largest lag, in steps.
    #[arg(long, default_value_t = 10)]
    max_lag: usize,
    /// In standard deviations instead of units.
    #[arg(long)]
    standardised: bool,
}

/// Arguments of `roscausal explain`.
#[derive(ClapArgs)]
pub(crate) struct ExplainArgs {
    #[command(flatten)]
    source: SourceArgs,
    /// The variable that changed.
    #[arg(long)]
    variable: String,
    /// Time before the change; without --from and --to: the largest fall or rise within the last --horizon steps.
    #[arg(long, value_name = "T", requires = "to", allow_negative_numbers = true)]
    from: Option<f64>,
    /// Time after it.
    #[arg(long, value_name = "T", requires = "from", allow_negative_numbers = true)]
    to: Option<f64>,
    /// Steps to look back over.
    #[arg(long, default_value_t = 10)]
    horizon: usize,
}

/// Runs `roscausal whatif`.
pub(crate) fn what_if(args: &WhatIfArgs) -> Result<Status> {
    let bad = |name: &'static str| move |reason: String| Error::param(name, reason);
    let action = |text: &String| parse_action(text).map_err(bad("action"));
    let limit = |text: &String| parse_limit(text).map_err(bad("limit"));
    let actions: Vec<Action> = args.actions.iter().map(action).collect::<Result<_>>()?;
    let (name, actions) = match actions.is_empty() {
        true => ("predict", vec![Action::go_on()]),
        false => ("whatif", actions),
    };
    let question = WhatIf {
        counterfactual: args.had,
        actions,
        cost: args.costs.iter().map(|text| cost(text)).collect::<Result<_>>()?,
        limits: args.limits.iter().map(limit).collect::<Result<_>>()?,
        allow_extrapolation: args.allow_extrapolation,
        ..WhatIf::default()
    };
    outlook(name, &args.source, &args.ahead, question)
}

fn cost(text: &str) -> Result<CostTerm> {
    let (variable, weight) = match text.split_once(':') {
        None => (text, 1.0),
        Some((variable, weight)) => {
            let fault =
                |_| Error::param("cost", format!("'{text}' is not a cost; write it like h_risk or h_risk:2"));
            (variable, weight.trim().parse().map_err(fault)?)
        }
    };
    Ok(CostTerm { variable: variable.trim().to_owned(), weight })
}

/// Answers, prints and draws into files of this name.
fn outlook(name: &str, source: &SourceArgs, ahead: &AheadArgs, question: WhatIf) -> Result<Status> {
    let reads = [std::slice::from_ref(&source.model), &source.data].concat();
    // Taken before any work.
    let results = Results::wanted(ahead.out.as_deref(), source.force, &reads)?;
    let question = WhatIf {
        horizon: ahead.horizon,
        variables: ahead.variables.clone(),
        paths: ahead.paths,
        seed: source.seed,
        ..question
    };
    source.with(|ready: &Ready| {
        let (situation, _) = ready.situation(ahead.at)?;
        let answer = answer::what_if(&ready.model, &situation, &question);
        if let Some(results) = results {
            picture::write(results, name, &ready.model, &situation, (&question, &answer))?;
        }
        show(source, &answer, (answer.status, &answer.message), || text::what_if(&answer))
    })
}

/// Runs `roscausal effect`.
pub(crate) fn effect(args: &EffectArgs) -> Result<Status> {
    let question = EffectQuestion {
        cause: args.cause.clone(),
        effect: args.effect.clone(),
        max_lag: args.max_lag,
        standardised: args.standardised,
    };
    args.source.with(|ready: &Ready| {
        let answer = answer::effect(&ready.model, &question);
        show(&args.source, &answer, (answer.status, &answer.message), || text::effect(&answer))
    })
}

/// Runs `roscausal explain`.
pub(crate) fn explain(args: &ExplainArgs) -> Result<Status> {
    args.source.with(|ready: &Ready| {
        let (situation, recording) = ready.situation(args.to)?;
        let row = |time: Option<f64>| time.map(|time| ready.row_in(recording, time)).transpose();
        let question = ExplainQuestion {
            variable: args.variable.clone(),
            from_row: row(args.from)?,
            to_row: row(args.to)?,
            horizon: args.horizon,
            seed: args.source.seed,
            start: ready.start(recording),
        };
        let answer = answer::explain(&ready.model, &situation, &question);
        show(&args.source, &answer, (answer.status, &answer.message), || text::explain(&answer))
    })
}

/// Prints an answer; one without anything to show as an error.
fn show(
    source: &SourceArgs,
    answer: &impl Serialize,
    (status, message): (Status, &str),
    text: impl FnOnce() -> String,
) -> Result<Status> {
    let answered = matches!(status, Status::Ok | Status::Ambiguous | Status::NotSupported);
    match source.format {
        Format::Json => {
            let json = serde_json::to_string_pretty(answer).map_err(|e| Error::Data(e.to_string()))?;
            crate::terminal::print_json(&json);
        }
        Format::Text if answered => crate::terminal::print_text(&(text() + "\n")),
        Format::Text => {}
    }
    if !message.is_empty() && (source.format == Format::Text || !answered) {
        let word = match status {
            Status::Ok => "note",
            Status::Ambiguous => "ambiguous",
            Status::NotSupported => "not supported by the data",
            _ => "error",
        };
        tell!("{word}: {message}");
    }
    Ok(status)
}
