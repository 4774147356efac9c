//! The rows that equations are fitted on: recordings, and where an experiment imposed a variable.

use ndarray::Array2;
use roscausal_discovery::{DataFrame, Error, Node, Result, names};

use crate::{graph::Graph, linear::least_squares};

pub use roscausal_discovery::methods::{ActsOn, default_intervention_targets};

/// Recordings of a graph's variables, in its order.
#[derive(Clone, Debug, PartialEq)]
pub struct Samples {
    values: Vec<Array2<f64>>,
    /// Whether a variable was imposed; none where no column says so.
    pub(crate) imposed: Vec<Array2<bool>>,
    /// For each recording the rows that are the past of others and no effect; empty for none.
    pub(crate) masked: Vec<Vec<bool>>,
}

/// A moment: number of the recording, and row.
pub(crate) type Moment = (usize, usize);

impl Samples {
    /// The columns of `data` that are the graph's variables. Where a column of `acts_on` is neither 0 nor missing, its variable
    /// was imposed. Rows that the data mask as effects train no equation and count for no effect; forecasts are scored on all rows.
    ///
    /// # Errors
    /// A variable that the data do not have, or that an entry of `acts_on` names and the graph does not have is no error.
    pub fn new(data: &DataFrame, graph: &Graph, acts_on: &ActsOn) -> Result<Self> {
        let column = |name: &String| {
            names::position(data.var_names(), name).ok_or_else(|| {
                let all = data.var_names().join(", ");
                Error::Data(format!(
                    "the data have no column '{name}', which the graph names; columns: {all}"
                ))
            })
        };
        let columns: Vec<usize> = graph.names().iter().map(column).collect::<Result<_>>()?;
        let places = |(column, variable): &(String, String)| {
            names::position(data.var_names(), column).zip(names::position(graph.names(), variable))
        };
        let acting: Vec<(usize, usize)> = acts_on.iter().filter_map(places).collect();
        let values = data.recordings().iter().map(|r| r.select(ndarray::Axis(1), &columns)).collect();
        let imposed_in = |recording: &Array2<f64>| {
            let mut imposed = Array2::from_elem((recording.nrows(), columns.len()), false);
            for &(column, variable) in &acting {
                for t in 0..recording.nrows() {
                    let value = recording[[t, column]];
                    imposed[[t, variable]] |= value != 0.0 && !value.is_nan();
                }
            }
            imposed
        };
        let masked = (0..data.recordings().len()).map(|recording| data.masked_effects(recording)).collect();
        Ok(Self { values, imposed: data.recordings().iter().map(imposed_in).collect(), masked })
    }

    /// With given marks of what was imposed, each of the shape of its recording, and of what is not an effect, as long as its recording or
    /// empty.
    pub(crate) fn with_marks(
        values: Vec<Array2<f64>>,
        imposed: Vec<Array2<bool>>,
        masked: Vec<Vec<bool>>,
    ) -> Option<Self> {
        let fits = values.len() == imposed.len()
            && values.len() == masked.len()
            && values.iter().zip(&imposed).all(|(v, i)| v.dim() == i.dim())
            && values.iter().zip(&masked).all(|(v, m)| m.is_empty() || m.len() == v.nrows());
        fits.then_some(Self { values, imposed, masked })
    }

    /// The recordings.
    pub fn recordings(&self) -> &[Array2<f64>] {
        &self.values
    }

    /// Whether what happens at a moment counts as an effect of what was before.
    pub(crate) fn is_effect(&self, (recording, t): Moment) -> bool {
        !self.masked[recording].get(t).copied().unwrap_or(false)
    }

    /// The smallest and the largest value that a variable was recorded with; `None` if it never was.
    pub(crate) fn range(&self, var: usize) -> Option<(f64, f64)> {
        let values = self.values.iter().flat_map(|r| r.column(var)).filter(|value| value.is_finite());
        values.fold(None, |ends, &value| {
            let (low, high) = ends.unwrap_or((value, value));
            Some((value.min(low), value.max(high)))
        })
    }

    /// In how many rows a variable was imposed.
    pub fn times_imposed(&self, var: usize) -> usize {
        self.imposed.iter().map(|r| r.column(var).iter().filter(|&&is| is).count()).sum()
    }

    /// Whether an experiment imposed a node, seen from a moment.
    pub(crate) fn was_imposed(&self, (recording, t): Moment, node: Node) -> bool {
        self.imposed[recording][[t - node.lag, node.var]]
    }

    /// Rows, coefficient and standard error of `y` on `x` in the rows in which an experiment imposed `x` and not `y`; `None` where they
    /// are too few or `x` does not vary.
    pub(crate) fn effect_where_imposed(&self, x: Node, y: Node) -> Option<(usize, f64, f64)> {
        let counts = |&m: &Moment| self.is_effect(m) && self.was_imposed(m, x) && !self.was_imposed(m, y);
        let pairs = self.moments(x.lag.max(y.lag)).into_iter().filter(counts);
        let pairs = pairs.map(|m| (self.at(m, x), self.at(m, y)));
        let (xs, ys): (Vec<f64>, Vec<f64>) = pairs.filter(|(x, y)| x.is_finite() && y.is_finite()).unzip();
        if xs.len() < 10 {
            return None;
        }
        let fit = least_squares(&ys, &[&xs]);
        fit.dropped.is_empty().then(|| (xs.len(), fit.coefficients[0], fit.standard_errors[0]))
    }

    /// The moments with `memory` rows before them.
    pub(crate) fn moments(&self, memory: usize) -> Vec<Moment> {
        let of = |(k, r): (usize, &Array2<f64>)| (memory..r.nrows()).map(move |t| (k, t)).collect::<Vec<_>>();
        self.values.iter().enumerate().flat_map(of).collect()
    }

    /// A variable at a lag, seen from a moment.
    pub(crate) fn at(&self, (recording, t): Moment, node: Node) -> f64 {
        self.values[recording][[t - node.lag, node.var]]
    }

    /// Whether a moment trains the equation of `var`: nothing missing, the row not masked, `var` not imposed.
    pub(crate) fn trains(&self, moment: Moment, var: usize, parents: &[Node]) -> bool {
        self.is_effect(moment)
            && !self.imposed[moment.0][[moment.1, var]]
            && self.at(moment, Node::new(var, 0)).is_finite()
            && parents.iter().all(|&parent| self.at(moment, parent).is_finite())
    }

    /// The first rows of each recording, a fraction of them, and the rest with `memory` rows of the first part before it.
    pub(crate) fn split(&self, fraction: f64, memory: usize) -> (Self, Self) {
        let cut = |r: usize| (r as f64 * fraction).round() as usize;
        let part = |of: &dyn Fn(usize) -> std::ops::Range<usize>| Self {
            values: self.values.iter().map(|a| rows(a, of(a.nrows()))).collect(),
            imposed: self.imposed.iter().map(|a| rows(a, of(a.nrows()))).collect(),
            masked: self.masked.iter().map(|a| a.get(of(a.len())).unwrap_or_default().to_vec()).collect(),
        };
        (part(&|n| 0..cut(n)), part(&|n| cut(n).saturating_sub(memory)..n))
    }
}

fn rows<T: Copy>(of: &Array2<T>, range: std::ops::Range<usize>) -> Array2<T> {
    of.slice(ndarray::s![range, ..]).to_owned()
}
