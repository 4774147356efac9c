"""`PCMCI`: the methods, with the reference's names, defaults and return values."""

from __future__ import annotations

import json
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import _native
from .._native import SettingError
from . import results
from .data_processing import DataFrame
from .refusal import NotCovered, not_covered, unknown
from .results import Links

Results = dict[str, Any]
Parents = Mapping[int, Sequence[tuple[int, int]]]


class PCMCI:
    """Causal discovery in time series: PCMCI, PCMCI+ and their parts.

    Args:
        dataframe: The data.
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
    """

    def __init__(self, dataframe: DataFrame, cond_ind_test: Any, verbosity: int = 0, **others: object) -> None:
        unknown("PCMCI", others, ("dataframe", "cond_ind_test", "verbosity"))
        if not isinstance(dataframe, DataFrame):
            kind = f"{type(dataframe).__module__}.{type(dataframe).__name__}"
            raise SettingError(f"setting 'dataframe': give a roscausal.tigramite.data_processing.DataFrame, not a {kind}")
        self.dataframe, self.cond_ind_test, self.verbosity = dataframe, cond_ind_test, verbosity
        if hasattr(cond_ind_test, "set_dataframe"):
            cond_ind_test.set_dataframe(dataframe)
        self.N, self.T, self.var_names = dataframe.N, dataframe.T, dataframe.var_names
        self.all_parents: dict[int, list[tuple[int, int]]] = {}
        self.val_min: dict[int, dict[tuple[int, int], float]] = {}
        self.pval_max: dict[int, dict[tuple[int, int], float]] = {}
        self.remarks: list[str] = []
        self._points: NDArray[Any] | None = None
        self._draw: tuple[int, int, str] | None = None

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        raise NotCovered(f"PCMCI.{name} is not covered by roscausal.tigramite")

    def _run(self, method: str, settings: dict[str, Any], links: Links | None = None) -> Results:
        test = self.cond_ind_test
        settings["link_assumptions"] = results.link_list(links, settings["tau_min"], settings["tau_max"])
        frame = self.dataframe.frame(getattr(test, "mask_type", None), self._points)
        if self._draw is not None:
            frame = frame.bootstrap(*self._draw, 2 * settings["tau_max"])
        found = _native.run(frame, method, json.dumps(settings, default=_plain), getattr(test, "spec", test))
        self.remarks = found["remarks"]
        if found["candidates"]:
            self._keep_parents(found)
        return found

    def _keep_parents(self, found: Results) -> None:
        nodes = {j: [(var, -lag) for var, lag in of] for j, of in enumerate(found["parents"])}
        of_targets = list(enumerate(found["candidates"]))
        self.all_parents = nodes
        self.pval_max = {j: {(var, -lag): p for var, lag, _, p in of} for j, of in of_targets}
        self.val_min = {j: {(var, -lag): v for var, lag, v, _ in of if (var, -lag) in nodes[j]} for j, of in of_targets}

    def _matrices(self, found: Results, alpha_level: float) -> Results:
        p_matrix = found["p_matrix"] if found["q_matrix"] is None else found["q_matrix"]
        answer = {
            "graph": results.MARKS[found["graph"]],
            "p_matrix": p_matrix,
            "val_matrix": found["val_matrix"],
            "conf_matrix": found["conf_matrix"],
        }
        if self.verbosity > 0:
            self.print_results(answer, alpha_level)
        return answer

    def run_pc_stable(
        self,
        selected_links: None = None,
        link_assumptions: Links | None = None,
        tau_min: int = 1,
        tau_max: int = 1,
        save_iterations: bool = False,
        pc_alpha: float | Sequence[float] | None = 0.2,
        max_conds_dim: int | None = None,
        max_combinations: int = 1,
    ) -> dict[int, list[tuple[int, int]]]:
        """The condition selection of PCMCI alone.

        Args:
            link_assumptions: `{j: {(i, -lag): "-?>" or "-->"}}`; a link that is not listed is absent. None: all may be.
            tau_min: Smallest lag; 0 counts as 1.
            tau_max: Largest lag.
            pc_alpha: Level; several, or None: a score chooses one for each variable.
            max_conds_dim: Largest number of conditions.
            max_combinations: Sets of conditions of each size that are tried.

        Returns:
            `{j: [(i, -lag), ..]}`, the strongest first.

        Raises:
            ValueError: Settings or data that do not allow it.
            NotImplementedError: `selected_links`, `save_iterations`.
        """
        not_covered(selected_links=selected_links, save_iterations=save_iterations)
        settings = {
            "tau_min": max(tau_min, 1),
            "tau_max": tau_max,
            "pc_alpha": pc_alpha,
            "max_conds_dim": max_conds_dim,
            "max_combinations": max_combinations,
        }
        self._run("pc_stable", settings, link_assumptions)
        return self.all_parents

    def run_mci(
        self,
        selected_links: None = None,
        link_assumptions: Links | None = None,
        tau_min: int = 0,
        tau_max: int = 1,
        parents: Parents | None = None,
        max_conds_py: int | None = None,
        max_conds_px: int | None = None,
        val_only: bool = False,
        alpha_level: float = 0.05,
        fdr_method: str = "none",
    ) -> Results:
        """The MCI tests alone, given the parents of each variable.

        Args:
            parents: `{j: [(i, -lag), ..]}`, the strongest first; None: none.
            max_conds_py: How many parents of the effect are conditions; None: all.
            max_conds_px: How many parents of the cause are conditions; None: all.
            link_assumptions: As in `run_pcmci`; so are the lags, `alpha_level` and `fdr_method`.

        Returns:
            As `run_pcmci`.

        Raises:
            ValueError: Settings or data that do not allow it.
            NotImplementedError: `selected_links`, `val_only`.
        """
        not_covered(selected_links=selected_links, val_only=val_only)
        given = parents or {}
        settings = {
            "tau_min": tau_min,
            "tau_max": tau_max,
            "pc_alpha": 0.2,
            "parents": [[(var, -lag) for var, lag in given.get(j, [])] for j in range(self.N)],
            "max_conds_py": max_conds_py,
            "max_conds_px": max_conds_px,
            "alpha_level": alpha_level,
            "fdr_method": fdr_method,
        }
        return self._matrices(self._run("mci", settings, link_assumptions), alpha_level)

    def run_pcmci(
        self,
        selected_links: None = None,
        link_assumptions: Links | None = None,
        tau_min: int = 0,
        tau_max: int = 1,
        save_iterations: bool = False,
        pc_alpha: float | Sequence[float] | None = 0.2,
        max_conds_dim: int | None = None,
        max_combinations: int = 1,
        max_conds_py: int | None = None,
        max_conds_px: int | None = None,
        alpha_level: float = 0.05,
        fdr_method: str = "none",
    ) -> Results:
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

        Raises:
            ValueError: Settings or data that do not allow it.
            NotImplementedError: `selected_links`, `save_iterations`.
        """
        not_covered(selected_links=selected_links, save_iterations=save_iterations)
        settings = {
            "tau_min": tau_min,
            "tau_max": tau_max,
            "pc_alpha": pc_alpha,
            "max_conds_dim": max_conds_dim,
            "max_combinations": max_combinations,
            "max_conds_py": max_conds_py,
            "max_conds_px": max_conds_px,
            "alpha_level": alpha_level,
            "fdr_method": fdr_method,
        }
        return self._matrices(self._run("pcmci", settings, link_assumptions), alpha_level)

    def run_pcmciplus(
        self,
        selected_links: None = None,
        link_assumptions: Links | None = None,
        tau_min: int = 0,
        tau_max: int = 1,
        pc_alpha: float | Sequence[float] | None = 0.01,
        contemp_collider_rule: str = "majority",
        conflict_resolution: bool = True,
        reset_lagged_links: bool = False,
        max_conds_dim: int | None = None,
        max_combinations: int = 1,
        max_conds_py: int | None = None,
        max_conds_px: int | None = None,
        max_conds_px_lagged: int | None = None,
        fdr_method: str = "none",
    ) -> Results:
        """PCMCI+: lagged links, and directed links at lag 0.

        Args:
            pc_alpha: Level of all tests; several, or None: a score chooses.
            contemp_collider_rule: "majority", "conservative" or "none".
            conflict_resolution: Whether contradictory directions are marked x-x.
            reset_lagged_links: Whether the skeleton starts from all lagged links.
            max_conds_px_lagged: How many parents of a lagged cause are conditions; None: as `max_conds_px`.

        Returns:
            As `run_pcmci`, and `sepsets` `{((i, -lag), j): [nodes]}`, `ambiguous_triples` `[((i, -lag), k, j)]`.

        Raises:
            ValueError: Settings or data that do not allow it.
            NotImplementedError: `selected_links`.
        """
        not_covered(selected_links=selected_links)
        settings = {
            "tau_min": tau_min,
            "tau_max": tau_max,
            "pc_alpha": pc_alpha,
            "contemp_collider_rule": contemp_collider_rule,
            "conflict_resolution": conflict_resolution,
            "reset_lagged_links": reset_lagged_links,
            "max_conds_dim": max_conds_dim,
            "max_combinations": max_combinations,
            "max_conds_py": max_conds_py,
            "max_conds_px": max_conds_px,
            "max_conds_px_lagged": max_conds_px_lagged,
        }
        found = self._run("pcmciplus", settings, link_assumptions)
        # The graph is that without correction, as in the reference.
        found["q_matrix"] = self.get_corrected_pvalues(
            found["p_matrix"], fdr_method, tau_min=tau_min, tau_max=tau_max, link_assumptions=link_assumptions
        )
        level = pc_alpha if isinstance(pc_alpha, (int, float)) else found["optimal_alpha"]
        answer = self._matrices(found, level)
        pairs = [((i, -lag), j) for lag in range(tau_max + 1) for i in range(self.N) for j in range(self.N)]
        sepsets: dict[Any, list[tuple[int, int]]] = {pair: [] for pair in pairs}
        for (var, lag), effect, conditions in found["sepsets"]:
            sepsets[(var, -lag), effect] = [(i, -t) for i, t in conditions]
        triples = [((var, -lag), k, j) for (var, lag), k, j in found["ambiguous_triples"]]
        return {**answer, "sepsets": sepsets, "ambiguous_triples": triples}

    def run_fullci(
        self,
        selected_links: None = None,
        link_assumptions: Links | None = None,
        tau_min: int = 0,
        tau_max: int = 1,
        val_only: bool = False,
        alpha_level: float = 0.05,
        fdr_method: str = "none",
    ) -> Results:
        """Each link given all other lagged variables.

        Args:
            link_assumptions: As in `run_pcmci`; so are the lags, `alpha_level` and `fdr_method`.

        Returns:
            As `run_pcmci`.
        """
        not_covered(selected_links=selected_links, val_only=val_only)
        return self._simple("fullci", link_assumptions, tau_min, tau_max, alpha_level, fdr_method)

    def run_bivci(
        self,
        selected_links: None = None,
        link_assumptions: Links | None = None,
        tau_min: int = 0,
        tau_max: int = 1,
        val_only: bool = False,
        alpha_level: float = 0.05,
        fdr_method: str = "none",
    ) -> Results:
        """Each link given the past of its effect.

        Args:
            link_assumptions: As in `run_pcmci`; so are the lags, `alpha_level` and `fdr_method`.

        Returns:
            As `run_pcmci`.
        """
        not_covered(selected_links=selected_links, val_only=val_only)
        return self._simple("bivci", link_assumptions, tau_min, tau_max, alpha_level, fdr_method)

    def get_lagged_dependencies(
        self,
        selected_links: None = None,
        link_assumptions: Links | None = None,
        tau_min: int = 0,
        tau_max: int = 1,
        val_only: bool = False,
        alpha_level: float = 0.05,
        fdr_method: str = "none",
    ) -> Results:
        """The dependence of all pairs at all lags, given nothing.

        Args:
            link_assumptions: As in `run_pcmci`; so are the lags, `alpha_level` and `fdr_method`.

        Returns:
            As `run_pcmci`.
        """
        not_covered(selected_links=selected_links, val_only=val_only)
        return self._simple("lagged_dependencies", link_assumptions, tau_min, tau_max, alpha_level, fdr_method)

    def _simple(
        self,
        method: str,
        link_assumptions: Links | None,
        tau_min: int,
        tau_max: int,
        alpha_level: float,
        fdr_method: str,
    ) -> Results:
        settings = {
            "tau_min": tau_min,
            "tau_max": tau_max,
            "pc_alpha": 0.2,
            "alpha_level": alpha_level,
            "fdr_method": fdr_method,
        }
        return self._matrices(self._run(method, settings, link_assumptions), alpha_level)

    def run_sliding_window_of(
        self, method: str, method_args: Mapping[str, Any], window_step: int, window_length: int, conf_lev: float = 0.9
    ) -> Results:
        """Runs a method in windows of the samples. The past of a window's first samples lies before it.

        Args:
            method: Such as "run_pcmci".
            method_args: Its keywords.
            window_step: Steps from one window to the next.
            window_length: Samples of a window.
            conf_lev: Level of the interval of values over the windows.

        Returns:
            `window_results`: the method's arrays with the window as first axis; `summary_results`: see
            `return_summary_results`.

        Raises:
            SettingError: A method that is not there, a window longer than the data.
        """
        if window_step < 1 or not 1 <= window_length < self.dataframe.largest_time_step:
            raise SettingError(
                f"setting 'window_length': {window_length} (step {window_step}) does not fit into "
                f"{self.dataframe.largest_time_step} samples"
            )
        _repeatable(method)
        runs = []
        try:
            for start in range(0, self.dataframe.largest_time_step - window_length, window_step):
                window = np.arange(start, start + window_length)
                self._points = np.intersect1d(window, self.dataframe.reference_points)
                runs.append(getattr(self, method)(**method_args))
        finally:
            self._points = None
        joined = results.joined(runs)
        return {"summary_results": results.summary(joined, conf_lev), "window_results": joined}

    def run_bootstrap_of(
        self,
        method: str,
        method_args: Mapping[str, Any],
        boot_samples: int = 100,
        boot_blocklength: int | str = 1,
        conf_lev: float = 0.9,
        aggregation: str = "majority",
        seed: int | None = None,
    ) -> Results:
        """Runs a method again and again on times drawn with replacement; lags stay whole.

        Args:
            method: Such as "run_pcmci".
            method_args: Its keywords.
            boot_samples: Number of draws.
            boot_blocklength: Neighbouring times that are drawn together, or "cube_root".
            conf_lev: Level of the interval of values over the draws.
            aggregation: "majority".
            seed: Of the draws; None: another one each time.

        Returns:
            `boot_results`: the method's arrays with the draw as first axis; `summary_results`: see `return_summary_results`.

        Raises:
            ValueError: A method that is not there, a block that is too long, data that are too few.
            NotImplementedError: `boot_blocklength="from_autocorrelation"`.

        Example:
            >>> import numpy as np
            >>> from roscausal.tigramite import data_processing as pp
            >>> from roscausal.tigramite.independence_tests.parcorr import ParCorr
            >>> from roscausal.tigramite.pcmci import PCMCI
            >>> x = np.random.default_rng(1).normal(size=(300, 2))
            >>> x[1:, 1] += x[:-1, 0]
            >>> found = PCMCI(pp.DataFrame(x), ParCorr()).run_bootstrap_of("run_pcmci", {"tau_max": 1}, boot_samples=30, seed=42)
            >>> float(found["summary_results"]["link_frequency"][0, 1, 1])
            1.0
        """
        _repeatable(method)
        if aggregation != "majority" or boot_blocklength == "from_autocorrelation":
            what = boot_blocklength if aggregation == "majority" else aggregation
            raise NotCovered(f"'{what}' is not covered by roscausal.tigramite; leave it out, or use tigramite for this run")
        test = self.cond_ind_test
        if hasattr(test, "run_test") and not (hasattr(test, "spec") or hasattr(test, "run_test_raw")):
            raise SettingError("setting 'cond_ind_test': a test on nodes sees no data, so that resamples say nothing")
        if isinstance(boot_samples, bool) or not hasattr(boot_samples, "__index__") or boot_samples < 1:
            raise SettingError(f"setting 'boot_samples': {boot_samples!r} is not a number of draws from 1 on")
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

    @staticmethod
    def return_summary_results(results_of_runs: Mapping[str, Any], conf_lev: float = 0.9, aggregation: str = "majority") -> Results:
        """The most frequent marks of many runs, how frequent they are, mean values and intervals.

        Args:
            results_of_runs: `graph` and `val_matrix` with the run as first axis.
            conf_lev: Level of the interval of values.
            aggregation: "majority".

        Returns:
            `most_frequent_links`, `link_frequency`, `val_matrix_mean` (N, N, tau_max + 1); `val_matrix_interval` (.., 2).
        """
        return results.summary(results_of_runs, conf_lev, aggregation)

    def get_corrected_pvalues(
        self,
        p_matrix: NDArray[Any],
        fdr_method: str = "fdr_bh",
        exclude_contemporaneous: bool = True,
        tau_min: int = 0,
        tau_max: int = 1,
        link_assumptions: Links | None = None,
    ) -> NDArray[np.float64]:
        """P-values corrected for many tests (Benjamini and Hochberg).

        Args:
            p_matrix: (N, N, tau_max + 1).
            fdr_method: "none" or "fdr_bh".
            exclude_contemporaneous: Whether lag 0 stays as it is and does not count.
            link_assumptions: Links that are not listed do not count.

        Returns:
            The corrected p-values, of the same shape.
        """
        p_values = np.ascontiguousarray(p_matrix, dtype=np.float64)
        if fdr_method == "none":
            return p_values
        if fdr_method != "fdr_bh":
            raise SettingError(f"setting 'fdr_method': '{fdr_method}' is unknown; allowed: none, fdr_bh")
        counted = np.ones(p_values.shape, dtype=bool)
        if link_assumptions is not None:
            counted[:] = False
            for cause, effect, lag, _ in results.link_list(link_assumptions, tau_min, tau_max) or []:
                counted[cause, effect, lag] = True
        diagonal = np.arange(p_values.shape[0])
        counted[diagonal, diagonal, 0] = False
        if exclude_contemporaneous:
            counted[:, :, 0] = False
        return _native.fdr_bh(p_values, counted)

    def get_graph_from_pmatrix(
        self,
        p_matrix: NDArray[Any],
        alpha_level: float,
        tau_min: int,
        tau_max: int,
        link_assumptions: Links | None = None,
    ) -> NDArray[np.str_]:
        """The marks of the links whose p-value is at most the level: --> with a lag, o-o at lag 0, or as assumed.

        Args:
            p_matrix: (N, N, tau_max + 1).
            alpha_level: The level.
            tau_min: Smallest lag of a link.
            tau_max: Largest lag of a link.
            link_assumptions: Links that are not listed are absent.

        Returns:
            Marks <U3 (N, N, tau_max + 1).
        """
        return results.graph_of_p(p_matrix, alpha_level, tau_min, tau_max, link_assumptions)

    @staticmethod
    def graph_to_dict(graph: NDArray[Any]) -> dict[int, dict[tuple[int, int], str]]:
        """The graph as `{j: {(i, -lag): mark}}`."""
        return results.graph_as_dict(graph)

    def return_parents_dict(
        self, graph: NDArray[Any], val_matrix: NDArray[Any], include_lagzero_parents: bool = False
    ) -> dict[int, list[tuple[int, int]]]:
        """The parents of each variable, `{j: [(i, -lag), ..]}`, the strongest first."""
        return results.parents_of(graph, val_matrix, include_lagzero_parents)

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
        self,
        p_matrix: NDArray[Any],
        val_matrix: NDArray[Any],
        conf_matrix: NDArray[Any] | None = None,
        graph: NDArray[Any] | None = None,
        ambiguous_triples: object = None,
        alpha_level: float = 0.05,
    ) -> None:
        """Prints the links of these matrices; without a graph, those whose p-value is at most the level."""
        if graph is None:
            graph = results.graph_of_p(p_matrix, alpha_level, 0, p_matrix.shape[2] - 1, None)
        print(results.text(self.dataframe.names, p_matrix, val_matrix, conf_matrix, graph, alpha_level))


def _repeatable(method: str) -> None:
    known = ["run_pcmci", "run_pcmciplus", "run_mci", "run_fullci", "run_bivci", "get_lagged_dependencies"]
    if method not in known:
        raise SettingError(f"setting 'method': '{method}' cannot be run again and again; allowed: {', '.join(known)}")


def _plain(value: Any) -> Any:
    """numpy's numbers and arrays as JSON has them."""
    if hasattr(value, "tolist"):
        return value.tolist()
    raise SettingError(f"a setting is {value!r}, of type {type(value).__name__}, which is neither a number nor a list")
