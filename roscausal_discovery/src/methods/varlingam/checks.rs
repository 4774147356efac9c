//! Whether residuals are what VARLiNGAM assumes: not Gaussian, and independent of each other.

use rayon::prelude::*;

use super::dependence;

use crate::{
    independence_tests::tail_dependence,
    methods::result::PcmciResult,
    numeric::{rows::standardized, special::chi_squared_sf},
};

const LEVEL: f64 = 0.05;
/// A choice of the order with a smaller lead is nearly a tie.
const CLOSE: f64 = 0.02;

/// One sentence for each assumption that the residuals fail.
pub(super) fn remarks(
    names: &[String],
    residuals: &[Vec<f64>],
    margins: &[f64],
    links: &PcmciResult,
) -> Vec<String> {
    let n = residuals.len();
    let mut stated = Vec::new();
    let gaussian: Vec<usize> = (0..n).filter(|&var| looks_gaussian(&residuals[var])).collect();
    let tied = |&&var: &&usize| gaussian.iter().any(|&other| links.graph[[var, other, 0]].is_link());
    let open: Vec<&str> = gaussian.iter().filter(tied).map(|&var| names[var].as_str()).collect();
    if !open.is_empty() {
        stated.push(format!(
            "what the model leaves of {} looks Gaussian, so the directions at lag 0 between them are arbitrary",
            open.join(", ")
        ));
    }
    if margins.iter().any(|margin| *margin < CLOSE) {
        stated.push("a choice of the causal order was nearly a tie, so directions at lag 0 may turn with a few more samples".into());
    }
    let pairs: Vec<(usize, usize)> = (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j))).collect();
    let p_values: Vec<f64> = match residuals.first().is_some_and(|values| values.len() >= dependence::FEWEST)
    {
        true => dependence::p_values(residuals, &pairs),
        false => pairs.par_iter().map(|&(i, j)| tail_dependence(&residuals[i], &residuals[j])).collect(),
    };
    let level = LEVEL / pairs.len().max(1) as f64;
    let dependent = pairs.iter().zip(p_values).filter(|(_, p)| *p < level);
    let dependent: Vec<String> =
        dependent.map(|((i, j), _)| format!("{} and {}", names[*i], names[*j])).collect();
    if !dependent.is_empty() {
        stated.push(format!(
            "what the model leaves of {} still depend on each other: a hidden common cause drives both, or the effects are not \
             linear; do not believe links between them",
            dependent.join(", of ")
        ));
    }
    stated
}

/// Whether a Gaussian is not refuted: the test of Jarque and Bera 1987 on skewness and kurtosis.
fn looks_gaussian(values: &[f64]) -> bool {
    let n = values.len() as f64;
    let z = standardized(values);
    let moment = |power: i32| z.iter().map(|v| v.powi(power)).sum::<f64>() / n;
    let (skewness, excess) = (moment(3), moment(4) - 3.0);
    chi_squared_sf(n / 6.0 * (skewness * skewness + 0.25 * excess * excess), 2) > LEVEL
}
