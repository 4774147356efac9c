//! What the model says of each moment, and what a mere correlation says.

use ndarray::{Array2, s};
use roscausal_core::{Error, Result};
use roscausal_reasoning::{
    StructuralModel,
    answer::{Outlook, Status, what_if},
    question::{Action, Intervention, Situation, WhatIf},
};

use super::{ACTING, ACTIONS, FEATURES, REACH, STEPS, names, twins::Twins};

/// Name of the path that was taken when nobody acted.
pub(super) const UNTOUCHED: &str = "untouched";
/// Names of the questions that no data answer: speeds half the range beyond the largest and the smallest that were seen.
pub(super) const TOO_FAST: &str = "too fast";
pub(super) const BACKWARDS: &str = "backwards";

/// `[step][variable]`, [`STEPS`] of them.
pub(super) type Path = Vec<Vec<f64>>;

/// One moment: truth and answers.
pub(super) struct Case {
    pub(super) seed: u64,
    pub(super) start: f64,
    /// What came about when nobody acted.
    pub(super) untouched: Path,
    /// By action.
    pub(super) actions: Vec<Answered>,
    /// By question: its name, whether it was refused, steps that the data carry (of [`REACH`]).
    pub(super) support: Vec<(String, bool, usize)>,
}

/// One action of one moment.
pub(super) struct Answered {
    /// What came about under the action.
    pub(super) real: Path,
    /// The forecast under it, with its interval.
    pub(super) mean: Path,
    pub(super) lower: Path,
    pub(super) upper: Path,
    /// The forecast under the speed that the robot had when nobody acted.
    pub(super) mean_untouched: Path,
    /// The observed rows again, under the action.
    pub(super) had: Path,
    /// The effect by correlation.
    pub(super) correlational: Path,
}

impl Case {
    /// Asks about one moment; none where the data do not reach what was the case then.
    ///
    /// # Errors
    /// A question that the model cannot answer.
    pub(super) fn ask(
        model: &StructuralModel,
        twins: &Twins,
        correlation: &Correlation,
    ) -> Result<Option<Self>> {
        let situation = Situation { rows: twins.rows.view(), now: twins.now };
        let own = twins.rows.slice(s![twins.now + 1.., ACTING]).to_vec();
        let imposed: Vec<Vec<f64>> = twins.acted.iter().map(|rows| rows.column(ACTING).to_vec()).collect();
        let (low, high) = seen(model);
        let beyond = 0.5 * (high - low);
        let mut questions: Vec<(&str, Vec<f64>)> =
            ACTIONS.iter().zip(&imposed).map(|((name, _), path)| (*name, path.clone())).collect();
        questions.extend([
            (UNTOUCHED, own.clone()),
            (TOO_FAST, vec![high + beyond]),
            (BACKWARDS, vec![low - beyond]),
        ]);
        let mut outlooks = Vec::new();
        let mut support = Vec::new();
        for (name, values) in questions {
            let question = set(name, values, REACH);
            let Some(outlook) = only(model, &situation, question.clone(), false)? else { return Ok(None) };
            support.push((name.to_owned(), outlook.refused, outlook.supported_steps));
            // Every case and every step counts, also where the data do not reach.
            if ACTIONS.iter().any(|(action, _)| *action == name) || name == UNTOUCHED {
                let Some(outlook) = only(model, &situation, question, true)? else { return Ok(None) };
                outlooks.push(outlook);
            }
        }
        let mean_untouched = by_step(&outlooks[ACTIONS.len()], |f| &f.mean);
        let answered = |action: usize| {
            let (path, forecast) = (&imposed[action], &outlooks[action]);
            let had = WhatIf { counterfactual: true, ..set(ACTIONS[action].0, path.clone(), STEPS) };
            let Some(had) = only(model, &situation, had, true)? else { return Ok(None) };
            Ok(Some(Answered {
                real: path_of(&twins.acted[action]),
                mean: by_step(forecast, |f| &f.mean),
                lower: by_step(forecast, |f| &f.lower),
                upper: by_step(forecast, |f| &f.upper),
                mean_untouched: mean_untouched.clone(),
                had: by_step(&had, |f| &f.mean),
                correlational: correlation.effects(path, &own),
            }))
        };
        let Some(actions) = (0..ACTIONS.len()).map(answered).collect::<Result<Option<_>>>()? else {
            return Ok(None);
        };
        let untouched = path_of(&twins.rows.slice(s![twins.now + 1.., ..]).to_owned());
        Ok(Some(Self { seed: twins.seed, start: twins.start, untouched, actions, support }))
    }
}

/// The first steps of some rows.
fn path_of(rows: &Array2<f64>) -> Path {
    rows.outer_iter().take(STEPS).map(|row| row.to_vec()).collect()
}

/// Smallest and largest value of the acting variable that the model has seen.
fn seen(model: &StructuralModel) -> (f64, f64) {
    let all = model.samples().recordings().iter().flat_map(|rows| rows.column(ACTING).to_vec());
    all.filter(|x| x.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
}

/// The acting variable set to a path.
fn set(name: &str, values: Vec<f64>, horizon: usize) -> WhatIf {
    let variable = names().swap_remove(ACTING);
    let values = if values.len() > 1 { values[..horizon].to_vec() } else { values };
    let actions = vec![Action::one(name, Intervention::set(variable, values))];
    WhatIf { horizon, actions, ..WhatIf::default() }
}

/// What comes of one action; none where even extrapolation is refused.
fn only(
    model: &StructuralModel,
    situation: &Situation<'_>,
    question: WhatIf,
    allow_extrapolation: bool,
) -> Result<Option<Outlook>> {
    let answer = what_if(model, situation, &WhatIf { allow_extrapolation, ..question });
    if answer.status == Status::NotSupported && allow_extrapolation {
        return Ok(None);
    }
    answer.outlooks.into_iter().next().map(Some).ok_or(Error::Data(answer.message))
}

fn by_step(outlook: &Outlook, pick: fn(&roscausal_reasoning::answer::Forecast) -> &Vec<f64>) -> Path {
    (0..STEPS).map(|k| outlook.forecasts.iter().map(|forecast| pick(forecast)[k]).collect()).collect()
}

/// The correlational answer: an outcome `k` steps ahead regressed on the mean of the acting variable over steps `1..k`.
pub(super) struct Correlation {
    /// `[step][variable]`.
    slopes: Path,
}

impl Correlation {
    /// Slopes in some walks.
    pub(super) fn of(walks: &[Array2<f64>]) -> Self {
        let slope = |k: usize, var: usize| {
            let pairs = walks.iter().flat_map(|rows| {
                (0..rows.nrows().saturating_sub(k)).map(move |t| {
                    let speed = rows.slice(s![t + 1..=t + k, ACTING]).sum() / k as f64;
                    (speed, rows[[t + k, var]])
                })
            });
            let (xs, ys): (Vec<f64>, Vec<f64>) =
                pairs.filter(|(x, y)| x.is_finite() && y.is_finite()).unzip();
            roscausal_reasoning::linear::least_squares(&ys, &[&xs]).coefficients[0]
        };
        let row = |k: usize| (0..FEATURES.len()).map(|var| slope(k, var)).collect();
        Self { slopes: (1..=STEPS).map(row).collect() }
    }

    /// The effect of one path against another.
    fn effects(&self, path: &[f64], own: &[f64]) -> Path {
        let mean = |path: &[f64], k: usize| path[..k].iter().sum::<f64>() / k as f64;
        let row = |(k, slopes): (usize, &Vec<f64>)| {
            let change = mean(path, k + 1) - mean(own, k + 1);
            slopes.iter().map(|slope| slope * change).collect()
        };
        self.slopes.iter().enumerate().map(row).collect()
    }
}
