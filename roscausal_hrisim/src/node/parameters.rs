//! The simulator's parameters, and the node as the backends start it.

use roscausal_core::{
    Result,
    middleware::Middleware,
    param_specs,
    params::{Allowed, ParamSpec, Params, Value},
};

use super::{Options, Pace, hrisim};
use crate::{Scenario, Simulation};

/// Names, defaults, allowed values and descriptions.
pub fn parameters() -> Vec<ParamSpec> {
    use Allowed::{Any, Range};
    param_specs! {
        "scenario" = Value::Str("thor".into()), Any,
            "name of a built-in scenario (thor, encounters, crowd, ...) or a scenario file";
        "do" = Value::List(Vec::new()), Any,
            "interventions in addition to those of the scenario, such as robot.speed=0.2@60..90";
        "seed" = Value::Int(1), Range(0.0, 9e15), "seed of all random numbers";
        "duration" = Value::Double(0.0), Range(0.0, 1e7), "simulated seconds; 0: as the scenario says";
        "speed" = Value::Double(1.0), Range(0.0, 1000.0),
            "how many times faster than real time; 0: as fast as the machine allows";
        "clock" = Value::Bool(true), Any, "publish /clock and stamp with simulated time";
        "guided" = Value::Bool(false), Any,
            "of a working day: the robot waits for /hri/way before each way, instead of taking the shortest at once";
        "every" = Value::Int(1), Range(1.0, 250.0), "steps of 0.04 s per message";
    }
}

/// Runs the simulator with its parameters, until its time is over or the middleware ends.
///
/// # Errors
/// A parameter that is not allowed, a scenario that cannot be used, or a topic that the middleware refuses.
pub fn run<M: Middleware>(mw: &M) -> Result<()> {
    let params = Params::read(mw, &parameters())?;
    let mut scenario = Scenario::load(&params.text("scenario"))?;
    if params.double("duration") > 0.0 {
        scenario.duration = params.double("duration");
    }
    scenario.add_interventions(&params.list("do"))?;
    let mut simulation = Simulation::new(&scenario, u64::try_from(params.int("seed")).unwrap_or(0))?;
    if let Some(day) = &mut simulation.day {
        day.porter.guided = params.flag("guided");
    }
    let speed = params.double("speed");
    let options = Options {
        pace: if speed > 0.0 { Pace::Times(speed) } else { Pace::Max },
        clock: params.flag("clock"),
        every: params.count("every") as u64,
    };
    hrisim(mw, simulation, &options).map(|_| ())
}

#[cfg(test)]
mod tests {
    use super::*;
    use roscausal_core::{Time, loopback::Loopback, middleware::Qos};
    use roscausal_msgs::rosgraph_msgs::Clock;

    #[test]
    fn the_parameters_make_the_simulation() {
        let bus = Loopback::live(|| Time::ZERO);
        let seconds = std::sync::Arc::new(std::sync::Mutex::new(Time::ZERO));
        let last = seconds.clone();
        let user = bus.node("user");
        let _clock =
            user.subscribe("/clock", Qos::Volatile(10), move |m: Clock| *last.lock().unwrap() = m.clock);
        for (name, value) in [("duration", Value::Double(2.0)), ("speed", Value::Int(0))] {
            bus.set_node_param("hrisim", name, value);
        }
        run(&bus.node("hrisim")).unwrap();
        assert_eq!(seconds.lock().unwrap().as_secs_f64(), 2.0);
        bus.set_node_param("hrisim", "scenario", Value::Str("thorr".into()));
        assert!(run(&bus.node("hrisim")).unwrap_err().to_string().contains("thor"));
    }
}
