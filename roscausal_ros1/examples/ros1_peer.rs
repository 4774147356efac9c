//! The other end of the interoperability tests: one node that does what its first argument says.
//!
//! - `echo TYPE IN OUT` sends back what it receives;
//! - `latch TOPIC TEXT` latches a text;
//! - `count TYPE TOPIC` reports how many messages arrived and how many were lost;
//! - `panic TOPIC` panics at the text "panic" and echoes other texts on TOPIC_echo;
//! - `param NAME...` prints parameters;
//! - `set NAME` sets one parameter of each kind;
//! - `clock` prints the time on the clock;
//! - `crash` panics after it has registered;
//! - `topics` prints the topics;
//! - `sensors SECONDS` publishes like the sensors of a busy robot, and prints how much.

#[path = "../../tests/soak/sensors.rs"]
mod sensors;

use std::{
    env,
    io::Write,
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    thread,
    time::Duration,
};

use roscausal_core::{
    Message, Result,
    middleware::{Middleware, Publish, Qos},
    params::{Allowed, ParamSpec, Value},
};
use roscausal_msgs::{
    CausalModel, CausalModelInfo, HumanState, Humans, ModelChanges, RobotState, diagnostic_msgs,
    geometry_msgs, move_base_msgs, nav_msgs, pedsim_msgs, sensor_msgs, std_msgs, tf2_msgs,
};
use roscausal_ros::{
    Console,
    console::{LevelFilter, Targets},
};
use roscausal_ros1::Ros1;

fn main() -> Result<()> {
    let console = Console::install(Targets::new().with_default(LevelFilter::INFO));
    let args: Vec<String> = env::args().skip(1).filter(|arg| !arg.contains(":=")).collect();
    let args: Vec<&str> = args.iter().map(String::as_str).collect();
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        let _ = signal_hook::flag::register(signal, stop.clone());
    }
    let mw = Ros1::connect("peer", &|| !stop.load(Ordering::SeqCst))?;
    mw.log_with(&console)?;
    match args.as_slice() {
        ["echo", kind, from, to] => return echo_any(&mw, &stop, kind, from, to),
        ["count", kind, topic] => return count_any(&mw, &stop, kind, topic),
        ["latch", topic, text] => {
            let publisher = mw.advertise::<std_msgs::String>(topic, Qos::Latched)?;
            publisher.publish(&std_msgs::String { data: (*text).to_owned() })?;
            wait(&mw, &stop);
        }
        ["panic", topic] => {
            let echo = mw.advertise::<std_msgs::String>(&format!("{topic}_echo"), Qos::Volatile(100))?;
            let _subscription = mw.subscribe(topic, Qos::Volatile(100), move |text: std_msgs::String| {
                assert!(text.data != "panic", "told to");
                let _ = echo.publish(&text);
            })?;
            say("ready");
            wait(&mw, &stop);
        }
        ["param", names @ ..] => {
            for name in names {
                let name: &'static str = Box::leak((*name).to_owned().into_boxed_str());
                let spec = ParamSpec::new(name, Value::Str(String::new()), Allowed::Any, "of the test");
                match mw.param(&spec) {
                    Ok(value) => say(&format!("{name} {value:?}")),
                    Err(error) => say(&format!("{name} error {error}")),
                }
            }
        }
        ["set", name] => {
            let values =
                [Value::Bool(true), Value::Int(-3), Value::Double(0.5), Value::Str("a<b".to_owned())];
            mw.set_param(name, Value::List(values.to_vec()))?;
        }
        ["clock"] => {
            say(&format!("{}", mw.now().as_secs_f64()));
            let mut last = mw.now();
            while mw.is_ok() && !stop.load(Ordering::SeqCst) {
                if mw.now() != last {
                    last = mw.now();
                    say(&format!("{}", last.as_secs_f64()));
                }
                thread::sleep(Duration::from_millis(2));
            }
        }
        ["crash"] => {
            let _publisher = mw.advertise::<std_msgs::String>("crash", Qos::Latched)?;
            let _subscription = mw.subscribe("crash_in", Qos::Volatile(1), |_: std_msgs::String| {})?;
            say("ready");
            thread::sleep(Duration::from_secs(1));
            let nothing: Option<u8> = env::args().nth(1000).and_then(|text| text.parse().ok());
            assert!(nothing.is_some(), "the panic of the test");
        }
        ["sensors", seconds] => {
            let [odometry, places, people] = sensors::publish(&mw, seconds.parse().unwrap_or(60), 100)?;
            say(&format!("sent {odometry} {places} {people}"));
            wait(&mw, &stop);
        }
        ["topics"] => mw.topics().iter().for_each(|(topic, kind)| say(&format!("{topic} {kind}"))),
        _ => say("unknown command"),
    }
    mw.close();
    Ok(())
}

fn say(line: &str) {
    println!("{line}");
    let _ = std::io::stdout().flush();
}

fn wait(mw: &Ros1, stop: &AtomicBool) {
    while mw.is_ok() && !stop.load(Ordering::SeqCst) {
        thread::sleep(Duration::from_millis(20));
    }
}

fn echo<M: Message>(mw: &Ros1, stop: &AtomicBool, from: &str, to: &str) -> Result<()> {
    let publisher = mw.advertise::<M>(to, Qos::Volatile(1000))?;
    let _subscription = mw.subscribe(from, Qos::Volatile(1000), move |message: M| {
        if let Err(error) = publisher.publish(&message) {
            tracing::error!("{error}");
        }
    })?;
    say("ready");
    wait(mw, stop);
    mw.close();
    Ok(())
}

fn count<M: Message>(mw: &Ros1, stop: &AtomicBool, topic: &str) -> Result<()> {
    let seen = Arc::new(AtomicU64::new(0));
    let counter = seen.clone();
    let _subscription = mw.subscribe(topic, Qos::Volatile(10_000), move |_: M| {
        counter.fetch_add(1, Ordering::SeqCst);
    })?;
    say("ready");
    let mut reported = 0;
    while mw.is_ok() && !stop.load(Ordering::SeqCst) {
        let now = seen.load(Ordering::SeqCst);
        if now != reported {
            reported = now;
            say(&format!("{now} {}", mw.lost().iter().map(|(_, count)| count).sum::<u64>()));
        }
        thread::sleep(Duration::from_millis(100));
    }
    mw.close();
    Ok(())
}

macro_rules! by_type {
    ($kind:expr, $call:ident $args:tt) => {
        by_type!(@ $kind, $call $args; RobotState, HumanState, Humans, CausalModel, CausalModelInfo, ModelChanges,
            std_msgs::String, nav_msgs::Odometry, geometry_msgs::PoseWithCovarianceStamped, geometry_msgs::PoseStamped,
            geometry_msgs::PoseArray, geometry_msgs::Point, move_base_msgs::MoveBaseActionGoal, tf2_msgs::TFMessage,
            sensor_msgs::Image, sensor_msgs::CompressedImage, diagnostic_msgs::DiagnosticArray,
            pedsim_msgs::AgentStates, pedsim_msgs::TrackedPersons)
    };
    (@ $kind:expr, $call:ident $args:tt; $($type:ty),*) => {
        match $kind {
            $(kind if kind == <$type as Message>::type_name() => $call::<$type> $args,)*
            other => Ok(say(&format!("unknown type {other}"))),
        }
    };
}

fn echo_any(mw: &Ros1, stop: &AtomicBool, kind: &str, from: &str, to: &str) -> Result<()> {
    by_type!(kind, echo(mw, stop, from, to))
}

fn count_any(mw: &Ros1, stop: &AtomicBool, kind: &str, topic: &str) -> Result<()> {
    by_type!(kind, count(mw, stop, topic))
}
