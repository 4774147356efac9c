//! How often changes of mechanisms are told, and told where there is none: the tables of docs/confidence.md.
//!
//! `cargo run --release --example changes -- STREAMS [FIRST_SEED]` reads STREAMS random streams of each kind (4 variables, lags to 2, 3000
//! rows in parts of 200; what changes, changes at row 1500) and prints confirmed events where nothing changed, for 1000 rows; the share of
//! changes that were told, with cause and effect; and of all that was told after a change, the share that names one that is there.

use std::{env, f64::consts::TAU};

use ndarray::Array2;
use rayon::prelude::*;
use roscausal_discovery::{
    Control, Result,
    changes::{ChangeEvent, Detector, Levels, Status},
    mix,
};

const VARS: usize = 4;
const ROWS: usize = 3000;
const CHANGE: usize = 1500;
const PART: usize = 200;

struct Draw(u64);

impl Draw {
    fn uniform(&mut self) -> f64 {
        self.0 += 1;
        (mix(self.0) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn below(&mut self, n: usize) -> usize {
        (self.uniform() * n as f64) as usize
    }

    fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.uniform()).ln()).sqrt() * (TAU * self.uniform()).cos()
    }
}

/// Cause, effect, lag, coefficient before and after the change.
type Link = (usize, usize, usize, [f64; 2]);

struct Kind {
    name: &'static str,
    /// What changes, of the links there are; `None`: nothing.
    change: Option<fn(&mut Vec<Link>, &mut Draw)>,
    /// What else drives the variables.
    other: fn(row: usize, var: usize, causes: &[f64]) -> f64,
}

fn free(links: &[Link], draw: &mut Draw, effect: Option<usize>) -> (usize, usize) {
    loop {
        let (i, j) = (draw.below(VARS), effect.unwrap_or_else(|| draw.below(VARS)));
        if i != j && links.iter().all(|&(a, b, ..)| (a, b) != (i, j)) {
            return (i, j);
        }
    }
}

fn appear(links: &mut Vec<Link>, draw: &mut Draw) {
    let (i, j) = free(links, draw, None);
    links.push((i, j, 1 + draw.below(2), [0.0, 0.4]));
}

#[allow(clippy::ptr_arg, reason = "all changes have one type")]
fn vanish(links: &mut Vec<Link>, draw: &mut Draw) {
    let which = draw.below(links.len());
    links[which].3[1] = 0.0;
}

#[allow(clippy::ptr_arg, reason = "all changes have one type")]
fn halve(links: &mut Vec<Link>, draw: &mut Draw) {
    let which = draw.below(links.len());
    links[which].3 = [0.5, 0.25];
}

/// Another cause takes the place of one.
fn two(links: &mut Vec<Link>, draw: &mut Draw) {
    let which = draw.below(links.len());
    links[which].3[1] = 0.0;
    // An effect of all others has room for no other cause.
    let effect = links[which].1;
    let has_room = links.iter().filter(|link| link.1 == effect).count() < VARS - 1;
    let (i, j) = free(links, draw, has_room.then_some(effect));
    links.push((i, j, 1 + draw.below(2), [0.0, 0.4]));
}

/// A link comes to the other lag.
fn moved(links: &mut Vec<Link>, draw: &mut Draw) {
    let (cause, effect, lag, [before, _]) = links[draw.below(links.len())];
    links.iter_mut().filter(|link| (link.0, link.1) == (cause, effect)).for_each(|link| link.3[1] = 0.0);
    links.push((cause, effect, 3 - lag, [0.0, before]));
}

fn nothing(_: usize, _: usize, _: &[f64]) -> f64 {
    0.0
}

const KINDS: [Kind; 9] = [
    Kind { name: "plain", change: None, other: nothing },
    Kind {
        name: "U-shaped",
        change: None,
        other: |_, var, causes| if var == 0 { 0.3 * (causes[1] * causes[1] - 1.0) } else { 0.0 },
    },
    Kind { name: "season", change: None, other: |row, _, _| (TAU * row as f64 / 200.0).sin() },
    Kind { name: "drift", change: None, other: |row, _, _| row as f64 / 1500.0 },
    Kind { name: "appears", change: Some(appear), other: nothing },
    Kind { name: "vanishes", change: Some(vanish), other: nothing },
    Kind { name: "halves", change: Some(halve), other: nothing },
    Kind { name: "two on one effect", change: Some(two), other: nothing },
    Kind { name: "comes to another lag", change: Some(moved), other: nothing },
];

#[derive(Default)]
struct Found {
    false_events: usize,
    changes: usize,
    reported: usize,
    all_told: usize,
    events: usize,
    right: usize,
}

fn run(kind: &Kind, seed: u64) -> Result<Found> {
    let mut draw = Draw(mix(seed));
    let mut links: Vec<Link> = Vec::new();
    for _ in 0..3 {
        let (i, j) = free(&links, &mut draw, None);
        let sign = if draw.uniform() < 0.5 { -1.0 } else { 1.0 };
        links.push((i, j, 1 + draw.below(2), [0.4 * sign; 2]));
    }
    if let Some(change) = kind.change {
        change(&mut links, &mut draw);
    }
    let past: Vec<f64> = (0..VARS).map(|_| 0.2 + 0.4 * draw.uniform()).collect();
    let mut rows = Array2::zeros((ROWS, VARS));
    for row in 2..ROWS {
        for var in 0..VARS {
            let of_links = links.iter().filter(|link| link.1 == var);
            let driven: f64 =
                of_links.map(|&(i, _, lag, of)| of[usize::from(row >= CHANGE)] * rows[[row - lag, i]]).sum();
            let causes = rows.row(row - 1).to_vec();
            rows[[row, var]] =
                past[var] * causes[var] + driven + (kind.other)(row, var, &causes) + draw.normal();
        }
    }
    let names = (0..VARS).map(|var| format!("v{var}")).collect();
    let mut detector = Detector::new(names, 2, &[], Levels::default())?;
    let events = detector.read_in_parts(rows.view(), &[], PART, &Control::default())?;
    let confirmed: Vec<_> = events.iter().filter(|event| event.status == Status::Confirmed).collect();
    let changed: Vec<&Link> = links.iter().filter(|link| link.3[0] != link.3[1]).collect();
    // Of a link that comes to another lag both lags are to be told.
    let lags_count = changed.len() == 2 && (changed[0].0, changed[0].1) == (changed[1].0, changed[1].1);
    let is_it = |link: &Link, event: &ChangeEvent| {
        let pair = event.cause == format!("v{}", link.0) && event.effect == format!("v{}", link.1);
        pair && (!lags_count || event.lag == link.2)
    };
    let is_early = |time: usize| time <= CHANGE || changed.is_empty();
    let late: Vec<_> = confirmed.iter().filter(|event| !is_early(event.time)).collect();
    let reported = changed.iter().filter(|link| late.iter().any(|event| is_it(link, event))).count();
    Ok(Found {
        false_events: confirmed.len() - late.len(),
        changes: changed.len(),
        reported,
        all_told: usize::from(reported == changed.len()),
        events: late.len(),
        right: late.iter().filter(|event| changed.iter().any(|link| is_it(link, event))).count(),
    })
}

fn main() -> Result<()> {
    let mut numbers = env::args().skip(1).filter_map(|text| text.parse::<u64>().ok());
    let (count, first) = (numbers.next().unwrap_or(100), numbers.next().unwrap_or(1));
    println!("| kind | false for 1000 rows | told | all of a stream's | right |\n|---|---|---|---|---|");
    for (k, kind) in KINDS.iter().enumerate() {
        let seeds: Vec<u64> = (0..count).map(|i| 1_000_003 * (first + i) + k as u64).collect();
        let found: Vec<Found> = seeds.into_par_iter().map(|seed| run(kind, seed)).collect::<Result<_>>()?;
        let sum = |of: fn(&Found) -> usize| found.iter().map(of).sum::<usize>() as f64;
        let quiet = if kind.change.is_some() { CHANGE } else { ROWS } as f64 * count as f64 / 1000.0;
        let share = |a: f64, b: f64| if b > 0.0 { format!("{:.0} %", 100.0 * a / b) } else { "-".to_owned() };
        println!(
            "| {} | {:.3} | {} | {} | {} |",
            kind.name,
            sum(|f| f.false_events) / quiet,
            share(sum(|f| f.reported), sum(|f| f.changes)),
            if kind.change.is_some() { share(sum(|f| f.all_told), count as f64) } else { "-".to_owned() },
            share(sum(|f| f.right), sum(|f| f.events)),
        );
    }
    Ok(())
}
