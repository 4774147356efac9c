//! The data check: what is in each column.

use serde::{Deserialize, Serialize};

use crate::types::DataFrame;

/// What is in one column, over all recordings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct VariableFacts {
    /// Its name.
    pub name: String,
    /// Values.
    pub present: usize,
    /// Missing values.
    pub missing: usize,
    /// Smallest value; null without any.
    pub min: Option<f64>,
    /// Largest value.
    pub max: Option<f64>,
    /// Mean.
    pub mean: Option<f64>,
    /// Standard deviation.
    pub sd: Option<f64>,
    /// Correlation of neighbouring samples; near 1 the samples say nearly the same.
    pub autocorrelation: Option<f64>,
}

pub(super) fn facts(data: &DataFrame) -> Vec<VariableFacts> {
    data.var_names().iter().enumerate().map(|(var, name)| of(data, var, name)).collect()
}

fn of(data: &DataFrame, var: usize, name: &str) -> VariableFacts {
    let columns = || data.recordings().iter().map(|recording| recording.column(var));
    let values: Vec<f64> = columns().flatten().copied().filter(|v| v.is_finite()).collect();
    let n = values.len() as f64;
    let known = |value: f64| (value.is_finite() && !values.is_empty()).then_some(value);
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n;
    let (mut product, mut pairs) = (0.0, 0);
    for column in columns() {
        for (a, b) in column.iter().zip(column.iter().skip(1)) {
            if a.is_finite() && b.is_finite() {
                product += (a - mean) * (b - mean);
                pairs += 1;
            }
        }
    }
    VariableFacts {
        name: name.to_owned(),
        present: values.len(),
        missing: columns().map(|column| column.len()).sum::<usize>() - values.len(),
        min: known(values.iter().copied().fold(f64::INFINITY, f64::min)),
        max: known(values.iter().copied().fold(f64::NEG_INFINITY, f64::max)),
        mean: known(mean),
        sd: known(variance.sqrt()),
        autocorrelation: known(product / f64::from(pairs) / variance),
    }
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;

    #[test]
    fn a_column_is_counted_and_measured_and_an_empty_one_too() {
        let rows = array![[1.0, f64::NAN], [2.0, f64::NAN], [f64::NAN, f64::NAN], [3.0, f64::NAN]];
        let data = DataFrame::new(vec![rows], vec!["a".into(), "b".into()]).unwrap();
        let [a, b] = &facts(&data)[..] else { panic!("two columns") };
        assert_eq!((a.present, a.missing, a.min, a.max, a.mean), (3, 1, Some(1.0), Some(3.0), Some(2.0)));
        assert_eq!((b.present, b.missing, b.min, b.autocorrelation), (0, 4, None, None));
    }
}
