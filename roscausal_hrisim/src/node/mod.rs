//! The simulator as a node: it publishes like a robot and a people tracker on any middleware, and obeys commands.
//!
//! Topics out:
//! - each robot (below `/NAME` if it has a name): `/mobile_base_controller/odom`, `/robot_pose`, `/goal_pose` and, on
//!   ROS 1, `/move_base/goal`; its frames on `/tf` (`map -> odom -> base_footprint`);
//! - people: `/ped/control/teleop_persons` (scripted or driven people), `/pedsim_simulator/simulated_agents`
//!   (pedestrians), `/hri/human_goal` (topic and parameter; `/hri/human_goal_ID` for all except the first person),
//!   `/hri/human_goals` (`TrackedPersons` whose poses are everybody's goals), `/hri/risk`;
//! - the rest: `/pedsim_simulator/simulated_walls`, `/clock`, and `/hri/interventions`, a JSON text
//!   `{"stamp": s, "time": s, "context": {column: [value]}}` in which an empty list means that nothing is imposed.
//! - of a working day, once a second: `/people_counter/PLACE`, `/robot_at/PLACE`, `/hour`, `/battery` (percent), `/load`, and
//!   `/hri/leg`, a JSON text with the way on which somebody has to decide (parameter `guided`).
//!
//! Topics in:
//! - `/ped/control/cmd_vel` and `twist_mux/scaling_factor`;
//! - `/hri/control`: `pause`, `resume`, `step`, `step N`, `reset`, `autonomous`;
//! - `/hri/way`: the decision on such a way, as seconds to wait and the names of its places;
//! - `/hri/do`: an intervention, such as `robot.speed=0.2@60..90`.

mod commands;
mod parameters;
mod publisher;
mod sensors;

use std::time::{Duration, Instant};

use roscausal_core::{
    Error, Result, Time,
    inbox::{Inbox, Next},
    loopback::Loopback,
    middleware::{Middleware, Publish, Qos},
};
use roscausal_msgs::rosgraph_msgs::Clock;

use crate::{
    Simulation,
    simulation::{STEP, STEP_NANOS},
};
use commands::{Command, Running, obey, subscribe};
pub use parameters::{parameters, run};
pub use publisher::Publisher;
pub use sensors::{Measured, Sensors};

/// How fast simulated time goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pace {
    /// This many times real time; 1: real time.
    Times(f64),
    /// As fast as the machine allows.
    Max,
}

roscausal_core::with_defaults! {
    /// Options of the node.
    #[derive(Clone, Debug, PartialEq)]
    pub struct Options {
        /// How fast simulated time goes.
        pub pace: Pace = Pace::Times(1.0),
        /// Whether to publish `/clock` and stamp with simulated time (for nodes with `use_sim_time`). Otherwise stamps
        /// are the middleware's time, which suits real time only.
        pub clock: bool = false,
        /// Steps per message: 1 is 25 Hz.
        pub every: u64 = 1,
    }
}

impl Options {
    fn check(&self) -> Result<()> {
        match self.pace {
            Pace::Times(factor) => {
                Error::ensure((0.01..=1000.0).contains(&factor), "speed", || {
                    format!("{factor} is not allowed; use 0.01 to 1000, or max")
                })?;
                let reason = "other than real time needs /clock; switch `clock` on";
                Error::ensure(factor == 1.0 || self.clock, "speed", || reason)?;
            }
            Pace::Max => Error::ensure(self.clock, "speed", || "max needs /clock; switch `clock` on")?,
        }
        Error::ensure((1..=250).contains(&self.every), "every", || {
            format!("{} is not allowed; use 1 to 250 steps", self.every)
        })
    }
}

/// Runs `simulation` until its duration is over or the node has to end.
///
/// # Errors
/// Invalid options, or a topic that the middleware refuses.
pub fn hrisim<M: Middleware>(mw: &M, mut simulation: Simulation, options: &Options) -> Result<Simulation> {
    options.check()?;
    let inbox = Inbox::detached(mw, 100);
    let _subscriptions = subscribe(mw, &inbox)?;
    let clock = if options.clock { Some(mw.advertise::<Clock>("/clock", Qos::Volatile(10))?) } else { None };
    let mut publisher = Publisher::new(mw, &simulation)?;
    let mut running = Running::default();
    let mut schedule = Schedule::new(mw.now(), options);
    while mw.is_ok() && !simulation.is_over() {
        wait(mw, &inbox, &mut simulation, &mut running, &schedule);
        if std::mem::take(&mut running.reset) {
            publisher = Publisher::new(mw, &simulation)?;
        }
        if running.paused && running.steps == 0 {
            schedule.stand_still();
            continue;
        }
        running.steps = running.steps.saturating_sub(1);
        simulation.step();
        schedule.ticks += 1;
        let stamp = schedule.stamp();
        if let Some(clock) = &clock {
            clock.publish(&Clock { clock: stamp })?;
        }
        if simulation.steps().is_multiple_of(options.every) {
            publisher.publish_step(&simulation, stamp)?;
        }
    }
    Ok(simulation)
}

/// When each step is due. Time never goes back, not even when the simulation restarts.
struct Schedule {
    begin: Instant,
    /// Stamp of tick 0.
    origin: Time,
    ticks: u64,
    /// Real seconds per tick; 0: at once.
    period: f64,
}

impl Schedule {
    fn new(now: Time, options: &Options) -> Self {
        let period = match options.pace {
            Pace::Times(factor) => STEP / factor,
            Pace::Max => 0.0,
        };
        let origin = if options.clock { Time::ZERO } else { now };
        Self { begin: Instant::now(), origin, ticks: 0, period }
    }

    fn stamp(&self) -> Time {
        Time::from_nanos(self.origin.as_nanos().saturating_add(self.ticks as i64 * STEP_NANOS))
    }

    /// Real time until the next step.
    fn left(&self) -> Duration {
        let due = Duration::from_secs_f64((self.ticks + 1) as f64 * self.period);
        due.saturating_sub(self.begin.elapsed())
    }

    /// While time stands still, what is due stays due.
    fn stand_still(&mut self) {
        let past = Duration::from_secs_f64(self.ticks as f64 * self.period);
        let now = Instant::now();
        self.begin = now.checked_sub(past).unwrap_or(now);
    }
}

/// Obeys commands until the next step is due, or for a while when paused.
fn wait<M: Middleware>(
    mw: &M,
    inbox: &Inbox<Command>,
    simulation: &mut Simulation,
    running: &mut Running,
    schedule: &Schedule,
) {
    const LOOK_AGAIN: Duration = Duration::from_millis(5);
    loop {
        while let Next::Event(command) = inbox.next(mw, Some(mw.now())) {
            if let Err(reason) = obey(&command, simulation, running) {
                tracing::warn!("{reason}");
            }
        }
        let left = if running.paused && running.steps == 0 { LOOK_AGAIN } else { schedule.left() };
        if left.is_zero() || !mw.is_ok() {
            return;
        }
        std::thread::sleep(left.min(LOOK_AGAIN));
        if running.paused && running.steps == 0 {
            return;
        }
    }
}

/// Runs `simulation` to its end on a lockstep bus: every message is delivered and handled before the next. So the
/// run is the same whatever the threads do. `every` is as in [`Options`]. `each_step` is called after each step; it
/// ends the run by returning false.
///
/// # Errors
/// A topic that the bus refuses.
pub fn run_lockstep(
    bus: &Loopback,
    simulation: &mut Simulation,
    every: u64,
    mut each_step: impl FnMut(&Simulation) -> bool,
) -> Result<()> {
    let mut publisher = Publisher::new(&bus.node("hrisim"), simulation)?;
    let origin = bus.now();
    while !simulation.is_over() {
        simulation.step();
        if simulation.steps().is_multiple_of(every.max(1)) {
            let stamp = Time::from_nanos(origin.as_nanos() + simulation.nanos());
            bus.advance_to(stamp);
            publisher.publish_step(simulation, stamp)?;
            bus.settle();
        }
        if !each_step(simulation) {
            break;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
