//! What the ROS 1 and ROS 2 backends share: the clock in use, a node's life, its log, and the program that runs
//! one of the nodes from the first argument to the last signal.

mod clock;
pub mod console;
mod life;
pub mod program;

use std::sync::{Mutex, MutexGuard, PoisonError};

pub use clock::{Clock, steady};
pub use console::Console;
pub use life::Life;

/// Locks; what a panic left behind is taken as it is.
pub fn lock<T: ?Sized>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
