//! One simulated run as the nodes record it, at several step sizes at once.

use std::{collections::BTreeMap, ops::Range};

use roscausal_core::{
    Error, Result,
    batch::{
        Recording, Sampling, Select,
        recorder::{Recorder, RecorderConfig},
    },
    inbox::{Inbox, Next},
    loopback::{Loopback, LoopbackNode},
    middleware::{Middleware, Qos},
    nodes,
};
use roscausal_hrisim::{Scenario, Simulation, node::run_lockstep};
use roscausal_msgs::{Humans, RobotState, std_msgs::String as Text};

use crate::{
    interrupt::Interrupt,
    nodes::{first_person, first_robot, set_subjects},
};

/// Seconds simulated in addition to the recording, until every topic has begun.
const WARM_UP_S: f64 = 3.0;
/// A recording is analysed in parts of at most this length in seconds, the data node's default.
const BATCH_S: f64 = 150.0;
/// As in the data node.
const MAX_GAP_S: f64 = 0.5;

enum Event {
    Robot(RobotState),
    Humans(Humans),
    Context(String),
}

/// Simulates `seconds` of the scenario through the robot and the human node on a lockstep bus, and returns one
/// recording per step size. The recorder is the data node's, so the rows are those that the node would write.
///
/// # Errors
/// A scenario or step that cannot be used, an interrupt, or a failing node.
pub(crate) fn record(
    scenario: &Scenario,
    seed: u64,
    seconds: f64,
    steps: &[f64],
    interrupt: &Interrupt,
) -> Result<Vec<Recording>> {
    let scenario = Scenario { duration: seconds + WARM_UP_S, ..scenario.clone() };
    let mut simulation = Simulation::new(&scenario, seed)?;
    let bus = Loopback::lockstep();
    set_subjects(&bus, &simulation);
    let robot_topic = match first_robot(&simulation) {
        "" => "/roscausal/robot".to_owned(),
        name => format!("/{name}/roscausal/robot"),
    };
    let robot = bus.start_task("robot", async |mw| nodes::run_task("robot", &mw).await);
    let human = bus.start_task("human", async |mw| nodes::run_task("human", &mw).await);
    let config = |step: &f64| RecorderConfig {
        dt_s: *step,
        ts_length_s: None,
        max_gap_s: MAX_GAP_S.max(*step),
        sampling: Sampling::default(),
        select: Select::Ids([first_person(&simulation)].into()),
    };
    let recorders: Vec<Recorder> = steps.iter().map(|step| Recorder::new(config(step))).collect();
    let recording = bus.start_task("data", async move |mw| listen(&mw, &robot_topic, recorders).await);
    let done = run_lockstep(&bus, &mut simulation, 1, |_| !interrupt.is_set());
    bus.shutdown();
    let died = |_| Error::Middleware("a node died; please report it".into());
    robot.end().map_err(died)??;
    human.end().map_err(died)??;
    let recorders =
        recording.end().map_err(|_| Error::Middleware("the recorder died; please report it".into()))??;
    done?;
    interrupt.check()?;
    let one = |mut recorder: Recorder| {
        recorder.finish();
        recorder.take_batches().into_iter().next().ok_or_else(|| Error::Data("nobody was recorded".into()))
    };
    recorders.into_iter().map(one).collect()
}

/// Feeds what the nodes publish to all recorders until the bus ends.
async fn listen(mw: &LoopbackNode, robot_topic: &str, mut recorders: Vec<Recorder>) -> Result<Vec<Recorder>> {
    let inbox = Inbox::new(mw, 20_000);
    let qos = Qos::Volatile(1000);
    let _robot = inbox.subscribe(mw, robot_topic, qos, Event::Robot)?;
    let _humans = inbox.subscribe(mw, "/roscausal/humans", qos, Event::Humans)?;
    let context = |m: Text| Event::Context(m.data);
    let _context = inbox.subscribe(mw, "/hri/interventions", Qos::Latched, context)?;
    loop {
        match inbox.awaited(mw, None).await {
            Next::Shutdown => return Ok(recorders),
            Next::Deadline => {}
            Next::Event(Event::Robot(state)) => {
                recorders.iter_mut().for_each(|recorder| recorder.robot(&state, mw.now()));
            }
            Next::Event(Event::Context(text)) => {
                recorders.iter_mut().try_for_each(|one| one.context(&text, mw.now()).map_err(Error::Data))?;
            }
            Next::Event(Event::Humans(people)) => {
                recorders.iter_mut().for_each(|recorder| recorder.humans(&people, mw.now()));
            }
        }
    }
}

/// The first `length` seconds as batches of equal length, none longer than the data node's default.
///
/// # Errors
/// A recording that is too short.
pub(crate) fn batches(recording: &Recording, length: f64) -> Result<Vec<Recording>> {
    let step = recording.dt_ns as f64 * 1e-9;
    let count = (length / BATCH_S).ceil().max(1.0);
    let rows = (length / count / step).round() as usize;
    let count = count as usize;
    Error::ensure_data(recording.n_rows() >= rows * count, || {
        format!("{} rows were recorded for {length} s at {step} s", recording.n_rows())
    })?;
    Ok(cut(recording, rows, count))
}

/// The first `count` batches of `rows` rows each.
pub(super) fn cut(recording: &Recording, rows: usize, count: usize) -> Vec<Recording> {
    let cut = |batch: usize| {
        let range = batch * rows..(batch + 1) * rows;
        Recording {
            start: recording.stamp(range.start),
            robot: recording.robot[range.clone()].to_vec(),
            people: part(&recording.people, &range),
            others: part(&recording.others, &range),
            context: part(&recording.context, &range),
            ..recording.clone()
        }
    };
    (0..count).map(cut).collect()
}

fn part<K: Clone + Ord, T: Clone>(all: &BTreeMap<K, Vec<T>>, range: &Range<usize>) -> BTreeMap<K, Vec<T>> {
    all.iter().map(|(key, rows)| (key.clone(), rows[range.clone()].to_vec())).collect()
}
