//! Columns that are not variables by themselves: they count the rows, say when a row is, or whose it is. They are left out and
//! named; `--keep` has them.

use std::collections::HashSet;

use roscausal_core::batch::table::is_id;
use roscausal_discovery::{DataFrame, Named};

/// Rows from which a column that rises by one in each is a count, whatever its name is.
const LONG: usize = 30;

/// Names of columns that count rows or messages.
const COUNTERS: &str = "seq sequence index idx row rownum row_number frame frame_number";

/// Names of columns that say when a row is, with the least and the largest number.
const CALENDAR: [(&str, f64, f64); 11] = [
    ("year yr", 1000.0, 3000.0),
    ("quarter", 1.0, 4.0),
    ("month mnth mo", 1.0, 12.0),
    ("week", 0.0, 53.0),
    ("day", 0.0, 31.0),
    ("dayofweek day_of_week weekday dow", 0.0, 7.0),
    ("dayofyear day_of_year doy", 0.0, 366.0),
    ("hour hr", 0.0, 24.0),
    ("minute", 0.0, 60.0),
    ("secs sec", 0.0, 4e9),
    ("nsecs nanosec nanoseconds", 0.0, 1e9),
];

/// What such a column says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Says {
    Row,
    When,
    Whose,
}

/// The columns that are not variables, and what to tell of them; none if fewer than two others would be left.
pub(super) fn aside(data: &DataFrame, kept: impl Fn(&str) -> bool) -> Option<(Vec<usize>, String)> {
    let of = |var: usize| says(data, var).filter(|_| !kept(&data.var_names()[var])).map(|says| (says, var));
    let mut found: Vec<(Says, usize)> = (0..data.n_vars()).filter_map(of).collect();
    if found.is_empty() || data.n_vars() < found.len() + 2 {
        return None;
    }
    found.sort_unstable();
    let reported = found.chunk_by(|a, b| a.0 == b.0).map(|group| {
        let names: Vec<&str> = group.iter().map(|(_, var)| data.var_names()[*var].as_str()).collect();
        let (names, s) = (names.join(", "), if names.len() == 1 { "s" } else { "" });
        match group[0].0 {
            Says::Row => format!("{names} count{s} the rows"),
            Says::When => format!("{names} say{s} when a row is"),
            Says::Whose => {
                format!("{names} say{s} whose a row is, which --recording {names} makes recordings of")
            }
        }
    });
    let reported = reported.collect::<Vec<_>>().join("; ");
    Some((
        found.into_iter().map(|(_, var)| var).collect(),
        format!("no variable by itself ({reported}; --keep has it)"),
    ))
}

/// Why the rows are not one after the other: they are of several at a time, one below the other. A column of that time stands still while an
/// `id` is another one in each row, and the same ones come again. Without names, these are the first two columns.
pub(super) fn interleaved(data: &DataFrame, kept: impl Fn(&str) -> bool) -> Option<String> {
    const FEWEST: usize = 3;
    let (rows, names) = (data.recordings().first()?, data.var_names());
    let is_nameless = |column: usize| ["x_0", "x_1"].contains(&names[column].as_str());
    let ids = (0..names.len()).filter(|&id| (is_id(&names[id]) || is_nameless(id)) && !kept(&names[id]));
    let mut pairs =
        ids.flat_map(|id| (0..names.len()).filter(move |time| *time != id).map(move |time| (id, time)));
    let different =
        |column: usize| rows.column(column).iter().map(|v| v.to_bits()).collect::<HashSet<_>>().len();
    let is_so = |&(id, time): &(usize, usize)| {
        let (nameless, of_id) = (is_nameless(id), id);
        if nameless && (!is_nameless(time) || kept(&names[time])) {
            return false;
        }
        let (id, time) = (rows.column(id), rows.column(time));
        let later = || time.iter().zip(time.iter().skip(1));
        let times = 1 + later().filter(|(a, b)| a < b).count();
        if times <= FEWEST || FEWEST * times > 2 * rows.nrows() || !later().all(|(a, b)| a <= b) {
            return false;
        }
        let different = different(of_id);
        // Years and months, or cells of a grid, have each pair.
        if nameless && times * different < rows.nrows() + different {
            return false;
        }
        let mut seen = HashSet::new();
        let mut are_new = id.iter().zip(time).map(|(id, time)| seen.insert([id.to_bits(), time.to_bits()]));
        FEWEST * different <= rows.nrows() && are_new.all(|is_new| is_new)
    };
    let (mut id, mut time) = pairs.find(is_so)?;
    // Sorted by person; frames are more.
    if is_nameless(id) && different(time) < different(id) {
        std::mem::swap(&mut id, &mut time);
    }
    let (id, time, recording, format) = (&names[id], &names[time], Named("recording"), Named("format"));
    Some(format!(
        "rows of the same {time} are of several {id}, one below the other: {recording} {id} makes a recording of each, and \
         {format} trajectories variables of people; {} {id} takes the rows one after the other",
        Named("keep")
    ))
}

fn says(data: &DataFrame, var: usize) -> Option<Says> {
    let columns = || data.recordings().iter().map(|rows| rows.column(var));
    let rows: usize = columns().map(|column| column.len()).sum();
    let values = || columns().flatten().copied();
    if !values().all(f64::is_finite) || rows < 3 {
        return None;
    }
    let name = data.var_names()[var].trim().to_lowercase();
    let last = name.rsplit(['.', '/']).next().unwrap_or_default().to_owned();
    let is_in = |names: &str| names.split(' ').any(|name| name == last);
    let whole = values().all(|value| value.fract() == 0.0);
    let steps = || {
        columns().flat_map(|column| column.into_iter().zip(column.into_iter().skip(1)).map(|(a, b)| b - a))
    };
    let rises = steps().all(|step| step > 0.0);
    let least = values().fold(f64::INFINITY, f64::min);
    let most = values().fold(f64::NEG_INFINITY, f64::max);
    let is_calendar = CALENDAR.iter().any(|&(names, from, to)| is_in(names) && from <= least && most <= to);
    // Times since 1970 in s, ms, us or ns, of this century.
    let is_stamp = rises && [1.0, 1e3, 1e6, 1e9].iter().any(|per| 9e8 * per < least && most < 4e9 * per);
    let is_clock = rises && ["time", "stamp", "zeit", "clock"].iter().any(|word| last.contains(word));
    if (whole && is_calendar) || ((is_stamp || is_clock) && rows >= LONG) {
        return Some(Says::When);
    }
    // A count may begin anew, a few times; where its numbers were rounded, steps differ by that.
    let first = steps().next().unwrap_or_default();
    let is_even = |step: f64| (step - first).abs() <= 1e-6 * first + 4.0 * f64::EPSILON * most.abs();
    let anew = steps().filter(|step| !is_even(*step)).count();
    let back = |step: f64| is_even(step) || (step - (least - most)).abs() <= first;
    let counts = first > 0.0 && 20 * anew <= rows && steps().all(back);
    if (whole && rises && is_in(COUNTERS)) || (rows >= LONG && counts) {
        return Some(Says::Row);
    }
    if !whole || !is_id(&last) {
        return None;
    }
    // Each value in rows of its own, which follow one another.
    let mut different: Vec<f64> = values().collect();
    let changes = different.windows(2).filter(|pair| pair[0] != pair[1]).count();
    different.sort_by(f64::total_cmp);
    different.dedup();
    let in_blocks = changes + 1 == different.len() && different.len() > 1 && different.len() * 3 <= rows;
    in_blocks.then_some(Says::Whose)
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;

    fn left_out(name: &str, value: impl Fn(usize) -> f64) -> Option<String> {
        let rows =
            Array2::from_shape_fn(
                (60, 3),
                |(t, v)| if v == 0 { value(t) } else { ((t * t * (v + 3)) % 101) as f64 },
            );
        let data = DataFrame::new(vec![rows], vec![name.into(), "a".into(), "b".into()]).expect("three");
        let found = aside(&data, |name| name == "kept");
        found.map(|(vars, reported)| {
            assert_eq!(vars, [0], "{reported}");
            reported
        })
    }

    /// A column by its row.
    type Value = Box<dyn Fn(usize) -> f64>;

    #[test]
    fn what_counts_rows_or_says_when_or_whose_is_no_variable() {
        let cases: [(&str, Value, &str); 11] = [
            ("Zeit", Box::new(|t| 0.1 * t as f64), "when a row is"),
            ("x0", Box::new(|t| 0.1 * t as f64), "counts the rows"),
            ("step", Box::new(|t| (t % 30) as f64), "counts the rows"),
            ("recv_time", Box::new(|t| 0.1 * t as f64 + 1e-3 * (t * t % 7) as f64), "when a row is"),
            ("field.header.seq", Box::new(|t| (7 + t) as f64), "counts the rows"),
            ("anything", Box::new(|t| (7 + t) as f64), "counts the rows"),
            (
                "field.header.stamp",
                Box::new(|t| 1.7e18 + 1e8 * (t as f64 + 0.3 * f64::from(t % 3 == 0))),
                "when a row is",
            ),
            ("Year", Box::new(|t| (1980 + t / 12) as f64), "when a row is"),
            ("month", Box::new(|t| (1 + t % 12) as f64), "when a row is"),
            ("hour", Box::new(|t| (t % 24) as f64), "when a row is"),
            ("id", Box::new(|t| (1 + t / 15) as f64), "--recording id"),
        ];
        for (name, value, reported) in cases {
            assert!(left_out(name, value).is_some_and(|stated| stated.contains(reported)), "{name}");
        }
    }

    #[test]
    fn rows_of_several_at_a_time_are_refused_unless_they_are_kept() {
        let of = |names: [&str; 3], at: fn(usize) -> [f64; 2]| {
            let rows =
                Array2::from_shape_fn((60, 3), |(t, v)| if v < 2 { at(t)[v] } else { (t * t % 101) as f64 });
            interleaved(
                &DataFrame::new(vec![rows], names.map(str::to_owned).to_vec()).expect("three"),
                |name| name == "kept_id",
            )
        };
        let crowd = |t: usize| [(10 * (t / 4)) as f64, (7 + t % 4) as f64];
        let reported = of(["frame", "ped_id", "a"], crowd).expect("a crowd");
        assert!(reported.contains("same frame") && reported.contains("ped_id"), "{reported}");
        assert_eq!(of(["frame", "kept_id", "a"], crowd), None);
        // Without names: people who come and go, in either order of the columns; years with their months.
        let walks = |t: usize| [(10 * (t / 4)) as f64, (t / 12 + t % 4) as f64];
        for names in [["x_0", "x_1", "x_2"], ["x_1", "x_0", "x_2"]] {
            assert!(of(names, walks).is_some_and(|reported| reported.contains("trajectories")));
        }
        assert_eq!(of(["x_0", "x_1", "x_2"], |t| [(t / 12) as f64, (t % 12) as f64]), None);
        assert_eq!(of(["x_1", "x_2", "x_3"], walks), None);
        assert_eq!(of(["year", "month", "a"], |t| [(t / 12) as f64, (t % 12) as f64]), None);
        assert_eq!(of(["seq", "id", "a"], |t| [t as f64, (t % 3) as f64]), None, "one at a time");
        assert_eq!(
            of(["gear", "track", "a"], |t| [(t / 10) as f64, (t * 7 % 5) as f64]),
            None,
            "comes twice"
        );
    }

    #[test]
    fn variables_stay_whatever_they_are_called() {
        let cases: [(&str, Value); 6] = [
            ("kept", Box::new(|t| t as f64)),
            ("month", Box::new(|t| (t % 12) as f64 + 0.5)),
            ("position", Box::new(|t| 0.1 * t as f64 + 1e-3 * (t * t % 7) as f64)),
            ("id", Box::new(|t| (t % 3) as f64)),
            ("hour", Box::new(|t| (t * 37 % 101) as f64)),
            ("gear", Box::new(|t| (t / 20) as f64)),
        ];
        for (name, value) in cases {
            assert_eq!(left_out(name, value), None, "{name}");
        }
    }
}
