//! Settings that lie beside the data: those that a recording was made with, and `roscausal.toml`.
//!
//! They become flags, placed before the user's own. A flag that the user gives takes precedence, and what is used is told.
//! Sources, the first one that names a flag wins:
//! 1. the recording's own: metadata in an MCAP file, or `FILE.roscausal.toml` beside any recording;
//! 2. `roscausal.toml` in the data's folder.
//!
//! In these files the keys are the command's flags (`tau-max = 3`) and, in tables, the nodes' parameters
//! (`[data]`, `risk_lag = 1`).

use std::{
    collections::BTreeMap,
    ffi::OsString,
    fs,
    path::{Path, PathBuf},
};

use clap::{ArgMatches, parser::ValueSource};
use roscausal_core::{Error, Result, params::nearest};
use roscausal_discovery::{
    independence_tests::{Significance, draws, spelled},
    methods::{Method, Reads},
};
use toml::{Table, Value};

use crate::{cli, flags, recording};

/// Name of the file beside the data.
pub(crate) const FILE: &str = "roscausal.toml";
/// Subcommands that read data, and their positional argument.
const READERS: [(&str, &str); 3] = [("discover", "files"), ("roll", "files"), ("replay", "recording")];
/// Flags that only some methods read.
const OF_METHODS: [(&str, Reads); 6] = [
    ("pc-alpha", Reads::PcAlpha),
    ("f-alpha", Reads::FAlpha),
    ("te-estimator", Reads::TeEstimator),
    ("max-sets", Reads::MaxSets),
    ("no-extra-conditions", Reads::ExtraConditions),
    ("acts-on", Reads::ActsOn),
];
/// Flags that only one test reads.
const OF_TESTS: [(&str, &str); 4] =
    [("gp-search", "gpdc"), ("gp-restarts", "gpdc"), ("null-dist", "gpdc"), ("shuffle-stop", "cmiknn")];
/// Flags that say how p-values are made, beside those of one test.
const OF_P_VALUES: [&str; 2] = ["significance", "shuffles"];

/// Settings from one place.
#[derive(Debug, Default, PartialEq)]
struct Found {
    place: PathBuf,
    /// Flag, without dashes, and its values.
    flags: Vec<(String, Vec<String>)>,
}

/// The command line with the presets of its data put in, and what to tell about them; `None` if there are none.
///
/// # Errors
/// A file of settings that cannot be read, or names a flag that does not exist.
pub(crate) fn apply(line: &[OsString], matches: &ArgMatches) -> Result<Option<(Vec<OsString>, Vec<String>)>> {
    let Some((name, own)) = matches.subcommand() else { return Ok(None) };
    let Some((_, positional)) = READERS.iter().find(|(reader, _)| *reader == name) else { return Ok(None) };
    let data: Vec<&PathBuf> = own.get_many::<PathBuf>(positional).into_iter().flatten().collect();
    let (mut preset, mut told): (Vec<OsString>, Vec<String>) = (Vec::new(), Vec::new());
    let mut taken: Vec<String> = Vec::new();
    let all = find(&data)?;
    let shuffles = is_by_shuffles(own, &all);
    for found in all {
        let mut used = Vec::new();
        for (flag, values) in &found.flags {
            let says_nothing = || is_given(own, flag) || !suits(own, flag, shuffles);
            if !cli::has_flag(name, flag) || taken.contains(flag) || says_nothing() {
                continue;
            }
            taken.push(flag.clone());
            for value in values {
                let words = if value.is_empty() { format!("--{flag}") } else { format!("--{flag}={value}") };
                used.push(words.clone());
                preset.push(words.into());
            }
        }
        if !used.is_empty() {
            told.push(format!("settings of {}: {}", found.place.display(), used.join(" ")));
        }
    }
    let Some(at) = line.iter().position(|word| word == name).filter(|_| !preset.is_empty()) else {
        return Ok(None);
    };
    let mut whole = line.to_vec();
    whole.splice(at + 1..=at, preset);
    Ok(Some((whole, told)))
}

/// Whether the user gave this flag. `--param` may be given by both.
fn is_given(own: &ArgMatches, flag: &str) -> bool {
    let id = flag.replace('-', "_");
    let given =
        |id: &str| own.try_contains_id(id).is_ok() && own.value_source(id) == Some(ValueSource::CommandLine);
    given(&id)
}

/// Whether p-values are to come from surrogates: by the user's word, else by the one beside the data.
fn is_by_shuffles(own: &ArgMatches, all: &[Found]) -> bool {
    let given = own.try_get_one::<String>("significance").ok().flatten();
    let mut flags = all.iter().flat_map(|found| &found.flags);
    let beside = || flags.find(|(flag, _)| flag == "significance").and_then(|(_, values)| values.first());
    let how = given.or_else(beside).and_then(|word| word.parse::<Significance>().ok());
    how == Some(Significance::ShuffleTest)
}

/// Whether a flag says something to the method and the test that the user names, for which it may not have been set. `shuffles`:
/// whether any test draws surrogates.
fn suits(own: &ArgMatches, flag: &str, shuffles: bool) -> bool {
    let named = |id: &str| own.get_one::<String>(id).filter(|_| is_given(own, id));
    let method = named("method").and_then(|name| name.parse::<Method>().ok());
    let of_methods = OF_METHODS.iter().find(|(name, _)| *name == flag);
    if let (Some(method), Some((_, setting))) = (method, of_methods) {
        return method.reads(*setting);
    }
    let of_test = OF_TESTS.iter().find(|(name, _)| *name == flag);
    let says_how = of_test.is_some() || OF_P_VALUES.contains(&flag);
    if says_how && method.is_some_and(|method| !method.asks_for_p_values()) {
        return false;
    }
    let Some(test) = named("test") else { return true };
    if flag == "shuffles" {
        return draws(test, shuffles.then_some(Significance::ShuffleTest));
    }
    of_test.is_none_or(|(_, reader)| spelled(test) == *reader)
}

/// The settings beside each of these files or folders, in the order in which they count.
fn find(data: &[&PathBuf]) -> Result<Vec<Found>> {
    let mut found: Vec<Found> = Vec::new();
    for path in data.iter().filter(|path| recording::is_recording(path)) {
        let carried = carried(path)?;
        let flag = |(name, value): (&String, &String)| {
            let (node, param) = name.split_once('.')?;
            // The step and the people belong to each recording by itself.
            (node == "discovery").then(|| flags::of_parameter(node, param, value)).flatten()
        };
        let flags =
            carried.iter().filter_map(flag).map(|(flag, value)| (flag.to_owned(), vec![value])).collect();
        found.push(Found { place: (*path).clone(), flags });
        let sidecar = sidecar(path);
        if sidecar.is_file() {
            found.push(Found { flags: flags_in(&read(&sidecar)?, &sidecar)?, place: sidecar });
        }
    }
    for path in data {
        let folder = if path.is_dir() { path.as_path() } else { path.parent().unwrap_or(Path::new("")) };
        let file = folder.join(FILE);
        if file.is_file() && found.iter().all(|found| found.place != file) {
            found.push(Found { flags: flags_in(&read(&file)?, &file)?, place: file });
        }
    }
    Ok(found)
}

/// The nodes' parameters that a recording carries, `NODE.PARAMETER` to value: its own, and those of the file beside it.
///
/// # Errors
/// A file of settings that cannot be read.
pub(crate) fn carried(path: &Path) -> Result<BTreeMap<String, String>> {
    let mut carried = roscausal_recording::settings(path);
    let file = sidecar(path);
    if file.is_file() {
        for (node, value) in read(&file)? {
            let Value::Table(params) = value else { continue };
            for (param, value) in params {
                carried.insert(format!("{node}.{param}"), texts(&value).join(","));
            }
        }
    }
    Ok(carried)
}

/// Writes the flags that a run's nodes were set to into [`FILE`] in `folder`, if there are any.
///
/// # Errors
/// The error of the file system.
pub(crate) fn write(folder: &Path, carried: &BTreeMap<String, String>) -> Result<()> {
    let mut text =
        String::from("# How this run was analysed; 'roscausal discover' and 'roscausal replay' use it.\n");
    let before = text.len();
    for (name, value) in carried {
        let Some(("discovery", param)) = name.split_once('.') else { continue };
        if let Some((flag, value)) = flags::of_parameter("discovery", param, value) {
            text += &format!("{flag} = {}\n", Value::String(value));
        }
    }
    if text.len() == before {
        return Ok(());
    }
    crate::output::write_file(folder, FILE, text.as_bytes()).map(drop)
}

/// `walk.bag.roscausal.toml` for `walk.bag`.
fn sidecar(recording: &Path) -> PathBuf {
    let mut name = recording.as_os_str().to_owned();
    name.push(".");
    name.push(FILE);
    name.into()
}

fn read(file: &Path) -> Result<Table> {
    let text = fs::read_to_string(file).map_err(|error| Error::file(file, error))?;
    text.parse::<Table>().map_err(|error| Error::file(file, error.to_string().trim().replace('\n', " ")))
}

/// The flags that a file names, checked against those that any subcommand has.
fn flags_in(table: &Table, file: &Path) -> Result<Vec<(String, Vec<String>)>> {
    let known = cli::long_flags();
    let mut found = Vec::new();
    for (key, value) in table {
        if let Value::Table(params) = value {
            // The parameters beside one recording belong to that recording.
            let own =
                if file.file_name().is_some_and(|name| name == FILE) { params.clone() } else { Table::new() };
            for (param, value) in own {
                let value = texts(&value).join(",");
                found.push(match flags::of_parameter(key, &param, &value) {
                    Some((flag, value)) => (flag.to_owned(), vec![value]),
                    None if flags::is_unset(key, &param, &value) => continue,
                    None => ("param".into(), vec![format!("{key}.{param}={value}")]),
                });
            }
            continue;
        }
        let flag = key.replace('_', "-");
        if !known.contains(&flag) {
            let hint =
                nearest(&known, &flag).map_or(String::new(), |near| format!("did you mean '{near}'? "));
            let reason = format!(
                "there is no flag '{key}'; {hint}the keys are the flags of 'roscausal discover --help'"
            );
            return Err(Error::file(file, reason));
        }
        match value {
            Value::Boolean(false) => {}
            Value::Boolean(true) => found.push((flag, vec![String::new()])),
            Value::Array(items) if flag == "param" || flag == "feature" => {
                found.push((flag, items.iter().flat_map(texts).collect()));
            }
            other => found.push((flag, vec![texts(other).join(",")])),
        }
    }
    Ok(found)
}

fn texts(value: &Value) -> Vec<String> {
    match value {
        Value::String(text) => vec![text.clone()],
        Value::Array(items) => items.iter().flat_map(texts).collect(),
        other => vec![other.to_string()],
    }
}
