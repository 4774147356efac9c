//! Linear equations: least squares, and what follows exactly from the coefficients.

mod least_squares;
mod system;

pub(crate) use least_squares::{CONSTANT, Factor, weighted};
pub use least_squares::{Fit, least_squares};
pub use system::LinearSystem;
