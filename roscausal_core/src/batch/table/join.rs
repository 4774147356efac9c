//! Files of one recording side by side, as a robot's topics are exported: each has some of the variables, at times of its own.
//!
//! 1. Their common span: from the latest first sample to the earliest last one.
//! 2. Each file is resampled to the same times within it.
//! 3. A column is called after its file and its name there: `steering.torque.z`.
//!
//! ```text
//! car-speed.csv    time 0.00 0.10 0.20 ...    v
//! car-wheel.csv    time 0.02 0.07 0.12 ...    angle      ->    time, speed.v, wheel.angle
//! ```

use std::path::{Path, PathBuf};

use roscausal_discovery::{Named, ensure};

use super::{
    Note, Table,
    steps::{self, DAY, GAP_STEPS, Steps, at_times, digits, evenly},
};

/// Steps from which on times are a calendar's, seconds: 20 days.
const OF_CALENDAR: f64 = 20.0 * DAY;

impl Table {
    /// The files' tables as one, at the step asked for, or else the longest of theirs.
    ///
    /// # Errors
    /// Fewer than two files, two of one name, one without times, files that share no span of time, or months that begin on other days.
    pub fn side_by_side(files: &[(PathBuf, Self)], how: &Steps) -> Result<Self, String> {
        ensure(files.len() > 1, || "there is one file; give all files of the recording")?;
        let parts = files.iter().map(|(path, table)| Part::of(path, table)).collect::<Result<Vec<_>, _>>()?;
        let longest = parts.iter().map(|part| part.step).fold(0.0, f64::max);
        let dt = how.dt.unwrap_or(longest);
        let [from, to] = span(&parts)?;
        let columns = files.iter().map(|(_, table)| table.values.ncols()).sum();
        let cells = files.iter().map(|(_, table)| table.values.len()).sum();
        let shared = how.dt.map_or_else(|| shared_stamps(&parts, [from, to]), |_| None);
        if shared.is_none() && how.dt.is_none() && longest >= OF_CALENDAR {
            let reason = "their times are months or longer, which a step in seconds does not join, and differ between the files; give each \
                          month (quarter, year) the same day in all of them";
            return Err(reason.into());
        }
        let grid = match &shared {
            Some(stamps) => stamps.clone(),
            None => evenly(from, to, dt, how.most_rows(columns, cells))?,
        };
        let short = short_names(&parts)?;
        let (mut names, mut columns, mut notes) = (Vec::new(), Vec::new(), Vec::new());
        for ((part, short), (path, table)) in parts.iter().zip(&short).zip(files) {
            let max_gap = how.max_gap.unwrap_or(GAP_STEPS * part.step.max(dt));
            columns.push(match &shared {
                Some(stamps) => table.values.select(ndarray::Axis(0), &part.rows_at(stamps)),
                None => at_times(&table.values, part.time, &grid, dt, how.how, max_gap),
            });
            names.extend(table.names.iter().map(|name| format!("{short}.{name}")));
            let of_file = table.notes.iter().filter(|note| matches!(note, Note::Read(_)));
            notes.extend(of_file.map(|note| Note::Read(format!("{}: {note}", path.display()))));
        }
        let views: Vec<_> = columns.iter().map(|part| part.view()).collect();
        let values = ndarray::concatenate(ndarray::Axis(1), &views).map_err(|error| error.to_string())?;
        let count = files.len();
        notes.push(Note::Read(match &shared {
            Some(stamps) => {
                format!("{count} files side by side, joined by the {} times that they share", stamps.len())
            }
            None => format!(
                "{count} files side by side: {} s that they share, at steps of {} s (theirs: {})",
                digits(to - from),
                digits(dt),
                parts.iter().map(|part| digits(part.step).to_string()).collect::<Vec<_>>().join(", ")
            ),
        }));
        notes.extend(Self::notes_on(&names, &values));
        Ok(Self { names, values, time: Some(grid), notes })
    }
}

/// A file of the recording.
struct Part<'a> {
    path: &'a Path,
    time: &'a [f64],
    /// Median step, seconds.
    step: f64,
}

impl<'a> Part<'a> {
    fn of(path: &'a Path, table: &'a Table) -> Result<Self, String> {
        let time = table.time.as_deref().unwrap_or_default();
        let step = steps::median_step(time).filter(|step| *step > 0.0).ok_or_else(|| {
            let (file, named) = (path.display(), Named("time_column"));
            format!(
                "{file} has no times to join it by; {named} names the column of times, which all files need"
            )
        })?;
        Ok(Self { path, time, step })
    }

    /// The rows at these times, all of which it has.
    fn rows_at(&self, stamps: &[f64]) -> Vec<usize> {
        stamps.iter().map(|stamp| self.time.partition_point(|t| t < stamp)).collect()
    }

    fn ends(&self) -> [f64; 2] {
        [self.time[0], self.time[self.time.len() - 1]]
    }
}

/// The times that all files have, if those are nearly all of each file's within their common span: days, months, one clock.
fn shared_stamps(parts: &[Part<'_>], [from, to]: [f64; 2]) -> Option<Vec<f64>> {
    const NEARLY_ALL: f64 = 0.8;
    let within = |part: &Part<'_>| part.time.iter().filter(|t| (from..=to).contains(*t)).count() as f64;
    let has = |part: &Part<'_>, stamp: f64| part.time.binary_search_by(|t| t.total_cmp(&stamp)).is_ok();
    let shared: Vec<f64> =
        parts[0].time.iter().copied().filter(|&stamp| parts.iter().all(|part| has(part, stamp))).collect();
    let are_most = |part: &Part<'_>| shared.len() as f64 >= NEARLY_ALL * within(part);
    (shared.len() > 2 && parts.iter().all(are_most)).then_some(shared)
}

/// From the latest beginning to the earliest end.
fn span(parts: &[Part<'_>]) -> Result<[f64; 2], String> {
    let latest = parts.iter().max_by(|a, b| a.ends()[0].total_cmp(&b.ends()[0]));
    let earliest = parts.iter().min_by(|a, b| a.ends()[1].total_cmp(&b.ends()[1]));
    let (Some(latest), Some(earliest)) = (latest, earliest) else { return Err("there are no files".into()) };
    let [from, to] = [latest.ends()[0], earliest.ends()[1]];
    if from >= to {
        let (first, second) = (earliest.path.display(), latest.path.display());
        return Err(format!(
            "{first} ends at {to} s, before {second} begins at {from} s; files of one recording need the same clock"
        ));
    }
    Ok([from, to])
}

/// Names of the files without what all of them begin with: `speed` and `wheel` of `car-speed.csv` and `car-wheel.csv`.
fn short_names(parts: &[Part<'_>]) -> Result<Vec<String>, String> {
    let whole = |part: &Part<'_>| {
        let name = part.path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        name.split('.').find(|stem| !stem.is_empty()).unwrap_or_default().to_owned()
    };
    let stems: Vec<String> = parts.iter().map(whole).collect();
    for (place, stem) in stems.iter().enumerate() {
        if let Some(other) = stems[..place].iter().position(|other| other == stem) {
            let (first, second) = (parts[other].path.display(), parts[place].path.display());
            return Err(format!(
                "{first} and {second} have the same name, after which their columns would be called; rename one of them"
            ));
        }
    }
    let first = stems[0].as_bytes();
    let shared = |length: &usize| stems.iter().all(|stem| stem.as_bytes().starts_with(&first[..*length]));
    let common = (0..=first.len()).rev().find(shared).unwrap_or(0);
    let cut = first[..common].iter().rposition(|byte| b"-_ ".contains(byte)).map_or(0, |place| place + 1);
    let short = |stem: &String| stem.get(cut..).filter(|rest| !rest.is_empty()).unwrap_or(stem).to_owned();
    Ok(stems.iter().map(short).collect())
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;
    use crate::batch::table::Resample;

    /// `value(t)` from `from` on, `n` times, `step` apart.
    fn table(name: &str, from: f64, n: usize, step: f64, value: impl Fn(f64) -> f64) -> Table {
        let time: Vec<f64> = (0..n).map(|row| from + row as f64 * step).collect();
        let values = Array2::from_shape_fn((n, 1), |(row, _)| value(time[row]));
        Table { names: vec![name.into()], values, time: Some(time), notes: Vec::new() }
    }

    fn joined(files: &[(&str, Table)], how: &Steps) -> Result<Table, String> {
        let files: Vec<_> = files.iter().map(|(path, table)| (PathBuf::from(path), table.clone())).collect();
        Table::side_by_side(&files, how)
    }

    #[test]
    fn files_of_one_recording_are_brought_to_the_same_times() {
        let speed = table("v", 100.0, 101, 0.1, |t| 2.0 * t);
        let wheel = table("angle", 101.03, 300, 0.05, |t| -t);
        let files = [("car-speed.csv", speed), ("logs/car-wheel.csv.gz", wheel)];
        let linear = Steps { how: Resample::Linear, ..Steps::default() };
        let one = joined(&files, &linear).expect("they overlap");
        assert_eq!(one.names, ["speed.v", "wheel.angle"]);
        let time = one.time.as_deref().expect("times");
        assert_eq!(time.len(), 90, "from 101.03 s to 110 s in steps of 0.1 s");
        for (t, row) in time.iter().zip(one.values.rows()) {
            assert!((row[0] - 2.0 * t).abs() < 1e-9 && (row[1] + t).abs() < 1e-9, "{t}: {row}");
        }
        let coarse =
            joined(&files, &Steps { dt: Some(1.0), how: Resample::Mean, ..Steps::default() }).expect("rows");
        // The mean since the row before, also in the first row.
        assert!((coarse.values[[0, 0]] - 2.0 * 100.55).abs() < 1e-9, "{}", coarse.values[[0, 0]]);
    }

    #[test]
    fn equal_stamps_are_joined_as_they_are() {
        let days = |from: usize, value: f64| {
            let time: Vec<f64> = (from..260)
                .filter(|day| day % 7 < 5 && *day != 40)
                .map(|day| day as f64 * 86_400.0)
                .collect();
            let values = Array2::from_shape_fn((time.len(), 1), |(row, _)| value * time[row]);
            Table { names: vec!["v".into()], values, time: Some(time), notes: Vec::new() }
        };
        let one =
            joined(&[("a.csv", days(0, 1.0)), ("b.csv", days(3, 2.0))], &Steps::default()).expect("joined");
        assert_eq!(one.values.nrows(), days(3, 1.0).values.nrows(), "no row is made up");
        assert!(one.values.rows().into_iter().all(|row| row[1] == 2.0 * row[0]));
    }

    #[test]
    fn files_that_cannot_be_joined_are_told_why() {
        let at = |from| table("v", from, 50, 0.1, |t| t);
        let timeless = Table { time: None, ..at(0.0) };
        let monthly = |from| table("v", from, 50, 30.0 * 86_400.0, |t| t);
        for (files, reported) in [
            (vec![("a.csv", at(0.0))], "there is one file"),
            (
                vec![("a.csv", at(0.0)), ("b.csv", at(60.0))],
                "a.csv ends at 4.9 s, before b.csv begins at 60 s",
            ),
            (vec![("a.csv", at(0.0)), ("b.csv", timeless)], "b.csv has no times to join it by"),
            (vec![("x/a.csv", at(0.0)), ("y/a.csv", at(0.0))], "x/a.csv and y/a.csv have the same name"),
            (
                vec![("a.csv", monthly(0.0)), ("b.csv", monthly(86_400.0))],
                "give each month (quarter, year) the same day",
            ),
        ] {
            let error = joined(&files, &Steps::default()).expect_err(reported);
            assert!(error.contains(reported), "{error}");
        }
    }
}
