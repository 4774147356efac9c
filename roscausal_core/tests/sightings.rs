//! Every sighting counts: what a tracker's rate, jitter and losses do to rows and to what is found in them. The example `sightings`
//! measures the same with 200 seeds.

#![allow(clippy::expect_used, clippy::panic, reason = "a test may panic: that is how it fails")]

#[path = "common/sightings.rs"]
mod world;

use world::{Found, Stamps, Tracker, run};

/// A tracker of 10 Hz and rows of its interval.
const TRACKER: Tracker =
    Tracker { interval_s: 0.1, jitter_s: 0.0, stamps: Stamps::Off, lost: 0.0, dt_s: 0.1 };
const ROWS: usize = 600;
const SEEDS: u64 = 8;

/// How often a link at lag 0 is found, and the mean strength of the true one; of the exact rows, and of those by each rule.
fn measured(tracker: &Tracker) -> [(usize, f64); 5] {
    let runs: Vec<[Found; 5]> = (0..SEEDS).map(|seed| run(tracker, ROWS, seed)).collect();
    // The rows hold what the tracker saw, or are less than a third of a deviation older.
    for [exact, _, _, auto, seen] in &runs {
        assert!(exact.error == 0.0 && auto.error < seen.error + 0.3, "{tracker:?}: {auto:?} {seen:?}");
    }
    [0, 1, 2, 3, 4].map(|which| {
        let strengths = runs.iter().map(|run| run[which].strength);
        (runs.iter().filter(|run| run[which].at_once).count(), strengths.sum::<f64>() / SEEDS as f64)
    })
}

#[test]
fn a_link_is_found_as_in_the_exact_rows_whatever_the_rate_and_the_jitter() {
    for tracker in [
        TRACKER,
        Tracker { jitter_s: 0.005, ..TRACKER },
        Tracker { interval_s: 1.0 / 12.0, ..TRACKER },
        Tracker { interval_s: 0.2, dt_s: 0.2, jitter_s: 0.02, ..TRACKER },
        Tracker { interval_s: 0.02, jitter_s: 0.02, stamps: Stamps::True, lost: 0.1, ..TRACKER },
        Tracker { interval_s: 0.1, dt_s: 0.5, jitter_s: 0.02, lost: 0.1, ..TRACKER },
    ] {
        let [(exact, right), _, _, (false_now, strength), _] = measured(&tracker);
        assert!(false_now <= exact + 1, "{tracker:?}: {false_now} links at lag 0, {exact} in the exact rows");
        assert!((strength - right).abs() < 0.05, "{tracker:?}: {strength:.3} for {right:.3}");
    }
}

#[test]
fn what_is_held_makes_no_link_at_once_but_weakens_one_where_it_is_as_old_as_a_row() {
    for (tracker, holds) in [
        (Tracker { interval_s: 0.02, jitter_s: 0.02, stamps: Stamps::True, lost: 0.1, ..TRACKER }, true),
        (Tracker { jitter_s: 0.02, stamps: Stamps::True, ..TRACKER }, false),
    ] {
        let [(exact, right), _, (false_now, strength), ..] = measured(&tracker);
        assert!(false_now <= exact + 1, "{tracker:?}: {false_now} links at lag 0, {exact} in the exact rows");
        assert_eq!((strength - right).abs() < 0.05, holds, "{tracker:?}: {strength:.3} for {right:.3}");
    }
}
