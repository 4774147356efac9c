//! How often an independence test finds dependence where there is none: the tables of docs/methods.md.
//!
//! `cargo run --release --example levels -- TEST COUNT [SAMPLES...]` prints, for each kind of data and each number of samples, the share of
//! COUNT tests of independent series with p at most 0.05, 0.01 and 0.001. COUNT 10,000 tells 0.05 to 0.0022 (one standard error), 200,000
//! tells 0.001 to 0.00007. Every draw has its own seed, so the same call prints the same numbers.

use std::f64::consts::TAU;

use ndarray::Array2;
use rayon::prelude::*;
use roscausal_discovery::{
    DataFrame, Node, Result, Samples,
    independence_tests::{TestSettings, by_name},
    mix,
};

const LEVELS: [f64; 3] = [0.05, 0.01, 0.001];
/// Steps before the first sample of a series with a past.
const BEFORE: usize = 50;

/// Random numbers of one draw.
struct Draw(u64);

impl Draw {
    fn uniform(&mut self) -> f64 {
        self.0 += 1;
        (mix(self.0) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.uniform()).ln()).sqrt() * (TAU * self.uniform()).cos()
    }

    fn category(&mut self, values: usize) -> f64 {
        (self.uniform() * values as f64).floor()
    }
}

/// Columns of independent X and Y (0 and 1), then conditions, and the nodes to test.
struct Kind {
    name: &'static str,
    categories: bool,
    columns: fn(&mut Draw, usize) -> Array2<f64>,
    test: fn() -> (Node, Node, Vec<Node>),
}

fn now(conditions: usize) -> (Node, Node, Vec<Node>) {
    (Node::new(0, 0), Node::new(1, 0), (2..2 + conditions).map(|var| Node::new(var, 0)).collect())
}

fn each(n: usize, vars: usize, mut value: impl FnMut() -> f64) -> Array2<f64> {
    Array2::from_shape_simple_fn((n, vars), &mut value)
}

/// X and Y follow the conditions, as strongly as their own noise.
fn driven(draw: &mut Draw, n: usize, conditions: usize, effect: fn(f64) -> f64) -> Array2<f64> {
    let mut table = each(n, 2 + conditions, || draw.normal());
    let share = 1.0 / (conditions as f64).sqrt();
    for mut row in table.rows_mut() {
        for k in 2..2 + conditions {
            row[0] += share * effect(row[k]);
            row[1] += share * effect(row[k]);
        }
    }
    table
}

/// X and Y keep a share of their last value.
fn with_past(draw: &mut Draw, n: usize) -> Array2<f64> {
    let mut table = each(n + BEFORE, 2, || draw.normal());
    for t in 1..n + BEFORE {
        table[[t, 0]] += 0.8 * table[[t - 1, 0]];
        table[[t, 1]] += 0.8 * table[[t - 1, 1]];
    }
    table.slice_move(ndarray::s![BEFORE.., ..])
}

const KINDS: &[Kind] = &[
    Kind { name: "white", categories: false, columns: |d, n| each(n, 2, || d.normal()), test: || now(0) },
    Kind {
        name: "a fifth tied",
        categories: false,
        columns: |d, n| each(n, 2, || (d.uniform() * 2.2 * n as f64).floor()),
        test: || now(0),
    },
    Kind {
        name: "half at one value",
        categories: false,
        columns: |d, n| each(n, 2, || d.normal().max(0.0)),
        test: || now(0),
    },
    Kind {
        name: "heavy tails",
        categories: false,
        columns: |d, n| each(n, 2, || d.normal() / d.uniform().sqrt()),
        test: || now(0),
    },
    Kind {
        name: "millimetres, mean 20",
        categories: false,
        columns: |d, n| driven(d, n, 1, |z| z).mapv(|v| 1000.0 * (v + 20.0)),
        test: || now(1),
    },
    Kind {
        name: "one linear condition",
        categories: false,
        columns: |d, n| driven(d, n, 1, |z| z),
        test: || now(1),
    },
    Kind {
        name: "three linear conditions",
        categories: false,
        columns: |d, n| driven(d, n, 3, |z| z),
        test: || now(3),
    },
    Kind {
        name: "past of both (MCI)",
        categories: false,
        columns: with_past,
        test: || (Node::new(0, 1), Node::new(1, 0), vec![Node::new(1, 1), Node::new(0, 2)]),
    },
    Kind {
        name: "3 categories",
        categories: true,
        columns: |d, n| each(n, 2, || d.category(3)),
        test: || now(0),
    },
    Kind {
        name: "3 categories given 3",
        categories: true,
        columns: |d, n| each(n, 3, || d.category(3)),
        test: || now(1),
    },
    Kind {
        name: "5 categories",
        categories: true,
        columns: |d, n| each(n, 2, || d.category(5)),
        test: || now(0),
    },
    Kind {
        name: "5 categories given 5",
        categories: true,
        columns: |d, n| each(n, 3, || d.category(5)),
        test: || now(1),
    },
    Kind {
        name: "3 categories and a number, given a number",
        categories: true,
        columns: |d, n| {
            let mut table = each(n, 3, || d.normal());
            for mut row in table.rows_mut() {
                row[0] = (row[2] + 0.5 * row[0]).round().clamp(-1.0, 1.0);
                row[1] += row[2];
            }
            table
        },
        test: || now(1),
    },
    Kind {
        name: "3 categories, given a number",
        categories: true,
        columns: |d, n| {
            let mut table = each(n, 3, || d.normal());
            for mut row in table.rows_mut() {
                row[0] = (row[2] + row[0]).round().clamp(-1.0, 1.0);
                row[1] = (row[2] + row[1]).round().clamp(-1.0, 1.0);
                row[2] *= 1e-3;
            }
            table
        },
        test: || now(1),
    },
];

/// How many of `count` tests have a p-value of at most each level.
fn rejected(kind: &Kind, test: &str, settings: &TestSettings, n: usize, count: u64) -> Result<[usize; 3]> {
    let test = by_name(test, settings)?;
    let one = |k: u64| -> Result<f64> {
        let mut draw = Draw(mix(mix(n as u64) ^ k));
        let columns = (kind.columns)(&mut draw, n);
        let names = (0..columns.ncols()).map(|k| k.to_string()).collect();
        let data = DataFrame::new(vec![columns], names)?;
        let (x, y, z) = (kind.test)();
        let samples = Samples::new(&data, z.iter().map(|node| node.lag).max().unwrap_or(0));
        Ok(test.prepare(&samples)?.run_test(x, y, &z)?.p_value)
    };
    let p_values = (0..count).into_par_iter().map(one).collect::<Result<Vec<f64>>>()?;
    Ok(LEVELS.map(|level| p_values.iter().filter(|p| **p <= level).count()))
}

fn main() -> std::result::Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [test, count, sizes @ ..] = &args[..] else { return Err("levels TEST COUNT [SAMPLES...]".into()) };
    let count: u64 = count.parse()?;
    let sizes: Vec<usize> = match sizes {
        [] => vec![50, 100, 200, 500],
        sizes => sizes.iter().map(|n| n.parse()).collect::<std::result::Result<_, _>>()?,
    };
    let wanted = std::env::var("KIND").unwrap_or_default();
    let of_categories = ["gsquared", "cmisymb"].contains(&test.as_str());
    let of_both = test == "regressionci";
    let settings =
        TestSettings { as_tigramite: std::env::var_os("AS_TIGRAMITE").is_some(), ..TestSettings::default() };
    let kinds = KINDS.iter().filter(|kind| of_both || kind.categories == of_categories);
    for kind in kinds.filter(|kind| kind.name.contains(&wanted)) {
        for &n in &sizes {
            let shares = rejected(kind, test, &settings, n, count)?.map(|k| k as f64 / count as f64);
            println!(
                "| {test} | {} | {n} | {:.4} | {:.4} | {:.5} |",
                kind.name, shares[0], shares[1], shares[2]
            );
        }
    }
    Ok(())
}
