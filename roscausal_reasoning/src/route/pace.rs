//! How long a robot takes for a metre among people, and what a second costs its battery, by what it recorded of itself.

use roscausal_discovery::{Error, Result};

use crate::linear::least_squares;

/// The most seconds that a metre may take.
const SLOWEST: f64 = 10_000.0;
/// Fewest rows of a driving robot.
const FEWEST: usize = 30;

/// Seconds for a metre: `free + each x people`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pace {
    /// Seconds for a metre where nobody is.
    pub free: f64,
    /// Seconds more for each person at the place.
    pub each: f64,
}

impl Pace {
    /// From rows in which the robot was driving: people at its place a row before, and its speed in m/s.
    ///
    /// The time for a metre is one over the mean speed over time, so `1 = E[v (free + each n)]` whatever `n` is: two moment conditions,
    /// with the weights 1 and `n`. A regression of `1 / v` would be infinite where the robot stands.
    ///
    /// # Errors
    /// Fewer than 30 rows, or a robot that did not drive.
    pub fn fit(rows: &[(f64, f64)]) -> Result<Self> {
        let n = rows.len();
        Error::ensure_data(n >= FEWEST, || {
            format!("{n} rows of a driving robot are too few to tell its pace; record {FEWEST} or more")
        })?;
        let sum = |of: fn(f64, f64) -> f64| rows.iter().map(|&(n, v)| of(n, v)).sum::<f64>();
        let (v, vn, vnn) = (sum(|_, v| v), sum(|n, v| n * v), sum(|n, v| n * n * v));
        let (one, people) = (rows.len() as f64, sum(|n, _| n));
        if v <= 0.0 {
            return Err(Error::Data("the robot did not move in any row".into()));
        }
        let determinant = v * vnn - vn * vn;
        let each =
            if determinant > 1e-9 * v * vnn { ((v * people - vn * one) / determinant).max(0.0) } else { 0.0 };
        let pace = Self { free: (one - each * vn) / v, each };
        Error::ensure_data(pace.free > 0.0 && pace.free <= SLOWEST && pace.each <= SLOWEST, || {
            format!("no pace of a robot: {} s for a metre where nobody is", pace.free)
        })?;
        Ok(pace)
    }
}

/// What the battery loses: `second` for each second and `metre` for each metre.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Drain {
    /// For each second.
    pub second: f64,
    /// For each metre.
    pub metre: f64,
}

impl Drain {
    /// From rows of the same kind (loaded or not): speed in m/s, and what the battery lost in a second. Without rows it is nothing.
    pub fn fit(rows: &[(f64, f64)]) -> Self {
        let (speed, loss): (Vec<f64>, Vec<f64>) = rows.iter().copied().unzip();
        let fit = least_squares(&loss, &[speed]);
        // Nothing charges by driving.
        Self { second: fit.intercept.max(0.0), metre: fit.coefficients[0].max(0.0) }
    }
}
