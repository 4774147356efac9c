//! A test that knows the true graph, for checking methods.

use std::collections::{HashSet, VecDeque};

use crate::types::{
    Assumption, CondIndTest, Dummy, Error, LinkAssumptions, Node, PreparedTest, Result, Samples, TestResult,
};

/// A test that knows the truth: d-separation in a given time series graph (Pearl 1988). With it a method shows what
/// it would find with infinite data. Value and p-value are 1 and 0 for dependent nodes, 0 and 1 for separated ones.
///
/// Take it to study a method, or to test one: what it finds with the oracle and not with data is a matter of samples.
///
/// ```
/// use roscausal_discovery::{Assumption, LinkAssumptions, Node, independence_tests::OracleCi};
///
/// // 0 drives 1, and 1 drives 2, one step later each.
/// let mut truth = LinkAssumptions::none(3);
/// truth.insert(0, 1, 1, Assumption::Exists)?;
/// truth.insert(1, 2, 1, Assumption::Exists)?;
/// let oracle = OracleCi::new(&truth)?;
/// assert!(!oracle.is_separated(Node::new(0, 2), Node::new(2, 0), &[]));
/// assert!(oracle.is_separated(Node::new(0, 2), Node::new(2, 0), &[Node::new(1, 1)]));
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
///
/// Paths into the past are followed until a finite set of conditions can no longer open or block them.
#[derive(Clone, Debug)]
pub struct OracleCi {
    /// `parents[j]`: the causes of `j` at `t`, with their lags.
    parents: Vec<Vec<Node>>,
    /// `children[i]`: the effects of `i` at `t`, with the number of steps until each.
    children: Vec<Vec<Node>>,
    max_lag: usize,
}

impl OracleCi {
    /// The oracle of the graph whose links `truth` assumes to exist (`-->`, and `<--` at lag 0).
    ///
    /// # Errors
    /// A link without direction, or a cycle at lag 0.
    pub fn new(truth: &LinkAssumptions) -> Result<Self> {
        let n_vars = truth.n_vars();
        let mut parents = vec![Vec::new(); n_vars];
        let mut children = vec![Vec::new(); n_vars];
        for (target, parents) in parents.iter_mut().enumerate() {
            for (node, assumption) in truth.of_target(target) {
                match assumption {
                    Assumption::Exists => {
                        parents.push(node);
                        children[node.var].push(Node::new(target, node.lag));
                    }
                    Assumption::ExistsBackward => {}
                    other => {
                        let reason = format!("'{}' is not a link of a known graph; use -->", other.symbol());
                        return Err(Error::param("truth", reason));
                    }
                }
            }
        }
        let max_lag = parents.iter().flatten().map(|node: &Node| node.lag).max().unwrap_or(0);
        let oracle = Self { parents, children, max_lag };
        let reason = "the links at lag 0 have a cycle; a causal graph has none";
        Error::ensure(!oracle.has_cycle(), "truth", || reason)?;
        Ok(oracle)
    }

    fn has_cycle(&self) -> bool {
        // Removes variables that have no contemporaneous parent left, until none remains or there is a cycle.
        let mut left: HashSet<usize> = (0..self.parents.len()).collect();
        loop {
            let free = |&&v: &&usize| !self.parents[v].iter().any(|p| p.lag == 0 && left.contains(&p.var));
            match left.iter().find(free).copied() {
                Some(v) => left.remove(&v),
                None => return !left.is_empty(),
            };
        }
    }

    /// Whether `z` separates `x` from `y`.
    pub fn is_separated(&self, x: Node, y: Node, z: &[Node]) -> bool {
        // A path that leaves the window of the nodes into the past returns, if at all, without meeting a condition.
        // The number of variables times the longest lag covers any such detour.
        let deepest = [x, y].iter().chain(z).map(|node| node.lag).max().unwrap_or(0);
        let horizon = deepest + self.max_lag * (self.parents.len() + 1);
        let conditions: HashSet<Node> = z.iter().copied().collect();
        let opened = self.ancestors(z, horizon);
        // Bayes ball: (node, whether it was reached from a child).
        let mut seen = HashSet::new();
        let mut queue = VecDeque::from([(x, true)]);
        while let Some((node, from_child)) = queue.pop_front() {
            if !seen.insert((node, from_child)) {
                continue;
            }
            let blocked = conditions.contains(&node);
            if node == y && !blocked {
                return false;
            }
            if from_child && !blocked {
                queue.extend(self.parents_of(node, horizon).map(|parent| (parent, true)));
                queue.extend(self.children_of(node).map(|child| (child, false)));
            }
            if !from_child {
                if !blocked {
                    queue.extend(self.children_of(node).map(|child| (child, false)));
                }
                if opened.contains(&node) {
                    queue.extend(self.parents_of(node, horizon).map(|parent| (parent, true)));
                }
            }
        }
        true
    }

    /// The nodes and all their ancestors: colliders there are open.
    fn ancestors(&self, nodes: &[Node], horizon: usize) -> HashSet<Node> {
        let mut found = HashSet::new();
        let mut queue: Vec<Node> = nodes.to_vec();
        while let Some(node) = queue.pop() {
            if found.insert(node) {
                queue.extend(self.parents_of(node, horizon));
            }
        }
        found
    }

    fn parents_of(&self, node: Node, horizon: usize) -> impl Iterator<Item = Node> + '_ {
        let parents = self.parents[node.var].iter().map(move |parent| parent.shifted(node.lag));
        parents.filter(move |parent| parent.lag <= horizon)
    }

    /// Effects up to the present.
    fn children_of(&self, node: Node) -> impl Iterator<Item = Node> + '_ {
        self.children[node.var]
            .iter()
            .filter_map(move |child| Some(Node::new(child.var, node.lag.checked_sub(child.lag)?)))
    }
}

impl CondIndTest for OracleCi {
    fn name(&self) -> &'static str {
        "oracle"
    }

    /// It knows dummies as further variables.
    fn with_dummies(&self, _: &[Dummy]) -> Result<Box<dyn CondIndTest + '_>> {
        Ok(Box::new(self.clone()))
    }

    fn prepare<'a>(&'a self, samples: &'a Samples<'a>) -> Result<Box<dyn PreparedTest + 'a>> {
        let (known, n) = (self.parents.len(), samples.data().n_vars());
        Error::ensure_data(known == n, || format!("the oracle knows {known} variables, the data have {n}"))?;
        Ok(Box::new(self))
    }
}

impl PreparedTest for &OracleCi {
    fn run_test(&self, x: Node, y: Node, z: &[Node]) -> Result<TestResult> {
        let (value, p_value) = if self.is_separated(x, y, z) { (0.0, 1.0) } else { (1.0, 0.0) };
        Ok(TestResult::new(value, p_value, 0, 0))
    }

    fn is_cheap(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn truth(n_vars: usize, links: &[(usize, usize, usize)]) -> OracleCi {
        let mut truth = LinkAssumptions::none(n_vars);
        links.iter().for_each(|&(i, j, lag)| truth.insert(i, j, lag, Assumption::Exists).unwrap());
        OracleCi::new(&truth).unwrap()
    }

    #[test]
    fn chains_forks_and_colliders_are_separated_as_in_the_book() {
        let n = Node::new;
        // 0 -> 1 -> 2 at lag 1 each.
        let chain = truth(3, &[(0, 1, 1), (1, 2, 1)]);
        assert!(!chain.is_separated(n(0, 2), n(2, 0), &[]));
        assert!(chain.is_separated(n(0, 2), n(2, 0), &[n(1, 1)]));
        // 0 <- 1 -> 2.
        let fork = truth(3, &[(1, 0, 1), (1, 2, 2)]);
        assert!(!fork.is_separated(n(0, 1), n(2, 0), &[]));
        assert!(fork.is_separated(n(0, 1), n(2, 0), &[n(1, 2)]));
        // 0 -> 1 <- 2, and 1 -> 3.
        let collider = truth(4, &[(0, 1, 1), (2, 1, 1), (1, 3, 1)]);
        assert!(collider.is_separated(n(0, 1), n(2, 1), &[]));
        assert!(!collider.is_separated(n(0, 1), n(2, 1), &[n(1, 0)]));
        assert!(!collider.is_separated(n(0, 2), n(2, 2), &[n(3, 0)]));
    }

    #[test]
    fn a_common_driver_deep_in_the_past_is_seen() {
        // The autocorrelated variables 0 and 2 share the driver 1 far in the past.
        let n = Node::new;
        let oracle = truth(3, &[(0, 0, 1), (2, 2, 1), (1, 0, 3), (1, 2, 3)]);
        assert!(!oracle.is_separated(n(0, 0), n(2, 0), &[]));
        assert!(!oracle.is_separated(n(0, 0), n(2, 0), &[n(1, 3)]));
        assert!(oracle.is_separated(n(0, 0), n(2, 0), &[n(1, 3), n(0, 1), n(2, 1)]));
    }

    #[test]
    fn a_cycle_at_lag_zero_is_refused() {
        let mut truth = LinkAssumptions::none(3);
        for (i, j) in [(0, 1), (1, 2), (2, 0)] {
            truth.insert(i, j, 0, Assumption::Exists).unwrap();
        }
        assert!(OracleCi::new(&truth).is_err());
    }
}
