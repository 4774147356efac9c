//! A model per window of time: how links come and go in one recording.
//!
//! A window takes the times `start..start + length`. Lags may reach before its start; the first `2 tau_max` times of a recording
//! only serve as the past of others. Windows start at 0, `step`, `2 step` .. below `T - length`, as the reference cuts them, so
//! one that would end exactly with the recording is left out unless [`Windows::last`] asks for it.
//!
//! ```
//! use roscausal_discovery::rolling::Windows;
//!
//! let windows = Windows { length: 100, step: 50, last: false };
//! assert_eq!(windows.starts(200), [0, 50]);
//! assert_eq!(Windows { last: true, ..windows }.starts(200), [0, 50, 100]);
//! ```

mod counts;
mod picture;

pub use counts::{LinkCount, link_counts};
pub use picture::strips_of;

use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::{
    analysis::analyse,
    confidence::{Resampling, analyse_resampled},
    methods::Status,
    model::Model,
    settings::Settings,
    types::{Control, DataFrame, Error, Named, Result},
};

/// Version of the layout of models over time.
pub const ROLLING_SCHEMA: &str = "roscausal/rolling/1";

/// How to cut recordings into windows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Windows {
    /// Times in a window.
    pub length: usize,
    /// Times from one start to the next.
    pub step: usize,
    /// Whether a window that ends exactly with the recording counts.
    pub last: bool,
}

/// The model of one window.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WindowModel {
    /// The recording, from 0.
    pub recording: usize,
    /// First time of the window, in rows.
    pub start: usize,
    /// The time after its last one.
    pub end: usize,
    /// What was found in it.
    #[serde(flatten)]
    pub model: Model,
}

impl Windows {
    /// The starts of the windows in a recording of `n` rows.
    pub fn starts(&self, n: usize) -> Vec<usize> {
        let end = (n + usize::from(self.last)).saturating_sub(self.length);
        (0..end).step_by(self.step.max(1)).collect()
    }

    /// Recording and start of each window, in order.
    fn places(&self, data: &DataFrame) -> Vec<(usize, usize)> {
        let recordings = data.recordings().iter().enumerate();
        recordings
            .flat_map(|(k, rows)| self.starts(rows.nrows()).into_iter().map(move |start| (k, start)))
            .collect()
    }

    fn check(&self, data: &DataFrame, tau_max: usize) -> Result<()> {
        let reason = "window and step are numbers of rows from 1 on";
        Error::ensure(self.length > 0 && self.step > 0, "window", || reason)?;
        let past = tau_max.saturating_mul(2);
        if self.length <= past {
            let (length, flag) = (self.length, Named("tau_max"));
            let reason = format!(
                "at the start of a recording {length} rows have no sample, since the first {past} only serve as the past of \
                 others ({flag} = {tau_max}); give more than {past}, or a lower {flag}"
            );
            return Err(Error::param("window", reason));
        }
        let longest = data.recordings().iter().map(|r| r.nrows()).max().unwrap_or(0);
        Error::ensure(!self.starts(longest).is_empty(), "window", || {
            let length = self.length;
            format!("{length} rows leave no window in {longest} rows; give a shorter window or record longer")
        })
    }
}

/// Analyses each window on its own, in the order of recordings and times, and passes each model to `each` as soon as it is there.
///
/// The time budget of `control` is that of all windows together. If it ends, the windows that came to their end count: the status
/// says how many they are.
///
/// # Errors
/// Invalid settings, windows that do not fit, data that do not suit the test, cancellation, or an error of `each`.
pub fn roll(
    data: &DataFrame,
    settings: &Settings,
    windows: &Windows,
    control: &Control,
    each: impl FnMut(WindowModel) -> Result<()>,
) -> Result<Status> {
    windows.check(data, settings.tau_max)?;
    let model_of = |recording: usize, rows: Range<usize>| {
        let mut times = vec![Vec::new(); data.recordings().len()];
        times[recording] = rows.collect();
        analyse(&data.at_times(times)?, settings, control)
    };
    in_turn(data, windows, control, model_of, each)
}

/// As [`roll`], and each model has its confidence.
///
/// # Errors
/// As [`roll`], and windows that are too short to draw from.
pub fn roll_resampled(
    data: &DataFrame,
    settings: &Settings,
    windows: &Windows,
    resampling: &Resampling,
    control: &Control,
    each: impl FnMut(WindowModel) -> Result<()>,
) -> Result<Status> {
    windows.check(data, settings.tau_max)?;
    let model_of = |recording: usize, rows: Range<usize>| {
        // The rows before a window are the past of its first ones.
        let from = rows.start.saturating_sub(2 * settings.tau_max);
        analyse_resampled(&data.stretch(recording, from..rows.end), settings, resampling, control)
    };
    in_turn(data, windows, control, model_of, each)
}

/// Finds the model of one window after another, until the time budget ends.
fn in_turn(
    data: &DataFrame,
    windows: &Windows,
    control: &Control,
    model_of: impl Fn(usize, Range<usize>) -> Result<Model>,
    mut each: impl FnMut(WindowModel) -> Result<()>,
) -> Result<Status> {
    let places = windows.places(data);
    for (done, &(recording, start)) in places.iter().enumerate() {
        let end = start + windows.length;
        let model = match model_of(recording, start..end) {
            Ok(model) if model.status == Status::Complete => model,
            Err(error) if !control.is_timeout(&error) => return Err(error),
            _ => {
                let how_far = format!("the time budget ended after {done} of {} windows", places.len());
                return Ok(Status::Partial(how_far));
            }
        };
        each(WindowModel { recording, start, end, model })?;
    }
    Ok(Status::Complete)
}

#[cfg(test)]
mod tests {
    use std::sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    };

    use ndarray::Array2;

    use super::*;
    use crate::{methods::Method, numeric::random::Rng};

    #[test]
    fn a_link_that_vanishes_is_in_the_early_windows_only() {
        let mut rng = Rng::new(4);
        let mut x = Array2::zeros((600, 2));
        for t in 1..600 {
            x[[t, 0]] = rng.unit() - 0.5;
            x[[t, 1]] = if t < 300 { x[[t - 1, 0]] } else { 0.0 } + rng.unit() - 0.5;
        }
        let data = DataFrame::new(vec![x], vec!["a".into(), "b".into()]).unwrap();
        let settings = Settings {
            method: Method::Pcmci,
            cond_ind_test: "parcorr".into(),
            alpha: 0.001,
            ..Settings::default()
        };
        let mut found = Vec::new();
        let windows = Windows { length: 150, step: 150, last: true };
        roll(&data, &settings, &windows, &Control::default(), |window| {
            found.push((window.start, window.model.links.iter().any(|l| l.cause == "a" && l.effect == "b")));
            Ok(())
        })
        .unwrap();
        assert_eq!(found, [(0, true), (150, true), (300, false), (450, false)]);
    }

    #[test]
    fn a_window_with_resamples_is_the_same_window() {
        let mut rng = Rng::new(9);
        let mut x = Array2::zeros((400, 2));
        for t in 1..400 {
            x[[t, 0]] = rng.unit() - 0.5;
            x[[t, 1]] = 0.6 * x[[t - 1, 0]] + rng.unit() - 0.5;
        }
        let data = DataFrame::new(vec![x], vec!["a".into(), "b".into()]).unwrap();
        let settings = Settings {
            method: Method::Pcmci,
            cond_ind_test: "parcorr".into(),
            tau_max: 2,
            ..Settings::default()
        };
        let windows = Windows { length: 120, step: 90, last: true };
        let (mut plain, mut drawn) = (Vec::new(), Vec::new());
        let keep = |all: &mut Vec<WindowModel>, window| {
            all.push(window);
            Ok(())
        };
        roll(&data, &settings, &windows, &Control::default(), |w| keep(&mut plain, w)).unwrap();
        let resampling = Resampling { resamples: 20, ..Resampling::default() };
        let control = Control::default();
        roll_resampled(&data, &settings, &windows, &resampling, &control, |w| keep(&mut drawn, w)).unwrap();
        assert_eq!(plain.len(), drawn.len());
        for (plain, drawn) in plain.iter().zip(&drawn) {
            assert_eq!(
                (plain.start, plain.end, &plain.model.graph),
                (drawn.start, drawn.end, &drawn.model.graph)
            );
            assert_eq!(plain.model.n_samples, drawn.model.n_samples);
            assert!(drawn.model.links.iter().all(|link| link.confidence.is_some()));
        }
        let models: Vec<&Model> = drawn.iter().map(|window| &window.model).collect();
        let count = link_counts(&models).into_iter().find(|c| c.cause == "a" && c.effect == "b").unwrap();
        assert_eq!((count.found, count.of), (models.len(), models.len()));
        let at: Vec<(f64, &Model)> = models.iter().map(|model| (0.0, *model)).collect();
        assert!(strips_of(&at, "rows", &[]).contains("a → b"));
    }

    #[test]
    fn a_window_with_resamples_keeps_the_mask_of_its_own_rows() {
        let mut rng = Rng::new(12);
        let mut x = Array2::zeros((400, 2));
        // Only in the rows that are masked `a` drives `b`.
        let is_masked = |t: usize| t % 200 >= 60;
        for t in 1..400 {
            x[[t, 0]] = rng.unit() - 0.5;
            x[[t, 1]] = if is_masked(t) { 2.0 * x[[t - 1, 0]] } else { 0.0 } + rng.unit() - 0.5;
        }
        let data = DataFrame::new(vec![x], vec!["a".into(), "b".into()]).unwrap();
        let mask = Array2::from_shape_fn((400, 2), |(t, _)| is_masked(t));
        let masked = data.clone().with_mask(vec![mask], "y".parse().unwrap()).unwrap();
        let settings = Settings {
            method: Method::Pcmci,
            cond_ind_test: "parcorr".into(),
            alpha: 0.001,
            ..Settings::default()
        };
        let windows = Windows { length: 200, step: 200, last: true };
        let resampling = Resampling { resamples: 20, ..Resampling::default() };
        let control = Control::default();
        let models_of = |data: &DataFrame| {
            let (mut plain, mut drawn) = (Vec::new(), Vec::new());
            roll(data, &settings, &windows, &control, |window| {
                plain.push(window.model);
                Ok(())
            })
            .unwrap();
            roll_resampled(data, &settings, &windows, &resampling, &control, |window| {
                drawn.push(window.model);
                Ok(())
            })
            .unwrap();
            (plain, drawn)
        };
        let found = |models: &[Model]| -> Vec<bool> {
            let is_link = |model: &Model| model.links.iter().any(|l| l.cause == "a" && l.effect == "b");
            models.iter().map(is_link).collect()
        };
        let (plain, drawn) = models_of(&data);
        assert_eq!((found(&plain), found(&drawn)), (vec![true; 2], vec![true; 2]));
        let (plain, drawn) = models_of(&masked);
        assert_eq!((found(&plain), found(&drawn)), (vec![false; 2], vec![false; 2]));
        for (plain, drawn) in plain.iter().zip(&drawn) {
            assert_eq!((&plain.graph, plain.n_samples), (&drawn.graph, drawn.n_samples));
        }
    }

    #[test]
    fn the_time_budget_is_that_of_all_windows_and_those_that_came_to_their_end_count() {
        let mut rng = Rng::new(3);
        let x = Array2::from_shape_simple_fn((400, 2), || rng.unit());
        let data = DataFrame::new(vec![x], vec!["a".into(), "b".into()]).unwrap();
        let settings =
            Settings { method: Method::Pcmci, cond_ind_test: "parcorr".into(), ..Settings::default() };
        let windows = Windows { length: 100, step: 100, last: true };
        let resampling = Resampling { resamples: 20, ..Resampling::default() };
        for resampled in [false, true] {
            let done = Arc::new(AtomicUsize::new(0));
            let seen = done.clone();
            let control = Control::default().out_of_time(move || seen.load(Ordering::Relaxed) >= 2);
            let each = |window: WindowModel| {
                assert_eq!(window.model.status, Status::Complete);
                done.fetch_add(1, Ordering::Relaxed);
                Ok(())
            };
            let status = match resampled {
                true => roll_resampled(&data, &settings, &windows, &resampling, &control, each),
                false => roll(&data, &settings, &windows, &control, each),
            };
            let reported = Status::Partial("the time budget ended after 2 of 4 windows".into());
            assert_eq!((status.unwrap(), done.load(Ordering::Relaxed)), (reported, 2), "{resampled}");
        }
    }

    #[test]
    fn a_window_longer_than_the_data_is_refused() {
        let data = DataFrame::new(vec![Array2::zeros((50, 2))], vec!["a".into(), "b".into()]).unwrap();
        let run = |windows: Windows| {
            roll(&data, &Settings::default(), &windows, &Control::default(), |_| Ok(()))
                .unwrap_err()
                .to_string()
        };
        assert!(run(Windows { length: 51, step: 1, last: true }).contains("leave no window in 50 rows"));
        assert!(run(Windows { length: 10, step: 0, last: true }).contains("from 1 on"));
    }

    #[test]
    fn a_window_without_a_sample_of_its_own_is_refused() {
        let x = Array2::from_shape_fn((50, 2), |(t, k)| ((t * t + 7 * k) % 11) as f64);
        let data = DataFrame::new(vec![x], vec!["a".into(), "b".into()]).unwrap();
        let settings = Settings { tau_max: 3, ..Settings::default() };
        let windows = Windows { length: 6, step: 6, last: true };
        let (control, resampling) =
            (Control::default(), Resampling { resamples: 20, ..Resampling::default() });
        for error in [
            roll(&data, &settings, &windows, &control, |_| Ok(())),
            roll_resampled(&data, &settings, &windows, &resampling, &control, |_| Ok(())),
        ] {
            let error = error.unwrap_err().to_string();
            assert!(error.contains("'window'") && error.contains("6 rows have no sample"), "{error}");
            assert!(error.contains("give more than 6, or a lower tau_max"), "{error}");
        }
    }
}
