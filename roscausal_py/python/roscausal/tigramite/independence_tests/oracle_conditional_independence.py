"""`OracleCI`: what a known graph says."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ... import _native
from ..refusal import not_covered
from ..results import graph_as_dict, graph_of_links, link_list


class OracleCI:
    """The independence test that knows the graph: separation in `{j: [((i, -lag), coefficient, function), ..]}`.

    Args:
        links: The graph, or one of the other forms of `get_graph_from_dict`.
        observed_vars: Variables that the data have, in their order; None: all.
        graph: The same as marks (N, N, tau_max + 1).

    Example:
        >>> from roscausal.tigramite.independence_tests.oracle_conditional_independence import OracleCI
        >>> OracleCI({0: [], 1: [((0, -1), 1.0, None)]}).run_test([(0, -1)], [(1, 0)])
        (1.0, 0.0)
    """

    measure = "oracle_ci"

    def __init__(
        self, links: Mapping[int, Any] | None = None, observed_vars: Sequence[int] | None = None,
        selection_vars: Sequence[int] | None = None, graph: Any = None, graph_is_mag: bool = False, tau_max: int | None = None,
        verbosity: int = 0,
    ) -> None:  # fmt: skip
        not_covered(selection_vars=list(selection_vars or []) or None, graph_is_mag=graph_is_mag)
        marks = graph_of_links(links or {}) if graph is None else np.asarray(graph)
        n, lags = marks.shape[0], marks.shape[2]
        self.observed_vars = list(range(n)) if observed_vars is None else list(observed_vars)
        known = {j: {node: mark for node, mark in of.items() if mark != "<--"} for j, of in graph_as_dict(marks).items()}
        self._truth = json.dumps({"links": link_list(known, 0, lags), "n_vars": n})
        self._names = [str(k) for k in range(n)]

    def set_dataframe(self, dataframe: object) -> None:
        """Ignored: the oracle needs no data."""

    def run_test(
        self, X: Any, Y: Any, Z: Any = None, tau_max: int = 0, cut_off: str = "2xtau_max", alpha_or_thres: float | None = None
    ) -> Any:
        """Whether X and Y are connected given Z: (1, 0) or (0, 1), and the decision if `alpha_or_thres` is given."""
        x, y, *z = [(self.observed_vars[var], -lag) for var, lag in (X[0], Y[0], *(Z or []))]
        lag = max(lag for _, lag in (x, y, *z))
        frame = _native.Frame([np.zeros((2 * lag + 50, len(self._names)))], self._names)
        value, p_value, *_ = _native.run_test(frame, self._truth, x, y, z, lag)
        return (value, p_value) if alpha_or_thres is None else (value, p_value, p_value <= alpha_or_thres)
