//! The structural model: equations on a graph, their noise, and how sure they are.

pub(crate) mod equation;
mod system;

pub use equation::{Equation, Equations};
pub use system::{Schedule, System};
