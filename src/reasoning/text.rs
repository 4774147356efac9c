//! Answers for people: sentences, then a table, then what they rest on.

use roscausal_core::visible;
use roscausal_reasoning::answer::{
    Contribution, EffectAnswer, ExplainAnswer, Forecast, Outlook, WhatIfAnswer,
};

/// The outlooks of all actions.
pub fn what_if(answer: &WhatIfAnswer) -> String {
    let mut lines: Vec<String> = answer.outlooks.iter().map(|outlook| outlook.text.clone()).collect();
    if !answer.ranking.is_empty() {
        let names: Vec<&str> = answer.ranking.iter().map(|&k| answer.outlooks[k].action.as_str()).collect();
        lines.push(format!("Best first: {}.", names.join(", ")));
    }
    for outlook in answer.outlooks.iter().filter(|outlook| !outlook.refused) {
        lines.push(String::new());
        lines.push(format!("{}: mean (interval), step by step", outlook.action));
        lines.extend(table(outlook));
    }
    finished(lines, &answer.caveats)
}

fn table(outlook: &Outlook) -> Vec<String> {
    let cell = |text: String| format!("{text:>26}");
    let header: String = outlook.forecasts.iter().map(|forecast| cell(forecast.variable.clone())).collect();
    let mut lines = vec![format!("step{header}")];
    for k in 0..outlook.forecasts.first().map_or(0, |forecast| forecast.mean.len()) {
        let value = |forecast: &Forecast| {
            let (mean, lower, upper) = (forecast.mean[k], forecast.lower[k], forecast.upper[k]);
            let range = if lower == upper { String::new() } else { format!(" ({lower:.3} to {upper:.3})") };
            cell(format!("{mean:.3}{range}"))
        };
        lines.push(format!("{:4}{}", k + 1, outlook.forecasts.iter().map(value).collect::<String>()));
    }
    lines
}

/// An effect by lag.
pub fn effect(answer: &EffectAnswer) -> String {
    let mut lines = vec![answer.text.clone()];
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
    let mut lines = vec![answer.text.clone()];
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
    lines.extend(caveats.iter().map(|caveat| format!("note: {caveat}")));
    let shown: Vec<_> = lines.iter().map(|line| visible::line(line)).collect();
    shown.join("\n")
}
