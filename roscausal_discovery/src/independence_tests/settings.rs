//! Settings of the independence tests.

use std::sync::Arc;

use super::null_distributions::NullDistributions;
use crate::types::{Error, Result};

/// Most surrogates, and samples of a bootstrap: they tell a p-value to a millionth.
pub const MOST_SURROGATES: usize = 1_000_000;

/// How a test value becomes a p-value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Significance {
    /// From the known null distribution.
    Analytic,
    /// From surrogates in which X is shuffled in blocks.
    ShuffleTest,
    /// No p-value: the nodes are dependent if the value reaches the significance level, which acts as a threshold.
    FixedThres,
}

words!(Significance, "significance": Analytic "analytic", ShuffleTest "shuffle" | "shuffle_test", FixedThres "threshold" | "fixed_thres");

/// What CMIknn turns values into before it measures distances.
pub const TRANSFORMS: &[&str] = &["ranks", "uniform", "standardize", "none"];

/// How a confidence interval is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Confidence {
    /// From the known null distribution.
    Analytic,
    /// From block-bootstrap samples.
    Bootstrap,
}

words!(Confidence, "confidence": Analytic "analytic", Bootstrap "bootstrap");

/// How GPDC searches for the maximum of a likelihood. Both end in the same one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum GpSearch {
    /// Each likelihood only as exact as it must be for the path to stay that of exact ones.
    #[default]
    Default,
    /// Every likelihood exact: the textbook's search. Some ten times slower; to check the other one.
    Exact,
}

words!(GpSearch, "gp_search": Default "default", Exact "exact");

with_defaults! {
    /// Settings of any test, as [`super::by_name`] takes them; a test reads what concerns it. `None` is the test's own default.
    ///
    /// ```
    /// use roscausal_discovery::independence_tests::{Confidence, Significance, TestSettings, by_name};
    ///
    /// let settings = TestSettings {
    ///     significance: Some(Significance::ShuffleTest),
    ///     sig_samples: Some(1000),
    ///     confidence: Some(Confidence::Bootstrap),
    ///     ..TestSettings::default()
    /// };
    /// assert_eq!(by_name("ParCorr", &settings)?.name(), "parcorr");
    /// # Ok::<(), roscausal_discovery::Error>(())
    /// ```
    #[derive(Clone, Debug, PartialEq)]
    pub struct TestSettings {
        /// How a test value becomes a p-value.
        pub significance: Option<Significance> = None,
        /// Number of surrogates of a shuffle test, or size of a null distribution, up to [`MOST_SURROGATES`]. Default 500.
        pub sig_samples: Option<usize> = None,
        /// Block length of a shuffle test, in samples; `None`: from the autocorrelation.
        pub sig_blocklength: Option<usize> = None,
        /// Confidence interval, if any.
        pub confidence: Option<Confidence> = None,
        /// Level of the two-sided confidence interval. Default 0.9.
        pub conf_lev: f64 = 0.9,
        /// Number of bootstrap samples, up to [`MOST_SURROGATES`]. Default 100.
        pub conf_samples: usize = 100,
        /// Block length of the bootstrap, in samples; `None`: from the autocorrelation.
        pub conf_blocklength: Option<usize> = None,
        /// Seed of all random numbers. Default 42.
        pub seed: u64 = 42,
        /// `cmiknn`: number of neighbours; below 1, the fraction of the samples. Default 0.2.
        pub knn: f64 = 0.2,
        /// `cmiknn`: neighbours in Z among which Y is permuted. Default 5.
        pub shuffle_neighbors: usize = 5,
        /// `cmiknn`: a test ends once so many surrogates have reached its value; `None` (default, as the reference): all are drawn.
        pub shuffle_stop: Option<usize> = None,
        /// `cmiknn`: `ranks` (default), `uniform`, `standardize` or `none`.
        pub transform: String = "ranks".into(),
        /// `regressionci`, `gsquared`, `cmisymb`: names of the variables of categories. Empty (default): those of few whole values.
        pub categories: Vec<String> = Vec::new(),
        /// `gpdc`: how the maximum of a likelihood is searched for.
        pub gp_search: GpSearch = GpSearch::Default,
        /// `gpdc`: searches from this many random places more, of which the best counts. Default 0, as the reference.
        pub gp_restarts: usize = 0,
        /// `gpdc`: null distributions to take where the number of samples is one of theirs; else its own.
        pub null_distributions: Option<Arc<NullDistributions>> = None,
        /// Whether answers are those of tigramite where it is known to be wrong: docs/methods.md, "Where we differ from the reference, on
        /// purpose". Default false.
        pub as_tigramite: bool = false,
        /// Memory in bytes that a test may take; `None`: no limit.
        pub max_memory: Option<u64> = None,
    }
}

impl TestSettings {
    /// Checks the settings that all tests share.
    ///
    /// # Errors
    /// The first setting that is out of its range.
    pub fn check(&self) -> Result<()> {
        let positive = |name: &str, value: Option<usize>| {
            Error::ensure(value != Some(0), name, || "0 is not allowed; give 1 or more")
        };
        let bounded = |name: &str, value: Option<usize>| {
            let n = value.unwrap_or(1);
            Error::ensure(n <= MOST_SURROGATES, name, || {
                format!("{n} is above {MOST_SURROGATES}, which tell a p-value to a millionth; give fewer")
            })?;
            positive(name, value)
        };
        bounded("sig_samples", self.sig_samples)?;
        positive("sig_blocklength", self.sig_blocklength)?;
        positive("shuffle_stop", self.shuffle_stop)?;
        bounded("conf_samples", Some(self.conf_samples))?;
        positive("conf_blocklength", self.conf_blocklength)?;
        let level = self.conf_lev;
        Error::ensure(level > 0.0 && level < 1.0, "conf_lev", || format!("{level} is not between 0 and 1"))
    }

    /// Checks the settings of a test that has p-values from theory only, and no intervals.
    ///
    /// # Errors
    /// Another significance, a confidence.
    pub(super) fn check_analytic(&self, test: &str) -> Result<()> {
        Error::ensure(self.confidence.is_none(), "confidence", || format!("{test} has none; leave it out"))?;
        let is_analytic = matches!(self.significance, None | Some(Significance::Analytic));
        Error::ensure(is_analytic, "significance", || {
            format!("{test} has analytic p-values only; choose 'analytic'")
        })
    }
}
