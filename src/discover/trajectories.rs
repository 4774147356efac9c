//! `--format trajectories`: tables with one row per agent and time.

use std::collections::BTreeMap;

use clap::Args as ClapArgs;
use roscausal_core::{
    Error, Result,
    batch::trajectories::{PositionUnit, TrajectoryChoice, TrajectoryReading, walks},
    nodes,
    params::Value,
};

use roscausal_discovery::Named;

use super::{Args, Data, Input};
use crate::{flags, recording::parameter};

/// Everybody, one recording each.
const EVERYBODY: &str = "all";

/// Flags for tables of trajectories.
#[derive(ClapArgs, Clone, Debug, Default)]
#[command(next_help_heading = "People")]
pub(crate) struct TrajectoryArgs {
    /// Trajectories: who is analysed: an id or name, several (`3,7`), a range (`3..7`), all but some (`!5`), `nearest:N` (to the
    /// obstacle), or `all` (each agent is a recording of one system). Default: all.
    #[arg(long, value_name = "WHO")]
    agent: Option<String>,
    /// Trajectories: whom they may collide with: an id or name, or `nearest` (the nearest other agent). Default: the robot, if the
    /// table has one, otherwise nearest.
    #[arg(long, value_name = "WHO")]
    obstacle: Option<String>,
    /// Trajectories: where each agent wants to go, if the table does not tell: `last`, its last place.
    #[arg(long, value_name = "WHERE", value_parser = ["last"])]
    goal: Option<String>,
    /// Trajectories: frames per second, where the table counts frames. Default: those at which places and velocities agree, or people
    /// walk like people.
    #[arg(long, value_name = "HZ")]
    frame_rate: Option<f64>,
    /// Trajectories: unit of the positions: m, cm, mm, ft, or a length such as `0.03m` (a pixel). Default: by the speeds that follow from it.
    #[arg(long, value_name = "UNIT", value_parser = flags::word::<PositionUnit>)]
    position_unit: Option<PositionUnit>,
    /// Trajectories: columns with unusual names, such as `id=ped,time=ts,x=px`, or without any, by number from 1. Roles: id, time, frame, x, y, vx, vy, speed, heading,
    /// gx, gy, kind.
    #[arg(long, value_name = "ROLE=NAME", value_delimiter = ',')]
    trajectory_columns: Vec<String>,
}

impl TrajectoryArgs {
    /// The first of these flags that was given, for input that is not a table of trajectories.
    pub(super) fn given(&self) -> Option<&'static str> {
        let flags = [
            ("--agent", self.agent.is_some()),
            ("--obstacle", self.obstacle.is_some()),
            ("--goal", self.goal.is_some()),
            ("--frame-rate", self.frame_rate.is_some()),
            ("--position-unit", self.position_unit.is_some()),
            ("--trajectory-columns", !self.trajectory_columns.is_empty()),
        ];
        flags.into_iter().find(|(_, given)| *given).map(|(flag, _)| flag)
    }

    /// The variables of all agents in the files.
    ///
    /// # Errors
    /// A file that is not a table of trajectories, or a flag that does not go with it.
    pub(super) fn read(&self, args: &Args) -> Result<Data> {
        let reason = "trajectories are pooled: each agent is a recording of one system";
        Error::ensure(args.several_people != "joint", "several-people", || reason)?;
        if let Some(flag) = args.how.read.of_lines() {
            let columns = Named("trajectory_columns");
            let reason = format!("of trajectories, {columns} says which column is what");
            return Err(Error::param(flag, reason));
        }
        let postprocess = nodes::postprocess(&self.parameters(args)?)?;
        let reading = TrajectoryReading {
            frame_rate: self.frame_rate,
            unit: self.position_unit,
            columns: self.columns()?,
            missing: args.how.read.missing()?,
            last_is_goal: self.goal.is_some(),
            max_memory: args.how.means.max_bytes(),
        };
        let choice = TrajectoryChoice {
            who: self.agent.clone().unwrap_or_else(|| EVERYBODY.to_owned()),
            obstacle: self.obstacle.clone(),
            dt: args.how.inputs.dt,
            max_gap: args.how.read.max_gap,
            // A few samples more than the lags take.
            least_rows: args.how.method.tau_max().saturating_mul(2).saturating_add(4),
        };
        let (mut tables, mut warnings) = (Vec::new(), Vec::new());
        for (number, file) in args.files.iter().enumerate() {
            let found = walks(file, &reading, &choice, &postprocess)?;
            warnings.extend(found.notes.iter().map(|note| format!("{}: {note}", file.display())));
            for (place, (agent, mut table)) in found.tables.into_iter().enumerate() {
                if let Some(columns) = &args.how.read.columns {
                    table.keep(columns)?;
                }
                let name = file.file_name().unwrap_or_default().to_string_lossy();
                let user = file.with_file_name(format!("{name} ({agent})"));
                tables.push((Input { table: file.clone(), user, run: [number, place] }, table));
            }
        }
        warnings.iter().for_each(|warning| tell!("{warning}"));
        Ok(Data { warnings, recorded: false, ..Data::of(tables)? })
    }

    /// The data node's parameters: those of `--param`, and the features.
    fn parameters(&self, args: &Args) -> Result<Vec<(String, Value)>> {
        let mut given = Vec::new();
        for text in args.how.inputs.params.iter().cloned().chain(args.how.read.as_parameter()) {
            let (node, name, value) = parameter(&text)?;
            Error::ensure(node == "data", "param", || {
                format!("trajectories know the parameters of the node data, not of {node}")
            })?;
            given.push((name, Value::Str(value)));
        }
        Ok(given)
    }

    fn columns(&self) -> Result<BTreeMap<String, String>> {
        const ROLES: [&str; 12] =
            ["id", "time", "frame", "x", "y", "vx", "vy", "speed", "heading", "gx", "gy", "kind"];
        let pair = |text: &String| -> Result<(String, String)> {
            let (role, name) =
                text.split_once('=').filter(|(role, _)| ROLES.contains(role)).ok_or_else(|| {
                    let reason = format!("'{text}' is not ROLE=NAME; roles: {}", ROLES.join(", "));
                    Error::param("trajectory-columns", reason)
                })?;
            Ok((role.to_owned(), name.to_owned()))
        };
        self.trajectory_columns.iter().map(pair).collect()
    }
}
