//! Pairs without a direction: every graph that they may stand for.
//!
//! PCMCI+ leaves a pair at lag 0 open where the data speak for neither direction (`o-o`) or for both (`x-x`). Its own rule for what
//! it leaves: an `o-o` pair makes no unshielded collider that it did not find (Runge 2020). So of all orientations without a circle
//! those remain in which no `o-o` pair makes a new one; where none remains, all without a circle.

use roscausal_discovery::{Error, Node, Result};

use super::{Arrow, Graph};

/// Pairs without a direction that are still tried in both directions, each with each.
pub const MOST_PAIRS: usize = 6;

/// One of the graphs that a graph with open pairs may stand for.
#[derive(Clone, Debug, PartialEq)]
pub struct Orientation {
    /// The graph, every link directed.
    pub graph: Graph,
    /// For each open pair its cause and its effect.
    pub turned: Vec<(usize, usize)>,
    /// Whether this has a collider that the method did not find, because each orientation has one.
    pub against_the_rule: bool,
}

impl Graph {
    /// All directed graphs that this one may stand for; itself if no pair is open.
    ///
    /// # Errors
    /// More than [`MOST_PAIRS`] open pairs; a circle in every orientation.
    pub fn orientations(&self) -> Result<Vec<Orientation>> {
        let pairs = &self.pairs;
        if pairs.len() > MOST_PAIRS {
            let listed: Vec<String> =
                pairs.iter().map(|pair| format!("{} - {}", self.names[pair.a], self.names[pair.b])).collect();
            let (n, listed) = (pairs.len(), listed.join(", "));
            return Err(Error::Data(format!(
                "{n} pairs of variables have no direction and at most {MOST_PAIRS} can be tried both ways: {listed}; direct \
                 some of them in the model, or sample faster so that effects come after their causes"
            )));
        }
        let arrows: Vec<Arrow> = self.arrows().collect();
        let mut all = Vec::new();
        for choice in 0..1_usize << pairs.len() {
            let turn = |(k, pair): (usize, &super::Pair)| {
                if choice >> (pairs.len() - 1 - k) & 1 == 0 { (pair.a, pair.b) } else { (pair.b, pair.a) }
            };
            let turned: Vec<(usize, usize)> = pairs.iter().enumerate().map(turn).collect();
            let mut with = arrows.clone();
            with.extend(turned.iter().map(|&(cause, effect)| Arrow { cause, effect, lag: 0 }));
            if let Ok(graph) = Graph::new(self.names.clone(), self.largest_lag, &with, &[]) {
                let against_the_rule = turned.iter().zip(pairs).any(|(&(cause, effect), pair)| {
                    !pair.conflict && graph.has_unshielded_collider(cause, effect)
                });
                all.push(Orientation { graph, turned, against_the_rule });
            }
        }
        if all.iter().any(|one| !one.against_the_rule) {
            all.retain(|one| !one.against_the_rule);
        }
        let reason = "the pairs without a direction make a circle however they are directed";
        Error::ensure_data(!all.is_empty(), || reason)?;
        Ok(all)
    }

    /// Whether `cause -> effect` at lag 0 meets another parent of `effect` to which `cause` is not adjacent.
    fn has_unshielded_collider(&self, cause: usize, effect: usize) -> bool {
        let cause = Node::new(cause, 0);
        self.parents[effect].iter().any(|&other| other != cause && !self.adjacent(cause, other))
    }

    /// Whether a node at lag 0 and another at lag 0 or before are linked.
    fn adjacent(&self, now: Node, other: Node) -> bool {
        self.parents[now.var].contains(&other) || (other.lag == 0 && self.parents[other.var].contains(&now))
    }
}

#[cfg(test)]
mod tests {
    use super::{super::Pair, *};

    fn graph(n: usize, arrows: &[(usize, usize, usize)], pairs: &[(usize, usize)]) -> Graph {
        let arrows: Vec<Arrow> =
            arrows.iter().map(|&(cause, effect, lag)| Arrow { cause, effect, lag }).collect();
        let pairs: Vec<Pair> = pairs.iter().map(|&(a, b)| Pair { a, b, conflict: false }).collect();
        Graph::new((0..n).map(|k| format!("x{k}")).collect(), 1, &arrows, &pairs).unwrap()
    }

    fn turned(graph: &Graph) -> Vec<Vec<(usize, usize)>> {
        graph.orientations().unwrap().into_iter().map(|one| one.turned).collect()
    }

    #[test]
    fn a_chain_may_be_anything_but_a_collider() {
        let members = turned(&graph(3, &[], &[(0, 1), (1, 2)]));
        assert_eq!(members, [vec![(0, 1), (1, 2)], vec![(1, 0), (1, 2)], vec![(1, 0), (2, 1)]]);
    }

    #[test]
    fn a_triangle_has_no_circle_among_its_six_orientations() {
        assert_eq!(turned(&graph(3, &[], &[(0, 1), (1, 2), (0, 2)])).len(), 6);
    }

    #[test]
    fn a_lagged_parent_makes_a_collider_unless_it_drives_both() {
        assert_eq!(turned(&graph(3, &[(2, 1, 1)], &[(0, 1)])), [vec![(1, 0)]]);
        assert_eq!(turned(&graph(3, &[(2, 1, 1), (2, 0, 1)], &[(0, 1)])).len(), 2);
    }

    #[test]
    fn without_a_rule_that_can_be_kept_all_orientations_stand_and_say_so() {
        let all = graph(3, &[(0, 0, 1), (1, 1, 1)], &[(0, 1)]).orientations().unwrap();
        assert!(all.len() == 2 && all.iter().all(|one| one.against_the_rule));
    }

    #[test]
    fn seven_open_pairs_are_refused_by_name() {
        let pairs: Vec<(usize, usize)> = (0..7).map(|k| (k, k + 1)).collect();
        let message = graph(8, &[], &pairs).orientations().unwrap_err().to_string();
        assert!(message.contains("7 pairs") && message.contains("x0 - x1"), "{message}");
    }
}
