//! Recordings that differ in level and scale: over 200 random systems, pooling makes no false links by default, and finds the true ones
//! as one recording of the same length does.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use ndarray::{Array2, s};
use roscausal_discovery::{Control, DataFrame, Levelled, Levels, Settings, analyse, methods::Method, mix};

fn uniform(seed: &mut u64) -> f64 {
    *seed += 1;
    mix(*seed) as f64 / u64::MAX as f64
}

fn normal(seed: &mut u64) -> f64 {
    (0..12).map(|_| uniform(seed)).sum::<f64>() - 6.0
}

/// Recordings of four variables that remember; `v0` drives `v1` one step later, and nothing else drives another. `apart`: each recording
/// has a level and a scale of its own.
fn recordings(seed: u64, lengths: &[usize], apart: bool) -> DataFrame {
    let mut seed = mix(seed + 1) >> 1;
    let own: Vec<f64> = (0..4).map(|_| 0.2 + 0.5 * uniform(&mut seed)).collect();
    let size = 0.12 + 0.1 * uniform(&mut seed);
    let mut one = |rows: usize| {
        let mut values = Array2::<f64>::zeros((rows + 50, 4));
        for t in 1..rows + 50 {
            for var in 0..4 {
                let driven = if var == 1 { size * values[[t - 1, 0]] } else { 0.0 };
                values[[t, var]] = own[var] * values[[t - 1, var]] + driven + normal(&mut seed);
            }
        }
        let mut values = values.slice(s![50.., ..]).to_owned();
        for mut column in values.columns_mut() {
            let (level, scale) = (4.0 * normal(&mut seed), (1.2 * normal(&mut seed)).exp());
            if apart {
                column.mapv_inplace(|value| level + scale * value);
            }
        }
        values
    };
    let all = lengths.iter().map(|rows| one(*rows)).collect();
    DataFrame::new(all, (0..4).map(|var| format!("v{var}")).collect()).unwrap()
}

/// The share of absent links that are found, and whether the true one is.
fn found(data: DataFrame, levels: Levels) -> (f64, bool) {
    let settings =
        Settings { method: Method::Pcmci, cond_ind_test: "parcorr".into(), levels, ..Settings::default() };
    let each: Vec<usize> = (0..data.recordings().len()).collect();
    let Levelled { data, settings, .. } = Levelled::of(data, &each, settings);
    let model = analyse(&data, &settings, &Control::default()).unwrap();
    let is = |i: usize, j: usize| model.graph[i][j][1].is_link();
    let pairs =
        (0..4).flat_map(|i| (0..4).map(move |j| (i, j))).filter(|(i, j)| i != j && (*i, *j) != (0, 1));
    (pairs.filter(|&(i, j)| is(i, j)).count() as f64 / 11.0, is(0, 1))
}

#[test]
fn pooled_recordings_have_the_nominal_level_and_the_power_of_one_recording() {
    let (mut pooled, mut kept, mut one) = ([0.0; 2], [0.0; 2], [0.0; 2]);
    let systems = 200;
    for seed in 0..systems {
        let mut of = mix(9000 + seed) >> 1;
        let n = 2 + (19.0 * uniform(&mut of)) as usize;
        let lengths: Vec<usize> = (0..n).map(|_| 400 / n + (40.0 * uniform(&mut of)) as usize + 20).collect();
        let whole = recordings(seed, &[lengths.iter().sum()], false);
        for (sum, (data, levels)) in [&mut pooled, &mut kept, &mut one].into_iter().zip([
            (recordings(seed, &lengths, true), Levels::Auto),
            (recordings(seed, &lengths, true), Levels::Keep),
            (whole, Levels::Auto),
        ]) {
            let (wrong, right) = found(data, levels);
            *sum = [sum[0] + wrong / systems as f64, sum[1] + f64::from(u8::from(right)) / systems as f64];
        }
    }
    println!("false, true: pooled {pooled:.3?}, levels kept {kept:.3?}, one recording {one:.3?}");
    assert!((0.035..0.065).contains(&pooled[0]) && kept[0] > 1.5 * pooled[0], "{pooled:?} {kept:?}");
    assert!(pooled[1] > one[1] - 0.05, "{pooled:?} {one:?}");
}
