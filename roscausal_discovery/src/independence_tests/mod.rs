//! Conditional independence tests: `X _||_ Y | Z` on lagged samples of a [`DataFrame`](crate::DataFrame).
//!
//! A test is a plain value ([`CondIndTest`](crate::CondIndTest): its settings). For one run it is *prepared* on the run's
//! samples ([`PreparedTest`](crate::PreparedTest)): there live the Gram matrix, residual caches and null tables that tests
//! of a run share. A prepared test is `Sync`, and a result never depends on which tests came before it.

mod cholesky;
pub(crate) mod cmiknn;
mod gpdc;
#[cfg(feature = "python")]
mod gpdc_python;
mod gram;
mod gsquared;
#[cfg(test)]
mod laws;
mod oracle;
mod parcorr;
mod registry;
mod resampling;
mod robust_parcorr;
mod settings;

pub use cmiknn::CmiKnn;
pub use gpdc::Gpdc;
#[cfg(feature = "python")]
pub use gpdc_python::GpdcPython;
pub use gsquared::Gsquared;
pub use oracle::OracleCi;
pub use parcorr::ParCorr;
pub use registry::{by_name, names, smallest_p};
pub use robust_parcorr::RobustParCorr;
pub use settings::{Confidence, Significance, TestSettings};
