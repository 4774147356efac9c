//! Where the definition of a type comes from: with its messages, from this program, or from `.msg` and `.action` files.
//!
//! The feedback of an action is a topic, `/navigate_to_pose/_action/feedback`, whose type no file holds: ROS 2 makes
//! `nav2_msgs/action/NavigateToPose_FeedbackMessage` of the third part of `NavigateToPose.action`. So does [`Definitions`]; Nav2's own is
//! known.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

use roscausal_msgs::{
    Wires,
    dynamic::{Schema, SchemaError, Wire},
    types,
};

use crate::middleware::RawType;

/// Most types that one type is followed to.
const MOST_TYPES: usize = 500;
/// Longest `.msg` file, bytes.
const LONGEST: u64 = 1 << 20;

/// The third part of Nav2's `NavigateToPose.action`, jazzy.
const NAVIGATE_TO_POSE: &str = "geometry_msgs/PoseStamped current_pose
builtin_interfaces/Duration navigation_time
builtin_interfaces/Duration estimated_time_remaining
int16 number_of_recoveries
float32 distance_remaining
";

/// Folders of `.msg` files: `PACKAGE/msg/NAME.msg` below the folder or below its `share`, as ROS 2 installs them, and
/// `PACKAGE/action/NAME.action`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Definitions {
    folders: Vec<PathBuf>,
}

impl Definitions {
    /// The folders in `msg_path`, separated by `:`, then those of the ROS installations in `AMENT_PREFIX_PATH`.
    pub fn of(msg_path: &str) -> Self {
        let ament = std::env::var("AMENT_PREFIX_PATH").unwrap_or_default();
        let named = msg_path.split(':').filter(|part| !part.is_empty()).map(crate::nodes::path);
        Self { folders: named.chain(std::env::split_paths(&ament)).collect() }
    }

    /// The schema of a type. A definition in IDL, which is not read, counts as none.
    ///
    /// # Errors
    /// A definition that is not to be had, or that cannot be used.
    pub fn schema(&self, kind: &RawType) -> Result<Schema, String> {
        let parse = |definition: &str| Schema::parse(&kind.type_name, definition);
        let reported = |error: SchemaError| format!("{}: {error}", kind.type_name);
        let carried = (!kind.definition.trim().is_empty()).then(|| parse(&kind.definition));
        match carried {
            Some(Err(SchemaError::Idl)) | None => {}
            Some(result) => return result.map_err(reported),
        }
        match (known(kind).or_else(|| self.search(&kind.type_name)), carried) {
            (Some(found), _) => parse(&found).map_err(reported),
            (None, Some(Err(idl))) => Err(reported(idl)),
            (None, _) => Err(format!(
                "the definition of {} is not known: it comes with no message, and no folder of .msg files \
                 (msg_path, AMENT_PREFIX_PATH) has it",
                kind.type_name
            )),
        }
    }

    /// The full definition of a type from the folders: its text and those of all types that it uses.
    fn search(&self, type_name: &str) -> Option<String> {
        let mut whole = self.text(type_name)?;
        let mut waiting = uses(type_name, &whole);
        let mut seen: BTreeSet<String> = [type_name.to_owned()].into();
        while let Some(next) = waiting.pop() {
            if seen.len() < MOST_TYPES
                && seen.insert(next.clone())
                && let Some(text) = self.text(&next).or_else(|| own_text(&next))
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
        let (folder, name) = name.split_once('/').unwrap_or(("msg", name));
        if !is_plain(package) || !is_plain(name) {
            return None;
        }
        match (folder, name.strip_suffix("_FeedbackMessage"), name.strip_suffix("_Feedback")) {
            ("msg", ..) => self.file(package, folder, &format!("{name}.msg")),
            ("action", Some(action), _) => Some(format!(
                "unique_identifier_msgs/UUID goal_id\n{package}/action/{action}_Feedback feedback\n"
            )),
            ("action", _, Some(action)) => {
                let text = self.file(package, folder, &format!("{action}.action"));
                let is_rule = |line: &&str| line.trim_end() == "---";
                let third = |text: String| {
                    let rule = text.lines().filter(is_rule).count() == 2;
                    let after = text.lines().rev().take_while(|line| !is_rule(line));
                    rule.then(|| after.collect::<Vec<_>>().into_iter().rev().collect::<Vec<_>>().join("\n"))
                };
                text.and_then(third)
            }
            _ => None,
        }
    }

    fn file(&self, package: &str, folder: &str, name: &str) -> Option<String> {
        let file = PathBuf::from(package).join(folder).join(name);
        let below = |root: &Path| [root.join("share").join(&file), root.join(&file)];
        self.folders.iter().flat_map(|root| below(root)).find_map(|file| {
            let is_fine = file.metadata().is_ok_and(|what| what.is_file() && what.len() <= LONGEST);
            if is_fine { fs::read_to_string(file).ok() } else { None }
        })
    }
}

/// The text of a ROS 2 type that need not be installed.
fn own_text(type_name: &str) -> Option<String> {
    match type_name {
        "unique_identifier_msgs/UUID" => Some("uint8[16] uuid\n".to_owned()),
        "nav2_msgs/action/NavigateToPose_Feedback" => Some(NAVIGATE_TO_POSE.to_owned()),
        _ => {
            let kind =
                RawType { type_name: type_name.to_owned(), definition: String::new(), wire: Wire::Cdr };
            known(&kind).map(|whole| whole.split("====").next().unwrap_or_default().to_owned())
        }
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
        let word = line.split('#').next()?.split_whitespace().next()?;
        let base = word.split(['[', '<']).next()?.replace("/msg/", "/");
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
