//! ROS 1 backend.
