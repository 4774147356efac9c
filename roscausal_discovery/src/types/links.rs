//! Link assumptions: what is known beforehand about which links may exist.

use std::collections::{BTreeMap, BTreeSet};

use super::{
    error::{Error, Result},
    marks::LinkMark,
    node::Node,
};

/// What is assumed about a possible link, read from cause to effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Assumption {
    /// `-->`: exists, and is not tested (value 1, p-value 0).
    Exists,
    /// `-?>`: may exist, and is tested.
    Test,
    /// `<--`: exists in the opposite direction (lag 0 only).
    ExistsBackward,
    /// `<?-`: may exist in the opposite direction (lag 0 only).
    TestBackward,
    /// `o-o`: exists, direction unknown (lag 0 only).
    ExistsUnoriented,
    /// `o?o`: may exist, direction unknown (lag 0 only).
    TestUnoriented,
    /// `o->`: exists, and the effect does not cause the cause. Only for methods that allow for hidden causes, as are the next
    /// five.
    ExistsNotBack,
    /// `o?>`: may exist, and the effect does not cause the cause.
    TestNotBack,
    /// `<-o`: `o->` in the opposite direction (lag 0 only).
    ExistsNotForward,
    /// `<?o`: `o?>` in the opposite direction (lag 0 only).
    TestNotForward,
    /// `<->`: exists, and neither causes the other.
    ExistsHidden,
    /// `<?>`: may exist, and neither causes the other.
    TestHidden,
}

impl Assumption {
    /// All of them.
    const ALL: [Self; 12] = {
        use Assumption::*;
        [
            Exists, Test, ExistsBackward, TestBackward, ExistsUnoriented, TestUnoriented, ExistsNotBack,
            TestNotBack, ExistsNotForward, TestNotForward, ExistsHidden, TestHidden,
        ]
    };

    /// Their symbols, in the order of the variants.
    const SYMBOLS: [&str; 12] =
        ["-->", "-?>", "<--", "<?-", "o-o", "o?o", "o->", "o?>", "<-o", "<?o", "<->", "<?>"];

    /// The assumption as tigramite writes it.
    pub fn symbol(self) -> &'static str {
        Self::SYMBOLS[self as usize]
    }

    /// The marks of each two: a link that exists, and the same that may exist.
    const MARKS: [LinkMark; 6] = {
        use LinkMark::*;
        [Forward, Backward, Unoriented, CircleHead, HeadCircle, Bidirected]
    };

    /// The mark of a link that was found under the assumption.
    pub(crate) fn mark(self) -> LinkMark {
        Self::MARKS[self as usize / 2]
    }

    /// Whether the assumption speaks of causes that were not recorded.
    pub fn speaks_of_hidden_causes(self) -> bool {
        !matches!(self.mark(), LinkMark::Forward | LinkMark::Backward | LinkMark::Unoriented)
    }

    /// Whether the link counts as existing without a test.
    pub fn exists(self) -> bool {
        !self.symbol().contains('?')
    }

    /// Whether two statements of one link cannot both be meant: one is more than "may exist", or they are of opposite directions.
    fn contradicts(self, other: Self) -> bool {
        let backward = |a: Self| matches!(a.mark(), LinkMark::Backward | LinkMark::HeadCircle);
        let open = |a: Self| a.mirrored() == a;
        self != other && (self.exists() || !open(self) && !open(other) && backward(self) != backward(other))
    }

    /// The same link, read from its other end.
    pub fn mirrored(self) -> Self {
        let mirrored = self.mark().mirrored();
        let is_it = |other: &Self| other.exists() == self.exists() && other.mark() == mirrored;
        Self::ALL.into_iter().find(is_it).unwrap_or(self)
    }
}

impl std::str::FromStr for Assumption {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|a| a.symbol() == text).ok_or_else(|| {
            let known = Self::SYMBOLS.join(", ");
            Error::param("link_assumptions", format!("'{text}' is not one of {known}"))
        })
    }
}

/// Which links may exist. A link that is not listed is assumed absent.
///
/// What is known before the analysis goes in here: a link that cannot be is not tested, and no false one is found.
///
/// ```
/// use roscausal_discovery::{Assumption, LinkAssumptions};
///
/// // Three variables, lags 0 to 2; nothing drives the weather (variable 2), and 0 drives 1 for certain.
/// let mut links = LinkAssumptions::all(3, 0, 2).exogenous(&[2]);
/// links.insert(0, 1, 1, Assumption::Exists)?;
/// assert_eq!(links.get(0, 2, 1), None);
/// assert_eq!(links.get(0, 1, 1), Some(Assumption::Exists));
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LinkAssumptions {
    targets: Vec<BTreeMap<Node, Assumption>>,
}

impl LinkAssumptions {
    /// No links among `n_vars` variables.
    pub fn none(n_vars: usize) -> Self {
        Self { targets: vec![BTreeMap::new(); n_vars] }
    }

    /// Every link may exist: lagged pairs `-?>`, pairs at lag 0 `o?o`, lags `tau_min..=tau_max`.
    pub fn all(n_vars: usize, tau_min: usize, tau_max: usize) -> Self {
        let mut links = Self::none(n_vars);
        for (target, map) in links.targets.iter_mut().enumerate() {
            for source in 0..n_vars {
                for lag in tau_min..=tau_max {
                    let assumption = if lag == 0 { Assumption::TestUnoriented } else { Assumption::Test };
                    if lag > 0 || source != target {
                        map.insert(Node::new(source, lag), assumption);
                    }
                }
            }
        }
        links
    }

    /// Every link may exist, and nothing is known of hidden causes: lagged pairs `o?>`, pairs at lag 0 `o?o`.
    pub fn all_with_hidden_causes(n_vars: usize, tau_min: usize, tau_max: usize) -> Self {
        let mut links = Self::all(n_vars, tau_min, tau_max);
        let lagged = links.targets.iter_mut().flatten().filter(|(source, _)| source.lag > 0);
        lagged.for_each(|(_, assumption)| *assumption = Assumption::TestNotBack);
        links
    }

    /// The same, where nothing is known of hidden causes: what may exist in one direction may also have a hidden cause.
    ///
    /// ```
    /// use roscausal_discovery::{Assumption, LinkAssumptions};
    ///
    /// let links = LinkAssumptions::all(2, 0, 1).allowing_hidden_causes();
    /// assert_eq!(links.get(0, 1, 1), Some(Assumption::TestNotBack));
    /// ```
    #[must_use]
    pub fn allowing_hidden_causes(mut self) -> Self {
        for assumption in self.targets.iter_mut().flat_map(BTreeMap::values_mut) {
            *assumption = match *assumption {
                Assumption::Test => Assumption::TestNotBack,
                Assumption::TestBackward => Assumption::TestNotForward,
                known => known,
            };
        }
        self
    }

    /// Removes all links that point to the variables `context`, such as weather or time of day. They have no
    /// parents, not even their own past. At lag 0 they can only be causes.
    #[must_use]
    pub fn exogenous(mut self, context: &[usize]) -> Self {
        for (target, map) in self.targets.iter_mut().enumerate() {
            let is_context = context.contains(&target);
            map.retain(|source, assumption| {
                let other_is_context = context.contains(&source.var);
                if source.lag > 0 || (is_context && other_is_context) {
                    return !is_context;
                }
                // One of the two is a context variable: the link points away from it.
                let (free, oriented) = match (is_context, other_is_context) {
                    (true, false) => (Assumption::TestBackward, Assumption::ExistsBackward),
                    (false, true) => (Assumption::Test, Assumption::Exists),
                    _ => return true,
                };
                let contradicts = assumption.mirrored() == free || assumption.mirrored() == oriented;
                *assumption = if assumption.exists() { oriented } else { free };
                !contradicts
            });
        }
        self
    }

    /// Assumes the link `cause(t - lag) -> effect(t)`; at lag 0 also its mirror image.
    ///
    /// # Errors
    /// A variable that does not exist, a variable on itself at lag 0, a lagged link that is not `-->` or `-?>`; at lag 0 a pair that is
    /// already known in another way, such as from its other end.
    pub fn insert(&mut self, cause: usize, effect: usize, lag: usize, assumption: Assumption) -> Result<()> {
        let fail = |reason: String| Err(Error::param("link_assumptions", reason));
        let n_vars = self.targets.len();
        if cause >= n_vars || effect >= n_vars {
            return fail(format!("link {cause} -> {effect}: variables are 0 to {}", n_vars - 1));
        }
        if lag == 0 && cause == effect {
            return fail(format!("variable {cause} cannot drive itself at lag 0"));
        }
        let lagged =
            matches!(assumption.mark(), LinkMark::Forward | LinkMark::CircleHead | LinkMark::Bidirected);
        if lag > 0 && !lagged {
            let allowed = "-->, -?>, o->, o?>, <-> or <?>";
            return fail(format!("'{}' at lag {lag}: a lagged link is {allowed}", assumption.symbol()));
        }
        if let Some(known) = self.get(cause, effect, lag).filter(|known| known.contradicts(assumption)) {
            let (known, new) = (known.symbol(), assumption.symbol());
            return fail(format!(
                "link {cause} -> {effect} at lag {lag} is both '{known}' and '{new}'; give one of them"
            ));
        }
        self.targets[effect].insert(Node::new(cause, lag), assumption);
        if lag == 0 {
            self.targets[cause].insert(Node::new(effect, 0), assumption.mirrored());
        }
        Ok(())
    }

    /// Rules the link `cause(t - lag) -> effect(t)` out; at lag 0 the pair in either direction.
    pub fn remove(&mut self, cause: usize, effect: usize, lag: usize) {
        for (source, target) in
            [(cause, effect), (effect, cause)].into_iter().take(if lag == 0 { 2 } else { 1 })
        {
            if let Some(links) = self.targets.get_mut(target) {
                links.remove(&Node::new(source, lag));
            }
        }
    }

    /// Number of variables.
    pub fn n_vars(&self) -> usize {
        self.targets.len()
    }

    /// The assumption about a link; `None`: no link.
    pub fn get(&self, cause: usize, effect: usize, lag: usize) -> Option<Assumption> {
        self.targets.get(effect)?.get(&Node::new(cause, lag)).copied()
    }

    /// The possible links into a target, by source and then lag.
    pub fn of_target(&self, target: usize) -> impl Iterator<Item = (Node, Assumption)> + '_ {
        self.targets[target].iter().map(|(&node, &assumption)| (node, assumption))
    }

    /// Checks that the assumptions match the variables and lags of a run.
    pub(crate) fn check(&self, n_vars: usize, tau_min: usize, tau_max: usize) -> Result<()> {
        Error::ensure(self.targets.len() == n_vars, "link_assumptions", || {
            format!("they are for {} variables, the data have {n_vars}", self.targets.len())
        })?;
        for map in &self.targets {
            if let Some(node) = map.keys().find(|node| !(tau_min..=tau_max).contains(&node.lag)) {
                let reason = format!("lag {} is outside tau_min..tau_max = {tau_min}..{tau_max}", node.lag);
                return Err(Error::param("link_assumptions", reason));
            }
        }
        let exists = |effect: &BTreeMap<Node, Assumption>| {
            let of = effect.iter().filter(|(cause, what)| cause.lag == 0 && **what == Assumption::Exists);
            of.map(|(cause, _)| cause.var).collect::<Vec<_>>()
        };
        match circle_of(&self.targets.iter().map(exists).collect::<Vec<_>>()) {
            Some(circle) => Err(Error::param(
                "link_assumptions",
                format!(
                    "the links that exist at lag 0 go round in a circle of the variables {circle:?}; take one back"
                ),
            )),
            None => Ok(()),
        }
    }
}

/// A circle of variables, each of which drives the next and the last the first; `causes` lists those of each variable.
pub(super) fn circle_of(causes: &[Vec<usize>]) -> Option<Vec<usize>> {
    let mut left: BTreeSet<usize> = (0..causes.len()).collect();
    loop {
        let is_free = |var: &usize| !causes[*var].iter().any(|cause| left.contains(cause));
        let free: Vec<usize> = left.iter().copied().filter(is_free).collect();
        if free.is_empty() {
            break;
        }
        for var in free {
            left.remove(&var);
        }
    }
    // Each that is left has a cause that is left: the way back comes round.
    let mut way = vec![*left.first()?];
    loop {
        let cause = causes[*way.last()?].iter().copied().find(|cause| left.contains(cause))?;
        if let Some(start) = way.iter().position(|var| *var == cause) {
            way.drain(..start);
            way.reverse();
            return Some(way);
        }
        way.push(cause);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_points_to_context_variables() {
        let links = LinkAssumptions::all(3, 0, 2).exogenous(&[1]);
        assert_eq!(links.of_target(1).filter(|(node, _)| node.lag > 0).count(), 0);
        assert_eq!(links.get(0, 1, 0), Some(Assumption::TestBackward));
        assert_eq!(links.get(1, 0, 0), Some(Assumption::Test));
        assert_eq!(links.get(1, 2, 2), Some(Assumption::Test));
        assert_eq!(links.get(0, 2, 0), Some(Assumption::TestUnoriented));
    }

    #[test]
    fn a_removed_link_is_gone_and_no_other() {
        let mut links = LinkAssumptions::all(2, 0, 1);
        links.remove(0, 1, 0);
        links.remove(0, 1, 1);
        assert_eq!([links.get(0, 1, 0), links.get(1, 0, 0), links.get(0, 1, 1)], [None; 3]);
        assert_eq!(links.get(1, 0, 1), Some(Assumption::Test));
        links.remove(7, 7, 0);
    }

    #[test]
    fn a_pair_at_lag_zero_is_one_statement_and_no_circle() {
        let mut links = LinkAssumptions::all(3, 0, 1);
        links.insert(0, 1, 0, Assumption::Exists).unwrap();
        links.insert(1, 0, 0, Assumption::ExistsBackward).unwrap();
        let error = links.insert(1, 0, 0, Assumption::Exists).unwrap_err().to_string();
        assert!(error.contains("both '<--' and '-->'"), "{error}");
        assert!(links.insert(1, 0, 0, Assumption::TestBackward).is_err());
        assert!(
            links.insert(0, 2, 0, Assumption::Test).is_ok()
                && links.insert(2, 0, 0, Assumption::Test).is_err()
        );
        assert!(links.check(3, 0, 1).is_ok());
        links = LinkAssumptions::none(3);
        for (cause, effect) in [(0, 1), (1, 2), (2, 0)] {
            links.insert(cause, effect, 0, Assumption::Exists).unwrap();
        }
        assert!(links.check(3, 0, 1).unwrap_err().to_string().contains("circle of the variables"));
    }

    #[test]
    fn a_circle_is_found_and_nothing_else() {
        assert_eq!(circle_of(&[vec![], vec![0], vec![0, 1]]), None);
        assert_eq!(circle_of(&[vec![], vec![0, 3], vec![1], vec![2], vec![3]]), Some(vec![2, 3, 1]));
    }

    #[test]
    fn links_at_lag_zero_are_known_from_both_ends() {
        let mut links = LinkAssumptions::none(2);
        links.insert(0, 1, 0, Assumption::Exists).unwrap();
        assert_eq!(links.get(1, 0, 0), Some(Assumption::ExistsBackward));
        assert!(links.insert(0, 0, 0, Assumption::Test).is_err());
        assert!(links.insert(0, 1, 1, Assumption::TestUnoriented).is_err());
        assert!(links.insert(0, 2, 1, Assumption::Test).is_err());
    }
}
