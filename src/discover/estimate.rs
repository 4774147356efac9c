//! Whether an analysis can end on this machine. One that cannot is refused before it starts, with what would fit.

use roscausal_core::{Error, Result, memory::Memory};
use roscausal_discovery::{
    DataFrame, Effort, Settings,
    confidence::{Resampling, Scheme},
};

use super::MeansArgs;

/// An analysis that takes longer than this is refused, unless a time budget ends it.
const LONGEST_S: f64 = 86_400.0;
/// An analysis that takes longer than this is announced.
const WORTH_TELLING_S: f64 = 20.0;

/// Refuses an analysis that cannot end; returns what to tell of one that takes a while.
///
/// # Errors
/// An analysis that needs more memory than there is (or `--max-memory` allows), or more than a day without `--time-budget`.
pub(super) fn check(
    data: &DataFrame,
    settings: &Settings,
    resampling: Option<&Resampling>,
    means: &MeansArgs,
) -> Result<Option<String>> {
    let n = data.recordings().iter().map(|recording| recording.nrows()).sum();
    let effort = Effort::of(n, data.n_vars(), settings);
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let threads = means.threads.filter(|&threads| threads > 0).unwrap_or(cores);
    let runs = 1.0 + resampling.map_or(0.0, part_of_resamples);
    let seconds = effort.seconds * runs / threads as f64;
    let available = Memory::of(means.max_bytes()).bytes() as f64;
    let longest = if means.time_budget.is_some() { f64::INFINITY } else { LONGEST_S };
    if effort.bytes <= available && seconds <= longest {
        let reported = format!("this will take about {}, with {}", duration(seconds), size(effort.bytes));
        return Ok((seconds > WORTH_TELLING_S).then_some(reported));
    }
    let most = Effort::most_samples(data.n_vars(), settings, available, longest * threads as f64 / runs);
    let what = if effort.bytes > available {
        format!("{} of memory, and {} are free", size(effort.bytes), size(available))
    } else {
        format!("about {}", duration(seconds))
    };
    let fewer = match round_down(most) {
        0 => "a lower --tau-max".to_owned(),
        rows => format!("fewer rows (at most {rows}: a window with --rows, a longer step with --dt)"),
    };
    let linear = if most == 0 || matches!(settings.cond_ind_test.as_str(), "parcorr" | "robustparcorr") {
        "fewer columns (--columns)"
    } else {
        "--test parcorr or robustparcorr, which take any number of rows"
    };
    let (method, test) = (settings.method.name().to_uppercase(), &settings.cond_ind_test);
    Err(Error::Data(format!(
        "{method} with {test} on {n} rows of {} variables would take {what}; what would fit: {linear}, or {fewer}",
        data.n_vars()
    )))
}

/// The time of all resamples, in analyses of all rows: a subsample has fewer, and time grows about as `n^1.6`.
fn part_of_resamples(resampling: &Resampling) -> f64 {
    let share = if resampling.scheme == Scheme::Subsample { resampling.share } else { 1.0 };
    resampling.resamples as f64 * share.powf(1.6)
}

/// `3 minutes`, `5 hours`, `120 years`.
fn duration(seconds: f64) -> String {
    let units =
        [("year", 31_557_600.0), ("day", 86_400.0), ("hour", 3600.0), ("minute", 60.0), ("second", 1.0)];
    let (unit, length) =
        units.into_iter().find(|(_, length)| seconds >= 1.5 * length).unwrap_or(("second", 1.0));
    let count = (seconds / length).round().max(1.0);
    format!("{count} {unit}{}", if count == 1.0 { "" } else { "s" })
}

/// `300 MB`, `18 TB`.
fn size(bytes: f64) -> String {
    let (unit, length) =
        [("TB", 1e12), ("GB", 1e9)].into_iter().find(|(_, length)| bytes >= *length).unwrap_or(("MB", 1e6));
    let count = bytes / length;
    if count < 10.0 { format!("{count:.1} {unit}") } else { format!("{count:.0} {unit}") }
}

/// To two digits: the estimate is rough.
fn round_down(count: usize) -> usize {
    let digits = count.max(1).ilog10().saturating_sub(1);
    count / 10_usize.pow(digits) * 10_usize.pow(digits)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_sizes_and_counts_are_read_at_a_glance() {
        assert_eq!([0.2, 80.0, 7200.0, 1e9].map(duration), ["1 second", "80 seconds", "2 hours", "32 years"]);
        assert_eq!([3e6, 2.5e9, 1.8e13].map(size), ["3.0 MB", "2.5 GB", "18 TB"]);
        assert_eq!([0, 7, 4567, 123_456].map(round_down), [0, 7, 4500, 120_000]);
    }
}
