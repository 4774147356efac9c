"""`PCMCI`: the methods, with the reference's names, defaults and return values."""

from __future__ import annotations

import itertools
import json
import warnings
from collections.abc import Mapping, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import _native
from .._native import SettingError
from ..quick import plain, whole
from . import results
from .data_processing import DataFrame, adopted
from .independence_tests.independence_tests_base import check_test
from .refusal import NotCovered, not_covered, unknown
from .results import Links

Results = dict[str, Any]
Parents = Mapping[int, Sequence[tuple[int, int]]]


#: What the engine reads of the keywords of a run.
_SETTINGS = (
    "tau_min", "tau_max", "pc_alpha", "alpha_level", "fdr_method", "max_conds_dim", "max_combinations", "max_conds_py", "max_conds_px",
    "max_conds_px_lagged", "contemp_collider_rule", "conflict_resolution", "reset_lagged_links", "n_preliminary_iterations", "max_cond_px",
    "prelim_with_collider_rules", "pc_only",
)  # fmt: skip


def _engines(keywords: Mapping[str, Any]) -> dict[str, Any]:
    return {name: keywords[name] for name in _SETTINGS if name in keywords}


def _pairs(name: str, what: str) -> Any:
    """A method that tests each pair in one way."""

    def run(
        self: PCMCI, selected_links: None = None, link_assumptions: Links | None = None, tau_min: int = 0, tau_max: int = 1,
        val_only: bool = False, alpha_level: float = 0.05, fdr_method: str = "none",
    ) -> Results:  # fmt: skip
        not_covered(selected_links=selected_links)
        method = name.removeprefix("run_").removeprefix("get_")
        found = self._run(method, {**_engines(locals()), "pc_alpha": 0.2}, link_assumptions)
        if val_only and method == "bivci" and tau_min == 0:
            # Values alone are not made alike from both sides at lag 0.
            for i, j in np.argwhere(found["val_matrix"][:, :, 0]):
                past = [(j, -lag) for lag in range(1, tau_max + 1)]
                found["val_matrix"][i, j, 0] = self.cond_ind_test.run_test([(i, 0)], [(j, 0)], past, tau_max)[0]
        return self._matrices(found, alpha_level, val_only)

    run.__name__, run.__doc__ = name, f"{what} The arguments and the result are those of `run_pcmci`; `val_only`: values only."
    return run


class PCMCI:
    """Causal discovery in time series: PCMCI, PCMCI+ and their parts.

    Args:
        dataframe: The data; a frame of tigramite's will do.
        cond_ind_test: A test of this package; or your own: a function `f(x, y, z) -> (value, p)` of arrays (n,), (n,),
            (n, k); an object with `run_test_raw(x, y, z)` of arrays (n, 1), (n, 1), (n, k) or None; an object with
            `run_test(X, Y, Z, tau_max)` of nodes `[(variable, -lag)]`. It is called once per question, one call at a time.
        verbosity: Above 0 the results are printed.

    Attributes:
        all_parents: After the condition selection: `{j: [(i, -lag), ..]}`, the strongest first.
        val_min: `{j: {(i, -lag): smallest |value|}}` of the parents.
        pval_max: `{j: {(i, -lag): largest p-value}}` of all candidates.
        remarks: What the reader of the last result should know, one sentence each.

    Example:
        >>> import numpy as np
        >>> from roscausal.tigramite import data_processing as pp
        >>> from roscausal.tigramite.independence_tests.parcorr import ParCorr
        >>> from roscausal.tigramite.pcmci import PCMCI
        >>> x = np.random.default_rng(1).normal(size=(300, 2))
        >>> x[1:, 1] += x[:-1, 0]
        >>> pcmci = PCMCI(pp.DataFrame(x), ParCorr())
        >>> pcmci.run_pcmci(tau_max=1)["graph"][0, 1].tolist()
        ['', '-->']
        >>> found = pcmci.run_bootstrap_of("run_pcmci", {"tau_max": 1}, boot_samples=30, seed=42)
        >>> float(found["summary_results"]["link_frequency"][0, 1, 1])
        1.0
    """

    #: What the variables are to J-PCMCI+.
    _classes: Sequence[str] = ()

    def __init__(self, dataframe: DataFrame, cond_ind_test: Any, verbosity: int = 0, **others: object) -> None:
        unknown("PCMCI", others, ("dataframe", "cond_ind_test", "verbosity"))
        dataframe = adopted(dataframe)
        self.dataframe, self.cond_ind_test, self.verbosity = dataframe, cond_ind_test, verbosity
        if hasattr(cond_ind_test, "set_dataframe"):
            cond_ind_test.set_dataframe(dataframe)
        self.all_parents: dict[int, list[tuple[int, int]]] = {}
        self.val_min: dict[int, dict[tuple[int, int], float]] = {}
        self.pval_max: dict[int, dict[tuple[int, int], float]] = {}
        self.remarks: list[str] = []
        self._draw: tuple[int, int, str] | None = None

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        if name in ("N", "T", "var_names"):
            return getattr(self.dataframe, name)
        raise NotCovered(f"{type(self).__name__}.{name} is not covered by roscausal.tigramite")

    def _run(self, method: str, settings: dict[str, Any], links: Links | None = None) -> Results:
        test = self.cond_ind_test
        check_test(test, self.dataframe)
        settings["link_assumptions"] = results.link_list(links, settings["tau_min"], settings["tau_max"], method == "lpcmci")
        if self._classes:
            method, settings["node_classification"] = "jpcmciplus", self._classes
        dummies = sum(what.endswith("_dummy") for what in self._classes)
        frame = self.dataframe.frame(getattr(test, "mask_type", None), self.N - dummies)
        if self._draw is not None:
            frame = frame.bootstrap(*self._draw, 2 * settings["tau_max"])
            if hasattr(test, "run_test_raw") and not hasattr(test, "spec"):
                # On nodes it would look at the data as they are.
                test = SimpleNamespace(run_test_raw=test.run_test_raw)
        text = json.dumps(settings, default=lambda value: plain(value, "a list"))
        found = _native.run(frame, method, text, getattr(test, "spec", test))
        self.remarks = found["remarks"]
        if found["candidates"]:
            nodes = {j: [(var, -lag) for var, lag in of] for j, of in enumerate(found["parents"])}
            of_targets = list(enumerate(found["candidates"]))
            self.all_parents = nodes
            self.pval_max = {j: {(var, -lag): p for var, lag, _, p in of} for j, of in of_targets}
            self.val_min = {j: {(var, -lag): v for var, lag, v, _ in of if (var, -lag) in nodes[j]} for j, of in of_targets}
        return found

    def _matrices(self, found: Results, alpha_level: float, val_only: bool = False) -> Results:
        matrices = {"val_matrix": found["val_matrix"], "conf_matrix": found["conf_matrix"]}
        if val_only:
            return matrices
        p_matrix = found["p_matrix"] if found["q_matrix"] is None else found["q_matrix"]
        answer = {"graph": results.MARKS[found["graph"]], "p_matrix": p_matrix, **matrices}
        if self.verbosity > 0:
            self.print_results(answer, alpha_level)
        return answer

    def run_pc_stable(
        self, selected_links: None = None, link_assumptions: Links | None = None, tau_min: int = 1, tau_max: int = 1,
        save_iterations: bool = False, pc_alpha: float | Sequence[float] | None = 0.2, max_conds_dim: int | None = None,
        max_combinations: int = 1,
    ) -> dict[int, list[tuple[int, int]]]:  # fmt: skip
        """The condition selection of PCMCI alone, with the arguments of `run_pcmci`: `{j: [(i, -lag), ..]}`, the strongest first."""
        not_covered(selected_links=selected_links, save_iterations=save_iterations)
        self._run("pc_stable", {**_engines(locals()), "tau_min": max(tau_min, 1)}, link_assumptions)
        return self.all_parents

    def run_mci(
        self, selected_links: None = None, link_assumptions: Links | None = None, tau_min: int = 0, tau_max: int = 1,
        parents: Parents | None = None, max_conds_py: int | None = None, max_conds_px: int | None = None, val_only: bool = False,
        alpha_level: float = 0.05, fdr_method: str = "none",
    ) -> Results:  # fmt: skip
        """The MCI tests alone, given `parents` `{j: [(i, -lag), ..]}`, the strongest first; all else is as in `run_pcmci`."""
        not_covered(selected_links=selected_links)
        given = parents or {}
        settings = {**_engines(locals()), "pc_alpha": 0.2, "parents": [[(var, -lag) for var, lag in given.get(j, [])] for j in range(self.N)]}
        return self._matrices(self._run("mci", settings, link_assumptions), alpha_level, val_only)

    def run_pcmci(
        self, selected_links: None = None, link_assumptions: Links | None = None, tau_min: int = 0, tau_max: int = 1,
        save_iterations: bool = False, pc_alpha: float | Sequence[float] | None = 0.2, max_conds_dim: int | None = None,
        max_combinations: int = 1, max_conds_py: int | None = None, max_conds_px: int | None = None, alpha_level: float = 0.05,
        fdr_method: str = "none",
    ) -> Results:  # fmt: skip
        """PCMCI: lagged links, and pairs at lag 0 without a direction.

        Args:
            link_assumptions: `{j: {(i, -lag): mark}}` with marks -->, -?>, <--, <?-, o-o, o?o; a link that is not listed is
                absent. None: all may be.
            tau_min: Smallest lag in steps.
            tau_max: Largest lag in steps.
            pc_alpha: Level of the condition selection; several, or None: a score chooses.
            max_conds_dim: Largest number of conditions of the selection.
            max_combinations: Sets of conditions of each size that it tries.
            max_conds_py: How many parents of the effect are conditions; None: all.
            max_conds_px: How many parents of the cause are conditions; None: all.
            alpha_level: Level of a link.
            fdr_method: "none" or "fdr_bh".

        Returns:
            A dict: `graph` of marks <U3, `p_matrix` (corrected, if so asked), `val_matrix`, all (N, N, tau_max + 1) as
            [cause, effect, lag]; `conf_matrix` (N, N, tau_max + 1, 2), or None.
        """
        not_covered(selected_links=selected_links, save_iterations=save_iterations)
        return self._matrices(self._run("pcmci", _engines(locals()), link_assumptions), alpha_level)

    def run_pcmciplus(
        self, selected_links: None = None, link_assumptions: Links | None = None, tau_min: int = 0, tau_max: int = 1,
        pc_alpha: float | Sequence[float] | None = 0.01, contemp_collider_rule: str = "majority", conflict_resolution: bool = True,
        reset_lagged_links: bool = False, max_conds_dim: int | None = None, max_combinations: int = 1,
        max_conds_py: int | None = None, max_conds_px: int | None = None, max_conds_px_lagged: int | None = None,
        fdr_method: str = "none",
    ) -> Results:  # fmt: skip
        """PCMCI+: lagged links, and directed links at lag 0.

        Args:
            pc_alpha: Level of all tests; several, or None: a score chooses.
            contemp_collider_rule: "majority", "conservative" or "none".
            conflict_resolution: Whether contradictory directions are marked x-x.
            reset_lagged_links: Whether the skeleton starts from all lagged links.
            max_conds_px_lagged: How many parents of a lagged cause are conditions; None: as `max_conds_px`.

        Returns:
            As `run_pcmci`, and `sepsets` `{((i, -lag), j): [nodes]}`, `ambiguous_triples` `[((i, -lag), k, j)]`.
        """
        not_covered(selected_links=selected_links)
        return self._oriented(_engines(locals()), link_assumptions, fdr_method)

    def _oriented(self, settings: dict[str, Any], links: Links | None, fdr_method: str) -> Results:
        lags = {"tau_min": settings["tau_min"], "tau_max": settings["tau_max"]}
        found = self._run("pcmciplus", {**settings, "fdr_method": "none"}, links)
        # The graph is that without correction, as in the reference.
        found["q_matrix"] = self.get_corrected_pvalues(found["p_matrix"], fdr_method, **lags, link_assumptions=links)
        level = settings["pc_alpha"]
        answer = self._matrices(found, level if isinstance(level, (int, float)) else found["optimal_alpha"])
        every = itertools.product(range(lags["tau_min"], lags["tau_max"] + 1), range(self.N), range(self.N))
        sepsets: dict[Any, list[tuple[int, int]]] = {((i, -lag), j): [] for lag, i, j in every}
        for (var, lag), effect, conditions in found["sepsets"]:
            sepsets[(var, -lag), effect] = [(i, -t) for i, t in conditions]
        # Where both ends are at lag 0, the reference lists a triple from each.
        both = [(j, k, var) for (var, lag), k, j in found["ambiguous_triples"] if lag == 0]
        ends = [(j, k, var, lag) for (var, lag), k, j in found["ambiguous_triples"]] + [(i, k, j, 0) for j, k, i in both]
        triples = [((var, -lag), k, j) for j, k, var, lag in sorted(ends)]
        return {**answer, "sepsets": sepsets, "ambiguous_triples": triples}

    def run_pcalg(
        self, selected_links: None = None, link_assumptions: Links | None = None, pc_alpha: float = 0.01, tau_min: int = 0,
        tau_max: int = 1, max_conds_dim: int | None = None, max_combinations: None = None, lagged_parents: None = None,
        max_conds_py: None = None, max_conds_px: None = None, max_conds_px_lagged: None = None, mode: str = "standard",
        contemp_collider_rule: str = "majority", conflict_resolution: bool = True,
    ) -> Results:  # fmt: skip
        """The PC algorithm on time series: conditions are neighbours at all lags, none is a parent beforehand.

        Arguments and result are those of `run_pcmciplus`.
        """
        other = None if mode == "standard" else f"{mode!r} (run_pcmciplus does it)"
        not_covered(selected_links=selected_links, max_combinations=max_combinations, lagged_parents=lagged_parents, mode=other)
        found = self._oriented({**_engines(locals()), "max_combinations": 1, "pc_only": True}, link_assumptions, "none")
        del found["conf_matrix"]
        return found

    def run_pcalg_non_timeseries_data(self, **settings: Any) -> Results:
        """The PC algorithm at lag 0: `run_pcalg` and its settings without lags, in the nodes of its answer too."""
        found = self.run_pcalg(tau_max=0, **settings)
        sepsets = {(i, j): [k for k, _ in of] for ((i, _), j), of in found["sepsets"].items()}
        return {**found, "sepsets": sepsets, "ambiguous_triples": [(i, k, j) for (i, _), k, j in found["ambiguous_triples"]]}

    run_fullci = _pairs("run_fullci", "Each link given all other lagged variables.")
    run_bivci = _pairs("run_bivci", "Each link given the past of its effect.")
    get_lagged_dependencies = _pairs("get_lagged_dependencies", "The dependence of all pairs at all lags, given nothing.")

    def run_sliding_window_of(
        self, method: str, method_args: Mapping[str, Any], window_step: int, window_length: int, conf_lev: float = 0.9
    ) -> Results:
        """Runs a method such as "run_pcmci" in windows of the samples. The past of a window's first samples lies before it.

        Returns:
            `window_results`: the method's arrays with the window as first axis; `summary_results`: see `return_summary_results`.
        """
        samples = self.dataframe.largest_time_step
        if window_step < 1 or not 1 <= window_length < samples:
            raise SettingError(f"setting 'window_length': {window_length} (step {window_step}) does not fit into {samples} samples")
        _repeatable(method)
        runs, every = [], self.dataframe.reference_points
        try:
            for start in range(0, samples - window_length, window_step):
                self.dataframe.reference_points = np.intersect1d(np.arange(start, start + window_length), every)
                runs.append(getattr(self, method)(**method_args))
        finally:
            self.dataframe.reference_points = every
        joined = results.joined(runs)
        return {"summary_results": results.summary(joined, conf_lev), "window_results": joined}

    def run_bootstrap_of(
        self, method: str, method_args: Mapping[str, Any], boot_samples: int = 100, boot_blocklength: int | str = 1,
        conf_lev: float = 0.9, aggregation: str = "majority", seed: int | None = None,
    ) -> Results:  # fmt: skip
        """Runs a method again and again on times drawn with replacement, `boot_blocklength` (or "cube_root") neighbours at once; lags stay whole.

        Returns:
            `boot_results`: the method's arrays with the draw as first axis; `summary_results`: see `return_summary_results`.
        """
        _repeatable(method)
        if aggregation != "majority" or boot_blocklength == "from_autocorrelation":
            what = boot_blocklength if aggregation == "majority" else aggregation
            raise NotCovered(f"'{what}' is not covered by roscausal.tigramite; leave it out, or use tigramite for this run")
        test = self.cond_ind_test
        if hasattr(test, "run_test") and not (hasattr(test, "spec") or hasattr(test, "run_test_raw")):
            raise SettingError("setting 'cond_ind_test': a test on nodes sees no data, so that resamples say nothing")
        boot_samples = whole("boot_samples", boot_samples, 1, "a number of draws from 1 on")
        first = int(np.random.default_rng().integers(2**32)) if seed is None else int(seed)
        runs, verbosity = [], self.verbosity
        try:
            self.verbosity = 0
            for number in range(boot_samples):
                self._draw = (first, number, str(boot_blocklength))
                runs.append(getattr(self, method)(**method_args))
        finally:
            self._draw, self.verbosity = None, verbosity
        joined = results.joined(runs)
        return {"summary_results": results.summary(joined, conf_lev, aggregation), "boot_results": joined}

    return_summary_results = staticmethod(results.summary)

    def get_corrected_pvalues(
        self, p_matrix: NDArray[Any], fdr_method: str = "fdr_bh", exclude_contemporaneous: bool = True, tau_min: int = 0,
        tau_max: int = 1, link_assumptions: Links | None = None,
    ) -> NDArray[np.float64]:  # fmt: skip
        """P-values (N, N, tau_max + 1) corrected for many tests (Benjamini and Hochberg). Links that `link_assumptions` do not list do not
        count, nor does lag 0 with `exclude_contemporaneous`."""
        p_values = np.ascontiguousarray(p_matrix, dtype=np.float64)
        if fdr_method == "none":
            return p_values
        if fdr_method != "fdr_bh":
            raise SettingError(f"setting 'fdr_method': '{fdr_method}' is unknown; allowed: none, fdr_bh")
        counted = np.full(p_values.shape, link_assumptions is None)
        for cause, effect, lag, _ in results.link_list(link_assumptions, tau_min, tau_max) or []:
            counted[cause, effect, lag] = True
        np.fill_diagonal(counted[:, :, 0], False)
        if exclude_contemporaneous:
            counted[:, :, 0] = False
        return _native.fdr_bh(p_values, counted)

    def get_graph_from_pmatrix(
        self, p_matrix: NDArray[Any], alpha_level: float, tau_min: int, tau_max: int, link_assumptions: Links | None = None,
    ) -> NDArray[np.str_]:  # fmt: skip
        """The marks of the links whose p-value is at most the level: --> with a lag, o-o at lag 0, or as assumed."""
        p_values = np.asarray(p_matrix)
        there = p_values <= alpha_level
        lags = np.arange(p_values.shape[2])
        there[:, :, (lags < tau_min) | (lags > tau_max)] = False
        np.fill_diagonal(there[:, :, 0], False)
        if link_assumptions is not None:
            links = results.link_list(link_assumptions, tau_min, tau_max) or []
            allowed = results.marked(p_values.shape, {(i, j, lag): mark.replace("?", "-") for i, j, lag, mark in links})
        else:
            allowed = np.where(lags == 0, "o-o", "-->")
        return np.where(there, allowed, "").astype("<U3")

    get_graph_from_dict = staticmethod(results.graph_of_links)
    graph_to_dict = staticmethod(results.graph_as_dict)

    def return_parents_dict(
        self, graph: NDArray[Any], val_matrix: NDArray[Any], include_lagzero_parents: bool = False
    ) -> dict[int, list[tuple[int, int]]]:
        """The parents of each variable, `{j: [(i, -lag), ..]}`, the strongest first."""
        parents = {}
        for effect, links in results.graph_as_dict(graph).items():
            found = [node for node, mark in links.items() if mark == "-->" and (node[1] < 0 or include_lagzero_parents)]
            parents[effect] = results.strongest_first(found, effect, val_matrix)
        return parents

    def return_significant_links(self, pq_matrix: Any, val_matrix: Any, alpha_level: float = 0.05, include_lagzero_links: bool = False) -> None:
        """Deprecated, as in the reference, where it returns nothing: the results hold the graph."""
        warnings.warn("return_significant_links is deprecated: results hold the graph", DeprecationWarning, stacklevel=2)

    def print_results(self, return_dict: Results, alpha_level: float = 0.05) -> None:
        """Prints the links of a result."""
        self.print_significant_links(
            return_dict["p_matrix"], return_dict["val_matrix"], return_dict.get("conf_matrix"), return_dict.get("graph"),
            alpha_level=alpha_level,
        )  # fmt: skip

    def print_significant_links(
        self, p_matrix: NDArray[Any], val_matrix: NDArray[Any], conf_matrix: NDArray[Any] | None = None,
        graph: NDArray[Any] | None = None, ambiguous_triples: object = None, alpha_level: float = 0.05,
    ) -> None:  # fmt: skip
        """Prints the links of these matrices; without a graph, those whose p-value is at most the level."""
        if graph is None:
            graph = self.get_graph_from_pmatrix(p_matrix, alpha_level, 0, p_matrix.shape[2] - 1)
        names = [_native.visible(name) for name in self.dataframe.names]
        note = {"o-o": " | unoriented link", "x-x": " | unclear orientation due to conflict"}
        lines = [f"\n## Significant links at alpha = {alpha_level}:"]
        for effect, links in results.graph_as_dict(graph).items():
            lines.append(f"\n    Variable {names[effect]} has {len(links)} link(s):")
            for cause, lag in results.strongest_first(links, effect, val_matrix):
                at = (cause, effect, -lag)
                line = f"        ({names[cause]} {lag}): pval = {p_matrix[at]:.5f} | val = {val_matrix[at]: .3f}"
                if conf_matrix is not None:
                    line += f" | conf = ({conf_matrix[at][0]:.3f}, {conf_matrix[at][1]:.3f})"
                lines.append(line + note.get(links[cause, lag], ""))
        print("\n".join(lines))


def _repeatable(method: str) -> None:
    known = "run_pcmci run_pcmciplus run_mci run_pcalg run_fullci run_bivci get_lagged_dependencies run_lpcmci run_jpcmciplus".split()
    if method not in known:
        raise SettingError(f"setting 'method': '{method}' cannot be run again and again; allowed: {', '.join(known)}")
