//! GPDC: distance correlation of the residuals of Gaussian process regressions (Runge et al. 2019, supplement S3):
//! a test for nonlinear dependence with additive noise.

mod dense;
mod distance_correlation;
mod gp;
mod kernel;
mod lbfgsb;
mod line_search;
mod low_rank;
mod null_table;
mod pcg64;
mod residuals;

use std::sync::Arc;

use super::{CondIndTest, PreparedTest, Significance, TestResult, TestSettings};
use crate::{
    Error, Result,
    discovery::{LaggedArrays, Node, Samples},
};
use distance_correlation::of_ranks;
use gp::GaussianProcess;
use null_table::NullTable;
use residuals::{ResidualCache, Residuals, is_constant, standardized};

/// Samples below which a test is refused.
const FEWEST_SAMPLES: usize = 5;

/// GPDC and its settings.
///
/// Without conditions the two series are compared as they are. With conditions, X and Y are each replaced by their
/// residuals from a Gaussian process regression on Z. Both become ranks; the value is their distance correlation, in
/// `[0, 1]`.
#[derive(Clone, Debug)]
pub struct Gpdc {
    significance: Significance,
    sig_samples: usize,
    seed: u64,
    max_memory: Option<usize>,
}

impl Gpdc {
    /// The test with `settings`: `significance` (`analytic`: from a table of values of independent uniform series, of
    /// `sig_samples` entries; or `fixed_thres`), `seed`, `max_memory`.
    ///
    /// # Errors
    /// A setting that the test does not allow.
    pub fn new(settings: &TestSettings) -> Result<Self> {
        let sig_samples = settings.sig_samples.unwrap_or(500);
        if sig_samples == 0 {
            return Err(Error::param("sig_samples", "must be at least 1 (default 500)"));
        }
        if settings.confidence.is_some() {
            return Err(Error::param("confidence", "gpdc has no confidence interval; leave it out"));
        }
        Ok(Self {
            significance: settings.significance.unwrap_or(Significance::Analytic),
            sig_samples,
            seed: settings.seed,
            max_memory: settings.max_memory,
        })
    }

    /// Refuses what would not fit into the memory that is allowed.
    fn check_memory(&self, n: usize) -> Result<()> {
        let needed = GaussianProcess::bytes(n) * rayon::current_num_threads();
        match self.max_memory {
            Some(allowed) if needed > allowed => Err(Error::param(
                "max_memory",
                format!(
                    "gpdc on {n} samples may take {} MB with {} threads and {} MB are allowed; \
                     use fewer threads or samples, or the test parcorr or robustparcorr",
                    needed >> 20,
                    rayon::current_num_threads(),
                    allowed >> 20
                ),
            )),
            _ => Ok(()),
        }
    }
}

impl CondIndTest for Gpdc {
    fn name(&self) -> &'static str {
        "gpdc"
    }

    fn prepare<'a>(&'a self, samples: &'a Samples<'a>) -> Result<Box<dyn PreparedTest + 'a>> {
        let n = samples.len();
        if n < FEWEST_SAMPLES {
            return Err(too_few(n));
        }
        self.check_memory(n)?;
        Ok(Box::new(PreparedGpdc { test: self, samples, residuals: ResidualCache::default() }))
    }

    fn decides_by_value(&self) -> bool {
        self.significance == Significance::FixedThres
    }
}

/// GPDC on the samples of one run.
struct PreparedGpdc<'a> {
    test: &'a Gpdc,
    samples: &'a Samples<'a>,
    residuals: ResidualCache,
}

impl PreparedTest for PreparedGpdc<'_> {
    fn run_test(&self, x: Node, y: Node, z: &[Node]) -> Result<TestResult> {
        let z = canonical(z);
        let arrays = self.samples.arrays(x, y, &z);
        let n = arrays.x.len();
        if n < FEWEST_SAMPLES {
            return Err(too_few(n));
        }
        let mut result = TestResult {
            value: 0.0,
            p_value: 1.0,
            confidence: None,
            n_samples: n,
            n_lost: arrays.n_lost,
            dependent: None,
        };
        if is_constant(&arrays.x) || is_constant(&arrays.y) {
            return Ok(result);
        }
        let [x, y] = self.pair(x, y, &z, &arrays)?;
        result.value = of_ranks(&x.ranks, &y.ranks);
        if self.test.significance == Significance::Analytic {
            result.p_value =
                NullTable::get(n, self.test.sig_samples, self.test.seed).share_above(result.value);
        }
        Ok(result)
    }

    fn model_selection_score(&self, target: Node, parents: &[Node]) -> Result<f64> {
        let z = canonical(parents);
        let arrays = self.samples.arrays(target, target, &z);
        let [target, _] = self.pair(target, target, &z, &arrays)?;
        Ok(-target.log_likelihood)
    }
}

impl PreparedGpdc<'_> {
    /// Residuals of X and Y.
    fn pair(&self, x: Node, y: Node, z: &[Node], arrays: &LaggedArrays) -> Result<[Arc<Residuals>; 2]> {
        let conditions: Vec<Vec<f64>> =
            arrays.z.iter().filter(|row| !is_constant(row)).map(|row| standardized(row)).collect();
        let process = (!conditions.is_empty()).then(|| GaussianProcess::new(&conditions));
        let check = || self.samples.control().check();
        let of = |node: Node, values: &[f64]| {
            let make = || Residuals::new(values, process.as_ref(), &check);
            // With samples left out, another test of the same node and conditions may have other samples.
            if arrays.n_lost == 0 { self.residuals.get(node, z, make) } else { make().map(Arc::new) }
        };
        Ok([of(x, &arrays.x)?, of(y, &arrays.y)?])
    }
}

/// The conditions in one order, each once: a regression does not depend on their order but for rounding.
fn canonical(z: &[Node]) -> Vec<Node> {
    let mut z = z.to_vec();
    z.sort_unstable();
    z.dedup();
    z
}

fn too_few(n: usize) -> Error {
    Error::Data(format!("gpdc has {n} complete samples and needs at least {FEWEST_SAMPLES}; record more"))
}
