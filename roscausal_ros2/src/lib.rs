//! ROS 2 backend: [`roscausal_core::middleware::Middleware`] over `ros2-client`, in pure Rust. It needs no ROS
//! installation, neither to build nor to run. Names, parameters and their files are in `roscausal_rcl`; the node's
//! side of DDS is in `roscausal_rmw`.

mod args;
mod node;
mod program;
mod rosout;
mod services;
mod wire;

pub use args::Args;
pub use node::Ros2;
