//! Conditional independence tests: is `X` independent of `Y` given `Z`, on lagged samples of a
//! [`DataFrame`](crate::DataFrame)?
//!
//! | test | value | p-value | cost of one test |
//! |---|---|---|---|
//! | [`ParCorr`] | partial correlation, -1 to 1 | Student's t | microseconds |
//! | [`ParCorr`] with dummies | the same, and of which recording a sample is from | Student's t | microseconds |
//! | [`RobustParCorr`] | the same of normal scores | Student's t | microseconds |
//! | [`ParCorrWls`] | the same, each sample weighted by the noise at its time | Student's t | tens of microseconds |
//! | [`RegressionCi`] | improvement of a regression's likelihood; numbers and categories | chi-squared | tens of microseconds |
//! | [`Gpdc`] | distance correlation of residuals, 0 to 1 | law of independent ranks | milliseconds at 500 samples |
//! | [`CmiKnn`] | conditional mutual information, nats | local permutations | a tenth of a second at 500 samples |
//! | [`CmiSymb`] | the same of discrete variables, nats | permutations within strata | milliseconds at 500 samples |
//! | [`Gsquared`] | G statistic | chi-squared | microseconds |
//! | [`OracleCi`] | 1 or 0 | 0 or 1 | none: it knows the graph |
//!
//! A test is a plain value ([`CondIndTest`](crate::CondIndTest): its settings). For one run it is *prepared* on the run's
//! samples ([`PreparedTest`](crate::PreparedTest)): there live the correlation matrix, the residuals and the null tables
//! that tests of a run share. A prepared test is `Sync`, and a result never depends on which tests came before it.
//!
//! [`by_name`] makes a test of a user's word. GPDC, for one, sees that `b` depends on the square of `a`, which no
//! correlation does:
//!
//! ```
//! use roscausal_discovery::{CondIndTest, DataFrame, Node, Samples, independence_tests::{TestSettings, by_name}};
//!
//! let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0) - 0.5;
//! let values = ndarray::Array2::from_shape_fn((150, 2), |(t, k)| {
//!     if k == 0 { noise(2 * t) } else { noise(2 * t).powi(2) + 0.1 * noise(2 * t + 1) }
//! });
//! let data = DataFrame::new(vec![values], vec!["a".into(), "b".into()])?;
//! let samples = Samples::new(&data, 0);
//! let p_value = |name: &str| -> roscausal_discovery::Result<f64> {
//!     let test = by_name(name, &TestSettings::default())?;
//!     let prepared = test.prepare(&samples)?;
//!     Ok(prepared.run_test(Node::new(0, 0), Node::new(1, 0), &[])?.p_value)
//! };
//! assert!(p_value("gpdc")? < 0.01);
//! assert!(p_value("parcorr")? > 0.05);
//! # Ok::<(), roscausal_discovery::Error>(())
//! ```

mod cholesky;
pub(crate) mod cmiknn;
mod cmisymb;
#[cfg(test)]
mod conformance_tests;
mod gpdc;
#[cfg(feature = "python")]
mod gpdc_python;
mod gram;
mod gsquared;
mod incomplete;
mod multinomial;
mod null_distributions;
mod oracle;
mod parcorr;
mod parcorr_mult;
mod parcorr_vector;
mod parcorr_wls;
mod registry;
pub(crate) mod regression_ci;
mod resampling;
mod robust_parcorr;
mod settings;

pub(crate) use cholesky::residuals;
pub use cmiknn::CmiKnn;
pub use cmisymb::CmiSymb;
pub use gpdc::{GpOptimum, GpRegression, Gpdc};
pub(crate) use gpdc::{bytes as gpdc_bytes, dependence, gp_residuals, tail_dependence};
#[cfg(feature = "python")]
pub use gpdc_python::GpdcPython;
pub use gsquared::Gsquared;
pub use null_distributions::NullDistributions;
pub use oracle::OracleCi;
pub use parcorr::ParCorr;
pub use parcorr_vector::ParCorrVector;
pub use parcorr_wls::ParCorrWls;
#[doc(hidden)]
pub use registry::spelled;
pub use registry::{by_name, draws, names, smallest_p};
pub use regression_ci::RegressionCi;
pub use robust_parcorr::RobustParCorr;
pub use settings::{Confidence, GpSearch, MOST_SURROGATES, Significance, TRANSFORMS, TestSettings};
