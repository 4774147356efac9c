//! What is compared: possible links, what two groups of batches say of them, and the conditions of each effect.

use serde::{Deserialize, Serialize};

use super::{
    baseline::Baseline,
    event::{Form, Kind},
    place::Place,
};
use crate::{
    numeric::slope::Slope,
    types::{Control, Node, add_new},
};

/// Level at which a slope counts as none.
pub(super) const NONE: f64 = 0.05;

/// What two groups of batches say of one possible link.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Difference {
    pub(super) at: Place,
    pub(super) before: Slope,
    pub(super) after: Slope,
    pub(super) kind: Kind,
    /// How far the two are apart, in standard deviations of independent rows.
    pub(super) z: f64,
    /// P-value of one mechanism in both, by the baseline.
    pub(super) p: f64,
    /// Corrected for the number of links (Benjamini and Hochberg).
    pub(super) q: f64,
}

impl Difference {
    pub(super) fn rises(&self) -> bool {
        self.after.value > self.before.value
    }

    /// Whether this and a link of which that became are one that came to another lag: it went at one, and appeared at the other.
    pub(super) fn moves_with(&self, at: Place, kind: Kind) -> bool {
        let has_gone = |kind: Kind| matches!(kind, Kind::Vanished | Kind::Weaker);
        let opposite = (has_gone(kind) && self.kind == Kind::Appeared)
            || (has_gone(self.kind) && kind == Kind::Appeared);
        (at.cause, at.effect) == (self.at.cause, self.at.effect) && at.lag != self.at.lag && opposite
    }
}

/// What compares.
pub(super) struct Comparison<'a> {
    pub(super) form: Form,
    pub(super) names: &'a [String],
    pub(super) tau_max: usize,
    /// Variables that others set: interventions, context.
    pub(super) exogenous: &'a [usize],
    pub(super) baseline: &'a Baseline,
    pub(super) control: &'a Control,
}

/// The conditions of each effect, and the effects that are not compared.
pub(super) struct Mechanisms {
    pub(super) parents: Vec<Vec<Node>>,
    /// Nodes that drive each effect by a curve: their squares are conditions, too.
    pub(super) curved: Vec<Vec<Node>>,
    pub(super) left_out: Vec<bool>,
    /// Nothing can be compared: an intervention that only one of the groups has is constant within each batch.
    pub(super) incomparable: bool,
}

impl Mechanisms {
    /// What an effect is regressed on.
    pub(super) fn inputs(&self, effect: usize) -> &[Node] {
        &self.parents[effect]
    }

    /// The causes that drive an effect by a curve.
    pub(super) fn bending(&self, effect: usize) -> Vec<usize> {
        self.curved[effect].iter().map(|node| node.var).filter(|cause| *cause != effect).collect()
    }

    /// A link that is there in one group, whatever both together show.
    pub(super) fn add(&mut self, at: Place) {
        add_new(&mut self.parents[at.effect], Node::new(at.cause, at.lag));
    }

    /// The conditions of a possible link: the parents of its effect but the link itself.
    pub(super) fn given(&self, at: Place) -> Vec<Node> {
        let own = Node::new(at.cause, at.lag);
        self.parents[at.effect].iter().copied().filter(|node| *node != own).collect()
    }
}

impl Comparison<'_> {
    pub(super) fn past(&self) -> usize {
        2 * self.tau_max
    }

    /// All that may drive a variable: each one at each lag from 1 on.
    pub(super) fn nodes(&self) -> impl Iterator<Item = Node> {
        let lags = 1..=self.tau_max;
        (0..self.names.len()).flat_map(move |var| lags.clone().map(move |lag| Node::new(var, lag)))
    }

    /// Whether two differences go in one direction; curves have none.
    pub(super) fn are_alike(&self, a: &Difference, b: &Difference) -> bool {
        self.form == Form::Curve || a.rises() == b.rises()
    }
}
