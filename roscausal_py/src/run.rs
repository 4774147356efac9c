//! The methods one by one, with the reference's words and arrays; single tests; the correction of p-values.

use ndarray::{Array3, Array4};
use numpy::{IntoPyArray, PyArray3, PyReadonlyArray3};
use pyo3::{prelude::*, types::PyDict};
use roscausal_discovery::{
    CondIndTest, Control, DataFrame, Error, LinkMark, Node, Result, Samples,
    methods::{
        self, JpcmciPlusSettings, LpcmciSettings, PcmciPlusSettings, PcmciResult, PcmciSettings,
        get_lagged_dependencies, run_bivci, run_fullci, run_jpcmciplus, run_lpcmci, run_mci, run_pc_stable,
        run_pcmci, run_pcmciplus,
    },
};

use crate::{
    discover::{own_exception, test_of},
    errors::raised,
    frame::Frame,
    settings::{Given, of_contexts, of_latent, of_method, parents_of},
    watched::{Means, watched},
};

/// What is run, with all its settings.
struct Job {
    method: String,
    settings: PcmciSettings,
    plus: PcmciPlusSettings,
    parents: Option<Vec<Vec<Node>>>,
    latent: LpcmciSettings,
    joint: JpcmciPlusSettings,
}

impl Job {
    fn run(&self, data: &DataFrame, test: &dyn CondIndTest, control: &Control) -> Result<PcmciResult> {
        let settings = &self.settings;
        match (self.method.as_str(), &self.parents) {
            ("pcmci", _) => run_pcmci(data, test, settings, control),
            ("pcmciplus", _) => run_pcmciplus(data, test, settings, &self.plus, control),
            ("pc_stable", _) => run_pc_stable(data, test, settings, control),
            ("fullci", _) => run_fullci(data, test, settings, control),
            ("bivci", _) => run_bivci(data, test, settings, control),
            ("lagged_dependencies", _) => get_lagged_dependencies(data, test, settings, control),
            ("lpcmci", _) => run_lpcmci(data, test, &self.latent, control).map(|found| found.result),
            ("jpcmciplus", _) => {
                let (pcmci, plus) = (settings.clone(), self.plus.clone());
                let joint = JpcmciPlusSettings { pcmci, plus, ..self.joint.clone() };
                run_jpcmciplus(data, test, &joint, control).map(|found| found.result)
            }
            ("mci", Some(parents)) => run_mci(data, test, settings, parents, control),
            (other, _) => Err(Error::param("method", format!("'{other}' is not known here"))),
        }
    }
}

/// Runs a method and returns its result as arrays `[cause, effect, lag]` and lists. Marks are numbers: 0 none, 1 `-->`,
/// 2 `<--`, 3 `o-o`, 4 `x-x`.
#[pyfunction]
pub(crate) fn run<'py>(
    py: Python<'py>,
    frame: &Frame,
    method: &str,
    settings: &str,
    test: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyDict>> {
    let data = frame.data.clone();
    let mut given = Given::read(settings).map_err(raised)?;
    let parents = given.take("parents").map(|list| parents_of(&list)).transpose().map_err(raised)?;
    let (settings, plus) = of_method(&mut given, data.n_vars()).map_err(raised)?;
    let latent = of_latent(&mut given, &settings).map_err(raised)?;
    let joint = of_contexts(&mut given).map_err(raised)?;
    given.end().map_err(raised)?;
    let (test, failure) = test_of(test, settings.tau_max).map_err(raised)?;
    let job = Job { method: method.to_owned(), settings, plus, parents, latent, joint };
    let found = watched(py, &Means::all_cores(), move |control| job.run(&data, test.as_ref(), control));
    as_dict(py, found.map_err(|error| own_exception(failure.as_ref(), error))?)
}

fn as_dict(py: Python<'_>, result: PcmciResult) -> PyResult<Bound<'_, PyDict>> {
    let out = PyDict::new(py);
    out.set_item("graph", result.graph.mapv(code).into_pyarray(py))?;
    out.set_item("val_matrix", result.val_matrix.into_pyarray(py))?;
    out.set_item("p_matrix", result.p_matrix.into_pyarray(py))?;
    out.set_item("q_matrix", result.q_matrix.map(|q| q.into_pyarray(py)))?;
    out.set_item("conf_matrix", result.conf_matrix.map(|conf| limits(&conf).into_pyarray(py)))?;
    let node = |node: &Node| (node.var, node.lag);
    let nodes = |list: &[Node]| list.iter().map(node).collect::<Vec<_>>();
    let parents: Vec<_> = result.parents.iter().map(|of| nodes(&of.parents)).collect();
    out.set_item("parents", parents)?;
    let candidates = result.parents.iter().map(|of| {
        of.candidates.iter().map(|c| (c.node.var, c.node.lag, c.val_min, c.pval_max)).collect::<Vec<_>>()
    });
    out.set_item("candidates", candidates.collect::<Vec<_>>())?;
    out.set_item("optimal_alpha", result.optimal_alpha)?;
    let sepsets: Vec<_> =
        result.sepsets.iter().map(|s| (node(&s.cause), s.effect, nodes(&s.conditions))).collect();
    out.set_item("sepsets", sepsets)?;
    let triples: Vec<_> = result.ambiguous_triples.iter().map(|(i, k, j)| (node(i), *k, *j)).collect();
    out.set_item("ambiguous_triples", triples)?;
    out.set_item("remarks", result.remarks)?;
    Ok(out)
}

/// Its place among all marks; `MARKS` in results.py has the same order.
fn code(mark: LinkMark) -> u8 {
    LinkMark::ALL.iter().position(|known| *known == mark).unwrap_or_default() as u8
}

/// Confidence limits, lower and upper; 0 where there are none, as in the reference.
fn limits(conf: &Array3<Option<(f64, f64)>>) -> Array4<f64> {
    let (i, j, lags) = conf.dim();
    Array4::from_shape_fn((i, j, lags, 2), |(i, j, lag, side)| {
        conf[[i, j, lag]].map_or(0.0, |(low, high)| if side == 0 { low } else { high })
    })
}

/// Value, p-value, confidence interval, samples used, and whether the test decides by its value.
type Answer = (f64, f64, Option<(f64, f64)>, usize, bool);

/// One test `x _||_ y | z` on nodes `(variable, lag)`: value, p-value, confidence interval, samples used, and whether the test
/// decides by its value.
#[pyfunction]
#[pyo3(signature = (frame, test, x, y, z, cut_off))]
pub(crate) fn run_test(
    py: Python<'_>,
    frame: &Frame,
    test: &Bound<'_, PyAny>,
    x: (usize, usize),
    y: (usize, usize),
    z: Vec<(usize, usize)>,
    cut_off: usize,
) -> PyResult<Answer> {
    let data = frame.data.clone();
    let node = |(var, lag): (usize, usize)| Node::new(var, lag);
    let (x, y, z): (_, _, Vec<Node>) = (node(x), node(y), z.into_iter().map(node).collect());
    let outside = |node: &&Node| node.var >= data.n_vars() || node.lag > cut_off;
    if let Some(node) = [x, y].iter().chain(&z).find(outside) {
        let (var, lag, last) = (node.var, node.lag, data.n_vars() - 1);
        let reason = format!("({var}, -{lag}) is outside: variables are 0 to {last}, lags at most {cut_off}");
        return Err(raised(Error::param("node", reason)));
    }
    let (test, failure) = test_of(test, cut_off).map_err(raised)?;
    let found = watched(py, &Means::all_cores(), move |control| {
        let samples = Samples::new(&data, cut_off).with_control(control.clone());
        let result = test.prepare(&samples)?.run_test(x, y, &z)?;
        Ok((result.value, result.p_value, result.confidence, result.n_samples, test.decides_by_value()))
    });
    found.map_err(|error| own_exception(failure.as_ref(), error))
}

/// P-values corrected for many tests by Benjamini and Hochberg, over the entries in `tested`.
#[pyfunction]
pub(crate) fn fdr_bh<'py>(
    py: Python<'py>,
    p_matrix: PyReadonlyArray3<'py, f64>,
    tested: PyReadonlyArray3<'py, bool>,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let (p_matrix, tested) = (p_matrix.as_array().to_owned(), tested.as_array().to_owned());
    if p_matrix.dim() != tested.dim() {
        return Err(raised(Error::param("tested", "its shape differs from that of the p-values")));
    }
    Ok(methods::fdr_bh(&p_matrix, &tested).into_pyarray(py))
}
