//! Causal discovery from time series.

mod analysis;
pub mod draw;
mod ground;
pub mod independence_tests;
pub mod methods;
mod model;
mod numeric;
pub mod transfer_entropy;

pub use analysis::{PcAlpha, Settings, analyse};
pub use ground::*;
pub use model::{Link, Matrices, Model, SCHEMA};
