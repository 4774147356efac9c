//! The columns of a header: their names, which of them are wanted, and which one is the time.

use std::collections::HashMap;

use crate::ensure;
use csv::ByteRecord;
use roscausal_discovery::names;

use super::{Complaint, Parsed, Reading, time::Unit};

/// Names of the column of sample times, which is not a variable; a unit may follow (`time_ms`, `Time [s]`).
const TIME_NAMES: [&str; 24] = [
    "time", "t", "timestamp", "stamp", "datetime", "date_time", "date", "header.stamp", "header_stamp",
    "ros_time", "rosbagtimestamp", "time_stamp", "elapsed", "elapsed_time", "sim_time", "unix_time", "epoch",
    "ts", "clock", "zeit", "datum", "uhrzeit", "yyyymmdd", "yyyymm",
];

/// The column of times, and the unit in its name.
pub(crate) fn time_column(header: &[String]) -> Option<(usize, Option<Unit>)> {
    // A later T is a temperature.
    let is_time = |column: usize, name: &String| time_name(name).filter(|_| column == 0 || name != "T");
    let named = header.iter().enumerate().find_map(|(column, name)| Some((column, is_time(column, name)?)));
    // The stamp of a message within a longer name: `/odom/header/stamp`, `.pose.header.stamp`.
    let is_stamp = |name: &String| name.to_lowercase().replace('/', ".").ends_with(".header.stamp");
    named.or_else(|| header.iter().position(is_stamp).map(|column| (column, None)))
}

/// The columns of a stamp's seconds and nanoseconds: `header.stamp.secs` and `header.stamp.nsecs`, `stamp_sec` and `stamp_nanosec`.
pub(crate) fn stamp_in_two(header: &[String]) -> Option<(usize, usize)> {
    let lower: Vec<String> = header.iter().map(|name| name.to_lowercase()).collect();
    let rest_of = |base: &str| {
        let is_rest = |unit: &str| ["nsecs", "nsec", "nanosec", "nanosecs"].contains(&unit);
        lower.iter().position(|name| name.strip_prefix(base).is_some_and(is_rest))
    };
    let seconds = |name: &String| Some(name.strip_suffix("secs").or(name.strip_suffix("sec"))?.to_owned());
    lower.iter().enumerate().find_map(|(column, name)| Some((column, rest_of(&seconds(name)?)?)))
}

/// Whether a name is one of a column of times, and the unit in it.
pub(crate) fn time_name(name: &str) -> Option<Option<Unit>> {
    let name = name.trim().trim_matches('\'').trim_start_matches(['%', '.', '_', '/']).to_lowercase();
    if ["seconds", "secs"].contains(&name.as_str()) {
        return Some(Some(Unit::Seconds));
    }
    if TIME_NAMES.contains(&name.as_str()) {
        return Some(None);
    }
    let (base, unit) = name.rsplit_once(['_', ' ', '[', '('])?;
    let unit = unit.trim_end_matches([']', ')']).parse().ok()?;
    let base = base.trim_end_matches(['_', ' ', '[', '(']);
    TIME_NAMES.contains(&base).then_some(Some(unit))
}

/// A table with more columns than this is none.
pub(super) const MOST_COLUMNS: usize = 100_000;
/// A name of more bytes than this is none.
const LONGEST_NAME: usize = 1000;

/// Checks the number of columns before anything is made for each.
///
/// # Errors
/// There are too many.
pub(super) fn check_count(columns: usize) -> Result<(), String> {
    if columns <= MOST_COLUMNS {
        return Ok(());
    }
    Err(format!(
        "it has {columns} columns, and at most {MOST_COLUMNS} are read; keep those that are to be analysed"
    ))
}

/// Checks how long the names of a header are, in bytes; `at` is where they stand.
pub(super) fn check_lengths(lengths: impl Iterator<Item = usize>, at: &str) -> Result<(), String> {
    let long = |(_, length): &(usize, usize)| *length > LONGEST_NAME;
    match lengths.enumerate().find(long) {
        None => Ok(()),
        Some((column, length)) => Err(format!(
            "{at}, column {}: the name is {length} bytes long; check the quotes and line ends of the header",
            column + 1
        )),
    }
}

/// Checks the names of a header. The empty name of a first column is that of pandas' index, of a last one a separator too
/// many; both are allowed here. `line` is where they stand.
pub(super) fn check_names(names: &[String], at: &str) -> Result<(), String> {
    check_lengths(names.iter().map(String::len), at)?;
    let mut places = HashMap::new();
    for (column, name) in names.iter().enumerate() {
        let at_an_end = column == 0 || column + 1 == names.len();
        ensure(!name.trim().is_empty() || (at_an_end && names.len() > 2), || {
            format!("{at}, column {}: the name is empty; name every column", column + 1)
        })?;
        if let Some(earlier) = places.insert(name, column).filter(|_| !name.is_empty()) {
            let (first, second) = (earlier + 1, column + 1);
            return Err(format!(
                "{at}: '{name}' names both column {first} and column {second}; give every column a name of its own"
            ));
        }
    }
    Ok(())
}

/// Names of columns that have none: `x_0`, `x_1`. A last one that is empty in both rows is a separator too many.
pub(super) fn made_up(first: &ByteRecord, second: &ByteRecord) -> Vec<String> {
    let last = first.len().saturating_sub(1);
    let is_end =
        |column| last > 1 && column == last && first[last].is_empty() && second.get(last) == Some(b"");
    let name = |column| if is_end(column) { String::new() } else { format!("x_{column}") };
    (0..first.len()).map(name).collect()
}

/// Whether a first column is the row numbers that pandas and R write.
pub(super) fn is_index(name: &str) -> bool {
    name.is_empty() || name == "Unnamed: 0"
}

/// The columns of `header` that `wanted` names: a name in any spelling, a pattern with `*` and `?`, a range `a..c`, or
/// `!pattern`, which takes columns away (from all others if nothing else is named), or `+name`, which adds one that is not chosen yet.
pub(super) fn chosen(
    header: &[String],
    wanted: &[String],
    time: Option<usize>,
) -> Result<Vec<usize>, String> {
    let is_variable = |column: &usize| Some(*column) != time;
    let mut columns: Vec<usize> = Vec::new();
    if wanted.iter().any(|name| name.starts_with('!'))
        && wanted.iter().all(|name| name.starts_with(['!', '+']))
    {
        columns.extend((0..header.len()).filter(is_variable));
    }
    for name in wanted {
        if let Some(pattern) = name.strip_prefix('!') {
            let away = matching(header, pattern)?;
            columns.retain(|column| !away.contains(column));
            continue;
        }
        if let Some(name) = name.strip_prefix('+') {
            // The time is at hand without being a variable.
            let more = one(header, name)?;
            if Some(more) != time && !columns.contains(&more) {
                columns.push(more);
            }
            continue;
        }
        let several = name.contains(['*', '?']) || name.contains("..");
        for column in matching(header, name)? {
            match (columns.contains(&column), several) {
                (true, false) => return Err(format!("'{name}' is named twice; name each column once")),
                (true, true) => {}
                (false, _) if several && Some(column) == time => {}
                (false, _) => columns.push(column),
            }
        }
    }
    ensure(!columns.is_empty(), || format!("no column is left; columns: {}", header.join(", ")))?;
    Ok(columns)
}

/// The columns that are read: those that are chosen, or all; and what other settings need besides.
pub(super) fn read(header: &[String], reading: &Reading, time: Option<usize>) -> Parsed<Vec<usize>> {
    let Some(wanted) = &reading.columns else { return Ok((0..header.len()).collect()) };
    let mut columns = Vec::new();
    if !wanted.is_empty() || reading.needs.is_empty() {
        columns = chosen(header, wanted, time).map_err(|reason| Complaint::Setting("columns", reason))?;
    }
    for (name, setting) in &reading.needs {
        let more = one(header, name).map_err(|reason| Complaint::Setting(setting, reason))?;
        // The time is at hand without being a variable.
        if Some(more) != time && !columns.contains(&more) {
            columns.push(more);
        }
    }
    Ok(columns)
}

fn matching(header: &[String], name: &str) -> Result<Vec<usize>, String> {
    if let Some(column) = names::position(header, name) {
        return Ok(vec![column]);
    }
    if let Some((from, to)) = name.split_once("..") {
        let (from, to) = (one(header, from)?, one(header, to)?);
        return Ok(if from <= to { (from..=to).collect() } else { (to..=from).rev().collect() });
    }
    let is_pattern = name.contains(['*', '?']);
    let is_meant = |column: &usize| is_pattern && fits(name, &names::plain(&header[*column]));
    let found: Vec<usize> = (0..header.len()).filter(is_meant).collect();
    if found.is_empty() { Err(unknown(header, name)) } else { Ok(found) }
}

/// The column of this name, in any spelling.
pub(super) fn one(header: &[String], name: &str) -> Result<usize, String> {
    names::position(header, name).ok_or_else(|| unknown(header, name))
}

fn unknown(header: &[String], name: &str) -> String {
    format!("there is no column '{name}'; {}", names::instead(header, name, "columns:"))
}

/// Whether a name fits a pattern in which `*` stands for any text and `?` for one character.
fn fits(pattern: &str, name: &str) -> bool {
    let (pattern, name): (Vec<char>, Vec<char>) = (pattern.chars().collect(), name.chars().collect());
    // For each prefix of the name: whether the pattern so far fits it.
    let mut fits: Vec<bool> = (0..=name.len()).map(|length| length == 0).collect();
    for letter in pattern {
        let before = fits.clone();
        for length in 0..=name.len() {
            fits[length] = match letter {
                '*' => before[length] || (length > 0 && fits[length - 1]),
                '?' => length > 0 && before[length - 1],
                letter => length > 0 && before[length - 1] && name[length - 1] == letter,
            };
        }
    }
    fits[name.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn strings(names: &str) -> Vec<String> {
        names.split(' ').map(str::to_owned).collect()
    }

    #[test]
    fn a_column_of_times_is_known_by_its_name_with_or_without_a_unit() {
        for (name, unit) in [
            ("Time", None),
            ("%time", None),
            ("Datum", None),
            ("__time", None),
            (".header.stamp", None),
            ("time_ms", Some(Unit::Milliseconds)),
            ("Time [s]", Some(Unit::Seconds)),
            ("timestamp(ns)", Some(Unit::Nanoseconds)),
            ("t_us", Some(Unit::Microseconds)),
        ] {
            assert_eq!(time_name(name), Some(unit), "{name}");
        }
        assert_eq!(time_column(&strings("v /odom/header/stamp")), Some((1, None)));
        for name in ["time_to_goal", "step", "h_v", "time_of_day", "temperature", "dt_ms"] {
            assert_eq!(time_name(name), None, "{name}");
        }
    }

    #[test]
    fn columns_are_chosen_by_name_range_pattern_and_exclusion() {
        let header = strings("time h_v h_dg h_risk r_v");
        let chosen = |wanted: &str| chosen(&header, &strings(wanted), Some(0)).expect("is there");
        assert_eq!(chosen("h_dg h_v"), [2, 1]);
        assert_eq!(chosen("h_*"), [1, 2, 3]);
        assert_eq!(chosen("?_v"), [1, 4]);
        assert_eq!(chosen("h_dg..r_v"), [2, 3, 4]);
        assert_eq!(chosen("!r_*"), [1, 2, 3]);
        assert_eq!(chosen("h_* !h_dg"), [1, 3]);
        assert_eq!(chosen("*"), [1, 2, 3, 4]);
        assert_eq!(chosen("h_v +h_v +r_v +time"), [1, 4]);
    }

    #[test]
    fn a_choice_of_nothing_is_refused() {
        let header = strings("time h_v");
        for wanted in ["x_*", "h_w", "h_v h_v", "!h_v", "h_v..h_w"] {
            assert!(chosen(&header, &strings(wanted), Some(0)).is_err(), "{wanted}");
        }
    }
}
