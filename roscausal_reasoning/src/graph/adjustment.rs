//! Adjustment sets: which variables at which times make the effect of X on Y a regression coefficient.
//!
//! Perkovic et al. 2018 (validity), Henckel et al. 2022 and Runge 2021 (the optimal set), for a graph without hidden variables that
//! repeats in time:
//! 1. unroll it to `L` = largest lag of X + largest lag of the graph;
//! 2. mediators M: nodes on directed paths from X to Y;
//! 3. forbidden: X, and the descendants of Y and M;
//! 4. a set exists iff no node of X descends from Y or M;
//! 5. the optimal one: parents of Y and M that are not forbidden.
//!
//! Nothing enumerates paths: each step is a search along links, over (variable, lag), in time proportional to their number.
//!
//! Example: `z -> x -> m -> y`, `z -> y`. M = {m}; parents of y and m = {m, z, x}; without what is forbidden: {z}.

use roscausal_discovery::Node;

use super::Graph;

/// How the effect of X on Y can be read off data.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Adjustment {
    /// Whether a directed path leads from X to Y; without one the effect is 0.
    pub causal_path: bool,
    /// The largest lag that was looked at.
    pub window: usize,
    /// Nodes on the paths, without X and Y.
    pub mediators: Vec<Node>,
    /// The optimal set; `None` where no set is valid, which happens for several X with feedback between them: simulate then.
    pub set: Option<Vec<Node>>,
}

/// The unrolled nodes: `true` at `lag * n + var`.
struct Nodes<'a> {
    graph: &'a Graph,
    window: usize,
}

type Set = Vec<bool>;

impl Nodes<'_> {
    fn index(&self, node: Node) -> usize {
        node.lag * self.graph.len() + node.var
    }

    fn node(&self, index: usize) -> Node {
        Node::new(index % self.graph.len(), index / self.graph.len())
    }

    fn set(&self, nodes: &[Node]) -> Set {
        let mut set = vec![false; (self.window + 1) * self.graph.len()];
        nodes.iter().for_each(|&node| set[self.index(node)] = true);
        set
    }

    fn parents(&self, node: Node) -> impl Iterator<Item = Node> + '_ {
        let shifted = self.graph.parents(node.var).iter().map(move |parent| parent.shifted(node.lag));
        shifted.filter(|parent| parent.lag <= self.window)
    }

    fn children(&self, node: Node) -> impl Iterator<Item = Node> + '_ {
        let arrows =
            self.graph.arrows().filter(move |arrow| arrow.cause == node.var && arrow.lag <= node.lag);
        arrows.map(move |arrow| Node::new(arrow.effect, node.lag - arrow.lag))
    }

    /// What can be reached from `start` by `next`, `start` itself included; the search does not enter `wall`.
    fn reach<I: Iterator<Item = Node>>(&self, start: &[Node], wall: &Set, next: impl Fn(Node) -> I) -> Set {
        let mut seen = self.set(start);
        let mut open = start.to_vec();
        while let Some(node) = open.pop() {
            for other in next(node) {
                let index = self.index(other);
                if !seen[index] && !wall[index] {
                    seen[index] = true;
                    open.push(other);
                }
            }
        }
        seen
    }

    fn list(&self, set: &Set) -> Vec<Node> {
        (0..set.len()).filter(|&index| set[index]).map(|index| self.node(index)).collect()
    }
}

/// The optimal adjustment set for the effect of `x` (one node or several) on `y`. Nodes that the graph does not have are left out.
///
/// ```
/// use roscausal_discovery::Node;
/// use roscausal_reasoning::graph::{Arrow, Graph, adjustment};
///
/// // z drives x and y one step later, x drives y.
/// let arrow = |cause, effect| Arrow { cause, effect, lag: 1 };
/// let graph = Graph::new(vec!["z".into(), "x".into(), "y".into()], 1, &[arrow(0, 1), arrow(0, 2), arrow(1, 2)], &[])?;
/// let found = adjustment(&graph, &[Node::new(1, 1)], Node::new(2, 0));
/// assert_eq!(found.set, Some(vec![Node::new(0, 1)]));
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
pub fn adjustment(graph: &Graph, x: &[Node], y: Node) -> Adjustment {
    let x: Vec<Node> = x.iter().copied().filter(|node| node.var < graph.len()).collect();
    let window = x.iter().map(|node| node.lag).max().unwrap_or(0).max(y.lag) + graph.largest_lag();
    let nodes = Nodes { graph, window };
    let none = Adjustment { causal_path: false, window, mediators: Vec::new(), set: Some(Vec::new()) };
    if y.var >= graph.len() || x.contains(&y) {
        return none;
    }
    // Paths leave X once: what lies behind another node of X belongs to that one.
    let wall = nodes.set(&x);
    let from_x = nodes.reach(&x, &wall, |node| nodes.children(node));
    if !from_x[nodes.index(y)] {
        return none;
    }
    let to_y = nodes.reach(&[y], &wall, |node| nodes.parents(node));
    let at_end = |index: usize| wall[index] || index == nodes.index(y);
    let between: Set = (0..wall.len()).map(|index| from_x[index] && to_y[index] && !at_end(index)).collect();
    let mediators = nodes.list(&between);
    let ends: Vec<Node> = mediators.iter().copied().chain([y]).collect();
    let mut forbidden = nodes.reach(&ends, &nodes.set(&[]), |node| nodes.children(node));
    let valid = !x.iter().any(|&node| forbidden[nodes.index(node)]);
    x.iter().for_each(|&node| forbidden[nodes.index(node)] = true);
    let mut set = nodes.set(&[]);
    for parent in ends.iter().flat_map(|&node| nodes.parents(node)) {
        let index = nodes.index(parent);
        set[index] = !forbidden[index];
    }
    Adjustment { causal_path: true, window, mediators, set: valid.then(|| nodes.list(&set)) }
}
