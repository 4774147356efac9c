//! TiMINo: time series models with independent noise.
//!
//! Source: Peters, Janzing and Schölkopf 2013, NeurIPS, "Causal inference on time series using restricted structural equation
//! models".
//!
//! 1. Each variable is regressed on its own past and on the present and past of all others. What is left of a variable that causes
//!    none of the others does not depend on them, neither on their past nor on what comes after.
//! 2. The variable whose rest depends least on the others is put last in the causal order, and taken out; the same again with those
//!    that remain. Where every rest depends on something, the variables that remain are undecided: something hidden drives some of
//!    them, a cause lies within a cycle, or the model does not fit.
//! 3. A variable's causes are those before it in the order without which its rest would depend on the others.
//!
//! Example: `b = a(t-1)^2 + noise`. What the past of `a` leaves of `b` is noise; what the past of `b` leaves of `a` is `a`, on which
//! the next `b` depends. So `b` is last, and `a` is its cause.

use std::collections::BTreeSet;

use rayon::prelude::*;

use super::result::{PcmciResult, Status};
use crate::{
    independence_tests::{TestSettings, dependence, gp_residuals},
    numeric::{
        least_squares::LeastSquares,
        rows::{is_constant, moments, units},
    },
    types::{CompleteRows, Control, DataFrame, Error, LinkMark, Named, Node, Result, SampleCount, Samples},
};

/// How a variable follows from its causes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum TiminoModel {
    /// Linear effects, by least squares. Its noise must not be Gaussian where effects are at lag 0.
    #[default]
    Linear,
    /// Effects of any smooth form, by a Gaussian process.
    GaussianProcess,
}

impl TiminoModel {
    /// The model that an independence test has: `parcorr` is linear, `gpdc` a Gaussian process.
    ///
    /// ```
    /// use roscausal_discovery::methods::TiminoModel;
    ///
    /// assert_eq!(TiminoModel::of_test("gpdc")?, TiminoModel::GaussianProcess);
    /// assert!(TiminoModel::of_test("cmiknn").is_err());
    /// # Ok::<(), roscausal_discovery::Error>(())
    /// ```
    ///
    /// # Errors
    /// Any other test.
    pub fn of_test(name: &str) -> Result<Self> {
        match name {
            "parcorr" => Ok(Self::Linear),
            "gpdc" => Ok(Self::GaussianProcess),
            other => Err(Error::param(
                "test",
                format!(
                    "timino regresses, and {other} is not a regression; take parcorr for linear effects, gpdc for others"
                ),
            )),
        }
    }
}

with_defaults! {
    /// Settings of [`run_timino`].
    ///
    /// ```
    /// use roscausal_discovery::methods::{TiminoModel, TiminoSettings};
    ///
    /// let settings = TiminoSettings { model: TiminoModel::GaussianProcess, ..TiminoSettings::default() };
    /// assert_eq!((settings.tau_min, settings.tau_max), (0, 1));
    /// ```
    #[derive(Clone, Debug)]
    pub struct TiminoSettings {
        /// Smallest lag at which one variable may act on another. Default 0.
        pub tau_min: usize = 0,
        /// Largest lag, at least 1. Default 1.
        pub tau_max: usize = 1,
        /// Level at which a rest counts as dependent on the other variables, all lags together. Default 0.05.
        pub alpha_level: f64 = 0.05,
        /// How a variable follows from its causes. Default: linear.
        pub model: TiminoModel = TiminoModel::default(),
        /// Variables that may be causes only.
        pub exogenous: Vec<usize> = Vec::new(),
        /// How a Gaussian process is searched for, and how much memory it may take.
        pub test: TestSettings = TestSettings::default(),
    }
}

/// What [`run_timino`] finds.
#[derive(Clone, Debug)]
pub struct TiminoResult {
    /// The links. Value and p-value at each lag are the distance correlation, and its p-value, of the cause there with what is left
    /// of the effect when this cause is left out of its model; a cause has links at the lags at the level, or at the strongest one
    /// if none is. A variable's own past is in every model, and no link.
    pub links: PcmciResult,
    /// Variables in their causal order as far as it was found, the last one first; then `undecided` would come.
    pub last_first: Vec<usize>,
    /// Variables of which none could be put last: nothing is said of links among them.
    pub undecided: Vec<usize>,
    /// For each variable the smallest p-value of its rest with the others, times their number and lags, when it was put last.
    pub p_values: Vec<f64>,
}

/// TiMINo: which variable drives which, from models whose noise must be independent, or that this cannot be said.
///
/// Take it where effects are not linear or the noise is far from Gaussian, and where "undecided" is a better answer than a wrong
/// one: a hidden common cause of two variables leaves no model with independent noise, so no link among them is claimed. The
/// variables' means in each recording are taken off first. The answer is a summary graph: that `a` drives `b` is the claim, the lags
/// are those at which it shows.
///
/// ```
/// use roscausal_discovery::{Control, DataFrame, methods::{TiminoSettings, run_timino}};
///
/// // `b` follows `a` within a step, `c` follows `b` a step later; the noise is uniform.
/// let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0) - 0.5;
/// let mut values = ndarray::Array2::from_shape_fn((400, 3), |(t, v)| noise(3 * t + v));
/// for t in 1..400 {
///     values[[t, 1]] += 0.8 * values[[t, 0]];
///     values[[t, 2]] += 0.8 * values[[t - 1, 1]];
/// }
/// let data = DataFrame::new(vec![values], ["a", "b", "c"].map(String::from).to_vec())?;
/// let found = run_timino(&data, &TiminoSettings::default(), &Control::default())?;
/// assert_eq!(found.last_first, [2, 1, 0]);
/// assert!(found.links.graph[[0, 1, 0]].is_link() && found.links.graph[[1, 2, 1]].is_link());
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
///
/// # Errors
/// Settings that do not match, fewer complete samples than coefficients, variables that determine each other, or cancellation.
/// Running out of time is not an error: the status says so, and what is left is undecided.
pub fn run_timino(data: &DataFrame, settings: &TiminoSettings, control: &Control) -> Result<TiminoResult> {
    settings.check()?;
    let n_vars = data.n_vars();
    let of_data = Samples::new(data, 2 * settings.tau_max).len();
    let scalars = data.of_scalars("timino")?;
    let centred = scalars.scaled(&units(scalars)).centred();
    let rows = Samples::new(&centred, 2 * settings.tau_max).complete();
    let models = Models { data, rows, settings, control };
    models.check()?;
    let mut result = TiminoResult {
        links: PcmciResult::untested(n_vars, settings.tau_max, of_data),
        last_first: Vec::new(),
        undecided: Vec::new(),
        p_values: vec![1.0; n_vars],
    };
    match models.order(&mut result).and_then(|()| models.causes(&mut result)) {
        Err(error) if control.is_timeout(&error) => {
            let how_far = format!("the time budget ended the search after {} models", result.links.n_tests);
            result.links.status = Status::Partial(how_far);
        }
        ended => ended?,
    }
    if result.links.status == Status::Complete && !result.undecided.is_empty() {
        result.links.remarks.push(format!(
            "undecided: {}; whichever of them is taken as an effect of the others, what is left of it depends on them: something \
             hidden drives them, they drive each other within a sample, or the model does not fit",
            data.listed(result.undecided.iter().copied())
        ));
    }
    Ok(result)
}

impl TiminoSettings {
    fn check(&self) -> Result<()> {
        Error::ensure(self.tau_max > 0, "tau_max", || "0 leaves no past; give at least 1")?;
        Error::check_lags(self.tau_min, self.tau_max)
    }
}

/// Models of variables by others, on the samples of one run. The present of a sample is at lag `tau_max` of its rows, so that what
/// comes after it is there, too.
struct Models<'a> {
    data: &'a DataFrame,
    rows: CompleteRows,
    settings: &'a TiminoSettings,
    control: &'a Control,
}

/// What the rest of a variable has to do with another variable: at each lag of the rows.
type WithOther = Vec<(f64, f64)>;

impl Models<'_> {
    fn check(&self) -> Result<()> {
        let of_one = self.settings.tau_max + 1 - self.settings.tau_min;
        let needed = self.settings.tau_max + (self.rows.n_vars - 1) * of_one + 2;
        let (rows, causes, flag) = (self.rows.len(), needed - 2, Named("tau_max"));
        Error::ensure_data(rows >= needed, || {
            format!(
                "{rows} complete samples are too few for {causes} causes of each variable: record at least {needed}, or lower {flag}"
            )
        })
    }

    /// What a model of `effect` by its own past and by `causes` leaves of it.
    fn rest(&self, effect: usize, causes: &BTreeSet<usize>) -> Result<Vec<f64>> {
        self.control.check()?;
        let (now, TiminoSettings { tau_min, tau_max, .. }) = (self.settings.tau_max, self.settings);
        let own = (1..=*tau_max).map(|lag| Node::new(effect, now + lag));
        let lagged = |&var: &usize| (*tau_min..=*tau_max).map(move |lag| Node::new(var, now + lag));
        let nodes = own.chain(causes.iter().flat_map(lagged));
        let columns: Vec<&[f64]> =
            nodes.map(|node| self.rows.column(node)).filter(|column| !is_constant(column)).collect();
        let target = self.rows.column(Node::new(effect, now));
        if is_constant(target) {
            return Ok(target.to_vec());
        }
        let rest = match self.settings.model {
            TiminoModel::Linear => {
                let fit = LeastSquares::new(&columns, &[target], true);
                let mut rest = target.to_vec();
                for (k, column) in columns.iter().enumerate() {
                    let coefficient = fit.coefficient(0, k);
                    rest.iter_mut().zip(*column).for_each(|(left, x)| *left -= coefficient * x);
                }
                rest
            }
            TiminoModel::GaussianProcess => {
                gp_residuals(target, &columns, &self.settings.test, &|| self.control.check())?
            }
        };
        let (_, deviation) = moments(&rest);
        let (_, whole) = moments(target);
        if deviation > NOTHING * whole {
            return Ok(rest);
        }
        Err(Error::Data(format!(
            "{} determine each other, so they have no causal order; leave all but one of them out",
            self.data.listed(causes.iter().copied().chain([effect]))
        )))
    }

    /// How a rest depends on another variable: value and p-value at each lag of the rows.
    fn with(&self, rest: &[f64], other: usize) -> WithOther {
        let lags = 0..=2 * self.settings.tau_max;
        lags.map(|lag| dependence(rest, self.rows.column(Node::new(other, lag)))).collect()
    }

    /// The smallest p-value of a rest with any of `others` at any lag, times their number.
    fn smallest_p(&self, rest: &[f64], others: &BTreeSet<usize>) -> f64 {
        let all: Vec<usize> = others.iter().copied().collect();
        let smallest =
            |&other: &usize| self.with(rest, other).into_iter().map(|(_, p)| p).fold(1.0, f64::min);
        let least = all.par_iter().map(smallest).reduce(|| 1.0, f64::min);
        (least * (all.len() * (2 * self.settings.tau_max + 1)) as f64).min(1.0)
    }

    /// Puts variables last, one after the other, as long as the rest of one is independent of those that remain.
    fn order(&self, result: &mut TiminoResult) -> Result<()> {
        let is_exogenous = |var: &usize| self.settings.exogenous.contains(var);
        let mut left: BTreeSet<usize> = (0..self.rows.n_vars).collect();
        result.undecided = left.iter().copied().filter(|var| !is_exogenous(var)).collect();
        while left.len() > 1 && !result.undecided.is_empty() {
            let candidates = result.undecided.clone();
            let p_of = |&var: &usize| -> Result<f64> {
                let others: BTreeSet<usize> = left.iter().copied().filter(|other| *other != var).collect();
                Ok(self.smallest_p(&self.rest(var, &others)?, &others))
            };
            let p_values = candidates.par_iter().map(p_of).collect::<Result<Vec<f64>>>()?;
            self.count(result, candidates.len());
            // The first one on ties.
            let best = p_values.iter().enumerate().rev().max_by(|a, b| a.1.total_cmp(b.1));
            let Some((at, &p)) = best.filter(|(_, p)| **p > self.settings.alpha_level) else { return Ok(()) };
            let last = candidates[at];
            left.remove(&last);
            result.undecided.retain(|var| *var != last);
            result.last_first.push(last);
            result.p_values[last] = p;
        }
        result.last_first.append(&mut result.undecided);
        Ok(())
    }

    /// The causes of each variable among those before it.
    fn causes(&self, result: &mut TiminoResult) -> Result<()> {
        let mut before: BTreeSet<usize> = (0..self.rows.n_vars).collect();
        for effect in result.last_first.clone() {
            before.remove(&effect);
            let others = before.clone();
            let mut causes = before.clone();
            // The least needed one goes first; then all are asked again.
            loop {
                let asked: Vec<usize> = causes.iter().copied().collect();
                let without = |&cause: &usize| -> Result<(f64, Vec<f64>)> {
                    let fewer: BTreeSet<usize> = causes.iter().copied().filter(|var| *var != cause).collect();
                    let rest = self.rest(effect, &fewer)?;
                    Ok((self.smallest_p(&rest, &others), rest))
                };
                let found = asked.par_iter().map(without).collect::<Result<Vec<_>>>()?;
                self.count(result, asked.len());
                let least = asked.iter().zip(&found).rev().max_by(|a, b| a.1.0.total_cmp(&b.1.0));
                match least {
                    Some((&cause, (p, _))) if *p > self.settings.alpha_level => causes.remove(&cause),
                    _ => {
                        let shown = asked.iter().zip(&found);
                        shown.for_each(|(&cause, (_, rest))| self.show(result, cause, effect, rest));
                        break;
                    }
                };
            }
        }
        Ok(())
    }

    /// Writes down a cause, at the lags at which the rest without it depends on it.
    fn show(&self, result: &mut TiminoResult, cause: usize, effect: usize, rest: &[f64]) {
        let with = self.with(rest, cause);
        let lags = self.settings.tau_min..=self.settings.tau_max;
        let samples = SampleCount { used: self.rows.len(), lost: self.rows.n_lost };
        let mut strongest = (f64::NEG_INFINITY, self.settings.tau_min);
        let mut any = false;
        for lag in lags {
            let (value, p) = with[self.settings.tau_max + lag];
            let at = [cause, effect, lag];
            result.links.put(at, value, p, Some(samples));
            if value > strongest.0 {
                strongest = (value, lag);
            }
            if p <= self.settings.alpha_level {
                any = true;
                mark(result, cause, effect, lag);
            }
        }
        if !any {
            mark(result, cause, effect, strongest.1);
        }
    }

    fn count(&self, result: &mut TiminoResult, n: usize) {
        result.links.n_tests += n;
        self.control.count(n);
    }
}

/// A rest of this share of its variable is what rounding leaves.
const NOTHING: f64 = 1e-10;

fn mark(result: &mut TiminoResult, cause: usize, effect: usize, lag: usize) {
    result.links.graph[[cause, effect, lag]] = LinkMark::Forward;
    if lag == 0 {
        result.links.graph[[effect, cause, 0]] = LinkMark::Backward;
        result.links.copy([cause, effect, 0], [effect, cause, 0]);
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;
    use crate::numeric::random::mix;

    /// Uniform noise of variance 1.
    fn noise(seed: u64, i: usize) -> f64 {
        12_f64.sqrt() * (mix(seed * 1_000_003 + i as u64) as f64 / u64::MAX as f64 - 0.5)
    }

    fn frame(values: Array2<f64>) -> DataFrame {
        let names = ["a", "b", "c", "d"].iter().take(values.ncols()).map(|name| (*name).to_owned()).collect();
        DataFrame::new(vec![values], names).unwrap()
    }

    fn run(data: &DataFrame, settings: &TiminoSettings) -> TiminoResult {
        run_timino(data, settings, &Control::default()).unwrap()
    }

    /// Runs of twelve seeds in which the answer is right; the level lets one in twenty steps fail.
    fn right(is_right: impl Fn(u64) -> bool) -> usize {
        (1..=12).filter(|&seed| is_right(seed)).count()
    }

    #[test]
    fn a_hidden_common_cause_leaves_its_effects_undecided() {
        let n = right(|seed| {
            let mut values = Array2::from_shape_fn((400, 2), |(t, v)| noise(seed, 3 * t + v));
            (0..400).for_each(|t| {
                let hidden = noise(seed, 3 * t + 2);
                values[[t, 0]] = 0.3 * values[[t, 0]] + hidden;
                values[[t, 1]] = 0.3 * values[[t, 1]] + 1.5 * hidden.abs();
            });
            let found = run(&frame(values), &TiminoSettings::default());
            let reported = found.links.remarks.iter().any(|remark| remark.starts_with("undecided: a, b;"));
            reported && found.undecided == [0, 1] && found.links.graph.iter().all(|mark| !mark.is_link())
        });
        assert!(n >= 10, "{n}");
    }

    #[test]
    fn a_square_is_seen_by_a_gaussian_process_and_not_by_a_line() {
        let system = |seed: u64| {
            let mut values = Array2::from_shape_fn((250, 2), |(t, v)| noise(seed, 2 * t + v));
            (1..250).for_each(|t| values[[t, 1]] = values[[t - 1, 0]].powi(2) + 0.4 * values[[t, 1]]);
            frame(values)
        };
        let of = |model| TiminoSettings { model, tau_min: 1, ..TiminoSettings::default() };
        let n = right(|seed| {
            let curve = run(&system(seed), &of(TiminoModel::GaussianProcess));
            let line = run(&system(seed), &of(TiminoModel::Linear));
            curve.links.graph[[0, 1, 1]].is_link()
                && !curve.links.graph[[1, 0, 1]].is_link()
                && line.undecided.len() == 2
        });
        assert!(n >= 10, "{n}");
    }

    #[test]
    fn an_exogenous_variable_is_never_an_effect() {
        let mut values = Array2::from_shape_fn((300, 2), |(t, v)| noise(5, 2 * t + v));
        (1..300).for_each(|t| values[[t, 1]] += values[[t - 1, 0]]);
        let found = run(&frame(values), &TiminoSettings { exogenous: vec![1], ..TiminoSettings::default() });
        assert!(found.links.graph.iter().all(|mark| !mark.is_link()), "{:?}", found.links.graph);
        assert_eq!(found.undecided, [0]);
    }

    #[test]
    fn what_cannot_be_ordered_is_one_sentence() {
        let values = Array2::from_shape_fn((100, 2), |(t, v)| noise(7, t + 500 * v));
        let twice = frame(values.clone()).select(&[0, 0, 1]);
        let error =
            run_timino(&twice, &TiminoSettings::default(), &Control::default()).unwrap_err().to_string();
        assert!(error.contains("determine each other"), "{error}");
        let short = frame(values.slice(ndarray::s![..8, ..]).to_owned());
        let error = run_timino(
            &short,
            &TiminoSettings { tau_max: 2, ..TiminoSettings::default() },
            &Control::default(),
        );
        assert!(error.unwrap_err().to_string().contains("too few for"));
    }

    #[test]
    fn a_used_up_time_budget_leaves_the_rest_undecided() {
        let values = Array2::from_shape_fn((100, 3), |(t, v)| noise(9, 3 * t + v));
        let control = Control::default().out_of_time(|| true);
        let found = run_timino(&frame(values), &TiminoSettings::default(), &control).unwrap();
        assert!(matches!(found.links.status, Status::Partial(_)) && found.undecided.len() == 3);
    }
}
