//! A model in words and as a table.

use roscausal_discovery::{Link, LinkMark, Model, Summary, SummaryLink, names::plain, visible};

use crate::flags;

/// Columns of a terminal.
pub(crate) const WIDTH: usize = 80;
/// Widest column of a table; a longer cell stands out. A format panics beyond 65535.
pub(crate) const WIDEST: usize = 200;
/// Links and notes that are printed, unless all are wanted.
const MOST_LINKS: usize = 6;
const MOST_NOTES: usize = 8;

/// What else than the usual is printed of a model.
#[derive(Clone, Copy, Debug, Default, clap::Args)]
pub(crate) struct Detail {
    /// Print all links, with a sentence for each, all notes, and a table of all tested pairs and lags.
    #[arg(long, help_heading = "Output")]
    pub(crate) all: bool,
}

/// The model for people: its summary.
pub fn text(model: &Model) -> String {
    text_with(model, Detail::default(), true)
}

/// As [`text`]; `advice`: whether it says what to do next.
pub(crate) fn text_with(model: &Model, detail: Detail, advice: bool) -> String {
    let summary = model.summary().spelled(flags::spelled_one);
    let time = model.run_time_s.map_or(String::new(), |s| format!(", found in {s:.2} s"));
    let mut lines = wrapped("", &format!("{}{time}", summary.headline));
    lines.push("Conclusion".into());
    summary.conclusion.iter().for_each(|sentence| lines.extend(wrapped("  ", sentence)));
    if !summary.links.is_empty() {
        lines.push("Links, firmest first".into());
        lines.extend(rows(model, &summary, if detail.all { usize::MAX } else { MOST_LINKS }));
    }
    if !summary.own_past.is_empty() {
        lines.extend(wrapped("", &format!("Each depends on its own past: {}.", summary.own_past.join(", "))));
    }
    if advice && !summary.advice.is_empty() {
        lines.push("Next".into());
        for (k, advice) in summary.advice.iter().enumerate() {
            lines.extend(wrapped(&format!("  {}. ", k + 1), &advice.text));
        }
    }
    if detail.all {
        lines.extend(model.links.iter().map(|link| format!("  {}", sentence(model, link))));
        lines.push(String::new());
        lines.extend(table(model));
        lines.extend(words_explained(model));
    }
    let ended = |note: &str| format!("{}.", visible::message(note).trim_end_matches('.'));
    let about = summary.about_data.iter();
    lines.extend(about.flat_map(|about| wrapped("", &ended(&format!("About the data: {about}")))));
    let most = if detail.all { usize::MAX } else { MOST_NOTES };
    lines.extend(summary.notes.iter().take(most).flat_map(|note| wrapped("note: ", &ended(note))));
    let more = summary.notes.len().saturating_sub(most);
    lines.extend((more > 0).then(|| format!("{more} more note{}: --all", if more == 1 { "" } else { "s" })));
    // Each is one line: an end of line in it is somebody else's.
    let shown: Vec<_> = lines.iter().map(|line| visible::line(line)).collect();
    shown.join("\n")
}

/// A text in lines that fit a terminal: the first begins with `mark`, the others below its end.
pub(crate) fn wrapped(mark: &str, text: &str) -> Vec<String> {
    let indent = " ".repeat(if mark == "note: " { 2 } else { mark.len() });
    let mut words = text.split(' ');
    let (mut lines, mut line) = (Vec::new(), format!("{mark}{}", words.next().unwrap_or_default()));
    for word in words {
        if line.chars().count() + 1 + word.chars().count() <= WIDTH {
            line += &format!(" {word}");
        } else {
            lines.push(std::mem::replace(&mut line, format!("{indent}{word}")));
        }
    }
    lines.push(line);
    lines
}

/// A line for each link: who drives whom, when, how strongly, how sure.
fn rows(model: &Model, summary: &Summary, most: usize) -> Vec<String> {
    let of = |link: &SummaryLink| {
        let when =
            if link.lag == 0 { "same time".to_owned() } else { model.lag_in_words(link.lag) + " later" };
        let sure = match (link.chance, link.confidence) {
            (Some(of), _) => format!("{}, probability {:.0} %", link.sure, (100.0 * of).clamp(1.0, 99.0)),
            (None, Some(share)) => format!("{}, in {:.0} % of resamples", link.sure, 100.0 * share),
            _ => link.sure.to_owned(),
        };
        let strength = link.value.map_or("-".to_owned(), |value| format!("{value:.2}"));
        let p = match link.p_value {
            _ if link.sure == "without a p-value" => String::new(),
            Some(p) => p_value(model, p),
            None => "not tested".to_owned(),
        };
        let few = few(model, link.samples).map_or(String::new(), |used| format!(", {used} samples"));
        [format!("{} {} {}", link.cause, link.mark, link.effect), when, strength, p, sure + &few]
    };
    let cells: Vec<[String; 5]> = summary.links.iter().take(most).map(of).collect();
    let width = |k: usize| cells.iter().map(|row| row[k].chars().count()).max().unwrap_or(0).min(WIDEST);
    let widths @ [a, b, c, d, _] = [0, 1, 2, 3, 4].map(width);
    // Beside long names there is no room: what is said of a pair stands below it.
    let is_long = widths.iter().sum::<usize>() + 10 > WIDTH;
    let row = |[pair, when, strength, p, sure]: &[String; 5]| {
        let rest = format!("{when:>b$}  {strength:>c$}  {p:d$}  {sure}");
        let lines = if is_long { wrapped("  ", pair) } else { vec![format!("  {pair:a$}  {rest}")] };
        lines.into_iter().chain(is_long.then(|| format!("    {rest}"))).map(|line| line.trim_end().to_owned())
    };
    let more = summary.links.len().saturating_sub(most);
    let more = (more > 0).then(|| format!("  {more} more, none of them firmer: --all"));
    cells.iter().flat_map(row).chain(more).collect()
}

/// "h_v at t-1 (0.3 s earlier) drives h_dg: strength 0.49, p < 0.001".
pub(crate) fn sentence(model: &Model, link: &Link) -> String {
    let (cause, effect) = (plain(&link.cause), plain(&link.effect));
    let earlier = match (link.lag, model.dt) {
        (0, _) => "at the same time".to_owned(),
        (lag, Some(_)) => format!("at t-{lag} ({} earlier)", model.lag_in_words(lag)),
        (lag, None) => format!("at t-{lag}"),
    };
    let verb = match link.mark {
        LinkMark::Forward if link.cause == link.effect => format!("{cause} {earlier} drives itself"),
        LinkMark::Forward => format!("{cause} {earlier} drives {effect}"),
        LinkMark::CircleHead if link.cause == link.effect => {
            format!("{cause} {earlier} drives itself, or something not recorded drives it at both times")
        }
        LinkMark::CircleHead => {
            format!("{cause} {earlier} drives {effect}, or something not recorded drives both")
        }
        LinkMark::Bidirected => format!("{cause} {earlier} and {effect}: something not recorded drives both"),
        LinkMark::ConflictHead => {
            format!("{cause} {earlier} and {effect}: on whether it drives it the data contradict themselves")
        }
        _ => format!("{cause} and {effect} depend on each other {earlier}, direction open"),
    };
    let Some(p) = link.p_value else {
        return format!("{verb}: {}not tested", if link.required { "required, " } else { "" });
    };
    let strength = link.strength_in_words(2) + &interval(link);
    let few = few(model, link.n_used)
        .map_or(String::new(), |used| format!(", on {used} of {} samples", model.n_samples));
    let p = p_value(model, p) + &few;
    let size = link.size_in_words().map_or(String::new(), |words| format!("; {words}"));
    format!("{verb}: strength {strength}, {p}{}{size}", found(model, link))
}

/// The samples of a link, where its test had much less to go by than others.
fn few(model: &Model, used: Option<usize>) -> Option<usize> {
    used.filter(|used| (*used as f64) < 0.9 * model.n_samples as f64)
}

/// ` (0.41 to 0.55)`, the strengths in nine of ten resamples.
fn interval(link: &Link) -> String {
    match (link.value_low, link.value_high) {
        (Some(low), Some(high)) => format!(" ({low:.2} to {high:.2})"),
        _ => String::new(),
    }
}

/// `; unsure (probability 9 %): in 20 of 100 resamples`; where no chance was measured `; in 97 of 100 resamples`.
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

fn table(model: &Model) -> Vec<String> {
    let names: Vec<String> = model.features.iter().map(|name| plain(name)).collect();
    let width = names.iter().map(String::len).max().unwrap_or(0).clamp("effect".len(), WIDEST);
    let found = model.confidence.as_deref().map(|confidence| &confidence.link_frequency);
    let column = if found.is_some() { "  found" } else { "" };
    let mut lines =
        vec![format!("{:width$}  {:width$}  lag  strength   p-value{column}  link", "cause", "effect")];
    for (i, cause) in names.iter().enumerate() {
        for (j, effect) in names.iter().enumerate() {
            for lag in model.tau_min..=model.tau_max {
                let (value, p) = (model.val_matrix[i][j][lag], model.p_matrix[i][j][lag]);
                let mark = model.graph[i][j][lag];
                if (lag == 0 && i == j) || (model.features.len() > 8 && !mark.is_link()) {
                    continue;
                }
                let outcome = model.outcomes[i][j][lag];
                let mark = match (mark.is_link(), outcome.why_not()) {
                    (is_link, None) => {
                        let few = few(model, model.n_matrix[i][j][lag]);
                        let few = few.map_or(String::new(), |used| format!("  {used} samples"));
                        if is_link { format!("{mark}{few}") } else { format!("-{few}") }
                    }
                    (false, Some(why)) => format!("not tested: {why}"),
                    (true, Some(why)) => format!("{mark} (not tested: {why})"),
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
