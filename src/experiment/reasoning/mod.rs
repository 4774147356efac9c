//! `roscausal experiment reasoning`: are the answers true?
//!
//! Two runs of the simulator with the same seed are equal to the last bit until an action begins, sensor noise included. So their
//! difference is the true effect of the action in that single case, and the second run is what would have happened.
//!
//! 1. A model is found and fitted on walks in which nobody intervenes (`--train`).
//! 2. Other walks (`--seeds`) are run with and without each action, from several moments on.
//! 3. The model is asked about each, and its answers are set beside what came about, and beside a regression of the outcome on the
//!    robot's speed: the correlational answer.

mod asked;
mod figures;
mod tables;
mod twins;

use std::path::PathBuf;

use clap::Args as ClapArgs;
use ndarray::Array2;
use rayon::prelude::*;
use roscausal_core::{Error, Result};
use roscausal_discovery::{DataFrame, Model};
use roscausal_hrisim::Scenario;
use roscausal_reasoning::{
    Facts, Settings as Fit, StructuralModel, default_intervention_targets, graph::Graph, model::Equations,
};

use super::{grid, in_order, model, workers};
use crate::{interrupt::Interrupt, output, results::Results};
use asked::Case;
use figures::Figures;
use twins::{Twins, walk};

/// The variables of the experiment.
const FEATURES: [&str; 4] = ["h_v = h.v", "h_dg = dist(h, h.goal)", "d = dist(h, r)", "r_v = r.v"];
/// The variable that is acted on, and those that are judged; numbers of [`FEATURES`].
const ACTING: usize = 3;
const JUDGED: [usize; 2] = [0, 2];
/// Name and intervention of each action.
const ACTIONS: [(&str, &str); 2] = [("stop", "robot.off"), ("slow", "robot.speed=0.4")];
/// Step between rows in seconds, and length of a walk for the fit.
const DT: f64 = 0.3;
const TRAINING_S: f64 = 300.0;
/// Steps that are judged, and steps for which support is asked.
const STEPS: usize = 10;
const REACH: usize = 20;

/// Arguments of `roscausal experiment reasoning`.
#[derive(ClapArgs)]
pub(super) struct Args {
    /// Scenario of one person and one robot: a built-in name or a TOML file.
    #[arg(long, default_value = "guide")]
    scenario: String,
    /// Seeds of the walks on which the model is found and fitted, including both ends; nobody intervenes.
    #[arg(long, default_value = "1..2", value_name = "A..B")]
    train: String,
    /// Seeds of the walks in which it is tried, including both ends.
    #[arg(long, default_value = "101..120", value_name = "A..B")]
    seeds: String,
    /// Moments at which the actions begin, in seconds.
    #[arg(long, value_delimiter = ',', default_values_t = [60.0, 99.9, 140.1, 180.0, 219.9])]
    starts: Vec<f64>,
    /// Discovery method.
    #[arg(long, default_value = "pcmci")]
    method: String,
    /// Independence test.
    #[arg(long, default_value = "parcorr")]
    test: String,
    /// Largest lag, in samples.
    #[arg(long, default_value_t = 2)]
    tau_max: usize,
    /// Equations: auto (a Gaussian process where it predicts better than a line), linear, gp.
    #[arg(long, default_value = "auto", value_parser = ["auto", "linear", "gp"])]
    equations: String,
    /// Runs at a time; default: one per core. They do not change the results.
    #[arg(long)]
    threads: Option<usize>,
    /// Folder for model.json, cases.csv and figures.json.
    #[arg(short, long, value_name = "DIR", default_value = "roscausal_experiment_reasoning")]
    out: PathBuf,
}

/// Runs `roscausal experiment reasoning`.
pub(super) fn run(args: &Args, interrupt: &Interrupt) -> Result<()> {
    interrupt.nothing_at_stake("nothing is written before the end");
    let scenario = Scenario::load(&args.scenario)?;
    args.check()?;
    let train = grid::seeds(&args.train)?;
    let seeds = grid::seeds(&args.seeds)?;
    model::apart(&train, &seeds, "a model is not tried on what it was fitted on")?;
    let workers = workers(args.threads)?;
    let results = Results::begin(&args.out, None, &[])?;
    let training = in_order(&train, workers, "walks", |seed| {
        walk(&scenario, *seed, TRAINING_S, interrupt).map(|walk| walk.rows)
    })?;
    let (found, model) = args.fitted(&training, interrupt)?;
    let twins = in_order(&seeds, workers, "twin runs", |seed| {
        Twins::of_seed(&scenario, *seed, &args.starts, interrupt)
    })?;
    let correlation = asked::Correlation::of(&training);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(workers)
        .build()
        .map_err(|e| Error::param("threads", e))?;
    let twins: Vec<Twins> = twins.into_iter().flatten().collect();
    let cases: Vec<Case> = pool.install(|| {
        twins.par_iter().map(|one| Case::ask(&model, one, &correlation)).collect::<Result<_>>()
    })?;
    let figures = Figures::of(&cases, &deviations(&training));
    let mut json = serde_json::to_string_pretty(&figures).map_err(|e| Error::Data(e.to_string()))?;
    json.push('\n');
    results.write(|dir| {
        output::write_model(dir, &found)?;
        output::write_file(dir, "cases.csv", tables::csv(&cases).as_bytes())?;
        output::write_file(dir, "figures.json", json.as_bytes()).map(drop)
    })?;
    crate::terminal::print_text(&format!("{}\n", tables::text(&figures, &found, args)));
    crate::terminal::say!("{}: model.json, cases.csv, figures.json", args.out.display());
    Ok(())
}

impl Args {
    fn check(&self) -> Result<()> {
        let latest = 3600.0;
        let bad = |start: &&f64| !(10.0..=latest).contains(*start);
        if let Some(start) = self.starts.iter().find(bad) {
            return Err(Error::param("starts", format!("{start} is not a moment from 10 to {latest} s")));
        }
        if self.starts.is_empty() {
            return Err(Error::param("starts", "there is none; give a moment in seconds, such as 60"));
        }
        Ok(())
    }

    /// The graph that discovery finds in the walks, and the structural model on it.
    fn fitted(&self, walks: &[Array2<f64>], interrupt: &Interrupt) -> Result<(Model, StructuralModel)> {
        let data = DataFrame::new(walks.to_vec(), names())?;
        let found = model::found(&data, (&self.method, &self.test), self.tau_max, DT, interrupt)?;
        let equations = match self.equations.as_str() {
            "linear" => Equations::Linear,
            "gp" => Equations::Gp,
            _ => Equations::Auto,
        };
        let graph = Graph::of_model(&found, &[])?;
        let fit = Fit { equations, ..Fit::default() };
        let model = StructuralModel::fit(&data, &graph, &fit, &default_intervention_targets())?;
        let facts = Facts::of_model(&found);
        Ok((found, model.with_facts(facts)))
    }
}

/// Names of the variables.
fn names() -> Vec<String> {
    model::names(&FEATURES)
}

/// Standard deviation of each variable in the walks for the fit: errors of all are added up in these units.
fn deviations(walks: &[Array2<f64>]) -> Vec<f64> {
    let deviation = |var: usize| {
        let all: Vec<f64> =
            walks.iter().flat_map(|walk| walk.column(var).to_vec()).filter(|x| x.is_finite()).collect();
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        (all.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / all.len() as f64).sqrt()
    };
    (0..FEATURES.len()).map(deviation).collect()
}
