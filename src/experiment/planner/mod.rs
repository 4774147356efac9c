//! `roscausal experiment planner`: does a robot that asks before it drives do better?
//!
//! 1. Exploration (`--train`): the robot drives, and every few seconds a top speed is drawn for it, or its own is left. The data node
//!    records these runs with the columns of the interventions, and a model is found in them.
//! 2. Trial (`--seeds`): the same runs under each policy: always one of the speeds, a rule of distance, and a planner as in
//!    `examples/planner`, which asks the reasoning node twice a second what each speed leads to and takes the best. All nodes are the
//!    real ones, on a lockstep bus.
//!
//! A trial ends at the goal: when the robot has reached so many waypoints. Risk is measured on the simulation itself, at 25 Hz.

mod drive;
mod table;

use std::path::{Path, PathBuf};

use clap::Args as ClapArgs;
use ndarray::Array2;
use roscausal_core::{Error, Result, batch::Table};
use roscausal_discovery::DataFrame;
use roscausal_hrisim::{Scenario, rng::Rng};

use super::{
    model::{self, Trained},
    runner::end,
};
use crate::{interrupt::Interrupt, output};
use drive::{Drive, Nodes, Policy, Question};

/// The variables of the model.
const FEATURES: [&str; 5] =
    ["h_v = h.v", "h_dg = dist(h, h.goal)", "d = dist(h, r)", "r_v = r.v", "h_risk = risk(h, r)"];
/// Speeds between which the planner chooses, m/s.
const SPEEDS: [f64; 3] = [0.2, 0.5, 0.8];
/// Step between rows in seconds.
const DT: f64 = 0.3;
/// Length of an exploration, and of one drawn speed in it, seconds.
const TRAINING_S: f64 = 300.0;
const DRAWN_S: f64 = 6.0;
/// The rule drives slowly within this distance of the person, metres.
const NEAR: f64 = 2.5;
/// Steps ahead that the planner asks about.
const HORIZON: u32 = 10;

/// Arguments of `roscausal experiment planner`.
#[derive(ClapArgs)]
#[command(mut_arg("out", |arg| {
    arg.default_value("roscausal_experiment_planner")
        .help("Folder for model.json, the explorations, trials.csv and table.md")
}))]
pub(super) struct Args {
    /// Waypoints that the robot has to reach.
    #[arg(long, default_value_t = 8)]
    legs: u64,
    /// What the planner's cost counts beside the risk, per m/s of speed: more hurries.
    #[arg(long, default_value_t = 0.2)]
    hurry: f64,
    #[command(flatten)]
    trained: Trained,
}

/// One trial.
struct Trial {
    seed: u64,
    policy: Policy,
    drive: Drive,
}

/// Runs `roscausal experiment planner`.
pub(super) fn run(args: &Args, interrupt: &Interrupt) -> Result<()> {
    let (trained, runner) = (&args.trained, &args.trained.runner);
    let scenario = Scenario::load(&trained.scenario)?;
    let (train, seeds) = trained.seeds("a planner is not tried where it learned")?;
    args.check()?;
    let results = runner.begin(interrupt)?;
    interrupt.remove_at_end(results.temporary());
    let dir = results.folder();
    let explorations = dir.join("exploration");
    let batches = runner.each(&train, "explorations", |seed| {
        let scenario = explored(&scenario, seed)?;
        drive::explore(&scenario, seed, TRAINING_S, &explorations.join(seed.to_string()), interrupt)
    })?;
    let batches: Vec<PathBuf> = batches.into_iter().flatten().collect();
    let rows = batches.iter().map(|path| rows(path)).collect::<Result<_>>()?;
    let found = trained.found(&DataFrame::new(rows, model::names(&FEATURES))?, DT, interrupt)?;
    output::write_model(&dir, &found)?;
    let nodes = Nodes {
        graph: dir.join("model.json"),
        data: batches,
        equations: trained.equations.clone(),
        question: Question { cost: vec![("h_risk", 1.0), ("r_v", -args.hurry)], horizon: HORIZON },
    };
    let policies: Vec<Policy> =
        SPEEDS.map(Policy::Always).into_iter().chain([Policy::Rule, Policy::Planner]).collect();
    let of_seed = |seed: u64| -> Result<Vec<Trial>> {
        let one = |&policy: &Policy| {
            let drive = drive::trial(&scenario, seed, policy, args.legs, &nodes, interrupt)?;
            Ok(Trial { seed, policy, drive })
        };
        policies.iter().map(one).collect()
    };
    let trials: Vec<Trial> = runner.each(&seeds, "trials", of_seed)?.into_iter().flatten().collect();
    let markdown = table::markdown(&policies, &trials);
    let Trained { scenario, train, .. } = trained;
    let (seeds, legs, links) = (seeds.len(), args.legs, model::links(&found));
    let text = format!(
        "{seeds} trials of {legs} waypoints in '{scenario}', with a model of the explorations {train}.\nLinks (lag): {links}.\n\n\
         {markdown}\n"
    );
    let files =
        [("model.json", found.to_file_json()), ("trials.csv", table::csv(&trials)), ("table.md", markdown)];
    end(&runner.out, results, None, &files, &text)
}

impl Args {
    fn check(&self) -> Result<()> {
        Error::ensure((1..=1000).contains(&self.legs), "legs", || {
            format!("{} is not a number of waypoints from 1 to 1000", self.legs)
        })?;
        Error::ensure((0.0..=1e6).contains(&self.hurry), "hurry", || {
            format!("{} is not a number from 0 to 1e6", self.hurry)
        })
    }
}

/// The variables of a batch.
fn rows(path: &Path) -> Result<Array2<f64>> {
    let table = Table::read(path, None)?;
    let column = |name: &String| {
        let found = table.names.iter().position(|known| known == name);
        found.ok_or_else(|| Error::file(path, format!("it has no column '{name}'")))
    };
    let columns = model::names(&FEATURES).iter().map(column).collect::<Result<Vec<usize>>>()?;
    Ok(table.values.select(ndarray::Axis(1), &columns))
}

/// The scenario with a top speed drawn for the robot every few seconds: one of the planner's, or its own.
fn explored(scenario: &Scenario, seed: u64) -> Result<Scenario> {
    let mut rng = Rng::new(seed, 977);
    let mut texts = Vec::new();
    for k in 0..(TRAINING_S / DRAWN_S) as usize {
        // Four equal parts, the last of which is its own speed.
        if let Some(speed) = SPEEDS.get(rng.uniform(0.0, SPEEDS.len() as f64 + 1.0) as usize) {
            texts.push(format!("robot.speed={speed}@{}..{}", k as f64 * DRAWN_S, (k + 1) as f64 * DRAWN_S));
        }
    }
    let mut scenario = scenario.clone();
    scenario.add_interventions(&texts)?;
    Ok(scenario)
}
