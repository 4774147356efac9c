//! Prints statistics of a scenario over seeds: `cargo run --example statistics -- thor 1 20`.

use roscausal_hrisim::{Scenario, statistics::Statistics};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    let name = args.next().unwrap_or_else(|| "thor".to_owned());
    let first: u64 = args.next().map_or(Ok(1), |text| text.parse())?;
    let last: u64 = args.next().map_or(Ok(20), |text| text.parse())?;
    let scenario = Scenario::load(&name)?;
    println!(
        "seed goals  v4-6  v2-3 v1-1.5 v.5-1   top   acc robot@v stopped course encounters: s, least m/s, m"
    );
    for seed in first..=last {
        let s = Statistics::of(&scenario, seed)?;
        let met: Vec<String> = s
            .encounters
            .iter()
            .map(|e| format!("{:.1},{:.2},{:.1}", e.end - e.start, e.least_speed, e.least_distance))
            .collect();
        let [a, b, c, d] = s.speeds;
        println!(
            "{seed:4} {:5} {a:5.2} {b:5.2} {c:6.2} {d:5.2} {:5.2} {:5.2} {:7.2} {:7.2} {:6.3} {:2} {}",
            s.goals,
            s.top_speed,
            s.top_acceleration,
            s.robot_at_speed,
            s.robot_stopped,
            s.collision_course,
            met.len(),
            met.join("  ")
        );
    }
    Ok(())
}
