//! Which action is best: costs, limits, ranking.

use super::ensembles::Outcomes;

/// What one action costs, and whether it keeps the limits.
#[derive(Clone, Debug, Default)]
pub(super) struct Price {
    /// Cost of each path.
    pub(super) costs: Vec<f64>,
    /// For each limit the part of the paths that keep it at every step.
    pub(super) kept: Vec<f64>,
    /// Part of the paths that keep all limits.
    pub(super) all_kept: f64,
}

/// The price of an action by all its paths.
pub(super) fn price(outcomes: &Outcomes, cost: &[(usize, f64)], limits: &[(usize, f64, f64, f64)]) -> Price {
    let mut price = Price { kept: vec![0.0; limits.len()], ..Price::default() };
    for outcome in &outcomes.all {
        let paths = &outcome.paths;
        for path in 0..paths.paths {
            let mean = |var: usize| {
                (0..paths.steps).map(|step| paths.at(path, step, var)).sum::<f64>() / paths.steps as f64
            };
            price.costs.push(cost.iter().map(|&(var, weight)| weight * mean(var)).sum());
            let mut all = true;
            for (kept, &(var, above, below, _)) in price.kept.iter_mut().zip(limits) {
                let inside =
                    (0..paths.steps).map(|step| paths.at(path, step, var)).all(|v| v > above && v < below);
                *kept += f64::from(u8::from(inside));
                all &= inside;
            }
            price.all_kept += f64::from(u8::from(all));
        }
    }
    let count = price.costs.len().max(1) as f64;
    price.kept.iter_mut().for_each(|kept| *kept /= count);
    price.all_kept /= count;
    price
}

impl Price {
    /// Mean cost.
    pub(super) fn mean(&self) -> f64 {
        self.costs.iter().sum::<f64>() / self.costs.len().max(1) as f64
    }
}

/// The eligible actions by mean cost, and for each action the part of the paths in which it is the cheapest of these.
pub(super) fn rank(prices: &[Price], eligible: &[usize]) -> (Vec<usize>, Vec<f64>) {
    let mut ranking = eligible.to_vec();
    ranking.sort_by(|&a, &b| prices[a].mean().total_cmp(&prices[b].mean()));
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
}
