//! Rows at one step: a lag must mean the same time everywhere.
//!
//! 1. Steps longer than the largest gap end a recording; the rows behind them are another one.
//! 2. With a step asked for, each recording is resampled to it.
//! 3. Otherwise the steps must be even: at most one in ten may be off by more than a quarter. What they vary by is told.

use crate::ensure;
use ndarray::{Array2, Axis, s};
use roscausal_discovery::Named;

use super::{Note, Table};
use crate::memory::{Memory, most_grown};

/// Steps farther than this fraction from the median are uneven.
const UNEVEN: f64 = 0.25;
/// The share of uneven steps from which a recording is irregular.
const IRREGULAR: f64 = 0.1;
/// Seconds of a day.
pub(super) const DAY: f64 = 86_400.0;
/// A gap is longer than this many steps, unless the user says how long.
pub(super) const GAP_STEPS: f64 = 5.0;
/// Even steps that vary by more than this are told.
const WORTH_TELLING: f64 = 0.02;

/// How rows come to one step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Steps {
    /// The step to resample to, seconds; `None`: the rows stay as they are.
    pub dt: Option<f64>,
    /// What a resampled row holds.
    pub how: Resample,
    /// A longer step is a gap, seconds; `None`: five times the median (or what is resampled to, if that is longer).
    pub max_gap: Option<f64>,
    /// Bytes that resampled rows may take; `None`: what the machine has free.
    pub max_memory: Option<u64>,
}

impl Steps {
    /// The most rows of `columns` that `cells` samples may become: a step far below theirs makes up rows without end.
    pub(super) fn most_rows(&self, columns: usize, cells: usize) -> f64 {
        let bytes = Memory::of(self.max_memory).bytes().min(most_grown((cells * size_of::<f64>()) as u64));
        // Each row has its time, too.
        bytes as f64 / (size_of::<f64>() * (columns + 1)) as f64
    }
}

/// What a resampled row holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Resample {
    /// The last sample at or before its time.
    #[default]
    Last,
    /// The mean of the samples since the row before.
    Mean,
    /// The line between the samples before and after.
    Linear,
}

roscausal_discovery::words!(Resample, "resample": Last "last", Mean "mean", Linear "linear");

/// Median step between times, seconds.
pub(super) fn median_step(time: &[f64]) -> Option<f64> {
    median(time.windows(2).map(|pair| pair[1] - pair[0]))
}

/// The middle of the numbers among these values.
pub(crate) fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

impl Table {
    /// The rows at one step, as one table for each recording without a gap. A table without times stays as it is.
    ///
    /// # Errors
    /// Uneven steps without a step to resample to; a step that gives no row, or too many; a resampled table without times.
    pub fn at_even_steps(mut self, steps: &Steps) -> Result<Vec<Self>, String> {
        let Some(mut time) = self.time.take() else {
            return match steps.dt {
                Some(_) => Err(format!(
                    "it has no times, so it cannot be resampled; leave {} out, or name the column with {}",
                    Named("dt"),
                    Named("time_column")
                )),
                None => Ok(vec![self]),
            };
        };
        let Some(mut median) = median_step(&time) else {
            self.time = Some(time);
            return Ok(vec![self]);
        };
        let mut notes = std::mem::take(&mut self.notes);
        if steps.dt.is_none() && are_working_days(&time, median) {
            let told = "its times are working days: a lag is one of them, also over a weekend or a holiday";
            notes.push(Note::Read(told.to_owned()));
            return Ok(vec![Self { time: Some(time), notes, ..self }]);
        }
        let usual = median.max(steps.dt.unwrap_or(0.0));
        let max_gap = steps.max_gap.unwrap_or(GAP_STEPS * usual);
        let parts = parts(&time, max_gap);
        if let (None, Some((even, step, rounded_to))) = (steps.dt, before_rounding(&time, &parts, median)) {
            let told = format!("its times are rounded to {rounded_to} s; the steps are {} s", digits(step));
            notes.push(Note::Read(told));
            (time, median) = (even, step);
        }
        if parts.len() > 1 {
            let longest = time.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
            let count = parts.len() - 1;
            notes.push(Note::Read(format!(
                "{count} gap{} of more than {} s (the longest {} s): analysed as {} recordings; no lag spans a gap",
                if count == 1 { "" } else { "s" },
                digits(max_gap),
                digits(longest),
                parts.len()
            )));
        }
        let jitter = Jitter::of(&time, median, max_gap);
        if steps.dt.is_none() {
            notes.extend(jitter.checked(median)?.map(Note::Read));
        }
        let most = steps.most_rows(self.values.ncols(), self.values.len());
        if steps.dt.is_none() && parts.len() == 1 {
            return Ok(vec![Self { time: Some(time), notes, ..self }]);
        }
        let mut tables = Vec::new();
        for (from, to) in parts {
            let (values, time) = (self.values.slice(s![from..to, ..]).to_owned(), time[from..to].to_vec());
            let (values, time) = match steps.dt {
                Some(dt) => resampled(&values, &time, dt, steps.how, max_gap, most)?,
                None => (values, time),
            };
            if values.nrows() > 0 {
                tables.push(Self { names: self.names.clone(), values, time: Some(time), notes: Vec::new() });
            }
        }
        let Some(first) = tables.first_mut() else { return Err("no row is left after resampling".into()) };
        if let Some(dt) = steps.dt {
            notes.retain(|note| matches!(note, Note::Read(_)));
            let was = format!("from steps of about {} s (median)", digits(median));
            let made_up = match dt < 0.75 * median {
                true => format!(
                    ": most rows are made up between samples, and tests count them as samples; give a longer {}",
                    Named("dt")
                ),
                false => String::new(),
            };
            notes.push(Note::Read(format!("resampled to steps of {} s {was}{made_up}", digits(dt))));
        }
        first.notes = notes;
        Ok(tables)
    }
}

/// The rows without a gap between them: first, and one past the last.
fn parts(time: &[f64], max_gap: f64) -> Vec<(usize, usize)> {
    // Stamps have errors in their last digits.
    let is_gap = |row: &usize| time[*row] - time[*row - 1] > max_gap * (1.0 + 1e-9);
    let mut starts: Vec<usize> = std::iter::once(0).chain((1..time.len()).filter(is_gap)).collect();
    starts.push(time.len());
    starts.windows(2).map(|pair| (pair[0], pair[1])).collect()
}

/// Whether these are days of which most follow one another, without any Saturday or Sunday, or, over four weeks, without others.
fn are_working_days(time: &[f64], median: f64) -> bool {
    // 1970 began on a Thursday.
    let weekday = |t: f64| ((t / DAY).floor() + 3.0).rem_euclid(7.0);
    let whole = |t: &f64| (t - time[0]).rem_euclid(DAY) == 0.0;
    if median != DAY || time.len() <= 7 || time[0] <= DAY || !time.iter().all(whole) {
        return false;
    }
    let mut worked = [false; 7];
    time.iter().for_each(|t| worked[weekday(*t) as usize] = true);
    let [.., saturday, sunday] = worked;
    let is_long = time[time.len() - 1] - time[0] >= 28.0 * DAY;
    !(saturday || sunday) || (is_long && (4..7).contains(&worked.iter().filter(|day| **day).count()))
}

/// Times as they were before they were rounded, if that explains their uneven steps; with the step, and to what they were rounded.
/// Each is at most one unit of the last digit from a multiple of the mean step since the part's first one.
fn before_rounding(time: &[f64], parts: &[(usize, usize)], median: f64) -> Option<(Vec<f64>, f64, f64)> {
    let is_whole = |t: f64, unit: f64| ((t / unit).round() * unit - t).abs() < 1e-3 * unit;
    let unit = [1.0, 0.1, 0.01, 0.001].into_iter().find(|&unit| time.iter().all(|&t| is_whole(t, unit)))?;
    let steps =
        || parts.iter().flat_map(|&(from, to)| time[from..to].windows(2).map(|pair| pair[1] - pair[0]));
    let (sum, count) = steps()
        .filter(|step| *step < 1.5 * median + unit)
        .fold((0.0, 0.0), |(s, n), step| (s + step, n + 1.0));
    let first = sum / f64::max(count, 1.0);
    // Rounding shows in the steps, and does not hide them.
    if count < 10.0
        || !(0.02 * first < unit && unit < 0.8 * first)
        || steps().all(|step| (step - first).abs() < 1e-3 * first)
    {
        return None;
    }
    let places = |step: f64| -> Vec<f64> {
        let mut place = 0.0;
        let rows = parts.iter().flat_map(|&(from, to)| (from..to).map(move |row| (from, row)));
        let place_of = |(from, row): (usize, usize)| {
            place += if row == from { 0.0 } else { ((time[row] - time[row - 1]) / step).round() };
            place
        };
        rows.map(place_of).collect()
    };
    let place = places(first);
    let longest = parts.iter().max_by_key(|(from, to)| to - from)?;
    let (from, to) = (longest.0, longest.1 - 1);
    let measured = (time[to] - time[from]) / (place[to] - place[from]);
    // A whole number of rows a second, if it may be one: rounding moves both ends.
    let rate = (1.0 / measured).round();
    let is_rate = rate > 0.0 && (rate * measured - 1.0).abs() < unit / (time[to] - time[from]);
    let step = if is_rate { 1.0 / rate } else { measured };
    let rows = parts.iter().flat_map(|&(from, to)| (from..to).map(move |row| (from, row)));
    let even: Vec<f64> = rows.map(|(from, row)| time[from] + (place[row] - place[from]) * step).collect();
    even.iter().zip(time).all(|(even, t)| (even - t).abs() < 1.1 * unit).then_some((even, step, unit))
}

/// How even the steps are, gaps left out.
struct Jitter {
    /// Standard deviation, in medians.
    deviation: f64,
    /// The share of uneven steps.
    uneven: f64,
}

impl Jitter {
    fn of(time: &[f64], median: f64, max_gap: f64) -> Self {
        let steps = time.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step <= max_gap);
        let (mut n, mut squares, mut uneven) = (0.0, 0.0, 0.0);
        for off in steps.map(|step| step / median - 1.0) {
            n += 1.0;
            squares += off * off;
            uneven += f64::from(off.abs() > UNEVEN);
        }
        let n = f64::max(n, 1.0);
        Self { deviation: (squares / n).sqrt(), uneven: uneven / n }
    }

    /// What to tell of steps that are even enough.
    fn checked(&self, median: f64) -> Result<Option<String>, String> {
        let (percent, median) = (|share: f64| (share * 100.0).round(), digits(median));
        if self.uneven > IRREGULAR || !self.deviation.is_finite() {
            let (uneven, dt, resample) = (percent(self.uneven), Named("dt"), Named("resample"));
            return Err(format!(
                "its steps are uneven: the median is {median} s, and {uneven} % of them are off by more than a quarter; a lag would mean \
                 many times. Resample it with {dt} {median} {resample} last (or mean, or linear)"
            ));
        }
        let varied = percent(self.deviation).max(1.0);
        let reported = || format!("steps of {median} s vary by {varied} % (standard deviation)");
        Ok((self.deviation > WORTH_TELLING).then(reported))
    }
}

/// Rows at the times `k dt` within the recording. A value is missing where the samples it would need lie farther apart than
/// `max_gap`, or are missing themselves.
fn resampled(
    values: &Array2<f64>,
    time: &[f64],
    dt: f64,
    how: Resample,
    max_gap: f64,
    most: f64,
) -> Result<(Array2<f64>, Vec<f64>), String> {
    // Grids of several recordings have the same phase: that of whole multiples of the step since the first sample.
    let grid = evenly(time[0], time[time.len() - 1], dt, most)?;
    Ok((at_times(values, time, &grid, dt, how, max_gap), grid))
}

/// The times `first + k dt` up to `last`, which are `most` at the most.
pub(super) fn evenly(first: f64, last: f64, dt: f64, most: f64) -> Result<Vec<f64>, String> {
    let count = ((last - first) / dt * (1.0 + 1e-12) + 1e-6).floor() + 1.0;
    ensure(dt > 0.0 && count <= most, || {
        format!("{} {dt} would give {count} rows; give a longer step", Named("dt"))
    })?;
    Ok((0..count as usize).map(|row| first + row as f64 * dt).collect())
}

/// Rows at the times of `grid`, which are `dt` apart.
pub(super) fn at_times(
    values: &Array2<f64>,
    time: &[f64],
    grid: &[f64],
    dt: f64,
    how: Resample,
    max_gap: f64,
) -> Array2<f64> {
    let mut out = Array2::from_elem((grid.len(), values.ncols()), f64::NAN);
    // Stamps a little late still count for their row.
    let late = 1e-6 * dt;
    for (column, mut cells) in values.axis_iter(Axis(1)).zip(out.axis_iter_mut(Axis(1))) {
        // Samples of this column that are there, and how many of them lie at or before the grid's time.
        let there = time.iter().zip(column).filter(|(_, value)| !value.is_nan());
        let there: Vec<(f64, f64)> = there.map(|(&t, &value)| (t, value)).collect();
        let begin = grid.first().map_or(0.0, |first| first - dt + late);
        let mut since = there.partition_point(|(t, _)| *t <= begin);
        let mut before = since;
        for (row, &at) in grid.iter().enumerate() {
            while there.get(before).is_some_and(|(t, _)| *t <= at + late) {
                before += 1;
            }
            let Some(&(t, value)) = before.checked_sub(1).and_then(|last| there.get(last)) else { continue };
            cells[row] = match how {
                Resample::Last if at - t <= max_gap => value,
                Resample::Mean if since < before => {
                    there[since..before].iter().map(|(_, value)| value).sum::<f64>() / (before - since) as f64
                }
                Resample::Linear => match there.get(before) {
                    Some(&(next, after)) if next - t <= max_gap => {
                        value + (after - value) * ((at - t) / (next - t)).clamp(0.0, 1.0)
                    }
                    _ if (at - t).abs() <= late => value,
                    _ => f64::NAN,
                },
                _ => f64::NAN,
            };
            since = before;
        }
    }
    out
}

/// Six digits, without zeros at the end.
pub(super) fn digits(seconds: f64) -> f64 {
    let scale = libm::pow(10_f64, 5.0 - libm::log10(seconds.abs().max(1e-12)).floor());
    (seconds * scale).round() / scale
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;

    fn table(time: &[f64], value: impl Fn(f64) -> f64) -> Table {
        let values = Array2::from_shape_fn((time.len(), 1), |(row, _)| value(time[row]));
        Table { names: vec!["a".into()], values, time: Some(time.to_vec()), notes: Vec::new() }
    }

    fn even(n: usize, step: f64) -> Vec<f64> {
        (0..n).map(|row| row as f64 * step).collect()
    }

    #[test]
    fn a_gap_ends_a_recording() {
        let mut time = even(100, 0.1);
        time.iter_mut().skip(40).for_each(|t| *t += 20.0);
        let tables = table(&time, |t| t).at_even_steps(&Steps::default()).expect("even");
        assert_eq!(tables.iter().map(|table| table.values.nrows()).collect::<Vec<_>>(), [40, 60]);
        let reported = tables[0].notes[0].to_string();
        assert!(
            reported.starts_with("1 gap of more than 0.5 s (the longest 20.1 s): analysed as 2 recordings"),
            "{reported}"
        );
        let wide = Steps { max_gap: Some(30.0), ..Steps::default() };
        assert_eq!(table(&time, |t| t).at_even_steps(&wide).expect("one").len(), 1);
    }

    #[test]
    fn uneven_steps_are_an_error_that_says_how_to_go_on() {
        let mut at = 0.0;
        let time: Vec<f64> = (0..200)
            .map(|i| {
                at += 0.02 + 0.1 * f64::from(i * 37 % 101) / 101.0;
                at
            })
            .collect();
        let error = table(&time, |t| t).at_even_steps(&Steps::default()).expect_err("uneven");
        assert!(error.contains("uneven") && error.contains(&format!("{} 0.", Named("dt"))), "{error}");
        let steps = Steps { dt: Some(0.1), how: Resample::Linear, ..Steps::default() };
        let even = table(&time, |t| 3.0 * t).at_even_steps(&steps).expect("resampled").remove(0);
        assert!((even.dt().expect("times") - 0.1).abs() < 1e-9);
        let times = even.time.expect("times");
        assert!(times.iter().zip(&even.values).all(|(t, value)| (value - 3.0 * t).abs() < 1e-9));
    }

    #[test]
    fn a_little_jitter_is_told() {
        let time: Vec<f64> = (0..100).map(|i| 0.1 * f64::from(i) + 0.004 * f64::from(i % 3)).collect();
        let tables = table(&time, |t| t).at_even_steps(&Steps::default()).expect("even");
        assert!(tables[0].notes[0].to_string().contains("vary by"), "{:?}", tables[0].notes);
        assert!(
            table(&even(100, 0.1), |t| t).at_even_steps(&Steps::default()).expect("even")[0].notes.is_empty()
        );
    }

    #[test]
    fn rounded_times_are_known_as_such_at_any_rate_and_with_rows_lost() {
        for (rate, unit) in [(30.0, 0.01), (29.97, 0.001), (60.0, 0.01), (7.5, 0.01)] {
            let at = |i: usize| 1.7e9 + i as f64 / rate;
            let rounded = |t: f64| (t / unit).round() * unit;
            let time: Vec<f64> = (0..500).filter(|i| i % 97 != 3).map(|i| rounded(at(i))).collect();
            let table = table(&time, |t| t).at_even_steps(&Steps::default()).expect("even").remove(0);
            let step = table.dt().expect("times");
            assert!((step * rate - 1.0).abs() < 1e-3, "{rate}: {step} {:?}", table.notes);
        }
        let mut at = 0.0;
        let uneven: Vec<f64> = (0..200)
            .map(|i| {
                at += 0.02 + 0.01 * f64::from(i * 37 % 11).floor();
                (at * 100.0).round() / 100.0
            })
            .collect();
        assert!(table(&uneven, |t| t).at_even_steps(&Steps::default()).is_err());
    }

    #[test]
    fn working_days_are_even() {
        // From Monday to Friday, from Sunday to Thursday, and from Monday to Saturday, with a holiday.
        for (first, count) in [(0, 5), (6, 5), (0, 6)] {
            let works = |day: &i32| (day + 3 - first).rem_euclid(7) < count && *day != 19_750;
            let time: Vec<f64> =
                (19_723..19_900_i32).filter(works).map(|day| f64::from(day) * 86_400.0).collect();
            let tables = table(&time, |t| t).at_even_steps(&Steps::default()).expect("even");
            assert!(
                tables.len() == 1 && tables[0].notes[0].to_string().contains("working days"),
                "{:?}",
                tables[0].notes
            );
        }
    }

    #[test]
    fn each_way_of_resampling_gives_what_it_says() {
        let values = array![[0.0], [1.0], [4.0], [f64::NAN], [8.0]];
        let time = [0.0, 0.1, 0.2, 0.3, 0.4];
        let row = |how, dt| {
            resampled(&values, &time, dt, how, 1.0, 1e3).expect("resampled").0.into_raw_vec_and_offset().0
        };
        assert_eq!(row(Resample::Last, 0.2), [0.0, 4.0, 8.0]);
        assert_eq!(row(Resample::Mean, 0.2), [0.0, 2.5, 8.0]);
        assert_eq!(row(Resample::Linear, 0.1)[3], 6.0);
        let held = resampled(&array![[1.0], [2.0]], &[0.0, 1.0], 0.25, Resample::Last, 0.3, 1e3)
            .expect("resampled")
            .0;
        assert!(held[[1, 0]] == 1.0 && held[[2, 0]].is_nan() && held[[4, 0]] == 2.0);
    }

    #[test]
    fn without_times_there_is_nothing_to_resample() {
        let plain = || Table { time: None, ..table(&even(5, 1.0), |t| t) };
        assert_eq!(plain().at_even_steps(&Steps::default()).expect("as it is").len(), 1);
        assert!(plain().at_even_steps(&Steps { dt: Some(1.0), ..Steps::default() }).is_err());
        for dt in [0.0, -1.0, f64::NAN, 1e-12] {
            assert!(
                table(&even(5, 1.0), |t| t)
                    .at_even_steps(&Steps { dt: Some(dt), ..Steps::default() })
                    .is_err()
            );
        }
    }
}
