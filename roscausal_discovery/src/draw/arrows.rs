//! The arrows of a summary graph: one for each mark of a pair of cause and effect, with all its lags.

use super::svg::display;
use crate::{
    model::{Link, Model},
    types::LinkMark,
};

/// Most pairs whose lags are listed below a graph.
const LISTED: usize = 14;

/// The mark that is the same from both ends: its links of both directions share an arrow.
const BOTH: LinkMark = LinkMark::Bidirected;

/// The links of one ordered pair with one mark.
pub(super) struct Arrow<'a> {
    pub(super) from: usize,
    pub(super) to: usize,
    /// By lag.
    pub(super) links: Vec<&'a Link>,
    /// The link with the largest strength.
    pub(super) strongest: &'a Link,
    /// What stands at its ends.
    pub(super) mark: LinkMark,
}

/// One arrow for each mark of a pair, by cause and then effect. The second mark of a pair, mirrored, takes the place of the other direction;
/// where that is taken, the next place beside them.
pub(super) fn arrows<'a>(model: &'a Model) -> Vec<Arrow<'a>> {
    let mut pairs = std::collections::BTreeMap::<(usize, usize, usize), Vec<&'a Link>>::new();
    let holds = |held: Option<&Vec<&Link>>, link: &Link| {
        let first = held.and_then(|held| held.first());
        first.is_some_and(|first| first.mark == link.mark && (link.mark == BOTH || first.cause == link.cause))
    };
    let mut links: Vec<&'a Link> = model.links.iter().collect();
    links.sort_by(|a, b| b.drawn_strength().abs().total_cmp(&a.drawn_strength().abs()));
    let mut more = Vec::new();
    for link in links {
        let Some((from, to)) = model.places(&link.cause, &link.effect) else { continue };
        let held = pairs.get(&(from, to, 0));
        match from == to || (link.mark != BOTH && (held.is_none() || holds(held, link))) {
            true => pairs.entry((from, to, 0)).or_default().push(link),
            false => more.push(((from, to), link)),
        }
    }
    for ((from, to), link) in more {
        let slots = [0_usize, 1, 2].map(|place| [(from, to, place), (to, from, place)]);
        let same = slots.into_iter().flatten().find(|slot| holds(pairs.get(slot), link));
        let free = slots.into_iter().flatten().find(|slot| !pairs.contains_key(slot));
        pairs.entry(same.or(free).unwrap_or((from, to, 0))).or_default().push(link);
    }
    let arrow = |((from, to, _), links): ((usize, usize, usize), Vec<&'a Link>)| {
        let is_mirrored = links.first().is_some_and(|link| model.features.get(from) != Some(&link.cause));
        Arrow::new(from, to, links, is_mirrored)
    };
    pairs.into_iter().filter_map(arrow).collect()
}

impl<'a> Arrow<'a> {
    fn new(from: usize, to: usize, mut links: Vec<&'a Link>, is_mirrored: bool) -> Option<Self> {
        links.sort_by_key(|link| link.lag);
        let by_strength =
            |a: &&Link, b: &&Link| a.drawn_strength().abs().total_cmp(&b.drawn_strength().abs());
        let strongest = links.iter().copied().max_by(by_strength)?;
        let mark = if is_mirrored { strongest.mark.mirrored() } else { strongest.mark };
        Some(Self { from, to, links, strongest, mark })
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
        let mark = if self.strongest.mark == LinkMark::Forward { "→" } else { "–" };
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
    fn every_mark_of_a_pair_is_an_arrow_of_its_own() {
        let mut model = crate::model::example();
        let link = |cause: &str, effect: &str, lag, mark: &str| Link {
            cause: cause.into(),
            effect: effect.into(),
            lag,
            mark: mark.parse().unwrap(),
            value: Some(0.5),
            ..Link::default()
        };
        model.links =
            vec![link("h_v", "h_dg", 2, "-->"), link("h_v", "h_dg", 0, "<->"), link("h_dg", "h_v", 1, "<->")];
        let drawn = |model: &Model| -> Vec<_> {
            let of = |arrow: &Arrow<'_>| (arrow.from, arrow.to, arrow.mark.symbol(), arrow.links.len());
            arrows(model).iter().map(of).collect()
        };
        assert_eq!(drawn(&model), [(0, 1, "-->", 1), (1, 0, "<->", 2)]);
        model.links[2] = link("h_dg", "h_v", 1, "-->");
        assert_eq!(drawn(&model), [(0, 1, "-->", 1), (0, 1, "<->", 1), (1, 0, "-->", 1)]);
        // Each takes another way, and has a label; a fourth line is the legend's.
        let svg = crate::draw::dag(&model);
        let lines = svg.lines().filter(|line| line.starts_with("<path") && line.contains("stroke-opacity"));
        assert_eq!(lines.collect::<std::collections::BTreeSet<_>>().len(), 4, "{svg}");
        assert_eq!(svg.matches("class=\"link\"").count(), 6, "{svg}");
    }

    #[test]
    fn lags_in_a_row_are_a_range() {
        assert_eq!(runs(&[1, 2, 3, 5, 6]), "1–3,5,6");
        assert_eq!(runs(&[0]), "0");
    }
}
