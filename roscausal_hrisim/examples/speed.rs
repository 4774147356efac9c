//! How much faster than real time a crowd runs on one core:
//! `cargo run --release -p roscausal_hrisim --example speed -- 100 5 60` (pedestrians, robots, seconds).

use std::time::Instant;

use roscausal_hrisim::{Scenario, Simulation};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    let mut number = |default: usize| args.next().map_or(Ok(default), |text| text.parse::<usize>());
    let (pedestrians, robots, seconds) = (number(100)?, number(5)?, number(60)?);
    let scenario = Scenario { duration: seconds as f64, ..Scenario::crowd(pedestrians, robots) };
    let mut simulation = Simulation::new(&scenario, 1)?;
    let begin = Instant::now();
    while !simulation.is_over() {
        simulation.step();
    }
    let taken = begin.elapsed().as_secs_f64();
    println!(
        "{pedestrians} pedestrians, {robots} robots: {seconds} s in {taken:.2} s, {:.0} times real time",
        seconds as f64 / taken
    );
    Ok(())
}
