//! Is the model any good? Errors of its forecasts on rows that it has not seen, beside simple forecasts.

use ndarray::Array2;
use rayon::prelude::*;
use roscausal_discovery::Result;
use serde::{Deserialize, Serialize};

use crate::{
    graph::{Arrow, Graph},
    model::{Directed, Equations, Schedule, Settings, System},
    random,
    samples::Samples,
    simulate::simulate,
};

/// The graph in which every variable drives every one at each lag from 1 on: a VAR.
///
/// # Errors
/// None for a graph that is one.
pub fn all_lagged(graph: &Graph) -> Result<Graph> {
    let n = graph.len();
    let largest_lag = graph.largest_lag().max(1);
    let pairs = (0..n).flat_map(|effect| (0..n).map(move |cause| (cause, effect)));
    let at_all_lags = |(cause, effect)| (1..=largest_lag).map(move |lag| Arrow { cause, effect, lag });
    let arrows: Vec<Arrow> = pairs.flat_map(at_all_lags).collect();
    Graph::new(graph.names().to_vec(), largest_lag, &arrows, &[])
}

/// Mean squared errors `[horizon][variable]` of forecasts without noise from every origin `first..` of each recording whose outcome
/// is known; without a system, of the last value (persistence). NaN where there is no such origin.
pub fn mean_squares(
    system: Option<&System>,
    recordings: &[Array2<f64>],
    first: usize,
    horizons: &[usize],
) -> Vec<Vec<f64>> {
    let n = recordings.first().map_or(0, Array2::ncols);
    let furthest = horizons.iter().max().copied().unwrap_or(0);
    let memory = system.map_or(1, |system| system.memory.max(1));
    let mut sums = vec![vec![(0.0, 0_usize); n]; horizons.len()];
    for recording in recordings {
        let rows: Vec<f64> = recording.iter().copied().collect();
        for origin in first.max(memory - 1)..recording.nrows().saturating_sub(1) {
            let steps = furthest.min(recording.nrows() - 1 - origin);
            let mut path = rows[(origin + 1 - memory) * n..(origin + 1) * n].to_vec();
            if let Some(system) = system {
                system.run(&mut path, &Schedule::free(n, steps), |_, _| 0.0);
            }
            for (sums, &horizon) in sums.iter_mut().zip(horizons).filter(|(_, horizon)| **horizon <= steps) {
                for (var, (sum, count)) in sums.iter_mut().enumerate() {
                    let at = if system.is_some() { memory - 1 + horizon } else { memory - 1 };
                    let error = path[at * n + var] - rows[(origin + horizon) * n + var];
                    if error.is_finite() {
                        *sum += error * error;
                        *count += 1;
                    }
                }
            }
        }
    }
    let mean = |&(sum, count): &(f64, usize)| if count > 0 { sum / count as f64 } else { f64::NAN };
    sums.iter().map(|row| row.iter().map(mean).collect()).collect()
}

/// Steps ahead for which skill and calibration are measured.
pub const HORIZON: usize = 10;
/// Part of the rows that the checked model is fitted on.
const TRAINING: f64 = 0.8;
/// Origins of calibration, at most, and paths from each.
const MOST_ORIGINS: usize = 100;
const PATHS: usize = 100;
/// Origins below which nothing is said.
const FEWEST_ORIGINS: usize = 20;

/// How a model does on the last fifth of the rows, fitted on the others. `[step - 1][variable]` for 1 to [`HORIZON`] steps.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Quality {
    /// `1 - MSE / MSE of the last value`.
    pub skill_over_persistence: Vec<Vec<Option<f64>>>,
    /// `1 - MSE / MSE of a VAR` (all variables, all lags).
    pub skill_over_var: Vec<Vec<Option<f64>>>,
    /// By what part of its width an interval is widened on either side, so that it holds as often as it says (conformalised
    /// quantiles: Romano et al. 2019).
    pub widening: Vec<Vec<f64>>,
    /// Part of the outcomes that lay in the intervals before they were widened, over all steps, by variable.
    pub coverage: Vec<Option<f64>>,
    /// Origins that the widening rests on.
    pub origins: usize,
}

impl Quality {
    /// Fits on the first rows and looks at the last; `None` where these are too few.
    pub(crate) fn measure(samples: &Samples, graph: &Graph, settings: &Settings) -> Option<Self> {
        let (training, rest) = samples.split(TRAINING, graph.memory().max(1));
        let model = Directed::fit(&training, graph, settings, None).ok()?;
        let steps: Vec<usize> = (1..=HORIZON).collect();
        let recordings = rest.recordings();
        let squares = |system: Option<&System>| mean_squares(system, recordings, 0, &steps);
        let of_model = squares(Some(&model.system));
        let lines = Settings { equations: Equations::Linear, members: 1, ..settings.clone() };
        let var = Directed::fit(&training, &all_lagged(graph).ok()?, &lines, None).ok();
        let skill = |reference: Vec<Vec<f64>>| -> Vec<Vec<Option<f64>>> {
            let one = |(own, other): (&f64, &f64)| Some(1.0 - own / other).filter(|skill| skill.is_finite());
            let row = |(own, other): (&Vec<f64>, &Vec<f64>)| own.iter().zip(other).map(one).collect();
            of_model.iter().zip(&reference).map(row).collect()
        };
        let of_var = var.map(|var| squares(Some(&var.system))).unwrap_or_default();
        let (skill_over_persistence, skill_over_var) = (skill(squares(None)), skill(of_var));
        let (widening, coverage, origins) = calibrate(&model, recordings, settings)?;
        Some(Self { skill_over_persistence, skill_over_var, widening, coverage, origins })
    }

    /// The widening for a step (0: the first); beyond the last that was measured, that one's.
    pub(crate) fn widening(&self, step: usize, var: usize) -> f64 {
        let row = self.widening.get(step.min(self.widening.len().saturating_sub(1)));
        row.and_then(|row| row.get(var)).copied().unwrap_or(0.0)
    }

    /// The skill over persistence at a step, where it was measured.
    pub(crate) fn skill(&self, step: usize, var: usize) -> Option<f64> {
        *self.skill_over_persistence.get(step)?.get(var)?
    }
}

type Calibration = (Vec<Vec<f64>>, Vec<Option<f64>>, usize);

/// Scores the intervals of forecasts from held-out origins.
fn calibrate(model: &Directed, recordings: &[Array2<f64>], settings: &Settings) -> Option<Calibration> {
    let (n, memory) = (model.graph.len(), model.graph.memory().max(1));
    let of =
        |(k, r): (usize, &Array2<f64>)| (memory..=r.nrows()).map(move |end| (k, end)).collect::<Vec<_>>();
    let past = |k: usize, end: usize| recordings[k].slice(ndarray::s![end - memory..end, ..]);
    let whole = |&(k, end): &(usize, usize)| {
        end < recordings[k].nrows() && past(k, end).iter().all(|v| v.is_finite())
    };
    let origins: Vec<(usize, usize)> = recordings.iter().enumerate().flat_map(of).filter(whole).collect();
    let origins: Vec<(usize, usize)> =
        origins.iter().step_by(origins.len().div_ceil(MOST_ORIGINS).max(1)).copied().collect();
    if origins.len() < FEWEST_ORIGINS {
        return None;
    }
    let score = |(number, &(k, end)): (usize, &(usize, usize))| {
        let past: Vec<f64> = past(k, end).iter().copied().collect();
        let steps = HORIZON.min(recordings[k].nrows() - end);
        let seed = random::at(settings.seed, number, 5);
        let paths = simulate(model, &past, &Schedule::free(n, steps), PATHS, seed, false, &|| false);
        let one = |step: usize, var: usize| {
            let (low, high) = paths.bounds(step, var, settings.interval);
            let real = recordings[k][[end + step, var]];
            ((low - real).max(real - high)) / (high - low)
        };
        (0..steps).map(|step| (0..n).map(|var| one(step, var)).collect()).collect::<Vec<Vec<f64>>>()
    };
    let scores: Vec<Vec<Vec<f64>>> = origins.par_iter().enumerate().map(score).collect();
    let of = |step: usize, var: usize| {
        let rows = scores.iter().filter_map(|origin| origin.get(step));
        let mut all: Vec<f64> = rows.map(|row| row[var]).filter(|r| r.is_finite()).collect();
        all.sort_unstable_by(f64::total_cmp);
        all
    };
    let conformal = |step: usize, var: usize| {
        let all = of(step, var);
        let rank = (settings.interval * (all.len() + 1) as f64).ceil() as usize;
        // An interval is never narrowed to less than half.
        all.get(rank.clamp(1, all.len().max(1)) - 1).map_or(0.0, |r| r.max(-0.25))
    };
    let coverage = |var: usize| {
        let all: Vec<f64> = (0..HORIZON).flat_map(|step| of(step, var)).collect();
        let inside = all.iter().filter(|r| **r <= 0.0).count();
        (!all.is_empty()).then(|| inside as f64 / all.len() as f64)
    };
    let widening = (0..HORIZON).map(|step| (0..n).map(|var| conformal(step, var)).collect()).collect();
    Some((widening, (0..n).map(coverage).collect(), origins.len()))
}
