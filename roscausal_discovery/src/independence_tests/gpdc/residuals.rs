//! Residuals of nodes on condition sets, computed once per run.

use std::{
    collections::HashMap,
    sync::{Arc, Mutex, PoisonError},
};

use super::{distance_correlation::ranks, gp::GaussianProcess};
use crate::ground::{Node, Result};

/// What a test needs of one node given a condition set.
#[derive(Debug)]
pub(super) struct Residuals {
    /// Ranks of the residuals; ties take the largest.
    pub(super) ranks: Vec<u32>,
    /// The residuals themselves, where a shuffle test needs their autocorrelation.
    pub(super) values: Vec<f64>,
    /// Log marginal likelihood of the regression; minus infinity without conditions, so that any
    /// regression scores better.
    pub(super) log_likelihood: f64,
}

/// A node and its conditions, sorted.
type Key = (Node, Vec<Node>);
type Slot = Arc<Mutex<Option<Arc<Residuals>>>>;

/// Residuals by node and condition set, for the samples that every test of a run shares.
#[derive(Default)]
pub(super) struct ResidualCache(Mutex<HashMap<Key, Slot>>);

impl ResidualCache {
    /// The residuals of `node` given `conditions`, computed by `make` if they are not there yet. Who asks while another
    /// thread computes them waits for that one.
    ///
    /// # Errors
    /// Those of `make`; nothing is kept then.
    pub(super) fn get(
        &self,
        node: Node,
        conditions: &[Node],
        make: impl FnOnce() -> Result<Residuals>,
    ) -> Result<Arc<Residuals>> {
        let slot = {
            let mut slots = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            slots.entry((node, conditions.to_vec())).or_default().clone()
        };
        let mut slot = slot.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(residuals) = &*slot {
            return Ok(residuals.clone());
        }
        let residuals = Arc::new(make()?);
        *slot = Some(residuals.clone());
        Ok(residuals)
    }
}

impl Residuals {
    /// Residuals of `target` by `process`, or of `target` itself without one.
    ///
    /// # Errors
    /// Those of `check`.
    pub(super) fn new(
        target: &[f64],
        process: Option<&GaussianProcess>,
        keep_values: bool,
        check: &dyn Fn() -> Result<()>,
    ) -> Result<Self> {
        let (residuals, log_likelihood) = match process {
            None => (target.to_vec(), f64::NEG_INFINITY),
            Some(process) => {
                let fit = process.fit(&standardized(target), check)?;
                (fit.residuals, fit.log_likelihood)
            }
        };
        let ranks = ranks(&residuals);
        Ok(Self { ranks, values: if keep_values { residuals } else { Vec::new() }, log_likelihood })
    }
}

/// `values` with mean 0 and variance 1 (by `n`); constant values become 0.
pub(super) fn standardized(values: &[f64]) -> Vec<f64> {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let deviation = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt();
    let scale = if deviation > 0.0 { deviation } else { 1.0 };
    values.iter().map(|v| (v - mean) / scale).collect()
}

/// Whether all values are the same.
pub(super) fn is_constant(values: &[f64]) -> bool {
    values.windows(2).all(|pair| pair[0] == pair[1])
}
