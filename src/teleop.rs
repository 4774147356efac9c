//! `roscausal teleop`: drive the person from the keyboard, in real time, while the nodes record.

use std::{path::PathBuf, thread, time::Instant};

use clap::Args as ClapArgs;
use roscausal_core::{Error, Result, Time, loopback::Loopback, middleware::Middleware, nodes, params::Value};
use roscausal_hrisim::{
    Scenario, Simulation,
    node::{Options, hrisim},
    teleop::teleop,
};

/// Arguments of `roscausal teleop`.
#[derive(ClapArgs)]
pub(crate) struct Args {
    /// Scenario: a built-in name or a TOML file.
    #[arg(long, default_value = "thor")]
    scenario: String,
    /// Seed of the simulation.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Maximum length of the run in seconds.
    #[arg(long, default_value_t = 300.0)]
    duration: f64,
    /// Intervene, such as `robot.speed=0.2@60..90`; may be given several times.
    #[arg(long = "do", value_name = "WHAT@FROM..TO")]
    interventions: Vec<String>,
    /// Length of a batch in seconds.
    #[arg(long, default_value_t = 150.0)]
    ts_length: f64,
    /// Folder for the batches.
    #[arg(long, value_name = "DIR", default_value = "roscausal_teleop")]
    out: PathBuf,
}

/// Runs `roscausal teleop`.
pub(crate) fn run(args: &Args) -> Result<()> {
    let mut scenario = Scenario::load(&args.scenario)?;
    scenario.duration = args.duration;
    scenario.add_interventions(&args.interventions)?;
    let simulation = Simulation::new(&scenario, args.seed)?;
    let begin = Instant::now();
    let bus = Loopback::live(move || Time::from_secs_f64(1.0 + begin.elapsed().as_secs_f64()));
    crate::nodes::set_subjects(&bus, &simulation);
    let folder = |name: &str| Value::Str(args.out.join(name).display().to_string());
    for (name, value) in [
        ("data_dir", folder("data_pool")),
        ("pp_data_dir", folder("pp_pool")),
        ("ts_length", Value::Double(args.ts_length)),
        ("risk_lag", Value::Int(1)),
    ] {
        bus.set_node_param("data", name, value);
    }
    let recording = ["robot", "human", "data"].map(|name| bus.start(name, move |mw| nodes::run(name, &mw)));
    let recording = recording.into_iter().collect::<Result<Vec<_>>>()?;
    let (world, driver) = (bus.node("hrisim"), bus.node("teleop"));
    let simulating = thread::spawn({
        let (world, driver) = (world.clone(), driver.clone());
        move || {
            let done = hrisim(&world, simulation, &Options::default()).map(drop);
            driver.shutdown();
            done
        }
    });
    let drove = teleop(&driver);
    world.shutdown();
    bus.shutdown();
    let died = |_| Error::Middleware("a node died; please report it".into());
    simulating.join().map_err(died)??;
    recording.into_iter().try_for_each(|thread| thread.join().map_err(died)?)?;
    drove?;
    say!("{}: batches in data_pool and pp_pool (roscausal discover {0}/pp_pool/*.csv)", args.out.display());
    Ok(())
}
