//! A ROS 2 node's place on DDS, over `ros2-client`, with what DDS vendors differ in: publishers and subscriptions,
//! services, who else is there and why nothing passes, whether the library still answers, leaving so that everybody
//! hears it. The library's handles stay in this folder.

mod farewell;
mod graph;
mod participant;
mod publisher;
mod qos;
mod service;
mod spinner;
mod standard;
mod subscription;
mod watchdog;
mod writer;

pub(crate) use participant::Participant;
pub use publisher::Publisher;
pub use subscription::Subscription;
pub(crate) use writer::Writer;

/// Whether DDS Security is built in.
pub(crate) const SECURITY: bool = cfg!(feature = "security");
