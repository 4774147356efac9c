//! The chance that a link is real, from the p-values of its own run: no resamples are needed.
//!
//! Source: empirical Bayes with two groups (Efron 2008, "Microarrays, empirical Bayes and the two-groups model", Statistical Science
//! 23); the strengths of real links follow a normal law, or one without weak links (a moment prior: Johnson and Rossell 2010, Journal
//! of the Royal Statistical Society B 72), each with weight one half.
//!
//! 1. A test that finds nothing has a uniform p-value, so `z = Phi^-1(1 - p/2)` is standard normal. A real link's `z` is larger, by a
//!    strength with variance `w` over the variance `v = 1/(n - 4)` of one test.
//! 2. The share of real links `pi` and `w` are fitted to all tests between two variables of the run (expectation and maximisation, 30
//!    rounds), from a share of 0.06 over the lags and `w = 0.05`, which count as much as ten tests and four links.
//! 3. The chance of a link is its posterior: `g = 1 / (1 + exp(-L))`, `L = ln(density if real / density if not) + ln(pi / (1 - pi))`.
//!
//! Where it was measured stands in docs/confidence.md (example `calibration`); elsewhere there is no figure. Example: of 100 tests with
//! p-values spread evenly and one of 1e-9, that one has a chance above 0.99, and a p-value of 0.02 one below 0.1.

use std::collections::HashMap;

use crate::{
    independence_tests::Significance,
    methods::{Method, Status},
    model::{Model, cells},
    numeric::normal::normal_quantile,
    settings::Settings,
    types::LinkMark,
};

/// Rounds of the fit.
const ROUNDS: usize = 30;
/// Share of real links before the data, over the lags, and the tests that it counts for.
const SHARE: (f64, f64) = (0.06, 10.0);
/// Variance of their strengths before the data, and the links that it counts for.
const VARIANCE: (f64, f64) = (0.05, 4.0);
/// Where the chance was measured: variables, lags, samples.
const MEASURED: [[usize; 2]; 3] = [[3, 12], [1, 5], [150, 2000]];
const MEASURED_WITH_GPDC: [[usize; 2]; 3] = [[3, 5], [1, 3], [150, 500]];
/// What the odds are multiplied by where a p-value is the largest of several.
const OF_LARGEST: f64 = 1.7;

/// What the odds of a link are multiplied by, where the chance was measured for such an analysis.
///
/// PCMCI+ and LPCMCI take the largest p-value of several tests: a small one says more there than evenly spread ones would.
fn odds(model: &Model, settings: &Settings) -> Option<f64> {
    let (odds, [variables, lags, samples]) = match (settings.method, model.cond_ind_test.as_str()) {
        (Method::Pcmci | Method::Fpcmci, "parcorr") => (1.0, MEASURED),
        (Method::Pcmciplus | Method::Lpcmci, "parcorr") => (OF_LARGEST, MEASURED),
        (Method::Fpcmci, "gpdc") => (1.0, MEASURED_WITH_GPDC),
        _ => return None,
    };
    let within = |value: usize, [from, to]: [usize; 2]| (from..=to).contains(&value);
    let is_measured = settings.test.significance.is_none_or(|how| how == Significance::Analytic)
        && model.status == Status::Complete
        && model.tau_min == settings.method.info().tau_min
        && within(model.features.len(), variables)
        && within(model.tau_max, lags)
        && within(model.n_samples, samples);
    is_measured.then_some(odds)
}

/// Gives each link between two variables its chance, where that was measured.
pub(crate) fn fill(model: &mut Model, settings: &Settings) {
    let Some(odds) = odds(model, settings) else { return };
    let (mut places, mut tests) = (HashMap::new(), Vec::new());
    for ([i, j, lag], p) in cells(&model.p_matrix).filter(|([i, j, lag], _)| i != j && *lag > 0) {
        let Some(p) = *p else { continue };
        places.insert((&model.features[i], &model.features[j], lag), tests.len());
        tests.push((p, model.n_matrix[i][j][lag].unwrap_or(model.n_samples)));
    }
    let chances = chances(&tests, model.tau_max, odds);
    // That something not recorded drives both is another claim.
    for link in model.links.iter_mut().filter(|link| link.mark != LinkMark::Bidirected) {
        link.chance = places.get(&(&link.cause, &link.effect, link.lag)).map(|&at| chances[at]);
    }
}

/// The chances of tests, by p-value and number of samples, of which each pair has one at each lag; the odds of each are multiplied by
/// `odds`.
fn chances(tests: &[(f64, usize)], lags: usize, odds: f64) -> Vec<f64> {
    let squares: Vec<f64> = tests.iter().map(|(p, _)| normal_quantile(0.5 * p.max(1e-300)).powi(2)).collect();
    let variances: Vec<f64> =
        tests.iter().map(|(_, samples)| 1.0 / (*samples as f64 - 4.0).max(1.0)).collect();
    let at_first = SHARE.0 / lags.max(1) as f64;
    let (mut share, mut spread) = (at_first, VARIANCE.0);
    let mut found = vec![0.0; tests.len()];
    for round in 0..=ROUNDS {
        let (mut real, mut strengths) = (0.0, 0.0);
        let shift = if round == ROUNDS { libm::log(odds) } else { 0.0 };
        for ((found, &square), &v) in found.iter_mut().zip(&squares).zip(&variances) {
            let of = spread / (v + spread);
            let normal = 0.5 * libm::log(v / (v + spread)) + 0.5 * square * of;
            let without_weak = normal + libm::log((1.0 - of) * (1.0 + square * of));
            let larger = normal.max(without_weak);
            let both =
                larger + libm::log(0.5 * (libm::exp(normal - larger) + libm::exp(without_weak - larger)));
            *found = 1.0 / (1.0 + libm::exp(-(both + libm::log(share / (1.0 - share)) + shift)));
            // What the strength's square is on average, given the test; that of the law without weak links is three times its variance.
            let of_moment = 0.5 * libm::exp(without_weak - both);
            let mean_square = square * v * of * of + v * of;
            real += *found;
            strengths += *found * mean_square * (1.0 - of_moment + of_moment / 3.0);
        }
        if round < ROUNDS {
            share = (SHARE.1 * at_first + real) / (SHARE.1 + tests.len() as f64);
            spread = (VARIANCE.1 * VARIANCE.0 + strengths) / (VARIANCE.1 + real);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `count` p-values, evenly spread.
    fn evenly(count: usize) -> Vec<(f64, usize)> {
        (0..count).map(|k| ((k as f64 + 0.5) / count as f64, 300)).collect()
    }

    #[test]
    fn p_values_that_are_spread_evenly_make_no_link_likely() {
        for count in [6, 40, 400] {
            let found = chances(&evenly(count), 2, 1.0);
            assert!(found.iter().all(|chance| *chance < 0.5), "{count}: {:?}", &found[..3]);
            assert!(found.iter().sum::<f64>() < 1.0, "{count}");
            assert!(found.windows(2).all(|pair| pair[0] >= pair[1]), "the smaller the p-value, the likelier");
        }
    }

    #[test]
    fn what_stands_out_is_real_and_many_links_make_each_likelier() {
        let with = |p: f64, many: usize| {
            let mut tests = evenly(100);
            tests.extend(std::iter::repeat_n((1e-9, 300), many));
            tests.push((p, 300));
            chances(&tests, 1, 1.0).pop().expect("the last")
        };
        assert!(with(1e-9, 0) > 0.99 && with(0.02, 0) < 0.1, "{} {}", with(1e-9, 0), with(0.02, 0));
        assert!(with(1e-3, 60) > with(1e-3, 0));
    }

    #[test]
    fn odd_numbers_have_a_chance_too() {
        let found = chances(&[(0.0, 0), (1.0, 4), (1e-320, 2_000_000), (0.5, 5)], 1, 1.7);
        assert!(found.iter().all(|chance| (0.0..=1.0).contains(chance)), "{found:?}");
        assert!(chances(&[], 0, 1.0).is_empty());
    }
}
