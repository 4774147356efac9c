//! ROS 2 backend: [`roscausal_core::middleware::Middleware`] over `ros2-client`, in pure Rust; no ROS
//! installation is needed, to build or to run.

mod farewell;
mod graph;
mod node;
mod parameters;
mod program;
mod rosout;
mod services;
mod spinner;
mod topics;

pub mod args;
pub mod names;
pub mod param_file;
pub mod security;

pub use args::Args;
pub use node::Ros2;
pub use topics::{Ros2Publisher, Ros2Subscription};
