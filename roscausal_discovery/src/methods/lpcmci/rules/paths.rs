//! The rules on paths (Zhang 2008, R4, R9, R10, on time series graphs), and APR, which makes links final.

use super::{Proposals, triangles::may_orient};
use crate::{
    ground::{
        LinkEnd::{Circle, Conflict, Head, Tail},
        Node, Result,
    },
    methods::lpcmci::{
        graph::{Link, Middle, Pair, before},
        search::Search,
    },
};

/// A with a tail and a head at B, where no subset of B's parents separates them: the link stays.
pub(super) fn apr(search: &mut Search<'_, '_>, _: bool) -> Result<Proposals> {
    let mut proposals = Proposals::default();
    for (a, b, link) in search.graph.readings() {
        let half = if before(a, b) { Middle::Right } else { Middle::Left };
        if link.left == Tail && link.right == Head && (link.middle == Middle::Both || link.middle == half) {
            proposals.fix.push(Pair::of(a, b).0);
        }
    }
    Ok(proposals)
}

/// Discriminating paths: X1 ... W, V, Y where every node from X1 to W is a collider and a parent of Y. If V is in what separates
/// X1 and Y, V --> Y; if not, W <-> V <-> Y.
pub(super) fn r4(search: &mut Search<'_, '_>, only_lagged: bool) -> Result<Proposals> {
    let mut proposals = Proposals::default();
    let graph = &search.graph;
    let mut found = Vec::new();
    for v in graph.nodes() {
        for (y, yv) in graph.neighbours(v) {
            let open = yv.is_final() && yv.right == Circle && matches!(yv.left, Circle | Head);
            for (w, wv) in graph.neighbours(v).filter(|_| open) {
                let first = w != y && wv.is_final() && wv.left == Head && is_final_parent(search, w, y);
                if first {
                    let mut path = vec![y, v, w];
                    ends_of_discriminating_paths(search, &mut path, &mut |end| found.push((end, w, v, y)));
                }
            }
        }
    }
    found.sort_unstable();
    found.dedup();
    for (end, w, v, y) in found {
        if search.separates_with(v, end, y)? {
            if may_orient(v, y, only_lagged) {
                proposals.tail(v, y);
                proposals.head(y, v);
            }
        } else if search.graph.get(w, v).is_some_and(|wv| wv.right != Conflict)
            && search.separates_without(v, end, y)?
        {
            for (a, b) in [(v, y), (w, v)].into_iter().filter(|&(a, b)| may_orient(a, b, only_lagged)) {
                proposals.head(a, b);
                proposals.head(b, a);
            }
        }
    }
    Ok(proposals)
}

fn is_final_parent(search: &Search<'_, '_>, w: Node, y: Node) -> bool {
    search.graph.get(w, y).is_some_and(|wy| wy.is_final() && wy.left == Tail && wy.right == Head)
}

/// The path ends in a node that is a parent of Y and gets a head from the node before; it goes on to every node that points to
/// its end.
fn ends_of_discriminating_paths(search: &Search<'_, '_>, path: &mut Vec<Node>, found: &mut dyn FnMut(Node)) {
    let (y, Some(&last)) = (path[0], path.last()) else { return };
    for (next, link) in search.graph.neighbours(last) {
        if path.contains(&next) || !link.is_final() || link.right != Head {
            continue;
        }
        if !search.graph.adjacent(next, y) {
            found(next);
        } else if link.left == Head && is_final_parent(search, next, y) {
            path.push(next);
            ends_of_discriminating_paths(search, path, found);
            path.pop();
        }
    }
}

/// A o*> C, and an uncovered potentially directed path from a neighbour of A to C that A is part of: A --> C.
pub(super) fn r9(search: &mut Search<'_, '_>, only_lagged: bool) -> Result<Proposals> {
    let mut proposals = Proposals::default();
    for (a, c) in open_causes(search, only_lagged) {
        let neighbours: Vec<(Node, Link)> = search.graph.neighbours(a).collect();
        for (b, ba) in neighbours {
            let circle_here = ba.right == Circle && matches!(ba.left, Circle | Head);
            let tail_here = ba.right == Tail && ba.left == Head;
            if b == c || !(circle_here || tail_here) || search.graph.adjacent(b, c) {
                continue;
            }
            let directed = ba.left == Head;
            let mut paths = Vec::new();
            uncovered_paths(search, &mut vec![b], c, a, directed, &mut paths);
            paths.retain(|path| path.len() >= 3 && !search.graph.adjacent(path[1], a));
            if paths.is_empty() || !search.separates_with(a, b, c)? {
                continue;
            }
            for path in paths {
                if directed || continues(search, a, &path)? {
                    proposals.tail(a, c);
                    break;
                }
            }
        }
    }
    Ok(proposals)
}

/// A o*> C, and two uncovered potentially directed paths from A over parents of C that start apart: A --> C.
pub(super) fn r10(search: &mut Search<'_, '_>, only_lagged: bool) -> Result<Proposals> {
    let mut proposals = Proposals::default();
    for (a, c) in open_causes(search, only_lagged) {
        let is_parent = |(_, link): &(Node, Link)| link.left == Tail && link.right == Head;
        let parents: Vec<(Node, Link)> = search.graph.neighbours(c).filter(is_parent).collect();
        let mut seconds = Vec::new();
        for (p, _) in parents.into_iter().filter(|(p, _)| *p != a) {
            let mut paths = Vec::new();
            uncovered_paths(search, &mut vec![a], p, c, false, &mut paths);
            for mut path in paths {
                let uncovered = path.len() >= 3 && !search.graph.adjacent(path[path.len() - 2], c);
                path.push(c);
                if uncovered && inner_nodes_continue(search, &path)? {
                    seconds.push(path[1]);
                }
            }
        }
        seconds.sort_unstable();
        seconds.dedup();
        for (k, &m) in seconds.iter().enumerate() {
            for &n in &seconds[k + 1..] {
                if !search.graph.adjacent(m, n) && search.separates_with(a, m, n)? {
                    proposals.tail(a, c);
                }
            }
        }
    }
    Ok(proposals)
}

/// A o*> C.
fn open_causes(search: &Search<'_, '_>, only_lagged: bool) -> Vec<(Node, Node)> {
    let nodes = search.graph.nodes();
    let of = |c: Node| search.graph.neighbours(c).map(move |(a, link)| (a, c, link));
    let open = |&(a, c, link): &(Node, Node, Link)| {
        link.left == Circle && link.right == Head && may_orient(a, c, only_lagged)
    };
    nodes.flat_map(of).filter(open).map(|(a, c, _)| (a, c)).collect()
}

/// Uncovered potentially directed paths that go on from `path` to `end`, not through `avoided`: o*o, o*> or -*> up to the first
/// step that is not o*o, then -*>.
fn uncovered_paths(
    search: &Search<'_, '_>,
    path: &mut Vec<Node>,
    end: Node,
    avoided: Node,
    directed: bool,
    found: &mut Vec<Vec<Node>>,
) {
    let Some(&last) = path.last() else { return };
    for (next, link) in search.graph.neighbours(last) {
        // The link is read from the next node back to the last one.
        let fits = match (link.right, link.left) {
            (Tail, Head) => true,
            (Circle, Circle | Head) => !directed,
            _ => false,
        };
        let covered = path.len() >= 2 && search.graph.adjacent(path[path.len() - 2], next);
        if next == avoided || !fits || covered || path.contains(&next) {
            continue;
        }
        path.push(next);
        if next == end {
            found.push(path.clone());
        } else {
            uncovered_paths(search, path, end, avoided, directed || link.left == Head, found);
        }
        path.pop();
    }
}

/// Whether `before` and the path after it make a chain: the first node is in what separates its neighbours, and so on.
fn continues(search: &mut Search<'_, '_>, before: Node, path: &[Node]) -> Result<bool> {
    let [first, second, ..] = path else { return Ok(false) };
    Ok(search.separates_with(*first, before, *second)? && inner_nodes_continue(search, path)?)
}

/// Whether each inner node, from the left until a step has a head at its far end, is in what separates its neighbours.
fn inner_nodes_continue(search: &mut Search<'_, '_>, path: &[Node]) -> Result<bool> {
    for three in path.windows(3) {
        let [before, middle, after] = three else { continue };
        if search.graph.get(*before, *middle).is_some_and(|link| link.right == Head) {
            return Ok(true);
        }
        if !search.separates_with(*middle, *before, *after)? {
            return Ok(false);
        }
    }
    Ok(true)
}
