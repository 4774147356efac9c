//! Settings in files: the user's own, and those that come with data.
//!
//! They become flags, placed before the user's own. A flag that the user gives takes precedence, and what is used is told.
//! Sources, the first one that names a flag wins:
//! 1. `roscausal.toml` in the working folder: the user's own;
//! 2. the recording's: metadata in an MCAP file, or `FILE.roscausal.toml` beside any recording;
//! 3. `roscausal.toml` in the data's folder;
//! 4. `roscausal/roscausal.toml` in the user's configuration folder: the user's own.
//!
//! What comes with data may be a stranger's, so only settings of the allow list in `travel.rs` are taken from there. The file in
//! the working folder comes with the data where both are the same folder. Where the data lie below the working folder, or above
//! it, both may be of one archive: then the file may also say where results go within the working folder, and what the analysis may
//! cost, and nothing that runs, opens or replaces.
//!
//! In these files the keys are the command's flags (`tau-max = 3`) and, in tables, the nodes' parameters
//! (`[data]`, `risk_lag = 1`).

use std::{
    collections::BTreeMap,
    ffi::OsString,
    path::{Path, PathBuf},
};

use clap::{Arg, ArgMatches, Command, parser::ValueSource};
use roscausal_core::{Error, Result, batch::pool::folder_of, params::nearest};
use roscausal_discovery::{independence_tests::Significance, methods::Method, settings::setting};
use toml::{Table, Value};

use crate::{
    carried::{FILE, carried, read, sidecar, texts},
    flags, recording, travel,
};

/// The flag that leaves all of them out, as clap names it and as it is written.
const IGNORE: &str = "ignore_settings";
const IGNORE_FLAG: &str = "ignore-settings";
/// Subcommands that read data, and their positional argument.
const READERS: [(&str, &str); 3] = [("discover", "files"), ("roll", "files"), ("replay", "recording")];
/// The format of a table of trajectories.
const TRAJECTORIES: &str = "trajectories";
/// Settings from one place.
#[derive(Debug, Default, PartialEq)]
struct Found {
    place: PathBuf,
    /// Flag, without dashes, and its values.
    flags: Vec<(String, Vec<String>)>,
    /// What came with the data and is none of theirs to say, as [`travel::told`] writes it.
    left_out: Vec<String>,
}

/// The line of `command` with the settings of files put in, and what to tell about them.
///
/// # Errors
/// A file of settings that cannot be read, or names a flag that does not exist.
pub(crate) fn apply(
    line: &[OsString],
    matches: &ArgMatches,
    command: &Command,
) -> Result<(Vec<OsString>, Vec<String>)> {
    let reader = |(name, own)| {
        let (_, positional) = READERS.iter().find(|(reader, _)| *reader == name)?;
        Some((name, own, *positional))
    };
    let reader = matches.subcommand().and_then(reader).filter(|(_, own, _)| !own.get_flag(IGNORE));
    let Some((name, own, positional)) = reader else { return Ok((line.to_vec(), Vec::new())) };
    let data: Vec<&Path> =
        own.get_many::<PathBuf>(positional).into_iter().flatten().map(AsRef::as_ref).collect();
    let (mut preset, mut reported): (Vec<OsString>, Vec<String>) = (Vec::new(), Vec::new());
    let mut taken: Vec<String> = Vec::new();
    let all = find(&data, &flags::all_of(command))?;
    let how = significance(own, &all);
    let beside =
        all.iter().flat_map(|found| &found.flags).any(|(flag, of)| flag == "format" && of == &[TRAJECTORIES]);
    let given =
        own.try_get_raw("format").ok().flatten().is_some_and(|mut of| of.any(|word| word == TRAJECTORIES));
    // Of trajectories parameters are told, too.
    let tables = !beside && !given && !data.iter().any(|path| recording::is_recording(path));
    for found in all {
        let (mut used, mut unknown, mut passed) = (Vec::new(), Vec::new(), Vec::new());
        let before = taken.clone();
        for (flag, values) in &found.flags {
            if arg_of(command, name, flag).is_none() {
                unknown.push(format!("--{flag}"));
                continue;
            }
            if is_given(own, flag) || !suits(own, flag, how) {
                continue;
            }
            if tables && recording::FLAGS.split(' ').any(|of| of == flag) {
                passed.push(format!("--{flag} {}", values.join(" ")));
                continue;
            }
            for value in values {
                let key = key_of(flag, value);
                if before.contains(&key) {
                    continue;
                }
                taken.push(key);
                // Never a flag that would take the user's next word for its value.
                let words = match value.is_empty() && !needs_value(command, name, flag) {
                    true => format!("--{flag}"),
                    false => format!("--{flag}={value}"),
                };
                used.push(words.clone());
                preset.push(words.into());
            }
        }
        let place = found.place.display();
        if !unknown.is_empty() {
            reported.push(format!("{place}: {name} does not have {}: not used", unknown.join(", ")));
        }
        if !passed.is_empty() {
            reported.push(format!("{place}: for recordings, and not used for tables: {}", passed.join(" ")));
        }
        if !used.is_empty() {
            reported.push(format!("settings of {place}: {}", used.join(" ")));
        }
        reported.extend(travel::sentence(&found.place, &found.left_out));
    }
    let mut whole = line.to_vec();
    if let Some(at) = line.iter().position(|word| word == name).filter(|_| !preset.is_empty()) {
        whole.splice(at + 1..=at, preset);
    }
    Ok((whole, reported))
}

/// A long flag of a subcommand, if it has it.
fn arg_of<'a>(command: &'a Command, subcommand: &str, flag: &str) -> Option<&'a Arg> {
    command.find_subcommand(subcommand)?.get_arguments().find(|arg| arg.get_long() == Some(flag))
}

/// Whether this flag of a subcommand has to have a value.
fn needs_value(command: &Command, subcommand: &str, flag: &str) -> bool {
    let mut command = command.clone();
    command.build();
    let range = arg_of(&command, subcommand, flag).and_then(Arg::get_num_args);
    range.is_some_and(|range| range.min_values() > 0)
}

/// What a flag's value decides, of which the first place that names it counts: the flag, or the parameter in `--param`.
fn key_of(flag: &str, value: &str) -> String {
    match value.split_once('=').filter(|_| flag == "param") {
        Some((parameter, _)) => format!("param {parameter}"),
        None => flag.to_owned(),
    }
}

/// Whether the user gave this flag. `--param` may be given by both.
fn is_given(own: &ArgMatches, flag: &str) -> bool {
    let id = setting(flag).map_or_else(|| flag.replace('-', "_"), |setting| setting.id.to_owned());
    own.try_contains_id(&id).is_ok() && own.value_source(&id) == Some(ValueSource::CommandLine)
}

/// How p-values are to be made: by the user's word, else by the one beside the data.
fn significance(own: &ArgMatches, all: &[Found]) -> Option<Significance> {
    let given = own.try_get_one::<String>("significance").ok().flatten();
    let mut flags = all.iter().flat_map(|found| &found.flags);
    let beside = || flags.find(|(flag, _)| flag == "significance").and_then(|(_, values)| values.first());
    given.or_else(beside).and_then(|word| word.parse().ok())
}

/// Whether the method and the test that the user names read a flag, for which it may not have been set.
fn suits(own: &ArgMatches, flag: &str, how: Option<Significance>) -> bool {
    let named = |id: &str| own.get_one::<String>(id).filter(|_| is_given(own, id));
    let Some(setting) = setting(flag) else { return true };
    let method = named("method").and_then(|name| name.parse::<Method>().ok());
    method.is_none_or(|method| setting.method_reads(method, how))
        && named("test").is_none_or(|test| setting.test_reads(test, how))
}

/// The settings for these files or folders of data, in the order in which they count.
fn find(data: &[&Path], known: &[String]) -> Result<Vec<Found>> {
    let beside = folders_beside(data);
    let is_beside = |folder: &Path| {
        folder.canonicalize().is_ok_and(|folder| {
            beside.iter().any(|other| other.canonicalize().is_ok_and(|other| other == folder))
        })
    };
    let here = Path::new(".");
    let mut found = Vec::new();
    if !is_beside(here) {
        let near = is_near(here, data);
        let may_say = |flag: &str, values: &[String]| {
            travel::may_say(flag, values) || travel::may_say_near(flag, values)
        };
        let own = stated(Path::new(FILE), known)?;
        found.extend(own.map(|own| if near { own.allowed(may_say) } else { own }));
    }
    let ignores =
        |found: &[Found]| found.iter().any(|place| place.flags.iter().any(|(flag, _)| flag == IGNORE_FLAG));
    let configuration = configuration().map(|file| stated(&file, known)).transpose()?.flatten();
    if !ignores(&found) && !ignores(configuration.as_slice()) {
        found.extend(with_the_data(data, &beside, known)?);
    }
    found.extend(configuration);
    Ok(found)
}

/// Whether data lie below a folder, or the folder below that of the data: both may have come out of one archive. A link within the
/// folder may have come out of it, too: each folder on the way counts.
fn is_near(folder: &Path, data: &[&Path]) -> bool {
    let Ok(folder) = folder.canonicalize() else { return false };
    let is_within = |place: &Path| place.canonicalize().is_ok_and(|real| real.starts_with(&folder));
    let is_around = |path: &Path| {
        path.canonicalize().is_ok_and(|real| real.parent().is_some_and(|of| folder.starts_with(of)))
    };
    data.iter().any(|path| path.ancestors().any(is_within) || is_around(path))
}

/// The user's file of settings in the user's configuration folder.
fn configuration() -> Option<PathBuf> {
    let set = |name: &str| std::env::var_os(name).filter(|set| !set.is_empty()).map(PathBuf::from);
    let folder = set("XDG_CONFIG_HOME").or_else(|| Some(set("HOME")?.join(".config")));
    folder.map(|folder| folder.join("roscausal").join(FILE))
}

/// What a file says, if it is there.
fn stated(file: &Path, known: &[String]) -> Result<Option<Found>> {
    if !file.is_file() {
        return Ok(None);
    }
    let flags = flags_in(&read(file)?, file, known)?;
    Ok(Some(Found { place: file.to_owned(), flags, left_out: Vec::new() }))
}

/// The folders whose settings came with these data: that of a file; a folder itself, and the one that it lies in.
fn folders_beside(data: &[&Path]) -> Vec<PathBuf> {
    let own = |path: &&Path| path.is_dir().then(|| path.to_path_buf());
    data.iter().flat_map(|path| own(path).into_iter().chain([folder_of(path).to_owned()])).collect()
}

/// The settings that came with these data, as far as data may decide them.
fn with_the_data(data: &[&Path], folders: &[PathBuf], known: &[String]) -> Result<Vec<Found>> {
    let mut found: Vec<Found> = Vec::new();
    for path in data.iter().filter(|path| recording::is_recording(path)) {
        let flag = |(name, value): (&String, &String)| {
            let (node, param) = name.split_once('.')?;
            // The step and the people belong to each recording by itself.
            (node == "discovery").then(|| flags::of_parameter(node, param, value)).flatten()
        };
        let used = carried(path)?.used;
        let flags = used.iter().filter_map(flag).map(|(flag, value)| (flag.to_owned(), vec![value]));
        // What a recording may not decide is told where its parameters are used.
        found.push(Found { place: path.to_path_buf(), flags: flags.collect(), left_out: Vec::new() });
        found.extend(stated(&sidecar(path), known)?.map(|stated| stated.allowed(travel::may_say)));
    }
    for folder in folders {
        let file = folder.strip_prefix(".").unwrap_or(folder).join(FILE);
        if found.iter().all(|found| found.place != file) {
            found.extend(stated(&file, known)?.map(|stated| stated.allowed(travel::may_say)));
        }
    }
    Ok(found)
}

impl Found {
    /// What `may_say` allows of it.
    fn allowed(self, may_say: impl Fn(&str, &[String]) -> bool) -> Self {
        let mut found = Self { place: self.place, ..Self::default() };
        for (flag, values) in self.flags {
            let (used, left_out): (Vec<_>, Vec<_>) =
                values.into_iter().partition(|value| may_say(&flag, std::slice::from_ref(value)));
            for value in left_out {
                let parameter = value.split_once('=').filter(|_| flag == "param");
                let reported = match parameter.and_then(|(name, _)| name.split_once('.')) {
                    Some((node, param)) => travel::reported(node, param),
                    None => format!("--{flag}"),
                };
                if !found.left_out.contains(&reported) {
                    found.left_out.push(reported);
                }
            }
            if !used.is_empty() {
                found.flags.push((flag, used));
            }
        }
        found
    }
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
    if text.len() == before { Ok(()) } else { crate::output::write_file(folder, FILE, text.as_bytes()) }
}

/// The flags that a file names, checked against those that are known of any subcommand.
fn flags_in(table: &Table, file: &Path, known: &[String]) -> Result<Vec<(String, Vec<String>)>> {
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
            let hint = nearest(known, &flag).map_or(String::new(), |near| format!("did you mean '{near}'? "));
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(unix)]
    fn data_behind_a_link_within_the_folder_are_near() {
        let dir = tempfile::tempdir().expect("a folder");
        let at = |name: &str| dir.path().join(name);
        for folder in ["work/d", "else"] {
            std::fs::create_dir_all(at(folder)).expect("made");
        }
        for file in ["work/own.csv", "else/t.csv"] {
            std::fs::write(at(file), "a,b\n").expect("written");
        }
        std::os::unix::fs::symlink(at("else/t.csv"), at("work/d/t.csv")).expect("a link");
        std::os::unix::fs::symlink(at("else"), at("work/e")).expect("a link");
        let near = |data: &str| is_near(&at("work"), &[&at(data)]);
        assert!(near("work/own.csv") && near("work/d/t.csv") && near("work/e/t.csv"));
        assert!(!near("else/t.csv"));
    }
}
