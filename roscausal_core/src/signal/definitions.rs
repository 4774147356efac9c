//! Where the definition of a type comes from: with its messages, from this program, or from `.msg` files.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

use roscausal_msgs::{
    Wires,
    dynamic::{Schema, Wire},
    types,
};

use crate::middleware::RawType;

/// Most types that one type is followed to.
const MOST_TYPES: usize = 500;
/// Longest `.msg` file, bytes.
const LONGEST: u64 = 1 << 20;

/// Folders of `.msg` files: `PACKAGE/msg/NAME.msg` below the folder or below its `share`, as ROS 2 installs them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Definitions {
    folders: Vec<PathBuf>,
}

impl Definitions {
    /// Definitions from `.msg` files in these folders, the first that has a type counts.
    pub fn in_folders(folders: Vec<PathBuf>) -> Self {
        Self { folders }
    }

    /// The folders in `msg_path`, separated by `:`, then those of the ROS installations in `AMENT_PREFIX_PATH`.
    pub fn of(msg_path: &str) -> Self {
        let ament = std::env::var("AMENT_PREFIX_PATH").unwrap_or_default();
        let named = msg_path.split(':').filter(|part| !part.is_empty()).map(crate::nodes::path);
        Self { folders: named.chain(std::env::split_paths(&ament)).collect() }
    }

    /// The schema of a type.
    ///
    /// # Errors
    /// A definition that is not to be had, or that cannot be used.
    pub fn schema(&self, kind: &RawType) -> Result<Schema, String> {
        let definition = match kind.definition.trim().is_empty() {
            false => kind.definition.clone(),
            true => known(kind).or_else(|| self.search(&kind.type_name)).ok_or_else(|| {
                format!(
                    "the definition of {} is not known: it comes with no message, and no folder of .msg files \
                     (msg_path, AMENT_PREFIX_PATH) has it",
                    kind.type_name
                )
            })?,
        };
        Schema::parse(&kind.type_name, &definition).map_err(|error| format!("{}: {error}", kind.type_name))
    }

    /// The full definition of a type from the folders: its text and those of all types that it uses.
    fn search(&self, type_name: &str) -> Option<String> {
        let mut whole = self.text(type_name)?;
        let mut waiting = uses(type_name, &whole);
        let mut seen: BTreeSet<String> = [type_name.to_owned()].into();
        while let Some(next) = waiting.pop() {
            if seen.len() < MOST_TYPES
                && seen.insert(next.clone())
                && let Some(text) = self.text(&next)
            {
                whole.push_str(&format!("\n{}\nMSG: {next}\n{text}", "=".repeat(80)));
                waiting.extend(uses(&next, &text));
            }
        }
        Some(whole)
    }

    fn text(&self, type_name: &str) -> Option<String> {
        let (package, name) = type_name.split_once('/')?;
        let is_plain =
            |part: &str| !part.is_empty() && part.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
        if !is_plain(package) || !is_plain(name) {
            return None;
        }
        let below = |folder: &Path| {
            let file = PathBuf::from(package).join("msg").join(format!("{name}.msg"));
            [folder.join("share").join(&file), folder.join(&file)]
        };
        self.folders.iter().flat_map(|folder| below(folder)).find_map(|file| {
            let is_fine = file.metadata().is_ok_and(|what| what.is_file() && what.len() <= LONGEST);
            if is_fine { fs::read_to_string(file).ok() } else { None }
        })
    }
}

/// The definition of a type of this program.
fn known(kind: &RawType) -> Option<String> {
    let other = if kind.wire == Wire::Ros1 { Wires::Ros2 } else { Wires::Ros1 };
    let found = types()
        .into_iter()
        .find(|definition| definition.type_name() == kind.type_name && definition.wires != other)?;
    Some(match kind.wire {
        Wire::Ros1 => found.ros1_definition().to_owned(),
        Wire::Cdr => found.ros2_definition().to_owned(),
    })
}

/// The types that the fields of a text name, in full.
fn uses(type_name: &str, text: &str) -> Vec<String> {
    let package = type_name.split('/').next().unwrap_or_default();
    let named = |line: &str| {
        let base = line
            .split('#')
            .next()?
            .split_whitespace()
            .next()?
            .split(['[', '<'])
            .next()?
            .replace("/msg/", "/");
        if base.contains('/') {
            return Some(base);
        }
        if base == "Header" {
            return Some("std_msgs/Header".to_owned());
        }
        base.starts_with(|c: char| c.is_ascii_uppercase()).then(|| format!("{package}/{base}"))
    };
    text.lines().filter_map(named).collect()
}
