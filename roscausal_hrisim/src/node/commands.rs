//! Commands from topics: teleoperation, speed scale, pause, step, reset, interventions.

use roscausal_core::{
    Error, Result,
    inbox::Inbox,
    middleware::{Middleware, Qos},
};
use roscausal_msgs::{
    geometry_msgs::Twist,
    std_msgs::{Float64, String as Text},
};

use crate::{Simulation, intervention::Intervention, person::Teleop};

const FORMS: &str = "use pause, resume, step, step N, reset or autonomous";

/// One command, as received.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Command {
    /// `/ped/control/cmd_vel`: drives the first person.
    Teleop(Teleop),
    /// `twist_mux/scaling_factor`: scales the robots' speeds.
    Scale(f64),
    /// `/hri/control`: see [`FORMS`].
    Control(String),
    /// `/hri/do`: an intervention. Without times it applies from now on.
    Do(String),
    /// `/hri/way`: seconds to wait, and the places of the way on which the robot has to decide.
    Way(String),
}

/// Whether simulated time is running.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Running {
    /// Time stands still.
    pub(super) paused: bool,
    /// Steps to take although time stands still.
    pub(super) steps: u64,
    /// The simulation restarted.
    pub(super) reset: bool,
}

/// Subscribes all commands into `inbox`. The subscriptions end when the returned handles are dropped.
pub(super) fn subscribe<M: Middleware>(mw: &M, inbox: &Inbox<Command>) -> Result<Vec<M::Subscription>> {
    let qos = Qos::Volatile(10);
    let teleop = |twist: Twist| Command::Teleop(Teleop { v: twist.linear.x, omega: twist.angular.z });
    Ok(vec![
        inbox.subscribe(mw, "/ped/control/cmd_vel", qos, teleop)?,
        inbox
            .subscribe(mw, "twist_mux/scaling_factor", qos, |factor: Float64| Command::Scale(factor.data))?,
        inbox.subscribe(mw, "/hri/control", qos, |text: Text| Command::Control(text.data))?,
        inbox.subscribe(mw, "/hri/do", qos, |text: Text| Command::Do(text.data))?,
        inbox.subscribe(mw, "/hri/way", qos, |text: Text| Command::Way(text.data))?,
    ])
}

/// Carries out one command.
///
/// # Errors
/// A command that is unknown or not allowed, with the allowed ones. It changes nothing.
pub(super) fn obey(command: &Command, simulation: &mut Simulation, running: &mut Running) -> Result<()> {
    match command {
        Command::Teleop(teleop) => match simulation.people.first().map(|person| person.id) {
            Some(id) => simulation.teleoperate(id, Some(*teleop)),
            None => Err(Error::param("/ped/control/cmd_vel", "there is no person to drive")),
        },
        Command::Scale(factor) => {
            simulation.scale_robot_speed(*factor);
            Ok(())
        }
        Command::Control(text) => control(text, simulation, running),
        Command::Way(text) => way(text, simulation),
        Command::Do(text) => simulation.intervene(imposed(text, simulation.time())?),
    }
}

fn control(text: &str, simulation: &mut Simulation, running: &mut Running) -> Result<()> {
    let words: Vec<&str> = text.split_whitespace().collect();
    match words.as_slice() {
        ["pause"] => running.paused = true,
        ["resume"] => running.paused = false,
        ["step"] => *running = Running { paused: true, steps: running.steps + 1, ..*running },
        ["step", count] => {
            let reason = || format!("'{count}' is not a number of steps; {FORMS}");
            let count: u32 = count.parse().map_err(|_| Error::param("/hri/control", reason()))?;
            *running = Running { paused: true, steps: running.steps + u64::from(count), ..*running };
        }
        ["reset"] => {
            simulation.reset()?;
            running.reset = true;
        }
        ["autonomous"] => {
            let ids: Vec<u32> = simulation.people.iter().map(|person| person.id).collect();
            ids.into_iter().try_for_each(|id| simulation.teleoperate(id, None))?;
        }
        _ => return Err(Error::param("/hri/control", format!("'{text}' is unknown; {FORMS}"))),
    }
    Ok(())
}

/// `12.5 dock_s0 south_0 ...`: after 12.5 s, by these places.
fn way(text: &str, simulation: &mut Simulation) -> Result<()> {
    let time = simulation.time();
    let bad = |reason: String| Error::param("/hri/way", reason);
    let Some(day) = &mut simulation.day else { return Err(bad("this scenario has no working day".into())) };
    let mut words = text.split_whitespace();
    let wait = words.next().and_then(|word| word.parse::<f64>().ok()).filter(|wait| *wait >= 0.0);
    let wait = wait.ok_or_else(|| bad(format!("'{text}' does not begin with the seconds to wait")))?;
    let places = words.map(|name| Ok(day.map.place(name)?)).collect::<Result<Vec<usize>>>()?;
    let reason = "it is no way from the robot to where it has to go, along arcs of the map";
    Error::ensure(day.decide(time + wait, &places), "/hri/way", || reason)
}

fn imposed(text: &str, now: f64) -> Result<Intervention> {
    let mut one: Intervention = text.parse().map_err(|reason: String| Error::param("/hri/do", reason))?;
    one.start = one.start.max(now);
    Error::ensure(one.end > one.start, "/hri/do", || format!("'{text}' is over: it is {now:.2} s now"))?;
    Ok(one)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Scenario;

    fn after(texts: &[&str]) -> (Simulation, Running, Vec<String>) {
        let mut simulation = Simulation::new(&Scenario::default(), 1).unwrap();
        (0..50).for_each(|_| simulation.step());
        let mut running = Running::default();
        let mut stated = Vec::new();
        for text in texts {
            let command = match text.strip_prefix("do ") {
                Some(order) => Command::Do(order.to_owned()),
                None => Command::Control((*text).to_owned()),
            };
            stated.extend(obey(&command, &mut simulation, &mut running).err().map(|error| error.to_string()));
        }
        (simulation, running, stated)
    }

    #[test]
    fn pause_step_resume_and_reset_do_what_they_say() {
        assert!(after(&["pause"]).1.paused && !after(&["pause", "resume"]).1.paused);
        assert_eq!(after(&["step", "step 25"]).1, Running { paused: true, steps: 26, reset: false });
        let (simulation, running, _) = after(&["reset"]);
        assert!(running.reset && simulation.time() == 0.0);
    }

    #[test]
    fn interventions_start_now_at_the_earliest() {
        let (simulation, _, stated) = after(&["do robot.speed=0.1", "do human.v=1@1..3"]);
        assert!(stated.is_empty(), "{stated:?}");
        assert_eq!(simulation.interventions()[0].start, 2.0);
        assert_eq!((simulation.interventions()[1].start, simulation.interventions()[1].end), (2.0, 3.0));
    }

    #[test]
    fn what_is_not_understood_is_said_with_the_allowed_words() {
        let (_, running, stated) = after(&["halt", "step x", "do fly", "do human.v=1@0..1"]);
        assert_eq!(running, Running::default());
        assert!(stated[0].contains("resume") && stated[1].contains("step N"), "{stated:?}");
        assert!(stated[2].contains("robot.speed") && stated[3].contains("is over"), "{stated:?}");
    }
}
