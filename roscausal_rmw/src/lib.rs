//! A ROS 2 node's side of DDS, over `ros2-client`, including what differs between DDS vendors. It has publishers
//! and subscriptions, the graph and the reasons why endpoints do not match, a watchdog over the library, and an
//! exit that every vendor notices.

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
