//! `roscausal experiment changes`: how soon a change is told that nobody announced, and how often one that is not there.
//!
//! Each seed is one run: the scenario as it is, and then under an action. What the nodes record of it is cut into batches, and the
//! detector reads them as the discovery node does. What it confirms before the action is a false alarm; so is all that it
//! confirms if there is no action, or an announced one.

use std::fmt::Write;

use clap::Args as ClapArgs;
use ndarray::Array2;
use roscausal_core::{Error, Result, batch::Recording};
use roscausal_discovery::{
    Control,
    changes::{ChangeEvent, Detector, Form, Levels, Status},
};
use roscausal_hrisim::{Intervention, Scenario, Simulation};

use super::{
    grid::within,
    recordings,
    runner::{Runner, end},
    runs,
};
use crate::interrupt::Interrupt;

/// Noise on the risk's exponent, as in the demo.
const RISK_NOISE: f64 = 0.02;
/// How long a waiting robot is looked for, in seconds.
const LOOKED_FOR_S: f64 = 600.0;
/// A robot waits where it is slower than this (m/s) and nearer to a waypoint than this (m).
const WAITS: (f64, f64) = (1e-3, 0.3);

/// Arguments of `roscausal experiment changes`.
#[derive(ClapArgs)]
#[command(mut_arg("out", |arg| arg.default_value("roscausal_experiment_changes").help("Folder for changes.csv")))]
pub(super) struct Args {
    /// Scenario of one person and one robot: a built-in name or a TOML file.
    #[arg(long, default_value = "pass_by_the_centre")]
    scenario: String,
    /// The action, without times, such as `robot.off`. Without one nothing changes: all that is told is a false alarm.
    #[arg(long = "do", value_name = "WHAT")]
    action: Option<String>,
    /// The action begins when the first robot next waits at a waypoint.
    #[arg(long, requires = "action")]
    waiting: bool,
    /// Announce the action, as an experimenter would.
    #[arg(long, requires = "action")]
    announced: bool,
    /// Seconds before the action.
    #[arg(long, default_value_t = 3000.0)]
    before: f64,
    /// Seconds after it.
    #[arg(long, default_value_t = 1200.0)]
    after: f64,
    /// Seconds of a batch.
    #[arg(long, default_value_t = 300.0)]
    ts_length: f64,
    /// Seconds between rows.
    #[arg(long, default_value_t = 0.3)]
    dt: f64,
    /// Rows that are compared at a time; 0: each batch as a whole.
    #[arg(long, default_value_t = 0)]
    change_rows: usize,
    /// Independence test; gpdc and cmiknn compare curves, the others slopes.
    #[arg(long, default_value = "parcorr")]
    test: String,
    /// Largest lag, in samples.
    #[arg(long, default_value_t = 1)]
    tau_max: usize,
    #[command(flatten)]
    runner: Runner,
}

/// What one run tells.
struct Reported {
    seed: u64,
    /// Moment of the action and of the end, in seconds of the recording.
    action: Option<f64>,
    end: f64,
    /// Confirmed events, and the second of the recording at which each was told.
    events: Vec<(ChangeEvent, f64)>,
}

/// Runs `roscausal experiment changes`.
pub(super) fn run(args: &Args, interrupt: &Interrupt) -> Result<()> {
    let scenario = Scenario::load(&args.scenario)?;
    args.check()?;
    let seeds = args.runner.seeds()?;
    let results = args.runner.begin(interrupt)?;
    let reported = args.runner.each(&seeds, "runs", |seed| args.one(&scenario, seed, interrupt))?;
    let files = [("changes.csv", args.csv(&reported))];
    end(&args.runner.out, results, None, &files, &format!("{}\n", args.text(&reported)))
}

impl Args {
    fn check(&self) -> Result<()> {
        within("dt", &[self.dt], (0.04, 10.0))?;
        within("ts-length", &[self.ts_length], (20.0, 100_000.0))?;
        within("before", &[self.before], (2.0 * self.ts_length, 1e6))?;
        within("after", &[self.after], (if self.action.is_some() { self.ts_length } else { 0.0 }, 1e6))?;
        if let Some(action) = self.action.as_ref().filter(|action| action.contains('@')) {
            let reason = format!("'{action}' has a time; --before says when the action begins");
            return Err(Error::param("do", reason));
        }
        Ok(())
    }

    /// When the action begins: at once after `--before`, or when the robot next waits.
    fn moment(&self, scenario: &Scenario, seed: u64) -> Result<f64> {
        if !self.waiting {
            return Ok(self.before);
        }
        let lasting = Scenario { duration: self.before + LOOKED_FOR_S, ..scenario.clone() };
        let mut simulation = Simulation::new(&lasting, seed)?;
        while !simulation.is_over() {
            simulation.step();
            let waits = simulation.robots.first().is_some_and(|robot| {
                let near = |waypoint: &_| robot.position.distance(*waypoint) < WAITS.1;
                robot.v.abs() < WAITS.0 && robot.waypoints.iter().any(near)
            });
            if waits && simulation.time() >= self.before {
                return Ok(simulation.time());
            }
        }
        let reason = format!("the robot of '{}' waits at no waypoint within {LOOKED_FOR_S} s", self.scenario);
        Err(Error::param("waiting", reason))
    }

    fn one(&self, scenario: &Scenario, seed: u64, interrupt: &Interrupt) -> Result<Reported> {
        let mut scenario = scenario.clone();
        let impose = |what: &String| -> Result<f64> {
            let moment = self.moment(&scenario, seed)?;
            let one: Intervention =
                format!("{what}@{moment}..").parse().map_err(|reason| Error::param("do", reason))?;
            scenario.interventions.push(one);
            Ok(moment)
        };
        let action = self.action.as_ref().map(impose).transpose()?;
        let length = action.map_or(self.before, |moment| moment + self.after);
        let recording = recordings::record(&scenario, seed, length, &[self.dt], interrupt)?.swap_remove(0);
        let begins = recording.start.as_secs_f64();
        let rows = (self.ts_length / self.dt).round() as usize;
        let count = recording.n_rows() / rows.max(1);
        let events = self.events(&recordings::cut(&recording, rows, count), seed, interrupt)?;
        let second = |event: &ChangeEvent| event.time as f64 * self.dt;
        Ok(Reported {
            seed,
            action: action.map(|moment| moment - begins),
            end: (rows * count) as f64 * self.dt,
            events: events.into_iter().map(|event| (event.clone(), second(&event))).collect(),
        })
    }

    /// What the detector confirms, batch by batch, as the discovery node reads them.
    fn events(&self, batches: &[Recording], seed: u64, interrupt: &Interrupt) -> Result<Vec<ChangeEvent>> {
        let postprocess = runs::postprocess(1, RISK_NOISE, seed)?;
        let control = Control::default().cancel_on(interrupt.flag());
        let mut detector: Option<Detector> = None;
        let mut events = Vec::new();
        for batch in batches {
            let announced: Vec<(String, Vec<f64>)> =
                batch.context.iter().filter(|_| self.announced).map(values).collect();
            let mut columns = postprocess.run(batch)?.columns;
            columns.retain(|column| !batch.context.contains_key(&column.name));
            let detector = match &mut detector {
                Some(detector) => detector,
                none => {
                    let names = columns.iter().map(|column| column.name.clone()).collect();
                    let new = Detector::new(names, self.tau_max, &[], Levels::default())?;
                    none.insert(new.of_form(Form::of_test(&self.test)))
                }
            };
            for (name, given) in &announced {
                if given.iter().any(|value| *value != 0.0) && !detector.names().contains(name) {
                    detector.add_exogenous(name);
                }
            }
            let table = Array2::from_shape_fn((batch.n_rows(), detector.names().len()), |(row, var)| {
                let given =
                    detector.names().get(var).and_then(|name| announced.iter().find(|(of, _)| of == name));
                match (columns.get(var), given) {
                    (Some(column), _) => column.values[row],
                    (None, Some((_, given))) => given[row],
                    (None, None) => 0.0,
                }
            });
            let size = if self.change_rows == 0 { batch.n_rows() } else { self.change_rows };
            let size = size.max(detector.fewest_rows());
            events.extend(detector.read_in_parts(table.view(), &[], size, &control)?);
        }
        events.retain(|event| event.status == Status::Confirmed);
        Ok(events)
    }

    /// Number of the batch in which a second lies, from 0.
    fn batch(&self, second: f64) -> f64 {
        (second / self.ts_length - 1e-9).floor()
    }

    fn text(&self, reported: &[Reported]) -> String {
        let runs = reported.len();
        let mut text = match (&self.action, self.announced) {
            (None, _) => format!("{}, unchanged", self.scenario),
            (Some(action), true) => format!("{}, {action} announced", self.scenario),
            (Some(action), false) => format!("{}, {action} not announced", self.scenario),
        };
        let _ =
            write!(text, ", {runs} runs, batches of {} s at {} s, {}:", self.ts_length, self.dt, self.test);
        if self.action.is_some() {
            // Batches after the one that begins last before the action: that one is the first.
            let firsts: Vec<(f64, &Reported)> = (reported.iter())
                .filter_map(|reported| {
                    let action = reported.action?;
                    Some((reported.events.iter().find(|(_, at)| *at > action)?.1, reported))
                })
                .collect();
            let in_batches = |(at, reported): &(f64, &Reported)| {
                self.batch(*at) - self.batch(reported.action.unwrap_or_default()) + 1.0
            };
            let soon = firsts.iter().filter(|first| in_batches(first) <= 3.0).count();
            let mut delays: Vec<f64> =
                firsts.iter().map(|(at, reported)| at - reported.action.unwrap_or_default()).collect();
            delays.sort_by(f64::total_cmp);
            let _ =
                write!(text, "\n  told in {} of {runs} runs, in {soon} within three batches", firsts.len());
            if let Some(median) = delays.get(delays.len() / 2) {
                let _ = write!(text, "; median delay {median:.0} s");
            }
            let risk = |(at, reported): &&(f64, &Reported)| {
                let of = |(event, reported): &&(ChangeEvent, f64)| {
                    reported == at && [&event.cause, &event.effect].iter().any(|name| *name == runs::NAMES[2])
                };
                reported.events.iter().any(|event| of(&event))
            };
            let (risk, count) = (runs::NAMES[2], firsts.iter().filter(risk).count());
            let _ = write!(text, "; the first events name a link of {risk} in {count}");
        }
        let hours: f64 =
            reported.iter().map(|reported| reported.action.unwrap_or(reported.end)).sum::<f64>() / 3600.0;
        let alarm = |reported: &Reported| {
            let is_before = |at: f64| reported.action.is_none_or(|action| at <= action);
            reported.events.iter().filter(|(_, at)| is_before(*at)).count()
        };
        let alarms: usize = reported.iter().map(alarm).sum();
        let _ = write!(text, "\n  false alarms: {alarms} in {hours:.1} h without change");
        text
    }

    fn csv(&self, reported: &[Reported]) -> String {
        let mut csv = String::from("seed,action_s,told_s,kind,cause,effect,lag,before,after,p_value\n");
        for one in reported {
            let action = one.action.map_or(String::new(), |action| format!("{action:.2}"));
            for (event, at) in &one.events {
                let ChangeEvent { cause, effect, lag, before, after, p_value, .. } = event;
                let (seed, kind) = (one.seed, event.kind.name());
                let _ = writeln!(
                    csv,
                    "{seed},{action},{at:.1},{kind},{cause},{effect},{lag},{before},{after},{p_value}"
                );
            }
        }
        csv
    }
}

/// A column of an announced action: what is imposed, and 0 where nothing is.
fn values((name, rows): (&String, &Vec<Vec<f64>>)) -> (String, Vec<f64>) {
    (name.clone(), rows.iter().map(|cells| cells.first().copied().unwrap_or_default()).collect())
}
