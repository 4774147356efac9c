//! Dependence that changes within a recording: a cheap look before the analysis.
//!
//! 1. What a variable's own last value tells is taken out of it; values beyond three deviations count as three.
//! 2. The products of what is left, of a cause and of an effect `lag` rows later, have one mean while nothing changes. Their cumulated
//!    sum about the mean says whether they have (KPSS statistic with the long-run variance about the two parts' own means), and is
//!    farthest from 0 where they change.
//! 3. A change is reported where it is there beyond chance for all that are looked at, and the correlations of both parts differ much.
//!
//! Source: Kwiatkowski, Phillips, Schmidt and Shin 1992, Journal of Econometrics 54; the tail of its law is that of Cramer and von Mises.
//!
//! Example: people smile after a voice in the first half of a recording, and stop smiling after it in the second. Over the whole no
//! dependence is left; here the two halves are seen.

use serde::{Deserialize, Serialize};

use crate::{
    numeric::rows::{centred, cumulated, dot, long_run_variance, moments},
    types::{DataFrame, Named, names::plain, time_in_words},
};

/// Fewer rows than this are not looked at, more not either.
const ROWS: [usize; 2] = [200, 20_000];
/// The statistic has 1 % above the first, and a tenth of it more for each second.
const KPSS_1_PERCENT: f64 = 0.743;
const KPSS_DECADE: f64 = 0.467;
/// The level for all pairs and lags together.
const LEVEL: f64 = 0.001;
/// Least difference of the two correlations.
const LEAST: f64 = 0.3;
/// A part has this share of the rows at least.
const SHORTEST: f64 = 0.1;
/// Farther values count as so many standard deviations.
const FAR: f64 = 3.0;

/// A dependence that is another one from some row on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Unsteady {
    /// Name of the earlier variable.
    pub cause: String,
    /// Name of the later one.
    pub effect: String,
    /// Steps between them.
    pub lag: usize,
    /// The last row of the first part; rows count from 1.
    pub row: usize,
    /// The rows that were looked at.
    pub rows: usize,
    /// Correlation up to that row, of what the variables' own past does not tell.
    pub before: f64,
    /// The same behind it.
    pub after: f64,
}

impl Unsteady {
    /// The largest change of each pair at lags up to `tau_max`, largest first; none where several recordings are pooled.
    pub fn of(data: &DataFrame, tau_max: usize) -> Vec<Self> {
        let [recording] = data.recordings() else { return Vec::new() };
        let rows = recording.nrows().min(ROWS[1]);
        if rows < ROWS[0] {
            return Vec::new();
        }
        let fresh: Vec<Fresh> = (0..data.n_vars())
            .map(|var| own_past_taken_out(recording.column(var).iter().take(rows).copied()))
            .collect();
        let n = fresh.len();
        let pairs =
            (0..n).flat_map(|cause| (0..n).map(move |effect| (cause, effect))).filter(|(a, b)| a != b);
        let tests = (n * n.saturating_sub(1) * tau_max) as f64;
        let critical = KPSS_1_PERCENT + KPSS_DECADE * libm::log10(0.01 * tests / LEVEL);
        let of_pair = |(cause, effect): (usize, usize)| {
            let changes = (1..=tau_max.min(rows / 4))
                .filter_map(|lag| change(&fresh[cause], &fresh[effect], lag, critical));
            let (lag, row, before, after) =
                changes.max_by(|a, b| (a.2 - a.3).abs().total_cmp(&(b.2 - b.3).abs()))?;
            let [cause, effect] = [cause, effect].map(|var| plain(&data.var_names()[var]));
            Some(Self { cause, effect, lag, row, rows, before, after })
        };
        let mut found: Vec<Self> = pairs.filter_map(of_pair).collect();
        found.sort_by(|a, b| (b.before - b.after).abs().total_cmp(&(a.before - a.after).abs()));
        found
    }

    /// The largest change in a sentence, with the step between rows in seconds.
    pub fn found(found: &[Self], dt: Option<f64>) -> Option<String> {
        let Self { cause, effect, lag, row, before, after, .. } = found.first()?;
        let others = match found.len() - 1 {
            0 => String::new(),
            1 => "; 1 more pair changes".to_owned(),
            more => format!("; {more} more pairs change"),
        };
        let at = dt.map_or(String::new(), |dt| format!(" ({})", time_in_words(dt, *row)));
        Some(format!(
            "How {effect} depends on {cause} changes after row {row}{at}: correlation {before:.2} before, {after:.2} after, at lag \
             {lag}{others}"
        ))
    }

    /// The way out.
    pub fn way_out(found: &[Self]) -> Option<String> {
        let Self { row, rows, .. } = found.first()?;
        Some(format!("Analyse the parts alone: {} 1..{row}, then {}..{rows}", Named("rows"), row + 1))
    }

    /// The same, and the way out.
    pub fn reported(found: &[Self], dt: Option<f64>) -> Option<String> {
        Some(format!("{}. {}", Self::found(found, dt)?, Self::way_out(found)?))
    }
}

/// What the last value of a variable does not tell of the next, in standard deviations; 0 where it is not known.
struct Fresh {
    values: Vec<f64>,
    is_known: Vec<bool>,
}

fn own_past_taken_out(column: impl Iterator<Item = f64>) -> Fresh {
    let values: Vec<f64> = column.collect();
    let there: Vec<f64> = values.iter().copied().filter(|value| !value.is_nan()).collect();
    let (mean, deviation) = moments(&there);
    let or_0 = |value: f64| if value.is_nan() { 0.0 } else { value };
    let even: Vec<f64> = values.iter().map(|value| or_0((value - mean) / deviation)).collect();
    let slope = or_0(dot(&even[1..], &even[..even.len() - 1]) / dot(&even, &even));
    let is_known: Vec<bool> =
        (0..values.len()).map(|row| row > 0 && !values[row].is_nan() && !values[row - 1].is_nan()).collect();
    let left = |row: usize| if is_known[row] { even[row] - slope * even[row - 1] } else { 0.0 };
    let mut left: Vec<f64> = (0..even.len()).map(left).collect();
    let known = is_known.iter().filter(|known| **known).count();
    let scale = (dot(&left, &left) / known as f64).sqrt();
    left.iter_mut().for_each(|value| *value = or_0(*value / scale).clamp(-FAR, FAR));
    Fresh { values: left, is_known }
}

fn correlation(x: &[f64], y: &[f64]) -> f64 {
    dot(x, y) / (dot(x, x) * dot(y, y)).sqrt().max(f64::MIN_POSITIVE)
}

/// Lag, row, and the correlations before and after it, if `effect` depends on `cause` otherwise from there on.
fn change(cause: &Fresh, effect: &Fresh, lag: usize, critical: f64) -> Option<(usize, usize, f64, f64)> {
    let all = cause.values.len() - lag;
    let (x, y) = (&cause.values[..all], &effect.values[lag..]);
    let parts = [0, 1, 2, 3].map(|part| part * all / 4..(part + 1) * all / 4);
    let parts = parts.map(|part| correlation(&x[part.clone()], &y[part]));
    let [least, most] = [f64::min, f64::max].map(|of| parts.into_iter().fold(parts[0], of));
    if most - least < LEAST {
        return None;
    }
    let rows: Vec<usize> =
        (0..all).filter(|&row| cause.is_known[row] && effect.is_known[row + lag]).collect();
    let n = rows.len();
    if n < ROWS[0] / 2 {
        return None;
    }
    let [x, y] = [x, y].map(|of| rows.iter().map(|&row| of[row]).collect::<Vec<f64>>());
    let products: Vec<f64> = x.iter().zip(&y).map(|(x, y)| x * y).collect();
    let off = |part: &[f64]| centred(part.to_vec());
    let sums = cumulated(&off(&products));
    let shortest = (SHORTEST * n as f64) as usize;
    let last = (shortest..n - shortest).max_by(|a, b| sums[*a].abs().total_cmp(&sums[*b].abs()))?;
    let (before, after) = products.split_at(last + 1);
    let statistic =
        dot(&sums, &sums) / (n as f64).powi(2) / long_run_variance(&[off(before), off(after)].concat());
    let (before, after) =
        (correlation(&x[..=last], &y[..=last]), correlation(&x[last + 1..], &y[last + 1..]));
    (statistic > critical && (before - after).abs() >= LEAST).then_some((
        lag,
        rows[last] + lag + 1,
        before,
        after,
    ))
}
