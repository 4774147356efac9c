//! Reasoning on a causal model of time series: what will happen, what if, had I, why, and which action is best.

#![warn(missing_docs)]

pub mod answer;
pub mod effects;
pub mod explain;
pub mod graph;
pub mod linear;
pub mod model;
pub mod quality;
pub mod question;
mod random;
mod samples;
mod simulate;

pub use model::{Facts, Settings, StructuralModel};
pub use samples::{ActsOn, Samples, default_acts_on};
