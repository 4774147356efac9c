//! Does a robot do better that knows where and when people will be? Its tasks of a working day, by who decides on its ways.
//!
//! For each seed: a new house, four days in which the robot takes the shortest ways and records, then the same fifth day once for each
//! policy. Then the house changes (lunch moved, an aisle closed, a team doubled), two more days are recorded, and a third is
//! driven once for each policy, with what all six days tell.

use std::fmt::Write as _;

use clap::Args as ClapArgs;
use ndarray::Array2;
use roscausal_core::{Error, Result};
use roscausal_hrisim::{
    Scenario, Simulation,
    day::{Day, DaySpec, Porter},
    simulation::STEP,
};
use roscausal_reasoning::{
    graph::{Arrow, Graph},
    route::{
        days::{Days, Known},
        levels::{Made, Way},
        plan::{Cost, Trip},
    },
};

use super::runner::{Runner, end};
use crate::{interrupt::Interrupt, output};

/// Steps of a row: 10 s.
const ROW: u64 = 250;
/// Seconds of a row.
const ROW_S: f64 = ROW as f64 * STEP;
/// Days that are recorded in a house before it changes, and afterwards.
const BEFORE: usize = 4;
const AFTER: usize = 2;
/// Days without a robot that tell the oracle how many people are where.
const TOLD: usize = 10;
/// Variables of a row.
const NAMES: [&str; 3] = ["people", "robot", "hour"];
/// What may happen to a house.
const CHANGES: [&str; 4] = ["unchanged", "lunch two hours later", "an aisle closed", "a team doubled"];
/// Who decides.
const POLICIES: [&str; 6] =
    ["shortest", "off-peak", "mean by hour and place", "autoregression", "causal", "oracle"];

/// The policy that the others are set beside.
const MEAN: usize = 2;

/// Arguments of `roscausal experiment day`.
#[derive(ClapArgs)]
#[command(mut_arg("out", |arg| arg.default_value("roscausal_experiment_day").help("Folder for days.csv and measures.csv")))]
pub(super) struct Args {
    /// Hours of a day.
    #[arg(long, default_value_t = 10.0)]
    hours: f64,
    /// Also write the recorded days of each house, and its map, as `roscausal discover` and `roscausal route` read them.
    #[arg(long)]
    tables: bool,
    #[command(flatten)]
    runner: Runner,
}

/// What a day came to.
struct Driven {
    seed: u64,
    change: usize,
    policy: usize,
    porter: Porter,
    close: f64,
}

/// Runs `roscausal experiment day`.
pub(super) fn run(args: &Args, interrupt: &Interrupt) -> Result<()> {
    let seeds = args.runner.seeds()?;
    let results = args.runner.begin(interrupt)?;
    let days = args.runner.each(&seeds, "houses", |seed| args.house(seed, interrupt))?;
    let days: Vec<Driven> = days.into_iter().flatten().collect();
    end(&args.runner.out, results, None, &[("days.csv", csv(&days))], &text(&days))
}

impl Args {
    fn house(&self, seed: u64, interrupt: &Interrupt) -> Result<Vec<Driven>> {
        let mut spec = DaySpec { house: seed, hours: self.hours, ..DaySpec::warehouse(4, 7) };
        let mut recorded = Days { names: NAMES.map(str::to_owned).to_vec(), row: ROW_S, ..Days::default() };
        let arrow = |cause, effect, lag| Arrow { cause, effect, lag };
        let graph = Graph::new(recorded.names.clone(), 1, &[arrow(0, 0, 1), arrow(1, 0, 1)], &[])?;
        let mut days = Vec::new();
        for day in 0..BEFORE {
            let table = record(&mut recorded, &spec, seed * 1000 + day as u64, interrupt)?;
            self.write(seed, day, &spec, &table)?;
        }
        for (change, _) in CHANGES.iter().enumerate() {
            let (mut now, before) = (recorded.clone(), spec.clone());
            match change {
                1 => spec.lunch += 2.0,
                2 => spec.closed = (1..4).map(|row| format!("aisle2s_{row}")).collect(),
                3 => spec.teams[0] *= 2,
                _ => {}
            }
            let first = seed * 1000 + 100 * (change as u64 + 1);
            if change > 0 {
                for day in 0..AFTER {
                    record(&mut now, &spec, first + day as u64, interrupt)?;
                }
            }
            let mut told = Days { names: recorded.names.clone(), row: ROW_S, ..Days::default() };
            for day in 0..TOLD {
                let idle = DaySpec { tasks: 0, ..spec.clone() };
                record(&mut told, &idle, first + 50 + day as u64, interrupt)?;
            }
            for (policy, _) in POLICIES.iter().enumerate() {
                let known = match policy {
                    2 => Some(now.known(&now, &graph, NAMES[0], Way::Mean)?),
                    3 => Some(now.known(&now, &graph, NAMES[0], Way::Lagged)?),
                    4 => Some(now.known(&now, &graph, NAMES[0], Way::Causal)?),
                    5 => Some(now.known(&told, &graph, NAMES[0], Way::Causal)?),
                    _ => None,
                };
                let day = drive(&spec, first + 90, policy, known.as_ref(), interrupt)?;
                days.push(Driven { seed, change, policy, porter: day.porter, close: day.close_seconds });
            }
            spec = before;
        }
        Ok(days)
    }

    /// The table of a day and the house's map.
    fn write(&self, seed: u64, day: usize, spec: &DaySpec, table: &str) -> Result<()> {
        if self.tables {
            let map = toml::to_string(spec).map_err(|error| Error::Data(error.to_string()))?;
            let (out, day) = (&self.runner.out, day + 1);
            output::write_file(out, &format!("house_{seed}.toml"), map.as_bytes())?;
            output::write_file(out, &format!("house_{seed}_day_{day}.csv"), table.as_bytes())?;
        }
        Ok(())
    }
}

fn simulation(spec: &DaySpec, seed: u64) -> Result<Simulation> {
    Simulation::new(&Scenario::of_day("warehouse", spec.clone()), seed)
}

/// The day of a simulation that has one.
fn of(simulation: &Simulation) -> Result<&Day> {
    simulation.day.as_ref().ok_or_else(|| Error::param("scenario", "it has no working day"))
}

/// Records one more day, in which the robot takes the shortest ways. Returns it as a table.
fn record(days: &mut Days, spec: &DaySpec, seed: u64, interrupt: &Interrupt) -> Result<String> {
    interrupt.check()?;
    let mut simulation = simulation(spec, seed)?;
    let mut rows: Vec<Vec<[f64; 3]>> = vec![Vec::new(); spec.places.len()];
    let mut table = format!("time,place,{},speed,loss,load\n", NAMES.join(","));
    let (mut driven, mut charge, number) = (0.0, 100.0, days.days());
    while !simulation.is_over() {
        simulation.step();
        if !simulation.steps().is_multiple_of(ROW) {
            continue;
        }
        let day = of(&simulation)?;
        let porter = &day.porter;
        let counts = day.counts(&simulation.crowd);
        let at = simulation.robots.first().and_then(|robot| day.counted_at(robot.position));
        let speed = (porter.driven - driven) / ROW_S;
        let speed = porter.is_driving().then_some(speed);
        let loss = (porter.charge < charge).then_some((charge - porter.charge) / ROW_S);
        (driven, charge) = (porter.driven, porter.charge);
        let load = u8::from(porter.is_loaded());
        let (time, hour) = (simulation.time() - ROW_S, day.clock(simulation.time() - ROW_S));
        for (place, rows) in rows.iter_mut().enumerate() {
            let row = [f64::from(counts[place]), f64::from(at == Some(place)), hour];
            let _ = write!(table, "{time},{place},{},{},{hour:.4}", row[0], row[1]);
            if at == Some(place) {
                let [speed, loss] =
                    [speed, loss].map(|value| value.map_or(String::new(), |value| format!("{value:.5}")));
                let _ = writeln!(table, ",{speed},{loss},{load}");
            } else {
                table.push_str(",,,\n");
            }
            if let (true, Some(speed), Some(before)) = (at == Some(place), speed, rows.last()) {
                days.drives.push((before[0], speed));
            }
            rows.push(row);
        }
        if let Some(loss) = loss {
            days.drains[usize::from(load)].push((speed.unwrap_or(0.0), loss));
        }
    }
    for (place, rows) in rows.into_iter().enumerate() {
        days.made.push(Made { place, day: number });
        days.recordings.push(Array2::from_shape_fn((rows.len(), 3), |(row, column)| rows[row][column]));
    }
    Ok(table)
}

/// Drives a day by a policy.
fn drive(
    spec: &DaySpec,
    seed: u64,
    policy: usize,
    known: Option<&Known>,
    interrupt: &Interrupt,
) -> Result<Day> {
    interrupt.check()?;
    let mut simulation = simulation(spec, seed)?;
    let no_day = || Error::param("scenario", "it has no working day");
    simulation.day.as_mut().ok_or_else(no_day)?.porter.guided = policy > 0;
    while !simulation.is_over() {
        simulation.step();
        let time = simulation.time();
        let day = of(&simulation)?;
        let Some(leg) = day.porter.open_leg().cloned() else { continue };
        let hour = day.clock(time);
        let (wait, places) = match known {
            // The half hours in which a team goes to lunch are busy.
            None => {
                let lunch = DaySpec::default().lunch;
                let peak = policy == 1 && [lunch, lunch + 1.0].iter().any(|at| (hour - at).abs() < 0.25);
                (if peak { 900.0 } else { 0.0 }, day.map.way(leg.from, leg.to))
            }
            Some(known) => {
                let counts: Vec<f64> = day.counts(&simulation.crowd).into_iter().map(f64::from).collect();
                let house = known.house(&day.map, leg.loaded);
                let trip = Trip {
                    from: leg.from,
                    to: leg.to,
                    hour,
                    horizon: (leg.latest - time).max(0.0).min(if leg.loaded { 600.0 } else { 1e9 }),
                    allowed: Some(leg.allowed),
                    now: (policy != MEAN).then_some(counts.as_slice()),
                    cost: Cost::default(),
                };
                match house.best(&trip) {
                    Ok((best, _)) => (best.wait, best.places),
                    // At the end of the day a way leads past what was recorded.
                    Err(roscausal_discovery::Error::Data(_)) => (0.0, day.map.way(leg.from, leg.to)),
                    Err(error) => return Err(error.into()),
                }
            }
        };
        simulation.day.as_mut().ok_or_else(no_day)?.decide(time + wait, &places);
    }
    simulation.day.take().ok_or_else(no_day)
}

fn csv(days: &[Driven]) -> String {
    let mut csv = String::from("seed,house,policy,tasks,done,empty,driven_m,wasted_m,close_s\n");
    for day in days {
        let Driven { seed, porter, close, .. } = day;
        let Porter { done, empty, driven, wasted, .. } = porter;
        let (change, policy, tasks) = (CHANGES[day.change], POLICIES[day.policy], porter.tasks.len());
        let _ = writeln!(
            csv,
            "{seed},{change},{policy},{tasks},{done},{empty},{driven:.1},{wasted:.1},{close:.1}"
        );
    }
    csv
}

fn text(days: &[Driven]) -> String {
    let mut text = String::new();
    for (change, name) in CHANGES.iter().enumerate() {
        let of = |policy: usize| -> Vec<&Driven> {
            days.iter().filter(|day| day.change == change && day.policy == policy).collect()
        };
        let share = |day: &Driven| 100.0 * day.porter.done as f64 / day.porter.tasks.len().max(1) as f64;
        let _ = writeln!(text, "{name}\n  {:24} done in time    beside the mean  wasted  close  empty", "");
        for (policy, name) in POLICIES.iter().enumerate() {
            let (of, mean) = (of(policy), of(MEAN));
            let sum = |get: fn(&Driven) -> f64| of.iter().map(|day| get(day)).sum::<f64>();
            let (done, half) = interval(of.iter().map(|day| share(day)));
            // The same house and day for both.
            let both = of.iter().zip(&mean).map(|(day, mean)| share(day) - share(mean));
            let (better, half_better) = interval(both);
            let wasted = 100.0 * sum(|day| day.porter.wasted) / sum(|day| day.porter.driven).max(1.0);
            let (close, empty) =
                (sum(|day| day.close) / of.len().max(1) as f64, sum(|day| day.porter.empty as f64));
            let _ = writeln!(
                text,
                "  {name:24} {done:5.1} % +- {half:4.1}  {better:+5.1} +- {half_better:4.1}  {wasted:5.1} % {close:4.0} s {empty:5.0}"
            );
        }
    }
    text
}

/// The mean, and half of its 95 % interval.
fn interval(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let values: Vec<f64> = values.collect();
    let n = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / n;
    let square = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
    (mean, 1.96 * (square / (n - 1.0).max(1.0) / n).sqrt())
}
