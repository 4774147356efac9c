//! From a graph with undirected links to one DAG, as PCMCI+ needs it for its model-selection score.

use ndarray::{Array3, Axis};

use crate::types::{LinkMark, Node};

/// Parents of each variable in one DAG of the equivalence class that a graph stands for (Dor and Tarsi 1992). Of several
/// possible sinks the one with the largest values is taken first, so the order of the columns does not matter. Links of
/// contradictory direction are left out. If no DAG fits, the remaining links follow the order of the values.
pub(crate) fn dag_parents(graph: &Array3<LinkMark>, values: &Array3<f64>) -> Vec<Vec<Node>> {
    let (n_vars, _, n_lags) = graph.dim();
    let sum_into: Vec<f64> =
        (0..n_vars).map(|j| values.index_axis(Axis(1), j).iter().map(|value| value.abs()).sum()).collect();
    let mut parents: Vec<Vec<Node>> = (0..n_vars)
        .map(|j| {
            let lagged = (0..n_vars).flat_map(|i| (1..n_lags).map(move |lag| Node::new(i, lag)));
            lagged.filter(|node| graph[[node.var, j, node.lag]].is_link()).collect()
        })
        .collect();
    let open = |i: usize, j: usize| graph[[i, j, 0]] == LinkMark::Unoriented;
    let adjacent = |i: usize, j: usize| graph[[i, j, 0]].is_link() && graph[[i, j, 0]] != LinkMark::Conflict;
    let mut left: Vec<usize> = (0..n_vars).rev().collect();
    left.sort_by(|&a, &b| sum_into[b].total_cmp(&sum_into[a]));
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

    /// The parents at lag 0 in one DAG of a graph of undirected `links`, where each variable has the sum of values of `strength`.
    fn extended(links: &[(usize, usize)], strength: [f64; 3]) -> Vec<Vec<Node>> {
        let mut graph = Array3::default((3, 3, 2));
        for &(i, j) in links {
            graph[[i, j, 0]] = LinkMark::Unoriented;
            graph[[j, i, 0]] = LinkMark::Unoriented;
        }
        graph[[2, 2, 1]] = LinkMark::Forward;
        dag_parents(&graph, &Array3::from_shape_fn((3, 3, 2), |(_, j, _)| strength[j] / 6.0))
    }

    #[test]
    fn an_extension_makes_no_new_collider_and_keeps_every_link() {
        // 0 o-o 1 o-o 2: any direction but 0 -> 1 <- 2.
        for strength in [[3.0, 2.0, 1.0], [1.0, 3.0, 2.0], [1.0, 2.0, 3.0]] {
            let parents = extended(&[(0, 1), (1, 2)], strength);
            assert!(parents[1].len() < 2);
            assert_eq!(parents.iter().flatten().filter(|node| node.lag == 0).count(), 2);
            assert!(parents[2].contains(&Node::new(2, 1)));
        }
    }

    #[test]
    fn open_links_point_to_the_variable_with_the_larger_values() {
        let to = |node: usize| vec![Node::new(node, 0)];
        assert_eq!(extended(&[(0, 1)], [2.0, 1.0, 0.0])[0], to(1));
        assert_eq!(extended(&[(0, 1)], [1.0, 2.0, 0.0])[1], to(0));
    }

    #[test]
    fn contradictory_links_are_left_out() {
        let mut graph = Array3::default((2, 2, 1));
        graph[[0, 1, 0]] = LinkMark::Conflict;
        graph[[1, 0, 0]] = LinkMark::Conflict;
        assert_eq!(dag_parents(&graph, &Array3::zeros((2, 2, 1))), [vec![], vec![]]);
    }
}
