//! How often an independence test finds dependence where there is none: the tables of docs/methods.md.
//!
//! `cargo run --release --example levels -- TEST COUNT [SAMPLES...]` prints a row for each kind of data: for each number of samples the share
//! of COUNT tests of independent series with p at most 0.05 and 0.01. COUNT 10,000 tells 0.05 to 0.0022 (one standard error). The environment
//! may have KIND (only kinds with this text), SEED (0), LEVELS (`0.05,0.01,0.001`) and AS_TIGRAMITE. Every draw has its own seed, so the same
//! call prints the same numbers.

use std::f64::consts::TAU;

use ndarray::Array2;
use rayon::prelude::*;
use roscausal_discovery::{
    DataFrame, Node, Result, Samples,
    independence_tests::{TestSettings, by_name},
    mix,
};

/// Steps before the first sample of a series with a past.
const BEFORE: usize = 50;

/// Random numbers of one draw.
pub(crate) struct Draw(u64);

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

/// What the columns of a kind are.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Of {
    Numbers,
    /// Pairs of columns are vectors.
    Vectors,
    Categories,
    Both,
}

/// Columns of independent X and Y (0 and 1), then conditions, and the nodes to test.
pub(crate) struct Kind {
    pub(crate) name: &'static str,
    pub(crate) of: Of,
    columns: fn(&mut Draw, usize) -> Array2<f64>,
    test: fn() -> (Node, Node, Vec<Node>),
}

impl Kind {
    /// Whether `test` is for such data.
    pub(crate) fn is_for(&self, test: &str) -> bool {
        match self.of {
            Of::Numbers => !["gsquared", "cmisymb"].contains(&test),
            Of::Vectors => test == "parcorrmult",
            Of::Categories => ["gsquared", "cmisymb", "regressionci", "parcorr"].contains(&test),
            Of::Both => test == "regressionci",
        }
    }
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

pub(crate) const KINDS: &[Kind] = &[
    Kind { name: "white", of: Of::Numbers, columns: |d, n| each(n, 2, || d.normal()), test: || now(0) },
    Kind {
        name: "a fifth tied",
        of: Of::Numbers,
        columns: |d, n| each(n, 2, || (d.uniform() * 2.2 * n as f64).floor()),
        test: || now(0),
    },
    Kind {
        name: "half at one value",
        of: Of::Numbers,
        columns: |d, n| each(n, 2, || d.normal().max(0.0)),
        test: || now(0),
    },
    Kind {
        name: "heavy tails",
        of: Of::Numbers,
        columns: |d, n| each(n, 2, || d.normal() / d.uniform().sqrt()),
        test: || now(0),
    },
    Kind {
        name: "millimetres, mean 20",
        of: Of::Numbers,
        columns: |d, n| driven(d, n, 1, |z| z).mapv(|v| 1000.0 * (v + 20.0)),
        test: || now(1),
    },
    Kind {
        name: "one linear condition",
        of: Of::Numbers,
        columns: |d, n| driven(d, n, 1, |z| z),
        test: || now(1),
    },
    Kind {
        name: "three linear conditions",
        of: Of::Numbers,
        columns: |d, n| driven(d, n, 3, |z| z),
        test: || now(3),
    },
    Kind {
        name: "past of both (MCI)",
        of: Of::Numbers,
        columns: with_past,
        test: || (Node::new(0, 1), Node::new(1, 0), vec![Node::new(1, 1), Node::new(0, 2)]),
    },
    Kind {
        name: "vectors of two, one condition",
        of: Of::Vectors,
        columns: |d, n| {
            // Both components of X and of Y follow the condition's, and each other.
            let mut table = each(n, 6, || d.normal());
            for mut row in table.rows_mut() {
                for first in [0, 2] {
                    row[first] += row[4];
                    row[first + 1] += row[5] + 0.5 * row[first];
                }
            }
            table
        },
        test: || now(1),
    },
    Kind {
        name: "3 categories",
        of: Of::Categories,
        columns: |d, n| each(n, 2, || d.category(3)),
        test: || now(0),
    },
    Kind {
        name: "3 categories given 3",
        of: Of::Categories,
        columns: |d, n| each(n, 3, || d.category(3)),
        test: || now(1),
    },
    Kind {
        name: "5 categories",
        of: Of::Categories,
        columns: |d, n| each(n, 2, || d.category(5)),
        test: || now(0),
    },
    Kind {
        name: "5 categories given 5",
        of: Of::Categories,
        columns: |d, n| each(n, 3, || d.category(5)),
        test: || now(1),
    },
    Kind {
        name: "3 categories and a number, given a number",
        of: Of::Both,
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
        of: Of::Both,
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

impl Kind {
    /// The draw `k` of `n` samples.
    pub(crate) fn data(&self, n: usize, seed: u64, k: u64) -> Result<DataFrame> {
        let columns = (self.columns)(&mut Draw(mix(mix(n as u64 ^ seed << 32) ^ k)), n);
        let names = (0..columns.ncols()).map(|k| k.to_string()).collect();
        let pairs = (0..columns.ncols() / 2).map(|k| (format!("pair {k}"), vec![2 * k, 2 * k + 1]));
        let data = DataFrame::new(vec![columns], names)?;
        if self.of == Of::Vectors { data.with_vectors(&pairs.collect::<Vec<_>>()) } else { Ok(data) }
    }
}

/// The p-values of `count` tests.
pub(crate) fn p_values(
    kind: &Kind,
    test: &str,
    settings: &TestSettings,
    n: usize,
    count: u64,
    seed: u64,
) -> Result<Vec<f64>> {
    let test = by_name(test, settings)?;
    let (x, y, z) = (kind.test)();
    let one = |k: u64| -> Result<f64> {
        let data = kind.data(n, seed, k)?;
        let samples = Samples::new(&data, z.iter().map(|node| node.lag).max().unwrap_or(0));
        Ok(test.prepare(&samples)?.run_test(x, y, &z)?.p_value)
    };
    (0..count).into_par_iter().map(one).collect()
}

#[allow(dead_code, reason = "a test shares this file")]
fn main() -> std::result::Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [test, count, sizes @ ..] = &args[..] else { return Err("levels TEST COUNT [SAMPLES...]".into()) };
    let count: u64 = count.parse()?;
    let sizes: Vec<usize> = match sizes {
        [] => vec![50, 100, 200, 500],
        sizes => sizes.iter().map(|n| n.parse()).collect::<std::result::Result<_, _>>()?,
    };
    let given = |name: &str, usual: &str| std::env::var(name).unwrap_or_else(|_| usual.to_owned());
    let (wanted, seed): (String, u64) = (given("KIND", ""), given("SEED", "0").parse()?);
    let levels: Vec<f64> =
        given("LEVELS", "0.05,0.01").split(',').map(str::parse).collect::<std::result::Result<_, _>>()?;
    let settings =
        TestSettings { as_tigramite: std::env::var_os("AS_TIGRAMITE").is_some(), ..TestSettings::default() };
    for kind in KINDS.iter().filter(|kind| kind.is_for(test) && kind.name.contains(&wanted)) {
        let mut row = format!("| {test} | {} |", kind.name);
        for &n in &sizes {
            let p = p_values(kind, test, &settings, n, count, seed)?;
            let share = |level| p.iter().filter(|p| **p <= level).count() as f64 / count as f64;
            let shares: Vec<String> = levels.iter().map(|&level| format!("{:.4}", share(level))).collect();
            row += &format!(" {} |", shares.join(" "));
        }
        println!("{row}");
    }
    Ok(())
}
