//! Sample times: their units, and dates.

use chrono::{DateTime, Datelike, NaiveDate, NaiveDateTime, NaiveTime};
use roscausal_discovery::Named;

use super::steps::{DAY, median_step};

/// The unit of a column of times.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// `s`
    Seconds,
    /// `ms`
    Milliseconds,
    /// `us`
    Microseconds,
    /// `ns`
    Nanoseconds,
    /// `min`
    Minutes,
    /// `h`
    Hours,
    /// `d`
    Days,
}

impl Unit {
    /// Units in a second.
    pub fn per_second(self) -> f64 {
        match self {
            Self::Seconds => 1.0,
            Self::Milliseconds => 1e3,
            Self::Microseconds => 1e6,
            Self::Nanoseconds => 1e9,
            Self::Minutes => 1.0 / 60.0,
            Self::Hours => 1.0 / 3600.0,
            Self::Days => 1.0 / DAY,
        }
    }
}

roscausal_discovery::words!(
    Unit, "time_unit":
    Seconds "s" | "sec" | "secs" | "seconds",
    Milliseconds "ms" | "msec" | "millis" | "milliseconds",
    Microseconds "us" | "µs" | "usec" | "micros" | "microseconds",
    Nanoseconds "ns" | "nsec" | "nanos" | "nanoseconds",
    Minutes "min" | "mins" | "minutes",
    Hours "h" | "hr" | "hrs" | "hours",
    Days "d" | "day" | "days"
);

/// Times in seconds, and what to tell about their unit. `known` is the unit if the user or the header says it.
///
/// Without it: numbers since 1970 tell it by their size; of others, whole numbers in steps of a million and more are
/// nanoseconds, and the rest are seconds.
pub(crate) fn in_seconds(mut time: Vec<f64>, known: Option<Unit>) -> (Vec<f64>, Option<String>) {
    if known.is_none()
        && let Some(dates) = dates(&time)
    {
        return (dates, Some("times are taken as dates, such as 20261124 or 202611".to_owned()));
    }
    let sheet =
        SHEETS.into_iter().find(|first| time.iter().all(|t| (0.0..UNTIL_2100).contains(&(t - first))));
    let (unit, reported) = known.map_or_else(|| guessed(&time, sheet), |unit| (unit, None));
    if let (Unit::Days, Some(first)) = (unit, sheet) {
        // To a millisecond: that is what their digits hold.
        time.iter_mut().for_each(|t| *t = ((*t - first) * DAY * 1e3).round() / 1e3);
    } else if unit != Unit::Seconds {
        // The first time is taken off before the division, so that steps keep their digits.
        let (first, per) = (time.first().copied().unwrap_or(0.0), unit.per_second());
        time.iter_mut().for_each(|t| *t = (*t - first) / per + first / per);
    }
    (time, reported)
}

/// Numbers that are all days, `20261124`, or months, `202611`, of years from 1500 to 2199, in seconds since 1970.
fn dates(time: &[f64]) -> Option<Vec<f64>> {
    let of = |number: f64| {
        let whole = (number.fract() == 0.0 && number < 3e7).then_some(number as u32)?;
        let day = if whole < 1_000_000 { 100 * whole + 1 } else { whole };
        let date = NaiveDate::from_ymd_opt((day / 10_000) as i32, day / 100 % 100, day % 100)?;
        (1500..2200).contains(&date.year()).then(|| begins(date))
    };
    if time.len() < 3 { None } else { time.iter().map(|number| of(*number)).collect() }
}

/// When a day begins, in seconds since 1970.
fn begins(day: NaiveDate) -> f64 {
    day.and_time(NaiveTime::MIN).and_utc().timestamp() as f64
}

/// 1970 as days of spreadsheets, and of MATLAB: numbers from there to 2100 may be these.
const SHEETS: [f64; 2] = [25_569.0, 719_529.0];
const UNTIL_2100: f64 = 47_482.0;
/// Steps of a clock, seconds.
const CLOCK: [f64; 12] = [1.0, 2.0, 5.0, 10.0, 15.0, 30.0, 60.0, 300.0, 600.0, 900.0, 1800.0, 3600.0];

/// The unit of whole numbers in a column that is called a date, if they may be days of a spreadsheet.
pub(super) fn unit_of_date(name: &str, time: &[f64]) -> Option<Unit> {
    let is_day = |t: &f64| t.fract() == 0.0 && (0.0..UNTIL_2100).contains(&(t - SHEETS[0]));
    (name.to_lowercase().contains("date") && time.iter().all(is_day)).then_some(Unit::Days)
}

/// `sheet`: they may be days of a spreadsheet.
fn guessed(time: &[f64], sheet: Option<f64>) -> (Unit, Option<String>) {
    let first = time.first().copied().unwrap_or(0.0).abs();
    // From 1973 to 5138 in each unit.
    let since_1970 = [Unit::Seconds, Unit::Milliseconds, Unit::Microseconds, Unit::Nanoseconds];
    if let Some(unit) = since_1970.into_iter().find(|unit| (1e8..1e11).contains(&(first / unit.per_second())))
    {
        let reported =
            (unit != Unit::Seconds).then(|| format!("times are taken as {} since 1970", unit.name()));
        return (unit, reported);
    }
    let whole = time.iter().all(|t| t.fract() == 0.0);
    let span = time.last().copied().unwrap_or(0.0) - time.first().copied().unwrap_or(0.0);
    let step = span / (time.len().max(2) - 1) as f64;
    let otherwise = Named("time_unit");
    if let Some(first) = sheet.filter(|_| time.len() > 2) {
        // As days they are whole seconds at the steps of a clock, or at less than one.
        let seconds = median_step(time).unwrap_or(step) * DAY;
        let is_whole = |t: &f64| ((t - first) * DAY - ((t - first) * DAY).round()).abs() < 0.05;
        let is_step = CLOCK.into_iter().any(|of| (seconds / of - 1.0).abs() < 0.01);
        if (1e-9..0.99).contains(&seconds) || (is_step && time.iter().all(is_whole)) {
            return (Unit::Days, Some(format!("times are taken as days ({otherwise} says otherwise)")));
        }
        if whole && step < 5.0 {
            return (Unit::Seconds, Some(format!("times are taken as seconds ({otherwise} says otherwise)")));
        }
    }
    if whole && step >= 1e6 {
        let reported = format!(
            "times are taken as nanoseconds, by the size of their steps ({otherwise} says otherwise)"
        );
        return (Unit::Nanoseconds, Some(reported));
    }
    let reported = (whole && step >= 5.0).then(|| {
        format!("times are taken as seconds, in steps of about {step:.0} ({otherwise} says otherwise)")
    });
    (Unit::Seconds, reported)
}

/// A stamp in units of which `per_second` make a second, in seconds: whole seconds and the rest apart, so that no digit is lost
/// that a number of seconds can hold.
pub(super) fn split_seconds(stamp: i64, per_second: f64) -> f64 {
    if per_second < 1.0 {
        return stamp as f64 / per_second;
    }
    let per = per_second as i64;
    stamp.div_euclid(per) as f64 + stamp.rem_euclid(per) as f64 / per_second
}

/// A date and time in seconds since 1970, or a time of day in seconds since midnight. ISO 8601, with or without a zone (then
/// UTC): `2026-11-24T08:30:00.25+01:00`, `2026-11-24 08:30:00`, `2026-11-24`, `08:30:00.25`, `20261124T083000Z`; also `2026/11/24`,
/// `24.11.2026` and `24-Nov-2026` with the day first, `08:30:00 PM`, a month, `1974-01`, `1974M01` or `Jan-1974`, and a quarter, `1974Q1`. What may be day or month, such as `01/02/2026`, is none.
pub(crate) fn date(text: &str) -> Option<f64> {
    let text = text.trim();
    if let Some((year, quarter)) = text.split_once('Q') {
        return quarter_begins(year.trim_end_matches(['-', ' ']), quarter);
    }
    if let Some(month) = month(text) {
        return Some(begins(month));
    }
    let dots = text.bytes().filter(|byte| *byte == b'.').count();
    if !(text.contains([':', '-', '/', 'T']) || dots == 2)
        || !text.starts_with(|letter: char| letter.is_ascii_digit())
    {
        return None;
    }
    let seconds = |whole: i64, nanoseconds: u32| whole as f64 + f64::from(nanoseconds) * 1e-9;
    let zoned = |format: &&str| DateTime::parse_from_str(text, format).ok();
    let with_zone =
        ["%F %T%.f%#z", "%FT%T%.f%#z", "%F %T%.f %#z", "%Y%m%dT%H%M%S%.f%#z", "%F %H:%M%#z", "%FT%H:%M%#z"];
    let zoned = DateTime::parse_from_rfc3339(text).ok().or_else(|| with_zone.iter().find_map(zoned));
    if let Some(zoned) = zoned {
        return Some(seconds(zoned.timestamp(), zoned.timestamp_subsec_nanos()));
    }
    let text = text.trim_end_matches('Z').trim_end_matches(" UTC");
    let formats = [
        "%FT%T%.f", "%F %T%.f", "%Y/%m/%d %T%.f", "%F %H:%M", "%FT%H:%M", "%Y/%m/%d %H:%M", "%d.%m.%Y %T%.f",
        "%d.%m.%Y %H:%M", "%d-%b-%Y %T%.f", "%d-%b-%Y %H:%M", "%Y%m%dT%H%M%S%.f", "%Y%m%dT%H%M",
        "%F %I:%M:%S%.f %p", "%F %I:%M %p", "%Y/%m/%d %I:%M %p",
    ];
    for format in formats.into_iter().chain(["%Y/%m/%d %I:%M:%S%.f %p", "%d.%m.%Y %I:%M:%S%.f %p"]) {
        if let Some(found) = NaiveDateTime::parse_from_str(text, format).ok().filter(has_year) {
            let found = found.and_utc();
            return Some(seconds(found.timestamp(), found.timestamp_subsec_nanos()));
        }
    }
    let day = ["%Y-%m-%d", "%Y/%m/%d", "%d.%m.%Y", "%d-%b-%Y"]
        .into_iter()
        .find_map(|format| NaiveDate::parse_from_str(text, format).ok().filter(has_year));
    if let Some(day) = day {
        return Some(begins(day));
    }
    let of_day = ["%H:%M:%S%.f", "%I:%M:%S%.f %p", "%I:%M %p"]
        .into_iter()
        .find_map(|format| NaiveTime::parse_from_str(text, format).ok())?;
    Some(of_day.signed_duration_since(NaiveTime::MIN).num_nanoseconds()? as f64 * 1e-9)
}

/// The first day of a month: `1974-01`, `1974M01`, `Jan-1974`. What has the signs of a longer date is not looked at: there are many.
fn month(text: &str) -> Option<NaiveDate> {
    if text.contains([':', '/', '.']) || text.matches('-').count() > 1 {
        return None;
    }
    let first = format!("{text}-01");
    let of = |format: &str| NaiveDate::parse_from_str(&first, format).ok().filter(has_year);
    ["%Y-%m-%d", "%YM%m-%d", "%b-%Y-%d", "%b %Y-%d"].into_iter().find_map(of)
}

/// When a quarter of a year begins, in seconds since 1970.
fn quarter_begins(year: &str, quarter: &str) -> Option<f64> {
    let month = 3 * ["1", "2", "3", "4"].iter().position(|known| *known == quarter)? as u32 + 1;
    Some(begins(NaiveDate::from_ymd_opt(year.parse().ok()?, month, 1).filter(has_year)?))
}

/// Whether the year has four digits: 1.2.3 is a version.
fn has_year(date: &impl Datelike) -> bool {
    (1000..10_000).contains(&date.year())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_unit_of_times_since_1970_is_their_size() {
        for per in [1.0, 1e3, 1e6, 1e9] {
            let start = 1_464_818_234.0;
            let time: Vec<f64> = (0..5).map(|i| (start + 0.25 * f64::from(i)) * per).collect();
            let (found, reported) = in_seconds(time, None);
            assert!((found[4] - found[0] - 1.0).abs() < 1e-6 && (found[0] - start).abs() < 1e-3, "{per}");
            assert_eq!(reported.is_some(), per > 1.0);
        }
    }

    #[test]
    fn steps_of_a_million_are_nanoseconds_and_the_user_has_the_last_word() {
        // Rounded, so that 0.1 * 3 is 0.3.
        let time = |step: f64| (0..5).map(|i| (step * f64::from(i) * 1e6).round() / 1e6).collect::<Vec<_>>();
        assert_eq!(in_seconds(time(1e8), None).0, time(0.1));
        assert_eq!(in_seconds(time(100.0), None).0, time(100.0));
        assert!(
            in_seconds(time(100.0), None)
                .1
                .is_some_and(|reported| reported.contains(&Named("time_unit").to_string()))
        );
        assert_eq!(in_seconds(time(100.0), Some(Unit::Milliseconds)), (time(0.1), None));
        assert_eq!(in_seconds(time(0.1), None), (time(0.1), None));
    }

    #[test]
    fn days_of_a_spreadsheet_are_known_by_their_steps_or_by_the_name() {
        let days = |first: f64, step: f64, digits: usize| -> Vec<f64> {
            (0..40).map(|k| format!("{:.digits$}", first + step * f64::from(k)).parse().unwrap()).collect()
        };
        for (step, digits) in [(1800.0, 8), (60.0, 6), (1.0, 10), (0.1, 9), (3600.0, 8)] {
            for first in [45123.5, 739_000.25] {
                let (time, told) = in_seconds(days(first, step / DAY, digits), None);
                assert!((time[39] - time[0] - 39.0 * step).abs() < 0.2, "{step} {}", time[39] - time[0]);
                assert!(told.is_some_and(|told| told.contains("as days")), "{step}");
            }
        }
        // 2023-07-16, a Sunday.
        assert_eq!(in_seconds(days(45123.0, 1.0, 0), Some(Unit::Days)).0[0], 1_689_465_600.0);
        assert_eq!(in_seconds(vec![0.0, 0.5, 1.0], Some(Unit::Days)).0, [0.0, DAY / 2.0, DAY]);
        assert_eq!(unit_of_date("Date", &days(45123.0, 1.0, 0)), Some(Unit::Days));
        assert_eq!(unit_of_date("time", &days(45123.0, 1.0, 0)), None);
        // Clocks of that many seconds: 10, 100 and 2000 Hz, 24 Hz of a clock with thousandths, one a second.
        for (first, step, digits) in [
            (45123.5, 0.1, 3),
            (30000.0, 0.01, 3),
            (30000.0, 0.0005, 4),
            (45123.517, 1.0 / 24.0, 6),
            (45123.0, 1.0, 0),
        ] {
            let time = days(first, step, digits);
            assert_eq!(in_seconds(time.clone(), None).0, time, "{step}");
        }
    }

    #[test]
    fn numbers_that_are_all_dates_are_dates() {
        let day = 86400.0;
        assert_eq!(
            in_seconds(vec![19700131.0, 19700201.0, 19700202.0], None).0,
            [30.0 * day, 31.0 * day, 32.0 * day]
        );
        assert_eq!(in_seconds(vec![197001.0, 197002.0, 197003.0], None).0, [0.0, 31.0 * day, 59.0 * day]);
        // A day that there is not, or a unit that is known: numbers.
        for (last, known) in [(19700230.0, None), (19700203.0, Some(Unit::Seconds))] {
            let time = vec![19700131.0, 19700201.0, last];
            assert_eq!(in_seconds(time.clone(), known).0, time);
        }
    }

    #[test]
    fn dates_with_and_without_a_zone_are_seconds_since_1970() {
        for (text, seconds) in [
            ("1970-01-01T00:00:01Z", 1.0),
            ("1970-01-01 01:00:01.5+01:00", 1.5),
            ("1970-01-01T01:00:01.5+0100", 1.5),
            ("1970-01-01 01:01+01:00", 60.0),
            ("1970-01-01T01:01Z", 3660.0),
            ("1970-01-01 00:01:00", 60.0),
            ("1970/01/02 00:00:00", 86400.0),
            ("1970-01-02", 86400.0),
            ("1970/01/02", 86400.0),
            ("1970/1/2 00:01", 86460.0),
            ("2.1.1970", 86400.0),
            ("02-Jan-1970", 86400.0),
            ("2-jan-1970 00:01:00.5", 86460.5),
            ("02.01.1970 00:00:01.5", 86401.5),
            ("00:00:02.25", 2.25),
            ("1970Q2", 90.0 * 86400.0),
            ("1970-Q1", 0.0),
            ("1970-02", 31.0 * 86400.0),
            ("1970M02", 31.0 * 86400.0),
            ("Feb-1970", 31.0 * 86400.0),
            ("Feb 1970", 31.0 * 86400.0),
            ("19700102T000001Z", 86401.0),
            ("19700102T010001.5+0100", 86401.5),
            ("19700102T000001.5", 86401.5),
            ("19700102T0001", 86460.0),
            ("1970-01-02 12:00:01 AM", 86401.0),
            ("1970/01/01 12:01 pm", 43260.0),
            ("2.1.1970 01:00:00 PM", 133_200.0),
            ("1:00:02 PM", 46802.0),
            ("12:30 AM", 1800.0),
        ] {
            assert_eq!(date(text), Some(seconds), "{text}");
        }
        for text in [
            "", "1.5", "-3", "walk-fast", "3T", "20261124", "13:00 PM", "12:30", "01/02/1970 00:00:00",
            "01-02-1970", "1.2.3", "31.31.1970", "0.1.0", "1970Q5", "Q1",
        ] {
            assert_eq!(date(text), None, "{text}");
        }
    }
}
