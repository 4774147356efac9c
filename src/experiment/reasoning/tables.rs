//! The figures as tables: Markdown for the terminal, and every case as CSV.

use std::fmt::Write;

use roscausal_discovery::Model;

use super::{ACTIONS, FEATURES, REACH, asked::Case, figures::Cell, figures::Figures, names};
use crate::experiment::model::{self, Trained};

/// What the experiment found, for people.
pub(super) fn text(figures: &Figures, found: &Model, trained: &Trained) -> String {
    let Trained { train, method, test, equations, runner, .. } = trained;
    let (walks, links) = (&runner.seeds, model::links(found));
    let mut text = format!(
        "{} of {} moments of the walks {walks} reached by the data, with a model of the walks {train} ({method} with {test}, {equations} equations).\n\
         Links (lag): {links}.\n\n",
        figures.reached, figures.moments,
    );
    let header: String =
        figures.cells.iter().map(|cell| format!(" {}: {} |", cell.action, cell.variable)).collect();
    let _ = writeln!(text, "| |{header}\n|---|{}", "---|".repeat(figures.cells.len()));
    let mut row = |what: &str, of: &dyn Fn(&Cell) -> String| {
        let cells: String = figures.cells.iter().map(|cell| format!(" {} |", of(cell))).collect();
        let _ = writeln!(text, "| {what} |{cells}");
    };
    row("mean effect at step 10: true / answered / by correlation", &|c| {
        format!("{:.2} / {:.2} / {:.2}", c.effect, c.effect_answered, c.effect_correlational)
    });
    row("error of the mean effect: answered / by correlation", &|c| {
        format!("{:.3} / {:.3}", c.mean_effect_error, c.mean_effect_error_correlational)
    });
    row("error of the single effect: answered / by correlation", &|c| {
        format!("{:.3} / {:.3}", c.effect_error, c.effect_error_correlational)
    });
    row("outcomes within their 90 % intervals", &|c| format!("{:.2}", c.coverage));
    row("error of had-I / forecast under the action / 'unchanged'", &|c| {
        format!("{:.3} / {:.3} / {:.3}", c.had_error, c.forecast_error, c.unchanged_error)
    });
    let _ = writeln!(
        text,
        "\n| question | refused | steps carried by the data (median, of {REACH}) |\n|---|---|---|"
    );
    for one in &figures.support {
        let _ =
            writeln!(text, "| {} | {:.0} % | {} |", one.question, 100.0 * one.refused, one.supported_steps);
    }
    let _ = writeln!(text, "\n| over all | measured | demanded | |\n|---|---|---|---|");
    for bar in &figures.bars {
        let demanded = if bar.least == 0.0 {
            format!("at most {}", bar.most)
        } else {
            format!("{} to {}", bar.least, bar.most)
        };
        let met = if bar.met { "met" } else { "MISSED" };
        let _ = writeln!(text, "| {} | {:.3} | {demanded} | {met} |", bar.what, bar.value);
    }
    text
}

/// Every number of every case: a row for each moment, action, step and variable.
pub(super) fn csv(cases: &[Case]) -> String {
    let mut text =
        "seed,start,action,step,variable,untouched,real,mean,lower,upper,mean_untouched,had,correlational\n"
            .to_owned();
    let names = names();
    for case in cases {
        for ((action, _), a) in ACTIONS.iter().zip(&case.actions) {
            for (k, real) in a.real.iter().enumerate() {
                for (var, name) in names.iter().enumerate().take(FEATURES.len()) {
                    let numbers = [
                        case.untouched[k][var], real[var], a.mean[k][var], a.lower[k][var], a.upper[k][var],
                        a.mean_untouched[k][var], a.had[k][var], a.correlational[k][var],
                    ];
                    let cells: Vec<String> = numbers.iter().map(|x| format!("{x:.4}")).collect();
                    let (seed, start, step, cells) = (case.seed, case.start, k + 1, cells.join(","));
                    let _ = writeln!(text, "{seed},{start},{action},{step},{name},{cells}");
                }
            }
        }
    }
    text
}
