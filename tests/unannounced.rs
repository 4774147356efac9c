//! A robot that is switched off and nobody says so: the nodes record it, and the discovery node tells a change. If it is announced,
//! it is none.

#![allow(clippy::expect_used, clippy::panic, reason = "a test may panic: that is how it fails")]

#[path = "common/discovery.rs"]
mod discovery;

use std::{path::Path, thread};

use discovery::discover;
use roscausal_core::{
    loopback::Loopback,
    nodes::{self, RecordedChange, recorded_changes},
    params::Value,
};
use roscausal_discovery::changes::Status;
use roscausal_hrisim::{Scenario, Simulation, node::run_lockstep};

/// Seconds of a batch, and batches before the robot is switched off.
const BATCH_S: f64 = 300.0;
const BEFORE: f64 = 7.0;

/// The scenario, and the moment from which on the robot waits at its waypoint and stays there.
fn switched_off(seed: u64) -> (Scenario, f64) {
    let mut scenario = Scenario::named("pass_by_the_centre").expect("is built in");
    scenario.duration = 1e5;
    let mut simulation = Simulation::new(&scenario, seed).expect("a scenario");
    let waits = |simulation: &Simulation| {
        let robot = &simulation.robots[0];
        robot.v.abs() < 1e-3 && robot.waypoints.iter().any(|place| place.distance(robot.position) < 0.3)
    };
    while simulation.time() < BEFORE * BATCH_S || !waits(&simulation) {
        simulation.step();
    }
    let moment = simulation.time();
    scenario.interventions.push(format!("robot.off@{moment}..").parse().expect("an intervention"));
    scenario.duration = moment + 4.0 * BATCH_S;
    (scenario, moment)
}

/// Runs the nodes that record on a simulation, in simulated time.
fn record(dir: &Path, scenario: &Scenario, seed: u64, announced: bool) {
    let mut simulation = Simulation::new(scenario, seed).expect("a scenario");
    let bus = Loopback::lockstep();
    let text = |name: &str| Value::Str(dir.join(name).display().to_string());
    let topic = if announced { "/hri/interventions" } else { "" };
    for (name, value) in [
        ("data_dir", text("raw")),
        ("pp_data_dir", text("pp")),
        ("ts_length", Value::Double(BATCH_S)),
        ("dt", Value::Double(0.3)),
        ("risk_lag", Value::Int(1)),
        ("risk_noise", Value::Double(0.02)),
        ("context_topic", Value::Str(topic.into())),
    ] {
        bus.set_node_param("data", name, value);
    }
    let tasks = ["robot", "human", "data"]
        .map(|name| (name, bus.start_task(name, async move |mw| nodes::run_task(name, &mw).await)));
    run_lockstep(&bus, &mut simulation, 1, |_| true).expect("runs");
    for (name, task) in tasks {
        task.end().expect("no panic").expect(name);
    }
}

/// What the discovery node tells of the batches.
fn reported(dir: &Path) -> Vec<RecordedChange> {
    discover(dir, 1e5, 4);
    recorded_changes(&dir.join("models")).expect("reads")
}

/// Whether the first change that is confirmed names a link of the risk, at the end of one of the three batches from the one in which
/// the robot is switched off; and whether none came before.
fn is_told(seed: u64) -> bool {
    let dir = tempfile::tempdir().expect("a folder");
    let (scenario, moment) = switched_off(seed);
    record(dir.path(), &scenario, seed, false);
    let reported = reported(dir.path());
    let first = reported.iter().find(|change| change.event.status == Status::Confirmed);
    // The recording begins within the first seconds.
    let last = ((moment / BATCH_S).floor() + 3.0) * BATCH_S + 5.0;
    let right = first.is_some_and(|change| {
        let of_risk = [&change.event.cause, &change.event.effect].iter().any(|name| *name == "h_risk");
        of_risk && change.told > moment && change.told <= last
    });
    println!("seed {seed}, off at {moment:.1} s: {first:?}");
    right
}

/// Each decision is a test at some level, so this is a law of several runs.
#[test]
fn a_robot_that_is_switched_off_without_a_word_is_told_as_a_change_of_the_risk_within_three_batches() {
    let runs: Vec<_> = (1..=4).map(|seed| thread::spawn(move || is_told(seed))).collect();
    let right =
        runs.into_iter().map(|run| run.join().expect("no panic")).filter(|reported| *reported).count();
    assert!(right >= 3, "of 4: {right}");
}

#[test]
fn a_robot_that_is_switched_off_with_an_announcement_is_no_change() {
    let dir = tempfile::tempdir().expect("a folder");
    let (scenario, moment) = switched_off(1);
    record(dir.path(), &scenario, 1, true);
    let after: Vec<RecordedChange> = reported(dir.path())
        .into_iter()
        .filter(|change| change.event.status == Status::Confirmed && change.told > moment)
        .collect();
    assert_eq!(after, []);
}
