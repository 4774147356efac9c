//! `actionlib_msgs`.

use serde::{Deserialize, Serialize};

use crate::Time;

/// `actionlib_msgs/GoalID`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct GoalID {
    /// When the goal was requested.
    pub stamp: Time,
    /// Its unique name.
    pub id: String,
}
message!("actionlib_msgs" GoalID uses []);
