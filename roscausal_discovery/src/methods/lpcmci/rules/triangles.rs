//! The rules on three or four nodes (Zhang 2008, R1, R2, R3, R8, on time series graphs).

use super::Proposals;
use crate::{
    methods::lpcmci::{graph::Link, search::Search},
    types::{
        LinkEnd::{Circle, Head, Tail},
        Node, Result,
    },
};

/// Unshielded triples in both directions, with the links A-B and B-C.
pub(super) fn both_ways(search: &Search<'_, '_>) -> Vec<([Node; 3], [Link; 2])> {
    let turned = search.graph.unshielded().into_iter().flat_map(|[a, b, c]| [[a, b, c], [c, b, a]]);
    let links = |[a, b, c]: [Node; 3]| Some([search.graph.get(a, b)?, search.graph.get(b, c)?]);
    turned.filter_map(|triple| Some((triple, links(triple)?))).collect()
}

/// Triples A, B, C, all adjacent, within one window, the latest at lag 0, whose links A-B and B-C fit, with the nodes A and C and
/// the link A-C.
fn triangles(search: &Search<'_, '_>, fits: impl Fn(Link, Link) -> bool) -> Vec<(Node, Node, Link)> {
    let graph = &search.graph;
    let mut found = Vec::new();
    for b in graph.nodes() {
        let neighbours: Vec<(Node, Link)> = graph.neighbours(b).collect();
        for &(a, ab) in &neighbours {
            for &(c, cb) in &neighbours {
                let bc = Link { left: cb.right, right: cb.left, ..cb };
                if fits(ab, bc) && a != c && (a.lag == 0 || b.lag == 0 || c.lag == 0) {
                    found.extend(graph.get(a, c).map(|ac| (a, c, ac)));
                }
            }
        }
    }
    found
}

/// A **> B o*+ C, unshielded, B in the separating sets: B --> C.
pub(super) fn r1(search: &mut Search<'_, '_>, proposals: &mut Proposals) -> Result<()> {
    for ([a, b, c], [ab, bc]) in both_ways(search) {
        let fits = ab.right == Head && bc.left == Circle && matches!(bc.right, Circle | Head);
        if fits && proposals.may_orient(b, c) && search.separates_with(b, a, c)? {
            proposals.tail(b, c);
            proposals.head(c, b);
        }
    }
    Ok(())
}

/// A -*> B **> C or A **> B -*> C, and A +*o C: a head at C.
pub(super) fn r2(search: &mut Search<'_, '_>, proposals: &mut Proposals) -> Result<()> {
    let path =
        |ab: Link, bc: Link| ab.right == Head && bc.right == Head && (ab.left == Tail || bc.left == Tail);
    for (a, c, ac) in triangles(search, path) {
        if matches!(ac.left, Circle | Head) && ac.right == Circle {
            proposals.head(c, a);
        }
    }
    Ok(())
}

/// A -*> B -*> C and A o*+ C: A --> C.
pub(super) fn r8(search: &mut Search<'_, '_>, proposals: &mut Proposals) -> Result<()> {
    let path = |ab: Link, bc: Link| [ab, bc].iter().all(|link| link.left == Tail && link.right == Head);
    for (a, c, ac) in triangles(search, path) {
        if ac.left == Circle && matches!(ac.right, Circle | Head) {
            proposals.tail(a, c);
            proposals.head(c, a);
        }
    }
    Ok(())
}

/// A **> B <** C unshielded, A +*o D o*+ C with D in the separating sets, D +*o B: a head at B.
pub(super) fn r3(search: &mut Search<'_, '_>, proposals: &mut Proposals) -> Result<()> {
    let graph = &search.graph;
    let mut candidates = Vec::new();
    for b in graph.nodes() {
        let into: Vec<Node> =
            graph.neighbours(b).filter(|(_, link)| link.right == Head).map(|(node, _)| node).collect();
        for (d, _) in
            graph.neighbours(b).filter(|(_, db)| matches!(db.left, Circle | Head) && db.right == Circle)
        {
            let open = |node: &&Node| {
                let link = graph.get(**node, d);
                link.is_some_and(|link| matches!(link.left, Circle | Head) && link.right == Circle)
            };
            let ends: Vec<Node> = into.iter().filter(open).copied().collect();
            for (k, &a) in ends.iter().enumerate() {
                let unshielded = ends[k + 1..].iter().filter(|&&c| !graph.adjacent(a, c));
                candidates.extend(unshielded.map(|&c| (a, b, c, d)));
            }
        }
    }
    for (a, b, c, d) in candidates {
        if proposals.may_orient(b, d) && search.separates_with(d, a, c)? {
            proposals.head(b, d);
        }
    }
    Ok(())
}
