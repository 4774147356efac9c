//! `move_base_msgs`; only ROS 1 has it.

use serde::{Deserialize, Serialize};

use crate::{actionlib_msgs::GoalID, geometry_msgs::PoseStamped, std_msgs::Header};

/// `move_base_msgs/MoveBaseGoal`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MoveBaseGoal {
    /// The pose to drive to.
    pub target_pose: PoseStamped,
}
message!("move_base_msgs" MoveBaseGoal on Ros1 uses [PoseStamped]);

/// `move_base_msgs/MoveBaseActionGoal`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MoveBaseActionGoal {
    /// Time of sending.
    pub header: Header,
    /// The id of the goal.
    pub goal_id: GoalID,
    /// The goal.
    pub goal: MoveBaseGoal,
}
message!("move_base_msgs" MoveBaseActionGoal on Ros1 uses [Header, GoalID, MoveBaseGoal]);
