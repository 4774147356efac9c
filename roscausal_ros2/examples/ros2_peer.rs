//! The other end of the interoperability tests (`tests/interop/ros2.sh`). It is also a small example of how to use
//! the backend. The parameter `role` says what it does:
//! - `echo`: for every message type, what arrives on `/in/package/Name` is sent on `/out/package/Name`;
//! - `model`: sends `count` causal models of `n_vars` variables and `n_lags` lags on `/model`, latched;
//! - `names`: prints what the command line makes of the node's name, of some topics and of its parameters;
//! - `count`: counts the odometry on `/odom`, and sends as many robot states on `/state` as `count` says;
//! - `sensors`: publishes like the sensors of a busy robot for `count` seconds, and prints how much.

#[path = "../../tests/soak/sensors.rs"]
mod sensors;

use std::{
    error::Error,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
    thread::sleep,
    time::{Duration, Instant},
};

use roscausal_core::{
    middleware::{Middleware, Publish, Qos},
    params::{Allowed, ParamSpec, Value},
};
use roscausal_msgs::{
    CausalLink, CausalModel, CausalModelInfo, HumanState, Humans, Message, ModelChange, ModelChanges,
    RobotState, diagnostic_msgs, geometry_msgs, nav_msgs, nav2_msgs, pedsim_msgs, people_msgs, rosgraph_msgs,
    sensor_msgs, spencer_tracking_msgs, std_msgs, tf2_msgs, visualization_msgs,
};
use roscausal_ros::{Console, program::Backend};
use roscausal_ros2::Subscription;
use roscausal_ros2::{Args, Ros2};

const ROLE: ParamSpec = ParamSpec::new(
    "role",
    Value::Str(String::new()),
    Allowed::OneOf(&["echo", "model", "count", "sensors"]),
    "What this peer does",
);

const fn number(name: &'static str, default: i64) -> ParamSpec {
    ParamSpec::new(name, Value::Int(default), Allowed::Range(0.0, 1e6), "A whole number").live()
}

fn main() -> Result<(), Box<dyn Error>> {
    let args = Args::parse("peer", std::env::args().skip(1), |name| std::env::var(name).ok())?;
    if args.overrides.get("role") == Some(&Value::Str("names".into())) {
        return print_names(&args);
    }
    let console = Console::install(Ros2::filter(&args));
    console.name("peer");
    let node = Ros2::start(&args)?;
    node.log_with(&console)?;
    let mut signals =
        signal_hook::iterator::Signals::new([signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM])?;
    let ended = node.clone();
    std::thread::spawn(move || {
        signals.forever().next();
        ended.shutdown();
    });
    let int = |name, default| match node.param(&number(name, default)) {
        Ok(Some(Value::Int(value))) => value as usize,
        _ => default as usize,
    };
    match node.param(&ROLE)? {
        Some(Value::Str(role)) if role == "echo" => echo_all(&node)?,
        Some(Value::Str(role)) if role == "model" => {
            send_models(&node, int("count", 1), int("n_vars", 8), int("n_lags", 2))?
        }
        Some(Value::Str(role)) if role == "sensors" => {
            let [odometry, places, people] = sensors::publish(&node, int("count", 60) as u32, 100)?;
            println!("sent {odometry} {places} {people}");
            while node.is_ok() {
                sleep(Duration::from_millis(20));
            }
        }
        _ => count(&node, int("count", 1000), int("period_us", 1000))?,
    }
    // The thread that waits for signals holds the node as well, so it would not leave by itself.
    node.leave();
    Ok(())
}

fn print_names(args: &Args) -> Result<(), Box<dyn Error>> {
    println!("NAME {}", args.names.full_name());
    for topic in ["chat", "/abs", "~/priv", "ns/chat", "/a/b/chat"] {
        println!("TOPIC {topic} {}", args.names.resolve(topic)?);
    }
    for (name, value) in &args.overrides {
        println!("PARAM {name} {value:?}");
    }
    Ok(())
}

fn echo<M: Message>(node: &Ros2) -> roscausal_core::Result<Subscription> {
    let out = node.advertise::<M>(&format!("/out/{}", M::type_name()), Qos::Volatile(100))?;
    node.subscribe(&format!("/in/{}", M::type_name()), Qos::Volatile(100), move |message: M| {
        if let Err(error) = out.publish(&message) {
            tracing::error!("{error}");
        }
    })
}

fn echo_all(node: &Ros2) -> roscausal_core::Result<()> {
    macro_rules! echoes {
        ($($message:ty),* $(,)?) => { vec![$(echo::<$message>(node)?),*] };
    }
    let _echoes = echoes![
        RobotState,
        HumanState,
        Humans,
        CausalModel,
        CausalLink,
        CausalModelInfo,
        ModelChange,
        ModelChanges,
        std_msgs::Header,
        std_msgs::String,
        std_msgs::Bool,
        std_msgs::Float64,
        std_msgs::Int32MultiArray,
        std_msgs::Float32MultiArray,
        geometry_msgs::Point,
        geometry_msgs::Pose2D,
        geometry_msgs::PoseStamped,
        geometry_msgs::PoseArray,
        geometry_msgs::PoseWithCovarianceStamped,
        geometry_msgs::TransformStamped,
        geometry_msgs::Twist,
        nav_msgs::Odometry,
        tf2_msgs::TFMessage,
        sensor_msgs::Image,
        sensor_msgs::CompressedImage,
        rosgraph_msgs::Clock,
        diagnostic_msgs::DiagnosticArray,
        visualization_msgs::Ros2MarkerArray,
        nav2_msgs::SpeedLimit,
        people_msgs::People,
        pedsim_msgs::AgentStates,
        pedsim_msgs::TrackedPersons,
        pedsim_msgs::Waypoints,
        pedsim_msgs::LineObstacles,
        spencer_tracking_msgs::TrackedPersons,
    ];
    while node.is_ok() {
        sleep(Duration::from_millis(20));
    }
    Ok(())
}

fn send_models(node: &Ros2, count: usize, n_vars: usize, n_lags: usize) -> roscausal_core::Result<()> {
    let publisher = node.advertise::<CausalModel>("/model", Qos::Latched)?;
    let n = n_vars * n_vars * n_lags;
    for id in 0..count {
        let mut model = CausalModel {
            original_shape: vec![n_vars as i32, n_vars as i32, n_lags as i32],
            ..CausalModel::default()
        };
        model.header.stamp = node.now();
        model.header.frame_id = format!("model {id}");
        model.causal_structure.data = (0..n as i32).collect();
        model.val_matrix.data = (0..n).map(|i| i as f32 * 0.5).collect();
        model.pval_matrix.data = vec![0.01; n];
        publisher.publish(&model)?;
        sleep(Duration::from_millis(100));
    }
    tracing::info!(target: "roscausal_peer", "{count} models sent");
    while node.is_ok() {
        sleep(Duration::from_millis(20));
    }
    Ok(())
}

fn count(node: &Ros2, count: usize, period_us: usize) -> roscausal_core::Result<()> {
    let publisher = node.advertise::<RobotState>("/state", Qos::Volatile(count))?;
    let received = Arc::new(AtomicU64::new(0));
    let counter = received.clone();
    let _odometry = node.subscribe("/odom", Qos::Volatile(count), move |_: nav_msgs::Odometry| {
        counter.fetch_add(1, Ordering::Relaxed);
    })?;
    let totals = node.advertise::<std_msgs::Float64>("/received", Qos::Volatile(10))?;
    while node.is_ok() && publisher.subscriber_count() == 0 {
        sleep(Duration::from_millis(5));
    }
    // The subscriber's side learns of the match a little later.
    sleep(Duration::from_millis(300));
    let started = Instant::now();
    for id in 0..count {
        let mut state = RobotState::default();
        state.header.stamp = node.now();
        state.header.frame_id = id.to_string();
        publisher.publish(&state)?;
        sleep(
            (started + Duration::from_micros((period_us * (id + 1)) as u64))
                .saturating_duration_since(Instant::now()),
        );
    }
    while node.is_ok() {
        totals.publish(&std_msgs::Float64 { data: received.load(Ordering::Relaxed) as f64 })?;
        sleep(Duration::from_millis(50));
    }
    Ok(())
}
