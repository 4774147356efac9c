//! `hri_msgs`, from ROS4HRI (REP-155).

use serde::{Deserialize, Serialize};

use crate::std_msgs::Header;

/// `hri_msgs/IdsList`: who is tracked now.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct IdsList {
    /// Time and frame.
    pub header: Header,
    /// The ids of all who are tracked.
    pub ids: Vec<String>,
}
message!("hri_msgs" IdsList uses [Header]);
