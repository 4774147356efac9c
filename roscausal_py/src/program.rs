//! What the command does with files: recordings, the demo, and the command itself.

use std::{
    ffi::OsString,
    path::PathBuf,
    sync::{Arc, atomic::AtomicBool},
};

use numpy::IntoPyArray;
use pyo3::{prelude::*, types::PyDict};
use roscausal_core::Result;
use roscausal_msgs::types;

use crate::{errors::raised_by_program, watched::wait};

/// Runs `work` with a flag that Ctrl-C sets.
fn cancellable<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce(Arc<AtomicBool>) -> Result<T> + Send + 'static,
) -> PyResult<T> {
    let cancel = Arc::new(AtomicBool::new(false));
    let flag = cancel.clone();
    wait(py, &cancel, || Ok(()), move || work(flag))?.map_err(raised_by_program)
}

/// The tables and recordings in `paths`, read with the options of `roscausal discover`: names, arrays (T, N), step, exogenous
/// variables, warnings, rows that are not effects.
#[pyfunction]
pub(crate) fn read(py: Python<'_>, paths: Vec<PathBuf>, options: Vec<String>) -> PyResult<Bound<'_, PyDict>> {
    let found = cancellable(py, move |cancel| roscausal::read_recordings(&paths, &options, cancel))?;
    let out = PyDict::new(py);
    out.set_item("names", found.names)?;
    let arrays: Vec<_> = found.values.into_iter().map(|values| values.into_pyarray(py)).collect();
    out.set_item("arrays", arrays)?;
    out.set_item("dt", found.dt)?;
    out.set_item("exogenous", found.exogenous)?;
    out.set_item("warnings", found.warnings)?;
    out.set_item("masked", found.masked.into_iter().map(|rows| rows.into_pyarray(py)).collect::<Vec<_>>())?;
    Ok(out)
}

/// Runs the demo into the folder `out` and returns the model's JSON.
#[pyfunction]
pub(crate) fn demo(py: Python<'_>, seed: u64, out: PathBuf) -> PyResult<String> {
    Ok(cancellable(py, move |cancel| roscausal::run_demo(seed, &out, cancel))?.to_json())
}

/// Runs the command `roscausal`, and returns its exit code.
#[pyfunction]
pub(crate) fn command(py: Python<'_>, args: Vec<OsString>) -> u8 {
    py.detach(|| roscausal::command(args))
}

/// The texts of our own messages, by ROS 2 name.
#[pyfunction]
pub(crate) fn messages() -> Vec<(String, &'static str)> {
    let own = types().into_iter().filter(|definition| definition.package == "roscausal_msgs");
    own.map(|definition| (definition.ros2_type_name(), definition.text)).collect()
}

/// The version of the package.
#[pyfunction]
pub(crate) fn version() -> &'static str {
    env!("CARGO_PKG_VERSION")
}
