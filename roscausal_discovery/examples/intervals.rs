//! How often the interval beside a link's strength holds what a long recording of the same system gives: a table of docs/confidence.md.
//!
//! `cargo run --release --example intervals -- METHOD TEST SYSTEMS [FIRST_SEED]` analyses SYSTEMS random systems of each kind with 100
//! subsamples: 3 to 6 variables, lags 1 to 3, 150 to 1500 samples (3 variables and to 400 samples with GPDC). Truth is the same analysis
//! of 30,000 further samples (2000 with GPDC). It prints, for each kind, the share of intervals that hold it, over the links that were
//! found and over those of them that are real.

mod systems;

use std::env;

use ndarray::s;
use rayon::prelude::*;
use roscausal_discovery::{
    Control, DataFrame, LinkMark, PcAlpha, Result, Settings, analyse,
    confidence::{Resampling, analyse_resampled},
    methods::Method,
    mix,
};
use systems::{Draw, KINDS, Kind, system};

/// For each link between two variables that was found: whether it is real, and whether its interval holds the truth.
fn run(kind: &Kind, method: Method, test: &str, seed: u64) -> Result<Vec<(bool, bool)>> {
    let mut draw = Draw(mix(seed));
    let slow = test.starts_with("gpdc");
    let (vars, lags) = (draw.whole([3, if slow { 3 } else { 6 }]), draw.whole([1, 3]));
    let (rows, long) = (draw.whole([150, if slow { 400 } else { 1500 }]), if slow { 2000 } else { 30_000 });
    let of_system = system(kind, vars, lags, rows + long, &mut draw);
    let names: Vec<String> = (0..vars).map(|var| format!("v{var}")).collect();
    let settings = Settings {
        method,
        cond_ind_test: test.into(),
        pc_alpha: PcAlpha::Fixed(0.05),
        tau_min: method.info().tau_min,
        tau_max: lags,
        ..Settings::default()
    };
    let frame = |from: usize, to: usize| {
        DataFrame::new(vec![of_system.data.slice(s![from..to, ..]).to_owned()], names.clone())
    };
    let resampling = Resampling { resamples: 100, ..Resampling::default() };
    let model = analyse_resampled(&frame(0, rows)?, &settings, &resampling, &Control::default())?;
    let truth = analyse(&frame(rows, rows + long)?, &settings, &Control::default())?;
    let mut found = Vec::new();
    for link in model.links.iter().filter(|link| link.cause != link.effect && link.mark == LinkMark::Forward)
    {
        let place = |name: &String, names: &[String]| names.iter().position(|other| other == name);
        let (Some(i), Some(j)) = (place(&link.cause, &truth.features), place(&link.effect, &truth.features))
        else {
            continue;
        };
        let (Some(low), Some(high)) = (link.value_low, link.value_high) else { continue };
        let Some(value) = truth.val_matrix[i][j][link.lag] else { continue };
        let (Some(cause), Some(effect)) = (place(&link.cause, &names), place(&link.effect, &names)) else {
            continue;
        };
        let is_real = of_system.links.iter().any(|&(i, j, lag, _)| (i, j, lag) == (cause, effect, link.lag));
        found.push((is_real, (low..=high).contains(&value)));
    }
    Ok(found)
}

fn tell(name: &str, links: &[(bool, bool)]) {
    let share = |of: &[&(bool, bool)]| {
        let held = of.iter().filter(|(_, held)| *held).count();
        format!("{:.1} % of {}", 100.0 * held as f64 / of.len().max(1) as f64, of.len())
    };
    let all: Vec<_> = links.iter().collect();
    let real: Vec<_> = links.iter().filter(|(real, _)| *real).collect();
    println!("| {name} | {} | {} |", share(&all), share(&real));
}

fn main() -> Result<()> {
    let args: Vec<String> = env::args().skip(1).collect();
    let [method, test, count, rest @ ..] = &args[..] else {
        println!("usage: intervals METHOD TEST SYSTEMS [FIRST_SEED]");
        return Ok(());
    };
    let (method, count): (Method, u64) = (method.parse()?, count.parse().unwrap_or(100));
    let first: u64 = rest.first().and_then(|seed| seed.parse().ok()).unwrap_or(1);
    println!("| systems | links found | of them real |\n|---|---|---|");
    let mut all = Vec::new();
    for (k, kind) in KINDS.iter().enumerate() {
        let seeds = (0..count).map(|i| 1_000_003 * (first + i) + k as u64).collect::<Vec<_>>();
        let found: Vec<_> =
            seeds.into_par_iter().map(|seed| run(kind, method, test, seed)).collect::<Result<_>>()?;
        let links: Vec<(bool, bool)> = found.into_iter().flatten().collect();
        tell(kind.name, &links);
        all.extend(links);
    }
    tell("all", &all);
    Ok(())
}
