//! The sets in which LPCMCI looks for conditions (Gerhardus and Runge 2020, definitions of apds and napds).

use super::{
    graph::{Link, Pair},
    search::Search,
};
use crate::types::{LinkEnd, Node, unique};

/// What every test of a pair conditions on, and what further conditions are taken from, the strongest first.
pub(super) struct Conditions {
    pub(super) always: Vec<Node>,
    pub(super) choices: Vec<Node>,
}

impl Search<'_, '_> {
    /// Neighbours in the window with a tail at themselves towards A or B, without both, sorted.
    pub(super) fn parents(&self, a: Node, b: Node) -> Vec<Node> {
        let of_both = [a, b].into_iter().flat_map(|end| self.graph.neighbours(end));
        let is_parent = |(node, link): &(Node, Link)| link.left == LinkEnd::Tail && *node != a && *node != b;
        let parents = of_both.filter(is_parent).map(|(node, _)| node).collect();
        unique(parents)
    }

    /// Neighbours of A but B that may cause A: not later, and no head at themselves.
    pub(super) fn apds(&self, a: Node, b: Node) -> Vec<Node> {
        let may_cause = |node: &Node, left| *node != b && node.lag >= a.lag && left != LinkEnd::Head;
        self.graph.neighbours(a).filter(|(node, link)| may_cause(node, link.left)).map(|(n, _)| n).collect()
    }

    /// Conditions of the ancestral phase, from A's side.
    pub(super) fn ancestral_conditions(&self, a: Node, b: Node) -> Conditions {
        self.conditions(a, self.parents(a, b), self.apds(a, b))
    }

    /// Conditions of the non-ancestral phase, from A's side.
    pub(super) fn non_ancestral_conditions(&self, a: Node, b: Node) -> Conditions {
        let napds = self.napds(a, b);
        let mut always = self.parents(a, b);
        let known = |node: &&Node| self.is_ancestor(**node, a) || self.is_ancestor(**node, b);
        always.extend(napds.iter().filter(known));
        self.conditions(a, unique(always), napds)
    }

    /// Choices by `|value|` with `a`, the largest first; ties: higher variable, then smaller lag.
    fn conditions(&self, a: Node, always: Vec<Node>, mut choices: Vec<Node>) -> Conditions {
        choices.retain(|node| !always.contains(node));
        choices.sort_by(|&m, &n| {
            let by_strength = self.strength(n, a).total_cmp(&self.strength(m, a));
            by_strength.then(n.var.cmp(&m.var)).then(m.lag.cmp(&n.lag))
        });
        Conditions { always, choices }
    }

    fn napds(&self, a: Node, b: Node) -> Vec<Node> {
        let mut found = self.apds(a, b);
        found.retain(|&node| !self.is_ancestor(b, node));
        let starts = self.graph.neighbours(a).filter(|(node, link)| {
            let no_tail = link.left != LinkEnd::Tail && link.right != LinkEnd::Tail;
            *node != b && node.lag >= b.lag && no_tail && !self.is_no_ancestor(*node, b)
        });
        let mut open: Vec<(Node, Node)> = starts.map(|(node, _)| (node, a)).collect();
        let n_nodes = self.graph.n_nodes();
        let mut visited = vec![false; n_nodes * n_nodes];
        let step_at = |(to, from): (Node, Node)| self.graph.index(to) * n_nodes + self.graph.index(from);
        open.iter().for_each(|&step| visited[step_at(step)] = true);
        while let Some((w, v)) = open.pop() {
            found.push(w);
            let Some(from) = self.graph.get(v, w) else { continue };
            for (u, link) in self.graph.neighbours(w) {
                let step = (u, w);
                if [a, b, v].contains(&u) || visited[step_at(step)] {
                    continue;
                }
                let no_tail = link.right != LinkEnd::Tail && from.right != LinkEnd::Tail;
                let no_circle = link.right != LinkEnd::Circle && from.right != LinkEnd::Circle;
                let no_descendant = !self.is_ancestor(a, u) && !self.is_ancestor(b, u);
                let may_cause = !(self.is_no_ancestor(u, a) && self.is_no_ancestor(u, b));
                if no_tail && (self.graph.adjacent(u, v) || no_circle) && no_descendant && may_cause {
                    visited[step_at(step)] = true;
                    open.push(step);
                }
            }
        }
        found.retain(|node| *node != a && *node != b);
        unique(found)
    }
}

/// `nodes` and `others` together, sorted, without the ends of a pair.
pub(super) fn union(pair: Pair, nodes: &[Node], others: &[Node]) -> Vec<Node> {
    let mut all: Vec<Node> = nodes.iter().chain(others).copied().collect();
    all.retain(|node| *node != pair.x && *node != pair.y);
    unique(all)
}
