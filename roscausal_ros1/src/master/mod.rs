//! A node's place on a ROS 1 master: parameters, who is there, and what the node has registered, which outlives a
//! restart of the master and is taken back when the node leaves.
//!
//! Each question has a deadline; rosrust's own client waits for ever on a master that hangs.

mod client;
mod membership;
mod xmlrpc;

pub(crate) use client::{Master, Role};
pub(crate) use membership::Membership;
