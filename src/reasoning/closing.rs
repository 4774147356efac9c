//! The last words of `roscausal demo`: one what-if and one explanation, and the commands that say more.

use std::path::{Path, PathBuf};

use roscausal_core::{Error, Result};
use roscausal_discovery::{LinkMark, Model, names, quantile};
use roscausal_reasoning::{
    answer::{self, ExplainQuestion},
    question::{WhatIf, parse_action},
};

use super::inputs::{Ready, SourceArgs};
use crate::report::wrapped;

/// What the robot can change about the paper's scenario, and what this does to them.
const PAPER: (&str, &str) = ("h_risk", "h_v");
/// The part of the samples that are below the value that is tried: low, and seen often enough.
const LOW: f64 = 0.1;
const HORIZON: usize = 10;

/// The commands' answers for a model and the batches it was found in.
///
/// # Errors
/// Batches that no equation can be fitted on.
pub(crate) fn closing(
    found: &Model,
    model: &Path,
    data: &[PathBuf],
    threads: Option<usize>,
) -> Result<String> {
    let Some((cause, effect)) = lever(found) else {
        return Ok("No variable drives another in this model: there is nothing to ask it.".to_owned());
    };
    let source = SourceArgs {
        model: model.to_owned(),
        data: data.to_vec(),
        equations: "auto".to_owned(),
        seed: 42,
        threads,
        ..SourceArgs::default()
    };
    source.with(|ready| {
        let value = low(ready, cause)?;
        let action = format!("low: {cause}={value}");
        let parsed = parse_action(&action).map_err(|reason| Error::param("action", reason))?;
        let question = WhatIf {
            horizon: HORIZON,
            actions: vec![parsed, roscausal_reasoning::question::Action::go_on()],
            variables: vec![effect.to_owned()],
            seed: source.seed,
            ..WhatIf::default()
        };
        let (situation, recording) = ready.situation(None)?;
        let outlook = answer::what_if(&ready.model, &situation, &question);
        let why = ExplainQuestion {
            variable: effect.to_owned(),
            from_row: None,
            to_row: None,
            horizon: HORIZON,
            seed: source.seed,
            start: ready.start(recording),
        };
        let why = answer::explain(&ready.model, &situation, &why);
        let mut lines =
            vec![format!("What if {cause} were {value} from now on, as low as in a tenth of the samples?")];
        lines.extend(outlook.outlooks.iter().flat_map(|one| wrapped("  ", &one.text)));
        lines.extend(outlook.message.lines().flat_map(|line| wrapped("  ", line)));
        lines.push(format!("Why did {effect} change at the end?"));
        lines.extend(wrapped("  ", if why.text.is_empty() { &why.message } else { &why.text }));
        let new = why.caveats.iter().filter(|note| !outlook.caveats.contains(note));
        lines.extend(outlook.caveats.iter().chain(new).flat_map(|note| wrapped("  note: ", note)));
        let files: Vec<String> = data.iter().map(|path| path.display().to_string()).collect();
        let of = format!("{} --data {}", model.display(), files.join(","));
        lines.push("Ask it yourself (docs/reasoning.md):".to_owned());
        lines.push(format!(
            "  roscausal whatif {of} --variables {effect} --action '{action}' --action 'go on'"
        ));
        lines.push(format!("  roscausal explain {of} --variable {effect}"));
        Ok(lines.join("\n"))
    })
}

/// The link to ask about: the paper's, else the strongest between two variables.
fn lever(found: &Model) -> Option<(&str, &str)> {
    let of_system = |name: &str| !name.starts_with("do_");
    let links = found.links.iter().filter(|link| link.mark == LinkMark::Forward && link.cause != link.effect);
    let mut links: Vec<_> = links.filter(|link| of_system(&link.cause) && of_system(&link.effect)).collect();
    links.sort_by(|a, b| b.drawn_strength().abs().total_cmp(&a.drawn_strength().abs()));
    let pairs = || links.iter().map(|link| (link.cause.as_str(), link.effect.as_str()));
    pairs().find(|pair| *pair == PAPER).or_else(|| pairs().next())
}

/// A low value of a variable, to three digits.
fn low(ready: &Ready, variable: &str) -> Result<f64> {
    let missing = || Error::Data(format!("the equations have no variable '{variable}'"));
    let var = names::position(ready.model.graph().names(), variable).ok_or_else(missing)?;
    let recordings = ready.model.samples().recordings();
    let mut all: Vec<f64> = recordings.iter().flat_map(|rows| rows.column(var).to_vec()).collect();
    all.retain(|x| x.is_finite());
    all.sort_unstable_by(f64::total_cmp);
    Ok((quantile(&all, LOW) * 1000.0).round() / 1000.0)
}
