//! `roscausal experiment`: runs the whole chain over seeds and settings, and counts how often each link is found; whether answers
//! of reasoning are true; and whether a planner that asks does better.

mod changes;
mod day;
mod grid;
mod model;
mod planner;
mod reasoning;
mod recordings;
mod report;
mod runner;
mod runs;

use std::path::{Path, PathBuf};

use clap::{Args as ClapArgs, Subcommand};
use indicatif::ProgressBar;
use roscausal_core::{Error, Result, threads};
use roscausal_discovery::{PcAlpha, Settings};
use roscausal_hrisim::Scenario;

use crate::{chart, discover::ResampleArgs, interrupt::Interrupt, results::Results};
use grid::{Grid, Setting};
use recordings::record;
use runner::Runner;
use runs::{Common, Run};

/// The recommended scenario, its controls, and the length to record.
const RECOMMENDED: [&str; 3] = ["encounters", "encounters_ignored", "encounters_unslowed"];
const RECOMMENDED_LENGTH: f64 = 300.0;

/// Arguments of `roscausal experiment`.
#[derive(ClapArgs)]
#[command(args_conflicts_with_subcommands = true)]
pub(crate) struct Args {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    sweep: Sweep,
}

#[derive(Subcommand)]
enum Command {
    /// Are answers of reasoning true? Twin runs with and without an action, beside what the model says of it.
    Reasoning(reasoning::Args),
    /// Does a robot that asks what-if before it drives do better? Risk and time to the goal, with and without.
    Planner(planner::Args),
    /// How soon is a change told that nobody announced, and how often one that is not there?
    Changes(changes::Args),
    /// Does a robot do more of its tasks that knows where and when people will be? Working days, by who decides.
    Day(day::Args),
    /// Join the results of several `--shard`s, or of several experiments, into one folder.
    Merge {
        /// Folders that `roscausal experiment --out` made.
        #[arg(required = true, value_name = "DIR")]
        from: Vec<PathBuf>,
        /// Folder for the joined runs, tables and plots.
        #[arg(short, long, value_name = "DIR", default_value = "roscausal_experiment")]
        out: PathBuf,
    },
}

/// What to run. Each factor takes a list of values, separated by commas. The first values are the base; one factor
/// at a time takes its other values (with `--cross`, every combination is run).
#[derive(ClapArgs)]
#[command(mut_arg("out", |arg| arg.help(
    "Folder for recall.csv, scores.csv, runs.csv, plots, and one file per run; a run whose file exists is not repeated"
)))]
struct Sweep {
    /// The recommended scenario and its two negative controls at the recommended length; nothing else varies.
    #[arg(long, conflicts_with_all = ["scenarios", "lengths", "steps", "risk_models", "risk_lags", "methods", "tests"])]
    default: bool,
    /// Scenarios: built-in names or TOML files.
    #[arg(long, alias = "scenario", value_delimiter = ',', default_value = "encounters")]
    scenarios: Vec<String>,
    /// Seconds recorded.
    #[arg(long, value_delimiter = ',', default_values_t = [300.0, 75.0, 150.0, 600.0])]
    lengths: Vec<f64>,
    /// Seconds between samples.
    #[arg(long, value_delimiter = ',', default_values_t = [0.3, 0.1, 0.2, 0.5, 1.0])]
    steps: Vec<f64>,
    /// Versions of the risk: v1_1, v1_0, paper.
    #[arg(long, value_delimiter = ',', default_values_t = ["v1_1", "v1_0", "paper"].map(str::to_owned))]
    risk_models: Vec<String>,
    /// Samples by which the risk is lagged: 0 or 1.
    #[arg(long, value_delimiter = ',', default_values_t = [1, 0])]
    risk_lags: Vec<usize>,
    /// Discovery methods.
    #[arg(long, alias = "method", value_delimiter = ',', default_values_t = ["fpcmci", "pcmci"].map(str::to_owned))]
    methods: Vec<String>,
    /// Independence tests.
    #[arg(long, alias = "test", value_delimiter = ',', default_values_t = ["gpdc", "parcorr"].map(str::to_owned))]
    tests: Vec<String>,
    /// Intervene in every run, such as `robot.speed=0.2@60..90`; may be given several times.
    #[arg(long = "do", value_name = "WHAT@FROM..TO")]
    interventions: Vec<String>,
    /// Run every combination of the values.
    #[arg(long)]
    cross: bool,
    /// Standard deviation of the noise on the risk's exponent (0.02 in the authors' published data).
    #[arg(long, default_value_t = 0.02)]
    risk_noise: f64,
    /// Significance level of a link, in (0, 1).
    #[arg(long, default_value_t = 0.05)]
    alpha: f64,
    /// Level of the condition selection, in (0, 1); default: the method's own.
    #[arg(long)]
    pc_alpha: Option<f64>,
    /// Largest lag, in samples.
    #[arg(long, default_value_t = 1)]
    tau_max: usize,
    #[command(flatten)]
    resample: ResampleArgs,
    /// Do only one part of the work, such as 2/8; join the folders with `roscausal experiment merge`.
    #[arg(long, value_name = "I/N", hide_short_help = true)]
    shard: Option<String>,
    #[command(flatten)]
    runner: Runner,
}

/// Runs `roscausal experiment`.
pub(crate) fn run(args: &Args, interrupt: &Interrupt) -> Result<()> {
    // The files of runs are no part of the set: a sweep goes on with them.
    let begin = |out: &Path| Results::begin(out, Some(true), &[]);
    let (out, results, runs) = match &args.command {
        Some(Command::Reasoning(args)) => return reasoning::run(args, interrupt),
        Some(Command::Planner(args)) => return planner::run(args, interrupt),
        Some(Command::Changes(args)) => return changes::run(args, interrupt),
        Some(Command::Day(args)) => return day::run(args, interrupt),
        Some(Command::Merge { from, out }) => (out, begin(out)?, merge(from, out)?),
        None => {
            interrupt.nothing_at_stake("finished runs are kept");
            let out = &args.sweep.runner.out;
            (out, begin(out)?, args.sweep.run(interrupt)?)
        }
    };
    runner::end(out, results, None, &report::files(&runs)?, &format!("{}\n\n", report::text(&runs)))
}

/// Copies the runs of all folders into one.
fn merge(from: &[PathBuf], out: &Path) -> Result<Vec<Run>> {
    for folder in from {
        Run::all(folder)?.iter().try_for_each(|run| run.write(out))?;
    }
    Run::all(out)
}

/// One simulation, and the settings that are analysed on it.
struct Job {
    scenario: Scenario,
    seed: u64,
    settings: Vec<Setting>,
}

impl Sweep {
    fn grid(&self) -> Result<Grid> {
        let mut grid = Grid {
            scenarios: self.scenarios.clone(),
            lengths: self.lengths.clone(),
            steps: self.steps.clone(),
            risk_models: self.risk_models.clone(),
            risk_lags: self.risk_lags.clone(),
            methods: self.methods.iter().map(|name| name.parse()).collect::<std::result::Result<_, _>>()?,
            tests: self.tests.clone(),
        };
        if self.default {
            grid.scenarios = RECOMMENDED.map(str::to_owned).to_vec();
            grid.lengths = vec![RECOMMENDED_LENGTH];
            grid.steps.truncate(1);
            grid.risk_models.truncate(1);
            grid.risk_lags.truncate(1);
            grid.methods.truncate(1);
            grid.tests.truncate(1);
        }
        Ok(grid)
    }

    fn analysis(&self) -> Result<Settings> {
        Error::ensure((0.0..=10.0).contains(&self.risk_noise), "risk-noise", || {
            format!("{} is not a number from 0 to 10", self.risk_noise)
        })?;
        let settings = Settings {
            alpha: self.alpha,
            pc_alpha: self.pc_alpha.map_or(PcAlpha::Default, PcAlpha::Fixed),
            tau_max: self.tau_max,
            ..Settings::default()
        };
        settings.check()?;
        Ok(settings)
    }

    /// Does the missing runs. Returns all runs of this sweep that exist then.
    fn run(&self, interrupt: &Interrupt) -> Result<Vec<Run>> {
        let (grid, analysis) = (self.grid()?, self.analysis()?);
        grid.check(&analysis)?;
        let common = Common {
            analysis,
            resampling: self.resample.asked()?,
            risk_noise: self.risk_noise,
            out: self.runner.out.clone(),
        };
        let jobs = self.jobs(&grid)?;
        let paths = |job: &Job| -> Vec<PathBuf> {
            job.settings.iter().map(|setting| common.path(setting, &job.scenario, job.seed)).collect()
        };
        let all: Vec<PathBuf> = jobs.iter().flat_map(paths).collect();
        let bar = chart::bar("runs", all.len() as u64, false);
        self.runner.work_off(&jobs, |job| job.run(&common, &bar, interrupt))?;
        bar.finish_and_clear();
        all.iter().filter_map(|path| Run::read(path).transpose()).collect()
    }

    /// One job per scenario and seed, only those of this shard.
    fn jobs(&self, grid: &Grid) -> Result<Vec<Job>> {
        let (i, n) = self.shard.as_deref().map_or(Ok((1, 1)), grid::shard)?;
        let settings = grid.settings(self.cross);
        let mut jobs = Vec::new();
        for name in &grid.scenarios {
            let mut scenario = Scenario::load(name)?;
            scenario.add_interventions(&self.interventions)?;
            scenario.check()?;
            let settings: Vec<Setting> = settings.iter().filter(|s| s.scenario == *name).cloned().collect();
            for seed in self.runner.seeds()? {
                jobs.push(Job { scenario: scenario.clone(), seed, settings: settings.clone() });
            }
        }
        Ok(jobs.into_iter().skip(i - 1).step_by(n).collect())
    }
}

impl Job {
    /// Simulates once, and analyses the recording with each setting that has no run yet.
    fn run(&self, common: &Common, bar: &ProgressBar, interrupt: &Interrupt) -> Result<()> {
        let is_open = |setting: &&Setting| {
            let done = matches!(Run::read(&common.path(setting, &self.scenario, self.seed)), Ok(Some(_)));
            bar.inc(u64::from(done));
            !done
        };
        let open: Vec<&Setting> = self.settings.iter().filter(is_open).collect();
        let mut steps: Vec<f64> = open.iter().map(|setting| setting.step).collect();
        steps.sort_by(f64::total_cmp);
        steps.dedup();
        let longest = open.iter().map(|setting| setting.length).fold(0.0, f64::max);
        if open.is_empty() {
            return Ok(());
        }
        let recorded = record(&self.scenario, self.seed, longest, &steps, interrupt)?;
        // One thread per analysis: run times are those of one core.
        for setting in open {
            let place = steps.iter().position(|step| *step == setting.step).unwrap_or(0);
            threads::in_pool(1, || {
                common.analyse(setting, &self.scenario, self.seed, &recorded[place], interrupt)
            })?;
            bar.inc(1);
        }
        Ok(())
    }
}
