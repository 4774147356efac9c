//! What the reasoning node costs on a robot: rows at 3.3 Hz into a model of three Gaussian processes, for some seconds of real time.
//! Prints the CPU usage of its threads, the memory of the process, and how long questions take there and back.
//! `cargo run --release -p roscausal_core --example reasoning_node [SECONDS]` (default: 90); Linux only.

use std::{
    fs, thread,
    time::{Duration, Instant},
};

use roscausal_core::{
    Error, Result, Time,
    loopback::{Loopback, LoopbackNode},
    middleware::{Middleware, Publish, Qos},
    nodes,
    params::Value,
};
use roscausal_msgs::{
    Action, CausalLink, CausalModelInfo, Effect, EffectRequest, Features, Intervention, WhatIf,
    WhatIfRequest, std_msgs::Header,
};

/// Step between rows in seconds, and rows that are there before the measurement.
const STEP_S: f64 = 0.3;
const BEFORE: usize = 600;
const PATIENCE: Duration = Duration::from_secs(60);

/// Each variable drives itself and the next one, with a bend.
fn row(t: usize, before: [f64; 3]) -> [f64; 3] {
    let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0) - 0.5;
    [0, 1, 2].map(|j| 0.5 * before[j] + 0.6 * before[(j + 2) % 3].sin() + 0.5 * noise(3 * t + j))
}

fn model() -> CausalModelInfo {
    let name = |j: usize| format!("x{}", j % 3);
    let link = |cause: usize, effect: usize| CausalLink {
        cause: name(cause),
        effect: name(effect),
        lag: 1,
        value: 0.5,
        p_value: 0.001,
        confidence: -1.0,
        ..CausalLink::default()
    };
    CausalModelInfo {
        method: "pcmci".into(),
        max_lag: 1,
        dt: STEP_S,
        candidate_features: (0..3).map(name).collect(),
        links: (0..3).flat_map(|j| [link(j, j), link(j + 2, j)]).collect(),
        ..CausalModelInfo::default()
    }
}

/// CPU seconds of the node's threads.
fn cpu() -> f64 {
    let tasks = fs::read_dir("/proc/self/task").into_iter().flatten().flatten().map(|entry| entry.path());
    let own = |task: &std::path::PathBuf| {
        fs::read_to_string(task.join("comm")).is_ok_and(|name| name.starts_with("reasoning"))
    };
    let spent = |task: std::path::PathBuf| {
        let text = fs::read_to_string(task.join("schedstat")).ok()?;
        text.split(' ').next()?.parse::<f64>().ok()
    };
    tasks.filter(own).filter_map(spent).sum::<f64>() * 1e-9
}

/// Megabytes of this process.
fn memory() -> f64 {
    let text = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = text.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    line.and_then(|line| line.split_whitespace().next()?.parse::<f64>().ok()).unwrap_or(f64::NAN) / 1024.0
}

/// The median of some calls in milliseconds.
fn time(times: usize, mut call: impl FnMut() -> Result<()>) -> Result<f64> {
    let mut all = Vec::new();
    for _ in 0..times {
        let start = Instant::now();
        call()?;
        all.push(start.elapsed().as_secs_f64() * 1e3);
    }
    all.sort_by(f64::total_cmp);
    Ok(all[all.len() / 2])
}

fn what_if(node: &LoopbackNode) -> Result<u8> {
    let action = Action::one("set", Intervention::set("x0", [0.2]));
    let question = WhatIfRequest { horizon: 10, actions: vec![action], ..WhatIfRequest::default() };
    Ok(node.call::<WhatIf>(nodes::WHAT_IF_SERVICE, &question, PATIENCE)?.status)
}

fn main() -> Result<()> {
    let seconds: f64 = std::env::args().nth(1).and_then(|text| text.parse().ok()).unwrap_or(90.0);
    let begun = Instant::now();
    // The rows before the measurement come at once; their stamps lie before.
    let start = BEFORE as f64 * STEP_S;
    let bus = Loopback::live(move || Time::from_secs_f64(start + begun.elapsed().as_secs_f64()));
    let set = |name: &str, value: Value| bus.set_node_param("reasoning", name, value);
    set("equations", Value::Str("gp".into()));
    let asking = bus.node("asking");
    let rows = asking.advertise::<Features>(nodes::FEATURES_TOPIC, Qos::Volatile(10))?;
    let models = asking.advertise::<CausalModelInfo>("/roscausal/causal_model_info", Qos::Latched)?;
    models.publish(&model())?;
    let node = bus.node("reasoning");
    let its_own = node.clone();
    let thread = thread::Builder::new().name("reasoning-node".into());
    let thread = thread
        .spawn(move || nodes::run("reasoning", &its_own))
        .map_err(|e| Error::Middleware(e.to_string()))?;
    while rows.subscriber_count() == 0 && !thread.is_finished() {
        thread::sleep(Duration::from_millis(5));
    }
    let mut x = [0.1, 0.2, 0.3];
    let mut t = 0;
    let mut publish = || -> Result<()> {
        x = row(t, x);
        t += 1;
        let names = (0..3).map(|j| format!("x{j}")).collect();
        let stamp = Time::from_secs_f64(t as f64 * STEP_S);
        rows.publish(&Features {
            header: Header { stamp, frame_id: "map".into() },
            names,
            values: x.to_vec(),
        })
    };
    (0..BEFORE).try_for_each(|_| publish())?;
    while what_if(&asking)? != 0 {
        if begun.elapsed() > PATIENCE || thread.is_finished() {
            return Err(Error::Data("no model was fitted".into()));
        }
        thread::sleep(Duration::from_millis(100));
    }
    let (before, from) = (cpu(), Instant::now());
    let mut sent = 0;
    while from.elapsed().as_secs_f64() < seconds {
        publish()?;
        sent += 1;
        let due = f64::from(sent) * STEP_S - from.elapsed().as_secs_f64();
        thread::sleep(Duration::from_secs_f64(due.max(0.0)));
    }
    println!(
        "{seconds} s at {:.1} rows/s: {:.1} % of a core, {:.1} MB",
        1.0 / STEP_S,
        100.0 * (cpu() - before) / from.elapsed().as_secs_f64(),
        memory()
    );
    let asked = time(21, || what_if(&asking).map(drop))?;
    let request = EffectRequest { cause: "nobody".into(), ..EffectRequest::default() };
    let refused = time(201, || asking.call::<Effect>(nodes::EFFECT_SERVICE, &request, PATIENCE).map(drop))?;
    println!(
        "what-if, 400 paths x 10 steps, there and back: {asked:.1} ms; a question that is refused: {refused:.3} ms"
    );
    node.shutdown();
    thread.join().map_err(|_| Error::Middleware("the node died".into()))?
}
