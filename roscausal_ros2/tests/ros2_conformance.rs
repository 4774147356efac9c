//! The conformance tests of the middleware, on real DDS over the loopback interface.
#![allow(clippy::expect_used, reason = "a node that does not start fails the test")]

use std::{thread::sleep, time::Duration};

use roscausal_core::conformance;
use roscausal_ros2::{Args, Ros2};

fn node(name: &str) -> Ros2 {
    let domain = (100 + std::process::id() % 100).to_string();
    let env = move |variable: &str| match variable {
        "ROS_DOMAIN_ID" => Some(domain.clone()),
        "ROS_AUTOMATIC_DISCOVERY_RANGE" => Some("LOCALHOST".to_owned()),
        _ => None,
    };
    let args = Args::parse(name, std::iter::empty(), env).expect("a name");
    Ros2::start(&args).expect("a node")
}

#[test]
fn ros2_is_a_middleware() {
    conformance::middleware_conformance(node, || sleep(Duration::from_millis(5)));
}
