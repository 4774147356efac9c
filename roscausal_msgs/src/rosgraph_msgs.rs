//! `rosgraph_msgs`.

use serde::{Deserialize, Serialize};

use crate::{Time, std_msgs::Header};

/// `rosgraph_msgs/Clock`: simulated time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Clock {
    /// Time of now.
    pub clock: Time,
}
message!("rosgraph_msgs" Clock uses []);

/// `rosgraph_msgs/Log`: what ROS 1's `/rosout` carries. ROS 2's is `rcl_interfaces/Log`, with other fields.
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
    /// News.
    pub const INFO: u8 = 2;
    /// Something is not as it should be.
    pub const WARN: u8 = 4;
    /// Something failed.
    pub const ERROR: u8 = 8;
    /// The node cannot go on.
    pub const FATAL: u8 = 16;
}
