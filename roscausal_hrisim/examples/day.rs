//! Runs working days with the shortest ways and prints what became of the tasks: `day [SEEDS]`.

use roscausal_hrisim::{Scenario, Simulation};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let seeds: u64 = std::env::args().nth(1).map_or(Ok(3), |text| text.parse())?;
    for seed in 1..=seeds {
        let begin = std::time::Instant::now();
        let scenario = Scenario::named("warehouse").ok_or("no warehouse")?;
        let mut simulation = Simulation::new(&scenario, seed)?;
        while !simulation.is_over() {
            simulation.step();
            let day = simulation.day.as_ref().ok_or("no day")?;
            if seed == 1 && simulation.steps().is_multiple_of(25 * 1800) {
                let counts = day.counts(&simulation.crowd);
                println!(
                    "{:5.2} charge {:3.0} {:?}",
                    day.clock(simulation.time()),
                    day.porter.charge,
                    counts
                );
            }
        }
        let day = simulation.day.as_ref().ok_or("no day")?;
        let p = &day.porter;
        println!(
            "seed {seed}: done {} failed {} of {}, driven {:.0} m, wasted {:.0} m, empty {}, close {:.0} s, charge {:.0}, {:.2} s",
            p.done,
            p.failed,
            p.tasks.len(),
            p.driven,
            p.wasted,
            p.empty,
            day.close_seconds,
            p.charge,
            begin.elapsed().as_secs_f64()
        );
    }
    Ok(())
}
