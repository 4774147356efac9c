//! The messages of ROS-Causal and of the nodes' inputs: one Rust type each for both ROS versions.
//!
//! A type carries the metadata of both wires ([`Message`]); the bytes are made by serde formats: CDR for
//! ROS 2 (by the ROS 2 backend's library) and [`ros1`] for ROS 1. `Header` has no `seq` field here: it
//! exists only on the ROS 1 wire, and the ROS 1 codec writes and reads it.

mod time;

pub mod std_msgs;

pub use time::Time;

use serde::{Serialize, de::DeserializeOwned};

/// A ROS message type: its names, and its text on the ROS 1 wire.
///
/// `serde` field order is the wire order of both ROS versions.
pub trait Message:
    Serialize + DeserializeOwned + Clone + Default + std::fmt::Debug + Send + Sync + 'static
{
    /// ROS package, such as `geometry_msgs`.
    const PACKAGE: &'static str;
    /// Type name within the package, such as `Point`.
    const NAME: &'static str;

    /// `package/Name`, the ROS 1 spelling.
    fn type_name() -> String {
        format!("{}/{}", Self::PACKAGE, Self::NAME)
    }
}
