//! ROS 2 backend.
