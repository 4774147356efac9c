//! Which part of the data is analysed: flags, and what they do to the data that was read.

use std::{ops::RangeInclusive, str::FromStr};

use clap::Args as ClapArgs;
use ndarray::{Array2, Axis, s};
use roscausal_core::{Error, Result};
use roscausal_discovery::{DataFrame, names::plain};

use super::Data;

/// Flags that choose a part of the data.
#[derive(ClapArgs, Clone, Debug, Default)]
pub(crate) struct PartArgs {
    /// Leave out columns without any number, such as the distance to a goal where no goal was recorded.
    #[arg(long)]
    drop_empty: bool,
    /// Rows to analyse of each recording, such as `1..5000`: counted from 1, the last one included; either end may be left out.
    #[arg(long, value_name = "FROM..TO")]
    rows: Option<Rows>,
}

/// A window of rows, counted from 1.
#[derive(Clone, Debug, PartialEq)]
struct Rows(RangeInclusive<usize>);

impl FromStr for Rows {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let number = |text: &str, open: usize| match text.trim() {
            "" => Some(open),
            text => text.parse().ok().filter(|&row: &usize| row > 0),
        };
        let ends =
            text.split_once("..").and_then(|(from, to)| Some((number(from, 1)?, number(to, usize::MAX)?)));
        match ends {
            Some((from, to)) if from <= to => Ok(Self(from..=to)),
            _ => Err("give FROM..TO with FROM at least 1 and at most TO, such as 1..5000".into()),
        }
    }
}

impl PartArgs {
    /// The part of `data` that these flags choose.
    ///
    /// # Errors
    /// A column without any number, unless it may be left out; a window without rows.
    pub(super) fn part(&self, mut data: Data) -> Result<Data> {
        if let Some(Rows(rows)) = &self.rows {
            data.map_recordings(|recording| {
                let end = recording.nrows().min(*rows.end());
                recording.slice(s![(rows.start() - 1).min(end)..end, ..]).to_owned()
            })?;
        }
        let empty: Vec<usize> = (0..data.data.n_vars()).filter(|&var| is_empty(&data.data, var)).collect();
        if empty.is_empty() {
            return Ok(data);
        }
        let names: Vec<String> = empty.iter().map(|&var| plain(&data.data.var_names()[var])).collect();
        if !self.drop_empty {
            return Err(Error::Data(sentence(&names, data.recorded)));
        }
        let kept: Vec<usize> = (0..data.data.n_vars()).filter(|var| !empty.contains(var)).collect();
        if kept.is_empty() {
            return Err(Error::Data("every column is empty: there is nothing to analyse".into()));
        }
        data.data = data.data.select(&kept);
        data.warnings.retain(|warning| !warning.contains("has no number at all"));
        data.warnings.push(format!("left out, without any number: {}", names.join(", ")));
        Ok(data)
    }
}

impl Data {
    /// Replaces each recording; those without rows are left out.
    fn map_recordings(&mut self, change: impl Fn(&Array2<f64>) -> Array2<f64>) -> Result<()> {
        let changed: Vec<Array2<f64>> =
            self.data.recordings().iter().map(change).filter(|r| r.nrows() > 0).collect();
        if changed.is_empty() {
            return Err(Error::param("rows", "there are no such rows"));
        }
        self.data = DataFrame::new(changed, self.data.var_names().to_vec())?;
        Ok(())
    }
}

fn is_empty(data: &DataFrame, var: usize) -> bool {
    data.recordings()
        .iter()
        .all(|recording| recording.index_axis(Axis(1), var).iter().all(|value| value.is_nan()))
}

/// Why there is nothing in these columns, and what to do.
fn sentence(names: &[String], recorded: bool) -> String {
    let has = if names.len() == 1 { "has" } else { "have" };
    let cause = match recorded && names.iter().any(|name| name.contains("_dg") || name.contains("_g")) {
        true => ": the recording tells no goal of the person (--human-goal names its topic)",
        false => "",
    };
    format!("{} {has} no value at all{cause}; --drop-empty goes on without", names.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_window_is_two_numbers_of_which_each_may_be_left_out() {
        let rows = |text: &str| text.parse::<Rows>().map(|Rows(rows)| rows);
        assert_eq!(rows("1..500"), Ok(1..=500));
        assert_eq!(rows("..500"), Ok(1..=500));
        assert_eq!(rows("20.."), Ok(20..=usize::MAX));
        for wrong in ["0..5", "7", "9..3", "a..b", "-1..3"] {
            assert!(rows(wrong).is_err(), "{wrong}");
        }
    }
}
