//! Counted runs as tables: CSV files, and Markdown for the terminal.

use std::fmt::{Display, Write};

use roscausal_core::{Error, Result};

use super::{
    super::{grid::Setting, runs::Run},
    counts::{Group, Recall, Score, groups, wilson},
};

/// One table per setting, as Markdown.
pub(crate) fn text(runs: &[Run]) -> String {
    let mut text = String::new();
    for group in groups(runs) {
        let [scenario, length, step, risk_model, risk_lag, method, test] = &group.setting.cells();
        let _ = writeln!(
            text,
            "{scenario}, {length} s at {step} s, risk {risk_model} late by {risk_lag}, {method} with {test}:\n\n\
             | link | found | of | 95 % interval | in this scenario | precision |\n|---|---|---|---|---|---|"
        );
        for recall in group.recalls() {
            let Recall { link: (cause, effect), found, runs, .. } = &recall;
            let (low, high) = wilson(*found, *runs);
            let (low, high, precision) = (100.0 * low, 100.0 * high, shown(recall.precision));
            let expected = if recall.expected { "yes" } else { "no" };
            let _ = writeln!(
                text,
                "| {cause} -> {effect} | {found} | {runs} | {low:.0}-{high:.0} % | {expected} | {precision} |"
            );
        }
        let Score { recall, precision, shd, exact, run_time_s } = group.score();
        let (precision, runs) = (shown(precision), group.runs.len());
        let _ = writeln!(
            text,
            "\nrecall {recall:.2}, precision {precision}, mean structural Hamming distance {shd:.2}, exact {exact} of {runs}, \
             {run_time_s:.2} s\n"
        );
    }
    text.truncate(text.trim_end().len());
    text
}

/// A fraction in a text; `-` for none.
fn shown(share: Option<f64>) -> String {
    share.map_or("-".to_owned(), |share| format!("{share:.2}"))
}

/// A fraction in a file; empty for none.
fn cell(share: Option<f64>) -> String {
    share.map_or(String::new(), |share| format!("{share:.4}"))
}

/// A table whose rows begin with the setting that they are about.
struct Csv(csv::Writer<Vec<u8>>);

impl Csv {
    fn new(columns: &[&str]) -> Result<Self> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        writer.write_record(Setting::HEADER.iter().chain(columns)).map_err(fault)?;
        Ok(Self(writer))
    }

    fn row(&mut self, setting: &Setting, cells: &[String]) -> Result<()> {
        self.0.write_record(setting.cells().iter().chain(cells)).map_err(fault)
    }

    fn text(self) -> Result<String> {
        String::from_utf8(self.0.into_inner().map_err(fault)?).map_err(fault)
    }
}

fn fault(error: impl Display) -> Error {
    Error::Data(format!("a table of the experiment cannot be written: {error}"))
}

/// One row per link and setting.
pub(super) fn recall_csv(groups: &[Group<'_>]) -> Result<String> {
    let mut csv = Csv::new(&["cause", "effect", "expected", "found", "runs", "low", "high", "precision"])?;
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
            csv.row(group.setting, &cells)?;
        }
    }
    csv.text()
}

/// One row per setting.
pub(super) fn scores_csv(groups: &[Group<'_>]) -> Result<String> {
    let mut csv = Csv::new(&["runs", "recall", "precision", "shd", "exact", "run_time_s"])?;
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
        csv.row(group.setting, &cells)?;
    }
    csv.text()
}

/// One row per run.
pub(super) fn runs_csv(runs: &[Run]) -> Result<String> {
    let mut csv = Csv::new(&["seed", "samples", "links", "run_time_s"])?;
    for run in runs {
        let links: Vec<String> =
            run.found.iter().map(|(cause, effect)| format!("{cause}->{effect}")).collect();
        let cells = [
            run.seed.to_string(),
            run.n_samples.to_string(),
            links.join(" "),
            format!("{:.3}", run.run_time_s),
        ];
        csv.row(&run.setting, &cells)?;
    }
    csv.text()
}
