//! `roscausal demo`: the simulator and the four nodes in one process, and the model at the end.

use std::{
    path::{Path, PathBuf},
    sync::{Arc, atomic::AtomicBool, mpsc::Receiver},
    time::{Duration, Instant},
};

use clap::Args as ClapArgs;
use roscausal_core::{Error, Result, Time, ensure, loopback::Loopback, params::Value};
use roscausal_discovery::{Model, Progress, Settings};
use roscausal_hrisim::{
    Scenario, Simulation,
    node::{Publisher, run_lockstep},
    picture::Film,
};

use crate::{
    chart,
    discover::{Analysis, MeansArgs, MethodArgs, ResampleArgs},
    expected, flags,
    folders::{EVIDENCE, Folders, Outcome},
    html_report::{self, Material, quoted},
    interrupt::Interrupt,
    nodes::{self, Nodes},
    output, presets, reasoning,
    replay::{Pace, Speed},
    report,
    sink::{Sink, SinkArgs},
    web::{Web, WebArgs},
};

/// Step of the demo's batches in seconds.
const DT: f64 = 0.3;
/// Noise on the exponent of the risk, as in the authors' published result.
const RISK_NOISE: f64 = 0.02;
/// Seconds of the run that the animation shows.
const FILM_S: f64 = 120.0;

/// Batches that the demo records and analyses together, as two recordings of one system.
const BATCHES: u32 = 2;
/// Seconds simulated in addition to the batches, until every topic has begun.
const WARM_UP_S: f64 = 3.0;
/// Longest run with a live page, in seconds.
const ENDLESS_S: f64 = 1e7;
/// Time between two checks of the results.
const LOOK_AGAIN: Duration = Duration::from_millis(50);
/// If the analysis shows no sign of life for this long, something is wrong.
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
    #[arg(long, default_value = "encounters")]
    scenario: String,
    /// Intervene, such as `robot.speed=0.2@60..90`, `robot.off@60..90`, `human.v=1.0@60..90`, `human.goal=3,-4@60..90`
    /// (seconds of simulated time); may be given several times.
    #[arg(long = "do", value_name = "WHAT@FROM..TO")]
    interventions: Vec<String>,
    #[command(flatten)]
    method: MethodArgs,
    #[command(flatten)]
    resample: ResampleArgs,
    #[command(flatten)]
    means: MeansArgs,
    /// Folder for batches, model and pictures.
    #[arg(short, long, value_name = "DIR", default_value = "roscausal_demo", help_heading = "Output")]
    out: PathBuf,
    #[command(flatten)]
    sink: SinkArgs,
    #[command(flatten)]
    web: WebArgs,
    /// With --web: how many times faster than real time the simulation runs; `max`: as fast as the machine allows.
    #[arg(long, default_value = "5", requires = "web", help_heading = "Nodes and page")]
    speed: Speed,
}

/// Runs `roscausal demo`.
pub(crate) fn run(args: &Args, interrupt: &Interrupt) -> Result<()> {
    let run = Run::of(args)?;
    let record = args.sink.claim()?;
    if args.web.web {
        return run.watch(record, interrupt);
    }
    let Args { scenario, duration, seed, .. } = args;
    say!("Simulating '{scenario}' for {duration} s (seed {seed}), recording two batches ...");
    let (folders, model) = run.recorded_chain(record, interrupt)?;
    // What is found is written as a whole.
    interrupt.writing();
    show(args, &folders, &model)
}

/// The demo for other programs: what `roscausal demo --seed SEED --out OUT` does, without its text.
///
/// # Errors
/// A folder that cannot be written, a run that gives no model, or cancellation by `cancel`.
pub fn run_demo(seed: u64, out: &Path, cancel: Arc<AtomicBool>) -> Result<Model> {
    let usual = flags::parsed(["demo"]).map_err(|error| Error::Data(error.to_string()))?;
    let args = Args { seed, out: out.to_owned(), ..usual };
    let (folders, model) = Run::of(&args)?.recorded_chain(None, &Interrupt::on(cancel))?;
    write(&folders, &model).and_then(|()| folders.keep()).map_err(|error| folders.named(error))?;
    Ok(model)
}

impl Args {
    /// The command that makes the same run again.
    fn command(&self, model: &Model) -> String {
        let Self { scenario, seed, duration, interventions, .. } = self;
        let (scenario, analysis) = (quoted(scenario), html_report::flags(model));
        let done: String = interventions.iter().map(|text| format!(" --do {}", quoted(text))).collect();
        // The seed of the analysis is fixed; the one given is that of the simulation.
        format!("roscausal demo --scenario {scenario} --seed {seed} --duration {duration}{done} {analysis}")
    }
}

/// One run of simulator and nodes, from the first message to the model.
struct Run<'a> {
    args: &'a Args,
    analysis: Analysis,
}

impl<'a> Run<'a> {
    fn of(args: &'a Args) -> Result<Self> {
        nodes::check_seed(args.seed)?;
        let analysis = Analysis::of(&args.method, &args.means, &args.resample, Settings::default().seed)?;
        Ok(Self { args, analysis })
    }

    fn simulation(&self, duration: f64) -> Result<Simulation> {
        let mut scenario = Scenario { duration, ..Scenario::load(&self.args.scenario)? };
        scenario.add_interventions(&self.args.interventions)?;
        Simulation::new(&scenario, self.args.seed)
    }

    /// Simulates, records two batches and analyses them. The files of the nodes are in the folder in which the run works, where
    /// the caller keeps them; without a model they are kept here. What is published is also recorded in the file `record`.
    fn recorded_chain(&self, record: Option<&Path>, interrupt: &Interrupt) -> Result<(Folders, Model)> {
        let duration = self.args.duration;
        Error::ensure((20.0..=1e6).contains(&duration), "duration", || {
            format!("{duration} is not a number of seconds from 20 to 1000000")
        })?;
        let simulation = self.simulation(duration + WARM_UP_S)?;
        let folders = Folders::begin(&self.args.out, &[], interrupt)?;
        let ended = self.chain(simulation, &folders, record, interrupt);
        match ended.map_err(|error| folders.named(error))? {
            Ok(model) => Ok((folders, model)),
            Err(error) => folders.keep().and(Err(folders.named(error))),
        }
    }

    /// The model of the run, or why there is none although the nodes ended well.
    fn chain(
        &self,
        simulation: Simulation,
        folders: &Folders,
        record: Option<&Path>,
        interrupt: &Interrupt,
    ) -> Result<Result<Model>> {
        let bus = Loopback::lockstep();
        nodes::set_subjects(&bus, &simulation);
        self.set_parameters(&bus, folders, BATCHES)?;
        presets::write(&folders.dir, &nodes::carried(&bus)?)?;
        let (nodes, progress) = Nodes::start(&bus, &nodes::RECORDING).with_discovery();
        let mut sink = Sink::open(&bus, record)?;
        // Every topic exists before its first message.
        let announced = Publisher::new(&bus.node("announcement"), &simulation)?;
        sink.watch()?;
        drop(announced);

        let recorded = simulate(&bus, simulation, interrupt, Speed::Max, Some(&folders.dir))
            .and_then(|()| self.check_batches(nodes.batches_recorded()));
        let found = recorded.and_then(|()| await_model(folders, &nodes, &progress, interrupt));
        if interrupt.is_set() {
            nodes.end_early(|| sink.close(), interrupt)?;
            return Ok(found);
        }
        // A node that failed is the reason why there is no model.
        nodes.end()?;
        bus.settle();
        sink.close()?;
        Ok(found)
    }

    /// Whether there are the batches that the analysis waits for; each begins when robot and person are there together.
    fn check_batches(&self, recorded: u64) -> Result<()> {
        let (scenario, length) = (&self.args.scenario, self.args.duration / f64::from(BATCHES));
        Error::ensure_data(recorded >= u64::from(BATCHES), || {
            format!(
                "scenario '{scenario}' gave {recorded} of the {BATCHES} batches of {length} s to analyse: its first robot and first \
                 person are not there together for long enough; see its robots and people"
            )
        })
    }

    /// Runs until the user ends it, with a live page: one model for each batch.
    fn watch(&self, record: Option<&Path>, interrupt: &Interrupt) -> Result<()> {
        let simulation = self.simulation(ENDLESS_S)?;
        let folders = Folders::begin(&self.args.out, &[], interrupt)?;
        let ended = self.live(simulation, &folders, record, interrupt);
        let simulated = ended.map_err(|error| folders.named(error))?;
        say!("{}: {} models, batches", self.args.out.display(), folders.keep()?.model_files()?.len());
        match simulated {
            Err(Error::Cancelled(_)) => Ok(()),
            other => other,
        }
    }

    /// The run with a live page: how the simulation ended, although the nodes ended well.
    fn live(
        &self,
        simulation: Simulation,
        folders: &Folders,
        record: Option<&Path>,
        interrupt: &Interrupt,
    ) -> Result<Result<()>> {
        let bus = Loopback::lockstep();
        nodes::set_subjects(&bus, &simulation);
        self.set_parameters(&bus, folders, 1)?;
        let web = Web::start(&bus, &self.args.web, nodes::first_robot(&simulation))?;
        let (nodes, _progress) = Nodes::start(&bus, &nodes::RECORDING).with_discovery();
        let nodes = nodes.with_reasoning(true);
        let mut sink = Sink::open(&bus, record)?;
        let announced = Publisher::new(&bus.node("announcement"), &simulation)?;
        sink.watch()?;
        drop(announced);
        let simulated = simulate(&bus, simulation, interrupt, self.args.speed, None);
        nodes.end_early(|| sink.close(), interrupt)?;
        web.map_or(Ok(()), Web::end)?;
        Ok(simulated)
    }

    /// Sets the nodes' parameters as a launch file would.
    fn set_parameters(&self, bus: &Loopback, folders: &Folders, batches: u32) -> Result<()> {
        nodes::set_pools(bus, &folders.raw, &folders.processed);
        let set = |name: &str, value: Value| bus.set_node_param("data", name, value);
        set("ts_length", Value::Double(self.args.duration / f64::from(BATCHES)));
        set("dt", Value::Double(DT));
        // The risk as in the authors' published result.
        set("risk_model", Value::Str("v1_1".into()));
        set("risk_lag", Value::Int(1));
        set("risk_noise", Value::Double(RISK_NOISE));
        set("seed", Value::Int(i64::try_from(self.args.seed).unwrap_or(0)));
        nodes::set_discovery(bus, folders, &self.analysis, batches)
    }
}

/// Runs the simulation to its end. Unless it is endless, shows a progress bar and writes an animation to `out`.
fn simulate(
    bus: &Loopback,
    mut simulation: Simulation,
    interrupt: &Interrupt,
    speed: Speed,
    out: Option<&Path>,
) -> Result<()> {
    let mut pace = Pace::new(speed);
    let bar = chart::bar("recording", simulation.scenario().duration as u64, out.is_none());
    let mut film = Film::default();
    run_lockstep(bus, &mut simulation, 1, |simulation| {
        bar.set_position(simulation.time() as u64);
        film.take(simulation);
        pace.wait(Time::from_secs_f64(simulation.time()), || !interrupt.is_set());
        !interrupt.is_set()
    })?;
    bar.finish_and_clear();
    if let Some(out) = out {
        output::write_file(out, "run.svg", film.svg(&simulation, FILM_S).as_bytes())?;
    }
    ensure(!interrupt.is_set(), || Error::Cancelled("by the user; what was recorded is kept".into()))
}

fn await_model(
    folders: &Folders,
    nodes: &Nodes,
    progress: &Receiver<Progress>,
    interrupt: &Interrupt,
) -> Result<Model> {
    let bar = chart::bar("discovery", 0, false);
    let mut last_sign = Instant::now();
    loop {
        if let Some(progress) = progress.try_iter().last() {
            chart::show(&bar, progress);
            last_sign = Instant::now();
        }
        let ended = nodes.one_has_ended() || last_sign.elapsed() > PATIENCE;
        ensure(!ended, || Error::file(&folders.processed, "no analysis came to its end"))?;
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

fn write(folders: &Folders, model: &Model) -> Result<()> {
    output::write_model(&folders.dir, model)?;
    for (i, batch) in folders.analysed_batches()?.iter().enumerate() {
        let table = roscausal_core::batch::Table::read(batch, None)?;
        let (name, dt) = (format!("series_{}", i + 1), table.dt());
        let units = output::units_beside(batch);
        output::write_series(&folders.dir, &name, &table.names, &units, table.values.view(), dt)?;
    }
    Ok(())
}

/// Writes what a look at the model needs: the report and the evidence.
fn write_report(args: &Args, folders: &Folders, model: &Model) -> Result<()> {
    let evidence = folders.evidence()?;
    if let Some(evidence) = &evidence {
        output::write_file(&folders.dir, EVIDENCE, evidence.to_json().as_bytes())?;
    }
    let material = Material {
        model: model.clone(),
        evidence,
        name: format!("scenario {}", args.scenario),
        command: args.command(model),
        batches: Vec::new(),
    };
    html_report::write_into(&folders.dir, &material)
}

fn show(args: &Args, folders: &Folders, model: &Model) -> Result<()> {
    let written = write(folders, model).and_then(|()| write_report(args, folders, model));
    crate::terminal::print_text(&format!("{}\n\n", report::text(model)));
    crate::terminal::print_text(&format!("{}\n\n", expected::comparison(model)));
    let folders = written.and_then(|()| folders.keep()).map_err(|error| folders.named(error))?;
    say!(
        "{}: batches, model.json, evidence.json, model.dot, model.graphml, links.csv, dag.svg, dag.png, dag.pdf, \
         tsdag.svg, tsdag.png, tsdag.pdf, run.svg",
        args.out.display()
    );
    say!("");
    let (path, batches) = (args.out.join("model.json"), folders.analysed_batches()?);
    let asked = reasoning::closing(model, &path, &batches, args.means.threads);
    // A model that answers nothing is a result, too.
    let asked = asked
        .unwrap_or_else(|error| format!("The model answers no question here: {}.", flags::sentence(&error)));
    crate::terminal::print_text(&format!("{asked}\n\n"));
    let report = args.out.join(html_report::REPORT);
    say!("Open {} in a browser: the graph, and the evidence of each link.", report.display());
    Ok(())
}
