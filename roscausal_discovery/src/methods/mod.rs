//! The methods of causal discovery.
//!
//! Field words: `tau_max`, `pc_alpha`, `val_matrix`, `link_assumptions`; `matrix[i][j][tau]` is the link
//! `X^i(t - tau) -> X^j(t)` (cause, effect, lag).

mod extension;
mod fdr;
mod fpcmci;
mod mci;
mod orientation;
mod pc_stable;
mod pcmci;
mod pcmciplus;
mod registry;
mod result;
mod run;
mod settings;
mod skeleton;

pub use fdr::{Fdr, fdr_bh};
pub use fpcmci::{CausalMatrices, FpcmciResult, FpcmciSettings, run_fpcmci};
pub use pcmci::{get_lagged_dependencies, run_bivci, run_fullci, run_mci, run_pc_stable, run_pcmci};
pub use pcmciplus::{ColliderRule, PcmciPlusSettings, run_pcmciplus};
pub use registry::{Method, MethodInfo, Reads};
pub use result::{Candidate, PcmciResult, Sepset, Status, TargetParents};
pub use settings::{PC_ALPHAS, PCMCIPLUS_ALPHAS, PcmciSettings};
