"""Acyclic graphs with arrows and `<->` (a hidden cause of both), on nodes (variable, -lag): m-separation and adjustment sets.

Perkovic et al. 2018 (which sets are valid), Runge 2021 (the optimal one), van der Zander et al. 2014 (validity as one separation):
1. mediators M: nodes on causal paths from X to Y that meet X only at their start;
2. forbidden: X, and the descendants of Y and M; `valid`: ancestors of X, Y and S that are not forbidden; if they do not adjust, nothing does;
3. the optimal set: parents of Y and M; the nodes C of their collider paths `W <-> C1 <-> C2 ..`, each of them valid or separated from X by
   the valid ones; and the parents of these; without forbidden ones.

Example: `x --> y`, `x <-> z`, `z <-> y`, `z --> x`: no set is valid, since z is a collider and a cause. Without `z <-> y` it is {}.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Set

Node = tuple[int, int]


class Graph:
    """Nodes with their parents and siblings (at the other end of a `<->`)."""

    def __init__(self) -> None:
        self.parents: dict[Node, set[Node]] = defaultdict(set)
        self.children: dict[Node, set[Node]] = defaultdict(set)
        self.siblings: dict[Node, set[Node]] = defaultdict(set)

    def arrow(self, cause: Node, effect: Node) -> None:
        self.parents[effect].add(cause)
        self.children[cause].add(effect)

    def both(self, a: Node, b: Node) -> None:
        self.siblings[a].add(b)
        self.siblings[b].add(a)

    def hide(self, node: Node) -> None:
        """Leaves a node out and keeps what it says of the others: its causes become those of its effects, which become siblings."""
        causes, effects, siblings = (list(of.pop(node, ())) for of in (self.parents, self.children, self.siblings))
        for end, links in ((causes, self.children), (effects, self.parents), (siblings, self.siblings)):
            for other in end:
                links[other].discard(node)
        for number, effect in enumerate(effects):
            for cause in causes:
                self.arrow(cause, effect)
            for other in (*siblings, *effects[:number]):
                if other != effect:
                    self.both(other, effect)

    def ancestors(self, nodes: Iterable[Node]) -> set[Node]:
        return _reach(nodes, self.parents)

    def descendants(self, nodes: Iterable[Node]) -> set[Node]:
        return _reach(nodes, self.children)

    def mediators(self, x: Set[Node], y: Set[Node], wall: Set[Node]) -> set[Node]:
        """Nodes on the paths from x to y that do not come to `wall`, with those of y that x reaches."""
        return (_reach(x, self.children, wall) & _reach(y, self.parents, wall)) - x

    def separated(self, x: Set[Node], y: Set[Node], given: Set[Node], without: Set[Node] = frozenset()) -> bool:
        """Whether `given` blocks all paths; `without`: on which no path begins with an arrow from x into one of these."""
        above = self.ancestors(given)
        open_nodes: list[tuple[Node, bool]] = []
        seen = set()

        def go(node: Node, arrowhead: bool, first: bool = False) -> None:
            ends = [(parent, False, True) for parent in self.parents[node]]
            ends += [(child, True, False) for child in self.children[node] if not (first and child in without)]
            ends += [(sibling, True, True) for sibling in self.siblings[node]]
            for other, arrives, leaves_by_arrowhead in ends:
                passes = first or (node in above if arrowhead and leaves_by_arrowhead else node not in given)
                if passes and (other, arrives) not in seen and other not in x:
                    seen.add((other, arrives))
                    open_nodes.append((other, arrives))

        for start in x - given:
            go(start, False, first=True)
        while open_nodes:
            go(*open_nodes.pop())
        return not any(node in y for node, _ in seen)


class Adjustment:
    """Which sets make the effect of X on Y, given S, a regression."""

    def __init__(self, graph: Graph, x: Set[Node], y: Set[Node], s: Set[Node]) -> None:
        self.graph, self.x, self.y, self.s = graph, x, y, s
        self.between = graph.mediators(x, y, x)
        self.mediators = self.between - y
        self.forbidden = x | graph.descendants(self.mediators | y)
        self.valid = graph.ancestors(x | y | s) - self.forbidden
        self.identified = self.adjusts(self.valid)

    def adjusts(self, given: Set[Node]) -> bool:
        """Whether the set, with S, blocks all paths from X to Y but the causal ones."""
        return self.graph.separated(self.x, self.y, given | self.s, self.between)

    def optimal(self) -> tuple[set[Node], set[Node]]:
        """Parents of Y and M, and what collider paths add; each without S."""
        ends, colliders = self.mediators | self.y, set[Node]()
        waiting = list(ends)
        while waiting:
            for node in self.graph.siblings[waiting.pop()] - self.forbidden - colliders:
                if node in self.valid or self.graph.separated(self.x, {node}, self.valid):
                    colliders.add(node)
                    waiting.append(node)
        parents, more = ({parent for node in of for parent in self.graph.parents[node]} for of in (ends, colliders))
        parents -= self.forbidden | self.s
        return parents, (colliders | more) - self.forbidden - self.s - parents

    def least(self, among: Set[Node], rest: Set[Node] = frozenset()) -> set[Node]:
        """`among`, which adjusts with `rest`, without nodes that it can do without, until each is needed."""
        for node in sorted(among):
            if self.adjusts((among | rest) - {node}):
                return self.least(among - {node}, rest)
        return set(among)


def _reach(nodes: Iterable[Node], links: dict[Node, set[Node]], wall: Set[Node] = frozenset()) -> set[Node]:
    seen = set(nodes)
    waiting = list(seen)
    while waiting:
        new = links[waiting.pop()] - seen - wall
        seen |= new
        waiting += new
    return seen
