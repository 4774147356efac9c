//! The orientation phase of PCMCI+: colliders and Meek's rules on time series graphs.

use ndarray::Array3;

use crate::types::{LinkMark, Node};

/// An unshielded triple: `i` and `k` are adjacent, `k` and `j` are adjacent at lag 0, `i` and `j` are not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Triple {
    /// One end, at its lag.
    pub(crate) i: Node,
    /// The middle, at lag 0.
    pub(crate) k: usize,
    /// The other end, at lag 0.
    pub(crate) j: usize,
}

/// Unshielded triples in which the link `k`-`j` has no direction yet and the link `i`-`k` does not point away from
/// `k`. If neither link has a direction, the triple is listed once, at its first end: which collider comes first counts where no link
/// becomes a conflict.
pub(crate) fn unshielded_triples(graph: &Array3<LinkMark>) -> Vec<Triple> {
    let (n_vars, _, n_lags) = graph.dim();
    let mut triples = Vec::new();
    for j in 0..n_vars {
        for k in (0..n_vars).filter(|&k| graph[[k, j, 0]] == LinkMark::Unoriented) {
            for i in 0..n_vars {
                for lag in 0..n_lags {
                    let adjacent = match graph[[i, k, lag]] {
                        LinkMark::Forward => true,
                        LinkMark::Unoriented => i > j,
                        _ => false,
                    };
                    let distinct = lag > 0 || (i != j && i != k);
                    if adjacent && distinct && !graph[[i, j, lag]].is_link() {
                        triples.push(Triple { i: Node::new(i, lag), k, j });
                    }
                }
            }
        }
    }
    triples
}

/// Points both links of each collider to its middle. A link that colliders point both ways becomes a conflict, or
/// keeps its first direction.
pub(crate) fn orient_colliders(
    graph: &mut Array3<LinkMark>,
    colliders: &[Triple],
    conflict_resolution: bool,
) {
    for triple in colliders {
        if triple.i.lag == 0 {
            orient(graph, triple.i.var, triple.k, conflict_resolution);
        }
        orient(graph, triple.j, triple.k, conflict_resolution);
    }
}

fn orient(graph: &mut Array3<LinkMark>, from: usize, to: usize, conflict_resolution: bool) {
    let mark = match graph[[from, to, 0]] {
        LinkMark::Unoriented => LinkMark::Forward,
        LinkMark::Backward if conflict_resolution => LinkMark::Conflict,
        same => same,
    };
    graph[[from, to, 0]] = mark;
    graph[[to, from, 0]] = mark.mirrored();
}

/// Orients the links that follow from those already oriented (Meek 1995, rules 1 to 3, on time series graphs).
/// Ambiguous triples are left alone. A link that the rules orient both ways becomes a conflict.
pub(crate) fn orient_by_rules(graph: &mut Array3<LinkMark>, ambiguous: &[Triple], conflict_resolution: bool) {
    loop {
        let mut any = false;
        for rule in [away_from_collider, acyclic, two_ways] {
            let wanted = rule(graph, ambiguous);
            any |= !wanted.is_empty();
            wanted.into_iter().for_each(|(from, to)| orient(graph, from, to, conflict_resolution));
        }
        if !any {
            return;
        }
    }
}

fn is_ambiguous(ambiguous: &[Triple], i: Node, k: usize, j: usize) -> bool {
    let reversed = |t: &Triple| i.lag == 0 && t.i == Node::new(j, 0) && t.j == i.var && t.k == k;
    ambiguous.iter().any(|t| (t.i == i && t.k == k && t.j == j) || reversed(t))
}

/// Rule 1: if `i --> k o-o j` is unshielded, then `k --> j` (otherwise `k` would be a collider).
fn away_from_collider(graph: &Array3<LinkMark>, ambiguous: &[Triple]) -> Vec<(usize, usize)> {
    let points = |t: &Triple| graph[[t.i.var, t.k, t.i.lag]] == LinkMark::Forward;
    let mut triples = unshielded_triples(graph);
    triples.retain(|t| points(t) && !is_ambiguous(ambiguous, t.i, t.k, t.j));
    triples.iter().map(|t| (t.k, t.j)).collect()
}

/// Rule 2: if `i --> k --> j` and `i o-o j`, then `i --> j` (otherwise there would be a cycle).
fn acyclic(graph: &Array3<LinkMark>, _: &[Triple]) -> Vec<(usize, usize)> {
    let drives = |i: usize, j: usize| graph[[i, j, 0]] == LinkMark::Forward;
    let has_way = |&(i, j): &(usize, usize)| (0..graph.dim().0).any(|k| drives(i, k) && drives(k, j));
    unoriented(graph).filter(has_way).collect()
}

/// Rule 3: if `i o-o k --> j`, `i o-o l --> j`, `i o-o j`, and `k` and `l` are not adjacent, then `i --> j`.
fn two_ways(graph: &Array3<LinkMark>, ambiguous: &[Triple]) -> Vec<(usize, usize)> {
    unoriented(graph)
        .filter(|&(i, j)| {
            let between: Vec<usize> = (0..graph.dim().0)
                .filter(|&k| {
                    graph[[i, k, 0]] == LinkMark::Unoriented && graph[[k, j, 0]] == LinkMark::Forward
                })
                .collect();
            between.iter().any(|&k| {
                between.iter().any(|&l| {
                    k < l && !graph[[k, l, 0]].is_link() && !is_ambiguous(ambiguous, Node::new(k, 0), i, l)
                })
            })
        })
        .collect()
}

/// Ordered pairs without direction.
fn unoriented(graph: &Array3<LinkMark>) -> impl Iterator<Item = (usize, usize)> + '_ {
    let open = graph.indexed_iter().filter(|((.., lag), mark)| *lag == 0 && **mark == LinkMark::Unoriented);
    open.map(|((i, j, _), _)| (i, j))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn graph_of(n_vars: usize, links: &[(usize, usize, usize, LinkMark)]) -> Array3<LinkMark> {
        let mut graph = Array3::default((n_vars, n_vars, 2));
        for &(i, j, lag, mark) in links {
            graph[[i, j, lag]] = mark;
            if lag == 0 {
                graph[[j, i, 0]] = mark.mirrored();
            }
        }
        graph
    }

    #[test]
    fn a_lagged_cause_orients_what_follows_it() {
        let mut graph = graph_of(3, &[(0, 1, 1, LinkMark::Forward), (1, 2, 0, LinkMark::Unoriented)]);
        orient_by_rules(&mut graph, &[], true);
        assert_eq!(graph[[1, 2, 0]], LinkMark::Forward);
        assert_eq!(graph[[2, 1, 0]], LinkMark::Backward);
    }

    #[test]
    fn an_ambiguous_triple_orients_nothing() {
        let mut graph = graph_of(3, &[(0, 1, 1, LinkMark::Forward), (1, 2, 0, LinkMark::Unoriented)]);
        orient_by_rules(&mut graph, &[Triple { i: Node::new(0, 1), k: 1, j: 2 }], true);
        assert_eq!(graph[[1, 2, 0]], LinkMark::Unoriented);
    }

    #[test]
    fn cycles_are_avoided_and_two_ways_are_joined() {
        let f = LinkMark::Forward;
        let u = LinkMark::Unoriented;
        let mut graph = graph_of(3, &[(0, 1, 0, f), (1, 2, 0, f), (0, 2, 0, u)]);
        orient_by_rules(&mut graph, &[], true);
        assert_eq!(graph[[0, 2, 0]], f);
        let mut graph = graph_of(4, &[(0, 1, 0, u), (0, 2, 0, u), (0, 3, 0, u), (1, 3, 0, f), (2, 3, 0, f)]);
        orient_by_rules(&mut graph, &[], true);
        assert_eq!(graph[[0, 3, 0]], f);
    }

    #[test]
    fn a_collider_comes_in_the_order_of_its_first_end() {
        // 0 and 4 point to 2, or the past of 1 points to 2 and 2 to 4: the first end of the one is 0, of the other 4.
        let (u, f) = (LinkMark::Unoriented, LinkMark::Forward);
        let graph = graph_of(5, &[(0, 2, 0, u), (2, 4, 0, u), (2, 2, 1, f)]);
        let triples = unshielded_triples(&graph);
        let at = |i: Node, j: usize| triples.iter().position(|t| *t == Triple { i, k: 2, j });
        assert!(at(Node::new(4, 0), 0) < at(Node::new(2, 1), 4));
        assert_eq!(at(Node::new(0, 0), 4), None);
    }

    #[test]
    fn contradicting_colliders_are_a_conflict() {
        let u = LinkMark::Unoriented;
        let graph = graph_of(4, &[(0, 1, 0, u), (1, 2, 0, u), (2, 3, 0, u)]);
        let colliders =
            [Triple { i: Node::new(0, 0), k: 1, j: 2 }, Triple { i: Node::new(1, 0), k: 2, j: 3 }];
        let mut resolved = graph.clone();
        orient_colliders(&mut resolved, &colliders, true);
        assert_eq!(resolved[[1, 2, 0]], LinkMark::Conflict);
        let mut first = graph;
        orient_colliders(&mut first, &colliders, false);
        assert_eq!(first[[1, 2, 0]], LinkMark::Backward);
    }
}
