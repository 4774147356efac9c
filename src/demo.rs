//! `roscausal demo`: the simulator and the four nodes in one process; the model at the end.

mod folders;
mod nodes;

use std::{
    path::PathBuf,
    sync::mpsc::Receiver,
    time::{Duration, Instant},
};

use clap::Args as ClapArgs;
use indicatif::ProgressBar;
use roscausal_core::{
    Error, Result,
    discovery::{Model, Progress, analysis::Settings},
    loopback::Loopback,
};
use roscausal_hrisim::{Scenario, Simulation, node::run_lockstep};

use crate::{chart, discover::MethodArgs, expected, interrupt::Interrupt, output, report};
use folders::{Folders, Outcome};
use nodes::Nodes;

/// Batches that the demo records and analyses together, as two recordings of one system.
const BATCHES: u32 = 2;
/// Seconds simulated beyond the batches, until every topic has begun.
const WARM_UP_S: f64 = 3.0;
/// Between two looks at the results.
const LOOK_AGAIN: Duration = Duration::from_millis(50);
/// Without any sign of the analysis for so long, something is wrong.
const PATIENCE: Duration = Duration::from_secs(600);

/// Arguments of `roscausal demo`.
#[derive(ClapArgs)]
pub(crate) struct Args {
    /// Seed of the simulation.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Seconds to record, as two batches.
    #[arg(long, default_value_t = 300.0)]
    duration: f64,
    /// Scenario: a built-in name or a TOML file.
    #[arg(long, default_value = "thor")]
    scenario: String,
    #[command(flatten)]
    method: MethodArgs,
    /// Threads of the analysis; default: all cores. The result does not depend on it.
    #[arg(long)]
    threads: Option<usize>,
    /// Folder for batches, model and pictures.
    #[arg(long, value_name = "DIR", default_value = "roscausal_demo")]
    out: PathBuf,
}

/// Runs `roscausal demo`.
pub(crate) fn run(args: &Args, interrupt: &Interrupt) -> Result<()> {
    let run = Run {
        scenario: args.scenario.clone(),
        seed: args.seed,
        duration: args.duration,
        settings: args.method.settings(Settings::default().seed)?,
        threads: args.threads,
        out: args.out.clone(),
        quiet: false,
    };
    println!(
        "Simulating '{}' for {} s (seed {}), recording two batches ...",
        args.scenario, args.duration, args.seed
    );
    let (folders, model) = run.whole_chain(interrupt)?;
    show(args, &folders, &model)
}

/// One run of simulator and nodes, from the first message to the model.
pub(crate) struct Run {
    pub(crate) scenario: String,
    pub(crate) seed: u64,
    /// Seconds to record.
    pub(crate) duration: f64,
    pub(crate) settings: Settings,
    pub(crate) threads: Option<usize>,
    pub(crate) out: PathBuf,
    pub(crate) quiet: bool,
}

impl Run {
    /// Simulates, records two batches and analyses them; what the nodes wrote stays in `out`.
    pub(crate) fn whole_chain(&self, interrupt: &Interrupt) -> Result<(Folders, Model)> {
        if !(20.0..=1e6).contains(&self.duration) {
            let reason = format!("{} is not a number of seconds from 20 to 1000000", self.duration);
            return Err(Error::param("duration", reason));
        }
        let mut scenario = Scenario::load(&self.scenario)?;
        scenario.duration = self.duration + WARM_UP_S;
        let simulation = Simulation::new(&scenario, self.seed)?;
        let folders = Folders::fresh(&self.out)?;
        let bus = Loopback::lockstep();
        let ts_length = self.duration / f64::from(BATCHES);
        nodes::set_parameters(&bus, &folders, &self.settings, ts_length, self.threads);
        let (nodes, progress) = Nodes::start(&bus)?;

        let recorded = record(&bus, simulation, interrupt, self.quiet);
        let found = recorded.and_then(|()| await_model(&folders, &nodes, &progress, interrupt, self.quiet));
        // A node that failed is the reason why there is no model.
        nodes.end()?;
        Ok((folders, found?))
    }
}

/// Runs the simulation to its end, as fast as the machine allows.
fn record(bus: &Loopback, mut simulation: Simulation, interrupt: &Interrupt, quiet: bool) -> Result<()> {
    let total = simulation.scenario().duration;
    let bar = chart::bar("recording", total as u64, quiet);
    run_lockstep(bus, &mut simulation, 1, |simulation| {
        bar.set_position(simulation.time() as u64);
        !interrupt.is_set()
    })?;
    bar.finish_and_clear();
    if interrupt.is_set() {
        return Err(Error::Cancelled("by the user; what was recorded is kept".into()));
    }
    Ok(())
}

fn await_model(
    folders: &Folders,
    nodes: &Nodes,
    progress: &Receiver<Progress>,
    interrupt: &Interrupt,
    quiet: bool,
) -> Result<Model> {
    let bar: ProgressBar = chart::bar("discovery", 0, quiet);
    let mut last_sign = Instant::now();
    loop {
        if let Some(progress) = progress.try_iter().last() {
            bar.set_length(progress.estimated_total as u64);
            bar.set_position(progress.done as u64);
            last_sign = Instant::now();
        }
        if nodes.one_has_ended() || last_sign.elapsed() > PATIENCE {
            return Err(Error::Data(format!(
                "no analysis came to its end; see {}",
                folders.processed.display()
            )));
        }
        match folders.outcome()? {
            Outcome::Waiting if interrupt.is_set() => {
                return Err(Error::Cancelled("by the user; the batches stay in the pool".into()));
            }
            Outcome::Waiting => std::thread::sleep(LOOK_AGAIN),
            Outcome::Model(model) => {
                bar.finish_and_clear();
                return Ok(*model);
            }
            Outcome::Rejected(reason) => return Err(Error::Data(reason)),
        }
    }
}

fn show(args: &Args, folders: &Folders, model: &Model) -> Result<()> {
    output::write_model(&args.out, model)?;
    for (i, batch) in folders.analysed_batches()?.iter().enumerate() {
        let table = roscausal_core::batch::Table::read(batch, None)?;
        output::write_series(
            &args.out,
            &format!("series_{}", i + 1),
            &table.names,
            table.values.view(),
            table.dt(),
        )?;
    }
    println!("{}\n", report::text(model));
    println!("{}\n", expected::comparison(model));
    println!(
        "{}: batches, model.json, links.csv, dag.svg, dag.png, tsdag.svg, tsdag.png",
        args.out.display()
    );
    Ok(())
}
