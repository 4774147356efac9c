//! The skeleton phase of PCMCI+ (Runge 2020, Algorithm 2).

use std::collections::HashMap;

use super::{
    pc_stable::next_combination,
    result::{PcmciResult, Sepset},
    run::Run,
};
use crate::ground::{LinkAssumptions, LinkMark, Node, Result, TestResult};

/// Conditions of a test: cause, effect, contemporaneous conditions.
pub(crate) type Conditions<'a> = dyn Fn(Node, usize, &[Node]) -> Vec<Node> + Sync + 'a;

/// Finds the skeleton: MCI tests of all links with growing sets of contemporaneous neighbours of the effect.
pub(crate) struct Skeleton<'a, 'b> {
    pub(crate) run: &'a Run<'b>,
    pub(crate) links: &'a LinkAssumptions,
    pub(crate) level: f64,
    pub(crate) max_conds_dim: Option<usize>,
    pub(crate) conditions: &'a Conditions<'a>,
    pub(crate) sepsets: HashMap<(Node, usize), Vec<Node>>,
}

/// A link in a round, with the tests done. The last of them may have removed it.
#[derive(Default)]
struct Round {
    /// One list per direction; for lagged links only the first.
    tests: Vec<TestResult>,
    separated_by: Option<Vec<Node>>,
    any: bool,
}

impl Skeleton<'_, '_> {
    /// Removes links from `result.graph`. Returns whether the time budget ended it.
    pub(crate) fn find(&mut self, result: &mut PcmciResult) -> Result<bool> {
        let mut strength: HashMap<(Node, usize), f64> = HashMap::new();
        for size in 0..=self.max_conds_dim.unwrap_or(usize::MAX) {
            let neighbours: Vec<Vec<Node>> = (0..self.run.n_vars())
                .map(|j| {
                    let mut nodes = self.neighbours(result, j);
                    let of = |node: &Node| strength.get(&(*node, j)).copied().unwrap_or(f64::INFINITY);
                    nodes.sort_by(|a, b| of(b).total_cmp(&of(a)));
                    nodes
                })
                .collect();
            let links = self.present(result);
            self.run.control().expect_tests(links.len());
            let rounds = self.run.map_tests(&links, |&(x, j)| self.test_link(&neighbours, x, j, size));
            let mut any = false;
            for (&(x, j), round) in links.iter().zip(rounds) {
                let round = match round {
                    Err(error) if self.run.is_timeout(&error) => {
                        result.p_matrix.mapv_inplace(|p| if p < 0.0 { 1.0 } else { p });
                        return Ok(true);
                    }
                    round => round?,
                };
                any |= round.any;
                self.put(result, &mut strength, x, j, round);
            }
            if !any {
                break;
            }
        }
        result.p_matrix.mapv_inplace(|p| if p < 0.0 { 1.0 } else { p });
        Ok(false)
    }

    /// Links to test: the lagged ones, and each pair at lag 0 once, with the smaller variable as the cause.
    fn present(&self, result: &PcmciResult) -> Vec<(Node, usize)> {
        let mut links = Vec::new();
        for j in 0..self.run.n_vars() {
            for (node, assumption) in self.links.of_target(j) {
                let there = result.graph[[node.var, j, node.lag]].is_link();
                if there && !assumption.exists() && (node.lag > 0 || node.var < j) {
                    links.push((node, j));
                }
            }
        }
        links
    }

    fn test_link(&self, neighbours: &[Vec<Node>], x: Node, j: usize, size: usize) -> Result<Round> {
        let mut round = Round::default();
        let directions = [(x, j), (Node::new(j, 0), x.var)];
        for &(x, j) in &directions[..if x.lag == 0 { 2 } else { 1 }] {
            let others: Vec<Node> = neighbours[j].iter().copied().filter(|&node| node != x).collect();
            if others.len() < size {
                continue;
            }
            let mut combination: Vec<usize> = (0..size).collect();
            loop {
                let set: Vec<Node> = combination.iter().map(|&m| others[m]).collect();
                let z = (self.conditions)(x, j, &set);
                let (outcome, dependent) =
                    self.run.decide(self.run.test(x, Node::new(j, 0), &z)?, self.level);
                round.any = true;
                round.tests.push(outcome);
                if !dependent {
                    round.separated_by = Some(set);
                    return Ok(round);
                }
                if !next_combination(&mut combination, others.len()) {
                    break;
                }
            }
        }
        Ok(round)
    }

    /// Writes the tests of a link: its value is that of the test with the largest p-value.
    fn put(
        &mut self,
        result: &mut PcmciResult,
        strength: &mut HashMap<(Node, usize), f64>,
        x: Node,
        j: usize,
        round: Round,
    ) {
        let ends = [(x, j), (Node::new(j, 0), x.var)];
        for &(x, j) in &ends[..if x.lag == 0 { 2 } else { 1 }] {
            let at = [x.var, j, x.lag];
            let weakest = strength.entry((x, j)).or_insert(f64::INFINITY);
            for test in &round.tests {
                *weakest = weakest.min(test.value.abs());
                if test.p_value > result.p_matrix[at] {
                    result.p_matrix[at] = test.p_value;
                    result.val_matrix[at] = test.value;
                    result.n_lost[at] = test.n_lost;
                }
            }
            if let Some(set) = &round.separated_by {
                result.graph[at] = LinkMark::Absent;
                self.sepsets.insert((x, j), set.clone());
            }
        }
    }

    /// Contemporaneous neighbours of `j`, in ascending order.
    pub(crate) fn neighbours(&self, result: &PcmciResult, j: usize) -> Vec<Node> {
        (0..self.run.n_vars())
            .filter(|&i| result.graph[[i, j, 0]].is_link())
            .map(|i| Node::new(i, 0))
            .collect()
    }

    /// The set that separated `i` from `j`; empty if no contemporaneous condition was needed.
    pub(crate) fn sepset(&self, i: Node, j: usize) -> &[Node] {
        self.sepsets.get(&(i, j)).map_or(&[], Vec::as_slice)
    }

    /// The non-empty separating sets, in order.
    pub(crate) fn listed(&self) -> Vec<Sepset> {
        let mut listed: Vec<Sepset> = self
            .sepsets
            .iter()
            .filter(|(_, conditions)| !conditions.is_empty())
            .map(|(&(cause, effect), conditions)| Sepset { cause, effect, conditions: conditions.clone() })
            .collect();
        listed.sort_by_key(|sepset| (sepset.cause, sepset.effect));
        listed
    }
}
