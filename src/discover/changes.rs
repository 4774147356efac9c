//! `--difference`, `--detrend`, `--season`, `--standardise`: what is done to the values before the analysis, in this order, to each recording by
//! itself. Missing values stay missing.

use clap::Args as ClapArgs;
use ndarray::{Array2, ArrayViewMut1};
use roscausal_core::{Error, Result, batch::table::Unit};
use roscausal_discovery::{
    names::{instead, plain, position},
    unit_factor, without_season,
};

use super::Data;

/// The word for all variables.
const ALL: &str = "all";

/// Flags that change the values.
#[derive(ClapArgs, Clone, Debug, Default)]
#[command(next_help_heading = "Data")]
pub(crate) struct ChangeArgs {
    /// Analyse the change since the row before instead of the value: of all variables, or of those named (`--difference=a,b`).
    #[arg(long, value_name = "COLUMNS", num_args = 0..=1, require_equals = true, default_missing_value = ALL, value_delimiter = ',')]
    difference: Vec<String>,
    /// Take out the straight line that fits each recording best: of all variables, or of those named.
    #[arg(long, value_name = "COLUMNS", num_args = 0..=1, require_equals = true, default_missing_value = ALL, value_delimiter = ',')]
    detrend: Vec<String>,
    /// Take the mean course of a period out of each recording, of all variables: rows, or a time such as 24h.
    #[arg(long, value_name = "PERIOD")]
    season: Option<String>,
    /// Bring each recording to mean 0 and standard deviation 1, so that recordings of other sizes are alike: all variables, or
    /// those named.
    #[arg(
        long, alias = "standardize", value_name = "COLUMNS", num_args = 0..=1, require_equals = true, default_missing_value = ALL,
        value_delimiter = ','
    )]
    standardise: Vec<String>,
}

/// What changes one column of one recording.
type Change<'a> = &'a dyn Fn(ArrayViewMut1<'_, f64>);

impl ChangeArgs {
    /// Changes the values as the flags say, and tells so.
    ///
    /// # Errors
    /// A column that is not there.
    pub(super) fn apply(&self, data: &mut Data) -> Result<()> {
        let all = [ALL.to_owned()];
        let shortest = data.data.recordings().iter().map(|rows| rows.nrows()).min().unwrap_or(0);
        let period = self.season.as_ref().map(|text| rows_of(text, data.dt, shortest)).transpose()?;
        let seasonal: &[String] = if period.is_some() { &all } else { &[] };
        let season = |column: ArrayViewMut1<'_, f64>| without_season(column, period.unwrap_or(1));
        let steps: [(&str, &[String], Change<'_>, &str); 4] = [
            ("difference", &self.difference, &difference, "the change since the row before is analysed of"),
            ("detrend", &self.detrend, &detrend, "a straight line is taken out of each recording of"),
            ("season", seasonal, &season, "the mean course of a period is taken out of each recording of"),
            (
                "standardise",
                &self.standardise,
                &standardise,
                "each recording has mean 0 and standard deviation 1 of",
            ),
        ];
        for (flag, wanted, change, reported) in steps {
            let columns = chosen(flag, wanted, data.data.var_names())?;
            if columns.is_empty() {
                continue;
            }
            let changed = |recording: &Array2<f64>| {
                let mut recording = recording.clone();
                columns.iter().for_each(|&column| change(recording.column_mut(column)));
                recording
            };
            let recordings: Vec<Array2<f64>> = data.data.recordings().iter().map(changed).collect();
            let names: Vec<String> =
                columns.iter().map(|&column| plain(&data.data.var_names()[column])).collect();
            data.data = data.data.with_recordings(recordings)?;
            data.warnings.push(format!("{reported} {}", names.join(", ")));
        }
        Ok(())
    }
}

/// The rows of a period: a number of rows, or a time, for which the step between rows must be known. The shortest recording must have
/// three of it, or nothing is left.
fn rows_of(text: &str, dt: Option<f64>, shortest: usize) -> Result<usize> {
    let fault = |reason: String| Error::param("season", reason);
    let unit = text.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(text.len());
    let (number, unit) = text.split_at(unit);
    let number: f64 = number.trim().parse().ok().filter(|number| *number > 0.0).ok_or_else(|| {
        fault(format!("'{text}' is not a period; give rows, such as 24, or a time, such as 24h or 30min"))
    })?;
    let rows = if unit.is_empty() {
        number
    } else {
        let allowed =
            || fault(format!("'{unit}' is not a unit of time; allowed: {}", Unit::NAMES.join(", ")));
        let unit: Unit = unit.parse().map_err(|_| allowed())?;
        let dt =
            dt.ok_or_else(|| fault("the step between rows is not known; give the period in rows".into()))?;
        number / unit.per_second() / dt
    };
    if rows < 1.5 || (rows - rows.round()).abs() > 0.01 {
        return Err(fault(format!("'{text}' are {rows} rows; give a period of 2 whole rows or more")));
    }
    if 3.0 * rows > shortest as f64 {
        let reason = format!(
            "a period has {rows:.0} rows, and the shortest recording {shortest}: three periods are needed"
        );
        return Err(fault(reason));
    }
    Ok(rows.round() as usize)
}

/// The places of the columns that a flag names.
fn chosen(flag: &str, wanted: &[String], names: &[String]) -> Result<Vec<usize>> {
    if wanted.iter().any(|name| name == ALL) {
        return Ok((0..names.len()).collect());
    }
    wanted.iter().map(|name| column(flag, name, names)).collect()
}

/// The place of the column `name` that a flag names.
///
/// # Errors
/// There is none.
pub(super) fn column(flag: &str, name: &str, names: &[String]) -> Result<usize> {
    position(names, name).ok_or_else(|| {
        Error::param(flag, format!("there is no column '{name}'; {}", instead(names, name, "columns:")))
    })
}

fn difference(mut column: ArrayViewMut1<'_, f64>) {
    let mut before = f64::NAN;
    for value in &mut column {
        let now = *value;
        *value = now - before;
        before = now;
    }
}

/// Takes out the line of least squares over the row numbers.
fn detrend(mut column: ArrayViewMut1<'_, f64>) {
    let known = column.iter().enumerate().filter(|(_, value)| !value.is_nan());
    let points: Vec<(f64, f64)> = known.map(|(row, value)| (row as f64, *value)).collect();
    let n = points.len() as f64;
    let (x, y) = points.iter().fold((0.0, 0.0), |(x, y), point| (x + point.0 / n, y + point.1 / n));
    let (xx, xy) = points
        .iter()
        .fold((0.0, 0.0), |(xx, xy), point| (xx + (point.0 - x).powi(2), xy + (point.0 - x) * (point.1 - y)));
    let slope = if xx > 0.0 { xy / xx } else { 0.0 };
    column.iter_mut().enumerate().for_each(|(row, value)| *value -= y + slope * (row as f64 - x));
}

fn standardise(mut column: ArrayViewMut1<'_, f64>) {
    // In units in which squares neither overflow nor vanish.
    let unit = unit_factor(&column.to_vec());
    column.mapv_inplace(|value| value * unit);
    let known: Vec<f64> = column.iter().copied().filter(|value| !value.is_nan()).collect();
    let n = known.len() as f64;
    let mean = known.iter().sum::<f64>() / n;
    let deviation = (known.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / n).sqrt();
    // A constant becomes 0.
    let scale = if deviation > 0.0 { 1.0 / deviation } else { 0.0 };
    column.mapv_inplace(|value| (value - mean) * scale);
}

#[cfg(test)]
mod tests {
    use ndarray::{Array1, array};

    use super::*;

    fn changed(change: fn(ArrayViewMut1<'_, f64>), mut column: Array1<f64>) -> Vec<f64> {
        change(column.view_mut());
        column.to_vec()
    }

    #[test]
    fn each_change_is_what_it_says_and_missing_values_stay_missing() {
        let found = changed(difference, array![1.0, 4.0, f64::NAN, 5.0, 7.0]);
        assert!(
            found[0].is_nan() && found[1] == 3.0 && found[2].is_nan() && found[3].is_nan() && found[4] == 2.0
        );
        let found = changed(detrend, array![1.0, 3.0, f64::NAN, 7.0]);
        assert!(
            found[2].is_nan() && [0, 1, 3].iter().all(|&row: &usize| found[row].abs() < 1e-12),
            "{found:?}"
        );
        let found = changed(standardise, array![2.0, 4.0, f64::NAN]);
        assert_eq!(found[..2], [-1.0, 1.0]);
        assert_eq!(changed(standardise, array![3.0, 3.0]), [0.0, 0.0]);
    }

    #[test]
    fn a_period_is_rows_or_a_time() {
        for (text, dt, rows) in [("24", None, 24), ("24h", Some(3600.0), 24), ("1.5 min", Some(0.5), 180)] {
            assert_eq!(rows_of(text, dt, 1000).expect(text), rows);
        }
        for (text, dt, reported) in [
            ("day", Some(1.0), "is not a period"),
            ("-3", None, "is not a period"),
            ("1e999", None, "not a unit"),
            ("24h", None, "not known"),
            ("3fortnights", Some(1.0), "not a unit"),
            ("2.5", None, "whole rows"),
            ("400", None, "three periods"),
        ] {
            assert!(rows_of(text, dt, 1000).expect_err(text).to_string().contains(reported), "{text}");
        }
    }

    #[test]
    fn columns_are_named_or_all() {
        let names = ["a", "b"].map(str::to_owned);
        let found = |wanted: &str| chosen("detrend", &[wanted.to_owned()], &names);
        assert_eq!((found("all").expect("all"), found("b").expect("b")), (vec![0, 1], vec![1]));
        assert!(found("c").expect_err("unknown").to_string().contains("columns: a, b"));
    }
}
