//! Causal discovery from time series.

pub mod discovery;
pub mod draw;
pub mod error;
pub mod independence_tests;
pub mod names;
mod special;

pub use error::{Error, Result};
