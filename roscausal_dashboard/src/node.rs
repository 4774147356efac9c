//! The node: listens to topics and sends events to the browsers.

use std::{
    net::IpAddr,
    thread,
    time::{Duration, Instant},
};

use roscausal_core::{
    Error, Result,
    inbox::{Inbox, Next},
    middleware::{Middleware, Qos},
    nodes::{CHANGES_TOPIC, EVIDENCE_TOPIC, FEATURES_TOPIC, PREDICTION_TOPIC, SceneOptions},
    param_specs,
    params::{Allowed, ParamSpec, Params, Value},
};
use roscausal_msgs::{
    CausalModelInfo, Features, Humans, ModelChanges, Prediction, RobotState,
    diagnostic_msgs::DiagnosticArray, pedsim_msgs::LineObstacles, std_msgs::String as Text,
};

use crate::{
    hub::{Frame, Keep},
    questions,
    server::Server,
    world::{World, evidence_frames},
};

/// Time between two scenes on the page.
const FRAME: Duration = Duration::from_millis(50);
/// Time between two updates of health and progress.
const STATUS: Duration = Duration::from_millis(500);
/// Messages that may wait. The oldest are dropped, which does not harm the page.
const INBOX: usize = 10_000;

enum Event {
    Robot(RobotState),
    Humans(Humans),
    Diagnostics(DiagnosticArray),
    Model(Box<CausalModelInfo>),
    Evidence(Text),
    Walls(LineObstacles),
    Interventions(Text),
    Changes(ModelChanges),
    Features(Features),
    Prediction(Prediction),
}

/// Names, defaults, allowed values and descriptions of the node's parameters.
pub fn parameters() -> Vec<ParamSpec> {
    use Allowed::{Any, Range};
    let text = |text: &str| Value::Str(text.to_owned());
    let mut specs = param_specs! {
        "address" = text("127.0.0.1"), Any, "address on which the page is served; 0.0.0.0: all";
        "port" = Value::Int(8321), Range(0.0, 65535.0), "port of the page; 0: any free port";
        "token" = text(""), Any,
            "token that opens the page; empty: none on 127.0.0.1, a random one on other addresses";
    };
    specs.extend(SceneOptions::specs());
    specs
}

/// The node as the backends start it: parameters, server, page.
///
/// # Errors
/// A parameter that is not allowed, a port that is in use, or a topic that cannot be used.
pub fn run<M: Middleware>(mw: &M) -> Result<()> {
    let params = Params::read(mw, &parameters())?;
    let options = SceneOptions::read(&params)?;
    let text = params.text("address");
    let address: IpAddr = text.parse().map_err(|_| {
        Error::param("address", format!("'{text}' is not an IP address; use 127.0.0.1, or 0.0.0.0 for all"))
    })?;
    let port = u16::try_from(params.int("port")).unwrap_or_default();
    let server = Server::start(address, port, &params.text("token"))?;
    tracing::info!("the page is at {}", server.url());
    dashboard(mw, &server, options)
}

/// Shows what is published on `server`, until the middleware ends. No other node waits for it.
///
/// # Errors
/// A topic that cannot be used.
pub fn dashboard<M: Middleware>(mw: &M, server: &Server, options: SceneOptions) -> Result<()> {
    let inbox = Inbox::detached(mw, INBOX);
    let qos = Qos::Volatile(100);
    let _robot = inbox.subscribe(mw, &options.robot_topic()?, qos, Event::Robot)?;
    let _humans = inbox.subscribe(mw, "roscausal/humans", qos, Event::Humans)?;
    let _health = inbox.subscribe(mw, "/diagnostics", qos, Event::Diagnostics)?;
    let model = |info| Event::Model(Box::new(info));
    let _models = inbox.subscribe(mw, "roscausal/causal_model_info", Qos::Latched, model)?;
    let _evidence = inbox.subscribe(mw, EVIDENCE_TOPIC, Qos::Latched, Event::Evidence)?;
    let _changes = inbox.subscribe(mw, CHANGES_TOPIC, Qos::Latched, Event::Changes)?;
    let few = Qos::Volatile(10);
    let _features = inbox.subscribe(mw, FEATURES_TOPIC, few, Event::Features)?;
    let _predictions = inbox.subscribe(mw, PREDICTION_TOPIC, few, Event::Prediction)?;
    // Both exist only where somebody tells them, as the simulator does.
    let _walls = inbox.subscribe(mw, "/pedsim_simulator/simulated_walls", Qos::Latched, Event::Walls)?;
    let _interventions = inbox.subscribe(mw, "/hri/interventions", Qos::Latched, Event::Interventions)?;

    let hub = &server.hub;
    hub.history().show(options.clone());
    hub.ask_at(Some(questions::answer(mw, hub)?));
    let mut world = World::new(options);
    let mut last_status = Instant::now();
    while mw.is_ok() {
        // In real time, whatever the clock in use does.
        let begin = Instant::now();
        while begin.elapsed() < FRAME {
            let Next::Event(event) = inbox.next(mw, Some(mw.now())) else { break };
            match event {
                Event::Robot(state) => world.robot(state, hub),
                Event::Humans(humans) => world.humans(humans, hub),
                Event::Diagnostics(message) => world.diagnostics(message, hub),
                Event::Model(info) => world.model(&info, hub),
                Event::Changes(changes) => world.changes(&changes, hub),
                Event::Features(row) => hub.ahead().row(&row),
                Event::Prediction(prediction) => hub.ahead().prediction(prediction),
                Event::Walls(walls) => world.walls(&walls, hub),
                Event::Interventions(text) => world.interventions(&text.data, hub),
                Event::Evidence(text) => {
                    let frames = evidence_frames(&text.data).into_iter().flatten();
                    frames.for_each(|(frame, keep)| hub.send(frame, keep));
                }
            }
        }
        world.send_scene(hub);
        let news = hub.ahead().news();
        if let Some(news) = news {
            hub.send(Frame { kind: "prediction", data: news.to_string().into() }, Keep::Last);
        }
        if last_status.elapsed() >= STATUS {
            last_status = Instant::now();
            world.send_status(hub);
        }
        thread::sleep(FRAME);
    }
    hub.ask_at(None);
    Ok(())
}
