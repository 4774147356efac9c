//! `geometry_msgs`: metres, radians, seconds (REP 103).

include!(concat!(env!("OUT_DIR"), "/geometry_msgs.rs"));

impl Default for Quaternion {
    fn default() -> Self {
        Self { x: 0.0, y: 0.0, z: 0.0, w: 1.0 }
    }
}

impl Quaternion {
    /// A rotation by `yaw` radians about z.
    pub fn from_yaw(yaw: f64) -> Self {
        let (sin, cos) = libm::sincos(yaw / 2.0);
        Self { x: 0.0, y: 0.0, z: sin, w: cos }
    }

    /// The rotation about z in radians, from -pi to pi; 0 for the invalid quaternion of zeros. The length of the
    /// quaternion does not matter.
    pub fn yaw(self) -> f64 {
        let Self { x, y, z, w } = self;
        libm::atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)
    }
}

impl Default for PoseWithCovariance {
    fn default() -> Self {
        Self { pose: Pose::default(), covariance: [0.0; 36] }
    }
}

impl Default for TwistWithCovariance {
    fn default() -> Self {
        Self { twist: Twist::default(), covariance: [0.0; 36] }
    }
}
