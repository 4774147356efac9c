//! What every implementation of a middleware must do.

mod tests;

pub use tests::*;
