//! A node's side of the ROS 1 master: parameters, other nodes, and the node's own registrations. They survive a
//! restart of the master, and are removed when the node leaves.
//!
//! Each call has a deadline; rosrust's own client waits for ever on a master that hangs.

mod client;
mod membership;
mod xmlrpc;

pub(crate) use client::{Master, Role};
pub(crate) use membership::Membership;
