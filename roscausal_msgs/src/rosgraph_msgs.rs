//! `rosgraph_msgs`.

use serde::{Deserialize, Serialize};

use crate::{Time, std_msgs::Header};

/// `rosgraph_msgs/Clock`: simulated time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Clock {
    /// The current time.
    pub clock: Time,
}
message!("rosgraph_msgs" Clock uses []);

/// `rosgraph_msgs/Log`: the messages on ROS 1's `/rosout`. ROS 2 has `rcl_interfaces/Log` instead, with other
/// fields.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Log {
    /// Time of the message.
    pub header: Header,
    /// One of the constants of this type.
    pub level: u8,
    /// The node.
    pub name: String,
    /// The message.
    pub msg: String,
    /// Source file.
    pub file: String,
    /// Function in it.
    pub function: String,
    /// Line in it.
    pub line: u32,
    /// Topics that the node publishes.
    pub topics: Vec<String>,
}
message!("rosgraph_msgs" Log on Ros1 uses [Header]);

impl Log {
    /// Detail for developers.
    pub const DEBUG: u8 = 1;
    /// Information.
    pub const INFO: u8 = 2;
    /// A warning.
    pub const WARN: u8 = 4;
    /// Something failed.
    pub const ERROR: u8 = 8;
    /// The node cannot continue.
    pub const FATAL: u8 = 16;
}
