//! A ROS 2 node's side of DDS, over `ros2-client`, including what differs between DDS vendors. It has publishers,
//! subscriptions and services, the graph and the reasons why endpoints do not match, a watchdog over the library, and an
//! exit that every vendor notices. The handles of the library stay in this folder.

mod client;
mod farewell;
mod graph;
mod listen;
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
pub(crate) use service::Content;
pub use service::Server;
pub use subscription::Subscription;
pub(crate) use writer::Writer;

/// Whether DDS Security is built in.
pub(crate) const SECURITY: bool = cfg!(feature = "security");
