//! Measures what a tracker's rate, jitter and losses do to a known link: how often a link at lag 0 is found that is not there, and how
//! strong the true one is, in the exact rows and in those that the nodes record.
//!
//! ```sh
//! cargo run --release -p roscausal_core --example sightings [-- SEEDS [ROWS]]
//! ```

#![allow(clippy::expect_used, reason = "a program that measures may end in a panic")]

#[path = "../tests/common/sightings.rs"]
mod world;

use world::{Found, Stamps, Tracker, run};

fn main() {
    let mut numbers = std::env::args().skip(1).map(|text| text.parse::<u64>().expect("a number"));
    let (seeds, rows) = (numbers.next().unwrap_or(200), numbers.next().unwrap_or(1200) as usize);
    println!("{seeds} seeds of {rows} rows; exact rows, then recorded ones");
    println!("rule    Hz    step  jitter  stamps  lost   links at lag 0    strength        error");
    for hold in [false, true] {
        for (interval_s, dt_s) in STEPS {
            for (jitter_s, stamps) in
                [(0.0, Stamps::Off), (0.005, Stamps::Off), (0.02, Stamps::Off), (0.02, Stamps::True)]
            {
                for lost in [0.0, 0.1] {
                    let tracker = Tracker { interval_s, jitter_s, stamps, lost, dt_s, hold };
                    tell(&tracker, seeds, rows);
                }
            }
        }
    }
}

/// Intervals of the tracker and steps between rows, seconds.
const STEPS: [(f64, f64); 8] =
    [(0.2, 0.2), (0.2, 0.4), (0.1, 0.1), (0.1, 0.2), (0.1, 0.5), (0.04, 0.04), (0.04, 0.2), (0.02, 0.1)];

fn tell(tracker: &Tracker, seeds: u64, rows: usize) {
    let runs: Vec<[Found; 2]> = (0..seeds).map(|seed| run(tracker, rows, seed)).collect();
    let count = |which: usize| runs.iter().filter(|run| run[which].at_once).count();
    let mean = |of: &dyn Fn(&[Found; 2]) -> f64| runs.iter().map(of).sum::<f64>() / seeds as f64;
    let (exact, recorded) = (count(0), count(1));
    let share = exact as f64 / seeds as f64;
    let allowed = exact as f64 + 2.0 * (seeds as f64 * share * (1.0 - share)).sqrt().max(1.0);
    let (right, strength) = (mean(&|run| run[0].strength), mean(&|run| run[1].strength));
    let verdict = match (recorded as f64 <= allowed, (strength - right).abs() <= 0.05) {
        (true, true) => "",
        (false, true) => "  links at lag 0",
        (true, false) => "  strength",
        (false, false) => "  links at lag 0, strength",
    };
    println!(
        "{}  {:4.1}  {:5.2}  {:5.3}  {:6}  {:4.2}   {exact:4} {recorded:4}         {right:.3} {strength:.3}     {:.3}{verdict}",
        if tracker.hold { "hold  " } else { "linear" },
        1.0 / tracker.interval_s,
        tracker.dt_s,
        tracker.jitter_s,
        format!("{:?}", tracker.stamps),
        tracker.lost,
        mean(&|run| run[1].error),
    );
}
