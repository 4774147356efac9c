"""`DataFrame`: the data of an analysis, with masks, missing values, several datasets and reference points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _native
from .._native import DataError, SettingError
from ..data import array_of
from .refusal import not_covered, unknown

Nodes = Sequence[tuple[int, int]]
_CUT_OFFS = ("2xtau_max", "tau_max", "max_lag", "max_lag_or_tau_max", "2xtau_max_future")


class DataFrame:
    """Time series of N variables.

    Args:
        data: An array (T, N); with `analysis_mode="multiple"` a dict of arrays (T_k, N), or an array (M, T, N).
        mask: Like `data`, True where a value is excluded; which roles exclude is the test's `mask_type`.
        missing_flag: Values equal to it are missing. NaN always is.
        var_names: N different names; None: 0 to N - 1.
        datatime: T times, for drawing; like `data` with several datasets.
        analysis_mode: "single" or "multiple".
        reference_points: Times t that count as samples, 0 to T - 1; None: all.
        time_offsets: With several datasets: the time of the first row of each.
        remove_missing_upto_maxlag: Whether a missing value also excludes the samples up to 2 tau_max after it.

    Raises:
        DataError: Data of another shape, or infinite values.
        SettingError: An unknown keyword, or names that repeat.
        NotImplementedError: `vector_vars`, `data_type`.

    Example:
        >>> import numpy as np
        >>> from roscausal.tigramite.data_processing import DataFrame
        >>> frame = DataFrame(np.zeros((50, 2)), var_names=["a", "b"])
        >>> frame.N, frame.T
        (2, {0: 50})
    """

    def __init__(
        self,
        data: Any,
        mask: Any = None,
        missing_flag: float | None = None,
        vector_vars: None = None,
        var_names: Sequence[Any] | None = None,
        data_type: None = None,
        datatime: Any = None,
        analysis_mode: Literal["single", "multiple"] = "single",
        reference_points: ArrayLike | None = None,
        time_offsets: Mapping[Any, int] | None = None,
        remove_missing_upto_maxlag: bool = False,
        **others: object,
    ) -> None:
        not_covered(vector_vars=vector_vars, data_type=data_type)
        unknown("DataFrame", others, ("data", "mask", "missing_flag", "var_names", "datatime", "analysis_mode"))
        if analysis_mode not in ("single", "multiple"):
            raise SettingError(f"setting 'analysis_mode': '{analysis_mode}' is unknown; allowed: single, multiple")
        self.analysis_mode = analysis_mode
        self.values: dict[Any, NDArray[np.float64]] = {
            key: array_of(values, f"dataset {key}").copy() for key, values in self._datasets(data, "data").items()
        }
        self.datasets = list(self.values)
        self.M = len(self.datasets)
        widths = {array.shape[1] for array in self.values.values()}
        if len(widths) != 1:
            raise DataError(f"the datasets have {', '.join(str(w) for w in sorted(widths))} columns; all need the same variables")
        self.N = widths.pop()
        self.T = {key: array.shape[0] for key, array in self.values.items()}
        self.missing_flag = missing_flag
        if missing_flag is not None:
            for array in self.values.values():
                array[array == missing_flag] = np.nan
        self.mask = None if mask is None else self._masks(mask)
        self.var_names: Any = dict(enumerate(range(self.N))) if var_names is None else list(var_names)
        self._check_names()
        self.remove_missing_upto_maxlag = remove_missing_upto_maxlag
        self.time_offsets = dict.fromkeys(self.datasets, 0) if time_offsets is None else dict(time_offsets)
        if sorted(map(str, self.time_offsets)) != sorted(map(str, self.datasets)):
            raise SettingError("setting 'time_offsets': give one offset per dataset, under the dataset's key")
        self.largest_time_step = max(self.T[key] + self.time_offsets[key] for key in self.datasets)
        self._all_points = reference_points is None
        points = np.arange(self.largest_time_step) if reference_points is None else np.unique(np.atleast_1d(reference_points))
        if points.dtype.kind not in "iu" or points.size == 0 or points.min() < 0 or points.max() >= self.largest_time_step:
            raise SettingError(f"setting 'reference_points': give whole numbers from 0 to {self.largest_time_step - 1}")
        self.reference_points = points
        self.datatime = {key: np.arange(self.T[key]) for key in self.datasets} if datatime is None else self._datasets(datatime, "datatime")
        self._frames: dict[str | None, _native.Frame] = {}

    def _datasets(self, data: Any, what: str) -> dict[Any, Any]:
        if self.analysis_mode == "single":
            if isinstance(data, Mapping):
                raise DataError(f"{what} is a dict; several datasets need analysis_mode='multiple'")
            return {0: data}
        if isinstance(data, Mapping):
            return dict(data)
        if getattr(data, "ndim", 0) == 3:
            return dict(enumerate(data))
        raise DataError(f"{what} of analysis_mode='multiple' is a dict of arrays (T, N), or one array (M, T, N)")

    def _masks(self, mask: Any) -> dict[Any, NDArray[np.bool_]]:
        masks = {key: np.ascontiguousarray(each, dtype=bool) for key, each in self._datasets(mask, "mask").items()}
        shapes = {key: array.shape for key, array in self.values.items()}
        if {key: each.shape for key, each in masks.items()} != shapes:
            raise DataError("the mask's shape differs from that of the data")
        return masks

    def _check_names(self) -> None:
        names = [str(self.var_names[k]) for k in range(len(self.var_names))]
        if len(names) != self.N:
            raise SettingError(f"setting 'var_names': {len(names)} names for {self.N} variables")
        repeated = next((name for name in names if names.count(name) > 1), None)
        if repeated is not None:
            raise SettingError(f"setting 'var_names': '{repeated}' is there twice; give each variable a name of its own")
        self.names = names

    def frame(self, mask_type: str | None, points: NDArray[Any] | None = None) -> _native.Frame:
        """The data as the engine takes them, with a test's `mask_type`; `points` replaces the reference points."""
        if points is None and mask_type in self._frames:
            return self._frames[mask_type]
        masks = None if self.mask is None or not mask_type else [self.mask[key] for key in self.datasets]
        chosen = None
        if points is not None or not self._all_points:
            chosen = [self._of_dataset(key, self.reference_points if points is None else points) for key in self.datasets]
        frame = _native.Frame(
            [self.values[key] for key in self.datasets],
            self.names,
            masks,
            mask_type or "",
            self.remove_missing_upto_maxlag,
            chosen,
        )
        if points is None:
            self._frames[mask_type] = frame
        return frame

    def _of_dataset(self, key: Any, points: NDArray[Any]) -> NDArray[np.bool_]:
        local = points - self.time_offsets[key]
        chosen = np.zeros(self.T[key], dtype=bool)
        chosen[local[(local >= 0) & (local < self.T[key])]] = True
        return chosen

    def construct_array(
        self,
        X: Nodes,
        Y: Nodes,
        Z: Nodes,
        tau_max: int,
        extraZ: Nodes | None = None,
        mask: Any = None,
        mask_type: str | None = None,
        data_type: None = None,
        return_cleaned_xyz: bool = False,
        do_checks: bool = True,
        remove_overlaps: bool = True,
        cut_off: str = "2xtau_max",
        verbosity: int = 0,
    ) -> tuple[Any, ...]:
        """The samples of a test as rows of one array.

        Args:
            X: Nodes (variable, -lag); so are Y, Z and extraZ.
            tau_max: Largest lag of the run.
            mask: Instead of the frame's own.
            mask_type: Roles, of "x", "y", "z", in which a masked value excludes a sample.
            return_cleaned_xyz: Whether the nodes come back, too, without those that are in a role before.
            do_checks: Whether the nodes are checked.
            remove_overlaps: Whether a node counts only in its first role.
            cut_off: Samples at the beginning that are never used: "2xtau_max", "tau_max" or "max_lag".

        Returns:
            The array (nodes, samples); the role of each row, 0 to 3 for x, y, z, extraZ; [the nodes by role;] None.

        Raises:
            ValueError: Nodes that are not there.

        Example:
            >>> import numpy as np
            >>> from roscausal.tigramite.data_processing import DataFrame
            >>> array, xyz, _ = DataFrame(np.arange(10.0).reshape(5, 2)).construct_array([(0, -1)], [(1, 0)], [], tau_max=1)
            >>> array.tolist(), xyz.tolist()
            ([[2.0, 4.0, 6.0], [5.0, 7.0, 9.0]], [0, 1])
        """
        not_covered(data_type=data_type)
        if cut_off not in _CUT_OFFS[:4]:
            raise SettingError(f"setting 'cut_off': '{cut_off}' is unknown; allowed: {', '.join(_CUT_OFFS[:4])}")
        roles = [list(dict.fromkeys(nodes)) for nodes in (X, Y, Z or [], extraZ or [])]
        if remove_overlaps:
            # X and Y stay; a condition that is X or Y, or is there already, goes.
            roles[2] = [node for node in roles[2] if node not in roles[0] + roles[1]]
            roles[3] = [node for node in roles[3] if node not in roles[0] + roles[1] + roles[2]]
        nodes = [node for role in roles for node in role]
        for var, lag in nodes if do_checks else []:
            if not 0 <= var < self.N or lag > 0:
                raise ValueError(f"({var}, {lag}) is not a node: variables are 0 to {self.N - 1}, lags 0 or less")
        if do_checks and not any(lag == 0 for _, lag in roles[1]):
            raise ValueError(f"Y = {roles[1]}: one of its nodes is at lag 0")
        max_lag = max([abs(lag) for _, lag in nodes], default=0)
        start = {"2xtau_max": 2 * tau_max, "tau_max": tau_max, "max_lag": max_lag}.get(cut_off, max(max_lag, tau_max))
        masks = self.mask if mask is None else self._masks(mask)
        blocks = [self._block(key, roles, start, masks, mask_type or "") for key in self.datasets]
        xyz = np.array([role for role, of_role in enumerate(roles) for _ in of_role])
        array = np.concatenate(blocks, axis=1)
        return (array, xyz, tuple(roles), None) if return_cleaned_xyz else (array, xyz, None)

    def _block(self, key: Any, roles: list[list[tuple[int, int]]], start: int, masks: Any, mask_type: str) -> NDArray[Any]:
        values, length = self.values[key], self.T[key]
        times = np.arange(start, length)
        rows, dropped = [], ~self._of_dataset(key, self.reference_points)[start:length]
        missing = np.zeros(times.size, dtype=bool)
        for letter, nodes in zip("xyze", roles):
            for var, lag in nodes:
                row = values[times + lag, var]
                missing |= np.isnan(row)
                if masks is not None and letter in mask_type:
                    dropped |= masks[key][times + lag, var]
                rows.append(row)
        dropped |= missing
        if self.remove_missing_upto_maxlag:
            for after in np.flatnonzero(missing):
                dropped[after : after + start + 1] = True
        return np.array(rows)[:, ~dropped]
