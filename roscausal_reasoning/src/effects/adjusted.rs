//! The effect of X on Y as a regression coefficient on an adjustment set, and as a sum over paths.

use roscausal_discovery::Node;

use super::mediation::Columns;
use crate::{
    graph::{Adjustment, Graph},
    linear::{Fit, least_squares},
    samples::Samples,
};

/// The regression of Y on X and an adjustment set.
#[derive(Clone, Debug)]
pub struct Adjusted {
    /// First row of each recording.
    pub first_sample: usize,
    /// Rows in all.
    pub n_samples: usize,
    /// Coefficient of each node of X.
    pub coefficients: Vec<f64>,
    /// Their standard errors.
    pub standard_errors: Vec<f64>,
    /// The whole fit: X first, then the set.
    pub fit: Fit,
    /// Means of the set's columns.
    pub means: Vec<f64>,
}

/// Regresses `y` on `x` and `set`, on the rows from `first` on in which nothing is missing and that are not masked.
pub fn adjusted(samples: &Samples, x: &[Node], y: Node, set: &[Node], first: usize) -> Adjusted {
    let nodes: Vec<Node> = x.iter().chain(set).copied().collect();
    let mut columns = vec![Vec::new(); nodes.len()];
    let mut target = Vec::new();
    for (recording, values) in samples.recordings().iter().enumerate() {
        for t in first..values.nrows() {
            let at = |node: Node| samples.at((recording, t), node);
            let counts = samples.is_effect((recording, t)) && at(y).is_finite();
            if counts && nodes.iter().all(|&node| at(node).is_finite()) {
                target.push(at(y));
                columns.iter_mut().zip(&nodes).for_each(|(column, &node)| column.push(at(node)));
            }
        }
    }
    let fit = least_squares(&target, &columns);
    let mean = |column: &Vec<f64>| column.iter().sum::<f64>() / column.len().max(1) as f64;
    Adjusted {
        first_sample: first,
        n_samples: target.len(),
        coefficients: fit.coefficients[..x.len()].to_vec(),
        standard_errors: fit.standard_errors[..x.len()].to_vec(),
        means: columns[x.len()..].iter().map(mean).collect(),
        fit,
    }
}

/// The effect of `x` on `y` as the sum over directed paths of products of coefficients (Wright 1921): each node on a path is
/// regressed on its parents on the same rows, those from `first` on.
pub fn wright(samples: &Samples, graph: &Graph, x: Node, y: Node, found: &Adjustment, first: usize) -> f64 {
    let mut on_paths: Vec<Node> = found.mediators.iter().copied().chain([y]).collect();
    // In time, and within a moment causes first.
    let place = |var: usize| graph.order().iter().position(|&v| v == var);
    on_paths.sort_by_key(|node| (std::cmp::Reverse(node.lag), place(node.var)));
    let parents = |node: Node| -> Vec<Node> {
        graph.parents(node.var).iter().map(|parent| parent.shifted(node.lag)).collect()
    };
    let mut nodes = on_paths.clone();
    nodes.extend(on_paths.iter().flat_map(|&node| parents(node)));
    nodes.sort_unstable();
    nodes.dedup();
    let columns = Columns::of(samples, nodes, first, &[]);
    let sums = columns.products.whole();
    let mut effects = vec![(x, 1.0)];
    for &node in &on_paths {
        let parents = parents(node);
        let positions: Vec<usize> = parents.iter().map(|&parent| columns.position(parent)).collect();
        let (coefficients, _) = sums.regress(columns.position(node), &positions);
        let of = |parent: &Node| {
            effects.iter().find(|(other, _)| other == parent).map_or(0.0, |(_, effect)| *effect)
        };
        let effect = parents.iter().zip(coefficients).map(|(parent, b)| b * of(parent)).sum();
        effects.push((node, effect));
    }
    effects.last().map_or(0.0, |(_, effect)| *effect)
}
