//! Files of settings, and the settings that a recording carries: its own, and those of the file beside it.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use roscausal_core::{Error, Result, bounded};
use toml::{Table, Value};

use crate::{nodes::RECORDING, travel};

/// Name of a file of settings.
pub(crate) const FILE: &str = "roscausal.toml";

/// What a recording carries: parameters of nodes, `NODE.PARAMETER`.
#[derive(Default)]
pub(crate) struct Carried {
    /// Those that data may decide, with their values.
    pub(crate) used: BTreeMap<String, String>,
    /// The others, as [`travel::told`] writes them.
    pub(crate) left_out: Vec<String>,
}

/// The nodes' parameters that a recording carries: its own, and those of the file beside it.
///
/// # Errors
/// A file of settings that cannot be read.
pub(crate) fn carried(path: &Path) -> Result<Carried> {
    let mut all = roscausal_recording::settings(path);
    let file = sidecar(path);
    if file.is_file() {
        for (node, value) in read(&file)? {
            let Value::Table(params) = value else { continue };
            let named =
                |(param, value): (String, Value)| (format!("{node}.{param}"), texts(&value).join(","));
            all.extend(params.into_iter().map(named));
        }
    }
    let mut carried = Carried::default();
    for (name, value) in all {
        let (node, param) = name.split_once('.').unwrap_or(("", &name));
        let is_known = node == "discovery" || RECORDING.contains(&node);
        match is_known && travel::may_set(node, param, &value) {
            true => drop(carried.used.insert(name, value)),
            false => carried.left_out.push(travel::reported(node, param)),
        }
    }
    Ok(carried)
}

/// `walk.bag.roscausal.toml` for `walk.bag`.
pub(crate) fn sidecar(recording: &Path) -> PathBuf {
    let mut name = recording.as_os_str().to_owned();
    name.push(".");
    name.push(FILE);
    name.into()
}

/// A file of settings.
///
/// # Errors
/// A file that cannot be read, or is not TOML.
pub(crate) fn read(file: &Path) -> Result<Table> {
    let text = bounded::read_settings(file)?;
    text.parse::<Table>().map_err(|error| Error::file(file, error.to_string().trim().replace('\n', " ")))
}

/// The texts in a value: each item of an array.
pub(crate) fn texts(value: &Value) -> Vec<String> {
    match value {
        Value::String(text) => vec![text.clone()],
        Value::Array(items) => items.iter().flat_map(texts).collect(),
        other => vec![other.to_string()],
    }
}
