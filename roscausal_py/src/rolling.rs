//! A model per window.

use std::sync::{
    Arc,
    atomic::{AtomicBool, AtomicUsize, Ordering},
};

use pyo3::prelude::*;
use roscausal_discovery::{
    Control,
    rolling::{WindowModel, Windows, roll as roll_windows},
};

use crate::{
    errors::raised,
    frame::Frame,
    settings::{Given, for_data, of_analysis, of_step},
    watched::{Means, in_pool, wait},
};

/// Recording, first row, the row after the last one, and the JSON of the model of each window.
type OfWindows = Vec<(usize, usize, usize, String)>;

/// The models of all windows of `length` rows, `step` rows apart, and whether these are all. `progress` gets (windows done, windows).
#[pyfunction]
#[pyo3(signature = (frame, settings, length, step, progress=None))]
pub(crate) fn roll(
    py: Python<'_>,
    frame: &Frame,
    settings: &str,
    length: usize,
    step: usize,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<(OfWindows, String)> {
    let mut given = Given::read(settings).map_err(raised)?;
    let dt = of_step(&mut given).map_err(raised)?;
    let warnings = given.words("warnings").map_err(raised)?;
    let request = of_analysis(&mut given).map_err(raised)?;
    given.end().and_then(|()| request.check()).map_err(raised)?;
    let means = Means { threads: request.threads, time_budget: request.time_budget, progress: None };
    let (data, settings) = for_data(&request, frame.data.clone()).map_err(raised)?;
    let windows = Windows { length, step, last: true };
    let cancel = Arc::new(AtomicBool::new(false));
    let total: usize = data.recordings().iter().map(|rows| windows.starts(rows.nrows()).len()).sum();
    let done = Arc::new(AtomicUsize::new(0));
    let control: Control = means.control(cancel.clone()).map_err(raised)?;
    let (threads, count) = (means.threads, done.clone());
    let report = || {
        let reported = progress.as_ref().map(|tell| tell.call1((done.load(Ordering::Relaxed), total)));
        reported.transpose().map(drop)
    };
    let found = wait(py, &cancel, report, move || {
        in_pool(threads, || {
            let mut found = Vec::with_capacity(total);
            let status = roll_windows(&data, &settings, &windows, &control, |window| {
                count.fetch_add(1, Ordering::Relaxed);
                let WindowModel { recording, start, end, mut model } = window;
                model.dt = dt;
                model.warnings.splice(0..0, warnings.iter().cloned());
                found.push((recording, start, end, model.to_json()));
                Ok(())
            })?;
            Ok((found, status.to_string()))
        })
    })?;
    found.map_err(raised)
}
