//! The core of ROS-Causal: the four nodes, the batches that they record and analyse, and the trait that connects nodes
//! to a middleware. Nothing here knows ROS, a network or the wall clock: time is an argument.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod batch;
pub mod bounded;
pub mod conformance;
pub mod content;
pub mod error;
pub mod external;
pub mod gate;
mod grammar;
pub mod house;
pub mod inbox;
pub mod loopback;
pub mod memory;
pub mod middleware;
pub mod nodes;
pub mod params;
pub mod people;
pub mod signal;
pub mod state;
pub mod threads;

pub use error::{Error, Result, spell_out_panics};
pub use roscausal_discovery::visible;
#[doc(hidden)]
pub use roscausal_discovery::{ensure, mix, with_defaults};
pub use roscausal_msgs::{Message, Time};
