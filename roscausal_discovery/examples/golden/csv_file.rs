//! Reads a table of numbers with a header; an empty cell, or `nan`, is a missing value.

use std::path::Path;

use ndarray::Array2;

/// Names of the columns, and the rows.
pub(crate) fn read_csv(path: &Path) -> Result<(Vec<String>, Array2<f64>), String> {
    let fail = |e: &dyn std::fmt::Display| format!("{}: {e}", path.display());
    let mut reader = csv::Reader::from_path(path).map_err(|e| fail(&e))?;
    let names: Vec<String> = reader.headers().map_err(|e| fail(&e))?.iter().map(str::to_owned).collect();
    let mut values = Vec::new();
    for record in reader.records() {
        for cell in &record.map_err(|e| fail(&e))? {
            let cell = cell.trim();
            let missing = cell.is_empty() || cell.eq_ignore_ascii_case("nan");
            values.push(if missing { f64::NAN } else { cell.parse().map_err(|e| fail(&e))? });
        }
    }
    let table =
        Array2::from_shape_vec((values.len() / names.len(), names.len()), values).map_err(|e| fail(&e))?;
    Ok((names, table))
}
