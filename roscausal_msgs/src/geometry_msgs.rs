//! `geometry_msgs`: metres, radians, seconds (REP 103).

use serde::{Deserialize, Serialize};
use serde_big_array::BigArray;

use crate::std_msgs::Header;

/// `geometry_msgs/Point`: a position.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Metres along x.
    pub x: f64,
    /// Metres along y.
    pub y: f64,
    /// Metres along z.
    pub z: f64,
}
message!("geometry_msgs" Point uses []);

/// `geometry_msgs/Point32`: a position in single precision.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Point32 {
    /// Metres along x.
    pub x: f32,
    /// Metres along y.
    pub y: f32,
    /// Metres along z.
    pub z: f32,
}
message!("geometry_msgs" Point32 uses []);

/// `geometry_msgs/Vector3`: a direction with a length.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Vector3 {
    /// Along (or about) x.
    pub x: f64,
    /// Along (or about) y.
    pub y: f64,
    /// Along (or about) z.
    pub z: f64,
}
message!("geometry_msgs" Vector3 uses []);

/// `geometry_msgs/Quaternion`: an orientation. The default is no rotation, as in ROS 2.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quaternion {
    /// First imaginary part.
    pub x: f64,
    /// Second imaginary part.
    pub y: f64,
    /// Third imaginary part.
    pub z: f64,
    /// Real part.
    pub w: f64,
}
message!("geometry_msgs" Quaternion uses []);

impl Default for Quaternion {
    fn default() -> Self {
        Self { x: 0.0, y: 0.0, z: 0.0, w: 1.0 }
    }
}

impl Quaternion {
    /// A rotation by `yaw` radians about z.
    pub fn from_yaw(yaw: f64) -> Self {
        let (sin, cos) = (yaw / 2.0).sin_cos();
        Self { x: 0.0, y: 0.0, z: sin, w: cos }
    }

    /// The rotation about z in radians, from -pi to pi; 0 for the invalid quaternion of zeros. The length of the
    /// quaternion does not matter.
    pub fn yaw(self) -> f64 {
        let Self { x, y, z, w } = self;
        (2.0 * (w * z + x * y)).atan2(w * w + x * x - y * y - z * z)
    }
}

/// `geometry_msgs/Pose`: position and orientation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// The position.
    pub position: Point,
    /// The orientation.
    pub orientation: Quaternion,
}
message!("geometry_msgs" Pose uses [Point, Quaternion]);

/// `geometry_msgs/Pose2D`: position and heading in the plane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pose2D {
    /// Metres along x.
    pub x: f64,
    /// Metres along y.
    pub y: f64,
    /// Radians about z.
    pub theta: f64,
}
message!("geometry_msgs" Pose2D uses []);

/// `geometry_msgs/PoseStamped`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PoseStamped {
    /// Time and frame.
    pub header: Header,
    /// The pose.
    pub pose: Pose,
}
message!("geometry_msgs" PoseStamped uses [Header, Pose]);

/// `geometry_msgs/PoseArray`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PoseArray {
    /// Time and frame of all poses.
    pub header: Header,
    /// The poses.
    pub poses: Vec<Pose>,
}
message!("geometry_msgs" PoseArray uses [Header, Pose]);

/// `geometry_msgs/PoseWithCovariance`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PoseWithCovariance {
    /// The pose.
    pub pose: Pose,
    /// Row-major 6 x 6 covariance of (x, y, z, rotations about x, y, z).
    #[serde(with = "BigArray")]
    pub covariance: [f64; 36],
}
message!("geometry_msgs" PoseWithCovariance uses [Pose]);

impl Default for PoseWithCovariance {
    fn default() -> Self {
        Self { pose: Pose::default(), covariance: [0.0; 36] }
    }
}

/// `geometry_msgs/PoseWithCovarianceStamped`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PoseWithCovarianceStamped {
    /// Time and frame.
    pub header: Header,
    /// The pose.
    pub pose: PoseWithCovariance,
}
message!("geometry_msgs" PoseWithCovarianceStamped uses [Header, PoseWithCovariance]);

/// `geometry_msgs/Transform`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Transform {
    /// Origin of the child frame in the parent frame.
    pub translation: Vector3,
    /// Orientation of the child frame in the parent frame.
    pub rotation: Quaternion,
}
message!("geometry_msgs" Transform uses [Vector3, Quaternion]);

/// `geometry_msgs/TransformStamped`: transforms points from `child_frame_id` to `header.frame_id`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TransformStamped {
    /// Time and parent frame.
    pub header: Header,
    /// Child frame.
    pub child_frame_id: String,
    /// The transform.
    pub transform: Transform,
}
message!("geometry_msgs" TransformStamped uses [Header, Transform]);

/// `geometry_msgs/Twist`: linear and angular velocity.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Twist {
    /// Metres per second.
    pub linear: Vector3,
    /// Radians per second.
    pub angular: Vector3,
}
message!("geometry_msgs" Twist uses [Vector3]);

/// `geometry_msgs/TwistStamped`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TwistStamped {
    /// Time and frame.
    pub header: Header,
    /// The velocity.
    pub twist: Twist,
}
message!("geometry_msgs" TwistStamped uses [Header, Twist]);

/// `geometry_msgs/TwistWithCovariance`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TwistWithCovariance {
    /// The velocity.
    pub twist: Twist,
    /// Row-major 6 x 6 covariance of (x, y, z, rotations about x, y, z).
    #[serde(with = "BigArray")]
    pub covariance: [f64; 36],
}
message!("geometry_msgs" TwistWithCovariance uses [Twist]);

impl Default for TwistWithCovariance {
    fn default() -> Self {
        Self { twist: Twist::default(), covariance: [0.0; 36] }
    }
}
