//! The live page: a node that listens on any [`roscausal_core::middleware::Middleware`] and shows in a browser what
//! is going on. Scene from above, series of the variables, batches, causal graph with its history, health of the
//! nodes.
//!
//! The page's files are in the program; it asks nothing of the internet. It is served on 127.0.0.1 unless told
//! otherwise; on another address it wants a token.

mod guard;
mod hub;
mod node;
mod patience;
mod server;
mod world;

pub use node::{dashboard, parameters, run};
pub use server::Server;
