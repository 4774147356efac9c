//! A model in words and as a table.

use ndarray::Array3;
use roscausal_discovery::{
    Advice, Link, Model, Outcome,
    methods::{Method, fdr_bh},
    names::plain,
    settings::setting,
    visible,
};

/// Pieces of advice that are printed.
const MOST_ADVICE: usize = 3;

/// The model for people: one sentence per link, then a table of all tested pairs.
pub fn text(model: &Model) -> String {
    text_with(model, true)
}

/// As [`text`]; `advice`: whether it says how much longer to record for links that are not settled.
pub(crate) fn text_with(model: &Model, advice: bool) -> String {
    let mut lines = vec![headline(model)];
    lines.extend(by_chance(model));
    if model.links.is_empty() {
        lines.push(nothing_found(model));
    }
    if model.links.iter().all(|link| link.cause == link.effect) {
        lines.extend(missed(model));
    }
    lines.extend(model.links.iter().map(|link| format!("  {}", sentence(model, link))));
    if !model.dropped.is_empty() {
        lines.push(format!("Left out, without a link to another variable: {}.", model.dropped.join(", ")));
    }
    if advice {
        lines.extend(advice_lines(model));
    }
    lines.push(String::new());
    lines.extend(table(model));
    lines.extend(untested(model));
    lines.extend(words_explained(model));
    if model.status != "complete" {
        lines.push(format!("This result is {}.", model.status));
    }
    lines.extend(about_data(model));
    lines.extend(model.warnings.iter().map(|warning| format!("note: {}", visible::message(warning))));
    // Each is one line: an end of line in it is somebody else's.
    let shown: Vec<_> = lines.iter().map(|line| visible::line(line)).collect();
    shown.join("\n")
}

/// The paragraph "About the data", if they were looked at.
fn about_data(model: &Model) -> Option<String> {
    let profile = model.about_data.as_ref()?;
    if profile.remarks.is_empty() {
        let fewest =
            profile.variables.iter().map(|variable| variable.effective_samples).fold(f64::INFINITY, f64::min);
        return Some(format!(
            "About the data: no drift, no stretches without change, no outliers; worth at least {fewest:.0} independent samples."
        ));
    }
    Some(format!("About the data: {}.", profile.remarks.join(". ")))
}

fn headline(model: &Model) -> String {
    let step = model.dt.map_or(String::new(), |dt| format!(" at steps of {dt:.3} s"));
    let recordings = match model.n_recordings {
        1 => String::new(),
        n if model.settings.get("levels").is_some_and(|levels| levels == "remove") => {
            format!(" from {n} recordings without their own levels")
        }
        n => format!(" from {n} recordings"),
    };
    let (level_name, level) = model.link_level_in_words();
    let time = model.run_time_s.map_or(String::new(), |s| format!(", found in {s:.2} s"));
    format!(
        "{} with {} ({level_name} {level}{}, lags {}..{}) on {} samples{recordings}{step}: {} link{}{time}",
        model.method.to_uppercase(),
        model.cond_ind_test,
        if model.fdr == "none" { String::new() } else { format!(" corrected by {}", model.fdr) },
        model.tau_min,
        model.tau_max,
        samples(model),
        model.links.len(),
        if model.links.len() == 1 { "" } else { "s" }
    )
}

/// Of how many samples tests were made: `498`, or `17 to 396` where values are missing.
fn samples(model: &Model) -> String {
    let tested = model.outcome_counts().iter().any(|(outcome, _)| *outcome == Outcome::Tested);
    match model.samples_used() {
        Some((fewest, most)) if fewest == most => most.to_string(),
        Some((fewest, most)) => format!("{fewest} to {most}"),
        None if tested || model.features.is_empty() => model.n_samples.to_string(),
        None => format!("0 of {}", model.n_samples),
    }
}

/// That there is no link, as far as anything was tested.
pub(crate) fn nothing_found(model: &Model) -> String {
    let counts = model.outcome_counts();
    let tested: usize =
        counts.iter().filter(|(outcome, _)| *outcome == Outcome::Tested).map(|(_, count)| count).sum();
    let all: usize = counts.iter().map(|(_, count)| count).sum();
    match tested {
        // All variables were left out by a filter, which is told beside this.
        0 if all == 0 => "No causal link found.".to_owned(),
        0 => "No pair was tested, so nothing is known of any link.".to_owned(),
        _ if model.about_data.as_ref().is_some_and(|profile| !profile.later.is_empty()) => {
            format!(
                "No causal link found at lags {} to {}; there is dependence at longer ones.",
                model.tau_min, model.tau_max
            )
        }
        _ if tested == all => "No causal link found: every tested pair may be independent.".to_owned(),
        _ => format!("No causal link found among the {tested} of {all} pairs and lags that were tested."),
    }
}

/// How strong a link must be to be found, where none is.
pub(crate) fn missed(model: &Model) -> Option<String> {
    let size = model.detectable()?;
    Some(format!(
        "A partial correlation of {size:.2} between two variables would be found in four of five such recordings; a weaker one may be missed."
    ))
}

/// What was not tested, and why.
fn untested(model: &Model) -> Option<String> {
    let why = |(outcome, count): (Outcome, usize)| Some(format!("{count}: {}", outcome.why_not()?));
    let told: Vec<String> = model.outcome_counts().into_iter().filter_map(why).collect();
    (!told.is_empty()).then(|| format!("Pairs and lags that were not tested: {}.", told.join("; ")))
}

/// How many links chance alone would give, where many pairs were tested.
fn by_chance(model: &Model) -> Option<String> {
    const MANY: usize = 20;
    let level = model.link_level().filter(|_| model.fdr == "none")?;
    let p: Vec<f64> = model.p_matrix.iter().flatten().flatten().copied().flatten().collect();
    if p.len() <= MANY {
        return None;
    }
    let p = Array3::from_shape_vec((1, 1, p.len()), p).ok()?;
    let left = fdr_bh(&p, &p.mapv(|_| true)).iter().filter(|corrected| **corrected <= level).count();
    let method = model.method.parse::<Method>().ok()?;
    let reads = setting("fdr").is_some_and(|fdr| fdr.refusal(method, &model.cond_ind_test, None).is_none());
    let way = if reads { format!("; --fdr leaves {left}") } else { String::new() };
    let by_chance = level * p.len() as f64;
    let chances: Vec<f64> = model.links.iter().filter_map(|link| link.chance).collect();
    let real = match chances.len() {
        0 => String::new(),
        n => format!(
            " By all p-values of this run, about {:.1} of the {n} links between variables are real.",
            chances.iter().sum::<f64>()
        ),
    };
    Some(format!(
        "Of {} tested pairs and lags {by_chance:.1} would be linked by chance at {level}{way}.{real}",
        p.len()
    ))
}

/// "h_v at t-1 (0.3 s earlier) drives h_dg: strength 0.49, p < 0.001".
pub(crate) fn sentence(model: &Model, link: &Link) -> String {
    let (cause, effect) = (plain(&link.cause), plain(&link.effect));
    let earlier = match (link.lag, model.dt) {
        (0, _) => "at the same time".to_owned(),
        (lag, Some(dt)) => format!("at t-{lag} ({} earlier)", duration(lag, dt)),
        (lag, None) => format!("at t-{lag}"),
    };
    let verb = match link.mark.as_str() {
        "-->" if link.cause == link.effect => format!("{cause} {earlier} drives itself"),
        "-->" => format!("{cause} {earlier} drives {effect}"),
        "o->" if link.cause == link.effect => {
            format!("{cause} {earlier} drives itself, or something not recorded drives it at both times")
        }
        "o->" => format!("{cause} {earlier} drives {effect}, or something not recorded drives both"),
        "<->" => format!("{cause} {earlier} and {effect}: something not recorded drives both"),
        "x->" => {
            format!("{cause} {earlier} and {effect}: on whether it drives it the data contradict themselves")
        }
        _ => format!("{cause} and {effect} depend on each other {earlier}, direction open"),
    };
    let Some(p) = link.p_value else {
        return format!("{verb}: {}not tested", if link.required { "required, " } else { "" });
    };
    format!(
        "{verb}: strength {}{}, {}{}{}{}",
        link.strength_in_words(2),
        interval(link),
        p_value(model, p),
        on_few(model, link),
        found(model, link),
        link.size_in_words().map_or(String::new(), |words| format!("; {words}"))
    )
}

/// `, on 17 of 396 samples`, where the test of a link had much less to go by than others.
fn on_few(model: &Model, link: &Link) -> String {
    let few = link.n_used.filter(|used| 10 * used < 9 * model.n_samples);
    few.map_or(String::new(), |used| format!(", on {used} of {} samples", model.n_samples))
}

/// ` (0.41 to 0.55)`, the strengths in nine of ten resamples.
fn interval(link: &Link) -> String {
    match (link.value_low, link.value_high) {
        (Some(low), Some(high)) => format!(" ({low:.2} to {high:.2})"),
        _ => String::new(),
    }
}

/// `; firm: in 97 of 100 resamples`; with a chance that was measured `; unsure (chance 9 %): in 20 of 100 resamples`.
fn found(model: &Model, link: &Link) -> String {
    let done = model.confidence.as_ref().map_or(100, |confidence| confidence.resampling.done);
    let word = link.word().map_or(String::new(), |word| format!("; {word}"));
    let share = link.confidence.map(|share| format!("in {:.0} of {done} resamples", share * done as f64));
    match share {
        Some(share) if word.is_empty() => format!("; {share}"),
        Some(share) => format!("{word}: {share}"),
        None => word,
    }
}

/// What would settle the links that are not settled, if they are real.
fn advice_lines(model: &Model) -> Vec<String> {
    let Some(confidence) = &model.confidence else { return Vec::new() };
    let chance = |of: &Advice| {
        let is_it = |link: &&Link| (&link.cause, &link.effect, link.lag) == (&of.cause, &of.effect, of.lag);
        model.links.iter().find(is_it).and_then(|link| link.chance).unwrap_or(of.confidence)
    };
    // What is as good as certain, or as good as absent, is no use of more rows.
    let is_open = |of: &&Advice| of.in_model && (0.1..0.9).contains(&chance(of));
    let mut open: Vec<&Advice> = confidence.advice.iter().filter(is_open).collect();
    if open.is_empty() {
        return Vec::new();
    }
    open.sort_by(|a, b| chance(b).total_cmp(&chance(a)));
    let mut lines = vec![String::new(), "Not settled, the likeliest first:".to_owned()];
    for Advice { cause, effect, lag, sentence, .. } in open.into_iter().take(MOST_ADVICE) {
        lines.push(format!("  {} -> {} at lag {lag}: {sentence}", plain(cause), plain(effect)));
    }
    lines
}

/// What the column `found` is.
fn words_explained(model: &Model) -> Option<String> {
    let facts = &model.confidence.as_ref()?.resampling;
    Some(format!("found: share of {} {}s with the link.", facts.done, facts.scheme))
}

/// `p < 0.001`, `p = 0.012`; none of 500 surrogates is `p < 0.002`.
fn p_value(model: &Model, p: f64) -> String {
    let smallest = model.smallest_p();
    if p < smallest { format!("p < {smallest}") } else { format!("p = {p:.3}") }
}

/// The same for a table: `<0.001`, `0.0123`, `not tested`.
pub(crate) fn p_cell(model: &Model, p: Option<f64>) -> String {
    let Some(p) = p else { return "not tested".to_owned() };
    let smallest = model.smallest_p();
    if p < smallest { format!("<{smallest}") } else { format!("{p:.4}") }
}

/// `lag` steps of `dt` seconds: `0.2 s`, `3 days`, `2 months`.
fn duration(lag: usize, dt: f64) -> String {
    const DAY: f64 = 86_400.0;
    let days = [
        (365.0, 366.0, "year"),
        (89.0, 92.0, "quarter"),
        (28.0, 31.0, "month"),
        (7.0, 7.0, "week"),
        (1.0, 1.0, "day"),
    ];
    match days.into_iter().find(|(from, to, _)| (from * DAY..=to * DAY).contains(&dt)) {
        Some((.., name)) => format!("{lag} {name}{}", if lag == 1 { "" } else { "s" }),
        None => format!("{} s", rounded(lag as f64 * dt)),
    }
}

fn rounded(seconds: f64) -> f64 {
    (seconds * 1000.0).round() / 1000.0
}

fn table(model: &Model) -> Vec<String> {
    let names: Vec<String> = model.features.iter().map(|name| plain(name)).collect();
    let width = names.iter().map(String::len).max().unwrap_or(0).max("effect".len());
    let found = model.confidence.as_deref().map(|confidence| &confidence.link_frequency);
    let column = if found.is_some() { "  found" } else { "" };
    let mut lines =
        vec![format!("{:width$}  {:width$}  lag  strength   p-value{column}  link", "cause", "effect")];
    for (i, cause) in names.iter().enumerate() {
        for (j, effect) in names.iter().enumerate() {
            for lag in model.tau_min..=model.tau_max {
                if lag == 0 && i == j {
                    continue;
                }
                let (value, p) = (model.val_matrix[i][j][lag], model.p_matrix[i][j][lag]);
                let mark = &model.graph[i][j][lag];
                if model.features.len() > 8 && mark.is_empty() {
                    continue;
                }
                let outcome = model.outcomes[i][j][lag];
                let mark = match (mark.is_empty(), outcome.why_not()) {
                    (true, None) => "-".to_owned(),
                    (false, None) => mark.clone(),
                    (true, Some(why)) => format!("not tested: {why}"),
                    (false, Some(why)) => format!("{mark} (not tested: {why})"),
                };
                let value = value.map_or("-".to_owned(), |value| format!("{value:.3}"));
                let p = p.map_or("-".to_owned(), |p| p_cell(model, Some(p)));
                let share = found.map_or(String::new(), |found| format!("  {:5.2}", found[i][j][lag]));
                lines.push(format!(
                    "{cause:width$}  {effect:width$}  {lag:3}  {value:>8}  {p:>8}{share}  {mark}"
                ));
            }
        }
    }
    lines
}
