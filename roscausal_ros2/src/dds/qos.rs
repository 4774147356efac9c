//! The quality of service of topics.

use ros2_client::QosProfile;
use ros2_client::qos::{Durability, History, WhenFull};
use roscausal_core::middleware::Qos;
use rustdds::QosPolicies;
use rustdds::policy::{self, Reliability};

/// The two ends of a topic.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Side {
    Publisher,
    Subscriber,
}

/// Volatile topics have reliable publishers that never wait, and best-effort subscribers. So either end matches
/// anything. Latched topics are reliable and transient local, with depth 1.
pub(crate) fn profile(qos: Qos, side: Side) -> QosProfile {
    let reliable = QosProfile::publisher_default().reliability_reliable(WhenFull::Fail);
    let last = |depth: usize| History::KeepLast { depth: depth.max(1) };
    match (qos, side) {
        (Qos::Latched, _) => reliable.durability(Durability::TransientLocal).history(last(1)),
        (Qos::Volatile(depth), Side::Publisher) => reliable.history(last(depth)),
        (Qos::Volatile(depth), Side::Subscriber) => QosProfile::subscription_default().history(last(depth)),
    }
}

/// A profile in the terms of ROS 2.
pub(crate) fn described(qos: &QosPolicies) -> String {
    let reliability = match qos.reliability() {
        Some(Reliability::Reliable { .. }) => "reliable",
        _ => "best_effort",
    };
    let durability = match qos.durability() {
        None | Some(policy::Durability::Volatile) => "volatile",
        Some(_) => "transient_local",
    };
    format!("{reliability} {durability}")
}
