//! A run that weighs as much as a long day on a robot: an hour of history with 100 people, 12 variables, models and predictions; then it
//! goes on in real time. `benches/page.sh` measures the page on it: `page_load [PEOPLE [HISTORY_SECONDS [PORT]]]`.

use std::{
    net::Ipv4Addr,
    thread,
    time::{Duration, Instant},
};

use roscausal_core::{
    Result, Time,
    loopback::{Loopback, LoopbackNode},
    middleware::{Middleware, Publish, Qos},
    nodes::{FEATURES_TOPIC, PREDICTION_TOPIC, SceneOptions},
};
use roscausal_dashboard::{Server, dashboard};
use roscausal_msgs::{
    CausalLink, CausalModelInfo, Features, Forecast, HumanState, Humans, Prediction, RobotState,
    diagnostic_msgs::{DiagnosticArray, DiagnosticStatus, KeyValue},
    std_msgs::Header,
};

/// Time between two scenes in the past and at present, between two rows, and between two models, in seconds.
const PAST_S: f64 = 0.5;
const PRESENT_S: f64 = 0.04;
const ROW_S: f64 = 0.3;
const MODEL_S: f64 = 60.0;
const VARIABLES: [&str; 12] =
    ["h_v", "h_dg", "h_risk", "d", "h_x", "h_y", "h_theta", "r_v", "r_dg", "r_x", "r_y", "r_theta"];

fn header(t: f64) -> Header {
    Header { stamp: Time::from_secs_f64(t), frame_id: "map".into() }
}

/// Somebody on a circle of his own.
fn person(id: u32, t: f64) -> HumanState {
    let mut state = HumanState { header: header(t), id, ..HumanState::default() };
    let angle = 0.1 * t + f64::from(id);
    let radius = 3.0 + 0.15 * f64::from(id % 100);
    (state.pose2d.x, state.pose2d.y, state.pose2d.theta) =
        (radius * angle.cos(), radius * angle.sin(), angle);
    state.twist.linear.x = 0.1 * radius;
    (state.goal.x, state.goal.y) = (radius * (angle + 0.5).cos(), radius * (angle + 0.5).sin());
    state
}

fn robot(t: f64) -> RobotState {
    let mut state = RobotState { header: header(t), ..RobotState::default() };
    (state.pose2d.x, state.pose2d.y) = (4.0 * (0.05 * t).cos(), 4.0 * (0.05 * t).sin());
    state.twist.linear.x = 0.2;
    state
}

struct Load {
    people: u32,
    robot: <LoopbackNode as Middleware>::Publisher<RobotState>,
    humans: <LoopbackNode as Middleware>::Publisher<Humans>,
    rows: <LoopbackNode as Middleware>::Publisher<Features>,
    predictions: <LoopbackNode as Middleware>::Publisher<Prediction>,
    models: <LoopbackNode as Middleware>::Publisher<CausalModelInfo>,
    health: <LoopbackNode as Middleware>::Publisher<DiagnosticArray>,
    next_row: f64,
    next_model: f64,
}

impl Load {
    fn new(node: &LoopbackNode, people: u32) -> Result<Self> {
        let (sensor, few) = (Qos::Volatile(100), Qos::Volatile(10));
        Ok(Self {
            people,
            robot: node.advertise("/roscausal/robot", sensor)?,
            humans: node.advertise("/roscausal/humans", sensor)?,
            rows: node.advertise(FEATURES_TOPIC, few)?,
            predictions: node.advertise(PREDICTION_TOPIC, few)?,
            models: node.advertise("/roscausal/causal_model_info", Qos::Latched)?,
            health: node.advertise("/diagnostics", few)?,
            next_row: 0.0,
            next_model: 0.0,
        })
    }

    fn publish(&mut self, t: f64) -> Result<()> {
        let ids = (0..self.people).map(|k| 1000 + k);
        self.humans.publish(&Humans { header: header(t), humans: ids.map(|id| person(id, t)).collect() })?;
        self.robot.publish(&robot(t))?;
        if t >= self.next_row {
            self.next_row = t + ROW_S;
            let value = |k: usize| (0.3 * t + k as f64).sin();
            let names = VARIABLES.map(str::to_owned).to_vec();
            self.rows.publish(&Features {
                header: header(t),
                names,
                values: (0..12).map(value).collect(),
            })?;
            let ahead = |k: usize| -> Vec<f64> {
                (1..=10).map(|step| (0.3 * (t + ROW_S * f64::from(step)) + k as f64).sin()).collect()
            };
            let forecast = |(k, name): (usize, &&str)| Forecast {
                variable: (*name).to_owned(),
                mean: ahead(k),
                lower: ahead(k).iter().map(|x| x - 0.2).collect(),
                upper: ahead(k).iter().map(|x| x + 0.2).collect(),
                skill: vec![0.5; 10],
            };
            let forecasts = VARIABLES.iter().enumerate().map(forecast).collect();
            let message = Prediction {
                header: header(t),
                dt: ROW_S,
                model_id: "load".into(),
                forecasts,
                coverage: 0.9,
            };
            self.predictions.publish(&message)?;
        }
        if t >= self.next_model {
            self.next_model = t + MODEL_S;
            self.models.publish(&model(t))?;
            let values =
                vec![KeyValue { key: "batches written".into(), value: format!("{:.0}", t / MODEL_S) }];
            let status = DiagnosticStatus { name: "data".into(), values, ..DiagnosticStatus::default() };
            self.health.publish(&DiagnosticArray { header: header(t), status: vec![status] })?;
        }
        Ok(())
    }
}

/// Each variable drives the next one, and those at a distance that changes from model to model.
fn model(t: f64) -> CausalModelInfo {
    let number = (t / MODEL_S) as usize;
    let n = VARIABLES.len();
    let link = |cause: usize, effect: usize| CausalLink {
        cause: VARIABLES[cause].into(),
        effect: VARIABLES[effect % n].into(),
        lag: 1,
        value: 0.4,
        p_value: 0.01,
        confidence: 0.8,
        ..CausalLink::default()
    };
    CausalModelInfo {
        header: header(t),
        start_time: Time::from_secs_f64((t - MODEL_S).max(0.0)),
        end_time: Time::from_secs_f64(t),
        batch_id: format!("batch_{number}"),
        method: "pcmci".into(),
        cond_ind_test: "parcorr".into(),
        alpha: 0.05,
        dt: ROW_S,
        n_samples: 200,
        candidate_features: VARIABLES.map(str::to_owned).to_vec(),
        links: (0..n).flat_map(|k| [link(k, k + 1), link(k, k + 2 + number % 3)]).collect(),
        ..CausalModelInfo::default()
    }
}

fn main() -> Result<()> {
    let mut given = std::env::args().skip(1).map(|text| text.parse::<u32>().unwrap_or_default());
    let (people, history) = (given.next().unwrap_or(100), f64::from(given.next().unwrap_or(3600)));
    let port = u16::try_from(given.next().unwrap_or(0)).unwrap_or_default();
    let begun = Instant::now();
    let bus = Loopback::live(move || Time::from_secs_f64(begun.elapsed().as_secs_f64()));
    let server = Server::start(Ipv4Addr::LOCALHOST.into(), port, "")?;
    let url = server.url().to_owned();
    let node = bus.node("dashboard");
    let page = thread::Builder::new()
        .name("dashboard-node".into())
        .spawn(move || dashboard(&node, &server, SceneOptions::default()))
        .map_err(|e| roscausal_core::Error::Middleware(e.to_string()))?;
    let mut load = Load::new(&bus.node("load"), people)?;
    while load.humans.subscriber_count() == 0 && !page.is_finished() {
        thread::sleep(Duration::from_millis(5));
    }
    let mut t = 0.0;
    while t < history {
        load.publish(t)?;
        t += PAST_S;
        // Slower than the node takes them.
        thread::sleep(Duration::from_millis(1));
    }
    println!("{url}");
    let start = Instant::now();
    while !page.is_finished() {
        let now = start.elapsed().as_secs_f64();
        load.publish(t + now)?;
        let due = (now / PRESENT_S).floor() * PRESENT_S + PRESENT_S;
        thread::sleep(Duration::from_secs_f64((due - start.elapsed().as_secs_f64()).max(0.0)));
    }
    Ok(())
}
