//! Numbers of a scenario, and the ranges in which they may lie.

use roscausal_core::{Error, Result};

/// Refuses a number of the field `name` outside of a range.
pub(crate) fn number(name: &str, value: f64, low: f64, high: f64) -> Result<()> {
    Error::ensure((low..=high).contains(&value), name, || {
        format!("{value} is not allowed; use a number from {low} to {high}")
    })
}

/// The same for several fields below `at`: name, value, and both ends of the range.
pub(crate) fn numbers(at: &str, fields: &[(&str, f64, f64, f64)]) -> Result<()> {
    fields.iter().try_for_each(|&(name, value, low, high)| number(&format!("{at}.{name}"), value, low, high))
}
