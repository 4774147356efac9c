//! What the cases have in common: JSON, data, matrices.

#[path = "../golden/csv_file.rs"]
mod csv_file;

pub(crate) use csv_file::read_csv;

use std::path::Path;

use ndarray::{ArrayView, Dimension};
use roscausal_discovery::DataFrame;
use serde_json::Value;

/// Sorted names of the JSON files in a folder.
pub(crate) fn files(folder: &Path) -> Result<Vec<String>, String> {
    let entries = std::fs::read_dir(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let names = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    let mut names: Vec<String> = names.filter(|name| name.ends_with(".json")).collect();
    names.sort();
    Ok(names)
}

/// The JSON of a file.
pub(crate) fn read_json(path: &Path) -> Result<Value, String> {
    let text = std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))?;
    serde_json::from_str(&text).map_err(|e| format!("{}: {e}", path.display()))
}

/// The data of a case: each file is a recording.
pub(crate) fn frame(case: &Value, set: &Path) -> Result<DataFrame, String> {
    let paths = case["csv"].as_array().ok_or("csv is not a list")?;
    let mut recordings = Vec::new();
    let mut names = Vec::new();
    for path in paths {
        let (columns, values) = read_csv(&set.join(path.as_str().ok_or("a path is not text")?))?;
        names = columns;
        recordings.push(values);
    }
    DataFrame::new(recordings, names).map_err(|e| e.to_string())
}

/// A count among the parameters.
pub(crate) fn count(case: &Value, name: &str) -> Result<usize, String> {
    let value = &case["params"][name];
    value.as_u64().map(|v| v as usize).ok_or_else(|| format!("'{name}' is {value}, not a count"))
}

/// A matrix as nested lists.
pub(crate) fn nested<D: Dimension>(matrix: ArrayView<'_, f64, D>) -> Value {
    fn lists(values: &[f64], shape: &[usize]) -> Value {
        match shape {
            [] => values.first().copied().into(),
            [first, rest @ ..] => {
                let size: usize = rest.iter().product();
                (0..*first).map(|k| lists(&values[k * size..(k + 1) * size], rest)).collect()
            }
        }
    }
    lists(&matrix.iter().copied().collect::<Vec<_>>(), matrix.shape())
}
