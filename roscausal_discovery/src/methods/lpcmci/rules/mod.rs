//! The rules that orient links, and how what they propose is applied.
//!
//! A rule looks at the whole graph and proposes: this node causes that one, or does not; this link goes; this link stays.
//! When all is collected, it is applied. If it changed something, the list starts again from its first rule.

mod colliders;
mod paths;
mod triangles;

use std::collections::BTreeMap;

use super::{
    graph::{Middle, Pair},
    knowledge::Known,
    search::Search,
};
use crate::types::{LinkEnd, Node, Result};

/// Which rules run.
#[derive(Clone, Copy)]
pub(super) enum Rules {
    /// Those that need no collider rule.
    Short,
    /// All.
    Long,
    /// The one that finds colliders between links that are final.
    Colliders,
}

/// What a rule found.
#[derive(Default)]
pub(super) struct Proposals {
    /// The node, the other end, and whether the node causes it.
    causes: Vec<(Node, Node, bool)>,
    /// Links that go, with the set that separates them.
    remove: Vec<(Pair, Vec<Node>)>,
    /// Links that stay.
    fix: Vec<Pair>,
    /// Links at lag 0 are not oriented.
    only_lagged: bool,
}

impl Proposals {
    fn may_orient(&self, a: Node, b: Node) -> bool {
        !self.only_lagged || a.lag != b.lag
    }

    /// `a` causes `b`.
    fn tail(&mut self, a: Node, b: Node) {
        self.causes.extend(self.may_orient(a, b).then_some((a, b, true)));
    }

    /// `a` does not cause `b`.
    fn head(&mut self, a: Node, b: Node) {
        self.causes.extend(self.may_orient(a, b).then_some((a, b, false)));
    }
}

type Rule = fn(&mut Search<'_, '_>, &mut Proposals) -> Result<()>;

const SHORT: &[Rule] = &[paths::apr, triangles::r8, triangles::r2, triangles::r1, paths::r9, paths::r10];
const COLLIDERS: &[Rule] = &[colliders::r0d];
const LONG: &[Rule] = &[
    paths::apr,
    triangles::r8,
    triangles::r2,
    triangles::r1,
    colliders::r0d,
    colliders::r0c,
    triangles::r3,
    paths::r4,
    paths::r9,
    paths::r10,
    colliders::r0b,
    colliders::r0a,
];

/// Runs a list of rules until none of them changes anything; whether one did. With `only_lagged` links at lag 0 are not
/// oriented.
pub(super) fn apply_rules(search: &mut Search<'_, '_>, rules: Rules, only_lagged: bool) -> Result<bool> {
    let rules = match rules {
        Rules::Short => SHORT,
        Rules::Long => LONG,
        Rules::Colliders => COLLIDERS,
    };
    let mut changed = false;
    let mut at = 0;
    while let Some(rule) = rules.get(at) {
        let mut proposals = Proposals { only_lagged, ..Proposals::default() };
        rule(search, &mut proposals)?;
        if apply(search, proposals)? {
            changed = true;
            at = 0;
        } else {
            at += 1;
        }
    }
    Ok(changed)
}

/// Applies what a rule proposes; whether the graph changed.
fn apply(search: &mut Search<'_, '_>, proposals: Proposals) -> Result<bool> {
    let Proposals { causes, remove, fix, .. } = proposals;
    let changed = if remove.is_empty() && fix.is_empty() {
        apply_causes(search, &causes)
    } else {
        apply_links(search, remove, &fix)?
    };
    if changed {
        search.votes.clear();
    }
    Ok(changed)
}

/// Removes and fixes links. One that is to do both is in conflict.
fn apply_links(search: &mut Search<'_, '_>, remove: Vec<(Pair, Vec<Node>)>, fix: &[Pair]) -> Result<bool> {
    let mut by_pair: BTreeMap<Pair, Vec<Vec<Node>>> = BTreeMap::new();
    remove.into_iter().for_each(|(pair, set)| by_pair.entry(pair).or_default().push(set));
    for &pair in fix {
        let middle = if by_pair.contains_key(&pair) { Middle::Conflict } else { Middle::Final };
        search.graph.put_middle(pair, middle);
    }
    for (pair, sets) in by_pair {
        if fix.contains(&pair) {
            continue;
        }
        sets.into_iter().for_each(|set| search.add_separating(pair, set, false));
        search.remove(pair);
        search.make_minimal(pair)?;
    }
    Ok(true)
}

/// Learns what causes what; whether an existing link got a head or a tail.
fn apply_causes(search: &mut Search<'_, '_>, causes: &[(Node, Node, bool)]) -> bool {
    // Said to cause, said not to cause.
    let mut stated: BTreeMap<(Node, Node), (bool, bool)> = BTreeMap::new();
    for &(a, b, causes) in causes {
        let present = |a: Node, b: Node| {
            let shift = a.lag.min(b.lag);
            (Node::new(a.var, a.lag - shift), Node::new(b.var, b.lag - shift))
        };
        let entry = stated.entry(present(a, b)).or_default();
        entry.0 |= causes;
        entry.1 |= !causes;
        if causes && a.lag == b.lag {
            stated.entry(present(b, a)).or_default().1 = true;
        }
    }
    let mut changed = false;
    for ((a, b), (yes, no)) in stated {
        let assumed = search.graph.get(a, b).map(|link| link.left);
        let before = match (search.known.get(&search.graph, a, b), assumed) {
            (Known::Nothing, Some(LinkEnd::Tail)) => Known::Ancestor,
            (known, _) => known,
        };
        let (known, end) = match before {
            Known::Ambiguous => continue,
            Known::NonAncestor if yes => (Known::Ambiguous, LinkEnd::Conflict),
            Known::Ancestor if no => (Known::Ambiguous, LinkEnd::Conflict),
            _ if yes && no => (Known::Ambiguous, LinkEnd::Conflict),
            _ if yes => (Known::Ancestor, LinkEnd::Tail),
            _ => (Known::NonAncestor, LinkEnd::Head),
        };
        search.known.set(&search.graph, a, b, known);
        let marked = search.mark_end(a, b, end);
        changed |= marked && end != LinkEnd::Conflict;
    }
    changed
}
