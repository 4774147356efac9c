//! The skeleton phase of PCMCI+ (Runge 2020, Algorithm 2).

use std::collections::HashMap;

use super::{
    orientation::Triple,
    pc_stable::combinations,
    result::{PcmciResult, Sepset},
    run::Run,
};
use crate::types::{LinkAssumptions, LinkMark, Node, Result, TestResult};

/// Conditions of a test: cause, effect, contemporaneous conditions.
pub(crate) type Conditions<'a> = dyn Fn(Node, usize, &[Node]) -> Vec<Node> + Sync + 'a;

/// Finds the skeleton: MCI tests of all links with growing sets of neighbours of the effect.
pub(crate) struct Skeleton<'a, 'b> {
    pub(crate) run: &'a Run<'b>,
    pub(crate) links: &'a LinkAssumptions,
    pub(crate) level: f64,
    pub(crate) max_conds_dim: Option<usize>,
    pub(crate) conditions: &'a Conditions<'a>,
    /// The variables whose links are tested, as causes; `None`: all.
    pub(crate) sources: Option<&'a [bool]>,
    /// Whether neighbours at all lags are conditions, and not only those at lag 0.
    pub(crate) all_lags: bool,
    pub(crate) sepsets: HashMap<(Node, usize), Vec<Node>>,
}

/// A link in a round, with the tests done. The last of them may have removed it.
#[derive(Default)]
struct Round {
    /// One list per direction; for lagged links only the first.
    tests: [Vec<TestResult>; 2],
    separated_by: Option<Vec<Node>>,
    any: bool,
}

impl Skeleton<'_, '_> {
    /// Removes links from `result.graph`. Returns whether the time budget ended it.
    pub(crate) fn find(&mut self, result: &mut PcmciResult) -> Result<bool> {
        let in_time = self.rounds(result)?;
        symmetrise(result);
        result.p_matrix.mapv_inplace(|p| if p < 0.0 { 1.0 } else { p });
        Ok(!in_time)
    }

    /// Rounds with growing sets, until no link has enough neighbours. Returns whether they came to their end in time.
    fn rounds(&mut self, result: &mut PcmciResult) -> Result<bool> {
        let mut strength: HashMap<(Node, usize), f64> = HashMap::new();
        for size in 0..=self.max_conds_dim.unwrap_or(usize::MAX) {
            let neighbours: Vec<Vec<Node>> = (0..self.run.n_vars())
                .map(|j| {
                    let mut nodes = self.neighbours(result, j);
                    // A certain link has the strength 1, as in the matrices.
                    let untested = |node: &Node| {
                        let certain = self.links.get(node.var, j, node.lag).is_some_and(|a| a.exists());
                        if certain { 1.0 } else { f64::INFINITY }
                    };
                    let of =
                        |node: &Node| strength.get(&(*node, j)).copied().unwrap_or_else(|| untested(node));
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
                    Err(error) if self.run.is_timeout(&error) => return Ok(false),
                    round => round?,
                };
                any |= round.any;
                self.put(result, &mut strength, x, j, round);
            }
            if !any {
                break;
            }
        }
        Ok(true)
    }

    /// Links to test: the lagged ones, and each pair at lag 0 once, with the smaller variable as the cause.
    fn present(&self, result: &PcmciResult) -> Vec<(Node, usize)> {
        let mut links = Vec::new();
        for j in 0..self.run.n_vars() {
            for (node, assumption) in self.links.of_target(j) {
                let there = result.graph[[node.var, j, node.lag]].is_link();
                let asked = self.is_source(node.var) || (node.lag == 0 && self.is_source(j));
                if asked && there && !assumption.exists() && (node.lag > 0 || node.var < j) {
                    links.push((node, j));
                }
            }
        }
        links
    }

    fn is_source(&self, var: usize) -> bool {
        self.sources.is_none_or(|sources| sources[var])
    }

    fn test_link(&self, neighbours: &[Vec<Node>], x: Node, j: usize, size: usize) -> Result<Round> {
        let mut round = Round::default();
        let directions = [(x, j), (Node::new(j, 0), x.var)];
        for (direction, &(x, j)) in directions[..if x.lag == 0 { 2 } else { 1 }].iter().enumerate() {
            if !self.is_source(x.var) {
                continue;
            }
            let others: Vec<Node> = neighbours[j].iter().copied().filter(|&node| node != x).collect();
            if others.len() < size {
                continue;
            }
            for set in combinations(&others, size) {
                let z = (self.conditions)(x, j, &set);
                let (outcome, dependent) =
                    self.run.decide(self.run.test(x, Node::new(j, 0), &z)?, self.level);
                round.any = true;
                round.tests[direction].push(outcome);
                if !dependent {
                    round.separated_by = Some(set);
                    return Ok(round);
                }
            }
        }
        Ok(round)
    }

    /// Writes the tests of a link, each direction of a pair at lag 0 apart: the value is that of the test with the largest
    /// p-value, of several the last. On strong links many p-values are 0, and the reference does so. The p-value that removes a
    /// link counts for both directions; the value of the other one stays, as in the reference.
    fn put(
        &mut self,
        result: &mut PcmciResult,
        strength: &mut HashMap<(Node, usize), f64>,
        x: Node,
        j: usize,
        round: Round,
    ) {
        let ends = [(x, j), (Node::new(j, 0), x.var)];
        let removed_by = round.tests.iter().rev().find_map(|tests| tests.last()).map(|test| test.p_value);
        for (direction, &(x, j)) in ends[..if x.lag == 0 { 2 } else { 1 }].iter().enumerate() {
            // Where one direction is not asked for, the other one counts for both.
            let tests = &round.tests[if self.is_source(x.var) { direction } else { 1 - direction }];
            let at = [x.var, j, x.lag];
            for test in tests {
                if test.p_value >= result.p_matrix[at] {
                    result.put(at, test.value, test.p_value, Some(test.samples()));
                }
            }
            let weakest = strength.entry((x, j)).or_insert(f64::INFINITY);
            let values = round.tests.iter().flatten().map(|test| test.value.abs());
            *weakest = values.fold(*weakest, f64::min);
            if let Some(set) = &round.separated_by {
                result.graph[at] = LinkMark::Absent;
                result.p_matrix[at] = result.p_matrix[at].max(removed_by.unwrap_or(-1.0));
                self.sepsets.insert((x, j), set.clone());
            }
        }
    }

    /// Neighbours of `j` that may be conditions, in ascending order.
    pub(crate) fn neighbours(&self, result: &PcmciResult, j: usize) -> Vec<Node> {
        let lags = if self.all_lags { result.graph.dim().2 } else { 1 };
        let nodes = (0..self.run.n_vars()).flat_map(|i| (0..lags).map(move |lag| Node::new(i, lag)));
        nodes.filter(|node| result.graph[[node.var, j, node.lag]].is_link()).collect()
    }

    /// Puts the middle of a triple into the set that separates its ends, or takes it out, as the vote on it says.
    pub(crate) fn amend(&mut self, triple: &Triple, with_middle: bool) {
        let middle = Node::new(triple.k, 0);
        let ends = [(triple.i, triple.j), (Node::new(triple.j, 0), triple.i.var)];
        for &end in &ends[..if triple.i.lag == 0 { 2 } else { 1 }] {
            let set = self.sepsets.entry(end).or_default();
            if !with_middle {
                set.retain(|node| *node != middle);
            } else if !set.contains(&middle) {
                set.push(middle);
            }
        }
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

/// Gives both directions of a pair at lag 0 the values of the one with the larger p-value, at equal ones those from the smaller
/// variable to the larger.
fn symmetrise(result: &mut PcmciResult) {
    let n = result.p_matrix.dim().0;
    for (i, j) in (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j))) {
        let (forward, back) = ([i, j, 0], [j, i, 0]);
        let (from, to) =
            if result.p_matrix[forward] >= result.p_matrix[back] { (forward, back) } else { (back, forward) };
        result.copy(from, to);
    }
}
