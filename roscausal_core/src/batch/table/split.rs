//! Several recordings in one table: a column says which recording a row is of, or the time begins anew.
//!
//! ```text
//! id  time  v              time  v    time  v
//! 1   0.0   3.1            0.0   3.1  0.0   2.2
//! 1   0.1   3.0      ->    0.1   3.0  0.1   2.4
//! 2   0.0   2.2
//! 2   0.1   2.4
//! ```

use std::collections::BTreeMap;

use ndarray::Axis;
use roscausal_discovery::{Named, names};

use super::{Table, out_of_order};
use crate::ensure;

/// Names of columns that say which recording a row is of, in lower case.
const IDS: &str = "id subject participant person agent ped track unit run trial session episode recording sequence walk \
                   experiment group patient vehicle pedestrian object animal player user country company firm";

/// Whether a column of this name may say which recording a row is of: `id`, `run`, `subject_id`, `TrialNumber` not.
pub fn is_id(name: &str) -> bool {
    let name = name.trim().to_lowercase();
    let stem = ["_id", "_no", "_nr", "_code", "id"].iter().find_map(|end| name.strip_suffix(end));
    [Some(name.as_str()), stem].into_iter().flatten().any(|name| IDS.split(' ').any(|id| id == name))
}

impl Table {
    /// One table for each value of a column, in the order of their first rows, with that value; without the column. `column` may
    /// also be that of the times, which then begin anew in each recording; these are numbered from 1.
    ///
    /// # Errors
    /// A column that is not there, or a time that does not increase within a recording (`equal`: it may stand still).
    pub fn by_recording(self, column: &str, equal: bool) -> Result<Vec<(String, Self)>, String> {
        let place = names::position(&self.names, column);
        let keys: Vec<f64> = match (place, &self.time) {
            (Some(place), _) => self.values.column(place).to_vec(),
            (None, Some(time)) => {
                let mut number = 1.0;
                let begins = |row: usize| row > 0 && time[row] < time[row - 1];
                let number = |row| {
                    number += f64::from(begins(row));
                    number
                };
                (0..time.len()).map(number).collect()
            }
            (None, None) => {
                return Err(format!("there is no column '{column}'; columns: {}", self.names.join(", ")));
            }
        };
        let missing = keys.iter().filter(|key| key.is_nan()).count();
        let needs = || format!("{} needs one in each row", Named("recording"));
        ensure(missing == 0, || format!("column '{column}' has no value in {missing} rows; {}", needs()))?;
        let mut rows: Vec<(f64, Vec<usize>)> = Vec::new();
        let mut places: BTreeMap<u64, usize> = BTreeMap::new();
        for (row, key) in keys.into_iter().enumerate() {
            let at = *places.entry((key + 0.0).to_bits()).or_insert(rows.len());
            if at == rows.len() {
                rows.push((key, Vec::new()));
            }
            rows[at].1.push(row);
        }
        let kept: Vec<usize> = (0..self.names.len()).filter(|other| Some(*other) != place).collect();
        let part = |(key, rows): (f64, Vec<usize>)| {
            let time: Option<Vec<f64>> =
                self.time.as_ref().map(|time| rows.iter().map(|&row| time[row]).collect());
            let wrong = |pair: &[f64]| pair[1] < pair[0] || (pair[1] == pair[0] && !equal);
            if let Some(pair) = time.as_deref().and_then(|time| time.windows(2).find(|pair| wrong(pair))) {
                return Err(out_of_order(&format!("{column} {key}"), pair[0], pair[1], column));
            }
            let names: Vec<String> = kept.iter().map(|&column| self.names[column].clone()).collect();
            let values = self.values.select(Axis(0), &rows).select(Axis(1), &kept);
            Ok((format!("{column} {key}"), Self { names, values, time, notes: Vec::new() }))
        };
        let mut parts = rows.into_iter().map(part).collect::<Result<Vec<_>, _>>()?;
        if let Some((_, first)) = parts.first_mut() {
            first.notes = self.notes;
        }
        Ok(parts)
    }
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;

    fn table(time: Option<Vec<f64>>) -> Table {
        let values = array![[1.0, 10.0], [2.0, 20.0], [1.0, 11.0], [2.0, 21.0]];
        Table { names: vec!["id".into(), "v".into()], values, time, notes: Vec::new() }
    }

    #[test]
    fn each_value_of_a_column_is_a_recording_wherever_its_rows_are() {
        let parts = table(Some(vec![0.0, 0.0, 0.1, 0.1])).by_recording("id", false).expect("two");
        let reported: Vec<_> =
            parts.iter().map(|(name, part)| (name.as_str(), part.values.column(0).to_vec())).collect();
        assert_eq!(reported, [("id 1", vec![10.0, 11.0]), ("id 2", vec![20.0, 21.0])]);
        assert!(
            parts
                .iter()
                .all(|(_, part)| part.names == ["v"] && part.time.as_deref() == Some(&[0.0, 0.1][..]))
        );
    }

    #[test]
    fn a_row_of_no_recording_is_refused_since_without_it_others_would_follow_one_another() {
        let mut table = table(None);
        table.values[[1, 0]] = f64::NAN;
        assert!(
            table.by_recording("id", false).is_err_and(|reported| reported.contains("no value in 1 rows"))
        );
    }

    #[test]
    fn a_time_that_begins_anew_begins_a_recording() {
        let parts = table(Some(vec![0.0, 0.1, 0.0, 0.1])).by_recording("time", false).expect("two");
        assert_eq!(parts.iter().map(|(_, part)| part.values.nrows()).collect::<Vec<_>>(), [2, 2]);
        assert!(
            table(None)
                .by_recording("walk", false)
                .is_err_and(|reported| reported.contains("no column 'walk'"))
        );
        assert!(
            table(Some(vec![0.2, 0.0, 0.1, 0.1]))
                .by_recording("id", false)
                .is_err_and(|reported| reported.contains("goes back"))
        );
    }

    #[test]
    fn names_that_say_whose_row_it_is() {
        for (name, is) in [
            ("id", true),
            ("Subject_ID", true),
            ("run", true),
            ("personid", true),
            ("running", false),
            ("humid", false),
        ] {
            assert_eq!(is_id(name), is, "{name}");
        }
    }
}
