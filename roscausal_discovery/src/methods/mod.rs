//! The methods of causal discovery: functions from data, an independence test and settings to a graph.
//!
//! | function | tests each link given | source |
//! |---|---|---|
//! | [`run_fpcmci`] | the parents of both ends, after a filter | Castri et al. 2023 |
//! | [`run_pcmci`] | the parents of both ends | Runge et al. 2019 |
//! | [`run_pcmciplus`] | the parents of both ends and sets of neighbours at lag 0 | Runge 2020 |
//! | [`run_jpcmciplus`] | as PCMCI+, and what differs between recordings | Günther et al. 2023 |
//! | [`run_lpcmci`] | known causes and sets of possible ones; common causes may be hidden | Gerhardus and Runge 2020 |
//! | [`run_candoit`] | as LPCMCI, with interventions | Castri et al. 2024 |
//! | [`run_tsfci`] | sets of neighbours in a window; common causes may be hidden | Entner and Hoyer 2010 |
//! | [`run_fullci`] | all other lagged variables | Granger 1969, with all variables |
//! | [`run_granger`] | all other lagged variables, all lags of a cause at once | Granger 1969 |
//! | [`run_bivci`] | the past of its effect | Granger 1969 |
//! | [`get_lagged_dependencies`] | nothing | |
//! | [`run_dynotears`] | (a sparse linear model without cycles) | Pamfil et al. 2020 |
//! | [`run_varlingam`] | (a model of linear effects and noise that is not Gaussian) | Hyvärinen et al. 2010 |
//! | [`run_timino`] | (models whose noise must be independent) | Peters et al. 2013 |
//! | [`run_pc_stable`], [`run_mci`] | the two halves of PCMCI | Runge et al. 2019 |
//!
//! [`analyse`](crate::analyse) chooses among them by [`Method`] and makes a [`Model`](crate::Model) of what they find.
//!
//! Field words: `tau_max`, `pc_alpha`, `val_matrix`, `link_assumptions`; `matrix[i][j][tau]` is the link
//! `X^i(t - tau) -> X^j(t)` (cause, effect, lag).

mod autoregression;
mod candoit;
mod dynotears;
mod extension;
mod fdr;
mod fpcmci;
mod granger;
mod jpcmciplus;
mod lpcmci;
mod mci;
mod orientation;
mod pc_stable;
mod pcmci;
mod pcmciplus;
mod registry;
mod result;
mod run;
mod settings;
mod shared_times;
mod skeleton;
mod timino;
mod varlingam;

pub use autoregression::Criterion;
pub use candoit::{ActsOn, Intervened, acts_on_of, default_intervention_targets, run_candoit};
pub use dynotears::{DynotearsResult, DynotearsSettings, run_dynotears};
pub(crate) use fdr::benjamini_hochberg;
pub use fdr::{Fdr, fdr_bh};
pub use fpcmci::{FpcmciResult, FpcmciSettings, run_fpcmci};
pub use granger::{GrangerResult, GrangerSettings, run_granger};
pub(crate) use jpcmciplus::is_shared;
pub use jpcmciplus::{JpcmciPlusResult, JpcmciPlusSettings, NodeClass, run_jpcmciplus};
pub use lpcmci::{LpcmciResult, LpcmciSettings, Stage, run_lpcmci, run_tsfci};
pub(crate) use mci::mci_conditions;
pub use pcmci::{get_lagged_dependencies, run_bivci, run_fullci, run_mci, run_pc_stable, run_pcmci};
pub use pcmciplus::{ColliderRule, PcmciPlusSettings, run_pcmciplus};
pub use registry::{Method, MethodInfo, Reads};
pub use result::{Candidate, PcmciResult, Sepset, Status, TargetParents};
pub use settings::{PC_ALPHAS, PCMCIPLUS_ALPHAS, PcmciSettings};
pub use timino::{TiminoModel, TiminoResult, TiminoSettings, run_timino};
pub use varlingam::{VarlingamResult, VarlingamSettings, run_varlingam};
