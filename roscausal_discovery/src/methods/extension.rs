//! From a graph with undirected links to one DAG, as PCMCI+ needs it for its model-selection score.

use ndarray::Array3;

use crate::ground::{LinkMark, Node};

/// Parents of each variable in one DAG of the equivalence class that a graph stands for (Dor and Tarsi 1992). Links
/// of contradictory direction count as undirected. If no DAG fits, the remaining links follow the order of the
/// variables.
pub(crate) fn dag_parents(graph: &Array3<LinkMark>) -> Vec<Vec<Node>> {
    let (n_vars, _, n_lags) = graph.dim();
    let mut parents: Vec<Vec<Node>> = (0..n_vars)
        .map(|j| {
            let lagged = (0..n_vars).flat_map(|i| (1..n_lags).map(move |lag| Node::new(i, lag)));
            lagged.filter(|node| graph[[node.var, j, node.lag]].is_link()).collect()
        })
        .collect();
    let open = |i: usize, j: usize| matches!(graph[[i, j, 0]], LinkMark::Unoriented | LinkMark::Conflict);
    let adjacent = |i: usize, j: usize| graph[[i, j, 0]].is_link();
    let mut left: Vec<usize> = (0..n_vars).collect();
    while !left.is_empty() {
        // A sink: no link leaves it, and each of its undirected neighbours is adjacent to all its other neighbours.
        let is_sink = |&x: &usize| {
            let others = || left.iter().copied().filter(move |&y| y != x);
            let leaves = others().any(|y| graph[[x, y, 0]] == LinkMark::Forward);
            let fits = others()
                .filter(|&y| open(x, y))
                .all(|y| others().filter(|&v| v != y && adjacent(x, v)).all(|v| adjacent(y, v)));
            !leaves && fits
        };
        let sink = left.iter().copied().find(is_sink);
        let no_exit = || {
            left.iter().copied().rev().find(|&x| !left.iter().any(|&y| graph[[x, y, 0]] == LinkMark::Forward))
        };
        let Some(sink) = sink.or_else(no_exit).or(left.last().copied()) else { break };
        left.retain(|&x| x != sink);
        parents[sink].extend(left.iter().filter(|&&i| adjacent(i, sink)).map(|&i| Node::new(i, 0)));
    }
    parents
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_extension_makes_no_new_collider_and_keeps_every_link() {
        // 0 o-o 1 o-o 2: any direction but 0 -> 1 <- 2.
        let mut graph = Array3::default((3, 3, 2));
        for (i, j) in [(0, 1), (1, 2)] {
            graph[[i, j, 0]] = LinkMark::Unoriented;
            graph[[j, i, 0]] = LinkMark::Unoriented;
        }
        graph[[2, 2, 1]] = LinkMark::Forward;
        let parents = dag_parents(&graph);
        assert!(parents[1].len() < 2);
        assert_eq!(parents.iter().flatten().filter(|node| node.lag == 0).count(), 2);
        assert!(parents[2].contains(&Node::new(2, 1)));
    }
}
