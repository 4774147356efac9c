//! The structural model on one directed graph: equations, joint noise, members, support.

use std::sync::{Arc, OnceLock};

use ndarray::Array1;
use rayon::prelude::*;
use roscausal_discovery::{Error, Node, Result};

use super::{
    equation::{Equation, Equations, Fitted, Hyperparameters, fit, spread},
    support::{MOST_ROWS, NEIGHBOURS, Support},
    system::System,
};
use crate::{
    graph::Graph,
    random,
    samples::{Moment, Samples},
};

/// Correlation of two residuals above which they share something.
const SHARED: f64 = 0.2;
/// Joint rows of noise below which each variable's noise is drawn alone.
const FEWEST_JOINT: usize = 30;

roscausal_discovery::with_defaults! {
    /// How a structural model is fitted.
    #[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
    pub struct Settings {
        /// Which equations.
        pub equations: Equations = Equations::Auto,
        /// Refits on bootstraps, which carry the uncertainty of the parameters.
        pub members: usize = 20,
        /// Seed of all random numbers.
        pub seed: u64 = 42,
        /// Whether skill and calibration are measured on the last fifth of the rows.
        pub check: bool = true,
        /// Probability of an interval.
        pub interval: f64 = 0.9,
    }
}

impl Settings {
    /// Checks the settings on their own.
    ///
    /// # Errors
    /// The first that is not allowed, with what is.
    pub fn check(&self) -> Result<()> {
        if !(1..=1000).contains(&self.members) {
            return Err(Error::param("members", format!("{} is not between 1 and 1000", self.members)));
        }
        Error::ensure((0.5..1.0).contains(&self.interval), "interval", || {
            format!("{} is not a probability from 0.5 to below 1, such as 0.9", self.interval)
        })?;
        Ok(())
    }
}

/// What a fit says of one equation.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Summary {
    /// Why there is no equation.
    pub missing: Option<String>,
    /// Rows that trained it.
    pub rows: usize,
    /// The constant of the line.
    pub intercept: f64,
    /// The line's coefficients, by parent.
    pub coefficients: Vec<f64>,
    /// Length scale and noise variance of the Gaussian process on what the line leaves.
    pub process: Option<(f64, f64)>,
    /// Parents that others explain.
    pub dropped: Vec<String>,
    /// Rows that alone decide on a coefficient, such as the only one in which a parent is not 0. They are no part of the noise.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub alone: usize,
    /// Root mean square of the left-out residuals.
    pub rmse: f64,
}

/// Equations on one directed graph.
#[derive(Debug)]
pub struct Directed {
    /// The graph.
    pub graph: Graph,
    /// The equations on all rows.
    pub system: System,
    /// The equations on bootstraps of the rows.
    pub members: Vec<System>,
    draws: Draws,
    /// By variable.
    pub summaries: Vec<Summary>,
    /// By variable.
    pub(crate) supports: Vec<Option<Support>>,
    pub(crate) noise: Noise,
    /// Standard deviation of each variable.
    pub deviations: Vec<f64>,
}

/// Residuals by moment.
#[derive(Debug)]
pub(crate) struct Noise {
    n: usize,
    /// `[row * n + var]`.
    rows: Vec<f64>,
    /// Whether the variables' residuals of one moment stay together.
    joint: bool,
    /// Those of each variable, where they are not joint.
    own: Vec<Vec<f64>>,
    /// Pairs of variables whose residuals are correlated, with the correlation.
    pub(crate) shared: Vec<(usize, usize, f64)>,
}

impl Directed {
    /// Fits the equations of a graph; the hyperparameters of Gaussian processes are searched, or `known`.
    pub(crate) fn fit(
        samples: &Samples,
        graph: &Graph,
        settings: &Settings,
        known: Option<&[Option<Hyperparameters>]>,
    ) -> Result<Self> {
        let moments = samples.moments(graph.memory());
        let equation = |var: usize| {
            let known = known.map(|known| known.get(var).copied().flatten());
            fit(samples, &moments, (var, &graph.names()[var]), graph.parents(var), settings.equations, known)
        };
        let fits: Vec<Found> = (0..graph.len()).into_par_iter().map(equation).collect();
        if fits.iter().all(Found::is_err) {
            let first = fits.into_iter().find_map(Found::err).unwrap_or_default();
            return Err(Error::Data(first));
        }
        let support = |fitted: &Fitted| {
            let kept: Vec<usize> = spread(fitted.rows.len(), MOST_ROWS).collect();
            let pick = |column: &Vec<f64>| kept.iter().map(|&i| column[i]).collect::<Vec<f64>>();
            Support::new(&fitted.columns.iter().map(pick).collect::<Vec<_>>(), NEIGHBOURS)
        };
        let supports = fits.par_iter().map(|fit| fit.as_ref().ok().map(support)).collect();
        let equation = |fit: &Found| fit.as_ref().ok().map(|fit| fit.equation.clone());
        let stretches = stretches(samples, &moments);
        Ok(Self {
            system: system(graph, fits.iter().map(equation).collect()),
            members: members(graph, &fits, &stretches, settings)?,
            summaries: fits.iter().map(|fit| summary(graph, fit)).collect(),
            noise: Noise::new(&fits, moments.len()),
            deviations: deviations(samples),
            graph: graph.clone(),
            supports,
            draws: Draws { fits, stretches, settings: settings.clone(), made: OnceLock::new() },
        })
    }

    /// Equations that the true ones may be, for answers that only the equations make unsure: functions drawn from their posterior. They are
    /// made when they are first asked for. Where only lines are fitted, the members are such.
    pub(crate) fn plausible(&self) -> &[System] {
        if self.draws.settings.equations == Equations::Linear {
            return &self.members;
        }
        self.draws.made.get_or_init(|| self.draws.make(&self.graph))
    }
}

/// An equation, or why there is none.
type Found = std::result::Result<Fitted, String>;

/// What draws of the equations are made of.
#[derive(Debug)]
struct Draws {
    fits: Vec<Found>,
    /// Moments by recording.
    stretches: Vec<usize>,
    settings: Settings,
    made: OnceLock<Vec<System>>,
}

impl Draws {
    fn make(&self, graph: &Graph) -> Vec<System> {
        let members = self.settings.members;
        let mut of_fits: Vec<Vec<Array1<f64>>> = vec![Vec::new(); self.fits.len()];
        for b in 0..members {
            let counts = counts(&self.stretches, &self.settings, b);
            let fits = of_fits.iter_mut().zip(&self.fits);
            fits.for_each(|(of, fit)| of.extend(fit.as_ref().ok().map(|fit| fit.bend_counts(&counts))));
        }
        let of = |(var, (fit, counts)): (usize, (&Found, Vec<Array1<f64>>))| {
            fit.as_ref().ok().map(|fit| fit.drawn(counts, random::at(self.settings.seed, var, 7)))
        };
        let drawn: Vec<_> = self.fits.par_iter().zip(of_fits).enumerate().map(of).collect();
        let one = |b: usize| system(graph, drawn.iter().map(|all| Some(all.as_ref()?[b].clone())).collect());
        (0..members).map(one).collect()
    }
}

/// Whether a file need not say how many.
fn is_zero(count: &usize) -> bool {
    *count == 0
}

fn system(graph: &Graph, equations: Vec<Option<Arc<Equation>>>) -> System {
    System { equations, order: graph.order().to_vec(), memory: graph.memory() }
}

/// Moments by recording.
fn stretches(samples: &Samples, moments: &[Moment]) -> Vec<usize> {
    let mut stretches = vec![0; samples.recordings().len()];
    moments.iter().for_each(|&(recording, _)| stretches[recording] += 1);
    stretches
}

/// How often each moment counts in a moving-block bootstrap.
fn counts(stretches: &[usize], settings: &Settings, b: usize) -> Vec<u32> {
    let block = random::block_length(stretches.iter().sum());
    random::block_counts(random::at(settings.seed, b, 2), stretches, block)
}

/// Refits on moving-block bootstraps of the moments.
fn members(graph: &Graph, fits: &[Found], stretches: &[usize], settings: &Settings) -> Result<Vec<System>> {
    let member = |b: usize| {
        let counts = counts(stretches, settings, b);
        let equation = |fit: &Found| match fit {
            Ok(fit) => fit.resampled(&counts).map(|equation| Some(Arc::new(equation))),
            Err(_) => Ok(None),
        };
        Ok(system(graph, fits.iter().map(equation).collect::<Result<_>>()?))
    };
    (0..settings.members).into_par_iter().map(member).collect()
}

fn summary(graph: &Graph, fit: &Found) -> Summary {
    match fit {
        Err(reason) => Summary { missing: Some(reason.clone()), ..Summary::default() },
        Ok(fit) => Summary {
            missing: None,
            rows: fit.rows.len(),
            intercept: fit.line.intercept,
            coefficients: fit.line.coefficients.clone(),
            process: fit.hyperparameters,
            dropped: fit.dropped.iter().map(|&node: &Node| graph.text(node)).collect(),
            alone: fit.alone,
            rmse: fit.mean_square.sqrt(),
        },
    }
}

fn deviations(samples: &Samples) -> Vec<f64> {
    let n = samples.recordings().first().map_or(0, ndarray::Array2::ncols);
    let of = |var: usize| {
        let columns = samples.recordings().iter().flat_map(|r| r.column(var).to_vec());
        let values: Vec<f64> = columns.filter(|v| v.is_finite()).collect();
        let count = values.len().max(1) as f64;
        let mean = values.iter().sum::<f64>() / count;
        (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / count).sqrt()
    };
    (0..n).map(of).collect()
}

impl Noise {
    fn new(fits: &[Found], moments: usize) -> Self {
        let n = fits.len();
        let residual = |var: usize, m: usize| fits[var].as_ref().map_or(0.0, |fit| fit.residuals[m]);
        let whole = |&m: &usize| (0..n).all(|var| residual(var, m).is_finite());
        let kept: Vec<usize> = (0..moments).filter(whole).collect();
        let rows: Vec<f64> = kept.iter().flat_map(|&m| (0..n).map(move |var| residual(var, m))).collect();
        let joint = kept.len() >= FEWEST_JOINT;
        let alone = |var: usize| {
            (0..moments).map(|m| residual(var, m)).filter(|e| e.is_finite()).collect::<Vec<f64>>()
        };
        let own = if joint { Vec::new() } else { (0..n).map(alone).collect() };
        let column = |var: usize| rows.iter().skip(var).step_by(n).copied().collect::<Vec<f64>>();
        let columns: Vec<Vec<f64>> = (0..n).map(column).collect();
        let linked = |(a, b): (usize, usize)| {
            let r = correlation(&columns[a], &columns[b]);
            (joint && r.abs() > SHARED).then_some((a, b, r))
        };
        let shared = (0..n).flat_map(|a| (a + 1..n).map(move |b| (a, b))).filter_map(linked).collect();
        Self { n, rows, joint, own, shared }
    }

    /// The noise of one moment, drawn by a random number, into `drawn`.
    pub(crate) fn draw(&self, number: u64, drawn: &mut [f64]) {
        if self.joint {
            let row = random::below(number, self.rows.len() / self.n) * self.n;
            drawn.copy_from_slice(&self.rows[row..row + self.n]);
            return;
        }
        for (var, (value, own)) in drawn.iter_mut().zip(&self.own).enumerate() {
            *value =
                if own.is_empty() { 0.0 } else { own[random::below(random::at(number, var, 0), own.len())] };
        }
    }
}

fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().max(1) as f64;
    let (mean_a, mean_b) = (a.iter().sum::<f64>() / n, b.iter().sum::<f64>() / n);
    let product =
        |f: &dyn Fn(f64, f64) -> f64| a.iter().zip(b).map(|(x, y)| f(x - mean_a, y - mean_b)).sum::<f64>();
    let scale = (product(&|x, _| x * x) * product(&|_, y| y * y)).sqrt();
    if scale > 0.0 { product(&|x, y| x * y) / scale } else { 0.0 }
}
