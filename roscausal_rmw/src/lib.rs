//! A ROS 2 node's place on DDS, over `ros2-client`, with what DDS vendors differ in: publishers and subscriptions, who
//! else is there and why nothing passes, whether the library still answers, leaving so that everybody hears it.

mod farewell;
mod graph;
mod participant;
mod publisher;
mod qos;
mod spinner;
mod subscription;
mod watchdog;
mod writer;

pub use participant::{Participant, Session};
pub use publisher::Publisher;
pub use subscription::Subscription;
pub use writer::Writer;

/// Whether DDS Security is built in.
pub const SECURITY: bool = cfg!(feature = "security");
