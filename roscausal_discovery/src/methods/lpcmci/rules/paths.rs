//! The rules on paths (Zhang 2008, R4, R9, R10, on time series graphs), and APR, which makes links final.

use std::collections::{HashMap, HashSet, VecDeque};

use super::Proposals;
use crate::{
    methods::lpcmci::{
        graph::{Link, Middle, Pair, before},
        search::Search,
    },
    types::{
        LinkEnd::{Circle, Conflict, Head, Tail},
        Node, Result, unique,
    },
};

/// A with a tail and a head at B, where no subset of B's parents separates them: the link stays.
pub(super) fn apr(search: &mut Search<'_, '_>, proposals: &mut Proposals) -> Result<()> {
    for (a, b, link) in search.graph.readings() {
        let half = if before(a, b) { Middle::Right } else { Middle::Left };
        if link.left == Tail && link.right == Head && (link.middle == Middle::Both || link.middle == half) {
            proposals.fix.push(Pair::of(a, b).0);
        }
    }
    Ok(())
}

/// Discriminating paths: X1 ... W, V, Y where every node from X1 to W is a collider and a parent of Y. If V is in what separates
/// X1 and Y, V --> Y; if not, W <-> V <-> Y.
pub(super) fn r4(search: &mut Search<'_, '_>, proposals: &mut Proposals) -> Result<()> {
    let graph = &search.graph;
    let mut found = Vec::new();
    for v in graph.nodes() {
        for (y, yv) in graph.neighbours(v) {
            let open = yv.is_final() && yv.right == Circle && matches!(yv.left, Circle | Head);
            for (w, wv) in graph.neighbours(v).filter(|_| open) {
                let first = w != y && wv.is_final() && wv.left == Head && is_final_parent(search, w, y);
                if first {
                    found.extend(ends_of_discriminating_paths(search, [y, v, w]).map(|end| (end, w, v, y)));
                }
            }
        }
    }
    for (end, w, v, y) in unique(found) {
        if search.separates_with(v, end, y)? {
            proposals.tail(v, y);
            proposals.head(y, v);
        } else if search.graph.get(w, v).is_some_and(|wv| wv.right != Conflict)
            && search.separates_without(v, end, y)?
        {
            for (a, b) in [(v, y), (w, v)] {
                proposals.head(a, b);
                proposals.head(b, a);
            }
        }
    }
    Ok(())
}

fn is_final_parent(search: &Search<'_, '_>, w: Node, y: Node) -> bool {
    search.graph.get(w, y).is_some_and(|wy| wy.is_final() && wy.left == Tail && wy.right == Head)
}

/// Where discriminating paths end that begin with Y, V and W: they go on to every node that points to their end, as long as those
/// are parents of Y, and end in a node that is not adjacent to Y. What a node needs does not depend on those before it, so each is
/// looked at once.
fn ends_of_discriminating_paths(
    search: &Search<'_, '_>,
    [y, v, w]: [Node; 3],
) -> impl Iterator<Item = Node> + use<> {
    let (mut seen, mut ends, mut open) = (HashSet::from([y, v, w]), Vec::new(), vec![w]);
    while let Some(last) = open.pop() {
        for (next, link) in search.graph.neighbours(last) {
            if !link.is_final() || link.right != Head || seen.contains(&next) {
                continue;
            }
            if !search.graph.adjacent(next, y) {
                ends.push(next);
            } else if link.left == Head && is_final_parent(search, next, y) {
                seen.insert(next);
                open.push(next);
            }
        }
    }
    ends.into_iter()
}

/// A o*> C, and an uncovered potentially directed path from a neighbour of A to C that A is part of: A --> C.
pub(super) fn r9(search: &mut Search<'_, '_>, proposals: &mut Proposals) -> Result<()> {
    for (a, c) in open_causes(search, proposals) {
        let neighbours: Vec<(Node, Link)> = search.graph.neighbours(a).collect();
        for (b, ba) in neighbours {
            let circle_here = ba.right == Circle && matches!(ba.left, Circle | Head);
            let tail_here = ba.right == Tail && ba.left == Head;
            if b == c || !(circle_here || tail_here) || search.graph.adjacent(b, c) {
                continue;
            }
            let directed = ba.left == Head;
            let mut is_part = None;
            let holds = &mut |search: &mut Search<'_, '_>, path: &[Node]| {
                if path.len() < 3 || search.graph.adjacent(path[1], a) {
                    return Ok(Some(2));
                }
                if is_part.is_none() {
                    is_part = Some(search.separates_with(a, b, c)?);
                }
                if is_part == Some(false) {
                    return Ok(Some(0));
                }
                if directed {
                    return Ok(None);
                }
                match search.separates_with(path[0], a, path[1])? {
                    true => fault_within(search, path),
                    false => Ok(Some(2)),
                }
            };
            if Paths::new(c, a, None).find(search, &Start { path: vec![b], directed }, holds)? {
                proposals.tail(a, c);
            }
        }
    }
    Ok(())
}

/// A o*> C, and two uncovered potentially directed paths from A over parents of C that start apart: A --> C.
pub(super) fn r10(search: &mut Search<'_, '_>, proposals: &mut Proposals) -> Result<()> {
    for (a, c) in open_causes(search, proposals) {
        let is_parent = |(_, link): &(Node, Link)| link.left == Tail && link.right == Head;
        let parents: Vec<(Node, Link)> = search.graph.neighbours(c).filter(is_parent).collect();
        let mut seconds = Vec::new();
        for (p, _) in parents.into_iter().filter(|(p, _)| *p != a) {
            let mut paths = Paths::new(p, c, Some(c));
            for (second, directed) in paths.steps(search, &[a], false) {
                let holds = &mut |search: &mut Search<'_, '_>, path: &[Node]| {
                    let whole = [path, &[c]].concat();
                    if path.len() < 3 { Ok(Some(0)) } else { fault_within(search, &whole) }
                };
                let start = Start { path: vec![a, second], directed };
                if second != p && paths.find(search, &start, holds)? {
                    seconds.push(second);
                }
            }
        }
        let seconds = unique(seconds);
        for (k, &m) in seconds.iter().enumerate() {
            for &n in &seconds[k + 1..] {
                if !search.graph.adjacent(m, n) && search.separates_with(a, m, n)? {
                    proposals.tail(a, c);
                }
            }
        }
    }
    Ok(())
}

/// A o*> C.
fn open_causes(search: &Search<'_, '_>, proposals: &Proposals) -> Vec<(Node, Node)> {
    let nodes = search.graph.nodes();
    let of = |c: Node| search.graph.neighbours(c).map(move |(a, link)| (a, c, link));
    let open = |&(a, c, link): &(Node, Node, Link)| {
        link.left == Circle && link.right == Head && proposals.may_orient(a, c)
    };
    nodes.flat_map(of).filter(open).map(|(a, c, _)| (a, c)).collect()
}

/// Steps after which paths are no longer looked at one by one.
const FEW_STEPS: usize = 2000;

/// From a node to the next, and whether the path is directed from there on.
type Step = (Node, Node, bool);
/// How long the part of a path is that fails; `None` if it holds.
type Holds<'a> = dyn FnMut(&mut Search<'_, '_>, &[Node]) -> Result<Option<usize>> + 'a;

/// How a path begins.
struct Start {
    path: Vec<Node>,
    directed: bool,
}

/// The search for an uncovered potentially directed path to `end`: o*o, o*> or -*> up to the first step that is not o*o, then -*>.
///
/// There may be more such paths than can be looked at, so what is known to fail is not tried again: three nodes one after the other of
/// which the middle one separates nothing. After [`FEW_STEPS`] only the shortest of what is left is tried, again and again. Where that
/// one would go through a node twice, there is none as far as this search knows: a link stays as it is.
struct Paths {
    end: Node,
    /// What the path does not go through.
    avoided: Node,
    /// The node that the whole path has after its end.
    beyond: Option<Node>,
    steps: usize,
    /// Three nodes that fail, and second nodes of a path that do.
    failed: HashSet<[Node; 3]>,
    failed_seconds: HashSet<Node>,
    /// The length of the longest part of the path that may still lead somewhere.
    alive: usize,
}

impl Paths {
    fn new(end: Node, avoided: Node, beyond: Option<Node>) -> Self {
        let (failed, failed_seconds) = (HashSet::new(), HashSet::new());
        Self { end, avoided, beyond, steps: 0, failed, failed_seconds, alive: usize::MAX }
    }

    /// The nodes that may follow, and whether the path is directed from there on.
    fn steps(&self, search: &Search<'_, '_>, path: &[Node], directed: bool) -> Vec<(Node, bool)> {
        let Some(&last) = path.last() else { return Vec::new() };
        let before = path.len().checked_sub(2).map(|at| path[at]);
        let may_follow = |next: Node, link: Link| {
            // The link is read from the next node back to the last one.
            let fits = match (link.right, link.left) {
                (Tail, Head) => true,
                (Circle, Circle | Head) => !directed,
                _ => false,
            };
            let goes_on = |before: Node| {
                !search.graph.adjacent(before, next) && !self.failed.contains(&[before, last, next])
            };
            let ends_well = |beyond: Node| {
                next != self.end
                    || !search.graph.adjacent(last, beyond) && !self.failed.contains(&[last, next, beyond])
            };
            let begins = path.len() > 1 || !self.failed_seconds.contains(&next);
            next != self.avoided
                && fits
                && begins
                && before.is_none_or(goes_on)
                && self.beyond.is_none_or(ends_well)
        };
        let following = search.graph.neighbours(last).filter(|(next, link)| may_follow(*next, *link));
        following.map(|(next, link)| (next, directed || link.left == Head)).collect()
    }

    /// Whether a path from `start` on comes to the end such that it `holds`.
    fn find(&mut self, search: &mut Search<'_, '_>, start: &Start, holds: &mut Holds<'_>) -> Result<bool> {
        (self.steps, self.alive) = (0, usize::MAX);
        if self.go_on(search, &mut start.path.clone(), start.directed, holds)? {
            return Ok(true);
        }
        if self.steps <= FEW_STEPS {
            return Ok(false);
        }
        while let Some(path) = self.shortest(search, start) {
            search.run.control().check()?;
            let distinct: HashSet<&Node> = path.iter().collect();
            if distinct.len() < path.len() {
                return Ok(false);
            }
            match holds(search, &path)? {
                None => return Ok(true),
                Some(length) if length <= start.path.len() => return Ok(false),
                Some(length) => self.remember(&path, length),
            }
        }
        Ok(false)
    }

    /// Tries all paths that go on from this one, until the steps are too many.
    fn go_on(
        &mut self,
        search: &mut Search<'_, '_>,
        path: &mut Vec<Node>,
        directed: bool,
        holds: &mut Holds<'_>,
    ) -> Result<bool> {
        for (next, then_directed) in self.steps(search, path, directed) {
            if path.contains(&next) {
                continue;
            }
            self.steps += 1;
            if self.steps > FEW_STEPS {
                self.alive = 0;
                return Ok(false);
            }
            path.push(next);
            let found = if next != self.end {
                self.go_on(search, path, then_directed, holds)?
            } else if let Some(length) = holds(search, path)? {
                self.remember(path, length);
                self.alive = length.min(path.len());
                false
            } else {
                true
            };
            path.pop();
            if found {
                return Ok(true);
            }
            if path.len() >= self.alive {
                return Ok(false);
            }
            self.alive = usize::MAX;
        }
        Ok(false)
    }

    /// Keeps in mind that the first nodes of a path fail, as many as `length`.
    fn remember(&mut self, path: &[Node], length: usize) {
        let whole: Vec<Node> = path.iter().copied().chain(self.beyond).take(length).collect();
        match whole.as_slice() {
            [_, second] => drop(self.failed_seconds.insert(*second)),
            [.., before, middle, after] => drop(self.failed.insert([*before, *middle, *after])),
            _ => {}
        }
    }

    /// The path with the fewest steps to the end that is not known to fail. It may go through a node twice.
    fn shortest(&self, search: &Search<'_, '_>, start: &Start) -> Option<Vec<Node>> {
        let mut before: HashMap<Step, Option<Step>> = HashMap::new();
        let mut open = VecDeque::from([(start.path.clone(), start.directed, None)]);
        while let Some((path, directed, step)) = open.pop_front() {
            let last = *path.last()?;
            for (next, then_directed) in self.steps(search, &path, directed) {
                let then = (last, next, then_directed);
                if before.contains_key(&then) {
                    continue;
                }
                before.insert(then, step);
                if next == self.end {
                    let back = std::iter::successors(Some(then), |step| before.get(step).copied().flatten());
                    let mut nodes: Vec<Node> = back.map(|(_, node, _)| node).collect();
                    nodes.extend(start.path.iter().rev());
                    nodes.reverse();
                    return Some(nodes);
                }
                open.push_back((vec![last, next], then_directed, Some(then)));
            }
        }
        None
    }
}

/// The length of the part of the path that fails: an inner node, from the left until a step has a head at its far end, is not in what
/// separates its neighbours. `None`: none fails.
fn fault_within(search: &mut Search<'_, '_>, path: &[Node]) -> Result<Option<usize>> {
    for (at, three) in path.windows(3).enumerate() {
        let [before, middle, after] = three else { continue };
        if search.graph.get(*before, *middle).is_some_and(|link| link.right == Head) {
            return Ok(None);
        }
        if !search.separates_with(*middle, *before, *after)? {
            return Ok(Some(at + 3));
        }
    }
    Ok(None)
}
