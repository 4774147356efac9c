//! What pooling does where recordings differ in level and scale: a table of docs/data.md.
//!
//! `cargo run --release --example pooling -- SYSTEMS [FIRST_SEED]` cuts SYSTEMS random systems of each kind (3 to 5 variables, lags 1 and
//! 2) into 2 to 20 recordings, 1000 rows together. Each variable of a recording has another level (some three standard deviations apart)
//! and scale. It prints the share of absent links that PCMCI with ParCorr finds at 0.05, and of those that are there: in one recording of
//! as many rows without such differences, pooled with the default, and pooled as they are (`--levels keep`).

mod systems;

use std::env;

use ndarray::{Array2, s};
use rayon::prelude::*;
use roscausal_discovery::{
    Control, DataFrame, Levelled, PcAlpha, Result, Settings, analyse, methods::Method, mix, settings::Levels,
};
use systems::{Draw, KINDS, Kind, system};

const ROWS: usize = 1000;
const LAGS: usize = 2;
/// Rows between two recordings, which are not recorded.
const PAUSE: usize = 50;

/// Absent links and how many of them were found, present ones and how many of these.
type Counts = [usize; 4];

fn counts(
    recordings: Vec<Array2<f64>>,
    levels: Levels,
    links: &[(usize, usize, usize, f64)],
) -> Result<Counts> {
    let vars = recordings[0].ncols();
    let runs: Vec<usize> = (0..recordings.len()).collect();
    let data = DataFrame::new(recordings, (0..vars).map(|var| format!("v{var}")).collect())?;
    let settings = Settings {
        method: Method::Pcmci,
        cond_ind_test: "parcorr".into(),
        pc_alpha: PcAlpha::Fixed(0.05),
        tau_min: 1,
        tau_max: LAGS,
        levels,
        ..Settings::default()
    };
    let Levelled { data, settings, .. } = Levelled::of(data, &runs, settings);
    let model = analyse(&data, &settings, &Control::default())?;
    let mut counts = [0; 4];
    for (cause, effect) in (0..vars).flat_map(|i| (0..vars).map(move |j| (i, j))).filter(|(i, j)| i != j) {
        for lag in 1..=LAGS {
            let is_there = links.iter().any(|&(i, j, of, _)| (i, j, of) == (cause, effect, lag));
            let is_found = model.links.iter().any(|link| {
                (link.cause.as_str(), link.effect.as_str(), link.lag)
                    == (&format!("v{cause}"), &format!("v{effect}"), lag)
            });
            let place = if is_there { 2 } else { 0 };
            counts[place] += 1;
            counts[place + 1] += usize::from(is_found);
        }
    }
    Ok(counts)
}

fn run(kind: &Kind, seed: u64) -> Result<[Counts; 3]> {
    let mut draw = Draw(mix(seed));
    let (vars, many) = (draw.whole([3, 5]), draw.whole([2, 20]));
    let rows = ROWS / many;
    let of_system = system(kind, vars, LAGS, ROWS + many * (rows + PAUSE), &mut draw);
    let one = of_system.data.slice(s![..ROWS, ..]).to_owned();
    let mut several = Vec::new();
    for number in 0..many {
        let from = ROWS + number * (rows + PAUSE);
        let mut part = of_system.data.slice(s![from..from + rows, ..]).to_owned();
        for mut column in part.columns_mut() {
            let (level, scale) = (3.0 * draw.normal(), (0.4 * draw.normal()).exp());
            column.mapv_inplace(|value| level + scale * value);
        }
        several.push(part);
    }
    Ok([
        counts(vec![one], Levels::Auto, &of_system.links)?,
        counts(several.clone(), Levels::Auto, &of_system.links)?,
        counts(several, Levels::Keep, &of_system.links)?,
    ])
}

fn main() -> Result<()> {
    let mut args = env::args().skip(1).map(|text| text.parse::<u64>().unwrap_or(200));
    let (systems, first) = (args.next().unwrap_or(200), args.next().unwrap_or(0));
    println!(
        "| systems | one recording: false, found | pooled by default | `--levels keep` |\n|---|---|---|---|"
    );
    for kind in &KINDS {
        let runs: Vec<[Counts; 3]> =
            (first..first + systems).into_par_iter().map(|seed| run(kind, seed)).collect::<Result<_>>()?;
        let cell = |which: usize| {
            let sum = |at: usize| runs.iter().map(|run| run[which][at]).sum::<usize>() as f64;
            let found =
                if sum(2) > 0.0 { format!("{:.1} %", 100.0 * sum(3) / sum(2)) } else { "-".to_owned() };
            format!("{:.1} %, {found}", 100.0 * sum(1) / sum(0))
        };
        println!("| {} | {} | {} | {} |", kind.name, cell(0), cell(1), cell(2));
    }
    Ok(())
}
