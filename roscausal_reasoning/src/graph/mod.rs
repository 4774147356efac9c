//! The causal graph over time that a structural model stands on: for each variable its parents, and an order within a moment.

mod adjustment;
mod orientations;

use std::collections::{HashMap, HashSet};

use roscausal_discovery::{
    Error, Link, LinkMark, Model, Node, Result,
    text::{check_names, quoted},
};

pub use adjustment::{Adjustment, adjustment};
pub use orientations::{MOST_PAIRS, Orientation};

/// Largest lag of a graph.
const MOST_LAGS: usize = 1000;
/// Most places for links of a graph: variables times variables times lags.
const MOST_PLACES: usize = 4_000_000;

/// A directed link: `cause` at `t - lag` drives `effect` at `t`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Arrow {
    /// The cause's number.
    pub cause: usize,
    /// The effect's number.
    pub effect: usize,
    /// Steps from cause to effect.
    pub lag: usize,
}

/// Two variables that depend on each other within a moment, in a direction that the data leave open.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Pair {
    /// One variable.
    pub a: usize,
    /// The other.
    pub b: usize,
    /// `x-x`: the data speak for both directions; else `o-o`: for neither.
    pub conflict: bool,
}

/// Variables, their parents, and the pairs without a direction.
///
/// ```
/// use roscausal_reasoning::graph::{Arrow, Graph};
///
/// let arrow = |cause, effect, lag| Arrow { cause, effect, lag };
/// let names = vec!["r_v".into(), "d".into()];
/// let graph = Graph::new(names, 1, &[arrow(0, 1, 0), arrow(1, 1, 1)], &[])?;
/// assert_eq!(graph.order(), [0, 1]);
/// assert_eq!(graph.parents(1).len(), 2);
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Graph {
    names: Vec<String>,
    largest_lag: usize,
    /// By variable, sorted.
    parents: Vec<Vec<Node>>,
    pairs: Vec<Pair>,
    order: Vec<usize>,
}

impl Graph {
    /// A graph of `names` with lags up to `largest_lag`.
    ///
    /// # Errors
    /// No variable, too many, one without a name, two of one name; a link of a variable that does not exist or to itself at lag 0, a lag
    /// above the largest, a link twice, a circle of links at lag 0.
    pub fn new(names: Vec<String>, largest_lag: usize, arrows: &[Arrow], pairs: &[Pair]) -> Result<Self> {
        let n = names.len();
        let refused = |reason: String| Err(Error::param("graph", reason));
        if n == 0 {
            return refused("it has no variable".into());
        }
        if largest_lag > MOST_LAGS {
            return refused(format!(
                "a largest lag of {largest_lag} is too large; lags are 0 to {MOST_LAGS}"
            ));
        }
        if n.saturating_mul(n).saturating_mul(largest_lag + 1) > MOST_PLACES {
            return refused(format!(
                "{n} variables with lags up to {largest_lag} are too many to reason on; leave some out"
            ));
        }
        check_names(&names).map_err(|error| Error::param("graph", error))?;
        let twice = |cause: usize, effect: usize, lag: usize| {
            let (cause, effect) = (quoted(&names[cause]), quoted(&names[effect]));
            refused(format!("the link {cause} -> {effect} at lag {lag} is there twice; keep one"))
        };
        let mut parents = vec![Vec::new(); n];
        for &Arrow { cause, effect, lag } in arrows {
            if cause >= n || effect >= n {
                return refused(format!("link {cause} -> {effect}: variables are 0 to {}", n - 1));
            }
            if lag > largest_lag || (lag == 0 && cause == effect) {
                let (cause, effect) = (quoted(&names[cause]), quoted(&names[effect]));
                return refused(format!(
                    "link {cause} -> {effect} at lag {lag}: lags are 0 to {largest_lag}, and above 0 for a variable on itself"
                ));
            }
            parents[effect].push(Node::new(cause, lag));
        }
        if let Some(pair) = pairs.iter().find(|pair| pair.a >= n || pair.b >= n || pair.a == pair.b) {
            return refused(format!("pair {} - {}: two of the variables 0 to {}", pair.a, pair.b, n - 1));
        }
        let either_way = |a: usize, b: usize| (a.min(b), a.max(b));
        let mut open = HashSet::new();
        if let Some(pair) = pairs.iter().find(|pair| !open.insert(either_way(pair.a, pair.b))) {
            return twice(pair.a, pair.b, 0);
        }
        let is_open =
            |arrow: &&Arrow| arrow.lag == 0 && open.contains(&either_way(arrow.cause, arrow.effect));
        if let Some(arrow) = arrows.iter().find(is_open) {
            return twice(arrow.cause, arrow.effect, 0);
        }
        for (effect, list) in parents.iter_mut().enumerate() {
            list.sort_unstable();
            if let Some(k) = (1..list.len()).find(|&k| list[k] == list[k - 1]) {
                return twice(list[k].var, effect, list[k].lag);
            }
        }
        let Some(order) = order(&parents) else {
            return refused("its links at lag 0 go round in a circle; turn or remove one of them".into());
        };
        Ok(Self { names, largest_lag, parents, pairs: pairs.to_vec(), order })
    }

    /// The graph of a model, without the columns `context`: these are not variables of the system. Within a moment, a pair without a
    /// direction is open. A link that [`is_no_plain_cause`] is left out, also one of a variable with its own past.
    ///
    /// # Errors
    /// A model without variables; links at lag 0 in a circle; a link of a variable that the model does not have.
    pub fn of_model(model: &Model, context: &[String]) -> Result<Self> {
        let names: Vec<String> =
            model.features.iter().filter(|name| !context.contains(name)).cloned().collect();
        let (mut arrows, mut pairs, mut open) = (Vec::new(), Vec::new(), HashSet::new());
        let places: HashMap<&String, usize> = names.iter().zip(0..).collect();
        let find = |name: &String| {
            let reason = || format!("a link names {}, which is none of its features", quoted(name));
            places.get(name).copied().ok_or_else(|| Error::param("model", reason()))
        };
        let of_system = |link: &&Link| !context.contains(&link.cause) && !context.contains(&link.effect);
        for link in model.links.iter().filter(of_system) {
            let (cause, effect) = (find(&link.cause)?, find(&link.effect)?);
            match link.mark {
                _ if is_no_plain_cause(link) => {}
                LinkMark::Forward => arrows.push(Arrow { cause, effect, lag: link.lag }),
                mark => {
                    // A pair may be listed from both ends.
                    if open.insert((cause.min(effect), cause.max(effect))) {
                        pairs.push(Pair { a: cause, b: effect, conflict: mark == LinkMark::Conflict });
                    }
                }
            }
        }
        Self::new(names, model.tau_max, &arrows, &pairs)
    }

    /// The graph of some of its variables, in that order, and of the links between them.
    ///
    /// # Errors
    /// No variable.
    pub fn only(&self, vars: &[usize]) -> Result<Self> {
        let place = |var: usize| vars.iter().position(|other| *other == var);
        let arrow = |Arrow { cause, effect, lag }: Arrow| {
            Some(Arrow { cause: place(cause)?, effect: place(effect)?, lag })
        };
        let pair = |pair: &Pair| Some(Pair { a: place(pair.a)?, b: place(pair.b)?, ..*pair });
        let arrows: Vec<Arrow> = self.arrows().filter_map(arrow).collect();
        let pairs: Vec<Pair> = self.pairs.iter().filter_map(pair).collect();
        let names = vars.iter().map(|&var| self.names[var].clone()).collect();
        Self::new(names, self.largest_lag, &arrows, &pairs)
    }

    /// Names of the variables.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Number of variables.
    pub fn len(&self) -> usize {
        self.names.len()
    }

    /// Whether there is no variable; never.
    pub fn is_empty(&self) -> bool {
        self.names.is_empty()
    }

    /// The largest lag that was looked at, which may be above that of any link.
    pub fn largest_lag(&self) -> usize {
        self.largest_lag
    }

    /// The largest lag of a link: the rows of the past that a prediction needs.
    pub fn memory(&self) -> usize {
        self.parents.iter().flatten().map(|parent| parent.lag).max().unwrap_or(0)
    }

    /// What drives a variable, sorted by variable and lag.
    pub fn parents(&self, var: usize) -> &[Node] {
        &self.parents[var]
    }

    /// The directed links, by effect.
    pub fn arrows(&self) -> impl Iterator<Item = Arrow> + '_ {
        let of = |(effect, parents): (usize, &'_ Vec<Node>)| {
            parents.iter().map(move |p| Arrow { cause: p.var, effect, lag: p.lag }).collect::<Vec<_>>()
        };
        self.parents.iter().enumerate().flat_map(of)
    }

    /// The pairs without a direction.
    pub fn pairs(&self) -> &[Pair] {
        &self.pairs
    }

    /// The variables in an order in which those at lag 0 come before what they drive.
    pub fn order(&self) -> &[usize] {
        &self.order
    }

    /// A node as text: `h_dg(t-2)`, `h_dg(t)`.
    pub fn text(&self, node: Node) -> String {
        let name = &self.names[node.var];
        if node.lag == 0 { format!("{name}(t)") } else { format!("{name}(t-{})", node.lag) }
    }
}

/// Whether a link of a model can be no cause that an equation stands for: `<->` says that something unrecorded is behind both, and a
/// link from the past with an open mark (`o->`) that this may be so.
pub fn is_no_plain_cause(link: &Link) -> bool {
    link.mark == LinkMark::Bidirected || (link.lag > 0 && link.mark != LinkMark::Forward)
}

/// The topological order at lag 0, the smallest number first where several may follow (Kahn 1962); `None` for a circle.
fn order(parents: &[Vec<Node>]) -> Option<Vec<usize>> {
    let mut order = Vec::with_capacity(parents.len());
    let mut placed = vec![false; parents.len()];
    while order.len() < parents.len() {
        let ready =
            |j: &usize| !placed[*j] && parents[*j].iter().all(|parent| parent.lag > 0 || placed[parent.var]);
        let next = (0..parents.len()).find(ready)?;
        placed[next] = true;
        order.push(next);
    }
    Some(order)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arrow(cause: usize, effect: usize, lag: usize) -> Arrow {
        Arrow { cause, effect, lag }
    }

    fn names(n: usize) -> Vec<String> {
        (0..n).map(|k| format!("x{k}")).collect()
    }

    #[test]
    fn causes_within_a_moment_come_first() {
        let graph = Graph::new(names(3), 1, &[arrow(2, 0, 0), arrow(0, 1, 0), arrow(1, 2, 1)], &[]).unwrap();
        assert_eq!(graph.order(), [2, 0, 1]);
        assert_eq!((graph.memory(), graph.text(Node::new(1, 1)).as_str()), (1, "x1(t-1)"));
    }

    #[test]
    fn what_is_no_graph_is_refused_in_a_sentence() {
        let refused = |arrows: &[Arrow], pairs: &[Pair]| {
            Graph::new(names(2), 1, arrows, pairs).unwrap_err().to_string()
        };
        assert!(refused(&[arrow(0, 1, 0), arrow(1, 0, 0)], &[]).contains("circle"));
        assert!(refused(&[arrow(0, 5, 1)], &[]).contains("0 to 1"));
        assert!(refused(&[arrow(0, 0, 0)], &[]).contains("lag 0"));
        assert!(refused(&[arrow(0, 1, 3)], &[]).contains("lag 3"));
        assert!(refused(&[], &[Pair { a: 0, b: 0, conflict: false }]).contains("pair"));
        assert!(refused(&[arrow(0, 1, 1), arrow(0, 1, 1)], &[]).contains("twice"));
        let pair = |a, b| Pair { a, b, conflict: false };
        assert!(refused(&[arrow(0, 1, 0)], &[pair(1, 0)]).contains("twice"));
        assert!(refused(&[], &[pair(0, 1), pair(1, 0)]).contains("twice"));
        assert!(Graph::new(names(2000), 1, &[], &[]).unwrap_err().to_string().contains("too many"));
        assert!(Graph::new(vec![" ".into()], 1, &[], &[]).unwrap_err().to_string().contains("no name"));
        assert!(
            Graph::new(vec!["a".into(), "a".into()], 1, &[], &[]).unwrap_err().to_string().contains("twice")
        );
    }
}
