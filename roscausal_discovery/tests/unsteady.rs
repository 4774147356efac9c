//! The look at dependence that changes within a recording: systems in which nothing changes are told to be steady, whatever their form,
//! and a dependence that turns is found where it turns.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use std::f64::consts::TAU;

use ndarray::Array2;
use roscausal_discovery::{DataFrame, Unsteady, mix};

struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 = mix(self.0);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.uniform()).ln()).sqrt() * (TAU * self.uniform()).cos()
    }
}

/// What a value `x` does to another.
const FORMS: [fn(f64) -> f64; 4] =
    [|x| 0.6 * x, |x| 0.4 * x * x, |x| (2.0 * x).tanh(), |x| (x - 1.0).max(0.0)];

/// Three to six variables in a chain; from row `turn` on, the first effect has the other sign. Every third system is noisy in bursts.
fn system(seed: u64, turn: Option<f64>) -> (DataFrame, usize) {
    let mut random = Random(mix(seed));
    let n = 3 + (4.0 * random.uniform()) as usize;
    let rows = 300 + (900.0 * random.uniform()) as usize;
    let row = turn.map_or(rows, |share| (share * rows as f64) as usize);
    let own: Vec<f64> = (0..n).map(|_| 0.1 + 0.8 * random.uniform()).collect();
    let form = FORMS[if turn.is_some() { 0 } else { (seed % 4) as usize }];
    let mut values = Array2::<f64>::zeros((rows, n));
    for t in 1..rows {
        let loud = if seed.is_multiple_of(3) && t % 60 < 15 { 3.0 } else { 1.0 };
        for var in 0..n {
            let driven = if var == 0 { 0.0 } else { form(values[[t - 1, var - 1]]) };
            let sign = if var == 1 && t >= row { -1.0 } else { 1.0 };
            values[[t, var]] = own[var] * values[[t - 1, var]] + sign * driven + loud * random.normal();
        }
    }
    let names = (0..n).map(|var| format!("v{var}")).collect();
    (DataFrame::new(vec![values], names).unwrap(), row)
}

#[test]
fn what_does_not_change_is_not_said_to() {
    let said: Vec<_> = (0..200)
        .map(|seed| Unsteady::of(&system(seed, None).0, 3))
        .filter(|found| !found.is_empty())
        .collect();
    assert!(said.len() <= 3, "{} of 200: {said:?}", said.len());
}

#[test]
fn a_dependence_that_turns_is_found_where_it_turns() {
    let mut found = 0;
    for seed in 0..100 {
        let (data, row) = system(1000 + seed, Some(0.3 + 0.004 * seed as f64));
        let first = Unsteady::of(&data, 3).into_iter().next();
        let is_right = |one: &Unsteady| {
            (one.cause.as_str(), one.effect.as_str(), one.lag) == ("v0", "v1", 1)
                && one.row.abs_diff(row) <= one.rows / 10
        };
        found += usize::from(first.as_ref().is_some_and(is_right));
    }
    assert!(found >= 90, "{found} of 100");
}

#[test]
fn values_that_are_missing_in_one_part_are_no_change() {
    for seed in 0..50 {
        let (data, _) = system(2000 + 4 * seed, None);
        let mut values = data.recordings()[0].clone();
        let half = values.nrows() / 2;
        values.slice_mut(ndarray::s![half.., 0]).fill(f64::NAN);
        let names = (0..values.ncols()).map(|var| format!("v{var}")).collect();
        let found = Unsteady::of(&DataFrame::new(vec![values], names).unwrap(), 2);
        assert!(found.is_empty(), "{seed}: {found:?}");
    }
}

#[test]
fn few_rows_constants_and_pooled_recordings_are_left_alone() {
    let two = |values: Array2<f64>| DataFrame::new(vec![values], vec!["a".into(), "b".into()]).unwrap();
    assert!(Unsteady::of(&two(Array2::from_shape_fn((50, 2), |(t, _)| t as f64)), 2).is_empty());
    assert!(Unsteady::of(&two(Array2::zeros((500, 2))), 2).is_empty());
    assert!(Unsteady::of(&two(Array2::from_elem((500, 2), f64::NAN)), 2).is_empty());
    let part = system(1000, Some(0.5)).0.recordings()[0].clone();
    let names = (0..part.ncols()).map(|var| format!("v{var}")).collect();
    assert!(Unsteady::of(&DataFrame::new(vec![part.clone(), part], names).unwrap(), 2).is_empty());
}
