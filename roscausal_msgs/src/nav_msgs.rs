//! `nav_msgs`.

use serde::{Deserialize, Serialize};

use crate::{
    geometry_msgs::{PoseStamped, PoseWithCovariance, TwistWithCovariance},
    std_msgs::Header,
};

/// `nav_msgs/Odometry`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Odometry {
    /// Time, and the frame of the pose.
    pub header: Header,
    /// Frame of the twist: the robot's base.
    pub child_frame_id: String,
    /// Pose of the base in `header.frame_id`.
    pub pose: PoseWithCovariance,
    /// Velocity of the base in its own frame.
    pub twist: TwistWithCovariance,
}
message!("nav_msgs" Odometry uses [Header, PoseWithCovariance, TwistWithCovariance]);

/// `nav_msgs/Path`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Path {
    /// Time and frame.
    pub header: Header,
    /// The way, from here to the goal.
    pub poses: Vec<PoseStamped>,
}
message!("nav_msgs" Path uses [Header, PoseStamped]);
