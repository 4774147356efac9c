"""`Models`, `Prediction`: regressors given the parents of variables. `LinearMediation`: how strongly variables drive, are driven and pass
on, in linear equations of a known graph (Runge et al. 2015).

Phi(s)[j, i] is the coefficient of i at s steps before in the equation of j. A pulse of i has, after tau steps, the effect Psi(tau)[j, i]:
Psi(0) = (1 - Phi(0))^-1, Psi(tau) = Psi(0) (Phi(1) Psi(tau - 1) + .. + Phi(tau) Psi(0)). What passes through k is Psi without that of the
equations in which nothing drives k.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy, deepcopy
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from .._native import DataError, SettingError
from .data_processing import bootstrapped
from .pcmci import PCMCI
from .refusal import NotCovered, not_covered
from .results import interval

LagMode = Literal["absmax", "all_lags"]
Parents = Mapping[int, Sequence[tuple[int, int]]]


class Models:
    """A regressor for each variable, on its parents.

    Args:
        dataframe: The data.
        model: A regressor as those of scikit-learn; each variable gets a copy.
        data_transform: Such as a `StandardScaler`, of each variable and its parents; predictions are in its units.
        mask_type: Roles in which masked values exclude a sample: z is the parents, x and y are the effect.

    Example:
        >>> import numpy as np
        >>> from roscausal.tigramite import data_processing as pp
        >>> from roscausal.tigramite.models import Models
        >>> models = Models(pp.DataFrame(np.arange(8.0).reshape(4, 2)), model=None)
        >>> sorted(models.fit_full_model({0: [], 1: []})), models.predict_full_model()[1].tolist()
        ([0, 1], [4.0, 4.0, 4.0, 4.0])
    """

    def __init__(
        self, dataframe: Any, model: Any, conditional_model: None = None, data_transform: Any = None, mask_type: str | None = None,
        verbosity: int = 0,
    ) -> None:  # fmt: skip
        not_covered(conditional_model=conditional_model)
        self.dataframe, self.model, self.data_transform, self.mask_type = dataframe, model, data_transform, mask_type
        self.N: int = dataframe.N

    def __getattr__(self, name: str) -> Any:
        if name in ("phi", "psi", "all_psi_k", "phi_boots", "fit_results"):
            raise SettingError(f"there is no {name} before fit_model{'_bootstrap' * name.endswith('boots')}")
        if name.startswith("_"):
            raise AttributeError(name)
        kind = type(self).__name__
        raise NotCovered(f"{kind}.{name} is not covered by roscausal; tigramite.models.{kind} takes our frames")

    def _given(self, all_parents: Parents, tau_max: int | None, variables: Sequence[int]) -> None:
        self.all_parents = {j: list(all_parents.get(j, [])) for j in variables}
        longest = max((-lag for of in self.all_parents.values() for _, lag in of), default=0)
        self.tau_max = longest if tau_max is None else tau_max
        if longest > self.tau_max:
            raise SettingError(f"setting 'tau_max': {self.tau_max} is less than the largest lag of a parent, {longest}")

    def _rows(self, dataframe: Any, j: int, cut_off: str = "max_lag_or_tau_max") -> NDArray[np.float64]:
        """The effect twice, then its parents."""
        node, parents = [(j, 0)], self.all_parents[j]
        return np.asarray(dataframe.construct_array(node, node, parents, tau_max=self.tau_max, mask_type=self.mask_type, cut_off=cut_off)[0])

    def fit_full_model(
        self, all_parents: Parents, selected_variables: Sequence[int] | None = None, tau_max: int | None = None,
        cut_off: str = "max_lag_or_tau_max", empty_predictors_function: Callable[..., Any] = np.mean, return_data: bool = False,
    ) -> dict[int, dict[str, Any]]:  # fmt: skip
        """Fits the regressors of `{j: [(i, -lag), ..]}`: `{j: {"model", "data_transform"}}`, and "data" (the variable twice, then its parents)
        if so asked; without parents the model is what `empty_predictors_function` makes of the values."""
        self._given(all_parents, tau_max, range(self.N) if selected_variables is None else selected_variables)
        self.fit_results: dict[int, dict[str, Any]] = {}
        for j in self.all_parents:
            rows, scale = self._rows(self.dataframe, j, cut_off), deepcopy(self.data_transform)
            if scale is not None:
                rows = scale.fit_transform(rows.T).T
            model = deepcopy(self.model).fit(rows[2:].T, rows[1]) if len(rows) > 2 else float(empty_predictors_function(rows[1]))
            self.fit_results[j] = {"data_transform": scale, **({"data": rows} if return_data else {}), "model": model}
        return self.fit_results

    def predict_full_model(
        self, new_data: Any = None, pred_params: Mapping[str, Any] | None = None, cut_off: str = "max_lag_or_tau_max"
    ) -> list[NDArray[np.float64]]:
        """What each regressor predicts, of the data or of new ones."""
        frame = self.dataframe if new_data is None else new_data
        return [self._predicted(self._scaled(frame, j, cut_off), j, pred_params) for j in self.fit_results]

    def _scaled(self, dataframe: Any, j: int, cut_off: str) -> NDArray[np.float64]:
        rows, scale = self._rows(dataframe, j, cut_off), self.fit_results[j]["data_transform"]
        return rows if scale is None else np.asarray(scale.transform(rows.T).T)

    def _predicted(self, rows: NDArray[np.float64], j: int, pred_params: Mapping[str, Any] | None) -> NDArray[np.float64]:
        model = self.fit_results[j]["model"]
        return np.full(rows.shape[1], model) if len(rows) == 2 else np.asarray(model.predict(rows[2:].T, **(pred_params or {})))

    def get_coefs(self) -> dict[int, dict[tuple[int, int], float]]:
        """The coefficients of linear regressors as `{j: {(i, -lag): b}}`."""
        return {j: dict(zip(of, self.fit_results[j]["model"].coef_)) if of else {} for j, of in self.all_parents.items()}

    def get_val_matrix(self) -> NDArray[np.float64]:
        """The coefficients of linear regressors (N, N, tau_max + 1) as [cause, effect, lag]."""
        values = np.zeros((self.N, self.N, self.tau_max + 1))
        for j, of in self.get_coefs().items():
            for (i, lag), b in of.items():
                values[i, j, -lag] = b
        return values


class Prediction(Models):
    """Predicts variables of one dataset from causes that are found in the training data.

    Args:
        train_indices: Times to fit on, as numbers or as True for each time; so are test_indices.
        prediction_model: As `model` of `Models`; `cond_ind_test` is for `get_predictors`.

    Example:
        >>> import numpy as np
        >>> from roscausal.tigramite import data_processing as pp
        >>> from roscausal.tigramite.independence_tests.parcorr import ParCorr
        >>> from roscausal.tigramite.models import Prediction
        >>> x = np.random.default_rng(1).normal(size=(300, 2))
        >>> x[1:, 1] += x[:-1, 0]
        >>> pred = Prediction(pp.DataFrame(x), range(200), range(200, 300), prediction_model=None, cond_ind_test=ParCorr())
        >>> pred.get_predictors(tau_max=2, pc_alpha=0.01)[1]
        [(0, -1)]
    """

    def __init__(
        self, dataframe: Any, train_indices: Any, test_indices: Any, prediction_model: Any, cond_ind_test: Any = None,
        data_transform: Any = None, verbosity: int = 0,
    ) -> None:  # fmt: skip
        self._test, train = _only(dataframe, test_indices), _only(dataframe, train_indices)
        self.cond_ind_test = cond_ind_test
        super().__init__(train, prediction_model, data_transform=data_transform, mask_type="y")

    def get_predictors(
        self, selected_targets: Sequence[int] | None = None, selected_links: None = None, steps_ahead: int = 1, tau_max: int = 1,
        pc_alpha: float | Sequence[float] | None = 0.2, max_conds_dim: int | None = None, max_combinations: int = 1,
    ) -> dict[int, list[tuple[int, int]]]:  # fmt: skip
        """The parents that `PCMCI.run_pc_stable` finds in the training data from `steps_ahead` steps before, of all variables."""
        test = copy(self.cond_ind_test)
        test.mask_type = self.mask_type
        return PCMCI(self.dataframe, test).run_pc_stable(
            selected_links, None, steps_ahead, tau_max, False, pc_alpha, max_conds_dim, max_combinations
        )

    def fit(
        self, target_predictors: Parents, selected_targets: Sequence[int] | None = None, tau_max: int | None = None, return_data: bool = False
    ) -> Prediction:
        """Fits the regressors of `{j: [(i, -lag), ..]}` to the training data."""
        self.fit_full_model(target_predictors, selected_targets, tau_max, return_data=return_data)
        return self

    def predict(
        self, target: int | Sequence[int], new_data: Any = None, pred_params: Mapping[str, Any] | None = None,
        cut_off: str = "max_lag_or_tau_max",
    ) -> Any:  # fmt: skip
        """What is predicted of a variable in the test data or in new ones; of a list of variables a list, of all an array (T, N)."""
        targets = [target] if isinstance(target, (int, np.integer)) else list(target)
        self._arrays = {j: self._scaled(self._test if new_data is None else new_data, j, cut_off) for j in targets}
        found = [self._predicted(rows, j, pred_params) for j, rows in self._arrays.items()]
        if len(found) == 1:
            return found[0]
        return np.stack(found, axis=1) if targets == list(range(self.N)) else found

    def get_test_array(self, j: int) -> NDArray[np.float64]:
        """The rows of the last `predict`: the variable twice, then its predictors."""
        return self._arrays[j]

    def get_train_array(self, j: int) -> NDArray[np.float64]:
        """The rows of a `fit` with `return_data=True`."""
        return np.asarray(self.fit_results[j]["data"])


def _only(dataframe: Any, times: Any) -> Any:
    """The frame with all other times masked."""
    chosen, mask = copy(dataframe), np.ones((dataframe.largest_time_step, dataframe.Ndata), dtype=bool)
    mask[np.asarray(times)] = False
    if len(dataframe.datasets) > 1:
        raise NotCovered("Prediction of several datasets is not covered by roscausal.tigramite; give one")
    chosen.mask = {key: mask | (False if dataframe.mask is None else dataframe.mask[key]) for key in dataframe.datasets}
    return chosen


class LinearMediation(Models):
    """Effects along the links of a graph, from linear regressions of each variable on its parents.

    Args:
        dataframe: The data.
        data_transform: A `StandardScaler` of scikit-learn, or "standardise": in standard deviations; None: in the data's units.
        mask_type: Roles in which masked values exclude a sample: z is the parents, x and y are the effect.

    Attributes:
        phi: Coefficients (tau_max + 1, N, N) as [lag, effect, cause].
        psi: Effects by all paths, of the same shape.
        all_psi_k: Effects by the paths around each variable, (N, tau_max + 1, N, N).

    Example:
        >>> import numpy as np
        >>> from roscausal.tigramite import data_processing as pp
        >>> from roscausal.tigramite.models import LinearMediation
        >>> x = np.random.default_rng(1).normal(size=(2000, 3))
        >>> for t in range(1, 2000):
        ...     x[t, 1:] += 0.5 * x[t - 1, :2]
        >>> med = LinearMediation(pp.DataFrame(x), data_transform=None)
        >>> med.fit_model({0: [], 1: [(0, -1)], 2: [(1, -1)]}, tau_max=3)
        >>> round(med.get_ce(0, -2, 2), 1), round(med.get_mce(0, -2, 2, 1), 1), round(med.get_coeff(0, -2, 2), 1)
        (0.2, 0.2, 0.0)
    """

    def __init__(
        self, dataframe: Any, model_params: None = None, data_transform: Any = "standardise", mask_type: str | None = None, verbosity: int = 0,
    ) -> None:  # fmt: skip
        not_covered(model_params=model_params)
        if data_transform not in (None, "standardise") and type(data_transform).__name__ != "StandardScaler":
            raise NotCovered(f"data_transform={data_transform!r} is not covered by roscausal.tigramite; give a StandardScaler, or None")
        super().__init__(dataframe, None, data_transform=data_transform, mask_type=mask_type)

    def fit_model(self, all_parents: Parents, tau_max: int | None = None, return_data: bool = False) -> None:
        """Fits the equations of `{j: [(i, -lag), ..]}` and follows effects to `tau_max` steps; None: to the largest lag of a parent.

        Raises:
            DataError: Fewer samples than coefficients.
        """
        not_covered(return_data=return_data)
        self._given(all_parents, tau_max, range(self.N))
        self._follow(self._coefficients())

    def _follow(self, phi: NDArray[np.float64]) -> None:
        self.phi, self.psi = phi, _effects(phi)
        self.all_psi_k = np.stack([self._around(k) for k in range(self.N)])

    def _coefficients(self) -> NDArray[np.float64]:
        phi = np.zeros((self.tau_max + 1, self.N, self.N))
        for j, parents in self.all_parents.items():
            if not parents:
                continue
            rows = self._rows(self.dataframe, j)[1:]
            if rows.shape[1] <= len(parents) + 1:
                raise DataError(f"{rows.shape[1]} samples are too few for an equation of {len(parents)} parents; record longer")
            found = slopes(rows[0], rows[1:])
            if self.data_transform is not None:
                deviations = rows.std(axis=1)
                found *= deviations[1:] / (deviations[0] or 1.0)
            for (i, lag), b in zip(parents, found):
                phi[-lag, j, i] = b
        return phi

    def fit_model_bootstrap(self, boot_blocklength: int = 1, seed: int | None = None, boot_samples: int = 100) -> None:
        """Fits the equations again on samples drawn with replacement, in blocks of so many, for `get_bootstrap_of`."""
        self.phi_boots = np.stack(bootstrapped(self.dataframe, self._coefficients, boot_samples, boot_blocklength, seed))

    def get_bootstrap_of(self, function: str, function_args: Mapping[str, Any], conf_lev: float = 0.9) -> NDArray[np.float64]:
        """The interval [low, high] of what a `get_` method returns, over the bootstraps of `fit_model_bootstrap`."""
        whole, found = self.phi, []
        try:
            for phi in self.phi_boots:
                self._follow(phi)
                found.append(getattr(self, function)(**function_args))
        finally:
            self._follow(whole)
        return interval(found, conf_lev)

    def _around(self, *mediators: int | Sequence[int]) -> NDArray[np.float64]:
        cut = self.phi.copy()
        for of in mediators:
            cut[:, of, :] = 0.0
        return _effects(cut)

    def get_coefs(self) -> dict[int, dict[tuple[int, int], float]]:
        """The coefficients as `{j: {(i, -lag): b}}`."""
        return {j: {(i, lag): float(self.phi[-lag, j, i]) for i, lag in of} for j, of in self.all_parents.items()}

    def get_coeff(self, i: int, tau: int, j: int) -> float:
        """The coefficient of i, `tau` steps before, in the equation of j."""
        return float(self.phi[abs(tau), j, i])

    def get_val_matrix(self, symmetrize: bool = False) -> NDArray[np.float64]:
        """The coefficients (N, N, tau_max + 1) as [cause, effect, lag]; `symmetrize`: at lag 0 from both sides."""
        values = self.phi.transpose(2, 1, 0).copy()
        if symmetrize:
            values[:, :, 0] = np.where(values[:, :, 0] == 0, values[:, :, 0].T, values[:, :, 0])
        return values

    def get_ce(self, i: int, tau: int, j: int) -> float:
        """The effect of a unit of i on j after `tau` steps, by all paths."""
        return float(self.psi[abs(tau), j, i])

    def get_ce_max(self, i: int, j: int) -> float:
        """The largest effect of i on j over the lags, with its sign."""
        effects = self.psi[:, j, i]
        return float(effects[np.argmax(np.abs(effects))])

    def get_joint_ce(self, i: int, j: int) -> NDArray[np.float64]:
        """The effect of i on j at each lag (tau_max + 1,), by the paths on which i comes only once."""
        return self._around(i)[:, j, i]

    def get_mce(self, i: int, tau: int, j: int, k: int | Sequence[int]) -> float:
        """The part of `get_ce` that passes through k (one variable, or any of several)."""
        return float(self.psi[abs(tau), j, i] - self._around(k)[abs(tau), j, i])

    def get_mediation_graph_data(self, i: int, tau: int, j: int, include_neighbors: bool = False) -> dict[str, NDArray[np.float64]]:
        """What tigramite's pictures of `get_ce` take: the part that passes through each variable (N,), and the links on its paths, by lag
        (N, N, tau_max + 1) and between the moments of a window, (variable, moment) to (variable, moment)."""
        not_covered(include_neighbors=include_neighbors)
        n, moments = self.N, self.tau_max + 2
        links = np.zeros((n, moments, n, moments))
        for lag, of in enumerate(self.phi):
            for t in range(moments - lag):
                links[:, t, :, t + lag] = of.T
        flat = links.reshape(n * moments, -1)
        # How many paths lead from each to each.
        paths = np.linalg.inv(np.eye(len(flat)) - (flat != 0))
        start, end = (i + 1) * moments - 1 - abs(tau), (j + 1) * moments - 1
        flat *= np.outer(paths[start], paths[:, end]) > 0.5
        lags = [sum(links[:, t, :, t + lag] != 0 for t in range(moments - lag)) > 0 for lag in range(self.tau_max + 1)]
        through = [self.get_mce(i, tau, j, k) for k in range(n)]
        return {
            "path_node_array": np.array(through),
            "path_val_matrix": np.where(np.stack(lags, axis=2), self.get_val_matrix(), 0.0),
            "tsg_path_val_matrix": flat,
        }

    def get_conditional_mce(self, i: int, tau: int, j: int, k: int | Sequence[int], notk: int | Sequence[int]) -> float:
        """The part of `get_ce` that passes through k, and not through notk."""
        at = (abs(tau), j, i)
        return float(self._around(notk)[at] - self._around(notk, k)[at])

    def get_joint_mce(self, i: int, j: int, k: int | Sequence[int]) -> NDArray[np.float64]:
        """The part of `get_joint_ce` that passes through k."""
        return (self._around(i) - self._around(i, k))[:, j, i]

    def get_all_ace(self, lag_mode: LagMode = "absmax", exclude_i: bool = True) -> NDArray[np.float64]:
        """Average causal effect of each variable: the mean, over the variables, of its largest effect ("absmax"), or over the lags."""
        return np.ma.filled(_over_lags(self.psi, lag_mode, exclude_i).mean(axis=0), 0.0)

    def get_all_acs(self, lag_mode: LagMode = "absmax", exclude_j: bool = True) -> NDArray[np.float64]:
        """Average causal susceptibility of each variable: the same mean of the effects on it."""
        return np.ma.filled(_over_lags(self.psi, lag_mode, exclude_j).mean(axis=1), 0.0)

    def get_all_amce(
        self, lag_mode: LagMode = "absmax", exclude_k: bool = True, exclude_self_effects: bool = True
    ) -> NDArray[np.float64]:
        """Average mediated effect of each variable: the mean, over pairs, of what passes through it. `exclude_k`: pairs with itself do not
        count; `exclude_self_effects`: a variable with itself is no pair, only with "absmax"."""
        found = []
        for k in range(self.N):
            parts = _over_lags(self.psi - self.all_psi_k[k], lag_mode, exclude_self_effects and lag_mode == "absmax")
            if exclude_k:
                parts[k, :] = parts[:, k] = np.ma.masked
            found.append(float(np.ma.filled(parts.mean(), 0.0)))
        return np.array(found)

    def get_ace(self, i: int, lag_mode: LagMode = "absmax", exclude_i: bool = True) -> float:
        """That of `get_all_ace` of one variable."""
        return float(self.get_all_ace(lag_mode, exclude_i)[i])

    def get_acs(self, j: int, lag_mode: LagMode = "absmax", exclude_j: bool = True) -> float:
        """That of `get_all_acs` of one variable."""
        return float(self.get_all_acs(lag_mode, exclude_j)[j])

    def get_amce(self, k: int, lag_mode: LagMode = "absmax", exclude_k: bool = True, exclude_self_effects: bool = True) -> float:
        """That of `get_all_amce` of one variable."""
        return float(self.get_all_amce(lag_mode, exclude_k, exclude_self_effects)[k])


def slopes(target: NDArray[np.float64], causes: NDArray[np.float64]) -> NDArray[np.float64]:
    """The coefficients (K,) of a linear regression of a target (n,) on causes (K, n)."""
    centred = (causes - causes.mean(axis=1, keepdims=True)).T
    return np.asarray(np.linalg.lstsq(centred, target - target.mean(), rcond=None)[0])


def _effects(phi: NDArray[np.float64]) -> NDArray[np.float64]:
    at_once = np.linalg.inv(np.eye(phi.shape[1]) - phi[0])
    psi = [at_once]
    for tau in range(1, len(phi)):
        psi.append(at_once @ sum(phi[s] @ psi[tau - s] for s in range(1, tau + 1)))
    return np.stack(psi)


def _over_lags(effects: NDArray[np.float64], lag_mode: str, without_self: bool) -> np.ma.MaskedArray[Any, Any]:
    if lag_mode not in ("absmax", "all_lags"):
        raise SettingError(f"setting 'lag_mode': '{lag_mode}' is unknown; allowed: absmax, all_lags")
    sizes = np.abs(effects)
    found = sizes.max(axis=0) if lag_mode == "absmax" else sizes.mean(axis=0)
    return np.ma.array(found, mask=np.eye(len(found), dtype=bool) & without_self)
