//! Effects of one variable on another: by paths, by adjustment, through mediators.

mod adjusted;
mod mediation;
mod products;

pub use adjusted::{Adjusted, adjusted, wright};
pub use mediation::{Mediation, OverLags};
