//! `spencer_tracking_msgs`, of the SPENCER people tracker.

use serde::{Deserialize, Serialize};

use crate::{
    Duration,
    geometry_msgs::{PoseWithCovariance, TwistWithCovariance},
    std_msgs::Header,
};

/// `spencer_tracking_msgs/TrackedPerson`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TrackedPerson {
    /// The track's number, the same as long as the track lives.
    pub track_id: u64,
    /// The person cannot be seen now.
    pub is_occluded: bool,
    /// A detection belongs to the track now.
    pub is_matched: bool,
    /// That detection's number.
    pub detection_id: u64,
    /// The track's age.
    pub age: Duration,
    /// Pose; z and orientation may not be set.
    pub pose: PoseWithCovariance,
    /// Velocity in the header's frame; z and rotations may not be set.
    pub twist: TwistWithCovariance,
}
message!("spencer_tracking_msgs" TrackedPerson uses [PoseWithCovariance, TwistWithCovariance]);

/// `spencer_tracking_msgs/TrackedPersons`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TrackedPersons {
    /// Time and frame.
    pub header: Header,
    /// All people tracked now.
    pub tracks: Vec<TrackedPerson>,
}
message!("spencer_tracking_msgs" TrackedPersons uses [Header, TrackedPerson]);
