//! The rules that find colliders in unshielded triples, and those that first test what is not final yet (R0a to R0d).

use super::{Proposals, triangles::both_ways};
use crate::{
    methods::lpcmci::{
        graph::{Link, Middle, Pair, before},
        search::Search,
        sets::union,
    },
    types::{
        LinkEnd::{Circle, Conflict, Head, Tail},
        Node, Result,
    },
};

/// A ** B ** C unshielded: tests both links given what separates A and C; where both stay and B is in no such set, heads at B.
pub(super) fn r0a(search: &mut Search<'_, '_>, proposals: &mut Proposals) -> Result<()> {
    for [a, b, c] in search.graph.unshielded() {
        let (Some(ab), Some(cb)) = (search.graph.get(a, b), search.graph.get(c, b)) else { continue };
        let goes = test_again(search, a, b, c, ab, proposals)?;
        if test_again(search, c, b, a, cb, proposals)? || goes {
            continue;
        }
        let ends = [ab.right, cb.right];
        let contradictory = [ab, cb].iter().any(|link| link.middle == Middle::Conflict);
        let known = ends.iter().any(|end| matches!(end, Tail | Conflict)) || ends == [Head, Head];
        if !known && !contradictory && search.separates_without(b, a, c)? {
            proposals.head(b, a);
            proposals.head(b, c);
        }
    }
    Ok(())
}

/// A **> B o!+ C unshielded: tests A-B given what separates A and C; where it stays and B is in no such set, a head at B on C-B.
pub(super) fn r0b(search: &mut Search<'_, '_>, proposals: &mut Proposals) -> Result<()> {
    for ([a, b, c], [ab, bc]) in both_ways(search) {
        if ab.right != Head || !is_open(b, c, bc) || test_again(search, a, b, c, ab, proposals)? {
            continue;
        }
        if ab.middle != Middle::Conflict && search.separates_without(b, a, c)? {
            proposals.head(b, c);
        }
    }
    Ok(())
}

/// A *-* B o!+ C unshielded, B in no separating set: a head at B on C-B.
pub(super) fn r0c(search: &mut Search<'_, '_>, proposals: &mut Proposals) -> Result<()> {
    for ([a, b, c], [ab, bc]) in both_ways(search) {
        if ab.is_final() && is_open(b, c, bc) && search.separates_without(b, a, c)? {
            proposals.head(b, c);
        }
    }
    Ok(())
}

/// A *-o B o-* C or A *-> B o-* C unshielded, B in no separating set: heads at B on both.
pub(super) fn r0d(search: &mut Search<'_, '_>, proposals: &mut Proposals) -> Result<()> {
    for ([a, b, c], [ab, bc]) in both_ways(search) {
        let fits = ab.is_final() && bc.is_final() && matches!(ab.right, Circle | Head) && bc.left == Circle;
        if fits && search.separates_without(b, a, c)? {
            proposals.head(b, a);
            proposals.head(b, c);
        }
    }
    Ok(())
}

/// B o!+ C: no set of C's parents separates them.
fn is_open(b: Node, c: Node, bc: Link) -> bool {
    let half = if before(b, c) { Middle::Right } else { Middle::Left };
    let exhausted = bc.middle == Middle::Both || bc.middle == half;
    exhausted && bc.left == Circle && matches!(bc.right, Circle | Head)
}

/// Tests a link A-B that is not final given each weakly minimal set that separates A and C; whether it goes.
fn test_again(
    search: &mut Search<'_, '_>,
    a: Node,
    b: Node,
    c: Node,
    ab: Link,
    proposals: &mut Proposals,
) -> Result<bool> {
    if matches!(ab.middle, Middle::Final | Middle::Conflict) {
        return Ok(false);
    }
    let (ends, shift) = Pair::of(a, c);
    let (pair, at) = Pair::of(a, b);
    let minimal: Vec<Vec<Node>> = search.evidence(ends).map_or(Vec::new(), |evidence| {
        evidence.separating.iter().filter(|set| set.minimal).map(|set| set.nodes.clone()).collect()
    });
    // All within the window of the triple: what is later than both ends, or before the window, is left out.
    let tau_max = search.graph.tau_max;
    let to_pair = |node: Node| Some(Node::new(node.var, node.lag.checked_sub(at)?));
    let parents: Vec<Node> = search.parents(a, b).into_iter().filter_map(to_pair).collect();
    let mut goes = false;
    for set in minimal {
        let in_window = set.iter().map(|node| node.shifted(shift)).filter(|node| node.lag <= tau_max);
        let moved: Vec<Node> = in_window.filter_map(to_pair).collect();
        let z = union(pair, &moved, &parents);
        if search.separates(pair, &z)?.is_some() {
            proposals.remove.push((pair, z));
            goes = true;
        }
    }
    Ok(goes)
}
