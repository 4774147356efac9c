"""`CausalEffects`: total effects of a known graph, by adjustment and by paths (Perkovic 2018, Runge 2021, Wright 1921)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy, deepcopy
from graphlib import CycleError, TopologicalSorter
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._native import DataError, SettingError
from ._admg import Adjustment, Graph, Node
from .data_processing import bootstrapped
from .models import slopes
from .refusal import NotCovered, not_covered
from .results import graph_of_links, interval

MARKS = {"dag": {"-->", "<--"}, "stationary_dag": {"-->", "<--"}, "admg": {"-->", "<--", "<->", "+->", "<-+"}}
MARKS["stationary_admg"] = MARKS["admg"]

Least = bool | Literal["colliders_only"]
SETS: dict[str, Least] = {"optimal": False, "minimized_optimal": True, "colliders_minimized_optimal": "colliders_only"}


class CausalEffects:
    """The effect of setting X on Y.

    Args:
        graph: Marks (N, N), or (N, N, tau_max + 1) as [cause, effect, lag].
        graph_type: "dag", "admg" with `<->` and `+->`; "stationary_dag", "stationary_admg".
        X, Y, S: Causes, effects and conditions `[(i, -lag), ..]`.
        hidden_variables: Nodes that were not recorded; the graph goes on without them.

    Attributes:
        M: Nodes on the paths from X to Y.
        no_causal_path: Whether none leads there.
        tau_max: The largest lag of a sample.

    Raises:
        NotImplementedError: Other graph types.
        SettingError: Nodes or marks that the graph cannot have; a circle; conditions that X drives on its way to Y.

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
        self, graph: ArrayLike, graph_type: str, X: Sequence[Node], Y: Sequence[Node], S: Sequence[Node] | None = None,
        hidden_variables: Sequence[Node] | None = None, check_SM_overlap: bool = True, verbosity: int = 0,
    ) -> None:  # fmt: skip
        if graph_type not in MARKS:
            known = ", ".join(MARKS)
            raise NotCovered(f"graph_type='{graph_type}' is not covered by roscausal, which has {known}; tigramite's takes our frames")
        marks, over_time = np.asarray(graph), graph_type.startswith("stationary")
        if marks.ndim != 2 + over_time or len(set(marks.shape[:2])) > 1:
            raise SettingError(f"setting 'graph': its shape {marks.shape} is none of graph_type='{graph_type}'")
        if others := sorted(set(map(str, np.unique(marks))) - MARKS[graph_type] - {""}):
            raise SettingError(f"setting 'graph': {others[0]} is no mark of graph_type='{graph_type}'")
        marks = marks if marks.ndim == 3 else marks[:, :, np.newaxis]
        back = np.vectorize(lambda mark: mark[::-1].translate(str.maketrans("<>", "><")), otypes=["U3"])
        if np.any(back(marks[:, :, 0]) != marks[:, :, 0].T):
            raise SettingError("setting 'graph': at lag 0 a pair has one mark from one side and another from the other")
        self.N: int = len(marks)
        try:
            self.X, self.Y, self.S, hidden = ([(int(i), int(lag)) for i, lag in of or ()] for of in (X, Y, S, hidden_variables))
        except (TypeError, ValueError):
            raise SettingError("setting 'X': X, Y, S and hidden_variables are lists of nodes [(i, -lag), ..]") from None
        named = self.X + self.Y + self.S
        if not (self.X and self.Y) or len({*named, *hidden}) < len(named) + len(set(hidden)) or any(
            not 0 <= i < self.N or lag > 0 or (lag < 0 and not over_time) for i, lag in named + hidden
        ):  # fmt: skip
            raise SettingError("setting 'X': X, Y, S and hidden_variables are different nodes (i, -lag) of the graph")
        self.tau_max = marks.shape[2] - 1 - min(lag for _, lag in named)
        # What lies before the window is a hidden cause of what lies at its border. So far back paths go that lead twice through each variable.
        before = 2 * self.N * (marks.shape[2] - 1)
        nodes = _unrolled(marks, self.tau_max + before)
        for node in hidden:
            nodes.hide(node)
        self._has_hidden_causes = any(nodes.siblings.values())
        try:
            TopologicalSorter(nodes.parents).prepare()
        except CycleError:
            raise SettingError("setting 'graph': its arrows go round in a circle") from None
        for lag in range(self.tau_max + before, self.tau_max, -1):
            for var in range(self.N):
                nodes.hide((var, -lag))
        self._nodes, self._sets = nodes, Adjustment(nodes, {*self.X}, {*self.Y}, {*self.S})
        self.M, self.no_causal_path = self._sets.mediators, not self._sets.between
        if overlap := {*self.S} & self._sets.forbidden:
            raise SettingError(f"setting 'S': X may drive {min(overlap)} by way of Y or M; take conditions before them")

    @property
    def graph(self) -> NDArray[np.str_]:
        """Marks (N, N, tau_max + 1, tau_max + 1) as [from, to, lag of from, lag of to], without the hidden variables."""
        marks = np.full((self.N, self.N, self.tau_max + 1, self.tau_max + 1), "", dtype="<U3")
        for (i, a), others in self._nodes.children.items():
            for j, b in others:
                both = (j, b) in self._nodes.siblings[i, a]
                marks[i, j, -a, -b], marks[j, i, -b, -a] = ("+->", "<-+") if both else ("-->", "<--")
        for (i, a), others in self._nodes.siblings.items():
            for j, b in others:
                marks[i, j, -a, -b] = marks[i, j, -a, -b] or "<->"
        return marks

    def get_optimal_set(
        self, alternative_conditions: None = None, minimize: Least = False, return_separate_sets: bool = False
    ) -> list[Node] | bool:
        """What the regression of `fit_total_effect` adjusts for, the set of least variance with S; False where none is valid.

        Args:
            minimize: True: without what it can do without; "colliders_only": of what collider paths add alone.
        """
        not_covered(alternative_conditions=alternative_conditions, return_separate_sets=return_separate_sets)
        if not self._sets.identified:
            return False
        parents, more = self._sets.optimal()
        if minimize == "colliders_only":
            more = self._sets.least(more, parents)
        elif minimize:
            parents, more = set(), self._sets.least(parents | more)
        return sorted({*parents, *more, *self.S})

    def _get_adjust_set(self) -> list[Node] | bool:
        return sorted(self._sets.valid) if self._sets.identified else False

    def check_XYS_paths(self) -> tuple[list[Node], list[Node]]:
        """The nodes of X and Y that a causal path joins."""
        x, y = {*self.X}, {*self.Y}
        return [node for node in self.X if self._nodes.mediators({node}, y, x)], [node for node in self.Y if node in self._sets.between]

    def fit_total_effect(
        self, dataframe: Any, estimator: Any, adjustment_set: str | Sequence[Node] = "optimal", conditional_estimator: Any = None,
        data_transform: None = None, mask_type: str | None = None, ignore_identifiability: bool = False,
    ) -> CausalEffects:  # fmt: skip
        """Fits a regressor of scikit-learn (`fit`, `predict`) of Y on X, S and a set.

        Args:
            adjustment_set: "optimal", "minimized_optimal", "colliders_minimized_optimal", or nodes.
            conditional_estimator: That of what it predicts on S; None: `estimator`.

        Raises:
            ValueError: No set is valid, or the given one is not.
        """
        not_covered(data_transform=data_transform, ignore_identifiability=ignore_identifiability)
        if self.no_causal_path:
            return self
        found: Any = adjustment_set
        if isinstance(adjustment_set, str):
            if adjustment_set not in SETS:
                raise SettingError(f"setting 'adjustment_set': '{adjustment_set}' is unknown; give {', '.join(SETS)}, or nodes [(i, -lag), ..]")
            found = self.get_optimal_set(minimize=SETS[adjustment_set]) or []
        given = {(int(i), int(lag)) for i, lag in found}
        if given & self._sets.forbidden or not self._sets.adjusts(given):
            raise DataError("no set, or not this one, makes the effect a regression: causes stay open, or X drive each other by way of Y")
        rows, roles, _ = self._rows(dataframe, self.X, self.Y, self.S, sorted(given - {*self.S}), mask_type)
        x, y, self._conditions, self._others = (rows[roles == role].T for role in range(4))
        self.estimator = deepcopy(estimator).fit(np.hstack([x, self._others, self._conditions]), y[:, 0] if len(self.Y) == 1 else y)
        self._conditional = deepcopy(estimator if conditional_estimator is None else conditional_estimator)
        return self

    def predict_total_effect(
        self, intervention_data: ArrayLike, conditions_data: ArrayLike | None = None, pred_params: Mapping[str, Any] | None = None,
        return_further_pred_results: bool = False, aggregation_func: Callable[..., Any] = np.mean,
        transform_interventions_and_prediction: bool = False, intervention_type: str = "hard",
    ) -> NDArray[np.float64]:  # fmt: skip
        """What `aggregation_func` makes of the samples' predictions of Y if X were set to each row of `intervention_data` (n, len(X)).

        Args:
            conditions_data: S of each row, (n, len(S)).
            pred_params: Keywords of the regressor's `predict`.
        """
        not_covered(
            return_further_pred_results=return_further_pred_results,
            transform_interventions_and_prediction=transform_interventions_and_prediction,
        )
        if intervention_type != "hard":
            raise NotCovered(f"intervention_type='{intervention_type}' is not covered by roscausal.tigramite; it has 'hard'")
        imposed = self._values("intervention_data", intervention_data, len(self.X))
        given = self._values("conditions_data", np.zeros((len(imposed), 0)) if conditions_data is None else conditions_data, len(self.S))
        if len(given) != len(imposed):
            raise DataError(f"conditions_data has {len(given)} rows for {len(imposed)} interventions")
        if self.no_causal_path:
            return np.zeros((len(imposed), *((len(self.Y),) if len(self.Y) > 1 else ())))
        found = []
        for x, s in zip(imposed, given):
            columns = np.hstack([np.tile(x, (len(self._others), 1)), self._others, np.tile(s, (len(self._others), 1))])
            predicted = self.estimator.predict(columns, **(pred_params or {}))
            if self.S:
                predicted = self._conditional.fit(self._conditions, predicted).predict(s[np.newaxis])
            found.append(aggregation_func(predicted, axis=0))
        return np.array(found)

    def fit_wright_effect(
        self, dataframe: Any, mediation: str | Sequence[Node] | None = None, method: str = "parents", links_coeffs: None = None,
        data_transform: None = None, mask_type: str | None = None,
    ) -> CausalEffects:  # fmt: skip
        """Adds up the products of coefficients along the paths, each node regressed on its parents.

        Args:
            mediation: None: all paths; "direct": the links from X to Y; nodes: the paths through any of them.
        """
        not_covered(links_coeffs=links_coeffs, data_transform=data_transform, S=self.S or None)
        if method != "parents" or len(self.Y) > 1 or self._has_hidden_causes:
            raise NotCovered("roscausal.tigramite adds up paths with method='parents' to one effect in a graph of --> alone")
        coefficients = {}
        for j, time in (node for node in {*self.M, *self.Y} if not self.no_causal_path):
            parents = sorted(self._nodes.parents[j, time])
            rows = self._rows(dataframe, parents, [(j, time)], [], [], mask_type)[0]
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
        return np.asarray(self._values("intervention_data", intervention_data, len(self.X)) @ self._wright)[:, np.newaxis]

    def fit_bootstrap_of(
        self, method: str, method_args: Mapping[str, Any], boot_samples: int = 100, boot_blocklength: int = 1, seed: int | None = None
    ) -> CausalEffects:
        """Calls a `fit_` method on samples drawn with replacement, in blocks of so many, for `predict_bootstrap_of`."""
        first = None if seed is None else seed * boot_samples
        fit = lambda: getattr(copy(self), method)(**method_args)
        self._boots = bootstrapped(method_args["dataframe"], fit, boot_samples, boot_blocklength, first)
        return self

    def predict_bootstrap_of(
        self, method: str, method_args: Mapping[str, Any], conf_lev: float = 0.9, return_individual_bootstrap_results: bool = False
    ) -> Any:
        """The interval [low, high] of what a `predict_` method returns over the bootstraps, and each if asked for."""
        found = np.stack([getattr(one, method)(**method_args) for one in self._boots])
        ends = interval(found, conf_lev)
        return (found, ends) if return_individual_bootstrap_results else ends

    def _values(self, name: str, values: ArrayLike, width: int) -> NDArray[np.float64]:
        rows = np.asarray(values, dtype=np.float64)
        if rows.ndim != 2 or rows.shape[1] != width:
            raise DataError(f"{name} has shape {rows.shape}; give a row of {width} values for each intervention")
        return rows

    def _rows(
        self, dataframe: Any, x: Sequence[Node], y: Sequence[Node], z: Sequence[Node], more: Sequence[Node], mask_type: str | None
    ) -> Any:
        if dataframe.N != self.N:
            raise DataError(f"the graph has {self.N} variables, the data {dataframe.N}")
        found = dataframe.construct_array(
            X=x, Y=y, Z=z, extraZ=more, tau_max=self.tau_max, mask_type=mask_type, cut_off="tau_max", do_checks=False
        )
        nodes, samples = found[0].shape
        if samples <= nodes:
            raise DataError(f"{samples} samples are too few for a regression among {nodes} nodes; record longer")
        return found

    get_graph_from_dict = staticmethod(graph_of_links)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name in ("estimator", "_others", "_wright", "_boots"):
            raise AttributeError(f"{name}: fit an effect first")
        raise NotCovered(f"CausalEffects.{name} is not covered by roscausal; tigramite.causal_effects.CausalEffects takes our frames")


def _unrolled(marks: NDArray[Any], window: int) -> Graph:
    """The graph of all nodes with lags up to `window`."""
    graph = Graph()
    for i, j, lag in np.argwhere((marks == "-->") | (marks == "<->") | (marks == "+->")).tolist():
        for time in range(window - lag + 1):
            nodes = (i, -time - lag), (j, -time)
            if marks[i, j, lag] != "<->":
                graph.arrow(*nodes)
            if marks[i, j, lag] != "-->":
                graph.both(*nodes)
    return graph
