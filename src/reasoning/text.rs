//! Answers for people: sentences, then a table, then what they rest on.

use roscausal_core::visible;
use roscausal_reasoning::answer::{
    Contribution, EffectAnswer, ExplainAnswer, Forecast, Outlook, WhatIfAnswer,
};

use crate::report::{WIDEST, WIDTH, wrapped};

/// The outlooks of all actions.
pub fn what_if(answer: &WhatIfAnswer) -> String {
    let mut lines: Vec<String> =
        answer.outlooks.iter().flat_map(|outlook| wrapped("", &outlook.text)).collect();
    if !answer.ranking.is_empty() {
        let names: Vec<&str> = answer.ranking.iter().map(|&k| answer.outlooks[k].action.as_str()).collect();
        lines.extend(wrapped("", &format!("Best first: {}.", names.join(", "))));
    }
    for outlook in answer.outlooks.iter().filter(|outlook| !outlook.refused) {
        lines.push(String::new());
        lines.extend(wrapped("", &format!("{}: mean (interval), step by step", outlook.action)));
        lines.extend(table(outlook));
    }
    finished(lines, &answer.caveats)
}

/// As many variables side by side as fit a terminal, the others below.
fn table(outlook: &Outlook) -> Vec<String> {
    let column = |forecast: &Forecast| -> Vec<String> {
        let value = |k: usize| {
            let (mean, lower, upper) = (forecast.mean[k], forecast.lower[k], forecast.upper[k]);
            let range = if lower == upper { String::new() } else { format!(" ({lower:.3} to {upper:.3})") };
            format!("{mean:.3}{range}")
        };
        [forecast.variable.clone()].into_iter().chain((0..forecast.mean.len()).map(value)).collect()
    };
    let columns: Vec<Vec<String>> = outlook.forecasts.iter().map(column).collect();
    let widest = columns.iter().flatten().map(|cell| cell.chars().count()).max().unwrap_or(0);
    let wide = (widest + 2).min(WIDEST);
    let cell = |text: &str| format!("{text:>wide$}");
    let mut lines = Vec::new();
    for part in columns.chunks(((WIDTH - 4) / wide).max(1)) {
        for k in 0..part[0].len() {
            let step = if k == 0 { "step".to_owned() } else { format!("{k:4}") };
            lines.push(step + &part.iter().map(|column| cell(&column[k])).collect::<String>());
        }
    }
    lines
}

/// An effect by lag.
pub fn effect(answer: &EffectAnswer) -> String {
    let mut lines = wrapped("", &answer.text);
    if !answer.total.is_empty() {
        lines.push(String::new());
        lines.push("lag      total                  interval     direct".to_owned());
    }
    for (lag, total) in answer.total.iter().enumerate() {
        let interval = format!("{:.4} to {:.4}", answer.lower[lag], answer.upper[lag]);
        lines.push(format!("{lag:3} {total:10.4} {interval:>25} {:10.4}", answer.direct[lag]));
    }
    finished(lines, &answer.caveats)
}

/// A change taken apart.
pub fn explain(answer: &ExplainAnswer) -> String {
    let mut lines = wrapped("", &answer.text);
    if !answer.contributions.is_empty() {
        lines.push(String::new());
        lines.push(format!("{:>12} {:>10}", "part", "value"));
        lines.push(format!("{:>12} {:10.4}", "expected", answer.expected));
        lines.extend(answer.contributions.iter().map(
            |Contribution { variable, value, lower, upper, .. }| {
                format!("{variable:>12} {value:10.4} ({lower:.4} to {upper:.4})")
            },
        ));
        lines.push(format!("{:>12} {:10.4}", "the change", answer.change));
    }
    finished(lines, &answer.caveats)
}

fn finished(mut lines: Vec<String>, caveats: &[String]) -> String {
    if !caveats.is_empty() {
        lines.push(String::new());
    }
    lines.extend(caveats.iter().flat_map(|caveat| wrapped("note: ", caveat)));
    let shown: Vec<_> = lines.iter().map(|line| visible::line(line)).collect();
    shown.join("\n")
}
