"""`structural_causal_process`, `var_process`: series of a known graph."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..._native import SettingError
from ..refusal import NotCovered, missing, not_covered
from ..results import graph_as_dict, graph_of_links

Links = Mapping[int, Sequence[tuple[tuple[int, int], float, Callable[[Any], Any]]]]
__getattr__ = missing(__name__, "check_stationarity", "generate_structural_causal_process")
#: Marks (N, N, tau_max + 1) of a toy model.
links_to_graph = graph_of_links


def structural_causal_process(
    links: Links, T: int, noises: Sequence[Callable[[int], Any]] | NDArray[Any] | None = None,
    intervention: Mapping[int, Any] | None = None, intervention_type: str | Mapping[int, str] = "hard",
    transient_fraction: float = 0.2, seed: int | None = None,
) -> tuple[NDArray[np.float32], bool]:  # fmt: skip
    """T times of `x_j(t) = sum of coefficient * function(x_i(t - lag)) + noise_j(t)`, and whether they run away.

    `noises` are functions of the number of times, or their values; an intervention is T values per variable, NaN where there is none.
    """
    n, first = len(links), int(np.floor(transient_fraction * T))
    random = np.random.RandomState(seed)
    noises = [random.randn for _ in range(n)] if noises is None else noises
    rows = noises if isinstance(noises, np.ndarray) else np.stack([noise(T + first) for noise in noises], axis=1)
    x = np.array(rows, dtype=np.float32)  # as the reference's
    order: list[int] = []
    before = {j: {node[0] for node, *_ in links[j] if node[1] == 0} for j in range(n)}
    while len(order) < n:
        ready = [j for j in range(n) if j not in order and before[j] <= set(order)]
        if not ready:
            raise SettingError("setting 'links': the links at lag 0 go round in a circle")
        order += ready
    done, nowhere = {}, np.full(T + first, np.nan)
    for j, values in (intervention or {}).items():
        padded = nowhere.copy()
        padded[first:] = values
        done[j] = padded, intervention_type if isinstance(intervention_type, str) else intervention_type[j]
    for t in range(max((-node[1] for of in links.values() for node, *_ in of), default=0), T + first):
        for j in order:
            imposed, how = done.get(j, (nowhere, ""))
            if how == "hard" and not np.isnan(imposed[t]):
                x[t, j] = imposed[t]
                continue
            x[t, j] += np.nan_to_num(imposed[t])
            for (i, lag), coefficient, function in links[j]:
                x[t, j] += coefficient * function(x[t + lag, i])
    x = x[first:]
    return x, bool(np.any(~np.isfinite(x)) or np.max(np.abs(x)) > 1e100)


def structural_causal_process_ensemble(
    realizations: int = 10, ensemble_seed: int | None = None, **given: Any
) -> tuple[NDArray[np.float32], bool]:
    """So many of `structural_causal_process`, (realizations, T, N), and whether one runs away."""
    seeds = [None if ensemble_seed is None else ensemble_seed * realizations + number for number in range(realizations)]
    series, away = zip(*(structural_causal_process(**given, seed=seed) for seed in seeds))
    return np.stack(series), any(away)


def var_process(
    parents_neighbors_coeffs: Mapping[int, Sequence[tuple[tuple[int, int], float]]], T: int = 1000, use: str = "inv_inno_cov",
    verbosity: int = 0, initial_values: None = None,
) -> tuple[NDArray[np.float64], dict[int, list[tuple[int, int]]]]:  # fmt: skip
    """T times of a linear process with lagged causes `{j: [((i, -lag), coefficient), ..]}` and unit noise of `np.random`; and its parents."""
    not_covered(use=None if use == "inv_inno_cov" else use, initial_values=initial_values)
    parents = {j: [(i, lag) for (i, lag), _ in of] for j, of in parents_neighbors_coeffs.items() if of}
    longest = max((-lag for of in parents.values() for _, lag in of), default=0)
    if any(lag == 0 for of in parents.values() for _, lag in of):
        raise NotCovered("noise that depends at lag 0 is not covered by roscausal.tigramite; use structural_causal_process")
    x = np.random.randn(len(parents_neighbors_coeffs), T).T
    # The first rows stay as they are, like the reference's.
    x[longest + 1 :] = np.random.randn(T, x.shape[1])[longest + 1 :]
    for t in range(longest + 1, T):
        for j, of in parents_neighbors_coeffs.items():
            x[t, j] += sum(coefficient * x[t + lag, i] for (i, lag), coefficient in of)
    return x, parents


def dag_to_links(dag: NDArray[Any]) -> dict[int, list[tuple[int, int]]]:
    """The parents `{j: [(i, -lag), ..]}` in a graph of marks."""
    return {j: [node for node, mark in of.items() if mark == "-->"] for j, of in graph_as_dict(dag).items()}


def _get_true_parent_neighbor_dict(links: Links) -> dict[int, list[tuple[int, int]]]:
    return {j: [(int(i), int(lag)) for (i, lag), coefficient, *_ in of if coefficient != 0] for j, of in links.items()}
