//! What ROS 2's `rcl` does for a node, done as `rcl` does it: names and remaps, parameters and their files, the
//! node's place on the network, and its enclave. It knows nothing of DDS.

mod enclave;
mod names;
mod network;
mod param_file;
mod parameters;

pub use enclave::Enclave;
pub use names::{Names, Remap};
pub use network::Network;
pub use param_file::ParamFile;
pub(crate) use parameters::{Parameters, USE_SIM_TIME, ros2_name};

/// A command line or environment with which a node cannot start: one sentence for the user.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BadArgument(pub String);

impl std::fmt::Display for BadArgument {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for BadArgument {}
