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

    fn row(&mut self, setting: &Setting, cells: &[&dyn Display]) -> Result<()> {
        let cells = cells.iter().map(ToString::to_string);
        self.0.write_record(setting.cells().into_iter().chain(cells)).map_err(fault)
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
            let Recall { link: (cause, effect), expected, found, runs, precision } = recall;
            let (low, high) = wilson(found, runs);
            let [low, high, precision] = [Some(low), Some(high), precision].map(cell);
            csv.row(group.setting, &[&cause, &effect, &expected, &found, &runs, &low, &high, &precision])?;
        }
    }
    csv.text()
}

/// One row per setting.
pub(super) fn scores_csv(groups: &[Group<'_>]) -> Result<String> {
    let mut csv = Csv::new(&["runs", "recall", "precision", "shd", "exact", "run_time_s"])?;
    for group in groups {
        let Score { recall, precision, shd, exact, run_time_s } = group.score();
        let [recall, precision, shd] = [Some(recall), precision, Some(shd)].map(cell);
        let (runs, time) = (group.runs.len(), format!("{run_time_s:.3}"));
        csv.row(group.setting, &[&runs, &recall, &precision, &shd, &exact, &time])?;
    }
    csv.text()
}

/// One row per run.
pub(super) fn runs_csv(runs: &[Run]) -> Result<String> {
    let mut csv = Csv::new(&["seed", "samples", "links", "run_time_s"])?;
    for run in runs {
        let links: Vec<String> =
            run.found.iter().map(|(cause, effect)| format!("{cause}->{effect}")).collect();
        let (links, time) = (links.join(" "), format!("{:.3}", run.run_time_s));
        csv.row(&run.setting, &[&run.seed, &run.n_samples, &links, &time])?;
    }
    csv.text()
}
