//! The nodes: wiring only. Topic names live here; the meaning of messages lives in `state`, `batch` and
//! `discovery`.

mod advisor;
mod data;
mod data_params;
mod discovery;
mod discovery_params;
mod health;
mod human;
mod link_ages;
mod markers;
mod model_changes;
pub mod model_messages;
mod planner_speed;
mod reasoning;
mod reasoning_messages;
mod reasoning_params;
mod reasoning_rows;
mod reasoning_score;
mod recorded_changes;
mod regime;
mod robot;
mod scene_params;

use std::{
    path::PathBuf,
    pin::pin,
    task::{Context, Poll, Waker},
};

use roscausal_msgs::Wires;

use crate::{
    Error, Result,
    batch::postprocess::Postprocess,
    loopback::Loopback,
    middleware::Middleware,
    params::{ParamSpec, Params, Value, instead},
};

pub use advisor::{advisor, watchdog};
pub use data::{FEATURES_TOPIC, Recorded, data, data_task, data_with};
pub use discovery::{EVIDENCE_FOLDER, EVIDENCE_TOPIC, discovery, discovery_with};
pub use human::human;
pub use markers::markers;
pub use model_changes::CHANGES_TOPIC;
pub use reasoning::{
    CANCEL_SERVICE, EFFECT_SERVICE, EXPLAIN_SERVICE, PREDICTION_TOPIC, ROUTE_COSTS_TOPIC, ROUTE_SERVICE,
    STRUCTURAL_MODEL_TOPIC, WHAT_IF_SERVICE, reasoning, reasoning_beside,
};
pub use recorded_changes::{CHANGES_FOLDER, RecordedChange, recorded_changes};
pub use robot::robot;
pub use scene_params::SceneOptions;

/// Labels of what nodes say of a recording in diagnostics.
pub mod labels {
    /// The human node: its list of names, and numbers that seem to be of one person.
    pub const NAMES: &str = "numbers of names";
    /// Numbers that began where another had ended.
    pub const CHANGED: &str = "numbers that changed";
    /// The data node: how close rows are, compared with sightings.
    pub const PER_ROW: &str = "sightings for 100 rows";
    /// How far the moments of rows are from even, or their values reach ahead of them.
    pub const AHEAD: &str = "rows uneven or ahead, 1/1000 of a step";
    /// How much of the time the robot keeps following people.
    pub const FOLLOWS: &str = "rows in which the robot follows, of 100 in which both move";
    /// Before a topic: the longest time without messages of it.
    pub const SILENCE: &str = "most seconds without ";
    /// How often somebody was at once farther away than anybody runs.
    pub const LEAPS: &str = "jumps farther than anybody runs (perhaps two people with one number)";
    /// How often a clock jumped.
    pub const JUMPS: &str = "clock jumps";
    /// Messages that were left out, by the reason.
    pub const LOST: [&str; 9] =
        [LATE, UNPAIRED, UNSTAMPED, NO_TRANSFORM, NOT_FINITE, UNREADABLE, TOO_LATE, FOREIGN, SIGNALS_UNREAD];
    pub(super) const LATE: &str = "out of order";
    pub(super) const UNPAIRED: &str = "poses without odometry";
    pub(super) const UNSTAMPED: &str = "without stamp";
    /// A transform that did not come.
    pub const NO_TRANSFORM: &str = "no transform in time";
    pub(super) const NOT_FINITE: &str = "not finite";
    pub(super) const UNREADABLE: &str = "not readable";
    pub(super) const TOO_LATE: &str = "too late";
    pub(super) const FOREIGN: &str = "in another frame";
    pub(super) const SIGNALS_UNREAD: &str = "messages of signals not read";
}

/// Expands `~` to the home folder.
pub(crate) fn path(text: &str) -> PathBuf {
    match (text.strip_prefix("~/"), std::env::var_os("HOME")) {
        (Some(rest), Some(home)) => PathBuf::from(home).join(rest),
        _ => PathBuf::from(text),
    }
}

/// Names of the nodes, as users start them.
pub const NODES: [&str; 8] =
    ["robot", "human", "data", "discovery", "markers", "reasoning", "advisor", "watchdog"];

/// Runs the node `name` until the middleware ends.
///
/// # Errors
/// An unknown name, a parameter that is not allowed, or a topic that cannot be used.
pub fn run<M: Middleware>(name: &str, mw: &M) -> Result<()> {
    match name {
        "robot" => robot(mw),
        "human" => human(mw),
        "data" => data(mw),
        "discovery" => discovery(mw),
        "markers" => markers(mw),
        "reasoning" => reasoning(mw),
        "advisor" => advisor(mw),
        "watchdog" => watchdog(mw),
        _ => Err(unknown_node(name)),
    }
}

/// Like [`run`], as a future for [`crate::loopback::Loopback::start_task`]. Only for nodes that wait for nothing
/// but their inbox: robot, human, data and markers.
///
/// # Errors
/// As [`run`]. The discovery node and the reasoning node are refused, because they compute for a long time.
pub async fn run_task<M: Middleware>(name: &str, mw: &M) -> Result<()> {
    match name {
        "robot" => robot::robot_task(mw).await,
        "human" => human::human_task(mw).await,
        "data" => data::data_task(mw, |_| {}).await,
        "markers" => markers::markers_task(mw).await,
        "discovery" | "reasoning" | "advisor" | "watchdog" => {
            Err(Error::Middleware(format!("the {name} node needs a thread of its own")))
        }
        _ => Err(unknown_node(name)),
    }
}

/// Runs a node on a thread of its own. Its inbox blocks, so one poll runs the node to its end.
fn to_its_end(node: impl Future<Output = Result<()>>) -> Result<()> {
    match pin!(node).poll(&mut Context::from_waker(Waker::noop())) {
        Poll::Ready(ended) => ended,
        Poll::Pending => Err(Error::Middleware("a task must be run by 'nodes::run_task'".into())),
    }
}

/// The parameters of the node `name` with the defaults of ROS-Causal, which hold everywhere but on ROS 2: for documentation, and for
/// backends that declare them.
///
/// # Errors
/// An unknown name.
pub fn parameters(name: &str) -> Result<Vec<ParamSpec>> {
    parameters_on(name, Wires::Both)
}

/// As [`parameters`], with the defaults on a middleware of these wires.
///
/// # Errors
/// An unknown name.
pub fn parameters_on(name: &str, wires: Wires) -> Result<Vec<ParamSpec>> {
    match name {
        "robot" => Ok(robot::specs(wires)),
        "human" => Ok(human::specs()),
        "data" => Ok(data_params::specs()),
        "discovery" => Ok(discovery_params::specs()),
        "markers" => Ok(SceneOptions::specs()),
        "reasoning" => Ok(reasoning_params::specs()),
        "advisor" => Ok(advisor::specs()),
        "watchdog" => Ok(advisor::watchdog_specs()),
        _ => Err(unknown_node(name)),
    }
}

/// The data node's post-processing with these of its parameters, and the others at their defaults.
///
/// # Errors
/// A parameter that is not allowed.
pub fn postprocess(given: &[(String, Value)]) -> Result<Postprocess> {
    let bus = Loopback::lockstep();
    given.iter().for_each(|(name, value)| bus.set_node_param("data", name, value.clone()));
    data_params::built_in(&Params::read(&bus.node("data"), &data_params::specs())?)
}

/// A topic in the namespace of the robot `name`; the topic itself if the name is empty: a relative one, such as ours, is then in the
/// node's own namespace.
///
/// # Errors
/// A name that is not a namespace, as an error of the parameter.
pub(crate) fn in_namespace(parameter: &str, name: &str, topic: &str) -> Result<String> {
    let name = name.trim().trim_matches('/');
    let legal = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let is_name = |part: &str| part.chars().all(legal) && !part.starts_with(|c: char| c.is_ascii_digit());
    if !name.is_empty() && !name.split('/').all(|part| !part.is_empty() && is_name(part)) {
        let reason = format!("'{name}' is not a namespace; use letters, digits and '_', such as robot1");
        return Err(Error::param(parameter, reason));
    }
    let below = topic.trim_start_matches('/');
    Ok(if name.is_empty() { topic.to_owned() } else { format!("/{name}/{below}") })
}

fn unknown_node(name: &str) -> Error {
    Error::param("node", format!("there is no node '{name}'; {}", instead(&NODES, name, "nodes:")))
}

#[cfg(test)]
mod tests {
    use std::{fmt::Write, fs, path::Path};

    use super::*;
    use crate::params::{Allowed, Value};

    fn documentation() -> String {
        let mut text = String::from(
            "# Parameters of the nodes\n\nThis page is generated from the nodes' own tables. Set a parameter with \
             `_name:=value` (ROS 1) or `-p name:=value` (ROS 2). The spellings `True`, `\"0.1\"`, and `\"\"` for none are \
             accepted.\n\nA parameter marked * can be set while the node runs in ROS 2 (`ros2 param set`): it is checked as at the start \
             and holds from the next batch on. All others are read when the node starts; to set one is refused with the way out. In \
             ROS 1 nodes read the parameter server when they start, and `rosparam set` gives no reply.\n",
        );
        for node in NODES {
            let _ = write!(
                text,
                "\n## {node}\n\n| parameter | default | allowed | meaning |\n|---|---|---|---|\n"
            );
            let on_ros2 = parameters_on(node, Wires::Ros2).expect("a node");
            for (spec, on_ros2) in parameters(node).expect("a node").into_iter().zip(on_ros2) {
                let allowed = match (&spec.allowed, &spec.default) {
                    (Allowed::Range(low, high), _) => format!("{low} to {high}"),
                    (Allowed::OneOf(words), _) => words.join(", "),
                    (Allowed::Any, Value::Bool(_)) => "true, false".into(),
                    (Allowed::Any, Value::Int(_)) => "integer".into(),
                    (Allowed::Any, Value::Double(_)) => "number or empty".into(),
                    (Allowed::Any, Value::Str(_)) => "text".into(),
                    (Allowed::Any, Value::List(_)) => "list".into(),
                };
                let spelled = |default: &Value| match default.to_string() {
                    empty if empty.is_empty() => "(empty)".to_owned(),
                    default => format!("`{default}`"),
                };
                let mut default = spelled(&spec.default);
                if on_ros2.default != spec.default {
                    let _ = write!(default, "; ROS 2: {}", spelled(&on_ros2.default));
                }
                let mark = if spec.live { " *" } else { "" };
                let _ = writeln!(
                    text,
                    "| `{}`{mark} | {default} | {allowed} | {} |",
                    spec.name, spec.description
                );
            }
        }
        text
    }

    /// `ROSCAUSAL_WRITE_DOCS=1 cargo test -p roscausal_core documented` rewrites the page.
    #[test]
    fn every_parameter_is_documented_as_it_is() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/parameters.md");
        if std::env::var_os("ROSCAUSAL_WRITE_DOCS").is_some() {
            fs::write(&path, documentation()).expect("writes");
        }
        let written = fs::read_to_string(&path).unwrap_or_default();
        assert!(written == documentation(), "docs/parameters.md is old: run with ROSCAUSAL_WRITE_DOCS=1");
    }

    #[test]
    fn the_defaults_are_allowed_and_no_parameter_is_there_twice() {
        for node in NODES {
            let specs = parameters(node).expect("a node");
            for (i, spec) in specs.iter().enumerate() {
                assert_eq!(spec.checked(spec.default.clone()).expect(spec.name), spec.default);
                assert!(
                    specs[..i].iter().all(|other| other.name != spec.name),
                    "{node}: {} twice",
                    spec.name
                );
                assert!(!spec.description.is_empty() && !spec.description.contains('|'));
            }
        }
        let error = parameters("robt").expect_err("unknown").to_string();
        assert!(error.contains("did you mean 'robot'?"), "{error}");
    }
}
