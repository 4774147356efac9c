//! Counted runs as plots over one factor.

use std::collections::BTreeMap;

use roscausal_discovery::draw::{Curve, Panel, curves};

use super::{
    super::grid::Setting,
    counts::{Group, Link},
};

/// The horizontal axis of a plot.
#[derive(Clone, Copy)]
pub(super) enum Factor {
    Length,
    Rate,
}

impl Factor {
    fn label(self) -> &'static str {
        match self {
            Self::Length => "length of the recording (s)",
            Self::Rate => "samples per second",
        }
    }

    fn of(self, setting: &Setting) -> f64 {
        match self {
            Self::Length => setting.length,
            Self::Rate => 1.0 / setting.step,
        }
    }

    /// The setting without this factor; it is the same for all points of one curve.
    fn family(self, setting: &Setting) -> String {
        let mut setting = setting.clone();
        match self {
            Self::Length => setting.length = 0.0,
            Self::Rate => setting.step = 0.0,
        }
        format!("{setting:?}")
    }
}

/// Recall of each link, precision, Hamming distance and run time against one factor. Uses the largest set of
/// settings that differ in that factor alone.
pub(super) fn plot(groups: &[Group<'_>], factor: Factor) -> String {
    let mut families: BTreeMap<String, Vec<&Group<'_>>> = BTreeMap::new();
    groups.iter().for_each(|group| families.entry(factor.family(group.setting)).or_default().push(group));
    // The first of equals: `max_by_key` prefers the last, hence the reversal.
    let Some(mut family) = families.into_values().rev().max_by_key(Vec::len) else {
        return curves("", factor.label(), &[]);
    };
    let factor_of = |group: &Group<'_>| factor.of(group.setting);
    family.sort_by(|a, b| factor_of(a).total_cmp(&factor_of(b)));
    let points = |value: &dyn Fn(&Group<'_>) -> f64| -> Vec<(f64, f64)> {
        family.iter().map(|group| (factor_of(group), value(group))).collect()
    };
    let share = |link: &Link| {
        points(&|group| {
            let recalls = group.recalls();
            recalls.iter().find(|r| r.link == *link).map_or(0.0, |r| r.found as f64 / r.runs.max(1) as f64)
        })
    };
    let names: Vec<(Link, bool)> =
        family[0].recalls().into_iter().map(|recall| (recall.link, recall.expected)).collect();
    let of = |wanted: bool| -> Vec<Curve> {
        let chosen = names.iter().filter(|(_, expected)| *expected == wanted);
        let curve = |link: &Link| Curve { name: format!("{} → {}", link.0, link.1), points: share(link) };
        chosen.map(|(link, _)| curve(link)).collect()
    };
    let single = |name: &str, value: &dyn Fn(&Group<'_>) -> f64| {
        vec![Curve { name: name.to_owned(), points: points(value) }]
    };
    let panel = |title: &str, range, curves| Panel { title: title.into(), range, curves };
    let shares = Some((0.0, 1.0));
    let precision = single("of all links found", &|group| group.score().precision.unwrap_or(f64::NAN));
    let panels = [
        panel("share of runs that find a link", shares, of(true)),
        panel("share of runs with a false link", shares, of(false)),
        panel("precision", shares, precision),
        panel("structural Hamming distance", None, single("mean", &|group| group.score().shd)),
        panel("run time on one core (s)", None, single("median", &|group| group.score().run_time_s)),
    ];
    let Setting { scenario, method, test, risk_model, risk_lag, .. } = family[0].setting;
    let runs = family[0].runs.len();
    let title = format!(
        "{scenario}: {method} with {test}, risk {risk_model} late by {risk_lag}, {runs} runs per point"
    );
    curves(&title, factor.label(), &panels)
}
