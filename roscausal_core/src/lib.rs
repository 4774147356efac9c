//! The core of ROS-Causal: causal discovery, the nodes, and the trait that connects nodes to a middleware. Nothing
//! here knows ROS, a network or the wall clock: time is an argument.

pub mod batch;
pub mod discovery;
pub mod draw;
pub mod error;
pub mod gate;
pub mod inbox;
pub mod independence_tests;
pub mod laws;
pub mod loopback;
pub mod middleware;
pub mod nodes;
pub mod params;
mod special;
pub mod state;

pub use error::{Error, Result};
pub use roscausal_msgs::{Message, Time};
