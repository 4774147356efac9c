//! `spencer_tracking_msgs`, from the SPENCER people tracker.

use serde::{Deserialize, Serialize};

use crate::{
    Duration,
    geometry_msgs::{PoseWithCovariance, TwistWithCovariance},
    std_msgs::Header,
};

/// `spencer_tracking_msgs/TrackedPerson`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TrackedPerson {
    /// The id of the track; it stays the same for the life of the track.
    pub track_id: u64,
    /// Whether the person is currently hidden.
    pub is_occluded: bool,
    /// Whether a detection currently belongs to the track.
    pub is_matched: bool,
    /// The id of that detection.
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
