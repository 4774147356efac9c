//! ROS 2 backend: [`roscausal_core::middleware::Middleware`] over `ros2-client`, in pure Rust. It needs no ROS
//! installation, neither to build nor to run. What `rcl` does (names, parameters and their files) is in `rcl/`; the node's
//! side of DDS is in `dds/`.

mod args;
mod dds;
mod distribution;
mod inner;
mod node;
mod program;
mod rcl;
mod rosout;
mod services;
mod wire;

pub use args::Args;
pub use dds::{Publisher, Server, Subscription};
pub use node::Ros2;
pub use rcl::{BadArgument, Enclave, Names, Network, ParamFile, Remap};
