//! Evaluates runs: recall per link, scores per setting, tables and plots.

use std::{collections::BTreeMap, fmt::Write};

use roscausal_core::draw::{Curve, Panel, curves};

use super::{grid::Setting, runs::Run};
use crate::expected::PAPER;

type Link = (String, String);

/// The variables of an experiment. Every ordered pair of two is a possible cross link.
const VARIABLES: [&str; 3] = ["h_v", "h_dg", "h_risk"];

/// How often one link was found with one setting.
#[derive(Clone, Debug, PartialEq)]
struct Recall {
    link: Link,
    expected: bool,
    found: usize,
    runs: usize,
    /// Of the runs of all scenarios that share the other settings and found the link: the fraction whose scenario
    /// has it. `None` if no run found it.
    precision: Option<f64>,
}

/// The runs of one setting.
struct Group<'a> {
    setting: &'a Setting,
    runs: Vec<&'a Run>,
    /// The runs of all scenarios that share the other settings.
    all_scenarios: Vec<&'a Run>,
}

/// The scores of one setting.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Score {
    /// Fraction of the expected links that were found, over all runs.
    recall: f64,
    /// Fraction of the links found that were expected; `None` if none was found.
    precision: Option<f64>,
    /// Mean structural Hamming distance: missing links plus extra links.
    shd: f64,
    /// Runs with exactly the expected links.
    exact: usize,
    /// Median wall time on one core, seconds.
    run_time_s: f64,
}

/// Name and text of every file.
pub(super) fn files(runs: &[Run]) -> Vec<(&'static str, String)> {
    let groups = groups(runs);
    vec![
        ("recall.csv", recall_csv(&groups)),
        ("scores.csv", scores_csv(&groups)),
        ("runs.csv", runs_csv(runs)),
        ("length.svg", plot(&groups, Factor::Length)),
        ("step.svg", plot(&groups, Factor::Rate)),
    ]
}

/// One table per setting, as Markdown.
pub(super) fn text(runs: &[Run]) -> String {
    let mut text = String::new();
    for group in groups(runs) {
        let score = group.score();
        let cells = group.setting.cells();
        let [scenario, length, step, risk_model, risk_lag, method, test] = &cells;
        let _ = writeln!(
            text,
            "{scenario}, {length} s at {step} s, risk {risk_model} late by {risk_lag}, {method} with {test}:\n\n\
             | link | found | of | 95 % interval | in this scenario | precision |\n|---|---|---|---|---|---|"
        );
        for recall in group.recalls() {
            let (low, high) = wilson(recall.found, recall.runs);
            let expected = if recall.expected { "yes" } else { "no" };
            let (cause, effect) = &recall.link;
            let _ = writeln!(
                text,
                "| {cause} -> {effect} | {} | {} | {:.0}-{:.0} % | {expected} | {} |",
                recall.found,
                recall.runs,
                100.0 * low,
                100.0 * high,
                shown(recall.precision)
            );
        }
        let precision = shown(score.precision);
        let _ = writeln!(
            text,
            "\nrecall {:.2}, precision {precision}, mean structural Hamming distance {:.2}, exact {} of {}, {:.2} s\n",
            score.recall,
            score.shd,
            score.exact,
            group.runs.len(),
            score.run_time_s
        );
    }
    text.truncate(text.trim_end().len());
    text
}

fn groups(runs: &[Run]) -> Vec<Group<'_>> {
    let mut groups: Vec<Group<'_>> = Vec::new();
    for run in runs {
        match groups.iter_mut().find(|group| *group.setting == run.setting) {
            Some(group) => group.runs.push(run),
            None => groups.push(Group { setting: &run.setting, runs: vec![run], all_scenarios: Vec::new() }),
        }
    }
    for group in &mut groups {
        let same = |run: &&Run| {
            Setting { scenario: group.setting.scenario.clone(), ..run.setting.clone() } == *group.setting
        };
        group.all_scenarios = runs.iter().filter(same).collect();
    }
    groups.sort_by(|a, b| {
        let order = |s: &Setting| {
            let words =
                (s.scenario.clone(), s.method.clone(), s.test.clone(), s.risk_model.clone(), s.risk_lag);
            (words, s.step, s.length)
        };
        let (a, b) = (order(a.setting), order(b.setting));
        a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.total_cmp(&b.2))
    });
    groups
}

impl Group<'_> {
    /// The paper's links first, then the others.
    fn recalls(&self) -> Vec<Recall> {
        let pairs = VARIABLES.iter().flat_map(|cause| VARIABLES.iter().map(move |effect| (*cause, *effect)));
        let others = pairs.filter(|(cause, effect)| cause != effect && !PAPER.contains(&(*cause, *effect)));
        let recall = |(cause, effect): (&str, &str)| {
            let link = (cause.to_owned(), effect.to_owned());
            Recall {
                expected: self.runs.iter().any(|run| run.expected.contains(&link)),
                found: self.runs.iter().filter(|run| run.found.contains(&link)).count(),
                runs: self.runs.len(),
                precision: self.precision(&link),
                link,
            }
        };
        PAPER.into_iter().chain(others).map(recall).collect()
    }

    fn precision(&self, link: &Link) -> Option<f64> {
        let found: Vec<_> = self.all_scenarios.iter().filter(|run| run.found.contains(link)).collect();
        let hits = found.iter().filter(|run| run.expected.contains(link)).count();
        (!found.is_empty()).then(|| hits as f64 / found.len() as f64)
    }

    fn score(&self) -> Score {
        let count = |of: fn(&Run) -> usize| self.runs.iter().map(|run| of(run)).sum::<usize>() as f64;
        let hits = count(|run| run.found.iter().filter(|link| run.expected.contains(link)).count());
        let (found, expected) = (count(|run| run.found.len()), count(|run| run.expected.len()));
        let is_exact = |run: &&&Run| {
            run.found.len() == run.expected.len() && run.found.iter().all(|link| run.expected.contains(link))
        };
        let mut times: Vec<f64> = self.runs.iter().map(|run| run.run_time_s).collect();
        times.sort_by(f64::total_cmp);
        Score {
            recall: if expected > 0.0 { hits / expected } else { 1.0 },
            precision: (found > 0.0).then_some(hits / found),
            shd: (found + expected - 2.0 * hits) / self.runs.len() as f64,
            exact: self.runs.iter().filter(is_exact).count(),
            run_time_s: times[times.len() / 2],
        }
    }
}

/// A fraction in a text; `-` for none.
fn shown(share: Option<f64>) -> String {
    share.map_or("-".to_owned(), |share| format!("{share:.2}"))
}

/// A fraction in a file; empty for none.
fn cell(share: Option<f64>) -> String {
    share.map_or(String::new(), |share| format!("{share:.4}"))
}

/// Wilson's 95 % interval of a fraction (Wilson 1927).
fn wilson(found: usize, runs: usize) -> (f64, f64) {
    const Z: f64 = 1.959_963_984_540_054;
    let (n, p) = (runs.max(1) as f64, found as f64 / runs.max(1) as f64);
    let centre = p + Z * Z / (2.0 * n);
    let half = Z * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt();
    let scale = 1.0 + Z * Z / n;
    (((centre - half) / scale).max(0.0), ((centre + half) / scale).min(1.0))
}

fn row(setting: &Setting, cells: &[String]) -> String {
    format!("{},{}\n", setting.cells().map(|cell| quoted(&cell)).join(","), cells.join(","))
}

fn quoted(cell: &str) -> String {
    if cell.contains([',', '"', '\n']) {
        format!("\"{}\"", cell.replace('"', "\"\""))
    } else {
        cell.to_owned()
    }
}

fn recall_csv(groups: &[Group<'_>]) -> String {
    let mut csv =
        format!("{},cause,effect,expected,found,runs,low,high,precision\n", Setting::HEADER.join(","));
    for group in groups {
        for recall in group.recalls() {
            let (low, high) = wilson(recall.found, recall.runs);
            let (cause, effect) = recall.link;
            let cells = [
                cause,
                effect,
                recall.expected.to_string(),
                recall.found.to_string(),
                recall.runs.to_string(),
                format!("{low:.4}"),
                format!("{high:.4}"),
                cell(recall.precision),
            ];
            csv += &row(group.setting, &cells);
        }
    }
    csv
}

fn scores_csv(groups: &[Group<'_>]) -> String {
    let mut csv = format!("{},runs,recall,precision,shd,exact,run_time_s\n", Setting::HEADER.join(","));
    for group in groups {
        let score = group.score();
        let cells = [
            group.runs.len().to_string(),
            format!("{:.4}", score.recall),
            cell(score.precision),
            format!("{:.4}", score.shd),
            score.exact.to_string(),
            format!("{:.3}", score.run_time_s),
        ];
        csv += &row(group.setting, &cells);
    }
    csv
}

fn runs_csv(runs: &[Run]) -> String {
    let mut csv = format!("{},seed,samples,links,run_time_s\n", Setting::HEADER.join(","));
    for run in runs {
        let links: Vec<String> =
            run.found.iter().map(|(cause, effect)| format!("{cause}->{effect}")).collect();
        let cells = [
            run.seed.to_string(),
            run.n_samples.to_string(),
            links.join(" "),
            format!("{:.3}", run.run_time_s),
        ];
        csv += &row(&run.setting, &cells);
    }
    csv
}

/// The horizontal axis of a plot.
#[derive(Clone, Copy)]
enum Factor {
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
fn plot(groups: &[Group<'_>], factor: Factor) -> String {
    let mut families: BTreeMap<String, Vec<&Group<'_>>> = BTreeMap::new();
    for group in groups {
        families.entry(factor.family(group.setting)).or_default().push(group);
    }
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
        chosen
            .map(|(link, _)| Curve { name: format!("{} → {}", link.0, link.1), points: share(link) })
            .collect()
    };
    let single = |name: &str, value: &dyn Fn(&Group<'_>) -> f64| {
        vec![Curve { name: name.to_owned(), points: points(value) }]
    };
    let panels = [
        Panel { title: "share of runs that find a link".into(), range: Some((0.0, 1.0)), curves: of(true) },
        Panel { title: "share of runs with a false link".into(), range: Some((0.0, 1.0)), curves: of(false) },
        Panel {
            title: "precision".into(),
            range: Some((0.0, 1.0)),
            curves: single("of all links found", &|group| group.score().precision.unwrap_or(f64::NAN)),
        },
        Panel {
            title: "structural Hamming distance".into(),
            range: None,
            curves: single("mean", &|group| group.score().shd),
        },
        Panel {
            title: "run time on one core (s)".into(),
            range: None,
            curves: single("median", &|group| group.score().run_time_s),
        },
    ];
    let setting = family[0].setting;
    let title = format!(
        "{}: {} with {}, risk {} late by {}, {} runs per point",
        setting.scenario,
        setting.method,
        setting.test,
        setting.risk_model,
        setting.risk_lag,
        family[0].runs.len()
    );
    curves(&title, factor.label(), &panels)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(length: f64, seed: u64, found: &[(&str, &str)]) -> Run {
        let links = |links: &[(&str, &str)]| -> Vec<Link> {
            links.iter().map(|(cause, effect)| ((*cause).to_owned(), (*effect).to_owned())).collect()
        };
        let setting = Setting {
            scenario: "thor".into(),
            length,
            step: 0.3,
            risk_model: "v1_1".into(),
            risk_lag: 1,
            method: "fpcmci".into(),
            test: "gpdc".into(),
        };
        Run {
            setting,
            seed,
            rest: String::new(),
            n_samples: 100,
            found: links(found),
            expected: links(&PAPER),
            run_time_s: 0.5 * length,
        }
    }

    #[test]
    fn links_and_distances_are_counted_per_setting() {
        let runs =
            [run(150.0, 1, &PAPER), run(150.0, 2, &[("h_v", "h_dg"), ("h_dg", "h_risk")]), run(75.0, 1, &[])];
        let groups = groups(&runs);
        assert_eq!(groups.len(), 2);
        let long = &groups[1];
        assert_eq!((long.setting.length, long.runs.len()), (150.0, 2));
        let counts: Vec<usize> = long.recalls().iter().map(|recall| recall.found).collect();
        assert_eq!(counts, [2, 1, 1, 1, 1, 0]);
        let score = long.score();
        assert_eq!((score.recall, score.precision), (5.0 / 8.0, Some(5.0 / 6.0)));
        // Three missing and one extra link in the second run of two.
        assert_eq!((score.shd, score.exact), (2.0, 1));
        assert_eq!((groups[0].score().precision, groups[0].score().shd), (None, 4.0));
    }

    #[test]
    fn precision_of_a_link_is_over_all_scenarios_with_the_same_settings() {
        let mut control = run(150.0, 1, &[("h_risk", "h_v"), ("h_dg", "h_v")]);
        control.setting.scenario = "ignores_the_robot".into();
        control.expected.retain(|link| link.0 != "h_risk");
        let mut longer = control.clone();
        longer.setting.length = 300.0;
        let runs = [run(150.0, 1, &PAPER), run(150.0, 2, &PAPER), control, longer];
        let precision_in = |scenario: &str, length: f64| -> BTreeMap<Link, Option<f64>> {
            let groups = groups(&runs);
            let group = groups.iter().find(|g| g.setting.scenario == scenario && g.setting.length == length);
            group.unwrap().recalls().into_iter().map(|recall| (recall.link, recall.precision)).collect()
        };
        let link = |cause: &str, effect: &str| (cause.to_owned(), effect.to_owned());
        for scenario in ["thor", "ignores_the_robot"] {
            let precision = precision_in(scenario, 150.0);
            assert_eq!(precision[&link("h_risk", "h_v")], Some(2.0 / 3.0));
            assert_eq!(precision[&link("h_dg", "h_v")], Some(1.0));
            assert_eq!(precision[&link("h_dg", "h_risk")], None);
        }
        assert_eq!(precision_in("ignores_the_robot", 300.0)[&link("h_risk", "h_v")], Some(0.0));
    }

    #[test]
    fn tables_have_one_row_per_link_and_setting() {
        let runs = [run(150.0, 1, &PAPER), run(75.0, 1, &[])];
        let files: BTreeMap<&str, String> = files(&runs).into_iter().collect();
        assert_eq!(files["recall.csv"].lines().count(), 1 + 2 * 6);
        assert!(
            files["recall.csv"]
                .contains("thor,150,0.3,v1_1,1,fpcmci,gpdc,h_dg,h_v,true,1,1,0.2065,1.0000,1.0000\n")
        );
        assert_eq!(files["scores.csv"].lines().count(), 3);
        assert!(files["runs.csv"].contains(",1,100,h_v->h_dg h_dg->h_v h_risk->h_v h_v->h_risk,75.000"));
        assert!(files["length.svg"].contains("length of the recording"));
        assert!(!files["length.svg"].contains("NaN") && !files["step.svg"].contains("NaN"));
    }

    #[test]
    fn the_interval_is_wilsons() {
        let (low, high) = wilson(16, 20);
        assert!((low - 0.5840).abs() < 1e-4 && (high - 0.9193).abs() < 1e-4, "{low} {high}");
        assert_eq!(wilson(0, 20).0, 0.0);
        assert!(wilson(20, 20).1 > 1.0 - 1e-12);
    }
}
