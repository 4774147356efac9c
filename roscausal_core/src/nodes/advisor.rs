//! The advisor node: asks what several speeds lead to, and publishes the best as a limit of speed, which Nav2 obeys.
//!
//! 1. At a rate it asks the reasoning node what comes of each of some speeds, held over the next steps.
//! 2. The best becomes the limit: in m/s, or in per cent of the robot's top speed, and never above that.
//! 3. What is refused, late or not supported by the data has no best, and neither has a question without an answer. Then the limit is what
//!    the parameter `otherwise` says: `none`, which is 0 in Nav2's message, or a speed. So it is when the node ends.
//!
//! It publishes no velocity, and it is no safety function: a robot's own limits and its emergency stop stay what they are.
//!
//! A planner of ROS 1 has its top speed set instead (`planner_speed`).
//!
//! The watchdog node is a process of its own: when limits stop coming, because the advisor was killed or hangs, it publishes `otherwise` in
//! its place.

use std::time::Duration;

use roscausal_msgs::{
    Action, CostTerm, Intervention, Limit, WhatIf, WhatIfRequest, WhatIfResponse, nav2_msgs::SpeedLimit,
    std_msgs::Header,
};

use super::{
    health::Health,
    planner_speed::{self, Planner},
    reasoning::WHAT_IF_SERVICE,
};
use crate::{
    Error, Result,
    inbox::{Inbox, Next},
    middleware::{Middleware, Publish, Qos},
    param_specs,
    params::{Allowed, ParamSpec, Params, Value},
};

/// How long the last limit has to leave.
const LAST_WORD: Duration = Duration::from_millis(300);

/// Names, defaults, allowed values and descriptions.
pub(super) fn specs() -> Vec<ParamSpec> {
    use Allowed::{Any, Range};
    use Value::{Double, Int, List, Str};
    let text = |text: &str| Str(text.to_owned());
    let mut specs = param_specs! {
        "variable" = text("r_v"), Any, "the variable that the robot sets: its speed";
        "speeds" = List(["0.2", "0.5", "0.8"].map(text).to_vec()), Any, "speeds to choose from, m/s";
        "cost" = List(["h_risk=1", "r_v=-0.2"].map(text).to_vec()), Any,
            "what an action costs: variables' means over the steps with weights";
        "keep_above" = List(Vec::new()), Any, "bounds to keep with a probability of 0.95, such as d=1.5: d stays above it";
        "horizon" = Int(10), Range(1.0, 1000.0), "steps ahead";
        "rate" = Double(2.0), Range(0.01, 50.0), "questions a second";
        "patience" = Double(1.0), Range(0.01, 60.0), "seconds after which an answer is too late";
    };
    specs.extend(limit_specs());
    specs
}

/// Parameters of the watchdog: how long it waits, and what both publish.
pub(super) fn watchdog_specs() -> Vec<ParamSpec> {
    let mut specs = param_specs! {
        "silence" = Value::Double(3.0), Allowed::Range(0.1, 60.0), "seconds without a limit after which the advisor is taken as gone";
    };
    specs.extend(limit_specs());
    specs
}

/// Parameters of what is published.
fn limit_specs() -> Vec<ParamSpec> {
    use Allowed::{Any, Range};
    use Value::{Bool, Double};
    let text = |text: &str| Value::Str(text.to_owned());
    let mut specs = param_specs! {
        "top_speed" = Double(0.0), Range(0.0, 100.0), "the planner's own top speed, m/s, above which no limit goes; 0: not known";
        "percentage" = Bool(false), Any, "publish per cent of top_speed instead of m/s";
        "otherwise" = text(""), Any, "limit without a supported answer, m/s; none or empty: no limit";
        "speed_limit_topic" = text("speed_limit"), Any, "nav2_msgs/SpeedLimit for the controller server";
    };
    specs.extend(planner_speed::specs());
    specs
}

fn number(name: &'static str, text: &str) -> Result<f64> {
    let value = text.trim().parse::<f64>().ok().filter(|value| value.is_finite());
    value.ok_or_else(|| Error::param(name, format!("'{text}' is not a number")))
}

/// What is published, and what where there is nothing better.
struct Limits {
    top_speed: f64,
    percentage: bool,
    otherwise: Option<f64>,
}

impl Limits {
    fn read(params: &Params) -> Result<Self> {
        let (top_speed, percentage) = (params.double("top_speed"), params.flag("percentage"));
        let reason = "it needs top_speed: per cent of what?";
        Error::ensure(!percentage || top_speed != 0.0, "percentage", || reason)?;
        let mut limits = Self { top_speed, percentage, otherwise: None };
        let speed = params.text("otherwise");
        if !speed.is_empty() {
            let reason = "give none, or a speed above 0 and not above top_speed";
            let speed = Some(number("otherwise", &speed)?).filter(|speed| limits.allow(*speed));
            limits.otherwise = Some(speed.ok_or_else(|| Error::param("otherwise", reason))?);
        }
        Ok(limits)
    }

    fn allow(&self, speed: f64) -> bool {
        let highest = if self.top_speed > 0.0 { self.top_speed } else { f64::INFINITY };
        speed > 0.0 && speed <= highest
    }

    /// The message for a limit in m/s; 0 is none.
    fn message<M: Middleware>(&self, mw: &M, limit: Option<f64>) -> SpeedLimit {
        let speed_limit = match limit {
            None => 0.0,
            Some(speed) if self.percentage => (100.0 * speed / self.top_speed).min(100.0),
            Some(speed) => speed,
        };
        let header = Header { stamp: mw.now(), frame_id: "map".into() };
        SpeedLimit { header, percentage: self.percentage, speed_limit }
    }
}

/// The parameters of the advisor, checked.
struct Advice {
    question: WhatIfRequest,
    speeds: Vec<f64>,
    limits: Limits,
    period_s: f64,
    patience: Duration,
}

impl Advice {
    fn read(params: &Params) -> Result<Self> {
        let pairs = |name: &'static str| {
            let pair = |text: String| {
                let reason = || Error::param(name, format!("'{text}' is not VARIABLE=NUMBER, such as d=1.5"));
                let (variable, value) = text.split_once('=').ok_or_else(reason)?;
                Ok((variable.trim().to_owned(), number(name, value)?))
            };
            params.list(name).into_iter().map(pair).collect::<Result<Vec<_>>>()
        };
        let speeds: Vec<f64> =
            params.list("speeds").iter().map(|text| number("speeds", text)).collect::<Result<_>>()?;
        let limits = Limits::read(params)?;
        let allowed = !speeds.is_empty() && speeds.iter().all(|speed| limits.allow(*speed));
        let reason = "give speeds above 0, and none above top_speed: a limit never raises the planner's";
        Error::ensure(allowed, "speeds", || reason)?;
        let patience = params.double("patience");
        let action = |speed: &f64| {
            let (variable, kind) = (params.text("variable"), Intervention::SET);
            let set = Intervention { variable, kind, first_step: 1, last_step: 0, values: vec![*speed] };
            Action { name: speed.to_string(), interventions: vec![set] }
        };
        let term = |(variable, weight)| CostTerm { variable, weight };
        let bound = |(variable, above)| Limit { variable, above, below: f64::NAN, probability: 0.95 };
        let question = WhatIfRequest {
            horizon: u32::try_from(params.int("horizon")).unwrap_or(1),
            actions: speeds.iter().map(action).collect(),
            cost: pairs("cost")?.into_iter().map(term).collect(),
            limits: pairs("keep_above")?.into_iter().map(bound).collect(),
            patience,
            ..WhatIfRequest::default()
        };
        let (period_s, patience) = (1.0 / params.double("rate"), Duration::from_secs_f64(patience));
        Ok(Self { question, speeds, limits, period_s, patience })
    }

    /// The limit that an answer leads to, m/s (`None`: none), and why.
    fn limit(&self, answer: Result<WhatIfResponse>) -> (Option<f64>, String) {
        let answer = match answer {
            Ok(answer) => answer,
            Err(error) => return (self.limits.otherwise, format!("no answer: {error}")),
        };
        let best = answer.ranking.first().and_then(|best| usize::try_from(*best).ok());
        let chosen = best.and_then(|best| Some((self.speeds.get(best)?, answer.outlooks.get(best)?)));
        match chosen.filter(|_| answer.status == WhatIfResponse::OK) {
            Some((speed, outlook)) => (Some(*speed), outlook.text.clone()),
            None if answer.message.is_empty() => {
                (self.limits.otherwise, "no speed is better than another".into())
            }
            None => (self.limits.otherwise, answer.message),
        }
    }
}

/// The advisor node. It runs until the middleware ends.
///
/// # Errors
/// A parameter that is not allowed, or a topic that cannot be used.
pub fn advisor<M: Middleware>(mw: &M) -> Result<()> {
    let params = Params::read(mw, &specs())?;
    let advice = Advice::read(&params)?;
    let publisher = mw.advertise::<SpeedLimit>(&params.text("speed_limit_topic"), Qos::Latched)?;
    let mut planner = Planner::read(&params);
    let mut health = Health::new(mw)?;
    let inbox = Inbox::<()>::detached(mw, 1);
    let (mut due, mut last) = (mw.now(), None);
    loop {
        if inbox.next(mw, Some(due)) == Next::Shutdown {
            planner.iter_mut().for_each(|planner| planner.limit(mw, advice.limits.otherwise));
            // Whoever reads the limit no longer hears of it.
            let _ = publisher.publish(&advice.limits.message(mw, advice.limits.otherwise));
            // DDS sends on a thread of its own, which ends with the node.
            std::thread::sleep(LAST_WORD);
            return Ok(());
        }
        due = mw.now().plus_secs(advice.period_s);
        let (limit, why) =
            advice.limit(mw.call::<WhatIf>(WHAT_IF_SERVICE, &advice.question, advice.patience));
        publisher.publish(&advice.limits.message(mw, limit))?;
        planner.iter_mut().for_each(|planner| planner.limit(mw, limit));
        health.sent();
        if last != Some(limit) {
            tracing::info!("{}: {why}", in_words(limit));
            last = Some(limit);
        }
        health.report(mw, || [("limit in m/s", limit.unwrap_or(0.0).to_string())], None);
    }
}

fn in_words(limit: Option<f64>) -> String {
    limit.map_or("no limit of speed".to_owned(), |speed| format!("limit {speed} m/s"))
}

/// The watchdog node. It runs until the middleware ends.
///
/// # Errors
/// A parameter that is not allowed, or a topic that cannot be used.
pub fn watchdog<M: Middleware>(mw: &M) -> Result<()> {
    let params = Params::read(mw, &watchdog_specs())?;
    let (limits, silence_s, topic) =
        (Limits::read(&params)?, params.double("silence"), params.text("speed_limit_topic"));
    let publisher = mw.advertise::<SpeedLimit>(&topic, Qos::Latched)?;
    let mut planner = Planner::read(&params);
    let inbox = Inbox::<SpeedLimit>::new(mw, 10);
    let sender = inbox.sender();
    // Its own limits come back.
    let _heard = mw.subscribe(&topic, Qos::Latched, move |limit: SpeedLimit| sender.send(limit))?;
    let (mut due, mut own) = (None, None);
    loop {
        match inbox.next(mw, due) {
            Next::Shutdown => return Ok(()),
            Next::Event(limit) if own.as_ref() == Some(&limit) => {}
            Next::Event(_) => due = Some(mw.now().plus_secs(silence_s)),
            Next::Deadline => {
                let limit = limits.message(mw, limits.otherwise);
                publisher.publish(&limit)?;
                planner.iter_mut().for_each(|planner| planner.limit(mw, limits.otherwise));
                tracing::warn!("no limit came for {silence_s} s: {}", in_words(limits.otherwise));
                (due, own) = (None, Some(limit));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use roscausal_msgs::Outlook;

    use super::*;
    use crate::loopback::Loopback;

    fn advice(given: &[(&str, Value)]) -> Result<Advice> {
        let bus = Loopback::lockstep();
        for (name, value) in given {
            bus.set_node_param("advisor", name, value.clone());
        }
        Advice::read(&Params::read(&bus.node("advisor"), &specs())?)
    }

    fn text(text: &str) -> Value {
        Value::Str(text.into())
    }

    fn answer(status: u8, ranking: &[i32]) -> Result<WhatIfResponse> {
        let outlooks = vec![Outlook { text: "calm".into(), ..Outlook::default() }; 3];
        Ok(WhatIfResponse { status, ranking: ranking.to_vec(), outlooks, ..WhatIfResponse::default() })
    }

    #[test]
    fn the_best_speed_is_the_limit_and_what_has_no_best_is_not() {
        let plain = advice(&[]).expect("defaults");
        assert_eq!(plain.limit(answer(WhatIfResponse::OK, &[1, 0])), (Some(0.5), "calm".into()));
        let slow = advice(&[("otherwise", text("0.2"))]).expect("a speed");
        for (status, ranking) in [
            (WhatIfResponse::OK, &[][..]),
            (WhatIfResponse::OK, &[7]),
            (WhatIfResponse::OK, &[-1]),
            (WhatIfResponse::NOT_SUPPORTED, &[2]),
            (WhatIfResponse::AMBIGUOUS, &[2]),
            (WhatIfResponse::LATE, &[2]),
        ] {
            assert_eq!(plain.limit(answer(status, ranking)).0, None, "{status} {ranking:?}");
            assert_eq!(slow.limit(answer(status, ranking)).0, Some(0.2), "{status} {ranking:?}");
        }
        assert_eq!(slow.limit(Err(Error::Data("gone".into()))).0, Some(0.2));
        let bus = Loopback::lockstep();
        assert_eq!(plain.limits.message(&bus.node("any"), None).speed_limit, 0.0);
    }

    #[test]
    fn per_cent_are_of_the_top_speed_which_no_limit_exceeds() {
        let per_cent = [("percentage", Value::Bool(true)), ("top_speed", Value::Double(1.0))];
        let advice_of = advice(&per_cent).expect("per cent");
        let message = advice_of.limits.message(&Loopback::lockstep().node("any"), Some(0.5));
        assert!(message.percentage && message.speed_limit == 50.0);
        for (name, value) in [
            ("percentage", Value::Bool(true)),
            ("top_speed", Value::Double(0.5)),
            ("speeds", Value::List(vec![text("fast")])),
            ("speeds", Value::List(vec![text("-1")])),
            ("otherwise", text("0")),
            ("cost", Value::List(vec![text("h_risk")])),
        ] {
            let reported = advice(&[(name, value)]).err().map(|error| error.to_string()).unwrap_or_default();
            assert!(!reported.is_empty(), "{name}");
        }
    }

    #[test]
    fn the_watchdog_takes_over_where_limits_stop_and_steps_back_when_they_come_again() {
        let bus = Loopback::lockstep();
        bus.set_node_param("watchdog", "otherwise", text("0.2"));
        let advisor = bus.node("advisor");
        let publisher = advisor.advertise::<SpeedLimit>("speed_limit", Qos::Latched).expect("advertises");
        let heard = std::sync::Arc::new(std::sync::Mutex::new(Vec::new()));
        let kept = heard.clone();
        let keep = move |limit: SpeedLimit| kept.lock().expect("not poisoned").push(limit.speed_limit);
        let _planner = bus.node("planner").subscribe("speed_limit", Qos::Latched, keep).expect("subscribes");
        let thread = bus.start("watchdog", |mw| watchdog(&mw)).expect("starts");
        let said = |seconds: f64, sends: bool| -> Vec<f64> {
            for _ in 0..(seconds * 2.0) as u32 {
                if sends {
                    let limit = SpeedLimit {
                        header: Header { stamp: bus.now(), ..Header::default() },
                        percentage: false,
                        speed_limit: 0.5,
                    };
                    publisher.publish(&limit).expect("publishes");
                }
                bus.advance_to(bus.now().plus_secs(0.5));
                bus.settle();
            }
            std::mem::take(&mut *heard.lock().expect("not poisoned"))
        };
        assert!(said(10.0, false).is_empty(), "nobody has advised yet");
        assert_eq!(said(2.0, true), [0.5; 4]);
        assert_eq!(said(10.0, false), [0.2], "said once");
        assert_eq!(said(1.0, true), [0.5; 2]);
        assert_eq!(said(10.0, false), [0.2]);
        bus.shutdown();
        thread.join().expect("no panic").expect("ends well");
    }
}
