//! Measures what a tracker's rate, jitter and losses do to a known link: how often a link at lag 0 is found that is not there, and how
//! strong the true one is, in the exact rows, in those that the nodes record by each rule, and in the exact values at the sightings'
//! moments, which no rule can better. Prints a table in Markdown.
//!
//! ```sh
//! cargo run --release -p roscausal_core --example sightings [-- SEEDS [ROWS]]
//! ```

#![allow(clippy::expect_used, reason = "a program that measures may end in a panic")]

#[path = "../tests/common/sightings.rs"]
mod world;

use world::{Found, Stamps, Tracker, run};

/// Intervals of the tracker and steps between rows, seconds.
const STEPS: [(f64, f64); 14] = [
    (0.2, 0.2),
    (0.1, 0.1),
    (0.04, 0.04),
    (1.0 / 7.0, 0.2),
    (1.0 / 12.0, 0.1),
    (1.0 / 15.0, 0.1),
    (0.04, 0.05),
    (0.2, 0.3),
    (0.1, 0.2),
    (0.2, 0.5),
    (0.1, 0.5),
    (0.04, 0.2),
    (0.02, 0.1),
    (0.02, 0.5),
];
const JITTER: [(f64, Stamps, f64); 5] = [
    (0.0, Stamps::Off, 0.0),
    (0.005, Stamps::Off, 0.0),
    (0.005, Stamps::True, 0.1),
    (0.02, Stamps::Off, 0.0),
    (0.02, Stamps::True, 0.1),
];

fn main() {
    let mut numbers = std::env::args().skip(1).map(|text| text.parse::<u64>().expect("a number"));
    let (seeds, rows) = (numbers.next().unwrap_or(200), numbers.next().unwrap_or(1200) as usize);
    println!("| Hz | step, s | jitter, ms | stamps | lost | exact | linear | hold | auto | when seen |");
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for (interval_s, dt_s) in STEPS {
        for (jitter_s, stamps, lost) in JITTER {
            tell(&Tracker { interval_s, jitter_s, stamps, lost, dt_s }, seeds, rows);
        }
    }
}

/// Prints, for the exact rows and either rule, the links at lag 0 and the strength of the true one; bold is what is out of bounds.
fn tell(tracker: &Tracker, seeds: u64, rows: usize) {
    let runs: Vec<[Found; 5]> = (0..seeds).map(|seed| run(tracker, rows, seed)).collect();
    let found = [0, 1, 2, 3, 4].map(|which| {
        let mean =
            |of: &dyn Fn(&Found) -> f64| runs.iter().map(|run| of(&run[which])).sum::<f64>() / seeds as f64;
        (
            runs.iter().filter(|run| run[which].at_once).count() as f64,
            mean(&|run| run.strength),
            mean(&|run| run.error),
        )
    });
    let (exact, right, _) = found[0];
    let share = exact / seeds as f64;
    let most = exact + 2.0 * (seeds as f64 * share * (1.0 - share)).sqrt().max(1.0);
    let cell = |(at_once, strength, error): (f64, f64, f64)| {
        let bold = |text: String, is_within: bool| if is_within { text } else { format!("**{text}**") };
        format!(
            "{}, {} ({error:.2})",
            bold(format!("{at_once:.0}"), at_once <= most),
            bold(format!("{strength:.2}"), (strength - right).abs() <= 0.05)
        )
    };
    println!(
        "| {:.0} | {} | {:.0} | {} | {:.0} % | {exact:.0}, {right:.2} | {} | {} | {} | {} |",
        1.0 / tracker.interval_s,
        tracker.dt_s,
        1e3 * tracker.jitter_s,
        if tracker.stamps == Stamps::Off { "off" } else { "true" },
        100.0 * tracker.lost,
        cell(found[1]),
        cell(found[2]),
        cell(found[3]),
        cell(found[4])
    );
}
