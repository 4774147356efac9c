//! How often the intervals of had-I and explain hold the truth: a table of docs/reasoning.md.
//!
//! `cargo run --release -p roscausal_reasoning --example had_i -- SYSTEMS [FIRST_SEED]` draws SYSTEMS random systems of each kind, 3 to 5
//! variables, lags 1 and 2, 300 to 1000 samples, and fits the structural model on the true graph. It asks 20 questions of each: had a
//! variable been set within what was recorded, what would each variable have been after 2, 5 and 10 steps; and why did a variable change.
//! Truth is the system itself with the noise that it had. All intervals are to hold with 90 %.

use std::{env, f64::consts::TAU};

use ndarray::{Array2, ArrayView2, s};
use rayon::prelude::*;
use roscausal_discovery::{DataFrame, Result, mix, quantile};
use roscausal_reasoning::{
    Settings, StructuralModel,
    answer::{ExplainQuestion, explain, what_if},
    graph::{Arrow, Graph},
    question::{Action, Intervention, Situation, WhatIf},
};

const HORIZON: usize = 10;
const STEPS: [usize; 3] = [2, 5, 10];
const QUESTIONS: usize = 20;
/// Steps before the first sample, and between the questions.
const BEFORE: usize = 200;
/// Longest lag.
const LAGS: usize = 2;

const CURVES: [fn(f64) -> f64; 5] = [
    |x| 1.5 * (1.2 * x).tanh(),
    |x| x * x / (1.0 + 0.3 * x * x) - 0.6,
    |x| 1.3 * (1.5 * x).sin(),
    |x| x.abs().min(3.0) - 0.8,
    |x| 1.3 * x.clamp(0.0, 3.0),
];

struct Draw(u64);

impl Draw {
    fn uniform(&mut self) -> f64 {
        self.0 += 1;
        (mix(self.0) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn within(&mut self, [from, to]: [f64; 2]) -> f64 {
        from + (to - from) * self.uniform()
    }

    fn whole(&mut self, [from, to]: [usize; 2]) -> usize {
        from + (self.uniform() * (to + 1 - from) as f64) as usize
    }

    fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.uniform()).ln()).sqrt() * (TAU * self.uniform()).cos()
    }
}

struct Link {
    cause: usize,
    effect: usize,
    lag: usize,
    strength: f64,
    curve: fn(f64) -> f64,
}

struct System {
    past: Vec<f64>,
    links: Vec<Link>,
}

impl System {
    fn new(curved: bool, draw: &mut Draw) -> Self {
        let n = draw.whole([3, 5]);
        let mut links = Vec::new();
        for (cause, effect) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))).filter(|(i, j)| i != j) {
            if draw.uniform() < 1.2 / n as f64 {
                let sign = if draw.uniform() < 0.5 { -1.0 } else { 1.0 };
                let curve = if curved && draw.uniform() < 0.7 { CURVES[draw.whole([0, 4])] } else { |x| x };
                let (lag, strength) = (draw.whole([1, LAGS]), sign * draw.within([0.15, 0.55]));
                links.push(Link { cause, effect, lag, strength, curve });
            }
        }
        Self { past: (0..n).map(|_| draw.within([0.2, 0.8])).collect(), links }
    }

    fn n(&self) -> usize {
        self.past.len()
    }

    /// The value of a variable at row `t`, without its noise.
    fn mean(&self, rows: &Array2<f64>, t: usize, var: usize) -> f64 {
        let of_links = self.links.iter().filter(|link| link.effect == var);
        let driven: f64 =
            of_links.map(|link| link.strength * (link.curve)(rows[[t - link.lag, link.cause]])).sum();
        self.past[var] * rows[[t - 1, var]] + driven
    }

    /// Rows that follow the first `from` of `rows`, with this noise; `set`: a variable that has a value.
    fn run(
        &self,
        rows: &mut Array2<f64>,
        from: usize,
        noise: ArrayView2<'_, f64>,
        set: Option<(usize, f64)>,
    ) {
        for t in from..rows.nrows() {
            for var in 0..self.n() {
                rows[[t, var]] = match set {
                    Some((of, value)) if of == var => value,
                    _ => self.mean(rows, t, var) + noise[[t - from, var]],
                };
            }
        }
    }

    fn graph(&self) -> Result<Graph> {
        let own = (0..self.n()).map(|var| Arrow { cause: var, effect: var, lag: 1 });
        let others =
            self.links.iter().map(|link| Arrow { cause: link.cause, effect: link.effect, lag: link.lag });
        let names = (0..self.n()).map(|var| format!("v{var}")).collect();
        Graph::new(names, LAGS, &own.chain(others).collect::<Vec<_>>(), &[])
    }

    /// The part of each variable in the change of `y` over `rows`, of which the first `LAGS` are the past (Shapley values).
    fn parts(&self, rows: &Array2<f64>, noise: ArrayView2<'_, f64>, y: usize) -> Vec<f64> {
        let n = self.n();
        let outcome = |subset: usize| {
            let mut own = noise.to_owned();
            (0..n).filter(|var| subset >> var & 1 == 0).for_each(|var| own.column_mut(var).fill(0.0));
            let mut path = rows.clone();
            self.run(&mut path, LAGS, own.view(), None);
            path[[rows.nrows() - 1, y]]
        };
        let values: Vec<f64> = (0..1 << n).map(outcome).collect();
        let factorial = |k: usize| (1..=k).map(|k| k as f64).product::<f64>();
        let part = |var: usize| {
            let without = (0..1_usize << n).filter(|subset| subset >> var & 1 == 0);
            let of = |subset: usize| {
                let size = subset.count_ones() as usize;
                let weight = factorial(size) * factorial(n - size - 1) / factorial(n);
                weight * (values[subset | 1 << var] - values[subset])
            };
            without.map(of).sum()
        };
        (0..n).map(part).collect()
    }
}

/// What was held, by step of had-I and then by explain.
type Held = Vec<(usize, bool)>;

fn run(curved: bool, seed: u64) -> Result<Held> {
    let mut draw = Draw(mix(seed));
    let (system, all, noise) = loop {
        let system = System::new(curved, &mut draw);
        let rows = BEFORE + draw.whole([300, 1000]);
        let noise = Array2::from_shape_simple_fn((rows, system.n()), || draw.normal());
        let mut all = Array2::zeros((rows, system.n()));
        system.run(&mut all, LAGS, noise.slice(s![LAGS.., ..]), None);
        if all.iter().all(|value: &f64| value.abs() < 50.0) {
            break (system, all.slice_move(s![BEFORE.., ..]), noise.slice_move(s![BEFORE.., ..]));
        }
    };
    let graph = system.graph()?;
    let data = DataFrame::new(vec![all.clone()], graph.names().to_vec())?;
    let model = StructuralModel::fit(&data, &graph, &Settings::default(), &Vec::new())?;
    let mut held = Vec::new();
    for _ in 0..QUESTIONS {
        let now = draw.whole([LAGS, all.nrows() - HORIZON - 2]);
        let var = draw.whole([0, system.n() - 1]);
        let mut sorted = all.column(var).to_vec();
        sorted.sort_by(f64::total_cmp);
        let value = quantile(&sorted, draw.within([0.1, 0.9]));
        let question = WhatIf {
            counterfactual: true,
            actions: vec![Action::one("set", Intervention::set(graph.names()[var].clone(), vec![value]))],
            horizon: HORIZON,
            ..WhatIf::default()
        };
        let answer = what_if(&model, &Situation { rows: all.view(), now }, &question);
        let mut truth = all.slice(s![now + 1 - LAGS..=now + HORIZON, ..]).to_owned();
        system.run(&mut truth, LAGS, noise.slice(s![now + 1..=now + HORIZON, ..]), Some((var, value)));
        for forecast in answer.outlooks.iter().flat_map(|outlook| &outlook.forecasts) {
            let other = graph.names().iter().position(|name| *name == forecast.variable).unwrap_or(0);
            for (k, step) in STEPS.into_iter().enumerate() {
                let (low, high) = (forecast.lower[step - 1], forecast.upper[step - 1]);
                let real = truth[[LAGS + step - 1, other]];
                // What nothing reaches is as it was, exactly.
                if other != var && (real - all[[now + step, other]]).abs() > 1e-9 {
                    held.push((k, low <= real && real <= high));
                }
            }
        }
        let question = ExplainQuestion {
            variable: graph.names()[var].clone(),
            from_row: Some(now),
            to_row: Some(now + 5),
            horizon: HORIZON,
            seed: 1,
            start: 0.0,
        };
        let answer = explain(&model, &Situation::newest(all.view()), &question);
        let stretch = all.slice(s![now + 1 - LAGS..=now + 5, ..]).to_owned();
        let parts = system.parts(&stretch, noise.slice(s![now + 1..=now + 5, ..]), var);
        for part in &answer.contributions {
            let other = graph.names().iter().position(|name| *name == part.variable).unwrap_or(0);
            held.push((STEPS.len(), part.lower <= parts[other] && parts[other] <= part.upper));
        }
    }
    Ok(held)
}

fn main() -> Result<()> {
    let args: Vec<u64> = env::args().skip(1).filter_map(|word| word.parse().ok()).collect();
    let [count, rest @ ..] = &args[..] else {
        println!("usage: had_i SYSTEMS [FIRST_SEED]");
        return Ok(());
    };
    let first = rest.first().copied().unwrap_or(1);
    println!("| systems | had I, 2 steps | 5 steps | 10 steps | explain |\n|---|---|---|---|---|");
    for (name, curved) in [("linear", false), ("curved", true)] {
        let seeds: Vec<u64> = (0..*count).map(|i| 1_000_003 * (first + i) + u64::from(curved)).collect();
        let all: Vec<Held> = seeds.into_par_iter().map(|seed| run(curved, seed)).collect::<Result<_>>()?;
        let share = |k: usize| {
            let of: Vec<bool> =
                all.iter().flatten().filter(|(of, _)| *of == k).map(|(_, held)| *held).collect();
            let held = of.iter().filter(|held| **held).count();
            format!("{:.1} % of {}", 100.0 * held as f64 / of.len().max(1) as f64, of.len())
        };
        println!("| {name} | {} |", (0..=STEPS.len()).map(share).collect::<Vec<_>>().join(" | "));
    }
    Ok(())
}
