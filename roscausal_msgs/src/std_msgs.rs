//! `std_msgs`.

use serde::{Deserialize, Serialize};

use crate::{Message, Time};

/// `std_msgs/Header` without `seq`, which only the ROS 1 wire has.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header {
    /// Time of acquisition.
    pub stamp: Time,
    /// Frame of the data.
    pub frame_id: String,
}

impl Message for Header {
    const PACKAGE: &'static str = "std_msgs";
    const NAME: &'static str = "Header";
}
