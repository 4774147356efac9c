//! The conformance tests of the middleware on a real ROS master. `ROSCAUSAL_ROS1_TESTS=1` and `ROS_MASTER_URI` say that there is
//! one (`tests/interop/ros1.sh` sets them). Otherwise nothing is tested.

use std::{thread, time::Duration};

use roscausal_core::conformance;
use roscausal_ros1::Ros1;

/// A node on the master that the environment names. On a busy machine the master does not answer each question in time.
#[allow(clippy::panic, reason = "a test without master has failed")]
fn node(name: &str) -> Ros1 {
    let mut failed = None;
    for _ in 0..5 {
        match Ros1::connect(name, &|| false) {
            Ok(node) => return node,
            Err(error) => failed = Some(error),
        }
    }
    panic!("{name} is on no master: {failed:?}")
}

#[test]
fn ros1_passes_the_conformance_tests() {
    if std::env::var_os("ROSCAUSAL_ROS1_TESTS").is_none() {
        eprintln!("NOT TESTED: no ROS 1 master; run tests/interop/ros1.sh");
        return;
    }
    conformance::middleware_conformance(node, || thread::sleep(Duration::from_millis(2)));
    conformance::absolute_parameters_are_shared(&node);
}
