//! How often links of a stated chance are real: the tables of docs/confidence.md.
//!
//! `cargo run --release --example calibration -- METHOD TEST SYSTEMS [FIRST_SEED]` analyses SYSTEMS random systems of each kind, 3 to 8
//! variables (to 5 with GPDC), lags 1 to 3, 150 to 1500 samples (to 500 with GPDC), and prints, for each kind and for all, how many links
//! have a chance in each range, what the chances say on average, and how many are real. Every system has its own seed.

mod systems;

use std::env;

use rayon::prelude::*;
use roscausal_discovery::{Control, DataFrame, PcAlpha, Result, Settings, analyse, methods::Method, mix};
use systems::{Draw, KINDS, Kind, System, system};

/// Bounds of the ranges of chances.
const BOUNDS: [f64; 7] = [0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.01];
/// The chances of one run's links, and whether each is real.
fn run(kind: &Kind, method: Method, test: &str, seed: u64) -> Result<Vec<(f64, bool)>> {
    let mut draw = Draw(mix(seed));
    let slow = test.starts_with("gpdc");
    let (vars, lags) = (draw.whole([3, if slow { 5 } else { 8 }]), draw.whole([1, 3]));
    let rows = draw.whole([150, if slow { 500 } else { 1500 }]);
    let System { links, data } = system(kind, vars, lags, rows, &mut draw);
    let names: Vec<String> = (0..vars).map(|var| format!("v{var}")).collect();
    let tau_min = method.info().tau_min;
    let settings = Settings {
        method,
        cond_ind_test: test.into(),
        pc_alpha: PcAlpha::Fixed(0.05),
        tau_min,
        tau_max: lags,
        ..Settings::default()
    };
    let model = analyse(&DataFrame::new(vec![data], names.clone())?, &settings, &Control::default())?;
    let place = |name: &String| names.iter().position(|other| other == name).unwrap_or(0);
    let is_real = |cause: usize, effect: usize, lag: usize| {
        links.iter().any(|&(i, j, of, _)| (i, j, of) == (cause, effect, lag))
    };
    let found = model
        .links
        .iter()
        .filter_map(|link| Some((link.chance?, is_real(place(&link.cause), place(&link.effect), link.lag))));
    Ok(found.collect())
}

fn tell(name: &str, links: &[(f64, bool)], runs: usize) {
    println!(
        "\n{name}: {} links, {:.2} a run by the chances, {:.2} real",
        links.len(),
        links.iter().map(|(chance, _)| chance).sum::<f64>() / runs as f64,
        links.iter().filter(|(_, real)| *real).count() as f64 / runs as f64
    );
    println!("| chance | links | said | real |\n|---|---|---|---|");
    let (mut weighted, mut worst) = (0.0, 0.0_f64);
    for bounds in BOUNDS.windows(2) {
        let within: Vec<_> =
            links.iter().filter(|(chance, _)| (bounds[0]..bounds[1]).contains(chance)).collect();
        let count = within.len() as f64;
        if within.is_empty() {
            continue;
        }
        let stated = within.iter().map(|(chance, _)| chance).sum::<f64>() / count;
        let real = within.iter().filter(|(_, real)| *real).count() as f64 / count;
        weighted += count * (stated - real).abs();
        worst = if within.len() >= 100 { worst.max((stated - real).abs()) } else { worst };
        println!(
            "| {:.0} to {:.0} % | {count:.0} | {:.1} % | {:.1} % |",
            100.0 * bounds[0],
            (100.0 * bounds[1]).min(100.0),
            100.0 * stated,
            100.0 * real
        );
    }
    println!(
        "mean error {:.1} points, in a range of 100 links or more at most {:.1}",
        100.0 * weighted / links.len().max(1) as f64,
        100.0 * worst
    );
}

fn main() -> Result<()> {
    let args: Vec<String> = env::args().skip(1).collect();
    let [method, test, count, rest @ ..] = &args[..] else {
        println!("usage: calibration METHOD TEST SYSTEMS [FIRST_SEED]");
        return Ok(());
    };
    let (method, count): (Method, u64) = (method.parse()?, count.parse().unwrap_or(100));
    let first: u64 = rest.first().and_then(|seed| seed.parse().ok()).unwrap_or(1);
    let mut all = Vec::new();
    for (k, kind) in KINDS.iter().enumerate() {
        let seeds = (0..count).map(|i| 1_000_003 * (first + i) + k as u64).collect::<Vec<_>>();
        let found: Vec<_> =
            seeds.into_par_iter().map(|seed| run(kind, method, test, seed)).collect::<Result<_>>()?;
        let links: Vec<(f64, bool)> = found.into_iter().flatten().collect();
        tell(kind.name, &links, count as usize);
        all.extend(links);
    }
    tell("all", &all, KINDS.len() * count as usize);
    Ok(())
}
