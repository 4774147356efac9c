//! The nodes: wiring only. Topic names live here; what messages mean lives in `state`, `batch` and `discovery`.

mod discovery;
mod discovery_params;
mod health;
pub mod model_messages;
mod robot;

use std::path::PathBuf;

pub use discovery::{discovery, discovery_with};
pub use robot::robot;

/// A folder as users write it: `~` is the home folder.
fn path(text: &str) -> PathBuf {
    match (text.strip_prefix("~/"), std::env::var_os("HOME")) {
        (Some(rest), Some(home)) => PathBuf::from(home).join(rest),
        _ => PathBuf::from(text),
    }
}
