//! Effects of one variable on another: by paths, by adjustment, through mediators.

mod adjusted;
mod mediation;
mod paths;
mod products;

pub use adjusted::{Adjusted, adjusted, wright};
pub(crate) use mediation::Columns;
pub use mediation::Mediation;
pub(crate) use paths::Paths;
pub(crate) use products::Sums;
