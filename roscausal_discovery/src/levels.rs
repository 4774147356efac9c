//! Several recordings that differ in level or scale: pooled as they are, that would look like links.
//!
//! Where means or standard deviations differ by more than chance explains, each recording's own are taken out, and the mean of all
//! put in their place, so that units stay. J-PCMCI+ and CAnDOIT compare recordings themselves, and tests of categories have no
//! level.
//!
//! Example: two people keep different distances and walk at different speeds. Pooled, distance and speed are correlated; within
//! each they are not.

use ndarray::Array2;

use crate::{
    methods::Method,
    numeric::rows,
    profile::effective_share,
    settings::{Levels, Settings},
    types::{DataFrame, Named},
};

/// Standard errors by which a recording must differ to be called different.
const FAR: f64 = 4.0;
/// Standard deviations that differ by less than this factor do no harm.
const ANOTHER_SCALE: f64 = 1.25;

/// Data without the levels of their recordings.
#[derive(Clone, Debug)]
pub struct Levelled {
    /// The data.
    pub data: DataFrame,
    /// The settings: those of [`Levels::Remove`] if levels were taken out.
    pub settings: Settings,
    /// What was done, if anything was.
    pub note: Option<String>,
}

impl Levelled {
    /// Takes out levels as the settings say. `runs` has for each recording which run it is of: recordings of one run, such as
    /// batches that follow one another, have one level; empty: all are of one.
    pub fn of<R: PartialEq>(data: DataFrame, runs: &[R], settings: Settings) -> Self {
        let first = |k: usize| runs.iter().position(|run| runs.get(k) == Some(run)).unwrap_or(0);
        let runs: Vec<usize> = (0..data.recordings().len()).map(first).collect();
        let one = runs.iter().all(|run| *run == 0);
        let other = matches!(settings.method, Method::Jpcmciplus | Method::Candoit)
            || ["gsquared", "cmisymb"].contains(&settings.cond_ind_test.as_str())
            || (settings.test.as_tigramite && settings.levels == Levels::Auto);
        if one || other || settings.levels == Levels::Keep {
            return Self { data, settings, note: None };
        }
        // What is constant in each recording says which one a row is of.
        let differs = |var: usize, by: usize| data.different_values(var, by).len() > by;
        let constant = |var| of_runs(&data, var, &runs).iter().all(|values| rows::is_constant(values));
        let labels: Vec<usize> = (0..data.n_vars()).filter(|&var| differs(var, 1) && constant(var)).collect();
        // Numbers, not one of two categories.
        let vars: Vec<usize> =
            (0..data.n_vars()).filter(|var| differs(*var, 2) && !labels.contains(var)).collect();
        let levels: Vec<usize> =
            vars.iter().copied().filter(|&var| levels_differ(&data, var, &runs)).collect();
        let scales: Vec<usize> =
            vars.iter().copied().filter(|&var| scales_differ(&data, var, &runs)).collect();
        if settings.levels == Levels::Auto && [&levels, &scales, &labels].iter().all(|of| of.is_empty()) {
            return Self { data, settings, note: None };
        }
        let named = |(vars, what): (&[usize], &str)| -> Option<String> {
            (!vars.is_empty()).then(|| format!("the {what} of {}", data.listed(vars.iter().copied())))
        };
        let differ: Vec<String> = match levels == scales {
            true => named((&levels, "level and scale")).into_iter().collect(),
            false => [(&levels[..], "level"), (&scales, "scale")].into_iter().filter_map(named).collect(),
        };
        let why = match differ.is_empty() {
            true => String::new(),
            false => format!("the recordings differ in {}: ", differ.join(" and in ")),
        };
        let what = if scales.is_empty() { "level is" } else { "level and scale are" };
        let mut note = format!(
            "{why}each one's own {what} taken out, so that what differs between recordings makes no link ({} keep leaves it in)",
            Named("levels")
        );
        if !labels.is_empty() {
            let names = data.listed(labels.iter().copied());
            note +=
                &format!("; {names}: constant in each recording, so only jpcmciplus takes it for a cause");
        }
        let mut recordings = data.recordings().to_vec();
        for &var in vars.iter().chain(&labels) {
            let scaled = |recordings: &mut [Array2<f64>], by: f64| {
                recordings.iter_mut().for_each(|rows| rows.column_mut(var).mapv_inplace(|value| value * by));
            };
            let unit = rows::unit(&data, var);
            scaled(&mut recordings, unit);
            take_out(&mut recordings, var, &runs, !scales.is_empty());
            scaled(&mut recordings, 1.0 / unit);
        }
        match data.with_values(recordings) {
            Some(data) => {
                Self { data, settings: Settings { levels: Levels::Remove, ..settings }, note: Some(note) }
            }
            None => Self { data, settings, note: None },
        }
    }
}

/// Mean and standard deviation; of equal values exactly they and 0.
fn moments(values: &[f64]) -> (f64, f64) {
    let same = values.first().filter(|first| values.iter().all(|value| value == *first));
    same.map_or_else(|| rows::moments(values), |value| (*value, 0.0))
}

/// The values of a variable in each run that has some.
fn of_runs(data: &DataFrame, var: usize, runs: &[usize]) -> Vec<Vec<f64>> {
    // In units in which squares neither overflow nor vanish.
    let unit = rows::unit(data, var);
    let of_run = |run: usize| -> Vec<f64> {
        let recordings = data.recordings().iter().zip(runs).filter(|(_, of)| **of == run);
        let values = recordings.flat_map(|(rows, _)| rows.column(var).to_vec());
        values.filter(|value| !value.is_nan()).map(|value| value * unit).collect()
    };
    let first = runs.iter().enumerate().filter(|(k, run)| k == *run).map(|(_, run)| *run);
    first.map(of_run).filter(|values| values.len() > 2).collect()
}

/// Whether any two of these (estimate, squared standard error) are farther apart than chance explains.
fn differ(of: &[(f64, f64)]) -> bool {
    let far = |(a, of_a): &(f64, f64), (b, of_b): &(f64, f64)| (a - b).abs() > FAR * (of_a + of_b).sqrt();
    of.iter().any(|one| of.iter().any(|other| far(one, other)))
}

/// Samples that count: neighbouring ones are not worth a sample each.
fn effective(values: &[f64]) -> f64 {
    (values.len() as f64 * effective_share(values)).max(1.0)
}

/// Whether the mean of a variable in some run is farther from the others' than chance explains.
pub(crate) fn levels_differ(data: &DataFrame, var: usize, runs: &[usize]) -> bool {
    let of = |values: &Vec<f64>| {
        let (mean, deviation) = moments(values);
        (mean, deviation * deviation / effective(values))
    };
    differ(&of_runs(data, var, runs).iter().map(of).collect::<Vec<_>>())
}

/// The same of the logarithm of the standard deviation.
fn scales_differ(data: &DataFrame, var: usize, runs: &[usize]) -> bool {
    let of = |values: &Vec<f64>| {
        let (mean, deviation) = moments(values);
        let fourth =
            values.iter().map(|v| ((v - mean) / deviation).powi(4)).sum::<f64>() / values.len() as f64;
        (libm::log(deviation), (fourth - 1.0).max(0.5) / (4.0 * effective(values)))
    };
    let of: Vec<(f64, f64)> =
        of_runs(data, var, runs).iter().map(of).filter(|(scale, _)| scale.is_finite()).collect();
    let ends = of.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), (s, _)| (a.min(*s), b.max(*s)));
    ends.1 - ends.0 > libm::log(ANOTHER_SCALE) && differ(&of)
}

/// Gives a variable the mean (and the standard deviation) of all in each run.
fn take_out(recordings: &mut [Array2<f64>], var: usize, runs: &[usize], scale: bool) {
    let values = |recordings: &[Array2<f64>], run: Option<usize>| -> Vec<f64> {
        let meant = recordings.iter().zip(runs).filter(|(_, of)| run.is_none_or(|run| run == **of));
        meant.flat_map(|(rows, _)| rows.column(var).to_vec()).filter(|value| !value.is_nan()).collect()
    };
    let (mean, _) = moments(&values(recordings, None));
    let own: Vec<(f64, f64)> = runs.iter().map(|run| moments(&values(recordings, Some(*run)))).collect();
    // The usual deviation within a run, so that units stay.
    let within =
        own.iter().zip(recordings.iter()).map(|((_, s), rows)| s * s * rows.nrows() as f64).sum::<f64>();
    let usual = (within / recordings.iter().map(|rows| rows.nrows() as f64).sum::<f64>()).sqrt();
    for (rows, (own_mean, deviation)) in recordings.iter_mut().zip(own) {
        let factor = if scale && deviation > 0.0 { usual / deviation } else { 1.0 };
        rows.column_mut(var).mapv_inplace(|value| (value - own_mean) * factor + mean);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::mix;

    fn noise(i: usize) -> f64 {
        mix(i as u64) as f64 / u64::MAX as f64
    }

    fn data(levels: &[f64], scales: &[f64]) -> DataFrame {
        let of = |(k, (level, scale)): (usize, (&f64, &f64))| {
            Array2::from_shape_fn((150, 2), |(t, v)| level + scale * noise(1000 * k + 2 * t + v))
        };
        let recordings = levels.iter().zip(scales).enumerate().map(of).collect();
        DataFrame::new(recordings, vec!["a".into(), "b".into()]).unwrap()
    }

    fn levelled(data: DataFrame, runs: &[usize], settings: &Settings) -> Levelled {
        Levelled::of(data, runs, settings.clone())
    }

    #[test]
    fn levels_and_scales_are_taken_out_where_runs_differ_and_only_there() {
        let usual = Settings::default();
        let apart = data(&[0.0, 2.0, 1.0], &[1.0, 1.0, 1.0]);
        let found = levelled(apart.clone(), &[0, 1, 2], &usual);
        assert!(found.note.is_some_and(|reported| reported.contains("the level of a, b") && !reported.contains("scale")));
        assert_eq!(found.settings.levels, Levels::Remove);
        let means: Vec<f64> = found.data.recordings().iter().map(|r| r.column(0).mean().unwrap()).collect();
        assert!(
            means.iter().all(|mean| (mean - means[0]).abs() < 1e-9) && (means[0] - 1.5).abs() < 0.1,
            "{means:?}"
        );
        let wide = levelled(data(&[0.0, 0.0], &[1.0, 3.0]), &[0, 1], &usual);
        let sizes: Vec<f64> = wide.data.recordings().iter().map(|r| r.column(1).std(0.0)).collect();
        assert!(
            wide.note.is_some_and(|reported| reported.contains("scale of"))
                && (sizes[0] / sizes[1] - 1.0).abs() < 1e-9
        );
        for (data, runs, settings) in [
            (data(&[0.0, 0.0, 0.0], &[1.0, 1.0, 1.0]), [0, 1, 2], usual.clone()),
            (apart.clone(), [7, 7, 7], usual.clone()),
            (apart.clone(), [0, 1, 2], Settings { levels: Levels::Keep, ..usual.clone() }),
            (apart.clone(), [0, 1, 2], Settings { method: Method::Jpcmciplus, ..usual.clone() }),
        ] {
            let same = levelled(data.clone(), &runs, &settings);
            assert!(same.note.is_none() && same.data.recordings() == data.recordings());
        }
        // Units that differ by a power of two change nothing but themselves.
        let small = 2_f64.powi(-660);
        let values = apart.recordings().iter().map(|rows| rows.mapv(|value| value * small)).collect();
        let scaled = DataFrame::new(values, vec!["a".into(), "b".into()]).unwrap();
        let [here, there] = [apart.clone(), scaled].map(|data| levelled(data, &[0, 1, 2], &usual).data);
        for (here, there) in here.recordings().iter().zip(there.recordings()) {
            assert_eq!(here.mapv(|value| value * small), there);
        }
        let mut as_reference = usual;
        as_reference.test.as_tigramite = true;
        assert!(levelled(apart, &[0, 1, 2], &as_reference).note.is_none());
    }
}
