//! Causal discovery from time series: data, graphs, and the algorithms of the PCMCI family.
//!
//! Field words: `tau_max`, `pc_alpha`, `val_matrix`, `link_assumptions`; `matrix[i][j][tau]` is the link
//! `X^i(t - tau) -> X^j(t)` (cause, effect, lag).

mod control;
mod dataframe;
pub mod model;
pub mod transfer_entropy;

pub use control::{Control, Progress, Stop};
pub use dataframe::{DataFrame, LaggedArrays, MaskType, Node, Samples};
pub use model::Model;
