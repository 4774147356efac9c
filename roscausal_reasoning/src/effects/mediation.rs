//! How strongly variables drive, are driven and pass on, in a linear model of the graph (Runge et al. 2015).

use ndarray::Array2;
use roscausal_discovery::{Error, Node, Result};

use super::products::{Products, Sums};
use crate::{graph::Graph, linear::LinearSystem, random, samples::Samples};

/// Total and mediated effects at lags 0 to a horizon.
#[derive(Clone, Debug)]
pub struct Mediation {
    /// The linear equations.
    pub system: LinearSystem,
    /// `[lag]` of `[effect, cause]`.
    pub total: Vec<Array2<f64>>,
    /// `[mediator][lag]` of `[effect, cause]`.
    pub mediated: Vec<Vec<Array2<f64>>>,
}

/// The columns of a graph's regressions: every variable at every lag that is a target or a parent.
pub(crate) struct Columns {
    pub(crate) products: Products,
    nodes: Vec<Node>,
    /// Rows of each recording.
    pub(crate) stretches: Vec<usize>,
}

impl Columns {
    /// Those of the equations of `variables`, from row `first` of each recording on, without rows in which one of their values is
    /// missing.
    fn new(samples: &Samples, graph: &Graph, variables: &[usize], first: usize) -> Self {
        let mut nodes: Vec<Node> = variables.iter().map(|&var| Node::new(var, 0)).collect();
        nodes.extend(variables.iter().flat_map(|&var| graph.parents(var)));
        nodes.sort_unstable();
        nodes.dedup();
        Self::of(samples, nodes, first, &[])
    }

    /// Of these nodes, which are sorted, without the rows in which an experiment imposed a node of `cut`.
    pub(crate) fn of(samples: &Samples, nodes: Vec<Node>, first: usize, cut: &[Node]) -> Self {
        let first = nodes.iter().chain(cut).map(|node| node.lag).max().unwrap_or(0).max(first);
        let mut columns = vec![Vec::new(); nodes.len()];
        let mut stretches = Vec::new();
        for (recording, values) in samples.recordings().iter().enumerate() {
            let mut rows = 0;
            for t in first..values.nrows() {
                let at = |&node: &Node| samples.at((recording, t), node);
                let is_cut = cut.iter().any(|&node| samples.was_imposed((recording, t), node));
                let counts = samples.is_effect((recording, t)) && !is_cut;
                if counts && nodes.iter().all(|node| at(node).is_finite()) {
                    columns.iter_mut().zip(&nodes).for_each(|(column, node)| column.push(at(node)));
                    rows += 1;
                }
            }
            stretches.push(rows);
        }
        Self { products: Products::new(columns), nodes, stretches }
    }

    pub(crate) fn position(&self, node: Node) -> usize {
        // Every node that is asked for is one of them.
        self.nodes.binary_search(&node).unwrap_or(0)
    }

    /// The linear equations of `variables` by some sums; in units of standard deviations if asked for. Other variables have no parents.
    pub(super) fn system(
        &self,
        graph: &Graph,
        variables: &[usize],
        sums: &Sums,
        standardise: bool,
    ) -> LinearSystem {
        let n = graph.len();
        let mut coefficients = vec![Array2::zeros((n, n)); graph.largest_lag() + 1];
        let mut intercepts = vec![0.0; n];
        let means = &self.products.means;
        for &var in variables {
            let (target, parents) = (self.position(Node::new(var, 0)), graph.parents(var));
            let columns: Vec<usize> = parents.iter().map(|&parent| self.position(parent)).collect();
            let (found, _) = sums.regress(target, &columns);
            intercepts[var] = means[target];
            for ((parent, &column), b) in parents.iter().zip(&columns).zip(found) {
                let deviation = sums.deviation(target);
                let unit =
                    if standardise && deviation > 0.0 { sums.deviation(column) / deviation } else { 1.0 };
                coefficients[parent.lag][[var, parent.var]] = b * unit;
                intercepts[var] -= b * means[column];
            }
        }
        if standardise {
            intercepts.fill(0.0);
        }
        LinearSystem { coefficients, intercepts, order: graph.order().to_vec() }
    }
}

impl Mediation {
    /// Fits the linear equations of a graph on the rows from `horizon` on, and follows all effects up to `horizon`.
    ///
    /// # Errors
    /// Fewer rows than coefficients; pairs without a direction.
    pub fn fit(samples: &Samples, graph: &Graph, horizon: usize, standardise: bool) -> Result<Self> {
        let all: Vec<usize> = (0..graph.len()).collect();
        let columns = columns_for(samples, graph, &all, horizon)?;
        Ok(Self::of(columns.system(graph, &all, &columns.products.whole(), standardise), horizon))
    }

    /// The same on `count` moving-block bootstraps of the rows.
    ///
    /// # Errors
    /// Those of [`Mediation::fit`].
    pub fn bootstrap(
        samples: &Samples,
        graph: &Graph,
        horizon: usize,
        standardise: bool,
        count: usize,
        seed: u64,
    ) -> Result<Vec<Self>> {
        let all: Vec<usize> = (0..graph.len()).collect();
        let columns = columns_for(samples, graph, &all, horizon)?;
        let prefix = columns.products.prefix();
        let one = |k: usize| {
            let sums = prefix.resampled(random::at(seed, k, 1), &columns.stretches);
            Self::of(columns.system(graph, &all, &sums, standardise), horizon)
        };
        Ok((0..count).map(one).collect())
    }

    /// The effects of known equations.
    pub fn of(system: LinearSystem, horizon: usize) -> Self {
        let total = system.effects(horizon);
        let through = |k: usize| {
            let around = system.effects_around(k, horizon);
            total.iter().zip(&around).map(|(all, around)| all - around).collect()
        };
        let mediated = (0..system.len()).map(through).collect();
        Self { system, total, mediated }
    }
}

/// The columns of the equations of `variables`, which may be none.
pub(super) fn columns_for(
    samples: &Samples,
    graph: &Graph,
    variables: &[usize],
    horizon: usize,
) -> Result<Columns> {
    let reason = "the graph has pairs without a direction; take one of its orientations";
    Error::ensure_data(graph.pairs().is_empty(), || reason)?;
    let columns = Columns::new(samples, graph, variables, horizon);
    let most = variables.iter().map(|&var| graph.parents(var).len()).max().unwrap_or(0);
    let rows = columns.products.n;
    Error::ensure_data(variables.is_empty() || rows >= most + 2, || {
        format!("{rows} complete rows are too few for equations of {most} parents; record longer")
    })?;
    Ok(columns)
}
