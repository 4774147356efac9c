//! Numbers and steps in words.

pub(super) use roscausal_discovery::text::listed;
use roscausal_discovery::time_in_words;

use crate::model::StructuralModel;

/// A number in three significant digits: `0.312`, `12.5`, `1340`.
pub(super) fn short(value: f64) -> String {
    if !value.is_finite() {
        return "unknown".to_owned();
    }
    if value == 0.0 || value.abs() < 1e-12 {
        return "0".to_owned();
    }
    let digits = (2 - libm::log10(value.abs()).floor() as i64).clamp(0, 9) as usize;
    let text = format!("{value:.digits$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

/// A time in seconds, to the hundredth.
pub(super) fn seconds(time: f64) -> String {
    format!("{time:.2}").trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// A number with the unit of a variable.
pub(super) fn with_unit(model: &StructuralModel, var: usize, value: f64) -> String {
    let name = &model.graph().names()[var];
    let unit = model.facts.units.iter().find(|(variable, _)| variable == name);
    unit.map_or_else(|| short(value), |(_, unit)| format!("{} {unit}", short(value)))
}

/// Some steps: `10 steps (3 s)`.
pub(super) fn steps(model: &StructuralModel, steps: usize) -> String {
    let word = if steps == 1 { "step" } else { "steps" };
    match model.facts.dt {
        Some(dt) => format!("{steps} {word} ({})", time_in_words(dt, steps)),
        None => format!("{steps} {word}"),
    }
}

/// The names of variables, [`listed`].
pub(super) fn named(model: &StructuralModel, vars: &[usize]) -> String {
    listed(&vars.iter().map(|&var| model.graph().names()[var].clone()).collect::<Vec<_>>())
}

/// `r_v has no effect on h_risk and d within 10 steps (3 s): the graph has no path`.
pub(super) fn no_effect(
    model: &StructuralModel,
    causes: &[usize],
    effects: &[usize],
    within: usize,
) -> String {
    let verb = if causes.len() == 1 { "has" } else { "have" };
    let (causes, effects, within) = (named(model, causes), named(model, effects), steps(model, within));
    format!("{causes} {verb} no effect on {effects} within {within}: the graph has no path")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_digits_and_lists_an_and() {
        let texts: Vec<String> =
            [0.31234, 12.55, 1340.2, -0.00456, 0.0, 1.0, 0.5].iter().map(|&v| short(v)).collect();
        assert_eq!(texts, ["0.312", "12.6", "1340", "-0.00456", "0", "1", "0.5"]);
        assert_eq!(listed(&["a", "b", "c"]), "a, b and c");
    }
}
