//! The nodes: wiring only. Topic names live here; what messages mean lives in `state`, `batch` and `discovery`.

mod agents;
mod data;
mod data_params;
mod discovery;
mod discovery_params;
mod health;
mod human;
pub mod model_messages;
mod robot;

use std::path::PathBuf;

use crate::{Error, Result, batch::header, middleware::Middleware, params::ParamSpec};

pub use data::{data, data_with};
pub use discovery::{discovery, discovery_with};
pub use human::human;
pub use robot::robot;

/// A folder as users write it: `~` is the home folder.
fn path(text: &str) -> PathBuf {
    match (text.strip_prefix("~/"), std::env::var_os("HOME")) {
        (Some(rest), Some(home)) => PathBuf::from(home).join(rest),
        _ => PathBuf::from(text),
    }
}

/// Names of the nodes, as users start them.
pub const NODES: [&str; 4] = ["robot", "human", "data", "discovery"];

/// Runs the node `name` until the middleware ends.
///
/// # Errors
/// An unknown name, a parameter that is not allowed, a topic that cannot be used.
pub fn run<M: Middleware>(name: &str, mw: &M) -> Result<()> {
    match name {
        "robot" => robot(mw),
        "human" => human(mw),
        "data" => data(mw),
        "discovery" => discovery(mw),
        _ => Err(unknown_node(name)),
    }
}

/// The parameters of the node `name`: for documentation, and for backends that declare them.
///
/// # Errors
/// An unknown name.
pub fn parameters(name: &str) -> Result<Vec<ParamSpec>> {
    match name {
        "robot" => Ok(robot::specs()),
        "human" => Ok(human::specs()),
        "data" => Ok(data_params::specs()),
        "discovery" => Ok(discovery_params::specs()),
        _ => Err(unknown_node(name)),
    }
}

fn unknown_node(name: &str) -> Error {
    let hint = header::nearest(&NODES, name).map_or(String::new(), |near| format!("did you mean '{near}'? "));
    Error::param("node", format!("there is no node '{name}'; {hint}nodes: {}", NODES.join(", ")))
}
