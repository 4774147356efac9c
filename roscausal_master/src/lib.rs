//! A node's side of the ROS 1 master: parameters, other nodes, and the node's own registrations. They survive a
//! restart of the master, and are removed when the node leaves.
//!
//! Each call has a deadline; rosrust's own client waits for ever on a master that hangs.

mod master;
mod membership;
mod xmlrpc;

pub use master::{Master, Role};
pub use membership::Membership;
