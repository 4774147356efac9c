//! One run of the simulator and the nodes, in which somebody chooses the robot's top speed.

use std::{
    path::{Path, PathBuf},
    thread,
    time::{Duration, Instant},
};

use roscausal_core::{
    Error, Result, Time,
    batch::pool::with_ending,
    loopback::{Loopback, LoopbackNode},
    middleware::{Middleware, Qos},
    nodes::{self as core_nodes, FEATURES_TOPIC, SceneOptions, WHAT_IF_SERVICE},
    params::Value,
};
use roscausal_hrisim::{Scenario, Simulation, node::Publisher};
use roscausal_msgs::{Action, CostTerm, Features, Intervention, WhatIf, WhatIfRequest, WhatIfResponse};

use super::{DT, FEATURES, NEAR, SPEEDS};
use crate::{
    interrupt::Interrupt,
    nodes::{RECORDING, Threaded, set_pools, set_subjects},
};

/// Steps of the simulation between two choices: about twice a second.
const CHOOSE_EVERY: u64 = 12;
/// Longest trial, seconds of simulated time.
const LONGEST_S: f64 = 900.0;
/// How long a node may take to start, and an answer to come; real time.
const PATIENCE: Duration = Duration::from_secs(60);
const LOOK_AGAIN: Duration = Duration::from_millis(1);
/// What an error calls the node that answers.
const REASONING: &str = "the reasoning node";
/// Folder of the post-processed batches.
const PROCESSED: &str = "processed";
/// Seconds simulated before a batch begins.
const WARM_UP_S: f64 = 3.0;

/// Who chooses the speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Policy {
    /// Always the same.
    Always(f64),
    /// The slowest when the person is near, else the fastest.
    Rule,
    /// Asks the reasoning node.
    Planner,
}

impl Policy {
    pub(super) fn name(self) -> String {
        match self {
            Self::Always(speed) => format!("always {speed} m/s"),
            Self::Rule => format!("{} m/s within {NEAR} m of them, else {} m/s", SPEEDS[0], SPEEDS[2]),
            Self::Planner => "planner that asks what if".to_owned(),
        }
    }
}

/// What the planner asks.
pub(super) struct Question {
    /// Variable and weight.
    pub(super) cost: Vec<(&'static str, f64)>,
    pub(super) horizon: u32,
}

/// What the reasoning node is started with, and what it is asked.
pub(super) struct Nodes {
    pub(super) graph: PathBuf,
    pub(super) data: Vec<PathBuf>,
    pub(super) equations: String,
    pub(super) question: Question,
}

/// How a trial went.
#[derive(Clone, Debug, Default)]
pub(super) struct Drive {
    /// Seconds to the goal; `None`: not reached.
    pub(super) seconds: Option<f64>,
    /// The risk at each step of the simulation.
    pub(super) risks: Vec<f64>,
    /// Seconds on collision course.
    pub(super) collision_s: f64,
    /// Smallest distance between robot and person, metres.
    pub(super) nearest: f64,
    /// Questions, and how many of them gave a ranking.
    pub(super) asked: u64,
    pub(super) answered: u64,
}

/// Runs the scenario and records it; returns the post-processed batches, which are below `out`.
pub(super) fn explore(
    scenario: &Scenario,
    seed: u64,
    seconds: f64,
    out: &Path,
    interrupt: &Interrupt,
) -> Result<Vec<PathBuf>> {
    let scenario = Scenario { duration: seconds + WARM_UP_S, ..scenario.clone() };
    let mut simulation = Simulation::new(&scenario, seed)?;
    let bus = Loopback::lockstep();
    let nodes = recording(&bus, &simulation, out, seconds);
    let run = roscausal_hrisim::node::run_lockstep(&bus, &mut simulation, 1, |_| !interrupt.is_set());
    nodes.end()?;
    run?;
    interrupt.check()?;
    with_ending(&out.join(PROCESSED), ".csv")
}

/// The nodes that record below `out`, with the experiment's variables.
fn recording(bus: &Loopback, simulation: &Simulation, out: &Path, seconds: f64) -> crate::nodes::Nodes {
    set_subjects(bus, simulation);
    set_pools(bus, &out.join("raw"), &out.join(PROCESSED));
    let set = |name: &str, value: Value| bus.set_node_param("data", name, value);
    set("dt", Value::Double(DT));
    set("ts_length", Value::Double(seconds));
    set("journal", Value::Bool(false));
    set("features_only", Value::List(FEATURES.map(|text| Value::Str(text.to_owned())).to_vec()));
    crate::nodes::Nodes::start(bus, &RECORDING)
}

/// Runs the scenario until the robot has reached `legs` waypoints.
pub(super) fn trial(
    scenario: &Scenario,
    seed: u64,
    policy: Policy,
    legs: u64,
    nodes: &Nodes,
    interrupt: &Interrupt,
) -> Result<Drive> {
    let scenario = Scenario { duration: LONGEST_S, ..scenario.clone() };
    let mut simulation = Simulation::new(&scenario, seed)?;
    let bus = Loopback::lockstep();
    let folder = tempfile::tempdir().map_err(|e| Error::file(std::env::temp_dir(), e))?;
    let recording = recording(&bus, &simulation, folder.path(), 0.0);
    let reasoning = if policy == Policy::Planner { Some(reasoning(&bus, nodes)?) } else { None };
    let driven = drive(&bus, &mut simulation, (policy, legs), nodes, interrupt);
    let ended = reasoning.map_or(Ok(()), |node| node.end(REASONING));
    recording.end().and(ended)?;
    driven
}

fn drive(
    bus: &Loopback,
    simulation: &mut Simulation,
    (policy, legs): (Policy, u64),
    nodes: &Nodes,
    interrupt: &Interrupt,
) -> Result<Drive> {
    let mut publisher = Publisher::new(&bus.node("hrisim"), simulation)?;
    let planner = bus.node("planner");
    let own = simulation.robots.first().map(|robot| robot.params.speed).filter(|speed| *speed > 0.0);
    let own = own.ok_or_else(|| Error::param("scenario", "there is no robot that drives"))?;
    let mut drive = Drive { nearest: f64::INFINITY, ..Drive::default() };
    let origin = bus.now();
    let mut speed = own;
    while !simulation.is_over() {
        interrupt.check()?;
        if simulation.steps().is_multiple_of(CHOOSE_EVERY) {
            speed = match policy {
                Policy::Always(speed) => speed,
                Policy::Rule if drive.distance(simulation) < NEAR => SPEEDS[0],
                Policy::Rule => SPEEDS[2],
                Policy::Planner => drive.ask(&planner, &nodes.question)?,
            };
        }
        simulation.scale_robot_speed(speed / own);
        simulation.step();
        let stamp = Time::from_nanos(origin.as_nanos() + simulation.nanos());
        bus.advance_to(stamp);
        publisher.publish_step(simulation, stamp)?;
        bus.settle();
        drive.measure(simulation);
        if simulation.robots.first().is_some_and(|robot| robot.legs_done >= legs) {
            drive.seconds = Some(simulation.time());
            break;
        }
    }
    Ok(drive)
}

impl Drive {
    fn distance(&self, simulation: &Simulation) -> f64 {
        let both = simulation.robots.first().zip(simulation.people.first());
        both.map_or(f64::INFINITY, |(robot, person)| robot.position.distance(person.position))
    }

    fn measure(&mut self, simulation: &Simulation) {
        let sizes = SceneOptions::default();
        let Some((robot, person)) = simulation.robots.first().zip(simulation.people.first()) else { return };
        let approach = person.approach(robot.position, robot.velocity());
        self.risks.push(simulation.risk(person, sizes.obs_size, sizes.safe_dist));
        if approach.is_collision_course(sizes.obs_size, sizes.safe_dist) {
            self.collision_s += roscausal_hrisim::simulation::STEP;
        }
        self.nearest = self.nearest.min(self.distance(simulation));
    }

    /// The best of the speeds; the slowest if no answer can be used.
    fn ask(&mut self, planner: &LoopbackNode, question: &Question) -> Result<f64> {
        let set = |speed: f64| Action::one(speed.to_string(), Intervention::set("r_v", [speed]));
        let term =
            |(variable, weight): &(&str, f64)| CostTerm { variable: (*variable).into(), weight: *weight };
        let request = WhatIfRequest {
            horizon: question.horizon,
            actions: SPEEDS.map(set).to_vec(),
            cost: question.cost.iter().map(term).collect(),
            ..WhatIfRequest::default()
        };
        let answer: WhatIfResponse = planner.call::<WhatIf>(WHAT_IF_SERVICE, &request, PATIENCE)?;
        self.asked += 1;
        let best = answer.ranking.first().and_then(|&best| SPEEDS.get(usize::try_from(best).ok()?));
        self.answered += u64::from(best.is_some());
        Ok(best.copied().unwrap_or(SPEEDS[0]))
    }
}

/// Starts the reasoning node on the bus, which waits for it.
fn reasoning(bus: &Loopback, nodes: &Nodes) -> Result<Threaded> {
    let text = Value::Str;
    let set = |name: &str, value: Value| bus.set_node_param("reasoning", name, value);
    let data = nodes.data.iter().map(|path| text(path.display().to_string())).collect();
    set("graph", text(nodes.graph.display().to_string()));
    set("data", Value::List(data));
    set("equations", text(nodes.equations.clone()));
    // The model stays that of the explorations.
    set("max_samples", Value::Int(100_000));
    set("refit_every", Value::Double(1e6));
    set("paths", Value::Int(100));
    set("prediction_paths", Value::Int(20));
    set("threads", Value::Int(1));
    let probe = bus.node("planner").advertise::<Features>(FEATURES_TOPIC, Qos::Volatile(10))?;
    let node = Threaded::start(bus, "reasoning", |mw| core_nodes::run("reasoning", mw));
    let begun = Instant::now();
    // The rows are the last thing that it subscribes.
    while roscausal_core::middleware::Publish::subscriber_count(&probe) == 0 {
        if node.is_finished() || begun.elapsed() > PATIENCE {
            let late = Error::Middleware("the reasoning node did not start".into());
            return node.end(REASONING).and(Err(late));
        }
        thread::sleep(LOOK_AGAIN);
    }
    Ok(node)
}
