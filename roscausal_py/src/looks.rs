//! A model as text, graph file or picture.

use std::borrow::Cow;

use numpy::PyReadonlyArray2;
use pyo3::{prelude::*, types::PyBytes};
use roscausal_discovery::{Error, Model, draw};

use crate::errors::{raised, raised_by_program};

/// The model of this JSON as `text`, `dot`, `graphml`, `csv`, `dag`, `tsdag` (both SVG) or `json` (as in a file), or the `level` that
/// decided on its links, with its name.
#[pyfunction]
pub(crate) fn export(model: &str, what: &str) -> PyResult<String> {
    let model = Model::from_json(model.as_bytes()).map_err(raised)?;
    match what {
        "text" => Ok(roscausal::text(&model)),
        "dot" => Ok(roscausal::dot(&model)),
        "graphml" => Ok(roscausal::graphml(&model)),
        "csv" => {
            let table = roscausal::links_csv(&model).map_err(raised_by_program)?;
            Ok(String::from_utf8_lossy(&table).into_owned())
        }
        "dag" => Ok(draw::dag(&model)),
        "tsdag" => Ok(draw::tsdag(&model)),
        "json" => Ok(model.to_file_json()),
        "level" => {
            let (name, level) = model.link_level_in_words();
            Ok(format!("{name} {level}"))
        }
        other => Err(raised(Error::param("what", format!("'{other}' is not a model format")))),
    }
}

/// The series (T, N) as SVG.
#[pyfunction]
#[pyo3(signature = (names, values, dt=None))]
pub(crate) fn series(names: Vec<String>, values: PyReadonlyArray2<'_, f64>, dt: Option<f64>) -> String {
    draw::series(&names, &[], values.as_array(), dt)
}

/// An SVG picture as PNG, `scale` pixels per unit.
#[pyfunction]
pub(crate) fn picture<'py>(py: Python<'py>, svg: &str, scale: f32) -> PyResult<Bound<'py, PyBytes>> {
    Ok(PyBytes::new(py, &py.detach(|| draw::rasterise(svg, scale)).map_err(raised)?.png))
}

/// An SVG picture as a PDF file of one page.
#[pyfunction]
pub(crate) fn pdf<'py>(py: Python<'py>, svg: &str) -> PyResult<Bound<'py, PyBytes>> {
    Ok(PyBytes::new(py, &py.detach(|| draw::pdf(svg)).map_err(raised)?))
}

/// A line of text with what a terminal would obey, or no reader would see, spelled out: `<U+001B>`.
#[pyfunction]
pub(crate) fn visible(text: &str) -> Cow<'_, str> {
    roscausal_discovery::visible::line(text)
}
