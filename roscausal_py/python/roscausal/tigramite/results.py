"""What runs return, and what is made of it: graphs, lists of links, summaries of many runs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._native import SettingError
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


def marked(shape: tuple[int, ...], marks: Mapping[tuple[int, int, int], str]) -> NDArray[np.str_]:
    """The graph of these marks by (cause, effect, lag), at lag 0 from both sides."""
    graph = np.full(shape, "", dtype="<U3")
    for (cause, effect, lag), mark in marks.items():
        graph[cause, effect, lag] = mark
        if lag == 0:
            graph[effect, cause, 0] = {"-->": "<--", "<--": "-->"}.get(mark, mark)
    return graph


def graph_of_links(links: Mapping[int, Any], tau_max: int | None = None) -> NDArray[np.str_]:
    """The graph, marks (N, N, tau_max + 1), of `{j: [(i, -lag), ..]}`, of `{j: [((i, -lag), coefficient, function), ..]}`, or of marks."""
    marks = {}
    for effect, causes in links.items():
        for cause in causes:
            var, lag = cause[0] if isinstance(cause[0], tuple) else cause
            marks[int(var), int(effect), abs(int(lag))] = causes[cause] if isinstance(causes, Mapping) else "-->"
    n, longest = len(links), max((lag for *_, lag in marks), default=0)
    return marked((n, n, 1 + (longest if tau_max is None else tau_max)), marks)


def graph_as_dict(graph: NDArray[Any]) -> dict[int, dict[tuple[int, int], str]]:
    """The graph as `{j: {(i, -lag): mark}}`."""
    links: dict[int, dict[tuple[int, int], str]] = {effect: {} for effect in range(graph.shape[0])}
    for cause, effect, lag in zip(*np.where(np.asarray(graph) != "")):
        links[int(effect)][int(cause), -int(lag)] = str(graph[cause, effect, lag])
    return links


def strongest_first(nodes: Iterable[tuple[int, int]], effect: int, val_matrix: NDArray[Any]) -> list[tuple[int, int]]:
    """Causes of an effect by the size of their values."""
    return sorted(nodes, key=lambda node: -abs(val_matrix[node[0], effect, -node[1]]))


def interval(found: Any, conf_lev: float) -> NDArray[np.float64]:
    """The interval of this level of what many runs found, the run as first axis: [low, high]."""
    return np.asarray(np.quantile(found, [(1 - conf_lev) / 2, (1 + conf_lev) / 2], axis=0))


def summary(results_of_runs: Mapping[str, Any], conf_lev: float = 0.9, aggregation: str = "majority") -> dict[str, Any]:
    """The most frequent marks of runs (`graph` and `val_matrix` with the run as first axis), how frequent they are, mean values and intervals:
    `most_frequent_links`, `link_frequency`, `val_matrix_mean` (N, N, tau_max + 1); `val_matrix_interval` (.., 2)."""
    if aggregation != "majority":
        raise NotCovered(f"aggregation='{aggregation}' is not covered by roscausal.tigramite; it has 'majority'")
    graphs = np.asarray(results_of_runs["graph"])
    counts = {mark: (graphs == mark).sum(axis=0) for mark in np.unique(graphs)}
    most = np.max(list(counts.values()), axis=0)
    tied = {mark: count == most for mark, count in counts.items()}
    values = np.asarray(results_of_runs["val_matrix"])
    return {
        "most_frequent_links": _winner(tied, most.shape),
        "link_frequency": np.sum(list(tied.values()), axis=0) * most / graphs.shape[0],
        "val_matrix_mean": values.mean(axis=0),
        "val_matrix_interval": np.stack([*interval(values, conf_lev)], axis=3),
    }


def joined(runs: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The results of many runs: matrices with the run as first axis, all else by the number of the run."""
    arrays = ("graph", "p_matrix", "val_matrix")
    every: dict[str, Any] = {name: np.stack([run[name] for run in runs]) for name in arrays}
    return {**every, **{name: {k: run[name] for k, run in enumerate(runs)} for name in runs[0] if name not in arrays}}


def _winner(tied: Mapping[str, NDArray[Any]], shape: tuple[int, ...]) -> NDArray[np.str_]:
    """The mark of the most frequent ones that counts: no link before x-x before o-o; --> and <-- together are x-x."""
    nowhere = np.zeros(shape, dtype=bool)
    forward, back = tied.get("-->", nowhere), tied.get("<--", nowhere)
    winner = np.where(forward & back, "x-x", np.where(forward, "-->", "<--")).astype("<U3")
    for mark in ("o-o", "x-x", ""):
        winner[tied.get(mark, nowhere)] = mark
    return winner
