//! Causal discovery from time series: data, graphs, and the algorithms of the PCMCI family.
//!
//! Field words: `tau_max`, `pc_alpha`, `val_matrix`, `link_assumptions`; `matrix[i][j][tau]` is the link
//! `X^i(t - tau) -> X^j(t)` (cause, effect, lag).

pub mod analysis;
mod control;
mod dataframe;
mod extension;
mod fdr;
mod fpcmci;
mod graph;
mod links;
mod mci;
pub mod model;
mod orientation;
mod pc_stable;
mod pcmci;
mod pcmciplus;
mod run;
mod skeleton;
pub mod transfer_entropy;

pub use control::{Control, Progress, Stop};
pub use dataframe::{DataFrame, LaggedArrays, MaskType, Node, Samples};
pub use fdr::fdr_bh;
pub use fpcmci::{CausalMatrices, FpcmciResult, FpcmciSettings, run_fpcmci};
pub use graph::{Candidate, LinkMark, PcmciResult, Sepset, Status, TargetParents};
pub use links::{Assumption, LinkAssumptions};
pub use model::Model;
pub use pcmci::{
    Fdr, PC_ALPHAS, PCMCIPLUS_ALPHAS, PcmciSettings, get_lagged_dependencies, run_bivci, run_fullci, run_mci,
    run_pc_stable, run_pcmci,
};
pub use pcmciplus::{ColliderRule, PcmciPlusSettings, run_pcmciplus};
