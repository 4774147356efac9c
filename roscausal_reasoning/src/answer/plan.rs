//! Which action is best: costs, limits, and which actions are ranked at all.
//!
//! A robot acts on a ranking. So it holds only actions that the data carry: every value was recorded, at least half of the steps are
//! supported, all limits are kept, and the action moves a part of the cost. Costs are compared over the steps that the data carry for
//! all of them; limits count at every step, also where the forecast is a guess.

use super::{
    ensembles::{Outcome, Outcomes},
    sentences::{no_effect, short, steps},
};
use crate::{
    model::{Schedule, StructuralModel},
    question::Asked,
};

/// Part of the steps that the data must carry.
const CARRIED: f64 = 0.5;

/// What one action costs, and whether it keeps the limits.
#[derive(Clone, Debug, Default)]
pub(super) struct Price {
    /// Cost of each path.
    pub(super) costs: Vec<f64>,
    /// Part of the paths that keep all limits.
    pub(super) all_kept: f64,
    /// Whether each limit is kept as often as it is to be.
    keeps: bool,
}

impl Price {
    /// Without the costs: the limits, at all steps.
    fn of_limits(outcomes: &Outcomes, asked: &Asked) -> Self {
        let mut kept = vec![0_usize; asked.limits.len()];
        let (mut all_kept, mut paths) = (0_usize, 0_usize);
        for Outcome { paths: ensemble, .. } in &outcomes.all {
            for path in 0..ensemble.paths {
                let mut all = true;
                for (kept, &(var, above, below, _)) in kept.iter_mut().zip(&asked.limits) {
                    let mut values = (0..ensemble.steps).map(|step| ensemble.at(path, step, var));
                    let inside = values.all(|v| v > above && v < below);
                    *kept += usize::from(inside);
                    all &= inside;
                }
                all_kept += usize::from(all);
                paths += 1;
            }
        }
        let share = |count: usize| count as f64 / paths.max(1) as f64;
        let keeps = asked.limits.iter().zip(&kept).all(|((.., p), &kept)| share(kept) >= *p);
        Self { costs: Vec::new(), all_kept: share(all_kept), keeps }
    }

    /// With the cost of each path over the first steps.
    fn with_costs(self, outcomes: &Outcomes, asked: &Asked, steps: usize) -> Self {
        let of = |Outcome { paths, .. }: &Outcome| {
            let mean = |path: usize, var: usize| {
                (0..steps).map(|step| paths.at(path, step, var)).sum::<f64>() / steps.max(1) as f64
            };
            let cost = |path| asked.cost.iter().map(|&(var, weight)| weight * mean(path, var)).sum();
            (0..paths.paths).map(cost).collect::<Vec<f64>>()
        };
        Self { costs: outcomes.all.iter().flat_map(of).collect(), ..self }
    }

    /// Mean cost.
    pub(super) fn mean(&self) -> f64 {
        self.costs.iter().sum::<f64>() / self.costs.len().max(1) as f64
    }
}

/// The actions that can be taken, and why the others cannot.
pub(super) struct Plan {
    /// By action.
    pub(super) prices: Vec<Price>,
    /// Numbers of the actions, best first.
    pub(super) ranking: Vec<usize>,
    /// By action: the part of the paths in which it is the cheapest of those that are ranked.
    pub(super) best: Vec<f64>,
    /// By action: why it is not ranked.
    pub(super) left_out: Vec<Option<String>>,
    /// Steps over which costs are compared.
    pub(super) steps: usize,
}

impl Plan {
    /// Prices and ranks the actions. With neither cost nor limits nothing is ranked.
    pub(super) fn of(model: &StructuralModel, asked: &Asked, all: &[Outcomes], horizon: usize) -> Self {
        let limits: Vec<Price> = all.iter().map(|one| Price::of_limits(one, asked)).collect();
        let reason = |(one, price): (&Outcomes, &Price)| {
            let kept = || {
                format!("it does not keep the limits (probability of keeping all: {})", short(price.all_kept))
            };
            let few = || {
                let few = (one.supported as f64) < CARRIED * horizon as f64;
                few.then(|| format!("the data carry only {} of {}", one.supported, steps(model, horizon)))
            };
            let limits = || (!price.keeps).then(kept);
            one.refused.clone().or_else(|| one.unseen.clone()).or_else(limits).or_else(few)
        };
        let mut left_out: Vec<Option<String>> = all.iter().zip(&limits).map(reason).collect();
        let carried = all.iter().zip(&left_out).filter(|(_, reason)| reason.is_none());
        let within = carried.map(|(one, _)| one.supported).min().unwrap_or(horizon);
        let targets = asked.targets();
        let idle = |(_, schedule): &(String, Schedule)| {
            let moved = moved(model, schedule, within);
            (!schedule.is_free() && !targets.iter().any(|&var| moved[var]))
                .then(|| no_effect(model, &schedule.acting(), &targets, within))
        };
        let idle: Vec<Option<String>> = asked.actions.iter().map(idle).collect();
        for (reason, idle) in left_out.iter_mut().zip(&idle) {
            *reason = reason.take().or_else(|| idle.clone());
        }
        // Where nothing that can be done makes a difference, going on is no choice either.
        let open = |k: &usize| all[*k].refused.is_none() && !asked.actions[*k].1.is_free();
        let mut open = (0..all.len()).filter(open).peekable();
        let nothing = targets.is_empty() || (open.peek().is_some() && open.all(|k| idle[k].is_some()));
        let ranked = |k: &usize| !nothing && left_out[*k].is_none();
        let priced = |(price, one): (Price, &Outcomes)| price.with_costs(one, asked, within);
        let prices: Vec<Price> = limits.into_iter().zip(all).map(priced).collect();
        let (ranking, best) = rank(&prices, &(0..all.len()).filter(ranked).collect::<Vec<_>>());
        Self { prices, ranking, best, left_out, steps: within }
    }

    /// Why nothing is ranked, for those of the actions that are answered.
    pub(super) fn why_empty(&self, asked: &Asked, answered: &[usize]) -> String {
        if answered.iter().all(|&k| !self.prices[k].keeps) {
            return "no action keeps the limits".to_owned();
        }
        let reason = |&k: &usize| Some(format!("'{}': {}", asked.actions[k].0, self.left_out[k].as_ref()?));
        let reasons: Vec<String> = answered.iter().filter_map(reason).collect();
        format!("no action is ranked; {}", reasons.join("; "))
    }
}

/// By variable: whether an action moves it within so many steps, in a graph that the model may stand for.
pub(super) fn moved(model: &StructuralModel, schedule: &Schedule, within: usize) -> Vec<bool> {
    let n = model.graph().len();
    let mut ever = vec![false; n];
    for member in model.members() {
        let graph = &member.model.graph;
        let mut moved = vec![false; n * within];
        for step in 0..within {
            for &var in graph.order() {
                let by = |parent: &roscausal_discovery::Node| {
                    step.checked_sub(parent.lag).is_some_and(|at| moved[at * n + parent.var])
                };
                let driven = || !schedule.is_set(step, var) && graph.parents(var).iter().any(by);
                let is = schedule.touches(step, var) || driven();
                moved[step * n + var] = is;
                ever[var] |= is;
            }
        }
    }
    ever
}

/// The eligible actions by mean cost, where that is equal by the probability of keeping all limits; and for each action the part of
/// the paths in which it is the cheapest of these.
fn rank(prices: &[Price], eligible: &[usize]) -> (Vec<usize>, Vec<f64>) {
    let mut ranking = eligible.to_vec();
    ranking.sort_by(|&a, &b| {
        let kept = || prices[b].all_kept.total_cmp(&prices[a].all_kept);
        prices[a].mean().total_cmp(&prices[b].mean()).then_with(kept)
    });
    let mut best = vec![0.0; prices.len()];
    let count = eligible.first().map_or(0, |&k| prices[k].costs.len());
    for path in 0..count {
        let lowest = eligible.iter().map(|&k| prices[k].costs[path]).fold(f64::INFINITY, f64::min);
        let cheapest: Vec<usize> =
            eligible.iter().copied().filter(|&k| prices[k].costs[path] <= lowest).collect();
        cheapest.iter().for_each(|&k| best[k] += 1.0 / (cheapest.len() * count) as f64);
    }
    (ranking, best)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cheapest_comes_first_and_shares_of_being_best_sum_to_one() {
        let price = |costs: &[f64]| Price { costs: costs.to_vec(), ..Price::default() };
        let prices = [price(&[3.0, 3.0, 3.0, 3.0]), price(&[1.0, 1.0, 9.0, 1.0]), price(&[0.0; 4])];
        let (ranking, best) = rank(&prices, &[0, 1]);
        assert_eq!((ranking, best), (vec![0, 1], vec![0.25, 0.75, 0.0]));
        assert_eq!(rank(&prices, &[]).0, Vec::<usize>::new());
    }

    #[test]
    fn without_a_cost_the_surest_to_keep_the_limits_comes_first() {
        let price = |all_kept: f64| Price { costs: vec![0.0; 4], all_kept, keeps: true };
        assert_eq!(rank(&[price(0.9), price(1.0), price(0.95)], &[0, 1, 2]).0, [1, 2, 0]);
    }
}
