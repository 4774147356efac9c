//! The rows that equations are fitted on: recordings, and where an experiment imposed a variable.

use ndarray::{Array2, ArrayView2};
use roscausal_discovery::{DataFrame, Error, Node, Result, names};

use crate::{graph::Graph, linear::least_squares};

pub use roscausal_discovery::methods::{ActsOn, usual_acts_on as default_acts_on};

/// Recordings of a graph's variables, in its order.
#[derive(Clone, Debug, PartialEq)]
pub struct Samples {
    values: Vec<Array2<f64>>,
    /// Whether a variable was imposed; none where no column says so.
    imposed: Vec<Array2<bool>>,
}

/// A moment: number of the recording, and row.
pub(crate) type Moment = (usize, usize);

impl Samples {
    /// The columns of `data` that are the graph's variables. Where a column of `acts_on` is neither 0 nor missing, its variable
    /// was imposed.
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
        let acting: Vec<(usize, usize)> = acts_on
            .iter()
            .filter_map(|(column, variable)| {
                let column = names::position(data.var_names(), column)?;
                Some((column, names::position(graph.names(), variable)?))
            })
            .collect();
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
        Ok(Self { values, imposed: data.recordings().iter().map(imposed_in).collect() })
    }

    /// With given marks of what was imposed, each of the shape of its recording.
    pub(crate) fn with_imposed(values: Vec<Array2<f64>>, imposed: Vec<Array2<bool>>) -> Option<Self> {
        let fits =
            values.len() == imposed.len() && values.iter().zip(&imposed).all(|(v, i)| v.dim() == i.dim());
        fits.then_some(Self { values, imposed })
    }

    /// The recordings.
    pub fn recordings(&self) -> &[Array2<f64>] {
        &self.values
    }

    /// Where variables were imposed.
    pub(crate) fn imposed(&self) -> &[Array2<bool>] {
        &self.imposed
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
        let all = self
            .moments(x.lag.max(y.lag))
            .into_iter()
            .filter(|&m| self.was_imposed(m, x) && !self.was_imposed(m, y));
        let pair = |m: Moment| (self.at(m, x), self.at(m, y));
        let (xs, ys): (Vec<f64>, Vec<f64>) =
            all.map(pair).filter(|(x, y)| x.is_finite() && y.is_finite()).unzip();
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

    /// Whether a moment trains the equation of `var`: nothing missing, `var` not imposed.
    pub(crate) fn trains(&self, moment: Moment, var: usize, parents: &[Node]) -> bool {
        !self.imposed[moment.0][[moment.1, var]]
            && self.at(moment, Node::new(var, 0)).is_finite()
            && parents.iter().all(|&parent| self.at(moment, parent).is_finite())
    }

    /// The first rows of each recording, a fraction of them, and the rest with `memory` rows of the first part before it.
    pub(crate) fn split(&self, fraction: f64, memory: usize) -> (Self, Self) {
        let cut = |r: usize| (r as f64 * fraction).round() as usize;
        let head = |a: ArrayView2<'_, f64>| a.slice(ndarray::s![..cut(a.nrows()), ..]).to_owned();
        let tail = |a: ArrayView2<'_, f64>| {
            a.slice(ndarray::s![cut(a.nrows()).saturating_sub(memory).., ..]).to_owned()
        };
        let head_of = |a: &Array2<bool>| a.slice(ndarray::s![..cut(a.nrows()), ..]).to_owned();
        let tail_of =
            |a: &Array2<bool>| a.slice(ndarray::s![cut(a.nrows()).saturating_sub(memory).., ..]).to_owned();
        let first = Self {
            values: self.values.iter().map(|r| head(r.view())).collect(),
            imposed: self.imposed.iter().map(head_of).collect(),
        };
        let rest = Self {
            values: self.values.iter().map(|r| tail(r.view())).collect(),
            imposed: self.imposed.iter().map(tail_of).collect(),
        };
        (first, rest)
    }
}
