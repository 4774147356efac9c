//! How near the answers are to the truth, over all cases.

use serde::Serialize;

use super::{
    ACTIONS, JUDGED, REACH, STEPS,
    asked::{Answered, BACKWARDS, Case, TOO_FAST, UNTOUCHED},
    names,
};

/// Everything that the experiment measures.
#[derive(Debug, Serialize)]
pub(super) struct Figures {
    /// Moments at which every action was tried, and those among them that the data reach: all other figures are of these.
    pub(super) moments: usize,
    pub(super) reached: usize,
    /// By action and variable, in the variable's unit.
    pub(super) cells: Vec<Cell>,
    /// By question.
    pub(super) support: Vec<Support>,
    /// What is demanded of the answers.
    pub(super) bars: Vec<Bar>,
}

/// One action and one variable; errors are means over steps (and cases) of absolute values.
#[derive(Debug, Serialize)]
pub(super) struct Cell {
    pub(super) action: String,
    pub(super) variable: String,
    /// Mean effect at the last step: as it was, as the model and as the correlation have it.
    pub(super) effect: f64,
    pub(super) effect_answered: f64,
    pub(super) effect_correlational: f64,
    /// Error of the mean effect.
    pub(super) mean_effect_error: f64,
    pub(super) mean_effect_error_correlational: f64,
    /// Error of the effect in each case.
    pub(super) effect_error: f64,
    pub(super) effect_error_correlational: f64,
    /// Part of the outcomes within their intervals.
    pub(super) coverage: f64,
    /// Error of had-I, of the forecast under the action, of "nothing would have changed".
    pub(super) had_error: f64,
    pub(super) forecast_error: f64,
    pub(super) unchanged_error: f64,
}

/// What was refused, and how far the data reach.
#[derive(Debug, Serialize)]
pub(super) struct Support {
    pub(super) question: String,
    pub(super) refused: f64,
    /// Median of the steps that the data carry, of [`REACH`].
    pub(super) supported_steps: f64,
}

/// A figure and what is demanded of it.
#[derive(Debug, Serialize)]
pub(super) struct Bar {
    pub(super) what: String,
    pub(super) value: f64,
    pub(super) least: f64,
    pub(super) most: f64,
    pub(super) met: bool,
}

impl Bar {
    fn new(what: &str, value: f64, (least, most): (f64, f64)) -> Self {
        Self { what: what.to_owned(), value, least, most, met: (least..=most).contains(&value) }
    }
}

impl Figures {
    /// Measures the cases that the data reach, of so many `moments`; errors of different variables are added up in units of their
    /// `deviations`.
    pub(super) fn of(cases: &[Case], deviations: &[f64], moments: usize) -> Self {
        let each = (0..ACTIONS.len()).flat_map(|action| JUDGED.map(|var| (action, var)));
        let cells: Vec<(Cell, f64)> = each.map(|(a, var)| (cell(cases, a, var), deviations[var])).collect();
        let sum = |pick: fn(&Cell) -> f64| cells.iter().map(|(cell, sd)| pick(cell) / sd).sum::<f64>();
        let ratio = |own: fn(&Cell) -> f64, other: fn(&Cell) -> f64| sum(own) / sum(other);
        let coverage = cells.iter().map(|(cell, _)| cell.coverage).sum::<f64>() / cells.len() as f64;
        let support = support(cases);
        let of = |name: &str| support.iter().find(|one| one.question == name);
        let refused = |name: &str| of(name).map_or(f64::NAN, |one| one.refused);
        let steps = |name: &str| of(name).map_or(f64::NAN, |one| one.supported_steps);
        let mean_effect = ratio(|c| c.mean_effect_error, |c| c.mean_effect_error_correlational);
        let effect = ratio(|c| c.effect_error, |c| c.effect_error_correlational);
        let had = ratio(|c| c.had_error, |c| c.forecast_error);
        let unchanged = ratio(|c| c.had_error, |c| c.unchanged_error);
        let bars = vec![
            Bar::new("outcomes within their 90 % intervals", coverage, (0.84, 0.97)),
            Bar::new("error of the mean effect / that of the correlational answer", mean_effect, (0.0, 0.4)),
            Bar::new("error of the single effect / that of the correlational answer", effect, (0.0, 0.75)),
            Bar::new("error of had-I / that of the forecast under the action", had, (0.0, 0.85)),
            Bar::new("error of had-I / that of 'nothing would have changed'", unchanged, (0.0, 0.6)),
            Bar::new("refused: a speed above all that were seen", refused(TOO_FAST), (0.95, 1.0)),
            Bar::new("refused: a speed below all that were seen", refused(BACKWARDS), (0.95, 1.0)),
            Bar::new("refused: the speed that the robot had", refused(UNTOUCHED), (0.0, 0.05)),
            Bar::new("refused: slow", refused("slow"), (0.0, 0.05)),
            Bar::new(
                "steps carried by the data (of 20): the speed that the robot had",
                steps(UNTOUCHED),
                (15.0, 20.0),
            ),
            Bar::new("steps carried by the data (of 20): stop", steps("stop"), (5.0, 15.0)),
        ];
        let cells = cells.into_iter().map(|(cell, _)| cell).collect();
        Self { moments, reached: cases.len(), cells, support, bars }
    }
}

fn cell(cases: &[Case], action: usize, var: usize) -> Cell {
    let all: Vec<(&Case, &Answered)> = cases.iter().map(|case| (case, &case.actions[action])).collect();
    let n = all.len() as f64;
    // Mean over the cases of something at a step.
    let mean = |k: usize, of: &dyn Fn(&Case, &Answered, usize) -> f64| {
        all.iter().map(|(case, answered)| of(case, answered, k)).sum::<f64>() / n
    };
    let over_steps = |of: &dyn Fn(usize) -> f64| (0..STEPS).map(of).sum::<f64>() / STEPS as f64;
    let real = |case: &Case, a: &Answered, k: usize| a.real[k][var] - case.untouched[k][var];
    let own = |_: &Case, a: &Answered, k: usize| a.mean[k][var] - a.mean_untouched[k][var];
    let naive = |_: &Case, a: &Answered, k: usize| a.correlational[k][var];
    let error = |of: &dyn Fn(&Case, &Answered, usize) -> f64| over_steps(&|k| mean(k, of));
    Cell {
        action: ACTIONS[action].0.to_owned(),
        variable: names().swap_remove(var),
        effect: mean(STEPS - 1, &real),
        effect_answered: mean(STEPS - 1, &own),
        effect_correlational: mean(STEPS - 1, &naive),
        mean_effect_error: over_steps(&|k| (mean(k, &own) - mean(k, &real)).abs()),
        mean_effect_error_correlational: over_steps(&|k| (mean(k, &naive) - mean(k, &real)).abs()),
        effect_error: error(&|case, a, k| (own(case, a, k) - real(case, a, k)).abs()),
        effect_error_correlational: error(&|case, a, k| (naive(case, a, k) - real(case, a, k)).abs()),
        coverage: error(&|_, a, k| {
            f64::from(a.lower[k][var] <= a.real[k][var] && a.real[k][var] <= a.upper[k][var])
        }),
        had_error: error(&|_, a, k| (a.had[k][var] - a.real[k][var]).abs()),
        forecast_error: error(&|_, a, k| (a.mean[k][var] - a.real[k][var]).abs()),
        unchanged_error: error(&|case, a, k| real(case, a, k).abs()),
    }
}

fn support(cases: &[Case]) -> Vec<Support> {
    let questions = cases.first().map_or(0, |case| case.support.len());
    let one = |q: usize| {
        let refused = cases.iter().filter(|case| case.support[q].1).count();
        let mut steps: Vec<f64> = cases.iter().map(|case| case.support[q].2.min(REACH) as f64).collect();
        steps.sort_unstable_by(f64::total_cmp);
        Support {
            question: cases[0].support[q].0.clone(),
            refused: refused as f64 / cases.len() as f64,
            supported_steps: roscausal_discovery::quantile(&steps, 0.5),
        }
    };
    (0..questions).map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One step is enough to tell the figures apart: every step is the same.
    fn case(untouched: f64, real: f64, forecast: f64, had: f64, naive: f64) -> Case {
        let path = |x: f64| vec![vec![x; 4]; STEPS];
        let answered = || Answered {
            real: path(real),
            mean: path(forecast),
            lower: path(forecast - 0.2),
            upper: path(forecast + 0.2),
            mean_untouched: path(1.0),
            had: path(had),
            correlational: path(naive),
        };
        Case {
            seed: 1,
            start: 60.0,
            untouched: path(untouched),
            actions: vec![answered(), answered()],
            support: vec![(TOO_FAST.to_owned(), true, 0), (UNTOUCHED.to_owned(), false, 20)],
        }
    }

    #[test]
    fn errors_are_those_of_effects_and_outcomes_not_of_levels() {
        // Effects -0.5 and -0.7; the model says -0.4 and -0.8, the correlation -0.1 in both.
        let cases = [case(1.0, 0.5, 0.6, 0.45, -0.1), case(1.2, 0.5, 0.2, 0.55, -0.1)];
        let figures = Figures::of(&cases, &[1.0; 4], 3);
        let cell = &figures.cells[0];
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-9, "{a} is not {b}: {cell:?}");
        assert_eq!((figures.moments, figures.reached), (3, 2));
        near(cell.effect, -0.6);
        near(cell.mean_effect_error, 0.0);
        near(cell.mean_effect_error_correlational, 0.5);
        near(cell.effect_error, 0.1);
        near(cell.effect_error_correlational, 0.5);
        near(cell.coverage, 0.5);
        near(cell.had_error, 0.05);
        near(cell.forecast_error, 0.2);
        near(cell.unchanged_error, 0.6);
        let bar = |what: &str| figures.bars.iter().find(|bar| bar.what.contains(what)).expect(what);
        near(bar("single effect").value, 0.2);
        near(bar("forecast under").value, 0.25);
        near(bar("above all").value, 1.0);
        assert!(!bar("within").met && bar("above all").met && bar("nothing would").met);
    }
}
