//! How long a question about a route takes: 60 places, ten hours in steps of a minute, counts known at each place.
//!
//! `cargo run --release -p roscausal_reasoning --example route` prints the median, and the slowest of 200.

use ndarray::Array2;
use roscausal_discovery::DataFrame;
use roscausal_reasoning::{
    graph::{Arrow, Graph},
    route::{
        levels::{Levels, Made, Way},
        map::{Map, Place},
        pace::{Drain, Pace},
        plan::{Cost, House, Trip},
    },
};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let name = |column: usize, row: usize| format!("p{column}_{row}");
    let (mut places, mut arcs) = (Vec::new(), Vec::new());
    for (column, row) in (0..6).flat_map(|column| (0..10).map(move |row| (column, row))) {
        let at = [10.0 * column as f64, 6.0 * row as f64];
        places.push(Place { name: name(column, row), at, kind: String::new() });
        if row > 0 {
            arcs.push([name(column, row - 1), name(column, row)]);
        }
        if column > 0 && row % 3 == 0 {
            arcs.push([name(column - 1, row), name(column, row)]);
        }
    }
    let map = Map::new(places, &arcs)?;
    let day = |place: usize| {
        Array2::from_shape_fn((3600, 2), |(row, column)| match column {
            0 => ((place * 31 + row / 360 * 7) % 5) as f64 + ((row * 12_345 + place) % 7) as f64 / 10.0,
            _ => 8.0 + row as f64 / 360.0,
        })
    };
    let names = ["people", "hour"].map(str::to_owned).to_vec();
    let graph = Graph::new(names.clone(), 1, &[Arrow { cause: 0, effect: 0, lag: 1 }], &[])?;
    let data = DataFrame::new((0..60).map(day).collect(), names)?;
    let made: Vec<Made> = (0..60).map(|place| Made { place, day: 0 }).collect();
    let levels = Levels::fit(&data, &made, &graph, 0, 1, Way::Causal)?;
    let pace = Pace { free: 1.25, each: 1.5 };
    let house =
        House { map: &map, levels: &levels, pace, drain: Drain { second: 0.006, metre: 0.002 }, row: 10.0 };
    let now = vec![2.0; 60];
    let mut took: Vec<f64> = Vec::new();
    for k in 0..200 {
        // Waiting costs next to nothing, so every minute of the day is looked at.
        let cost = Cost { waiting: 1e-9, ..Cost::default() };
        let (from, to) = (k % 60, (k * 7 + 31) % 60);
        let trip =
            Trip { from, to, hour: 8.0, horizon: 35_000.0, allowed: Some(200.0), now: Some(&now), cost };
        let begin = std::time::Instant::now();
        std::hint::black_box(house.best(&trip)?);
        took.push(begin.elapsed().as_secs_f64() * 1e3);
    }
    took.sort_by(f64::total_cmp);
    println!("median {:.1} ms, slowest {:.1} ms", took[100], took[199]);
    Ok(())
}
