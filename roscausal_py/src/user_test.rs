//! An independence test that is a Python object: a function of arrays, or an object with `run_test_raw` or `run_test`.
//!
//! One call at a time; each (X, Y, Z) is asked once. An exception ends the run and is raised as it is. While Python works,
//! the caller of the run is waiting without the GIL.

use std::{
    collections::HashMap,
    sync::{Arc, Mutex},
};

use numpy::{IntoPyArray, PyArray2};
use pyo3::{IntoPyObjectExt, prelude::*, types::PyDict};
use roscausal_discovery::{CondIndTest, Error, Node, PreparedTest, Result, Samples, TestResult, lock};

/// How the object is called.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Interface {
    /// `f(x, y, z) -> (value, p)` with arrays (n,), (n,), (n, k).
    Function,
    /// `run_test_raw(x, y, z) -> (value, p)` with arrays (n, 1), (n, 1), (n, k) or None.
    RawObject,
    /// `run_test(X, Y, Z, tau_max) -> (value, p)` with lists of (variable, -lag).
    Nodes,
}

/// The exception of a user's test, for the caller to raise.
pub(crate) type Failure = Arc<Mutex<Option<PyErr>>>;

/// A user's test.
pub(crate) struct UserTest {
    object: Py<PyAny>,
    interface: Interface,
    tau_max: usize,
    seen: Mutex<HashMap<Question, TestResult>>,
    failure: Failure,
}

type Question = (Node, Node, Vec<Node>);

impl UserTest {
    /// The test that `object` is. It is called for runs with this `tau_max`.
    pub(crate) fn new(object: &Bound<'_, PyAny>, tau_max: usize) -> Result<Self> {
        let has = |name: &str| object.hasattr(name).unwrap_or(false);
        let interface = if has("run_test") {
            Interface::Nodes
        } else if has("run_test_raw") {
            Interface::RawObject
        } else if object.is_callable() {
            Interface::Function
        } else {
            let reason = "give a test's name, a function f(x, y, z) -> (value, p), or an object with run_test_raw or run_test";
            return Err(Error::param("test", reason));
        };
        Ok(Self {
            object: object.clone().unbind(),
            interface,
            tau_max,
            seen: Mutex::new(HashMap::new()),
            failure: Failure::default(),
        })
    }

    /// Where the exception of a run will be.
    pub(crate) fn failure(&self) -> Failure {
        self.failure.clone()
    }

    fn ask(&self, samples: &Samples<'_>, x: Node, y: Node, z: &[Node]) -> PyResult<TestResult> {
        let arrays = (self.interface != Interface::Nodes).then(|| samples.arrays(x, y, z));
        let (n_samples, n_lost) = arrays.as_ref().map_or((samples.len(), 0), |a| (a.x.len(), a.n_lost));
        Python::attach(|py| {
            let object = self.object.bind(py);
            let answer = match (self.interface, arrays) {
                (Interface::Function, Some(a)) => {
                    let z = columns(py, &a.z, n_samples);
                    object.call1((a.x.into_pyarray(py), a.y.into_pyarray(py), z))?
                }
                (_, Some(a)) => {
                    let z = if a.z.is_empty() {
                        py.None().into_bound(py)
                    } else {
                        columns(py, &a.z, n_samples).into_any()
                    };
                    let one = |row: Vec<f64>| columns(py, &[row], n_samples);
                    object.call_method1("run_test_raw", (one(a.x), one(a.y), z))?
                }
                (_, None) => {
                    let named = PyDict::new(py);
                    named.set_item("X", nodes(py, &[x])?)?;
                    named.set_item("Y", nodes(py, &[y])?)?;
                    named.set_item("Z", nodes(py, z)?)?;
                    named.set_item("tau_max", self.tau_max)?;
                    object.call_method("run_test", (), Some(&named))?
                }
            };
            let (value, p_value) = (answer.get_item(0)?.extract()?, answer.get_item(1)?.extract()?);
            Ok(TestResult { value, p_value, confidence: None, n_samples, n_lost, dependent: None })
        })
    }
}

/// Rows of samples as an array (n, k).
fn columns<'py>(py: Python<'py>, rows: &[Vec<f64>], n: usize) -> Bound<'py, PyArray2<f64>> {
    ndarray::Array2::from_shape_fn((n, rows.len()), |(t, k)| rows[k][t]).into_pyarray(py)
}

/// Nodes as `[(variable, -lag), ..]`.
fn nodes<'py>(py: Python<'py>, nodes: &[Node]) -> PyResult<Bound<'py, PyAny>> {
    nodes.iter().map(|node| (node.var, -(node.lag as i64))).collect::<Vec<_>>().into_bound_py_any(py)
}

impl CondIndTest for UserTest {
    fn name(&self) -> &'static str {
        "custom"
    }

    fn prepare<'a>(&'a self, samples: &'a Samples<'a>) -> Result<Box<dyn PreparedTest + 'a>> {
        Ok(Box::new(Prepared { test: self, samples }))
    }
}

struct Prepared<'a> {
    test: &'a UserTest,
    samples: &'a Samples<'a>,
}

impl PreparedTest for Prepared<'_> {
    fn run_test(&self, x: Node, y: Node, z: &[Node]) -> Result<TestResult> {
        let question = (x, y, z.to_vec());
        // The lock is taken without the GIL, and held while Python answers: one question at a time.
        let mut seen = lock(&self.test.seen);
        if let Some(answer) = seen.get(&question) {
            return Ok(*answer);
        }
        let of = |node: &Node| format!("({}, -{})", node.var, node.lag);
        let name = || {
            let given: Vec<String> = z.iter().map(of).collect();
            format!("X = {}, Y = {}, Z = [{}]", of(&x), of(&y), given.join(", "))
        };
        match self.test.ask(self.samples, x, y, z) {
            Err(exception) => {
                let mut failure = lock(&self.test.failure);
                failure.get_or_insert(exception);
                Err(Error::Data(format!("the independence test failed at {}", name())))
            }
            Ok(answer) if !answer.value.is_finite() || !(0.0..=1.0).contains(&answer.p_value) => {
                Err(Error::Data(format!(
                    "the independence test answered value {} and p-value {} at {}; a value is a finite number and a p-value \
                     lies in [0, 1]",
                    answer.value,
                    answer.p_value,
                    name()
                )))
            }
            Ok(answer) => {
                seen.insert(question, answer);
                Ok(answer)
            }
        }
    }
}
