//! The node: listens, and sends to the browsers.

use std::{
    net::IpAddr,
    thread,
    time::{Duration, Instant},
};

use roscausal_core::{
    Error, Result,
    inbox::{Inbox, Next},
    middleware::{Middleware, Qos},
    params::{Allowed, ParamSpec, Params, Value},
};
use roscausal_msgs::{CausalModelInfo, Humans, RobotState, diagnostic_msgs::DiagnosticArray};

use crate::{
    server::Server,
    world::{View, World},
};

/// Between two scenes on the page.
const FRAME: Duration = Duration::from_millis(50);
/// Between two looks at health and progress.
const STATUS: Duration = Duration::from_millis(500);
/// Messages that may wait; the oldest go, which a page can bear.
const INBOX: usize = 10_000;

enum Event {
    Robot(RobotState),
    Humans(Humans),
    Diagnostics(DiagnosticArray),
    Model(Box<CausalModelInfo>),
}

/// Whom and what to show.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// The person whose risk is shown; not there: the first.
    pub person: Option<u32>,
    /// Radius the robot is widened by, metres.
    pub obs_size: f64,
    /// No collision course beyond, metres.
    pub safe_dist: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self { person: Some(1000), obs_size: 2.0, safe_dist: 5.0 }
    }
}

/// Names, defaults, allowed values and descriptions of the node's parameters.
pub fn parameters() -> Vec<ParamSpec> {
    use Allowed::{Any, Range};
    let text = |text: &str| Value::Str(text.to_owned());
    vec![
        ParamSpec::new("address", text("127.0.0.1"), Any, "address to serve the page on; 0.0.0.0: all"),
        ParamSpec::new("port", Value::Int(8321), Range(0.0, 65535.0), "port of the page; 0: any free one"),
        ParamSpec::new(
            "token",
            text(""),
            Any,
            "who opens the page must know it; empty: none on 127.0.0.1, a random one on other addresses",
        ),
        ParamSpec::new("sel_agent", text("1000"), Any, "person whose risk is shown; not there: the first"),
        ParamSpec::new(
            "obs_size",
            Value::Double(2.0),
            Range(0.01, 100.0),
            "radius the robot is widened by, metres",
        ),
        ParamSpec::new(
            "safe_dist",
            Value::Double(5.0),
            Range(0.01, 1000.0),
            "no collision course beyond, metres",
        ),
    ]
}

/// The node as the backends start it: parameters, server, page.
///
/// # Errors
/// A parameter that is not allowed, a port that is in use, a topic that cannot be used.
pub fn run<M: Middleware>(mw: &M) -> Result<()> {
    let params = Params::read(mw, &parameters())?;
    let text = params.text("address");
    let address: IpAddr = text.parse().map_err(|_| {
        Error::param("address", format!("'{text}' is no IP address; use 127.0.0.1, or 0.0.0.0 for all"))
    })?;
    let port = u16::try_from(params.int("port")).unwrap_or_default();
    let server = Server::start(address, port, &params.text("token"))?;
    tracing::info!("the page is at {}", server.url());
    let options = Options {
        person: params.text("sel_agent").trim().parse().ok(),
        obs_size: params.double("obs_size"),
        safe_dist: params.double("safe_dist"),
    };
    dashboard(mw, &server, &options)
}

/// Shows on `server` what is published, until the middleware ends. No other node waits for it.
///
/// # Errors
/// A topic that cannot be used.
pub fn dashboard<M: Middleware>(mw: &M, server: &Server, options: &Options) -> Result<()> {
    let inbox = Inbox::detached(mw, INBOX);
    let qos = Qos::Volatile(100);
    let send = inbox.sender();
    let _robot = mw.subscribe("/roscausal/robot", qos, move |m| send.send(Event::Robot(m)))?;
    let send = inbox.sender();
    let _humans = mw.subscribe("/roscausal/humans", qos, move |m| send.send(Event::Humans(m)))?;
    let send = inbox.sender();
    let _health = mw.subscribe("/diagnostics", qos, move |m| send.send(Event::Diagnostics(m)))?;
    let send = inbox.sender();
    let model = move |m| send.send(Event::Model(Box::new(m)));
    let _models = mw.subscribe("/roscausal/causal_model_info", Qos::Latched, model)?;

    let hub = server.hub();
    let mut world =
        World::new(View { person: options.person, obs_size: options.obs_size, safe_dist: options.safe_dist });
    let mut last_status = Instant::now();
    while mw.is_ok() {
        // In real time, whatever the clock in use does.
        let begin = Instant::now();
        while begin.elapsed() < FRAME {
            let Next::Event(event) = inbox.next(mw, Some(mw.now())) else { break };
            match event {
                Event::Robot(state) => world.robot(state),
                Event::Humans(humans) => world.humans(humans),
                Event::Diagnostics(message) => world.diagnostics(message, hub),
                Event::Model(info) => world.model(&info, hub),
            }
        }
        world.send_scene(hub);
        if last_status.elapsed() >= STATUS {
            last_status = Instant::now();
            world.send_status(hub);
        }
        thread::sleep(FRAME);
    }
    Ok(())
}
