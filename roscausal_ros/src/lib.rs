//! What the ROS 1 and ROS 2 backends share: the clock, a node's life, its log, and the program that runs a node from the first
//! argument to the last signal.

mod clock;
pub mod console;
mod life;
mod memory;
pub mod program;

pub use clock::Clock;
pub use console::Console;
pub use life::{Life, in_time};
#[doc(hidden)]
pub use roscausal_core::gate::lock;
