//! The quality of service of topics.

use ros2_client::{
    QosProfile,
    qos::{Durability, History, WhenFull},
};
use roscausal_core::middleware::Qos;
use rustdds::{
    QosPolicies,
    policy::{self, Reliability},
};

/// Which end of a topic.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Side {
    Publisher,
    Subscriber,
}

/// Volatile topics: reliable publishers that never wait, best-effort subscribers, so that either matches
/// anything. Latched topics: reliable and transient local, depth 1.
pub(crate) fn profile(qos: Qos, side: Side) -> QosProfile {
    let reliable = QosProfile::publisher_default().reliability_reliable(WhenFull::Fail);
    match (qos, side) {
        (Qos::Latched, _) => {
            reliable.durability(Durability::TransientLocal).history(History::KeepLast { depth: 1 })
        }
        (Qos::Volatile(depth), Side::Publisher) => {
            reliable.history(History::KeepLast { depth: depth.max(1) })
        }
        (Qos::Volatile(depth), Side::Subscriber) => {
            QosProfile::subscription_default().history(History::KeepLast { depth: depth.max(1) })
        }
    }
}

/// A profile in the words of ROS 2.
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
