//! The folder of results: model, pictures, tables. Each file is complete or absent.

use std::{
    fs,
    io::Write,
    path::{Path, PathBuf},
};

use ndarray::ArrayView2;
use roscausal_core::{Error, Result};
use roscausal_discovery::{Model, draw};

use crate::export;

/// Pixels per unit of the pictures.
const SCALE: f32 = 2.0;

/// Writes `model.json`, the graphs and the list of links into `dir` and returns their names.
pub(crate) fn write_model(dir: &Path, model: &Model) -> Result<Vec<PathBuf>> {
    let dag = draw::dag(model);
    let tsdag = draw::tsdag(model);
    let files = [
        ("model.json", model.to_file_json().into_bytes()),
        ("links.csv", export::links_csv(model)?),
        ("model.dot", export::dot(model).into_bytes()),
        ("model.graphml", export::graphml(model).into_bytes()),
        ("dag.png", draw::rasterise(&dag, SCALE)?.png),
        ("dag.svg", dag.into_bytes()),
        ("tsdag.png", draw::rasterise(&tsdag, SCALE)?.png),
        ("tsdag.svg", tsdag.into_bytes()),
    ];
    files.iter().map(|(name, bytes)| write_file(dir, name, bytes)).collect()
}

/// Writes a plot of the series, `name.svg`.
pub(crate) fn write_series(
    dir: &Path,
    name: &str,
    names: &[String],
    values: ArrayView2<f64>,
    dt: Option<f64>,
) -> Result<PathBuf> {
    write_file(dir, &format!("{name}.svg"), draw::series(names, values, dt).as_bytes())
}

/// Writes a file under a temporary name and renames it, so that nobody sees an incomplete file.
pub(crate) fn write_file(dir: &Path, name: &str, bytes: &[u8]) -> Result<PathBuf> {
    let path = dir.join(name);
    let temporary = dir.join(format!(".{name}.tmp"));
    let write = || -> std::io::Result<()> {
        fs::create_dir_all(dir)?;
        let mut file = fs::File::create(&temporary)?;
        file.write_all(bytes)?;
        file.sync_all()?;
        fs::rename(&temporary, &path)
    };
    write().map_err(|e| Error::file(&path, e))?;
    Ok(path)
}

/// Copies a batch and its metadata into `dir`.
pub(crate) fn copy_batch(batch: &Path, dir: &Path) -> Result<()> {
    for path in [batch.to_path_buf(), batch.with_extension("json")] {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let bytes = fs::read(&path).map_err(|e| Error::file(&path, e))?;
        write_file(dir, &name, &bytes)?;
    }
    Ok(())
}
