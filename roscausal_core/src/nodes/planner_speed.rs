//! The top speed of a planner of ROS 1, which `dynamic_reconfigure` sets while it runs.
//!
//! 1. Asked with nothing to set, the planner says what its own top speed is. That is kept as a parameter beside it, for an advisor or a
//!    watchdog that starts later must not take a limit for it.
//! 2. A limit becomes the top speed, if it is below the planner's own. Without a limit, and when a node ends, the own one is back.
//!
//! Example: move_base with DWA drives 0.55 m/s at most; an advice of 0.2 m/s sets `max_vel_x` to 0.2, and none sets it to 0.55.

use std::time::Duration;

use roscausal_msgs::dynamic_reconfigure::{
    Config, DoubleParameter, Reconfigure, ReconfigureRequest, ReconfigureResponse,
};

use crate::{
    Error, Result,
    middleware::Middleware,
    param_specs,
    params::{Allowed, ParamSpec, Params, Value},
};

/// How long a planner may take to answer.
const PATIENCE: Duration = Duration::from_secs(1);

/// Names, defaults, allowed values and descriptions.
pub(super) fn specs() -> Vec<ParamSpec> {
    let text = |text: &str| Value::Str(text.to_owned());
    param_specs! {
        "planner" = text(""), Allowed::Any,
            "ROS 1: planner whose top speed is set by dynamic_reconfigure, such as /move_base/DWAPlannerROS; empty: none";
        "planner_speed" = text("max_vel_x"), Allowed::Any, "its parameter, m/s";
    }
}

/// A planner, and what it was told.
pub(super) struct Planner {
    name: String,
    parameter: String,
    /// Its own top speed, once it is known.
    own: Option<f64>,
    told: Option<f64>,
    in_trouble: bool,
}

impl Planner {
    /// The planner of the parameters, if they name one.
    pub(super) fn read(params: &Params) -> Option<Self> {
        let name = params.text_if_set("planner")?.trim_end_matches('/').to_owned();
        Some(Self { name, parameter: params.text("planner_speed"), own: None, told: None, in_trouble: false })
    }

    /// Sets a limit in m/s, or the planner's own top speed. What keeps it from that is told once.
    pub(super) fn limit<M: Middleware>(&mut self, mw: &M, limit: Option<f64>) {
        let trouble = self.try_limit(mw, limit).err();
        if let Some(error) = trouble.as_ref().filter(|_| !self.in_trouble) {
            tracing::warn!("the top speed of {} is not set: {error}", self.name);
        }
        self.in_trouble = trouble.is_some();
    }

    fn try_limit<M: Middleware>(&mut self, mw: &M, limit: Option<f64>) -> Result<()> {
        let own = self.own(mw)?;
        let wanted = limit.map_or(own, |limit| limit.min(own));
        if self.told != Some(wanted) {
            let parameter = DoubleParameter { name: self.parameter.clone(), value: wanted };
            self.ask(mw, Config { doubles: vec![parameter], ..Config::default() })?;
            self.told = Some(wanted);
        }
        Ok(())
    }

    /// The planner's own top speed.
    fn own<M: Middleware>(&mut self, mw: &M) -> Result<f64> {
        if let Some(own) = self.own {
            return Ok(own);
        }
        let name = format!("{}/roscausal_own_{}", self.name, self.parameter);
        // Once in a run of a node: a specification's name lives as long as the program.
        let description = "the planner's own top speed";
        let spec = ParamSpec::new(name.clone().leak(), Value::Double(0.0), Allowed::Any, description);
        let own = match mw.param(&spec)?.and_then(|value| value.as_double()) {
            Some(own) => own,
            None => {
                let own = self.ask(mw, Config::default())?;
                mw.set_param(&name, Value::Double(own))?;
                own
            }
        };
        self.own = Some(own);
        Ok(own)
    }

    /// Has the planner set something. Returns its top speed.
    fn ask<M: Middleware>(&self, mw: &M, config: Config) -> Result<f64> {
        let service = format!("{}/set_parameters", self.name);
        let ReconfigureResponse { config } =
            mw.call::<Reconfigure>(&service, &ReconfigureRequest { config }, PATIENCE)?;
        let speed = config.doubles.into_iter().find(|double| double.name == self.parameter);
        let missing =
            || Error::Service { service, reason: format!("it has no parameter '{}'", self.parameter) };
        speed.map(|speed| speed.value).ok_or_else(missing)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use super::*;
    use crate::{Time, gate::lock, loopback::Loopback};

    #[test]
    fn a_limit_is_the_planner_s_top_speed_never_above_its_own_which_comes_back() {
        let bus = Loopback::live(|| Time::from_secs_f64(1.0));
        let speed = Arc::new(Mutex::new(0.55));
        let of_planner = speed.clone();
        let _served = bus.node("move_base").serve::<Reconfigure>(
            "/move_base/DWA/set_parameters",
            move |request: ReconfigureRequest, reply| {
                let mut speed = lock(&of_planner);
                request.config.doubles.iter().for_each(|double| *speed = double.value);
                let doubles = vec![DoubleParameter { name: "max_vel_x".into(), value: *speed }];
                reply.send(ReconfigureResponse { config: Config { doubles, ..Config::default() } });
            },
        );
        bus.set_node_param("advisor", "planner", Value::Str("/move_base/DWA/".into()));
        let advisor = bus.node("advisor");
        let started =
            || Planner::read(&Params::read(&advisor, &specs()).expect("parameters")).expect("a planner");
        let mut planner = started();
        for (limit, wanted) in [(Some(0.2), 0.2), (Some(9.0), 0.55), (None, 0.55), (Some(0.3), 0.3)] {
            planner.limit(&advisor, limit);
            assert_eq!(*lock(&speed), wanted, "{limit:?}");
        }
        // One that starts later does not take the limit for the planner's own speed.
        started().limit(&advisor, None);
        assert_eq!((*lock(&speed), planner.in_trouble), (0.55, false));
        bus.set_node_param("advisor", "planner_speed", Value::Str("top".into()));
        let mut lost = started();
        lost.limit(&advisor, Some(0.1));
        assert_eq!((*lock(&speed), lost.in_trouble), (0.55, true), "it has no such parameter");
    }
}
