//! What an analysis will take, before it starts: memory, and CPU time on one core of a usual machine.
//!
//! The figures are rough: the number of tests depends on the links that are found, the time of one test on the data. They
//! tell seconds from hours and from never. Times of one test come from docs/speed.md.

use crate::{
    evidence::AtLag, independence_tests::gpdc_bytes, methods::Method, settings::Settings,
    transfer_entropy::TeEstimator,
};

/// CPU seconds of one test of GPDC on 500 samples, for each sample above [`MANY`], in Python, and of CMIknn on 500 samples. Measured with
/// 250 to 20,000 samples of three variables: within a factor of two.
const GPDC_S: f64 = 0.02;
const GPDC_OF_MANY_S: f64 = 7e-5;
const GPDC_PYTHON_S: f64 = 0.043;
const CMIKNN_S: f64 = 0.083;
/// Samples above which GPDC keeps no matrix of all pairs of them: there its time grows with them.
const MANY: f64 = 2000.0;
/// CPU seconds for each sample of a linear test.
const LINEAR_S: f64 = 2e-9;
/// CPU seconds for each sample of a test with ranks or counts.
const RANKED_S: f64 = 1e-7;
/// Rows that a kept sample takes in memory: the data, and what a test copies of it.
const COPIES: f64 = 4.0;
/// Bytes for each pair and lag: marks, strengths and p-values, in the method's result, in the model and in its file.
const RESULT: f64 = 250.0;
/// Bytes of a lag function for each lag, in the evidence of a link.
const AT_LAG: f64 = size_of::<AtLag>() as f64;

/// What an analysis will take.
///
/// ```
/// use roscausal_discovery::{Effort, Settings};
///
/// let gpdc = Settings::default();
/// let parcorr = Settings { cond_ind_test: "parcorr".into(), ..Settings::default() };
/// // A million rows of ten variables: hours with GPDC, a moment with partial correlation.
/// assert!(Effort::of(1_000_000, 10, &gpdc).seconds > 3600.0);
/// assert!(Effort::of(1_000_000, 10, &parcorr).seconds < 60.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effort {
    /// Memory that it needs at the least.
    pub bytes: f64,
    /// CPU seconds on one core, roughly; threads share them.
    pub seconds: f64,
}

impl Effort {
    /// The effort for `n_samples` samples of `n_vars` variables.
    pub fn of(n_samples: usize, n_vars: usize, settings: &Settings) -> Self {
        let (n, vars) = (n_samples as f64, n_vars as f64);
        let lags = settings.tau_max.saturating_sub(settings.tau_min) as f64 + 1.0;
        let pairs = vars * vars * lags;
        let tests = pairs * tests_per_pair(settings.method);
        let relative = n / 500.0;
        // Models without a test: a regression on all causes for each pair.
        let test = if settings.method.info().uses_test { settings.cond_ind_test.as_str() } else { "none" };
        let of_test = match test {
            "none" => LINEAR_S * n * vars,
            "gpdc" if n > MANY => GPDC_OF_MANY_S * n,
            "gpdc" => GPDC_S * relative.powi(2),
            "gpdcpython" => GPDC_PYTHON_S * relative.powi(3),
            "cmiknn" => CMIKNN_S * relative.powi(2),
            "parcorr" => LINEAR_S * n,
            _ => RANKED_S * n,
        };
        let of_pair_in_filter = match (settings.method, settings.te_estimator) {
            (Method::Fpcmci, TeEstimator::Kraskov) => 1e-5 * n * libm::log2(n.max(2.0)),
            (Method::Fpcmci, _) => RANKED_S * n,
            _ => 0.0,
        };
        let rows = COPIES * n * vars * (settings.tau_max as f64 + 1.0) * size_of::<f64>() as f64;
        let matrices = if test == "gpdc" { gpdc_bytes(n_samples) as f64 } else { 0.0 };
        // As many links as chance gives, each with a lag function.
        let lags = settings.tau_max as f64 + 1.0;
        let results = vars * vars * lags * (RESULT + settings.alpha * lags * AT_LAG);
        Self { bytes: rows + matrices + results, seconds: tests * of_test + pairs * of_pair_in_filter }
    }

    /// The most samples whose effort stays within `bytes` and `seconds`.
    pub fn most_samples(n_vars: usize, settings: &Settings, bytes: f64, seconds: f64) -> usize {
        let fits = |n: usize| {
            let effort = Self::of(n, n_vars, settings);
            effort.bytes <= bytes && effort.seconds <= seconds
        };
        let (mut least, mut most) = (0, 1 << 40);
        while least + 1 < most {
            let middle = least + (most - least) / 2;
            if fits(middle) { least = middle } else { most = middle }
        }
        least
    }
}

/// PC1 and MCI, or one test of each pair.
fn tests_per_pair(method: Method) -> f64 {
    match method {
        Method::Pcmciplus => 4.0,
        // Contexts, dummies, the system.
        Method::Jpcmciplus => 8.0,
        Method::Lpcmci | Method::Candoit => 16.0,
        // On a window of few nodes; with more it doubles with each.
        Method::Tsfci => 64.0,
        Method::Pcmci | Method::Timino => 3.0,
        // Of F-PCMCI the filter leaves about a third.
        _ => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_samples_variables_and_lags_take_more() {
        let settings =
            |test: &str, tau_max| Settings { cond_ind_test: test.into(), tau_max, ..Settings::default() };
        for test in ["gpdc", "cmiknn", "parcorr", "robustparcorr", "gsquared"] {
            let effort = |n, vars, tau_max| Effort::of(n, vars, &settings(test, tau_max));
            let base = effort(1000, 3, 1);
            for more in [effort(2000, 3, 1), effort(1000, 6, 1), effort(1000, 3, 4)] {
                assert!(more.seconds > base.seconds && more.bytes > base.bytes, "{test}");
            }
        }
    }

    #[test]
    fn estimates_are_within_a_factor_of_three_of_what_was_measured() {
        // CPU seconds of `discover --test gpdc --threads 1` on chains of variables, 2026-12-01.
        for (method, samples, vars, tau_max, measured) in [
            (Method::Pcmci, 1900, 3, 1, 5.3),
            (Method::Pcmci, 2100, 3, 1, 3.8),
            (Method::Pcmci, 2500, 3, 1, 2.4),
            (Method::Pcmci, 2500, 3, 3, 15.1),
            (Method::Pcmci, 2500, 6, 1, 33.5),
            (Method::Pcmci, 10_000, 3, 1, 10.8),
            (Method::Fpcmci, 2500, 3, 1, 1.1),
            (Method::Fpcmci, 2500, 3, 3, 1.8),
            (Method::Fpcmci, 3000, 5, 1, 6.7),
        ] {
            let settings = Settings { method, tau_max, ..Settings::default() };
            let off = Effort::of(samples, vars, &settings).seconds / measured;
            assert!((1.0 / 3.0..=3.0).contains(&off), "{method}, {samples} x {vars}: {off}");
        }
    }

    #[test]
    fn a_method_without_a_test_takes_no_memory_for_one() {
        for method in [Method::Granger, Method::Varlingam, Method::Dynotears] {
            let effort = Effort::of(200_000, 10, &Settings { method, ..Settings::default() });
            assert!(effort.bytes < 1e9 && effort.seconds < 60.0, "{method}: {effort:?}");
        }
    }

    #[test]
    fn results_and_evidence_count_however_few_rows_there_are() {
        let bytes = |vars, tau_max| {
            Effort::of(
                500,
                vars,
                &Settings { tau_max, cond_ind_test: "parcorr".into(), ..Settings::default() },
            )
            .bytes
        };
        assert!(bytes(20, 10) < 10e6);
        assert!(bytes(20_000, 10) > 1e12, "graph and matrices");
        assert!(bytes(20, 50_000) > 1e12, "lag functions");
        assert_eq!(Effort::most_samples(20_000, &Settings::default(), 16e9, 86_400.0), 0);
    }

    #[test]
    fn the_most_samples_fit_and_one_more_does_not() {
        let settings = Settings::default();
        let most = Effort::most_samples(3, &settings, 4e9, 3600.0);
        let fits = |n| {
            let effort = Effort::of(n, 3, &settings);
            effort.bytes <= 4e9 && effort.seconds <= 3600.0
        };
        assert!(most > 1000 && fits(most) && !fits(most + 1), "{most}");
    }
}
