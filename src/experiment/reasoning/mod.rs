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

use clap::Args as ClapArgs;
use ndarray::Array2;
use rayon::prelude::*;
use roscausal_core::{Error, Result, threads};
use roscausal_discovery::{DataFrame, Model};
use roscausal_hrisim::Scenario;
use roscausal_reasoning::{
    Facts, Settings as Fit, StructuralModel, default_intervention_targets, graph::Graph,
};

use super::{
    model::{self, Trained},
    runner::end,
};
use crate::interrupt::Interrupt;
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
#[command(mut_arg("scenario", |arg| arg.default_value("guide")), mut_arg("train", |arg| arg.default_value("1..8")))]
#[command(mut_arg("out", |arg| {
    arg.default_value("roscausal_experiment_reasoning").help("Folder for model.json, cases.csv and figures.json")
}))]
pub(super) struct Args {
    /// Moments at which the actions begin, in seconds.
    #[arg(long, value_delimiter = ',', default_values_t = [60.0, 99.9, 140.1, 180.0, 219.9])]
    starts: Vec<f64>,
    #[command(flatten)]
    trained: Trained,
}

/// Runs `roscausal experiment reasoning`.
pub(super) fn run(args: &Args, interrupt: &Interrupt) -> Result<()> {
    let (trained, runner) = (&args.trained, &args.trained.runner);
    let scenario = Scenario::load(&trained.scenario)?;
    args.check()?;
    let (train, seeds) = trained.seeds("a model is not tried on what it was fitted on")?;
    let results = runner.begin(interrupt)?;
    let training = runner
        .each(&train, "walks", |seed| walk(&scenario, seed, TRAINING_S, interrupt).map(|walk| walk.rows))?;
    let (found, model) = fitted(trained, &training, interrupt)?;
    let twins =
        runner.each(&seeds, "twin runs", |seed| Twins::of_seed(&scenario, seed, &args.starts, interrupt))?;
    let correlation = asked::Correlation::of(&training);
    let twins: Vec<Twins> = twins.into_iter().flatten().collect();
    let ask = |one: &Twins| Case::ask(&model, one, &correlation);
    let cases: Vec<Option<Case>> =
        threads::in_pool(runner.workers()?, || twins.par_iter().map(ask).collect::<Result<_>>())?;
    let cases: Vec<Case> = cases.into_iter().flatten().collect();
    if cases.is_empty() {
        return Err(Error::Data(format!("the walks {} reach none of the moments; give more", trained.train)));
    }
    let figures = Figures::of(&cases, &deviations(&training), twins.len());
    let json = serde_json::to_string_pretty(&figures).map_err(|e| Error::Data(e.to_string()))? + "\n";
    let files = [("cases.csv", tables::csv(&cases)), ("figures.json", json)];
    end(&runner.out, results, Some(&found), &files, &format!("{}\n", tables::text(&figures, &found, trained)))
}

impl Args {
    fn check(&self) -> Result<()> {
        let latest = 3600.0;
        let bad = |start: &&f64| !(10.0..=latest).contains(*start);
        if let Some(start) = self.starts.iter().find(bad) {
            return Err(Error::param("starts", format!("{start} is not a moment from 10 to {latest} s")));
        }
        let reason = "there is none; give a moment in seconds, such as 60";
        Error::ensure(!self.starts.is_empty(), "starts", || reason)?;
        Ok(())
    }
}

/// The graph that discovery finds in the walks, and the structural model on it.
fn fitted(
    trained: &Trained,
    walks: &[Array2<f64>],
    interrupt: &Interrupt,
) -> Result<(Model, StructuralModel)> {
    let data = DataFrame::new(walks.to_vec(), names())?;
    let found = trained.found(&data, DT, interrupt)?;
    let graph = Graph::of_model(&found, &[])?;
    let fit = Fit { equations: trained.equations.parse()?, ..Fit::default() };
    let model = StructuralModel::fit(&data, &graph, &fit, &default_intervention_targets())?;
    let facts = Facts::of_model(&found);
    Ok((found, model.with_facts(facts)))
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
