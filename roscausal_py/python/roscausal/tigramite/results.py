"""What runs return, and what is made of it: graphs, lists of links, summaries of many runs, text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._native import SettingError, visible
from .refusal import NotCovered

#: Marks by the engine's numbers.
MARKS = np.array(
    ["", "-->", "<--", "o-o", "x-x", "o->", "<-o", "<->", "x->", "<-x", "o-x", "x-o", "--x", "x--", "--o", "o--", "---"],
    dtype="<U3",
)

Links = Mapping[int, Mapping[tuple[int, int], str]]


def link_list(assumptions: Links | None, tau_min: int, tau_max: int, hidden: bool = False) -> list[list[Any]] | None:
    """The engine's list of `{effect: {(cause, -lag): mark}}`, within these lags. `hidden`: there may be hidden causes."""
    if assumptions is None:
        return None
    links: list[list[Any]] = []
    for effect, causes in assumptions.items():
        for (cause, lag), mark in causes.items():
            if lag > 0:
                raise SettingError(f"setting 'link_assumptions': ({cause}, {lag}) is in the future; lags are 0 or less")
            # The past drives the present: of a lagged link only counts whether it is certain.
            if lag < 0 and not hidden and mark in ("o?o", "o-o"):
                mark = "-?>" if mark == "o?o" else "-->"
            if mark != "" and tau_min <= -lag <= tau_max:
                links.append([int(cause), int(effect), -int(lag), mark])
    return links


def graph_of_p(
    p_matrix: NDArray[Any], alpha_level: float, tau_min: int, tau_max: int, link_assumptions: Links | None
) -> NDArray[np.str_]:
    """Marks (N, N, tau_max + 1) of the links whose p-value is at most the level."""
    p_values = np.asarray(p_matrix)
    graph = np.full(p_values.shape, "", dtype="<U3")
    there = p_values <= alpha_level
    lags = np.arange(p_values.shape[2])
    there[:, :, (lags < tau_min) | (lags > tau_max)] = False
    np.fill_diagonal(there[:, :, 0], False)
    graph[there] = "-->"
    graph[:, :, 0][there[:, :, 0]] = "o-o"
    if link_assumptions is not None:
        allowed = np.full(p_values.shape, "", dtype="<U3")
        for cause, effect, lag, mark in link_list(link_assumptions, tau_min, tau_max) or []:
            mark = mark.replace("?", "-")
            allowed[cause, effect, lag] = mark
            if lag == 0:
                allowed[effect, cause, 0] = {"-->": "<--", "<--": "-->"}.get(mark, mark)
        graph = np.where(graph != "", allowed, "").astype("<U3")
    return graph


def graph_of_links(links: Mapping[int, Any], tau_max: int | None = None) -> NDArray[np.str_]:
    """Marks (N, N, tau_max + 1) of nodes, of nodes with coefficients and functions, or of nodes with marks."""
    marked = {}
    for effect, causes in links.items():
        for cause in causes:
            var, lag = cause[0] if isinstance(cause[0], tuple) else cause
            marked[int(var), int(effect), abs(int(lag))] = causes[cause] if isinstance(causes, Mapping) else "-->"
    n, longest = len(links), max((lag for *_, lag in marked), default=0)
    graph = np.full((n, n, 1 + (longest if tau_max is None else tau_max)), "", dtype="<U3")
    for (cause, effect, lag), mark in marked.items():
        graph[cause, effect, lag] = mark
        if lag == 0:
            graph[effect, cause, 0] = {"-->": "<--", "<--": "-->"}.get(mark, mark)
    return graph


def graph_as_dict(graph: NDArray[Any]) -> dict[int, dict[tuple[int, int], str]]:
    """`{effect: {(cause, -lag): mark}}`."""
    links: dict[int, dict[tuple[int, int], str]] = {effect: {} for effect in range(graph.shape[0])}
    for cause, effect, lag in zip(*np.where(np.asarray(graph) != "")):
        links[int(effect)][int(cause), -int(lag)] = str(graph[cause, effect, lag])
    return links


def parents_of(graph: NDArray[Any], val_matrix: NDArray[Any], lagzero: bool) -> dict[int, list[tuple[int, int]]]:
    """The parents of each variable, the strongest first."""
    parents = {}
    for effect, links in graph_as_dict(graph).items():
        found = [node for node, mark in links.items() if mark == "-->" and (node[1] < 0 or lagzero)]
        parents[effect] = sorted(found, key=lambda node: -abs(val_matrix[node[0], effect, -node[1]]))
    return parents


def summary(results: Mapping[str, Any], conf_lev: float = 0.9, aggregation: str = "majority") -> dict[str, Any]:
    """The most frequent marks of many runs, how frequent they are, mean values and intervals."""
    if aggregation != "majority":
        raise NotCovered(f"aggregation='{aggregation}' is not covered by roscausal.tigramite; it has 'majority'")
    graphs = np.asarray(results["graph"])
    counts = {mark: (graphs == mark).sum(axis=0) for mark in np.unique(graphs)}
    most = np.max(list(counts.values()), axis=0)
    tied = {mark: count == most for mark, count in counts.items()}
    low, high = (1 - conf_lev) / 2, (1 + conf_lev) / 2
    values = np.asarray(results["val_matrix"])
    return {
        "most_frequent_links": _winner(tied, most.shape),
        "link_frequency": np.sum(list(tied.values()), axis=0) * most / graphs.shape[0],
        "val_matrix_mean": values.mean(axis=0),
        "val_matrix_interval": np.stack([np.quantile(values, q, axis=0) for q in (low, high)], axis=3),
    }


def joined(runs: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The results of many runs: matrices with the run as first axis, all else by the number of the run."""
    arrays = ("graph", "p_matrix", "val_matrix")
    every: dict[str, Any] = {name: np.stack([run[name] for run in runs]) for name in arrays}
    others = [name for name in runs[0] if name not in arrays]
    return {**every, **{name: {k: run[name] for k, run in enumerate(runs)} for name in others}}


def _winner(tied: Mapping[str, NDArray[Any]], shape: tuple[int, ...]) -> NDArray[np.str_]:
    """The mark of the most frequent ones that counts: no link before x-x before o-o; --> and <-- together are x-x."""
    nowhere = np.zeros(shape, dtype=bool)
    forward, back = tied.get("-->", nowhere), tied.get("<--", nowhere)
    winner = np.where(forward & back, "x-x", np.where(forward, "-->", "<--")).astype("<U3")
    for mark in ("o-o", "x-x", ""):
        winner[tied.get(mark, nowhere)] = mark
    return winner


def text(
    names: Sequence[str],
    p_matrix: NDArray[Any],
    val_matrix: NDArray[Any],
    conf_matrix: NDArray[Any] | None,
    graph: NDArray[Any],
    alpha_level: float,
) -> str:
    """The links as lines, in the reference's layout."""
    names = [visible(str(name)) for name in names]
    lines = [f"\n## Significant links at alpha = {alpha_level}:"]
    for effect, links in graph_as_dict(graph).items():
        strength = {node: abs(val_matrix[node[0], effect, -node[1]]) for node in links}
        lines.append(f"\n    Variable {names[effect]} has {len(links)} link(s):")
        for cause, lag in sorted(links, key=lambda node: -strength[node]):
            at = (cause, effect, -lag)
            line = f"        ({names[cause]} {lag}): pval = {p_matrix[at]:.5f} | val = {val_matrix[at]: .3f}"
            if conf_matrix is not None:
                line += f" | conf = ({conf_matrix[at][0]:.3f}, {conf_matrix[at][1]:.3f})"
            note = {"o-o": " | unoriented link", "x-x": " | unclear orientation due to conflict"}
            lines.append(line + note.get(links[cause, lag], ""))
    return "\n".join(lines)
