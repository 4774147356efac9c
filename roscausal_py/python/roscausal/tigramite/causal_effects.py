"""`CausalEffects`: total effects of a graph without hidden variables, by adjustment and by paths (Perkovic 2018, Runge 2021, Wright 1921)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import deepcopy
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _native
from .._native import DataError, SettingError
from .models import slopes
from .refusal import NotCovered, not_covered
from .results import graph_of_links

Node = tuple[int, int]


class CausalEffects:
    """The effect of setting X on Y.

    Args:
        graph: Marks (N, N), or (N, N, tau_max + 1) as [cause, effect, lag], of --> (and <-- at lag 0) alone.
        graph_type: "dag" or "stationary_dag".
        X: Causes `[(i, -lag), ..]`.
        Y: The effect, `[(j, 0)]`.

    Attributes:
        M: Nodes on the paths from X to Y.
        no_causal_path: Whether none leads there.
        tau_max: The largest lag of a sample.

    Raises:
        NotImplementedError: Other marks or graph types, conditions S, hidden variables, several effects.

    Example:
        >>> import numpy as np
        >>> from roscausal.tigramite import data_processing as pp
        >>> from roscausal.tigramite.causal_effects import CausalEffects
        >>> x = np.random.default_rng(1).normal(size=(2000, 3))
        >>> x[1:, 1:] += 0.5 * x[:-1, :1]
        >>> x[1:, 2] += 0.5 * x[:-1, 1]
        >>> graph = CausalEffects.get_graph_from_dict({0: [], 1: [(0, -1)], 2: [(0, -1), (1, -1)]})
        >>> effects = CausalEffects(graph, graph_type="stationary_dag", X=[(1, -1)], Y=[(2, 0)])
        >>> effects.get_optimal_set()
        [(0, -1)]
        >>> effects.fit_wright_effect(pp.DataFrame(x)).predict_wright_effect(np.array([[0.0], [2.0]])).round(0).tolist()
        [[0.0], [1.0]]
    """

    def __init__(
        self, graph: ArrayLike, graph_type: str, X: Sequence[Node], Y: Sequence[Node], S: None = None, hidden_variables: None = None,
        check_SM_overlap: bool = True, verbosity: int = 0,
    ) -> None:  # fmt: skip
        not_covered(S=S, hidden_variables=hidden_variables)
        marks = np.asarray(graph)
        if graph_type not in ("dag", "stationary_dag") or len(Y) != 1 or not set(np.unique(marks)) <= {"", "-->", "<--"}:
            what = f"graph_type='{graph_type}' with {len(Y)} effects and marks {' '.join(map(str, np.unique(marks)))}"
            raise NotCovered(f"{what} is not covered by roscausal, which has one effect in a graph of --> ; tigramite.causal_effects takes our frames")
        if marks.ndim != (2 if graph_type == "dag" else 3):
            raise SettingError(f"setting 'graph': its shape {marks.shape} is none of graph_type='{graph_type}'")
        self.graph = marks[:, :, np.newaxis] if marks.ndim == 2 else marks
        self.N: int = len(self.graph)
        self.X, self.Y = [(int(i), int(lag)) for i, lag in X], [(int(j), int(lag)) for j, lag in Y]
        if any(lag > 0 for _, lag in self.X + self.Y):
            raise SettingError("setting 'X': lags of X and Y are 0 or less")
        arrows = [tuple(map(int, at)) for at in np.argwhere(self.graph == "-->")]
        self._parents = {j: [(i, -lag) for i, effect, lag in arrows if effect == j] for j in range(self.N)}
        x, (y,) = ([(var, -lag) for var, lag in of] for of in (self.X, self.Y))
        path, self.tau_max, between, found = _native.adjustment(self.N, self.graph.shape[2] - 1, arrows, x, y)
        self.no_causal_path, self.M = not path, {(i, -lag) for i, lag in between}
        self._set = None if found is None else [(i, -lag) for i, lag in found]

    def get_optimal_set(self) -> list[Node] | bool:
        """What the regression of `fit_total_effect` adjusts for, the set of least variance; False where none is valid."""
        return False if self._set is None else list(self._set)

    def fit_total_effect(
        self, dataframe: Any, estimator: Any, adjustment_set: str = "optimal", conditional_estimator: None = None, data_transform: None = None,
        mask_type: str | None = None, ignore_identifiability: bool = False,
    ) -> CausalEffects:  # fmt: skip
        """Fits a regressor of scikit-learn (`fit`, `predict`) of Y on X and the optimal set.

        Raises:
            ValueError: No set is valid.
        """
        not_covered(conditional_estimator=conditional_estimator, data_transform=data_transform, ignore_identifiability=ignore_identifiability)
        if adjustment_set != "optimal":
            raise NotCovered(f"adjustment_set={adjustment_set!r} is not covered by roscausal.tigramite; it has 'optimal'")
        if self._set is None:
            raise DataError("no set makes the effect a regression: X drive each other by way of Y's causes; use fit_wright_effect")
        rows, roles, _ = self._rows(dataframe, self.X, self.Y, self._set, mask_type)
        self._others = rows[roles == 3]
        self.estimator = deepcopy(estimator).fit(np.vstack([rows[roles == 0], self._others]).T, rows[roles == 1][0])
        return self

    def predict_total_effect(self, intervention_data: ArrayLike) -> NDArray[np.float64]:
        """The mean of Y, (n,), if X were set to each row of `intervention_data` (n, len(X))."""
        means = [
            np.mean(self.estimator.predict(np.vstack([np.repeat(values[:, np.newaxis], self._others.shape[1], axis=1), self._others]).T))
            for values in self._interventions(intervention_data)
        ]
        return np.zeros(len(means)) if self.no_causal_path else np.array(means)

    def fit_wright_effect(
        self, dataframe: Any, mediation: str | Sequence[Node] | None = None, method: str = "parents", links_coeffs: None = None,
        data_transform: None = None, mask_type: str | None = None,
    ) -> CausalEffects:  # fmt: skip
        """Adds up the products of coefficients along the paths, each node regressed on its parents.

        Args:
            mediation: None: all paths; "direct": the links from X to Y; nodes: the paths through any of them.
        """
        not_covered(links_coeffs=links_coeffs, data_transform=data_transform)
        if method != "parents":
            raise NotCovered(f"method='{method}' is not covered by roscausal.tigramite; it has 'parents'")
        coefficients = {}
        for j, time in (node for node in {*self.M, *self.Y} if not self.no_causal_path):
            parents = [(i, lag + time) for i, lag in self._parents[j]]
            rows = self._rows(dataframe, parents, [(j, time)], [], mask_type)[0]
            coefficients[j, time] = dict(zip(parents, slopes(rows[-1], rows[:-1])))

        def effects(without: set[Node]) -> NDArray[np.float64]:
            # On Y, of each node of X, by the paths that avoid some nodes.
            known = {node: np.zeros(len(self.X)) for node in without} | dict(zip(self.X, np.eye(len(self.X))))

            def on(node: Node) -> NDArray[np.float64]:
                if node not in known:
                    parents = coefficients.get(node, {}).items()
                    known[node] = sum((b * on(parent) for parent, b in parents), np.zeros(len(self.X)))
                return known[node]

            return on(self.Y[0])

        if isinstance(mediation, str):
            if mediation != "direct":
                raise SettingError(f"setting 'mediation': '{mediation}' is unknown; give direct, or nodes [(i, -lag), ..]")
            self._wright = effects(self.M)
        else:
            self._wright = effects(set()) - (0.0 if mediation is None else effects({(int(i), int(lag)) for i, lag in mediation}))
        return self

    def predict_wright_effect(self, intervention_data: ArrayLike) -> NDArray[np.float64]:
        """How much Y changes, (n, 1), if X are changed by each row of `intervention_data` (n, len(X))."""
        return np.asarray(self._interventions(intervention_data) @ self._wright)[:, np.newaxis]

    def _interventions(self, values: ArrayLike) -> NDArray[np.float64]:
        rows = np.asarray(values, dtype=np.float64)
        if rows.ndim != 2 or rows.shape[1] != len(self.X):
            raise DataError(f"intervention_data has shape {rows.shape}; give a row of {len(self.X)} values for each intervention")
        return rows

    def _rows(self, dataframe: Any, x: Sequence[Node], y: Sequence[Node], more: Sequence[Node], mask_type: str | None) -> Any:
        if dataframe.N != self.N:
            raise DataError(f"the graph has {self.N} variables, the data {dataframe.N}")
        return dataframe.construct_array(
            X=x, Y=y, Z=[], extraZ=more, tau_max=self.tau_max, mask_type=mask_type, cut_off="tau_max", do_checks=False
        )

    @staticmethod
    def get_graph_from_dict(links: Mapping[int, Any], tau_max: int | None = None) -> NDArray[np.str_]:
        """As `PCMCI.get_graph_from_dict`."""
        return graph_of_links(links, tau_max)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name in ("estimator", "_others", "_wright"):
            raise AttributeError(f"{name}: fit an effect first")
        raise NotCovered(f"CausalEffects.{name} is not covered by roscausal; tigramite.causal_effects.CausalEffects takes our frames")
