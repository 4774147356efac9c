//! Greedy selection of the sources of one target, with its hierarchy of tests.

use super::{
    estimator::Estimator,
    result::{Selected, TargetSelection},
};
use crate::types::{Control, Node, Result};

/// Selects the sources of one target: first from the target's own past, then other variables one at a time, then
/// pruning, then the final tests.
pub(super) struct Selection<'a> {
    pub(super) estimator: &'a dyn Estimator,
    pub(super) alpha: f64,
    pub(super) n_vars: usize,
    pub(super) lags: std::ops::RangeInclusive<usize>,
    /// Most variables that may be selected for a target: more would leave no degrees of freedom to estimate.
    pub(super) limit: usize,
    pub(super) control: &'a Control,
}

impl Selection<'_> {
    pub(super) fn run(&self, target: usize) -> Result<TargetSelection> {
        let present = Node::new(target, 0);
        let lagged = |var: usize| self.lags.clone().map(move |lag| Node::new(var, lag));

        let own = self.greedy(present, lagged(target).collect(), &[])?;
        let autodependency = self.autodependency(present, &own);
        // Transfer entropy is conditioned on the target's past even if that past is not informative.
        let past = if own.is_empty() { vec![Node::new(target, *self.lags.start())] } else { own };

        let others = (0..self.n_vars).filter(|&var| var != target).flat_map(lagged).collect();
        let mut sources = self.greedy(present, others, &past)?;
        self.prune(present, &past, &mut sources)?;
        self.control.check()?;
        let (sources, transfer_entropy, p_value) = self.final_tests(present, &past, sources);
        Ok(TargetSelection { target, autodependency, sources, beyond: Vec::new(), transfer_entropy, p_value })
    }

    /// Adds the candidate with the largest information given all selected ones, as long as the maximum statistic
    /// over the remaining candidates is significant.
    fn greedy(&self, target: Node, mut candidates: Vec<Node>, given: &[Node]) -> Result<Vec<Node>> {
        let mut z = given.to_vec();
        while !candidates.is_empty() && z.len() < self.limit {
            self.control.check()?;
            let values = self.estimator.cmi_of_each(target, &candidates, &z);
            let Some((best, value)) = first_max(&values) else { break };
            if value <= 0.0 || self.estimator.p_max(value, target, &candidates, &z) >= self.alpha {
                break;
            }
            z.push(candidates.remove(best));
        }
        Ok(z.split_off(given.len()))
    }

    /// Information of each selected past value given the others; the p-value is that of the whole past.
    fn autodependency(&self, target: Node, own: &[Node]) -> Vec<Selected> {
        if own.is_empty() {
            return Vec::new();
        }
        let p_value = self.estimator.p_joint(self.estimator.cmi(target, own, &[]), target, own, &[]);
        let one = |&node: &Node| {
            let value = self.estimator.cmi(target, &[node], &without(own, node));
            Selected { source: node, value, p_value }
        };
        own.iter().map(one).collect()
    }

    /// Removes the source with the least information given all others, as long as the minimum statistic is not
    /// significant.
    fn prune(&self, target: Node, past: &[Node], sources: &mut Vec<Node>) -> Result<()> {
        while !sources.is_empty() {
            self.control.check()?;
            let values = self.given_the_others(target, past, sources);
            let Some((worst, value)) = first_max(&values.iter().map(|v| -v).collect::<Vec<_>>()) else {
                break;
            };
            if self.estimator.p_min(-value, target, sources, past) < self.alpha {
                break;
            }
            sources.remove(worst);
        }
        Ok(())
    }

    /// The omnibus test of all sources together, then the sequential maximum statistic of each.
    fn final_tests(&self, target: Node, past: &[Node], sources: Vec<Node>) -> (Vec<Selected>, f64, f64) {
        if sources.is_empty() {
            return (Vec::new(), 0.0, 1.0);
        }
        let transfer_entropy = self.estimator.cmi(target, &sources, past);
        let p_value = self.estimator.p_joint(transfer_entropy, target, &sources, past);
        if p_value >= self.alpha {
            return (Vec::new(), transfer_entropy, p_value);
        }
        let values = self.given_the_others(target, past, &sources);
        let mut order: Vec<usize> = (0..sources.len()).collect();
        order.sort_by(|&a, &b| values[b].total_cmp(&values[a]));
        let falling: Vec<f64> = order.iter().map(|&i| values[i]).collect();
        let p = self.estimator.p_sequential(&falling, target, &sources, past);
        // Once a source is not significant, all weaker ones are dropped with it.
        let mut p_of = vec![None; sources.len()];
        for (&i, p) in order.iter().zip(p).take_while(|(_, p)| *p < self.alpha) {
            p_of[i] = Some(p);
        }
        let kept = (0..sources.len())
            .filter_map(|i| p_of[i].map(|p_value| Selected { source: sources[i], value: values[i], p_value }))
            .collect();
        (kept, transfer_entropy, p_value)
    }

    fn given_the_others(&self, target: Node, past: &[Node], sources: &[Node]) -> Vec<f64> {
        let one = |&source: &Node| {
            let z: Vec<Node> = past.iter().copied().chain(without(sources, source)).collect();
            self.estimator.cmi(target, &[source], &z)
        };
        sources.iter().map(one).collect()
    }
}

/// `nodes` without `node`, in their order.
pub(super) fn without(nodes: &[Node], node: Node) -> Vec<Node> {
    nodes.iter().copied().filter(|&other| other != node).collect()
}

/// Position and value of the largest value; the first of equals.
fn first_max(values: &[f64]) -> Option<(usize, f64)> {
    let mut best: Option<(usize, f64)> = None;
    for (i, &value) in values.iter().enumerate() {
        if best.is_none_or(|(_, most)| value > most) {
            best = Some((i, value));
        }
    }
    best
}
