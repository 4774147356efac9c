//! `roscausal_ros1 NODE [ROS arguments]` runs one of the nodes of ROS-Causal on a ROS 1 master. Under another name,
//! such as `roscausal_data`, the program runs the node of that name.

use std::process::ExitCode;

use roscausal_ros1::Ros1;

fn main() -> ExitCode {
    roscausal_ros::program::main::<Ros1>(&[
        #[cfg(feature = "hrisim")]
        ("hrisim", roscausal_hrisim::node::run),
        #[cfg(feature = "dashboard")]
        ("dashboard", roscausal_dashboard::run),
    ])
}
