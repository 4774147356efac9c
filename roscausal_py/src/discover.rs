//! From settings to a model, and the words that settings take.

use std::time::Instant;

use pyo3::{prelude::*, types::PyString};
use roscausal_discovery::{
    CondIndTest, DataProfile, Error, Fault, Levelled, Result, analyse, analyse_with,
    confidence::{analyse_resampled, set_step},
    independence_tests::by_name,
    lock,
    methods::Method,
    settings,
};
use serde_json::json;

use crate::{
    errors::{named, raised},
    frame::Frame,
    settings::{Given, for_data, of_analysis, of_step, of_test, oracle_of},
    user_test::{Failure, UserTest},
    watched::{Means, watched},
};

/// A test as the Python files give it: the JSON of its name and settings, or the user's own.
pub(crate) fn test_of(
    test: &Bound<'_, PyAny>,
    tau_max: usize,
) -> Result<(Box<dyn CondIndTest>, Option<Failure>)> {
    if let Ok(json) = test.cast::<PyString>() {
        if let Some(oracle) = oracle_of(&json.to_string_lossy())? {
            return Ok((Box::new(oracle), None));
        }
        let (name, settings) = of_test(&json.to_string_lossy())?;
        return Ok((by_name(&name, &settings)?, None));
    }
    let own = UserTest::new(test, tau_max)?;
    let failure = own.failure();
    Ok((Box::new(own), Some(failure)))
}

/// The exception of the user's test, if that is why a run failed.
pub(crate) fn own_exception(failure: Option<&Failure>, error: PyErr) -> PyErr {
    failure.and_then(|slot| lock(slot).take()).unwrap_or(error)
}

/// The JSON of the model of `frame`. `settings` is a JSON object; `test` a user's own test, else the settings name one.
#[pyfunction]
#[pyo3(signature = (frame, settings, test=None, progress=None))]
pub(crate) fn discover(
    py: Python<'_>,
    frame: &Frame,
    settings: &str,
    test: Option<Bound<'_, PyAny>>,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<String> {
    let mut given = Given::read(settings).map_err(raised)?;
    let dt = of_step(&mut given).map_err(raised)?;
    let warnings = given.words("warnings").map_err(raised)?;
    let request = of_analysis(&mut given).map_err(raised)?;
    given.end().map_err(raised)?;
    // A test of the user's own may read what no other does.
    if test.is_none() {
        request.check().map_err(raised)?;
    }
    let resampling = request.resampling().map_err(raised)?;
    let means = Means { threads: request.threads, time_budget: request.time_budget, progress };
    if test.is_some() && resampling.is_some() {
        let reason = "resamples are for the tests that have a name; with a test of your own use run_bootstrap_of of \
                      roscausal.tigramite";
        return Err(raised(Error::param("resamples", reason)));
    }
    let own = test.map(|test| test_of(&test, request.settings.tau_max)).transpose().map_err(raised)?;
    let (own, failure) = own.map_or((None, None), |(test, failure)| (Some(test), failure));
    let start = Instant::now();
    let (data, settings) = for_data(&request, frame.data.clone()).map_err(raised)?;
    // What the command refuses, its own caller may want; what the data are like is told.
    let (mut profile, faults) = DataProfile::of(&data, settings.tau_max);
    profile.remarks.extend(faults.into_iter().map(|fault| match fault {
        Fault::MissingFlag { name, value, count } => {
            format!("{name} is {value} in {count} rows, far from all its other values: it seems to stand for a missing value")
        }
        Fault::Twins(a, b) => {
            format!("{a} and {b} say the same (correlation 1): no test can tell which of them drives anything")
        }
        Fault::SameRecording(a, b) => {
            format!("recordings {a} and {b} hold the same rows: counted twice, they would make any link significant")
        }
    }));
    let each: Vec<usize> = (0..data.recordings().len()).collect();
    let Levelled { data, settings, note } =
        Levelled::of(std::sync::Arc::unwrap_or_clone(data), &each, settings);
    let profile = settings.look_later(profile, &data, dt);
    let found = watched(py, &means, move |control| match (&own, &resampling) {
        (Some(test), _) => analyse_with(&data, test.as_ref(), &settings, control),
        (None, Some(resampling)) => analyse_resampled(&data, &settings, resampling, control),
        (None, None) => analyse(&data, &settings, control),
    });
    let mut model = found.map_err(|error| own_exception(failure.as_ref(), error))?;
    model.run_time_s = Some(start.elapsed().as_secs_f64());
    set_step(&mut model, dt);
    model.about_data = Some(profile);
    model.warnings.splice(0..0, warnings.into_iter().chain(note));
    Ok(model.spelled(named).to_json())
}

/// The names of the methods, and the table of settings, as JSON.
#[pyfunction]
pub(crate) fn words() -> String {
    let methods: Vec<_> = Method::all().map(|method| method.info().name).collect();
    json!({ "methods": methods, "settings": settings::as_json() }).to_string()
}
