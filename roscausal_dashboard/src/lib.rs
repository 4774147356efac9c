//! The live page: a node that listens on any [`roscausal_core::middleware::Middleware`] and shows in a browser what
//! happens. It shows the scene from above, series of the variables with what may come, batches, the causal graph with its
//! history, what the reasoning node answers to a reader's questions, and the health of the nodes.
//!
//! The files of the page are inside the program; it loads nothing from the internet. By default it is served on
//! 127.0.0.1. On another address it requires a token.

mod ahead;
mod asked;
mod connections;
mod guard;
mod history;
mod hub;
mod moment;
mod node;
mod patience;
mod questions;
mod server;
mod world;

pub use node::{dashboard, parameters, run};
pub use server::{Server, Teller};
