//! Files of results: models, pictures, tables. Each is complete or absent; `results.rs` makes a set of them.

use std::{fs, io::Read, path::Path};

use ndarray::ArrayView2;
use roscausal_core::{
    Error, Result,
    batch::pool::{folder_of, write_whole},
    bounded, ensure,
};
use roscausal_discovery::{Model, draw};

use crate::export;

/// Pixels per unit of the pictures.
const SCALE: f32 = 2.0;

/// How the graphs of a model are drawn.
#[derive(clap::Args, Clone, Debug, Default)]
#[command(next_help_heading = "Output")]
pub(crate) struct PictureArgs {
    /// What the graphs call a variable, such as `h_v='speed (m/s)'`; may be given several times.
    #[arg(long = "label", value_name = "NAME=LABEL")]
    labels: Vec<String>,
    /// Width of the graphs, such as 85mm for one column of a paper.
    #[arg(long, value_name = "MM", value_parser = millimetres)]
    width: Option<f64>,
    /// Leave out the line above the graphs that says how they were found.
    #[arg(long)]
    no_title: bool,
}

fn millimetres(text: &str) -> std::result::Result<f64, String> {
    let number = text.strip_suffix("mm").unwrap_or(text).trim().parse::<f64>();
    let fits = |width: &f64| (10.0..=2000.0).contains(width);
    number.ok().filter(fits).ok_or_else(|| format!("'{text}' is not a width from 10mm to 2000mm"))
}

impl PictureArgs {
    /// Refuses labels of variables that there are not.
    pub(crate) fn check(&self, model: &Model) -> Result<()> {
        self.labelled(model).map(drop)
    }

    /// The model with labels as names, for pictures.
    fn labelled(&self, model: &Model) -> Result<Model> {
        let mut labelled = model.clone();
        for text in &self.labels {
            let fault = |reason: &str| Err(Error::param("label", format!("'{text}' {reason}")));
            let Some((name, label)) = text.split_once('=') else { return fault("is not NAME=LABEL") };
            let Some(place) = model.features.iter().position(|feature| feature == name) else {
                if model.dropped.iter().any(|dropped| dropped == name) {
                    continue;
                }
                return fault("names no variable of the model");
            };
            label.clone_into(&mut labelled.features[place]);
            for (link, was) in labelled.links.iter_mut().zip(&model.links) {
                for (new, old) in [(&mut link.cause, &was.cause), (&mut link.effect, &was.effect)] {
                    if old == name {
                        label.clone_into(new);
                    }
                }
            }
        }
        Ok(labelled)
    }
}

/// Writes `model.json`, the graphs and the list of links into `dir`.
pub(crate) fn write_model(dir: &Path, model: &Model) -> Result<()> {
    write_model_as(dir, model, &PictureArgs::default())
}

/// As [`write_model`], with the graphs drawn so.
pub(crate) fn write_model_as(dir: &Path, model: &Model, how: &PictureArgs) -> Result<()> {
    let labelled = how.labelled(model)?;
    let [dag, tsdag] = [draw::dag(&labelled), draw::tsdag(&labelled)]
        .map(|svg| draw::fitted(&svg, how.width, !how.no_title));
    let files = [
        ("model.json", model.to_file_json().into_bytes()),
        ("links.csv", export::links_csv(model)?),
        ("model.dot", export::dot(model).into_bytes()),
        ("model.graphml", export::graphml(model).into_bytes()),
        ("dag.png", draw::rasterise(&dag, SCALE)?.png),
        ("dag.pdf", draw::pdf(&dag)?),
        ("dag.svg", dag.into_bytes()),
        ("tsdag.png", draw::rasterise(&tsdag, SCALE)?.png),
        ("tsdag.pdf", draw::pdf(&tsdag)?),
        ("tsdag.svg", tsdag.into_bytes()),
    ];
    files.iter().try_for_each(|(name, bytes)| write_file(dir, name, bytes))
}

/// Writes a picture as `name.svg` and `name.png`.
pub(crate) fn write_picture(dir: &Path, name: &str, svg: &str) -> Result<()> {
    write_file(dir, &format!("{name}.svg"), svg.as_bytes())?;
    write_file(dir, &format!("{name}.png"), &draw::rasterise(svg, SCALE)?.png)
}

/// The units that the `.json` beside a batch names, by variable; none where there is no such file.
pub(crate) fn units_beside(batch: &Path) -> Vec<(String, String)> {
    let json: serde_json::Value = bounded::read_json(&batch.with_extension("json")).unwrap_or_default();
    let columns = json["columns"].as_array().into_iter().flatten();
    let pair = |column: &serde_json::Value| {
        Some((column["name"].as_str()?.to_owned(), column["unit"].as_str()?.to_owned()))
    };
    columns.filter_map(pair).filter(|(_, unit)| !unit.is_empty()).collect()
}

/// Writes a plot of the series, `name.svg`; `units` by variable.
pub(crate) fn write_series(
    dir: &Path,
    name: &str,
    names: &[String],
    units: &[(String, String)],
    values: ArrayView2<f64>,
    dt: Option<f64>,
) -> Result<()> {
    let unit = |name| units.iter().find(|(of, _)| of == name).map_or("", |(_, unit)| unit.as_str());
    let units: Vec<&str> = names.iter().map(unit).collect();
    write_file(dir, &format!("{name}.svg"), draw::series(names, &units, values, dt).as_bytes())
}

/// Writes a file so that nobody sees an incomplete one.
pub(crate) fn write_file(dir: &Path, name: &str, bytes: &[u8]) -> Result<()> {
    write_whole(&dir.join(name), bytes)
}

/// How much of a file is read to see whose it is.
const BEGINNING: u64 = 2048;

/// Makes sure that a file that the user named can be written, before any work: it is new, empty, or an earlier result of the
/// same kind, which has `mark` near its beginning, or `force` is given.
///
/// # Errors
/// A file of others, a folder, or one in which nothing can be written.
pub(crate) fn claim_file(file: &Path, mark: &str, force: bool) -> Result<()> {
    ensure(!file.is_dir(), || Error::file(file, "this is a folder; give the name of a file"))?;
    if is_device(file) {
        return Ok(());
    }
    let own = force || !file.exists() || begins_with(file, mark).map_err(|e| Error::file(file, e))?;
    let reason = "there is another file of this name; choose another name, or overwrite it with --force";
    ensure(own, || Error::file(file, reason))?;
    let folder = folder_of(file);
    fs::create_dir_all(folder).map_err(|e| Error::file(file, e))?;
    tempfile::tempfile_in(folder).map(drop).map_err(|e| Error::file(file, e))
}

/// Whether a file is empty, or has the mark near its beginning.
fn begins_with(file: &Path, mark: &str) -> std::io::Result<bool> {
    let mut bytes = Vec::new();
    fs::File::open(file)?.take(BEGINNING).read_to_end(&mut bytes)?;
    Ok(bytes.is_empty() || bytes.windows(mark.len()).any(|part| part == mark.as_bytes()))
}

/// Whether this is neither a file nor a folder, such as `/dev/stdout` or a pipe.
fn is_device(file: &Path) -> bool {
    fs::metadata(file).is_ok_and(|found| !found.is_file() && !found.is_dir())
}

/// Writes a file of the user's: whole or not at all, except into a device.
pub(crate) fn write_at(file: &Path, bytes: &[u8]) -> Result<()> {
    if is_device(file) {
        return fs::write(file, bytes).map_err(|e| Error::file(file, e));
    }
    write_file(folder_of(file), &file.file_name().unwrap_or_default().to_string_lossy(), bytes)
}

/// Copies a batch and its metadata into `dir`.
pub(crate) fn copy_batch(batch: &Path, dir: &Path) -> Result<()> {
    for path in [batch.to_path_buf(), batch.with_extension("json")] {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        write_file(dir, &name, &fs::read(&path).map_err(|e| Error::file(&path, e))?)?;
    }
    Ok(())
}
