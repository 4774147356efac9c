//! `roscausal demo`: simulator and the four nodes in one process; the model at the end.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::mpsc,
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use clap::Args as ClapArgs;
use roscausal_core::{
    Error, Result, Time,
    batch::Table,
    discovery::{Model, Progress},
    loopback::Loopback,
    middleware::Middleware,
    nodes,
    params::Value,
};
use roscausal_hrisim::{Publisher, Scenario, Simulation};

use crate::{chart, discover::MethodArgs, expected, interrupt::Interrupt, output, report};

/// Batches that the demo records and analyses together.
const BATCHES: u32 = 2;
/// Step of the batches in seconds.
const DT: f64 = 0.3;

/// Arguments of `roscausal demo`.
#[derive(ClapArgs)]
pub(crate) struct Args {
    /// Seed of the simulation.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Seconds to simulate, recorded as two batches.
    #[arg(long, default_value_t = 300.0)]
    duration: f64,
    /// Scenario: a built-in name or a file.
    #[arg(long, default_value = "thor")]
    scenario: String,
    #[command(flatten)]
    method: MethodArgs,
    /// Folder for batches, model and pictures.
    #[arg(long, value_name = "DIR", default_value = "roscausal_demo")]
    out: PathBuf,
}

/// Runs `roscausal demo`.
pub(crate) fn run(args: &Args, interrupt: &Interrupt) -> Result<()> {
    let settings = args.method.settings(args.method.default_seed())?;
    if !(args.duration >= 2.0 * f64::from(BATCHES)) || args.duration > 1e6 {
        return Err(Error::param("duration", format!("{} is not a number of seconds from 4 to 1e6", args.duration)));
    }
    let scenario = Scenario::find(&args.scenario)?;
    println!("Simulating {} s of '{}' (seed {}) ...", args.duration, args.scenario, args.seed);
    let folders = Folders::fresh(&args.out)?;
    let bus = Loopback::lockstep();
    set_parameters(&bus, &folders, args)?;
    let (progress, on_progress) = mpsc::channel();
    let nodes = Nodes::start(&bus, progress);

    let recorded = record(&bus, scenario, args, interrupt);
    nodes.end_recording();
    recorded?;
    let found = await_model(&folders, &on_progress, interrupt);
    nodes.end();
    let mut model = found?;
    model.run_time_s = None;
    drop(settings);
    show(args, &folders, &model)
}
