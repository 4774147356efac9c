//! CPU seconds of the calls that others offer too, on one thread: `cargo run --release -p roscausal_reasoning --example reasoning_speed`.
//!
//! Linux only: the time is that of the thread, so that a busy machine does not count.

use std::{fs, hint::black_box};

use ndarray::Array2;
use roscausal_discovery::{DataFrame, Node, Result, mix};
use roscausal_reasoning::{
    Samples, Settings, StructuralModel,
    answer::{EffectQuestion, ExplainQuestion, effect, explain, what_if},
    effects::{Mediation, adjusted},
    graph::{Arrow, Graph, adjustment},
    model::Equations,
    question::{Action, Intervention, Situation, WhatIf},
};

/// CPU time of this thread in seconds.
fn now() -> f64 {
    let text = fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    text.split(' ').next().and_then(|field| field.parse::<f64>().ok()).unwrap_or(0.0) * 1e-9
}

/// The mean of at least `times` calls, and of as many as fill half a second: the clock ticks every few milliseconds.
fn time<T>(name: &str, times: usize, mut call: impl FnMut() -> T) {
    let (start, mut calls) = (now(), 0);
    while calls < times || (now() - start < 0.5 && calls < 100_000) {
        black_box(call());
        calls += 1;
    }
    println!("{name}: {:.6} s", (now() - start) / calls as f64);
}

/// Each variable drives itself and the next one, at lags 1 and 2, with a bend.
fn system(n: usize, rows: usize) -> Result<(Graph, DataFrame)> {
    let noise =
        |place: usize| (0..6).map(|k| mix(6 * place as u64 + k) as f64 / u64::MAX as f64).sum::<f64>() - 3.0;
    let mut x = Array2::<f64>::zeros((rows, n));
    for t in 2..rows {
        for j in 0..n {
            let cause = (j + n - 1) % n;
            x[[t, j]] = 0.5 * x[[t - 1, j]] + 0.6 * x[[t - 1, cause]].sin() - 0.2 * x[[t - 2, cause]]
                + 0.5 * noise(n * t + j);
        }
    }
    let arrow = |cause, effect, lag| Arrow { cause, effect, lag };
    let arrows: Vec<Arrow> = (0..n)
        .flat_map(|j| [arrow(j, j, 1), arrow((j + n - 1) % n, j, 1), arrow((j + n - 1) % n, j, 2)])
        .collect();
    let names: Vec<String> = (0..n).map(|j| format!("x{j}")).collect();
    Ok((Graph::new(names.clone(), 2, &arrows, &[])?, DataFrame::new(vec![x], names)?))
}

fn linear(n: usize, rows: usize) -> Result<()> {
    let (graph, data) = system(n, rows)?;
    let samples = Samples::new(&data, &graph, &Vec::new())?;
    let name = format!("{n} variables x {rows}");
    time(&format!("mediation, horizon 10, {name}"), 21, || Mediation::fit(&samples, &graph, 10, true));
    time(&format!("its bootstrap, 100 samples, {name}"), 5, || {
        Mediation::bootstrap(&samples, &graph, 10, true, 100, 1)
    });
    for lag in [1, 3, 5] {
        time(&format!("adjusted effect at lag {lag}, {name}"), 21, || {
            let found = adjustment(&graph, &[Node::new(0, lag)], Node::new(1, 0));
            adjusted(
                &samples,
                &[Node::new(0, lag)],
                Node::new(1, 0),
                &found.set.unwrap_or_default(),
                found.window,
            )
        });
    }
    Ok(())
}

/// A chain, without data, with room for lags that are not there.
fn graph_alone(n: usize) -> Result<()> {
    let arrow = |cause, effect| Arrow { cause, effect, lag: 1 };
    let arrows: Vec<Arrow> = (0..n).flat_map(|j| [arrow(j, j), arrow(j.saturating_sub(1), j)]).collect();
    let graph = Graph::new((0..n).map(|j| format!("x{j}")).collect(), 3, &arrows, &[])?;
    time(&format!("adjustment at lag 4, {n} variables"), 21, || {
        adjustment(&graph, &[Node::new(0, 4)], Node::new(1, 0))
    });
    Ok(())
}

/// Three Gaussian processes on the first 600 rows, and what they expect in the next 200, each from the rows before it.
fn one_step() -> Result<()> {
    let (graph, data) = system(3, 800)?;
    let all = data.recordings()[0].clone();
    let first = DataFrame::new(vec![all.slice(ndarray::s![..600, ..]).to_owned()], graph.names().to_vec())?;
    let rows: Vec<f64> = all.iter().copied().collect();
    let settings = Settings { equations: Equations::Gp, members: 1, check: false, ..Settings::default() };
    time("fit and 200 one-step answers, Gp, 3 equations, 600 rows", 3, || -> Result<f64> {
        let model = StructuralModel::fit(&first, &graph, &settings, &Vec::new())?;
        let (system, mut scratch) = (&model.members()[0].model.system, Vec::new());
        Ok((600..800).map(|t| (0..3).map(|j| system.expected(&rows, t, j, &mut scratch)).sum::<f64>()).sum())
    });
    Ok(())
}

fn set(steps: usize) -> Vec<Action> {
    vec![Action::one("set", Intervention::set("x0", [0.2]).during(1, steps))]
}

fn simulation(equations: Equations, rows: usize) -> Result<()> {
    let (graph, data) = system(3, rows)?;
    let settings = Settings { equations, check: false, ..Settings::default() };
    let name = format!("{equations:?}, 3 equations, {rows} rows");
    let alone = Settings { members: 1, ..settings.clone() };
    time(&format!("fit without bootstraps, {name}"), 3, || {
        StructuralModel::fit(&data, &graph, &alone, &Vec::new())
    });
    time(&format!("fit with 20 members, {name}"), 3, || {
        StructuralModel::fit(&data, &graph, &settings, &Vec::new())
    });
    let checked = Settings { check: true, ..settings.clone() };
    time(&format!("fit, skill and calibration, {name}"), 3, || {
        StructuralModel::fit(&data, &graph, &checked, &Vec::new())
    });
    let model = StructuralModel::fit(&data, &graph, &settings, &Vec::new())?;
    let situation = Situation { rows: data.recordings()[0].view(), now: rows - 50 };
    for (paths, horizon) in [(1000, 10), (400, 10), (400, 3)] {
        let question = WhatIf { actions: set(horizon), paths, horizon, ..WhatIf::default() };
        time(&format!("what-if, {paths} paths x {horizon}, {name}"), 11, || {
            what_if(&model, &situation, &question)
        });
    }
    let had = WhatIf { actions: set(10), counterfactual: true, ..WhatIf::default() };
    time(&format!("had-I, 10 steps, {name}"), 11, || what_if(&model, &situation, &had));
    let why = ExplainQuestion {
        variable: "x1".into(),
        from_row: None,
        to_row: None,
        horizon: 10,
        seed: 1,
        start: 0.0,
    };
    time(&format!("explain, {name}"), 11, || explain(&model, &situation, &why));
    let pulse = EffectQuestion { cause: "x0".into(), effect: "x1".into(), max_lag: 3, standardised: false };
    time(&format!("effect up to lag 3 with its bootstraps, {name}"), 5, || effect(&model, &pulse));
    Ok(())
}

fn all() -> Result<()> {
    linear(3, 1000)?;
    linear(8, 2000)?;
    graph_alone(5)?;
    graph_alone(6)?;
    one_step()?;
    simulation(Equations::Linear, 1000)?;
    simulation(Equations::Gp, 502)?;
    simulation(Equations::Gp, 802)
}

fn main() {
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let done = one.map_err(|e| e.to_string()).and_then(|pool| pool.install(all).map_err(|e| e.to_string()));
    if let Err(message) = done {
        eprintln!("{message}");
    }
}
