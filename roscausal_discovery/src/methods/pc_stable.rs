//! PC1, the condition selection of PCMCI: for each target, the parents that the MCI tests then condition on.
//!
//! It starts from all possible lagged links into the target. In round `n` each remaining candidate is tested given the `n`
//! strongest others, and removed if it is independent. The removals of a round take effect at its end, so the order
//! of the variables does not matter.

use std::collections::HashMap;

use super::{
    result::{Candidate, TargetParents},
    run::Run,
};
use crate::types::{Assumption, LinkAssumptions, Node, Result, TestResult};

/// Settings of PC1.
#[derive(Clone, Debug)]
pub(crate) struct PcStable<'a> {
    pub(crate) links: &'a LinkAssumptions,
    /// One level, or several from which a score chooses one per target.
    pub(crate) pc_alphas: &'a [f64],
    pub(crate) max_conds_dim: Option<usize>,
    pub(crate) max_combinations: usize,
}

/// Tests of one target, by source and conditions, so that the next level can reuse them.
type Memo = HashMap<(Node, Vec<Node>), TestResult>;

/// One candidate in a round.
struct Round {
    candidate: Candidate,
    removed: bool,
    new: Vec<((Node, Vec<Node>), TestResult)>,
}

impl PcStable<'_> {
    /// Runs PC1 for all targets (Runge et al. 2019; the order-independent PC algorithm of Colombo and Maathuis
    /// 2014, one target at a time). Also returns whether the time budget ended it.
    pub(crate) fn run(&self, run: &Run<'_>) -> Result<(Vec<TargetParents>, bool)> {
        let targets: Vec<usize> = (0..run.n_vars()).collect();
        let outcomes = run.map_targets(&targets, |&target| self.target(run, target));
        let mut out_of_time = false;
        let mut parents = Vec::with_capacity(targets.len());
        for (target, end) in outcomes {
            match end {
                Err(error) if !run.is_timeout(&error) => return Err(error),
                end => out_of_time |= end.is_err(),
            }
            parents.push(target);
        }
        Ok((parents, out_of_time))
    }

    fn target(&self, run: &Run<'_>, target: usize) -> (TargetParents, Result<()>) {
        let mut memo = (self.pc_alphas.len() > 1).then(Memo::new);
        let mut best: Option<(f64, TargetParents)> = None;
        for &pc_alpha in self.pc_alphas {
            let (mut found, end) = self.target_at(run, target, pc_alpha, &mut memo);
            if end.is_err() || self.pc_alphas.len() == 1 {
                return (found, end);
            }
            match run.score(Node::new(target, 0), &found.parents) {
                Err(error) => return (found, Err(error)),
                Ok(score) if best.as_ref().is_none_or(|(lowest, _)| score < *lowest) => {
                    found.optimal_pc_alpha = Some(pc_alpha);
                    best = Some((score, found));
                }
                Ok(_) => {}
            }
        }
        (best.map(|(_, found)| found).unwrap_or_default(), Ok(()))
    }

    fn target_at(
        &self,
        run: &Run<'_>,
        target: usize,
        pc_alpha: f64,
        memo: &mut Option<Memo>,
    ) -> (TargetParents, Result<()>) {
        let lagged = self.links.of_target(target).filter(|(node, _)| node.lag > 0);
        let links: Vec<(Node, Assumption)> = lagged.collect();
        let untested = |&(node, assumption): &(Node, Assumption)| {
            let (val_min, pval_max) = if assumption.exists() { (1.0, 0.0) } else { (f64::INFINITY, 0.0) };
            Candidate { node, val_min, pval_max, value: val_min, samples: None }
        };
        let mut present: Vec<Candidate> = links.iter().map(untested).collect();
        let mut all: HashMap<Node, Candidate> = present.iter().map(|c| (c.node, *c)).collect();
        let mut end = Ok(());
        'rounds: for size in 0..=self.max_conds_dim.unwrap_or(usize::MAX) {
            if present.len() <= size {
                break;
            }
            let order: Vec<Node> = present.iter().map(|c| c.node).collect();
            run.control().expect_tests(order.len());
            let indices: Vec<usize> = (0..order.len()).collect();
            let known = memo.as_ref();
            let outcomes = run.map_tests(&indices, |&k| {
                let exists =
                    self.links.get(order[k].var, target, order[k].lag).is_some_and(Assumption::exists);
                if exists {
                    return Ok(Round { candidate: present[k], removed: false, new: Vec::new() });
                }
                self.candidate(run, target, (&order, k, size), present[k], pc_alpha, known)
            });
            let mut next = Vec::with_capacity(present.len());
            for outcome in outcomes {
                match outcome {
                    Err(error) => {
                        end = Err(error);
                        break 'rounds;
                    }
                    Ok(round) => {
                        all.insert(round.candidate.node, round.candidate);
                        if let Some(memo) = memo {
                            memo.extend(round.new);
                        }
                        if !round.removed {
                            next.push(round.candidate);
                        }
                    }
                }
            }
            // Strongest first; ties keep their order.
            next.sort_by(|a, b| b.val_min.total_cmp(&a.val_min));
            present = next;
        }
        let of = |(node, _): &(Node, Assumption)| match all[node] {
            tested if tested.val_min.is_finite() => tested,
            untested => Candidate { val_min: 0.0, value: 0.0, pval_max: 1.0, ..untested },
        };
        let candidates = links.iter().map(of).collect();
        let parents = present.iter().map(|c| c.node).collect();
        (TargetParents { parents, candidates, optimal_pc_alpha: None }, end)
    }

    /// Tests candidate `k` of `order` given the first combinations of `size` others.
    fn candidate(
        &self,
        run: &Run<'_>,
        target: usize,
        (order, k, size): (&[Node], usize, usize),
        mut candidate: Candidate,
        pc_alpha: f64,
        memo: Option<&Memo>,
    ) -> Result<Round> {
        let others = [&order[..k], &order[k + 1..]].concat();
        let mut new = Vec::new();
        for z in combinations(&others, size).take(self.max_combinations) {
            let known = memo.and_then(|memo| memo.get(&(order[k], z.clone())));
            let raw = match known {
                Some(&known) => known,
                None => {
                    let result = run.test(order[k], Node::new(target, 0), &z)?;
                    if memo.is_some() {
                        new.push(((order[k], z), result));
                    }
                    result
                }
            };
            let (result, dependent) = run.decide(raw, pc_alpha);
            candidate.val_min = candidate.val_min.min(result.value.abs());
            // At equal p-values the first test counts.
            if result.p_value > candidate.pval_max || !candidate.value.is_finite() {
                candidate.pval_max = result.p_value;
                candidate.value = result.value;
                candidate.samples = Some(result.samples());
            }
            if !dependent {
                return Ok(Round { candidate, removed: true, new });
            }
        }
        Ok(Round { candidate, removed: false, new })
    }
}

/// Advances to the next combination of numbers below `n`, in lexicographic order; false after the last one.
fn next_combination(combination: &mut [usize], n: usize) -> bool {
    let size = combination.len();
    let Some(at) = (0..size).rev().find(|&i| combination[i] < n - size + i) else { return false };
    combination[at] += 1;
    (at + 1..size).for_each(|i| combination[i] = combination[i - 1] + 1);
    true
}

/// All sets of `size` of the nodes, of which there are at least as many, in lexicographic order of their places.
pub(crate) fn combinations(nodes: &[Node], size: usize) -> impl Iterator<Item = Vec<Node>> {
    let after = |places: &Vec<usize>| {
        let mut places = places.clone();
        next_combination(&mut places, nodes.len()).then_some(places)
    };
    let all = std::iter::successors(Some((0..size).collect()), after);
    all.map(|places| places.iter().map(|&k| nodes[k]).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn combinations_come_in_lexicographic_order() {
        let mut combination = vec![0, 1];
        let mut all = vec![combination.clone()];
        while next_combination(&mut combination, 4) {
            all.push(combination.clone());
        }
        assert_eq!(all, [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]].map(|c| c.to_vec()));
        assert!(!next_combination(&mut [], 3));
    }
}
