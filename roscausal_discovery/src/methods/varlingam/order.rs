//! The causal order of variables whose noise is not Gaussian: DirectLiNGAM.
//!
//! A cause is independent of what it leaves of its effect, an effect is not independent of what it leaves of its cause. So:
//!
//! 1. For each pair of the variables that remain: `D_ij = H(x_j) + H(r_i|j) - H(x_i) - H(r_j|i)`, where `r_i|j` is what is left
//!    of `x_i` after a regression on `x_j`, all of deviation 1. It is above 0 where `i` comes before `j`.
//! 2. The variable whose sum of `min(0, D_ij)^2` is least comes next.
//! 3. All others are replaced by what it leaves of them; again from 1.
//!
//! Source: Shimizu et al. 2011, JMLR 12:1225; the measure: Hyvärinen and Smith 2013, JMLR 14:111.

use pulp::Arch;
use rayon::prelude::*;

use super::entropy::entropy;
use crate::{
    numeric::rows::{dot, sum},
    types::{Control, Result},
};

/// The variables from first cause to last effect.
pub(super) struct Order {
    /// The variables.
    pub(super) variables: Vec<usize>,
    /// How clear each choice was but the last, which had none: 1 for clear, 0 for a tie. The lead over the second, by its sum.
    pub(super) margins: Vec<f64>,
}

/// A variable with mean 0, and its variance (by `n`).
struct Centred {
    values: Vec<f64>,
    variance: f64,
}

impl Centred {
    fn new(mut values: Vec<f64>) -> Self {
        let n = values.len().max(1) as f64;
        let mean = sum(&values) / n;
        values.iter_mut().for_each(|v| *v -= mean);
        let variance = dot(&values, &values) / n;
        Self { values, variance }
    }

    /// The factor that makes its deviation 1; 0 of a constant.
    fn scale(&self) -> f64 {
        if self.variance > 0.0 { 1.0 / self.variance.sqrt() } else { 0.0 }
    }
}

/// Finds the order of `columns`, which all have the same length; those in `first` come before all others.
///
/// # Errors
/// Cancellation.
pub(super) fn causal_order(columns: &[Vec<f64>], first: &[usize], control: &Control) -> Result<Order> {
    let mut left: Vec<Centred> = columns.iter().map(|column| Centred::new(column.clone())).collect();
    let mut remaining: Vec<usize> = (0..columns.len()).collect();
    let mut order = Order { variables: Vec::new(), margins: Vec::new() };
    while remaining.len() > 1 {
        control.check()?;
        let sums = sums(&left, &remaining);
        let must = remaining.iter().any(|var| first.contains(var));
        let allowed = |k: &usize| !must || first.contains(&remaining[*k]);
        let smaller = |best: Option<usize>, k: usize| match best {
            Some(best) if sums[k] >= sums[best] => Some(best),
            _ => Some(k),
        };
        let Some(best) = (0..sums.len()).filter(allowed).fold(None, smaller) else { break };
        // Where nothing is left of one of them, no order of the two is wrong.
        let varies = |k: usize| left[remaining[k]].variance > 0.0;
        let others = (0..sums.len()).filter(|k| *k != best && allowed(k) && varies(best) && varies(*k));
        let second = others.map(|k| sums[k]).fold(f64::INFINITY, f64::min);
        order.margins.push(match second {
            f64::INFINITY => 1.0,
            second if second > 0.0 => (second - sums[best]) / second,
            _ => 0.0,
        });
        let chosen = remaining.remove(best);
        order.variables.push(chosen);
        remaining.iter().for_each(|&other| left[other] = residual(&left[other], &left[chosen]));
    }
    order.variables.extend(remaining);
    Ok(order)
}

/// What `cause` leaves of `effect`.
fn residual(effect: &Centred, cause: &Centred) -> Centred {
    if cause.variance <= 0.0 {
        return Centred::new(effect.values.clone());
    }
    let slope = dot(&effect.values, &cause.values) / (cause.values.len() as f64 * cause.variance);
    Centred::new(effect.values.iter().zip(&cause.values).map(|(e, c)| e - slope * c).collect())
}

/// For each remaining variable how much speaks against its being the first.
fn sums(left: &[Centred], remaining: &[usize]) -> Vec<f64> {
    let arch = Arch::new();
    let alone = |&k: &usize| entropy(arch, &left[k].values, &left[k].values, 0.0, left[k].scale());
    let alone: Vec<f64> = remaining.par_iter().map(alone).collect();
    let pairs: Vec<(usize, usize)> =
        (0..remaining.len()).flat_map(|i| (i + 1..remaining.len()).map(move |j| (i, j))).collect();
    let differences: Vec<f64> = pairs
        .par_iter()
        .map(|&(i, j)| {
            let (x, y) = (&left[remaining[i]], &left[remaining[j]]);
            let n = x.values.len().max(1) as f64;
            let correlation = x.scale() * y.scale() * dot(&x.values, &y.values) / n;
            // r_i|j = x - r y in units of deviations; its deviation is sqrt(1 - r^2).
            let rest = (1.0 - correlation * correlation).max(1e-12).sqrt();
            let given = |a: &Centred, b: &Centred| {
                let slope = if a.scale() > 0.0 { -correlation * b.scale() / a.scale() } else { 0.0 };
                entropy(arch, &a.values, &b.values, slope, a.scale() / rest)
            };
            alone[j] + given(x, y) - alone[i] - given(y, x)
        })
        .collect();
    let mut sums = vec![0.0; remaining.len()];
    for (&(i, j), d) in pairs.iter().zip(differences) {
        sums[i] += d.min(0.0).powi(2);
        sums[j] += (-d).min(0.0).powi(2);
    }
    sums
}
