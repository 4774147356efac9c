//! `roscausal_ros2 NODE --ros-args ...` runs one of the nodes on ROS 2. Under a link `roscausal_NODE`, the
//! program's name selects the node.

use std::process::ExitCode;

use roscausal_ros2::Ros2;

fn main() -> ExitCode {
    roscausal_ros::program::main::<Ros2>(&[
        #[cfg(feature = "hrisim")]
        ("hrisim", roscausal_hrisim::node::run),
        #[cfg(feature = "dashboard")]
        ("dashboard", roscausal_dashboard::run),
    ])
}
