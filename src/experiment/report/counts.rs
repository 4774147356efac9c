//! Runs counted: how often each link is found, and scores per setting.

use super::super::{
    grid::Setting,
    runs::{NAMES, Run},
};
use crate::expected::PAPER;

pub(super) type Link = (String, String);

/// How often one link was found with one setting.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Recall {
    pub(super) link: Link,
    pub(super) expected: bool,
    pub(super) found: usize,
    pub(super) runs: usize,
    /// Of the runs of all scenarios that share the other settings and found the link: the fraction whose scenario
    /// has it. `None` if no run found it.
    pub(super) precision: Option<f64>,
}

/// The runs of one setting.
pub(super) struct Group<'a> {
    pub(super) setting: &'a Setting,
    pub(super) runs: Vec<&'a Run>,
    /// The runs of all scenarios that share the other settings.
    pub(super) all_scenarios: Vec<&'a Run>,
}

/// The scores of one setting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Score {
    /// Fraction of the expected links that were found, over all runs.
    pub(super) recall: f64,
    /// Fraction of the links found that were expected; `None` if none was found.
    pub(super) precision: Option<f64>,
    /// Mean structural Hamming distance: missing links plus extra links.
    pub(super) shd: f64,
    /// Runs with exactly the expected links.
    pub(super) exact: usize,
    /// Median wall time on one core, seconds.
    pub(super) run_time_s: f64,
}

/// The runs by setting, in the order of the tables.
pub(super) fn groups(runs: &[Run]) -> Vec<Group<'_>> {
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
                (s.scenario.clone(), s.method.name(), s.test.clone(), s.risk_model.clone(), s.risk_lag);
            (words, s.step, s.length)
        };
        let (a, b) = (order(a.setting), order(b.setting));
        a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.total_cmp(&b.2))
    });
    groups
}

impl Group<'_> {
    /// The paper's links first, then the others.
    pub(super) fn recalls(&self) -> Vec<Recall> {
        // Every ordered pair of two variables is a possible cross link.
        let pairs = NAMES.iter().flat_map(|cause| NAMES.iter().map(move |effect| (*cause, *effect)));
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

    pub(super) fn score(&self) -> Score {
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

/// Wilson's 95 % interval of a fraction (Wilson 1927).
pub(super) fn wilson(found: usize, runs: usize) -> (f64, f64) {
    const Z: f64 = 1.959_963_984_540_054;
    let (n, p) = (runs.max(1) as f64, found as f64 / runs.max(1) as f64);
    let centre = p + Z * Z / (2.0 * n);
    let half = Z * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt();
    let scale = 1.0 + Z * Z / n;
    (((centre - half) / scale).max(0.0), ((centre + half) / scale).min(1.0))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::{super::tests::run, *};

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
    fn the_interval_is_wilsons() {
        let (low, high) = wilson(16, 20);
        assert!((low - 0.5840).abs() < 1e-4 && (high - 0.9193).abs() < 1e-4, "{low} {high}");
        assert_eq!(wilson(0, 20).0, 0.0);
        assert!(wilson(20, 20).1 > 1.0 - 1e-12);
    }
}
