//! Causal discovery from time series: which variable drives which, and how many steps later.
//!
//! ```
//! use ndarray::Array2;
//! use roscausal_discovery::{Control, DataFrame, Settings, analyse, methods::Method};
//!
//! // Two series of 300 samples: `b` follows `a` one step later.
//! let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0) - 0.5;
//! let mut values = Array2::zeros((300, 2));
//! for t in 1..300 {
//!     values[[t, 0]] = noise(2 * t);
//!     values[[t, 1]] = 0.7 * values[[t - 1, 0]] + noise(2 * t + 1);
//! }
//! let data = DataFrame::new(vec![values], vec!["a".into(), "b".into()])?;
//! let settings = Settings { method: Method::Pcmci, cond_ind_test: "parcorr".into(), ..Settings::default() };
//! let model = analyse(&data, &settings, &Control::default())?;
//! let link = &model.links[0];
//! assert_eq!((link.cause.as_str(), link.effect.as_str(), link.lag), ("a", "b", 1));
//! # Ok::<(), roscausal_discovery::Error>(())
//! ```
//!
//! A correlation between two series is not a link: both may follow a third one, or their own past. The methods here test
//! each possible link given other variables at other times, and keep what no such condition explains away. All but one assume
//! that all common causes were recorded; all assume that the system does not change while it is recorded, and that the samples are
//! dense enough to see an effect after its cause.
//!
//! # Methods
//!
//! | name | function | finds | take it |
//! |---|---|---|---|
//! | `fpcmci` | [`run_fpcmci`](methods::run_fpcmci) | lagged links | when some variables may have no part in the system, and with a slow test |
//! | `pcmci` | [`run_pcmci`](methods::run_pcmci) | lagged links; pairs at lag 0 without a direction | as the first choice |
//! | `pcmciplus` | [`run_pcmciplus`](methods::run_pcmciplus) | lagged links and directed links at lag 0 | when effects follow faster than the samples |
//! | `fullci` | [`run_fullci`](methods::run_fullci) | lagged links | with few variables and many samples, to compare |
//! | `bivci` | [`run_bivci`](methods::run_bivci) | pairs | as the Granger test of two variables |
//! | `granger` | [`run_granger`](methods::run_granger) | lagged links, linear | as the baseline, with few variables and many samples |
//! | `varlingam` | [`run_varlingam`](methods::run_varlingam) | lagged links and directed links at lag 0, linear | when the noise is far from Gaussian |
//! | `dynotears` | [`run_dynotears`](methods::run_dynotears) | weights without p-values | to compare with results of others |
//! | `timino` | [`run_timino`](methods::run_timino) | which variable drives which, linear or not, and where it cannot tell | when no answer is better than a wrong one |
//! | `lagdep` | [`get_lagged_dependencies`](methods::get_lagged_dependencies) | dependencies, not links | to choose `tau_max` before anything else |
//! | `lpcmci` | [`run_lpcmci`](methods::run_lpcmci) | lagged links and links at lag 0, and where something hidden is behind them | when not everything was recorded |
//! | `candoit` | [`run_candoit`](methods::run_candoit) | the same, with interventions | when something was imposed for a while |
//! | `tsfci` | [`run_tsfci`](methods::run_tsfci) | as `lpcmci`, with fewer links | to compare with results of others |
//! | `jpcmciplus` | [`run_jpcmciplus`](methods::run_jpcmciplus) | as `pcmciplus`, from recordings that may differ | when several people, robots or days are pooled |
//!
//! All take several recordings as one system and, all but `dynotears`, give a p-value for each link; only `lpcmci`, `candoit` and `tsfci` allow for
//! hidden common causes. `granger`, `varlingam` and `dynotears` are linear models and ask no independence test.
//! [`Method`](methods::Method) holds the names, aliases and defaults.
//!
//! # Independence tests
//!
//! | name | type | finds | take it |
//! |---|---|---|---|
//! | `gpdc` | [`Gpdc`](independence_tests::Gpdc) | nonlinear dependence with additive noise | up to some thousand samples |
//! | `parcorr` | [`ParCorr`](independence_tests::ParCorr) | linear dependence | as the fastest, and with many variables |
//! | `robustparcorr` | [`RobustParCorr`](independence_tests::RobustParCorr) | monotone dependence | with outliers or heavy tails |
//! | `cmiknn` | [`CmiKnn`](independence_tests::CmiKnn) | dependence of any form | with time to spend |
//! | `cmisymb` | [`CmiSymb`](independence_tests::CmiSymb) | dependence of discrete variables | with few samples for each combination of levels |
//! | `gsquared` | [`Gsquared`](independence_tests::Gsquared) | dependence of discrete variables | for categories and counts |
//! | `parcorrwls` | [`ParCorrWls`](independence_tests::ParCorrWls) | linear dependence | where the noise grows and shrinks over time |
//! | `parcorrmult` | [`ParCorrVector`](independence_tests::ParCorrVector) | linear dependence of vectors | where some variables have several columns |
//! | `regressionci` | [`RegressionCi`](independence_tests::RegressionCi) | linear dependence of numbers and categories | where some variables are categories |
//! | (oracle) | [`OracleCi`](independence_tests::OracleCi) | what a known graph says | to study a method |
//!
//! # The way through
//!
//! 1. Put the samples into a [`DataFrame`]: one array per recording, time in rows, NaN where a value is missing.
//! 2. [`analyse`] it with [`Settings`]; a [`Control`] shows progress, sets a time budget, cancels.
//! 3. Read the [`Model`]: its links, or the matrices `[cause][effect][lag]`; write it as JSON or [draw] it.
//!
//! The functions of [`methods`] give more: separating sets, confidence intervals, the steps of a method one by one. A
//! test of your own is a type with [`CondIndTest`]; its documentation has an example.
//!
//! Random numbers come from a seed and the test they serve: the same seed gives the same bytes, whatever the number of
//! threads. Tests run in the current `rayon` pool.

#![warn(missing_docs)]
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

// Its macros are for all that follow.
#[macro_use]
mod types;

mod analysis;
pub mod changes;
pub mod confidence;
pub mod draw;
mod effort;
mod evidence;
pub mod independence_tests;
mod later;
mod levels;
pub mod methods;
mod model;
mod numeric;
mod profile;
mod recommend;
pub mod rolling;
mod season;
pub mod settings;
pub mod transfer_entropy;
mod unsteady;

pub use analysis::{analyse, analyse_with, analyse_with_evidence};
pub use effort::Effort;
pub use evidence::{AtLag, Condition, EVIDENCE_SCHEMA, Evidence, LinkEvidence, MOST_POINTS, VariableFacts};
pub use later::{Later, Within};
pub use levels::Levelled;
pub use model::{
    Advice, Confidence, FoundBy, Link, LinkSize, Matrices, Model, Outcome, ResamplingFacts, SCHEMA, SCHEMA_1,
    Summary, SummaryAdvice, SummaryLink, word_of,
};
pub use numeric::rows::{quantile, unit_factor};
/// For the project's other crates, no part of the interface.
#[doc(hidden)]
pub use numeric::{random::mix, rows::dot, student_t::quantile as student_t_quantile};
pub use profile::{DataProfile, Fault, VariableProfile};
pub use recommend::Recommendation;
pub use season::{Season, without_season};
pub use settings::{Levels, PcAlpha, Settings};
pub use types::*;
pub use unsteady::Unsteady;

/// The README's example runs, too.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
