//! Null distributions that a user gives: values of a statistic where nothing depends on anything, by the number of samples.
//!
//! Example: an own simulation of GPDC's values for 298 samples, of which 10 of 500 are above 0.21: a test of 298 samples with the
//! value 0.21 has the p-value 0.02.

use std::collections::BTreeMap;

use crate::types::{Error, Result};

/// Sorted values of a statistic under independence, by the number of samples.
///
/// ```
/// use roscausal_discovery::independence_tests::NullDistributions;
///
/// let given = NullDistributions::parse("100,150\n0.1,0.05\n0.2,0.08\n0.15,")?;
/// assert_eq!(given.sizes().collect::<Vec<_>>(), [100, 150]);
/// assert_eq!(given.share_above(100, 0.15), Some(1.0 / 3.0));
/// assert_eq!(given.share_above(120, 0.15), None);
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NullDistributions(BTreeMap<usize, Vec<f64>>);

impl NullDistributions {
    /// Distributions of values in any order, each with its number of samples.
    ///
    /// # Errors
    /// No distribution, one without a value, two of one size, or a value that is not finite.
    pub fn new(given: impl IntoIterator<Item = (usize, Vec<f64>)>) -> Result<Self> {
        let fail = |reason: String| Err(Error::param("null_dist", reason));
        let mut all = BTreeMap::new();
        for (size, mut values) in given {
            if values.is_empty() || values.iter().any(|value| !value.is_finite()) {
                return fail(format!(
                    "the distribution for {size} samples has no value, or one that is not a number"
                ));
            }
            values.sort_unstable_by(f64::total_cmp);
            if all.insert(size, values).is_some() {
                return fail(format!("there are two distributions for {size} samples"));
            }
        }
        if all.is_empty() { fail("there is no distribution".to_owned()) } else { Ok(Self(all)) }
    }

    /// Reads a table separated by commas: the first row has the numbers of samples, each column below the values for one. Columns
    /// may differ in length; the cells that are left over are empty.
    ///
    /// # Errors
    /// Text that is not such a table, and those of [`NullDistributions::new`].
    pub fn parse(text: &str) -> Result<Self> {
        let wrong = |line: usize, cell: &str, what: &str| {
            Error::param("null_dist", format!("line {line}: '{cell}' is not a {what}"))
        };
        let mut lines = text.lines().zip(1..).filter(|(line, _)| !line.trim().is_empty());
        let Some((header, at)) = lines.next() else { return Self::new([]) };
        let size =
            |cell: &str| cell.trim().parse::<usize>().map_err(|_| wrong(at, cell, "number of samples"));
        let sizes = header.split(',').map(size).collect::<Result<Vec<usize>>>()?;
        let mut columns = vec![Vec::new(); sizes.len()];
        for (line, at) in lines {
            for (k, cell) in line.split(',').enumerate().filter(|(_, cell)| !cell.trim().is_empty()) {
                let value = cell.trim().parse().map_err(|_| wrong(at, cell, "number"))?;
                columns
                    .get_mut(k)
                    .ok_or_else(|| wrong(at, cell, "value of a column of the first row"))?
                    .push(value);
            }
        }
        Self::new(sizes.into_iter().zip(columns))
    }

    /// The numbers of samples, ascending.
    pub fn sizes(&self) -> impl Iterator<Item = usize> + '_ {
        self.0.keys().copied()
    }

    /// The share of values above `value` for `n` samples; `None` if there is no distribution for so many.
    pub fn share_above(&self, n: usize, value: f64) -> Option<f64> {
        let values = self.0.get(&n)?;
        let not_above = values.partition_point(|&null| null <= value);
        Some((values.len() - not_above) as f64 / values.len() as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_table_is_one_sentence() {
        for (text, says) in [
            ("", "there is no distribution"),
            ("100", "the distribution for 100 samples has no value"),
            ("100,100\n1,2", "two distributions for 100 samples"),
            ("many\n1", "line 1: 'many' is not a number of samples"),
            ("100\n1,2", "line 2: '2' is not a value of a column"),
            ("100\nx", "line 2: 'x' is not a number"),
            ("100\ninf", "no value, or one that is not a number"),
        ] {
            let error = NullDistributions::parse(text).unwrap_err().to_string();
            assert!(error.contains(says) && error.lines().count() == 1, "{text}: {error}");
        }
    }
}
