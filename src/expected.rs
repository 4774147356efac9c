//! The links that the paper expects, compared with those that were found.

use roscausal_discovery::Model;
use roscausal_hrisim::Scenario;

/// The cross links of the paper's scenario (Castri et al. 2024, section 4), cause and effect.
pub(crate) const PAPER: [(&str, &str); 4] =
    [("h_v", "h_dg"), ("h_dg", "h_v"), ("h_risk", "h_v"), ("h_v", "h_risk")];

/// The cross links that a scenario's people have: the paper's, without `h_dg -> h_v` if nobody slows down for a
/// goal, and without `h_risk -> h_v` if nobody gives way to robots.
pub(crate) fn links_of(scenario: &Scenario) -> Vec<(String, String)> {
    let slows = scenario.people.iter().any(|person| person.walk.slow_distance > 0.0);
    let avoids = scenario.people.iter().any(|person| person.walk.avoids);
    let exists = |link: &&(&str, &str)| match **link {
        ("h_dg", "h_v") => slows,
        ("h_risk", "h_v") => avoids,
        _ => true,
    };
    PAPER.iter().filter(exists).map(|(cause, effect)| ((*cause).to_owned(), (*effect).to_owned())).collect()
}

/// Which of the paper's links were found, which are missing, and which are extra. Links of a variable with its own
/// past are expected and not counted.
pub(crate) fn comparison(model: &Model) -> String {
    let others = model.links.iter().filter(|link| link.cause != link.effect);
    let found: Vec<(&str, &str)> = others.map(|link| (link.cause.as_str(), link.effect.as_str())).collect();
    let mut lines = vec!["Beside the paper's expected model:".to_owned()];
    for (cause, effect) in PAPER {
        let mark = if found.contains(&(cause, effect)) { "found  " } else { "missing" };
        lines.push(format!("  {mark}  {cause} -> {effect}"));
    }
    for (cause, effect) in found.iter().filter(|link| !PAPER.contains(link)) {
        lines.push(format!("  extra    {cause} -> {effect}"));
    }
    lines.join("\n")
}
