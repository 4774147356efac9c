//! One effect by the paths of a graph: only the equations of what lies between cause and effect are fitted.
//!
//! Of `z -> x -> m -> y` and `y -> w`, the effect of x on y needs the equations of x, m and y, and so the values of z. Whether w is
//! missing decides on no row.

use roscausal_discovery::Result;

use super::mediation::columns_for;
use crate::{graph::Graph, linear::LinearSystem, random, samples::Samples};

/// What the paths say of the effect of one variable on another.
pub(crate) struct Paths {
    cause: usize,
    effect: usize,
    /// The variables on the paths, cause and effect with them; none without a path.
    between: Vec<usize>,
    /// The equations of these.
    system: LinearSystem,
    /// Total effect by lag.
    pub(crate) total: Vec<f64>,
    /// The same on bootstraps of the rows, `[bootstrap][lag]`.
    pub(crate) drawn: Vec<Vec<f64>>,
}

impl Paths {
    /// Follows the effect up to lag `horizon`, on all rows and on `count` moving-block bootstraps of them.
    ///
    /// # Errors
    /// Fewer rows than coefficients; pairs without a direction.
    pub(crate) fn fit(
        samples: &Samples,
        graph: &Graph,
        (cause, effect): (usize, usize),
        horizon: usize,
        (count, seed): (usize, u64),
    ) -> Result<Self> {
        let between = between(graph, cause, effect);
        let columns = columns_for(samples, graph, &between, horizon)?;
        let by_lag = |system: &LinearSystem| {
            system.effects(horizon).iter().map(|all| all[[effect, cause]]).collect::<Vec<f64>>()
        };
        let system = columns.system(graph, &between, &columns.products.whole(), false);
        let prefix = columns.products.prefix();
        let draw = |k: usize| {
            let sums = prefix.resampled(random::at(seed, k, 1), &columns.stretches);
            by_lag(&columns.system(graph, &between, &sums, false))
        };
        let drawn: Vec<Vec<f64>> = (0..count).map(draw).collect();
        Ok(Self { cause, effect, total: by_lag(&system), drawn, between, system })
    }

    /// The effect of the link itself.
    pub(crate) fn direct(&self, lag: usize) -> f64 {
        self.system.coefficients.get(lag).map_or(0.0, |phi| phi[[self.effect, self.cause]])
    }

    /// What passes through a variable, at a lag up to the horizon.
    pub(crate) fn through(&self, mediator: usize, lag: usize) -> f64 {
        if !self.between.contains(&mediator) {
            return 0.0;
        }
        let around = self.system.effects_around(mediator, lag);
        self.total[lag] - around[lag][[self.effect, self.cause]]
    }
}

/// The variables on directed paths from `cause` to `effect`, at whatever lag.
fn between(graph: &Graph, cause: usize, effect: usize) -> Vec<usize> {
    let (after, before) = (reached(graph, cause, true), reached(graph, effect, false));
    (0..graph.len()).filter(|&var| after[var] && before[var]).collect()
}

/// By variable: whether a search along the links, or against them, comes there; the start is there.
fn reached(graph: &Graph, start: usize, along: bool) -> Vec<bool> {
    let mut seen = vec![false; graph.len()];
    let mut open = vec![start];
    while let Some(var) = open.pop() {
        if !std::mem::replace(&mut seen[var], true) {
            let ends = graph.arrows().map(|a| if along { (a.cause, a.effect) } else { (a.effect, a.cause) });
            open.extend(ends.filter(|(from, _)| *from == var).map(|(_, to)| to));
        }
    }
    seen
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;
    use roscausal_discovery::DataFrame;

    use super::*;
    use crate::{effects::Mediation, graph::Arrow};

    fn graph() -> Graph {
        let links = [(0, 0, 1), (0, 1, 1), (1, 2, 0), (0, 2, 2), (2, 3, 1), (4, 1, 1)];
        let arrows = links.map(|(cause, effect, lag)| Arrow { cause, effect, lag });
        Graph::new((0..5).map(|k| format!("x{k}")).collect(), 2, &arrows, &[]).unwrap()
    }

    fn samples(last_of: usize) -> Samples {
        let number = |i: usize| roscausal_discovery::mix(i as u64) as f64 / u64::MAX as f64;
        let values = Array2::from_shape_fn((200, 5), |(t, k)| match t {
            150.. if k == last_of => f64::NAN,
            _ => number(5 * t + k),
        });
        let names = (0..5).map(|k| format!("x{k}")).collect();
        Samples::new(&DataFrame::new(vec![values], names).unwrap(), &graph(), &Vec::new()).unwrap()
    }

    #[test]
    fn what_lies_between_says_what_the_whole_graph_says_to_the_last_bit() {
        let (samples, graph) = (samples(9), graph());
        assert_eq!(between(&graph, 0, 2), [0, 1, 2]);
        let paths = Paths::fit(&samples, &graph, (0, 2), 5, (3, 7)).unwrap();
        let whole = Mediation::fit(&samples, &graph, 5, false).unwrap();
        let drawn = Mediation::bootstrap(&samples, &graph, 5, false, 3, 7).unwrap();
        for lag in 0..=5 {
            assert_eq!(paths.total[lag], whole.total[lag][[2, 0]]);
            assert_eq!(paths.through(1, lag), whole.mediated[1][lag][[2, 0]]);
            assert_eq!(paths.through(3, lag), 0.0);
            let of_draws: Vec<f64> = drawn.iter().map(|one| one.total[lag][[2, 0]]).collect();
            assert_eq!(paths.drawn.iter().map(|one| one[lag]).collect::<Vec<f64>>(), of_draws);
        }
        assert_eq!(paths.direct(2), whole.system.coefficients[2][[2, 0]]);
    }

    #[test]
    fn a_value_that_is_missing_elsewhere_takes_no_row_away() {
        let of = |last_of: usize| Paths::fit(&samples(last_of), &graph(), (0, 2), 5, (3, 7)).unwrap();
        let (whole, below, beside) = (of(9), of(3), of(4));
        assert_eq!((&below.total, &below.drawn), (&whole.total, &whole.drawn), "x3 is behind the effect");
        assert_ne!(beside.total, whole.total, "x4 drives what lies between");
    }

    #[test]
    fn without_a_path_nothing_is_fitted_and_the_effect_is_none() {
        let paths = Paths::fit(&samples(0), &graph(), (3, 0), 2, (2, 7)).unwrap();
        assert_eq!((paths.total, paths.drawn), (vec![0.0; 3], vec![vec![0.0; 3]; 2]));
    }
}
