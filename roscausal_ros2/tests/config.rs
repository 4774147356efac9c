//! `config/ros2.yaml` holds every parameter of every node, with its default and description. To rewrite it, run
//! `ROSCAUSAL_WRITE_DOCS=1 cargo test -p roscausal_ros2 --test config`.
#![allow(clippy::expect_used, clippy::panic, reason = "a file that is not as it must be fails the test")]

use std::{fmt::Write, path::PathBuf};

use roscausal_core::{
    loopback::Loopback,
    nodes,
    params::{Allowed, ParamSpec, Value},
};
use roscausal_msgs::Wires;
use roscausal_ros2::{Args, ParamFile};

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
        .map(|name| (format!("roscausal_{name}"), nodes::parameters_on(name, Wires::Ros2).expect("a node")));
    let more = [
        ("roscausal_dashboard".to_owned(), roscausal_dashboard::parameters()),
        ("roscausal_hrisim".to_owned(), roscausal_hrisim::node::parameters()),
    ];
    nodes.chain(more).collect()
}

fn generated() -> String {
    let mut text =
        "# Every parameter of every node, with its default on ROS 2. Copy the parameters that you change. /** is any namespace.\n"
            .to_owned();
    for (node, specs) in all() {
        let _ = write!(text, "\n/**/{node}:\n  ros__parameters:\n");
        for spec in specs.iter().filter(|spec| !spec.name.starts_with('/')) {
            let _ = writeln!(text, "    # {}{}", spec.description, allowed(spec));
            let _ = writeln!(text, "    {}: {}", spec.name, spelled(&spec.default));
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

/// What one of the files sets of a node.
fn set_by(file: &str, node: &str) -> std::collections::BTreeMap<String, Value> {
    let line = ["--ros-args", "--params-file"].map(str::to_owned).into_iter();
    Args::parse(node, line.chain([path(file).display().to_string()]), |_| None).expect("arguments").overrides
}

#[test]
fn nodes_start_with_the_parameter_files_as_they_are() {
    let home = tempfile::tempdir().expect("a folder");
    for file in ["ros2.yaml", "hrisim.yaml"] {
        for name in ["robot", "human", "data", "markers"] {
            let bus = Loopback::lockstep();
            for (parameter, value) in set_by(file, &format!("roscausal_{name}")) {
                let value = if parameter.ends_with("_dir") && value != Value::Str(String::new()) {
                    Value::Str(home.path().join(&parameter).display().to_string())
                } else {
                    value
                };
                bus.set_node_param(name, &parameter, value);
            }
            let node = bus.start_task(name, async move |mw| nodes::run_task(name, &mw).await);
            bus.settle();
            bus.shutdown();
            node.end().expect("no panic").unwrap_or_else(|error| panic!("{file}: {name}: {error}"));
        }
    }
}
