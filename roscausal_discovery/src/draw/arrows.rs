//! The arrows of a summary graph: one per pair of cause and effect, with all its lags.

use super::svg::display;
use crate::model::{Link, Model};

/// Most pairs whose lags are listed below a graph.
const LISTED: usize = 14;

/// The links of one ordered pair.
pub(super) struct Arrow<'a> {
    pub(super) from: usize,
    pub(super) to: usize,
    /// By lag.
    pub(super) links: Vec<&'a Link>,
    /// The link with the largest strength.
    pub(super) strongest: &'a Link,
}

/// One arrow per pair with a link, by cause and then effect.
pub(super) fn arrows(model: &Model) -> Vec<Arrow<'_>> {
    let place = |name: &str| model.features.iter().position(|feature| feature == name);
    let mut pairs = std::collections::BTreeMap::<(usize, usize), Vec<&Link>>::new();
    for link in &model.links {
        if let (Some(from), Some(to)) = (place(&link.cause), place(&link.effect)) {
            pairs.entry((from, to)).or_default().push(link);
        }
    }
    pairs.into_iter().filter_map(|((from, to), links)| Arrow::new(from, to, links)).collect()
}

impl<'a> Arrow<'a> {
    fn new(from: usize, to: usize, mut links: Vec<&'a Link>) -> Option<Self> {
        links.sort_by_key(|link| link.lag);
        let strongest = links
            .iter()
            .copied()
            .max_by(|a, b| a.drawn_strength().abs().total_cmp(&b.drawn_strength().abs()))?;
        Some(Self { from, to, links, strongest })
    }

    /// The largest share of resamples that have one of its links; `None` without resamples.
    pub(super) fn confidence(&self) -> Option<f64> {
        self.links.iter().filter_map(|link| link.confidence).max_by(f64::total_cmp)
    }

    /// What stands on the arrow: its lags and its largest strength.
    pub(super) fn label(&self) -> String {
        let lags: Vec<usize> = self.links.iter().map(|link| link.lag).collect();
        format!("{} · {}", runs(&lags), self.strongest.strength_in_words(2))
    }

    /// The arrow in words: every lag with its strength and p-value.
    pub(super) fn words(&self, smallest_p: f64) -> String {
        let lag = |link: &&Link| {
            let Some(p) = link.p_value else {
                return format!("lag {}: {}", link.lag, link.strength_in_words(2));
            };
            let p = if p < smallest_p { format!("p < {smallest_p}") } else { format!("p = {p:.3}") };
            let found = link.confidence.map_or(String::new(), |share| format!(", found in {share:.2}"));
            format!("lag {}: {} ({p}{found})", link.lag, link.strength_in_words(2))
        };
        let mark = if self.strongest.mark == "-->" { "→" } else { "–" };
        let lags: Vec<String> = self.links.iter().map(lag).collect();
        let (cause, effect) = (display(&self.strongest.cause), display(&self.strongest.effect));
        format!("{cause} {mark} {effect}  {}", lags.join(", "))
    }
}

/// The arrows that stand for several links, in words; at most so many lines.
pub(super) fn merged(arrows: &[Arrow<'_>], smallest_p: f64) -> Vec<String> {
    let several: Vec<&Arrow<'_>> = arrows.iter().filter(|arrow| arrow.links.len() > 1).collect();
    let mut lines: Vec<String> = several.iter().take(LISTED).map(|arrow| arrow.words(smallest_p)).collect();
    if several.len() > LISTED {
        lines.push(format!(
            "and {} more pairs with several lags; the table of links has them",
            several.len() - LISTED
        ));
    }
    lines
}

/// Numbers that rise, runs of three and more as first and last: `1–3,5`.
fn runs(numbers: &[usize]) -> String {
    let mut parts: Vec<String> = Vec::new();
    for run in numbers.chunk_by(|a, b| b - a == 1) {
        match run {
            [first, _, .., last] => parts.push(format!("{first}–{last}")),
            few => parts.extend(few.iter().map(ToString::to_string)),
        }
    }
    parts.join(",")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lags_in_a_row_are_a_range() {
        assert_eq!(runs(&[1, 2, 3, 5, 6]), "1–3,5,6");
        assert_eq!(runs(&[0]), "0");
    }
}
