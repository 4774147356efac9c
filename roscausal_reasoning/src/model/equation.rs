//! One equation: a variable's expected value from its parents, `x_j(t) = f_j(parents) + e_j(t)`.
//!
//! `f` is a constant without parents, a line, or a line and a Gaussian process on what the line leaves. With the line, far from the
//! data the answer is the trend and not the mean. An equation that is drawn is a line with hinges (`bends`).

use std::sync::Arc;

use ndarray::Array1;
use roscausal_discovery::{
    Node, Result,
    independence_tests::{GpRegression, TestSettings},
};

use super::bends::{Bends, Drawn, draws};
use crate::{
    linear::{Fit, weighted},
    samples::{Moment, Samples},
};

/// Most samples of a Gaussian process.
pub(crate) const GP_ROWS: usize = 500;
/// Most samples that say where an equation bends.
const BEND_ROWS: usize = 10_000;
/// A Gaussian process is taken where its squared errors are below this part of the line's.
const WORTH_IT: f64 = 0.98;
/// Rows that an equation needs: at least, and for each coefficient.
const FEWEST_ROWS: usize = 50;
const ROWS_PER_COEFFICIENT: usize = 10;
/// How near to 1 a leverage is where the row alone decides on a coefficient. What the row would leave without itself is then 0/0.
const ALONE: f64 = 1e-10;

/// Which equations are fitted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Equations {
    /// A Gaussian process where it predicts left-out rows better than a line.
    #[default]
    Auto,
    /// Lines.
    Linear,
    /// Gaussian processes.
    Gp,
}

roscausal_discovery::words!(Equations, "equations": Auto "auto", Linear "linear", Gp "gp");

/// A variable's expected value from its parents.
#[derive(Debug)]
pub struct Equation {
    /// The parents, in the order of the coefficients.
    pub parents: Vec<Node>,
    /// The constant.
    pub intercept: f64,
    /// One coefficient for each parent; 0 for one that others explain.
    pub coefficients: Vec<f64>,
    /// What the line leaves, as a function of the parents numbered here.
    pub process: Option<(Vec<usize>, GpRegression)>,
    /// Of a drawn equation: where it bends, and the weight of each bend.
    pub(crate) bends: Option<(Arc<Bends>, Vec<f64>)>,
}

impl Equation {
    /// A line.
    pub fn line(parents: &[Node], intercept: f64, coefficients: &[f64]) -> Self {
        Self {
            parents: parents.to_vec(),
            intercept,
            coefficients: coefficients.to_vec(),
            process: None,
            bends: None,
        }
    }

    pub(crate) fn is_line(&self) -> bool {
        self.process.is_none() && self.bends.is_none()
    }

    /// The expected value, given the parents' values in their order.
    pub fn mean(&self, values: &[f64]) -> f64 {
        let line = self.coefficients.iter().zip(values).fold(self.intercept, |sum, (b, x)| sum + b * x);
        let line = line + self.bends.as_ref().map_or(0.0, |(bends, weights)| bends.sum(weights, values));
        let Some((used, process)) = &self.process else { return line };
        if used.len() == values.len() {
            return line + process.mean(values);
        }
        let place: Vec<f64> = used.iter().map(|&k| values[k]).collect();
        line + process.mean(&place)
    }
}

/// The length scale and the noise variance of an equation's Gaussian process.
pub(crate) type Hyperparameters = (f64, f64);

/// An equation with what its fit says.
#[derive(Debug)]
pub(crate) struct Fitted {
    pub(crate) equation: Arc<Equation>,
    /// Numbers of the moments that trained it.
    pub(crate) rows: Vec<usize>,
    /// By moment: the residual without the moment itself; NaN where it cannot be known.
    pub(crate) residuals: Vec<f64>,
    /// Parents that others explain.
    pub(crate) dropped: Vec<Node>,
    /// How many rows alone decide on a coefficient: their residuals are unknown.
    pub(crate) alone: usize,
    /// The line alone.
    pub(crate) line: Fit,
    /// Mean square of the residuals that are known.
    pub(crate) mean_square: f64,
    pub(crate) hyperparameters: Option<Hyperparameters>,
    /// What resampling needs: the target and each parent's values by training row.
    target: Vec<f64>,
    /// The parents' values by training row.
    pub(crate) columns: Vec<Vec<f64>>,
}

/// Fits the equation of `var` on `moments`. With `known`, no hyperparameters are searched: those given are taken, or none.
///
/// # Errors
/// In one sentence: too few rows, or values that are too large to compute with.
pub(crate) fn fit(
    samples: &Samples,
    moments: &[Moment],
    (var, name): (usize, &str),
    parents: &[Node],
    kind: Equations,
    known: Option<Option<Hyperparameters>>,
) -> std::result::Result<Fitted, String> {
    let rows: Vec<usize> = (0..moments.len()).filter(|&m| samples.trains(moments[m], var, parents)).collect();
    let needed = FEWEST_ROWS.max(ROWS_PER_COEFFICIENT * (parents.len() + 1));
    let (complete, count) = (rows.len(), parents.len());
    if complete < needed {
        return Err(format!(
            "the equation of {name} has {complete} complete rows and needs {needed} for its {count} parents (too few rows); record longer"
        ));
    }
    let value = |node: Node| rows.iter().map(|&m| samples.at(moments[m], node)).collect::<Vec<f64>>();
    let target = value(Node::new(var, 0));
    let columns: Vec<Vec<f64>> = parents.iter().map(|&parent| value(parent)).collect();
    let line = weighted(&target, &columns, None);
    let alone: Vec<bool> = line.leverages.iter().map(|h| !parents.is_empty() && 1.0 - h < ALONE).collect();
    let kept: Vec<usize> = (0..rows.len()).filter(|&i| !alone[i]).collect();
    if kept.len() < needed {
        return Err(format!(
            "the equation of {name} has {} rows beside those that alone decide on a coefficient, and needs {needed} (too few rows); \
             record longer",
            kept.len()
        ));
    }
    let mut equation = Equation::line(parents, line.intercept, &line.coefficients);
    // Without parents the noise is the sample itself, shifted by its mean.
    let left_out = |i: usize| {
        if parents.is_empty() { line.residuals[i] } else { line.residuals[i] / (1.0 - line.leverages[i]) }
    };
    let mut own: Vec<f64> = (0..rows.len()).map(left_out).collect();
    let used: Vec<usize> = (0..parents.len()).filter(|k| !line.dropped.contains(k)).collect();
    let mut hyperparameters = None;
    if kind != Equations::Linear
        && !used.is_empty()
        && let Some(process) = process(&columns, &line.residuals, &used, known)
        && let Ok(without) = process.leave_one_out()
    {
        let thinned: Vec<usize> = thin(rows.len(), GP_ROWS).collect();
        let square = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>();
        let by_line = square(&mut thinned.iter().filter(|i| !alone[**i]).map(|&i| own[i]));
        let left = thinned.iter().zip(&without).filter(|(i, _)| !alone[**i]);
        let by_process = square(&mut left.map(|(_, residual)| *residual));
        if known.is_some() || kind == Equations::Gp || by_process < WORTH_IT * by_line {
            let optimum = process.optimum();
            hyperparameters = Some((optimum.length_scale, optimum.noise));
            equation.process = Some((used, process));
            let mut place = vec![0.0; parents.len()];
            for i in 0..rows.len() {
                place.iter_mut().zip(&columns).for_each(|(p, column)| *p = column[i]);
                own[i] = target[i] - equation.mean(&place);
            }
            thinned.iter().zip(without).for_each(|(&i, residual)| own[i] = residual);
        }
    }
    let mean_square = kept.iter().map(|&i| own[i] * own[i]).sum::<f64>() / kept.len() as f64;
    let slopes_are_finite = line.coefficients.iter().all(|slope| slope.is_finite());
    if !slopes_are_finite || !mean_square.is_finite() || !line.intercept.is_finite() {
        return Err(format!(
            "the equation of {name} cannot be computed: its values or those of its parents are too large; take out the largest ones, or \
             record in another unit"
        ));
    }
    let mut residuals = vec![f64::NAN; moments.len()];
    kept.iter().for_each(|&i| residuals[rows[i]] = own[i]);
    let dropped = line.dropped.iter().map(|&k| parents[k]).collect();
    Ok(Fitted {
        equation: Arc::new(equation),
        rows,
        residuals,
        dropped,
        alone: alone.len() - kept.len(),
        line,
        mean_square,
        hyperparameters,
        target,
        columns,
    })
}

/// The process on what the line leaves, on at most [`GP_ROWS`] rows; `None` where there is none.
fn process(
    columns: &[Vec<f64>],
    left: &[f64],
    used: &[usize],
    known: Option<Option<Hyperparameters>>,
) -> Option<GpRegression> {
    let (target, conditions) =
        (thinned(left), used.iter().map(|&k| thinned(&columns[k])).collect::<Vec<_>>());
    match known {
        Some(None) => None,
        Some(Some((l, s))) => GpRegression::at(&target, &conditions, l, s).ok(),
        None => GpRegression::fit(&target, &conditions, &TestSettings::default()).ok(),
    }
}

/// The values on the rows of a process.
fn thinned<T: Copy>(values: &[T]) -> Vec<T> {
    thin(values.len(), GP_ROWS).map(|i| values[i]).collect()
}

/// Every `ceil(n / most)`-th of `0..n`.
pub(crate) fn thin(n: usize, most: usize) -> impl Iterator<Item = usize> {
    (0..n).step_by(n.div_ceil(most).max(1))
}

/// At most `most` of `0..n`, evenly spread.
pub(crate) fn spread(n: usize, most: usize) -> impl Iterator<Item = usize> {
    let count = n.min(most);
    (0..count).map(move |i| i * n / count)
}

impl Fitted {
    /// The same equation on rows that count as often as their moments do; its hyperparameters stay.
    ///
    /// # Errors
    /// A resample on which the process has no covariance.
    pub(crate) fn resampled(&self, counts: &[u32]) -> Result<Equation> {
        let counts: Vec<u32> = self.rows.iter().map(|&m| counts[m]).collect();
        let line = weighted(&self.target, &self.columns, Some(&counts));
        let mut equation = Equation::line(&self.equation.parents, line.intercept, &line.coefficients);
        if let Some((used, process)) = &self.equation.process {
            let process = process.resampled(&thinned(&line.residuals), &thinned(&counts))?;
            equation.process = Some((used.clone(), process));
        }
        Ok(equation)
    }

    /// Equations that the true one may be, on rows that count as often as their moments do. They may bend where a line was taken, too: what
    /// bends a little is forecast no better for it, but what would have been had a value been another is.
    ///
    /// `counts`: of [`bend_counts`](Self::bend_counts), for each draw.
    pub(crate) fn drawn(&self, counts: Vec<Array1<f64>>, seed: u64) -> Vec<Arc<Equation>> {
        let some =
            |values: &Vec<f64>| spread(values.len(), BEND_ROWS).map(|i| values[i]).collect::<Vec<f64>>();
        let columns: Vec<Vec<f64>> = self.columns.iter().map(some).collect();
        // What happens once may be in none of these rows.
        let varies = |k: &usize| columns[*k].iter().any(|value| *value != columns[*k][0]);
        let used = (0..columns.len()).filter(|k| !self.line.dropped.contains(k) && varies(k));
        let used: Vec<usize> = used.collect();
        let whole = |drawn: Drawn| {
            let intercept = self.line.intercept + drawn.constant;
            let mut equation = Equation::line(&self.equation.parents, intercept, &self.line.coefficients);
            drawn.slopes.into_iter().for_each(|(k, slope)| equation.coefficients[k] += slope);
            Arc::new(Equation { bends: drawn.bends, ..equation })
        };
        let drawn = draws((&some(&self.line.residuals), &columns, &used), counts, seed);
        drawn.into_iter().map(whole).collect()
    }

    /// How often the rows count that say where it bends.
    pub(crate) fn bend_counts(&self, counts: &[u32]) -> Array1<f64> {
        spread(self.rows.len(), BEND_ROWS).map(|i| f64::from(counts[self.rows[i]])).collect()
    }
}
