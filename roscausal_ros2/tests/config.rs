//! `config/ros2.yaml` holds every parameter of every node, with its default and description. To rewrite it, run
//! `ROSCAUSAL_WRITE_DOCS=1 cargo test -p roscausal_ros2 --test config`.
#![allow(clippy::expect_used, clippy::panic, reason = "a file that is not as it must be fails the test")]

use std::{fmt::Write, path::PathBuf};

use roscausal_core::{
    nodes,
    params::{Allowed, ParamSpec, Value},
};
use roscausal_ros2::{Args, ParamFile};

/// Where the usual robot of ROS 2, with Nav2, differs from the nodes' defaults, which are those of ROS-Causal 1.x. Its pose is
/// its place in TF: `/amcl_pose` comes only now and then. Its goal is the end of the plan: goals of the action NavigateToPose are on no
/// topic.
const NAV2: [(&str, &str, &str); 5] = [
    ("roscausal_robot", "odom_topic", "/odom"),
    ("roscausal_robot", "pose_topic", ""),
    ("roscausal_robot", "source_frame", "base_link"),
    ("roscausal_robot", "goal_topic", "/plan"),
    ("roscausal_robot", "goal_type", "Path"),
];

fn path(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../config").join(name)
}

fn spelled(value: &Value) -> String {
    match value {
        Value::Str(text) => format!("{text:?}"),
        Value::Double(number) => format!("{number:?}"),
        Value::List(items) => format!("[{}]", items.iter().map(spelled).collect::<Vec<_>>().join(", ")),
        value => value.to_string(),
    }
}

fn allowed(spec: &ParamSpec) -> String {
    match spec.allowed {
        Allowed::Any => String::new(),
        Allowed::Range(from, to) => format!(" ({from:?} to {to:?})"),
        Allowed::OneOf(words) => format!(" (one of: {})", words.join(", ")),
    }
}

fn all() -> Vec<(String, Vec<ParamSpec>)> {
    let nodes = nodes::NODES
        .iter()
        .map(|name| (format!("roscausal_{name}"), nodes::parameters(name).expect("a node")));
    let more = [
        ("roscausal_dashboard".to_owned(), roscausal_dashboard::parameters()),
        ("roscausal_hrisim".to_owned(), roscausal_hrisim::node::parameters()),
    ];
    nodes.chain(more).collect()
}

fn generated() -> String {
    let mut text =
        "# Every parameter of every node, with its default; the robot's topics are those of Nav2. Copy the parameters that you change.\n"
            .to_owned();
    for (node, specs) in all() {
        let _ = write!(text, "\n{node}:\n  ros__parameters:\n");
        for spec in specs.iter().filter(|spec| !spec.name.starts_with('/')) {
            let _ = writeln!(text, "    # {}{}", spec.description, allowed(spec));
            let nav2 = NAV2.iter().find(|(of, name, _)| (*of, *name) == (node.as_str(), spec.name));
            let value = nav2.map_or(spec.default.clone(), |(_, _, value)| Value::Str((*value).to_owned()));
            let _ = writeln!(text, "    {}: {}", spec.name, spelled(&value));
        }
    }
    text
}

#[test]
fn the_parameter_file_holds_every_parameter() {
    let path = path("ros2.yaml");
    if std::env::var_os("ROSCAUSAL_WRITE_DOCS").is_some() {
        // In one step, because the other test reads it at the same time.
        let draft = path.with_extension("yaml.tmp");
        std::fs::write(&draft, generated()).expect("the file is written");
        std::fs::rename(&draft, &path).expect("the file is put in place");
    }
    let text = std::fs::read_to_string(&path).expect("the file is there");
    assert!(text == generated(), "{} is not up to date: run with ROSCAUSAL_WRITE_DOCS=1", path.display());
}

#[test]
fn the_parameter_files_are_read_and_allowed() {
    for file in ["ros2.yaml", "hrisim.yaml"] {
        let mut params = ParamFile::default();
        params.add_file(&path(file)).expect("a parameter file");
        for (node, specs) in all() {
            let line =
                ["--ros-args".to_owned(), "--params-file".to_owned(), path(file).display().to_string()];
            let args = Args::parse(&node, line, |_| None).expect("arguments");
            for (name, value) in args.overrides {
                let spec = specs.iter().find(|spec| spec.name == name);
                let spec = spec.unwrap_or_else(|| panic!("{file}: {node} has no parameter {name}"));
                spec.checked(value).expect("an allowed value");
            }
        }
    }
}
