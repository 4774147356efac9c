//! Tables of trajectories, as data sets of crowds ship them, made into batches in memory.
//!
//! 1. `layout`: which columns say who, when and where; a row for each agent and time, or columns for each agent.
//! 2. `agents`: the samples of each agent in metres and seconds, and its states as the human node computes them.
//! 3. Here: rows at one step for each agent that is analysed, with the others around it, and the variables of the data node.

mod agents;
mod layout;
mod motion;
mod sample;
#[cfg(test)]
mod tests;

use std::{collections::BTreeMap, path::Path};

use ndarray::Array2;
use roscausal_discovery::{Named, same_value};

use super::{
    EndedBy, Recording, Select, Table, Values,
    postprocess::{Obstacle, Postprocess},
    table::{Note, median},
};
use crate::{Error, Result, Time, ensure};

pub use agents::{Agent, Agents};
pub use sample::PositionUnit;

/// The step of a table that is sampled faster, unless the user says another: that of the data node.
const USUAL_STEP: f64 = 0.1;
/// Samples farther apart than this are a gap, unless their usual step is longer: that of the data node.
const USUAL_GAP: f64 = 0.5;
/// A gap is at least this many usual steps long.
const GAP_STEPS: f64 = 2.5;
/// A recording has at most this many rows.
const MOST_ROWS: f64 = 1e7;

/// How a table of trajectories is read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrajectoryReading {
    /// Frames per second, where frames are counted instead of times.
    pub frame_rate: Option<f64>,
    /// Unit of the positions, if it is not metres.
    pub unit: Option<PositionUnit>,
    /// Names of columns by role, such as `id` to `ped`.
    pub columns: BTreeMap<String, String>,
    /// Numbers that stand for a missing value.
    pub missing: Vec<f64>,
    /// The last place of each agent is its goal.
    pub last_is_goal: bool,
    /// Bytes that reading may take; `None`: what the machine has free.
    pub max_memory: Option<u64>,
}

/// What is made of the agents.
#[derive(Clone, Debug)]
pub struct TrajectoryChoice {
    /// Who is analysed: names or numbers, `nearest:N`, `all`.
    pub who: String,
    /// Whom they may collide with: a name or number, or `nearest`. `None`: a robot, if there is one, otherwise the nearest.
    pub obstacle: Option<String>,
    /// Step between rows, seconds.
    pub dt: Option<f64>,
    /// Samples farther apart are a gap, seconds.
    pub max_gap: Option<f64>,
    /// Agents with fewer rows are left out.
    pub least_rows: usize,
}

/// One table of variables for each agent, and what to tell.
pub struct Walks {
    /// Name of each agent, and its variables.
    pub tables: Vec<(String, Table)>,
    /// What was made of the file, one sentence each.
    pub notes: Vec<String>,
}

/// The variables of the agents in a file.
///
/// # Errors
/// A file that is no such table, an agent or obstacle that is not in it, or agents that are there too briefly.
pub fn walks(
    path: &Path,
    reading: &TrajectoryReading,
    choice: &TrajectoryChoice,
    postprocess: &Postprocess,
) -> Result<Walks> {
    let agents = Agents::read(path, reading)?;
    let scene = Scene::of(&agents, choice)?;
    let chosen = scene.chosen(&choice.who)?;
    let postprocess = Postprocess {
        obstacle: if scene.robot.is_some() { Obstacle::Robot } else { Obstacle::Nearest },
        ..postprocess.clone()
    };
    let mut notes = agents.notes.clone();
    if reading.last_is_goal {
        notes.push(
            "each one's last place is the goal: h_dg looks ahead, since it knows how long the walk still is; read its links so".to_owned(),
        );
    }
    let (mut tables, mut out, mut emptied) =
        (Vec::new(), LeftOut::default(), BTreeMap::<String, usize>::new());
    for agent in chosen {
        if agent.stands {
            out.stand.push(&agent.name);
            continue;
        }
        let batch = scene.batch(agent)?;
        if batch.n_rows() < choice.least_rows {
            out.brief.push(&agent.name);
            continue;
        }
        let features = postprocess.run(&batch)?;
        for (column, count) in features.emptied {
            *emptied.entry(column.rsplit('_').next().unwrap_or_default().to_owned()).or_default() += count;
        }
        let (rows, columns) = (batch.n_rows(), features.columns.len());
        let values =
            Array2::from_shape_fn((rows, columns), |(row, column)| features.columns[column].values[row]);
        let names = features.columns.into_iter().map(|column| column.name).collect();
        let time = Some((0..rows).map(|row| batch.stamp(row).as_secs_f64()).collect());
        let table = Table { names, values, time, notes: Vec::<Note>::new() };
        if tables.iter().any(|(_, other)| is_double(other, &table)) {
            out.double.push(&agent.name);
            continue;
        }
        tables.push((agent.name.clone(), table));
    }
    notes.push(scene.reported(tables.len()));
    notes.extend(out.reported(choice.least_rows));
    let of_emptied = |(what, count)| format!("{count} impossible values of '{what}' are left out");
    notes.extend(emptied.into_iter().map(of_emptied));
    if tables.is_empty() {
        let (dt, tau_max) = (Named("dt"), Named("tau_max"));
        let way = match out.brief.is_empty() {
            true => String::new(),
            false => format!("; choose a shorter step with {dt}, or a smaller {tau_max}"),
        };
        let (rows, step) = (choice.least_rows, scene.dt);
        let why = out.reported(rows).collect::<Vec<_>>().join("; ");
        let reason = format!("nobody is there for {rows} rows of {step} s and moves ({why}){way}");
        return Err(Error::file(path, reason));
    }
    leave_out_unknown(&mut tables, &mut notes);
    Ok(Walks { tables, notes })
}

/// The names of agents that are not analysed, by the reason.
#[derive(Default)]
struct LeftOut<'a> {
    stand: Vec<&'a str>,
    brief: Vec<&'a str>,
    double: Vec<&'a str>,
}

impl LeftOut<'_> {
    fn reported(&self, least_rows: usize) -> impl Iterator<Item = String> {
        const MOST: usize = 20;
        let reasons = [
            (&self.stand, "they stand still all the time".to_owned()),
            (&self.brief, format!("they are there for fewer than {least_rows} rows")),
            (&self.double, "they have the rows of another one".to_owned()),
        ];
        let reported = |(names, why): (&Vec<&str>, String)| {
            let more =
                if names.len() > MOST { format!(" and {} more", names.len() - MOST) } else { String::new() };
            let listed = names.iter().take(MOST).copied().collect::<Vec<_>>().join(", ");
            let are = if names.len() == 1 { "agent is" } else { "agents are" };
            (!names.is_empty())
                .then(|| format!("{} {are} left out, since {why}: {listed}{more}", names.len()))
        };
        reasons.map(reported).into_iter().flatten()
    }
}

/// Whether two agents have the same rows at the same times.
fn is_double(one: &Table, other: &Table) -> bool {
    one.time == other.time
        && one.values.dim() == other.values.dim()
        && one.values.iter().zip(&other.values).all(same_value)
}

/// Leaves out the variables that are known of nobody, such as the distance to a goal.
fn leave_out_unknown(tables: &mut [(String, Table)], notes: &mut Vec<String>) {
    let Some((_, first)) = tables.first() else { return };
    let known = |column: usize| {
        tables.iter().any(|(_, table)| table.values.column(column).iter().any(|value| !value.is_nan()))
    };
    let (kept, out): (Vec<usize>, Vec<usize>) = (0..first.names.len()).partition(|&column| known(column));
    if out.is_empty() || kept.is_empty() {
        return;
    }
    let names: Vec<&str> = out.iter().map(|&column| first.names[column].as_str()).collect();
    let why = match names.iter().any(|name| name.contains("_dg")) {
        true => format!(": the table tells no goals ({} last takes each one's last place)", Named("goal")),
        false => String::new(),
    };
    notes.push(format!("left out, since nothing is known of it: {}{why}", names.join(", ")));
    for (_, table) in tables {
        table.values = table.values.select(ndarray::Axis(1), &kept);
        table.names = kept.iter().map(|&column| table.names[column].clone()).collect();
    }
}

/// The agents, and how they come to rows.
struct Scene<'a> {
    agents: &'a Agents,
    robot: Option<&'a Agent>,
    dt: f64,
    max_gap: f64,
    start: f64,
}

impl<'a> Scene<'a> {
    fn of(agents: &'a Agents, choice: &TrajectoryChoice) -> Result<Self> {
        let robot = match choice.obstacle.as_deref() {
            None => agents.robot(),
            Some("nearest") => None,
            Some(name) => Some(agents.named("obstacle", name)?),
        };
        let usual = agents.usual_step;
        let dt = choice.dt.unwrap_or_else(|| rounded(usual.max(USUAL_STEP)));
        ensure(dt.is_finite() && dt > 0.0, || {
            Error::param("dt", format!("{dt} is not a number of seconds above 0"))
        })?;
        if let Some(gap) = choice.max_gap.filter(|gap| gap.is_nan() || *gap <= 0.0) {
            return Err(Error::param("max-gap", format!("{gap} is not a number of seconds above 0")));
        }
        let max_gap = choice.max_gap.unwrap_or_else(|| USUAL_GAP.max(GAP_STEPS * usual));
        Ok(Self { agents, robot, dt, max_gap, start: agents.start() })
    }

    fn reported(&self, chosen: usize) -> String {
        let other = Named("obstacle");
        let obstacle = match self.robot {
            Some(robot) => format!("the obstacle is {} ({other} names another)", robot.name),
            None => format!("the obstacle is the nearest other one ({other} names one)"),
        };
        let (all, dt) = (self.agents.all.len(), self.dt);
        format!("{all} agents, of whom {chosen} are analysed, in steps of {dt} s; {obstacle}")
    }

    /// Those who are analysed.
    fn chosen(&self, who: &str) -> Result<Vec<&'a Agent>> {
        let people =
            || self.agents.all.iter().filter(|agent| self.robot.is_none_or(|robot| robot.id != agent.id));
        match who.parse::<Select>() {
            Ok(Select::All) => Ok(people().collect()),
            Ok(Select::Nearest(number)) => {
                let moving = people().filter(|agent| !agent.stands);
                let mut by_distance: Vec<(f64, &Agent)> =
                    moving.map(|agent| Ok((self.usual_distance(agent)?, agent))).collect::<Result<_>>()?;
                by_distance.sort_by(|(one, _), (other, _)| one.total_cmp(other));
                Ok(by_distance.into_iter().take(number).map(|(_, agent)| agent).collect())
            }
            _ => {
                let words = who.split(',').map(str::trim);
                let (away, named): (Vec<&str>, Vec<&str>) = words.partition(|word| word.starts_with('!'));
                let mut chosen: Vec<&Agent> = Vec::new();
                for word in &named {
                    chosen.extend(self.agents.meant(word)?);
                }
                if named.is_empty() {
                    chosen.extend(people());
                }
                for word in away {
                    let away = self.agents.meant(&word[1..])?;
                    chosen.retain(|agent| away.iter().all(|other| other.name != agent.name));
                }
                Ok(chosen)
            }
        }
    }

    /// Median distance to the obstacle; infinite for somebody who never meets it.
    fn usual_distance(&self, agent: &Agent) -> Result<f64> {
        let batch = self.batch(agent)?;
        let rows = batch.people.get(&agent.id).map(Vec::as_slice).unwrap_or_default();
        let distance = |row: usize, other: &Values| libm::hypot(other.x - rows[row].x, other.y - rows[row].y);
        let nearest = |row: usize| {
            let others = batch.others.values().map(|rows| &rows[row]).chain([&batch.robot[row]]);
            others.map(|other| distance(row, other)).filter(|d| d.is_finite()).min_by(f64::total_cmp)
        };
        Ok(median((0..rows.len()).filter_map(nearest)).unwrap_or(f64::INFINITY))
    }

    /// The rows of one agent: from the first step at which it is there to the last, with the others around it.
    fn batch(&self, agent: &Agent) -> Result<Recording> {
        let step_ns = (self.dt * 1e9).round();
        let first = ((agent.start - self.start) / self.dt).ceil();
        let last = ((agent.end - self.start) / self.dt + 1e-6).floor();
        let rows = (last - first + 1.0).max(0.0);
        Error::ensure(rows <= MOST_ROWS, "dt", || {
            format!("{rows} rows are too many; choose a longer step than {} s", self.dt)
        })?;
        let start_ns = ((self.start * 1e9).round() + first * step_ns) as i64;
        let stamps: Vec<i64> = (0..rows as usize).map(|row| start_ns + row as i64 * step_ns as i64).collect();
        let values = |of: &Agent| of.rows(&stamps, (self.max_gap * 1e9) as i64);
        let together =
            |other: &&Agent| other.id != agent.id && other.start <= agent.end && other.end >= agent.start;
        let others = self.agents.all.iter().filter(|other| self.robot.is_none() && together(other));
        Ok(Recording {
            start: Time::from_nanos(start_ns),
            dt_ns: step_ns as i64,
            frame: "map".into(),
            robot: self.robot.map_or_else(|| vec![Values::UNKNOWN; stamps.len()], values),
            people: BTreeMap::from([(agent.id, values(agent))]),
            others: others.map(|other| (other.name.clone(), values(other))).collect(),
            complete: true,
            ended_by: Some(EndedBy::NodeEnd),
            ..Recording::default()
        })
    }
}

/// A step without the noise of its last digits.
fn rounded(step: f64) -> f64 {
    (step * 1e4).round() / 1e4
}
