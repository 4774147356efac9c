//! The MCI phase: momentary conditional independence tests of all possible links (Runge et al. 2019).
//!
//! A link `X -> Y` is tested given the parents of Y without X, and the parents of X shifted to its lag.

use std::collections::HashSet;

use ndarray::Array3;

use super::{
    fdr::{Fdr, fdr_bh},
    result::PcmciResult,
    run::Run,
};
use crate::types::{Assumption, Error, LinkAssumptions, LinkMark, Node, Result, TestResult, add_new};

/// The conditions under which links are tested.
#[derive(Clone, Debug)]
pub(crate) struct Mci<'a> {
    pub(crate) links: &'a LinkAssumptions,
    /// Conditions of each target, strongest first.
    pub(crate) parents: &'a [Vec<Node>],
    /// How many parents of the effect, and of the cause, are used.
    pub(crate) max_conds_py: Option<usize>,
    pub(crate) max_conds_px: Option<usize>,
    pub(crate) alpha_level: f64,
    pub(crate) fdr: Fdr,
    /// Whether a pair at lag 0 is marked by two tests, one for each direction, each given the past of its own
    /// effect. Otherwise both directions have the same conditions, and the pair stays unoriented.
    pub(crate) directed: bool,
}

/// Conditions of `x _||_ (effect, 0)`: the effect's parents without `x`, then those parents of `x`, shifted to its
/// lag, that are not yet among them.
pub(crate) fn mci_conditions(x: Node, of_effect: &[Node], of_cause: &[Node], z: &mut Vec<Node>) {
    z.extend(of_effect.iter().copied().filter(|&node| node != x));
    of_cause.iter().for_each(|node| add_new(z, node.shifted(x.lag)));
}

/// The first `limit` nodes.
pub(crate) fn first(nodes: &[Node], limit: Option<usize>) -> &[Node] {
    &nodes[..limit.unwrap_or(nodes.len()).min(nodes.len())]
}

impl Mci<'_> {
    /// Tests every possible link and writes values, p-values and marks into `result`. Returns whether the time
    /// budget ended the run.
    pub(crate) fn run(&self, run: &Run<'_>, result: &mut PcmciResult) -> Result<bool> {
        let tests: Vec<(usize, Vec<Node>)> = (0..run.n_vars())
            .map(|target| {
                let tested = self.links.of_target(target).filter(|(_, assumption)| !assumption.exists());
                (target, tested.map(|(node, _)| node).collect())
            })
            .collect();
        run.control().expect_tests(tests.iter().map(|(_, sources)| sources.len()).sum());
        let outcomes = run.map_targets(&tests, |(target, sources)| {
            run.map_tests(sources, |&source| self.test(run, source, *target))
        });
        let mut out_of_time = false;
        let mut directed = HashSet::new();
        for ((target, sources), outcomes) in tests.iter().zip(outcomes) {
            for (source, outcome) in sources.iter().zip(outcomes) {
                match outcome {
                    Ok(outcome) => {
                        if source.lag == 0 && run.decide(outcome, self.alpha_level).1 {
                            directed.insert((source.var, *target));
                        }
                        self.put(run, result, *source, *target, outcome);
                    }
                    Err(error) if run.is_timeout(&error) => out_of_time = true,
                    Err(error) => return Err(error),
                }
            }
        }
        self.put_existing(result);
        self.mark(result, &directed);
        Ok(out_of_time)
    }

    fn test(&self, run: &Run<'_>, source: Node, target: usize) -> Result<TestResult> {
        let of = |var: usize, limit| self.parents.get(var).map_or(&[][..], |nodes| first(nodes, limit));
        let mut z = Vec::new();
        mci_conditions(source, of(target, self.max_conds_py), of(source.var, self.max_conds_px), &mut z);
        let (source_name, target_name) = (source.var, target);
        run.test(source, Node::new(target, 0), &z).map_err(|error| match error {
            Error::Data(reason) => {
                Error::Data(format!("link {source_name} (lag {}) -> {target_name}: {reason}", source.lag))
            }
            other => other,
        })
    }

    /// Writes one test. Of the two tests of a pair at lag 0, the one with the larger p-value counts.
    fn put(&self, run: &Run<'_>, result: &mut PcmciResult, source: Node, target: usize, outcome: TestResult) {
        let (outcome, _) = run.decide(outcome, self.alpha_level);
        let both = [[source.var, target, source.lag], [target, source.var, 0]];
        let at = &both[..if source.lag == 0 { 2 } else { 1 }];
        // Targets are written in order, so the other test of the pair is already there if the source comes first.
        let second = source.lag == 0 && source.var < target;
        if second && outcome.p_value <= result.p_matrix[both[0]] {
            return;
        }
        for &at in at {
            result.put(at, outcome.value, outcome.p_value, Some(outcome.samples()));
        }
        if let Some(interval) = outcome.confidence {
            let shape = result.graph.dim();
            let conf = result.conf_matrix.get_or_insert_with(|| Array3::default(shape));
            at.iter().for_each(|&at| conf[at] = Some(interval));
        }
    }

    fn put_existing(&self, result: &mut PcmciResult) {
        for target in 0..self.links.n_vars() {
            for (node, _) in self.links.of_target(target).filter(|(_, assumption)| assumption.exists()) {
                result.val_matrix[[node.var, target, node.lag]] = 1.0;
                result.p_matrix[[node.var, target, node.lag]] = 0.0;
            }
        }
    }

    /// Corrects the p-values and marks the links whose p-value is at most the level. `directed` holds the ordered
    /// pairs at lag 0 for which the test in this direction found a dependence.
    fn mark(&self, result: &mut PcmciResult, directed: &HashSet<(usize, usize)>) {
        result.q_matrix = corrected(self.fdr, self.links, &result.p_matrix);
        for target in 0..self.links.n_vars() {
            for (node, assumption) in self.links.of_target(target) {
                let at = [node.var, target, node.lag];
                // Corrected is the larger p-value of a pair, so it decides for both directions.
                let by_direction = self.directed
                    && node.lag == 0
                    && assumption == Assumption::TestUnoriented
                    && self.fdr != Fdr::Bh;
                result.graph[at] = if by_direction {
                    match (directed.contains(&(node.var, target)), directed.contains(&(target, node.var))) {
                        (true, true) => LinkMark::Unoriented,
                        (true, false) => LinkMark::Forward,
                        (false, true) => LinkMark::Backward,
                        (false, false) => LinkMark::Absent,
                    }
                } else if result.deciding_p()[at] <= self.alpha_level {
                    assumption.mark()
                } else {
                    LinkMark::Absent
                };
            }
        }
    }
}

/// P-values corrected over the links that are assumed possible; `None` without a correction.
fn corrected(fdr: Fdr, links: &LinkAssumptions, p_matrix: &Array3<f64>) -> Option<Array3<f64>> {
    // The second of two entries that are one test.
    let is_twin = |(i, j, lag)| {
        lag == 0 && j < i && p_matrix[[i, j, 0]] == p_matrix[[j, i, 0]] && links.get(j, i, 0).is_some()
    };
    let counts = |(i, j, lag)| {
        links.get(i, j, lag).is_some() && (lag > 0 || (fdr == Fdr::Bh && i != j && !is_twin((i, j, lag))))
    };
    (fdr != Fdr::None).then(|| {
        let mut q_matrix = fdr_bh(p_matrix, &Array3::from_shape_fn(p_matrix.dim(), counts));
        if fdr == Fdr::Bh {
            for (i, j, lag) in ndarray::indices(p_matrix.dim()).into_iter().filter(|at| is_twin(*at)) {
                q_matrix[[i, j, lag]] = q_matrix[[j, i, lag]];
            }
        }
        q_matrix
    })
}

/// Corrects the p-values, if that is asked for, and takes out what is then above the level.
pub(crate) fn correct(result: &mut PcmciResult, fdr: Fdr, links: &LinkAssumptions, level: f64) {
    result.q_matrix = corrected(fdr, links, &result.p_matrix);
    let Some(q) = &result.q_matrix else { return };
    let above = result.graph.indexed_iter_mut().filter(|(at, _)| q[*at] > level);
    above.for_each(|(_, mark)| *mark = LinkMark::Absent);
}
