//! Runs of the same seed with and without an action.

use ndarray::{Array2, s};
use roscausal_core::{
    Error, Result,
    batch::{
        Recording,
        postprocess::{Feature, Postprocess},
    },
};
use roscausal_hrisim::Scenario;

use super::{ACTIONS, DT, FEATURES, REACH};
use crate::{
    experiment::{recordings::record, runs},
    interrupt::Interrupt,
};

/// Seconds that an action lasts: longer than what is asked about.
const LASTS_S: f64 = REACH as f64 * DT + DT;

/// The variables of one run.
pub(super) struct Walk {
    /// Time of each row in seconds.
    pub(super) times: Vec<f64>,
    /// `T x N`.
    pub(super) rows: Array2<f64>,
}

/// One moment of one seed: what came about when nobody acted, and what under each action.
pub(super) struct Twins {
    pub(super) seed: u64,
    pub(super) start: f64,
    /// Rows up to [`REACH`] steps after `now`, untouched.
    pub(super) rows: Array2<f64>,
    /// The last row before the actions.
    pub(super) now: usize,
    /// By action: the [`REACH`] rows after `now`.
    pub(super) acted: Vec<Array2<f64>>,
}

/// Simulates a run through the robot and the human node, and computes its variables.
pub(super) fn walk(scenario: &Scenario, seed: u64, seconds: f64, interrupt: &Interrupt) -> Result<Walk> {
    let recording = record(scenario, seed, seconds, &[DT], interrupt)?.swap_remove(0);
    let rows = variables(&recording)?;
    Ok(Walk { times: (0..rows.nrows()).map(|row| recording.stamp(row).as_secs_f64()).collect(), rows })
}

fn variables(recording: &Recording) -> Result<Array2<f64>> {
    // The variables of this experiment have no risk.
    let features = Feature::parse("features", &FEATURES.map(str::to_owned))?;
    let postprocess = Postprocess { features, ..runs::postprocess(0, 0.0, 0)? };
    let columns = postprocess.run(recording)?.columns;
    Ok(Array2::from_shape_fn((recording.n_rows(), FEATURES.len()), |(row, var)| columns[var].values[row]))
}

impl Twins {
    /// All moments of a seed.
    ///
    /// # Errors
    /// Runs that differ before the action begins, or that are too short; those of a simulation.
    pub(super) fn of_seed(
        scenario: &Scenario,
        seed: u64,
        starts: &[f64],
        interrupt: &Interrupt,
    ) -> Result<Vec<Self>> {
        let until = |start: f64| start + LASTS_S;
        let last = starts.iter().copied().fold(0.0, f64::max);
        let untouched = walk(scenario, seed, until(last), interrupt)?;
        let one = |&start: &f64| {
            let now = untouched.row_at(seed, start)?;
            let rows = untouched.rows.slice(s![..=now + REACH, ..]).to_owned();
            let under = |(_, what): &(&str, &str)| {
                let mut scenario = scenario.clone();
                scenario.add_interventions(&[format!("{what}@{start}..{}", until(start))])?;
                let twin = walk(&scenario, seed, until(start), interrupt)?;
                twin.row_at(seed, start)?;
                if twin.rows.slice(s![..=now, ..]) != rows.slice(s![..=now, ..]) {
                    return Err(Error::Data(format!(
                        "seed {seed}: the run with {what} differs from the one without before {start} s; their difference would be no effect of it"
                    )));
                }
                Ok(twin.rows.slice(s![now + 1..=now + REACH, ..]).to_owned())
            };
            Ok(Self { acted: ACTIONS.iter().map(under).collect::<Result<_>>()?, seed, start, rows, now })
        };
        starts.iter().map(one).collect()
    }
}

impl Walk {
    /// The last row at a time or before it, with [`REACH`] rows after it.
    fn row_at(&self, seed: u64, start: f64) -> Result<usize> {
        let after = self.times.partition_point(|&time| time <= start + 1e-6);
        let known = after > 0 && after + REACH <= self.times.len();
        let whole = |row: usize| {
            self.rows.slice(s![row + 1 - after.min(10)..=row + REACH, ..]).iter().all(|x| x.is_finite())
        };
        match after.checked_sub(1) {
            Some(row) if known && whole(row) => Ok(row),
            _ => Err(Error::Data(format!(
                "seed {seed}: robot and person are not both there around {start} s; choose other --starts"
            ))),
        }
    }
}
