//! GPDC computed by the Python reference (feature `python`).

use std::{collections::HashMap, sync::Mutex};

use pyo3::{prelude::*, types::PyDict};

use super::settings::{Significance, TestSettings};
use crate::types::{CondIndTest, Error, Node, PreparedTest, Result, Samples, TestResult, lock};

/// GPDC as the Python package `tigramite` computes it, in an embedded interpreter. Use it to compare the native
/// [`super::Gpdc`] with the reference on your own data. It is slow and runs one test at a time.
///
/// The interpreter is the one that this crate was built with. `PYTHONPATH` makes the packages of a virtual
/// environment visible to it.
#[derive(Clone, Debug)]
pub struct GpdcPython {
    significance: &'static str,
    sig_samples: usize,
    seed: u64,
}

impl GpdcPython {
    /// The test with `settings`: `significance` (`analytic` or `shuffle_test`), `sig_samples`, `seed`.
    ///
    /// # Errors
    /// A setting that the test does not allow.
    pub fn new(settings: &TestSettings) -> Result<Self> {
        let significance = match settings.significance {
            None | Some(Significance::Analytic) => "analytic",
            Some(Significance::ShuffleTest) => "shuffle_test",
            Some(Significance::FixedThres) => {
                return Err(Error::param("significance", "gpdc-python knows analytic and shuffle_test"));
            }
        };
        let reason = "gpdc-python has no confidence interval; use gpdc";
        Error::ensure(settings.confidence.is_none(), "confidence", || reason)?;
        Ok(Self { significance, sig_samples: settings.sig_samples.unwrap_or(500), seed: settings.seed })
    }

    /// Checks that the Python package can be imported.
    ///
    /// # Errors
    /// Why it cannot, and what to install.
    pub fn check_package() -> Result<()> {
        Python::attach(|py| class(py).map(|_| ()))
    }
}

/// The Python class.
fn class(py: Python<'_>) -> Result<Bound<'_, PyAny>> {
    let missing = |e: PyErr| {
        Error::param(
            "test",
            format!(
                "gpdc-python cannot import its Python package ({e}); install it (pip install tigramite==5.2.10.1 \
                 numpy==2.3.5 numba scikit-learn dcor) and set PYTHONPATH to its site-packages, or use gpdc"
            ),
        )
    };
    py.import("tigramite.independence_tests.gpdc").and_then(|module| module.getattr("GPDC")).map_err(missing)
}

impl CondIndTest for GpdcPython {
    fn name(&self) -> &'static str {
        "gpdc_python"
    }

    fn prepare<'a>(&'a self, samples: &'a Samples<'a>) -> Result<Box<dyn PreparedTest + 'a>> {
        Self::check_package()?;
        Ok(Box::new(Prepared { test: self, samples, objects: Mutex::default() }))
    }
}

/// The Python test on the samples of one run.
struct Prepared<'a> {
    test: &'a GpdcPython,
    samples: &'a Samples<'a>,
    /// One Python object per number of samples. Each draws its null distribution from the start of its random
    /// stream.
    objects: Mutex<HashMap<usize, Py<PyAny>>>,
}

impl PreparedTest for Prepared<'_> {
    fn run_test(&self, x: Node, y: Node, z: &[Node]) -> Result<TestResult> {
        let arrays = self.samples.arrays(x, y, z);
        let n = arrays.x.len();
        Error::ensure_data(n > 0, || "gpdc-python has no complete sample; record more")?;
        let (value, p_value) = Python::attach(|py| -> Result<(f64, f64)> {
            let object = self.object(py, n)?;
            let numpy = py.import("numpy").map_err(failed)?;
            let columns = |rows: Vec<&Vec<f64>>| -> PyResult<Bound<'_, PyAny>> {
                numpy
                    .call_method1("array", (rows.into_iter().cloned().collect::<Vec<_>>(),))?
                    .getattr("T")?
                    .call_method0("copy")
            };
            let call = || -> PyResult<(f64, f64)> {
                let (x, y) = (columns(vec![&arrays.x])?, columns(vec![&arrays.y])?);
                let arguments = PyDict::new(py);
                if !arrays.z.is_empty() {
                    arguments.set_item("z", columns(arrays.z.iter().collect())?)?;
                }
                object.call_method("run_test_raw", (x, y), Some(&arguments))?.extract()
            };
            call().map_err(failed)
        })?;
        // The Python class gives no value for a constant series.
        let (value, p_value) =
            if value.is_finite() && p_value.is_finite() { (value, p_value) } else { (0.0, 1.0) };
        Ok(TestResult::new(value, p_value, n, arrays.n_lost))
    }
}

impl Prepared<'_> {
    fn object<'py>(&self, py: Python<'py>, n: usize) -> Result<Bound<'py, PyAny>> {
        let known = lock(&self.objects).get(&n).map(|o| o.clone_ref(py));
        if let Some(object) = known {
            return Ok(object.into_bound(py));
        }
        let make = || -> PyResult<Bound<'py, PyAny>> {
            let arguments = PyDict::new(py);
            arguments.set_item("significance", self.test.significance)?;
            arguments.set_item("sig_samples", self.test.sig_samples)?;
            arguments.set_item("seed", self.test.seed)?;
            class(py)
                .map_err(|e| pyo3::exceptions::PyImportError::new_err(e.to_string()))?
                .call((), Some(&arguments))
        };
        let object = make().map_err(failed)?;
        let mut objects = lock(&self.objects);
        Ok(objects.entry(n).or_insert_with(|| object.unbind()).clone_ref(py).into_bound(py))
    }
}

fn failed(e: PyErr) -> Error {
    Error::Data(format!("gpdc-python: the Python test failed with {e}"))
}
