//! Many paths into the future, under interventions or without: the g-formula (Robins 1986), by Monte Carlo.
//!
//! Path `s` follows the equations of member `s mod B` with noise of moments drawn at random: `x_j := f_j(parents) + e_j`. A set variable
//! takes its value, whatever its parents; a shifted one is moved. This is right for sustained and several interventions with feedback,
//! where no adjustment set exists. All actions of one question use the same noise and members (common random numbers), so that their
//! difference is not noise.

use rayon::prelude::*;
use roscausal_discovery::{quantile, student_t_quantile};

use crate::{
    model::{Directed, Schedule},
    random,
};

/// Paths that are simulated together.
const CHUNK: usize = 50;

/// Paths, and where they leave what was seen.
pub(crate) struct Ensemble {
    pub(crate) n: usize,
    pub(crate) steps: usize,
    pub(crate) paths: usize,
    /// `[(path * steps + step) * n + var]`.
    values: Vec<f64>,
    /// `[path * steps + step]`: a bit for each equation that is asked outside its support.
    outside: Vec<u64>,
}

/// The bit of a variable; those beyond the 63rd share one.
pub(crate) fn bit(var: usize) -> u64 {
    1 << var.min(63)
}

/// Whether nobody waits for the result any more. Asked often, and by several threads.
pub type Stop<'a> = &'a (dyn Fn() -> bool + Sync);

/// Simulates `paths` paths that follow `past` (rows one after the other). Once `stop` is true the rest stay 0.
pub(crate) fn simulate(
    model: &Directed,
    past: &[f64],
    schedule: &Schedule,
    paths: usize,
    seed: u64,
    watch: bool,
    stop: Stop<'_>,
) -> Ensemble {
    let (n, steps) = (model.graph.len(), schedule.steps());
    let memory = model.graph.memory().max(1);
    let recent = &past[past.len().saturating_sub(memory * n)..];
    let mut values = vec![0.0; paths * steps * n];
    let mut outside = vec![0_u64; paths * steps];
    let all =
        values.par_chunks_mut((CHUNK * steps * n).max(1)).zip(outside.par_chunks_mut((CHUNK * steps).max(1)));
    all.enumerate().for_each(|(chunk, (values, outside))| {
        let mut run = Run { model, schedule, rows: Vec::new(), parents: Vec::new(), noise: vec![0.0; n] };
        let own = values.chunks_exact_mut((steps * n).max(1)).zip(outside.chunks_exact_mut(steps.max(1)));
        for (k, (values, outside)) in own.enumerate() {
            if stop() {
                return;
            }
            let path = chunk * CHUNK + k;
            run.path(recent, path, random::at(seed, path, 3), watch.then_some(outside));
            values.copy_from_slice(&run.rows[recent.len()..]);
        }
    });
    Ensemble { n, steps, paths, values, outside }
}

struct Run<'a> {
    model: &'a Directed,
    schedule: &'a Schedule,
    rows: Vec<f64>,
    parents: Vec<f64>,
    noise: Vec<f64>,
}

impl Run<'_> {
    fn path(&mut self, past: &[f64], path: usize, seed: u64, mut outside: Option<&mut [u64]>) {
        let model = self.model;
        let n = model.graph.len();
        let first = past.len() / n;
        let system = &model.members[path % model.members.len()];
        self.rows.clear();
        self.rows.extend_from_slice(past);
        self.rows.resize(past.len() + self.schedule.steps() * n, f64::NAN);
        for step in 0..self.schedule.steps() {
            model.noise.draw(random::at(seed, step, 4), &mut self.noise);
            for &var in &system.order {
                let value = match (self.schedule.value(step, var), &system.equations[var]) {
                    (Some(value), _) => value,
                    (None, None) => f64::NAN,
                    (None, Some(equation)) => {
                        system.parents(&self.rows, first + step, equation, &mut self.parents);
                        if let Some(outside) = outside.as_deref_mut()
                            && let Some(support) = &model.supports[var]
                            && support.is_left(&self.parents)
                        {
                            outside[step] |= bit(var);
                        }
                        equation.mean(&self.parents) + self.noise[var] + self.schedule.moved(step, var)
                    }
                };
                self.rows[(first + step) * n + var] = value;
            }
        }
    }
}

impl Ensemble {
    /// A variable at a step of a path.
    pub(crate) fn at(&self, path: usize, step: usize, var: usize) -> f64 {
        self.values[(path * self.steps + step) * self.n + var]
    }

    /// Mean over the paths.
    pub(crate) fn mean(&self, step: usize, var: usize) -> f64 {
        (0..self.paths).map(|path| self.at(path, step, var)).sum::<f64>() / self.paths as f64
    }

    /// The quantiles `(1 - interval) / 2` and its counterpart.
    pub(crate) fn bounds(&self, step: usize, var: usize, interval: f64) -> (f64, f64) {
        let tail = 0.5 * (1.0 - interval);
        let [low, high] = self.quantiles(step, var, [tail, 1.0 - tail]);
        (low, high)
    }

    /// The values that these shares of the paths lie below.
    pub(crate) fn quantiles<const K: usize>(&self, step: usize, var: usize, shares: [f64; K]) -> [f64; K] {
        let mut values: Vec<f64> = (0..self.paths).map(|path| self.at(path, step, var)).collect();
        values.sort_unstable_by(f64::total_cmp);
        shares.map(|share| quantile(&values, share))
    }

    /// The ends and the middle of the interval of an answer that only the equations make unsure, from what each refit says
    /// ([`interval_of`]): at `level`, at one half, and the mean, as [`Self::quantiles`] of these shares.
    pub(crate) fn of_refits(&self, step: usize, var: usize, level: f64) -> [f64; 5] {
        let values: Vec<f64> = (0..self.paths).map(|path| self.at(path, step, var)).collect();
        let ([low, high], [inner_low, inner_high]) = (interval_of(&values, level), interval_of(&values, 0.5));
        [low, inner_low, self.mean(step, var), inner_high, high]
    }

    /// The part of the paths that at this step ask an equation of `mask` outside its support.
    pub(crate) fn share_outside(&self, step: usize, mask: u64) -> f64 {
        let out = (0..self.paths).filter(|path| self.outside[path * self.steps + step] & mask != 0).count();
        out as f64 / self.paths as f64
    }
}

/// The interval, at this level, of a number that each refit gives: percentiles of some twenty refits lie too near together, so it is that of
/// one more draw from a normal distribution (Student's t).
pub(crate) fn interval_of(values: &[f64], level: f64) -> [f64; 2] {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    if values.len() < 2 {
        return [mean, mean];
    }
    let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0);
    let t = student_t_quantile(0.5 + 0.5 * level, values.len() - 1);
    let reach = t * (variance * (1.0 + 1.0 / count)).sqrt();
    [mean - reach, mean + reach]
}

/// Had I: rows that were observed again, with the noise that they had, under a schedule (abduction, action, prediction: Pearl 2009). The
/// paths are those of equations that the true ones may be, each with the noise that it sees.
/// `rows` begin with `memory` rows that stay.
pub(crate) fn observed_again(model: &Directed, rows: &[f64], memory: usize, schedule: &Schedule) -> Ensemble {
    let (n, steps) = (model.graph.len(), schedule.steps());
    let (mut values, mut outside) = (Vec::new(), Vec::new());
    let mut parents = Vec::new();
    for system in model.plausible() {
        let noise = system.noise(rows, memory);
        let mut path = rows[..memory * n].to_vec();
        system.run(&mut path, schedule, |step, var| noise[step * n + var]);
        for step in 0..steps {
            let mut bits = 0;
            for var in (0..n).filter(|&var| !schedule.is_set(step, var)) {
                if let (Some(equation), Some(support)) = (&system.equations[var], &model.supports[var]) {
                    system.parents(&path, memory + step, equation, &mut parents);
                    bits |= if support.is_left(&parents) { bit(var) } else { 0 };
                }
            }
            outside.push(bits);
        }
        values.extend_from_slice(&path[memory * n..]);
    }
    Ensemble { n, steps, paths: model.plausible().len(), values, outside }
}
