"""`DataFrame`: the data of an analysis, with masks, missing values, several datasets and reference points."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from statistics import NormalDist
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _native
from .._native import DataError, SettingError
from ..data import array_of
from .refusal import NotCovered, missing, unknown

Nodes = Sequence[tuple[int, int]]
__getattr__ = missing(
    __name__, "get_acf", "get_block_length", "lowhighpass_filter", "ordinal_patt_array", "smooth", "var_process",
    "structural_causal_process",
)  # fmt: skip


class DataFrame:
    """Time series of N variables.

    Args:
        data: An array (T, N); with `analysis_mode="multiple"` a dict of arrays (T_k, N), or an array (M, T, N).
        mask: Like `data`, True where a value is excluded; which roles exclude is the test's `mask_type`.
        missing_flag: Values equal to it are missing. NaN always is.
        vector_vars: Variables of several columns, `{variable: [(column, 0), ..]}`; None: each column is one.
        data_type: Like `data`, 0 for numbers and 1 for categories.
        var_names: N different names; None: 0 to N - 1.
        datatime: T times, for drawing; like `data` with several datasets.
        analysis_mode: "single" or "multiple".
        reference_points: Times t that count as samples, 0 to T - 1; None: all.
        time_offsets: With several datasets: the time of the first row of each.
        remove_missing_upto_maxlag: Whether a missing value also excludes the samples up to 2 tau_max after it.

    Raises:
        DataError: Data of another shape, or infinite values.
        SettingError: An unknown keyword, or names that repeat.
        NotImplementedError: `vector_vars` with lags.

    Example:
        >>> import numpy as np
        >>> from roscausal.tigramite.data_processing import DataFrame
        >>> frame = DataFrame(np.arange(10.0).reshape(5, 2), var_names=["a", "b"])
        >>> frame.N, frame.T
        (2, {0: 5})
        >>> array, xyz, _ = frame.construct_array([(0, -1)], [(1, 0)], [], tau_max=1)
        >>> array.tolist(), xyz.tolist()
        ([[2.0, 4.0, 6.0], [5.0, 7.0, 9.0]], [0, 1])
    """

    def __init__(
        self, data: Any, mask: Any = None, missing_flag: float | None = None, vector_vars: Mapping[int, Nodes] | None = None,
        var_names: Sequence[Any] | None = None, data_type: Any = None, datatime: Any = None,
        analysis_mode: Literal["single", "multiple"] = "single", reference_points: ArrayLike | None = None,
        time_offsets: Mapping[Any, int] | None = None, remove_missing_upto_maxlag: bool = False, **others: object,
    ) -> None:  # fmt: skip
        unknown("DataFrame", others, ("data", "mask", "missing_flag", "var_names", "datatime", "analysis_mode"))
        if analysis_mode not in ("single", "multiple"):
            raise SettingError(f"setting 'analysis_mode': '{analysis_mode}' is unknown; allowed: single, multiple")
        self.analysis_mode, self.missing_flag = analysis_mode, missing_flag
        self.values: dict[Any, NDArray[np.float64]] = {
            key: array_of(values, f"dataset {key}").copy() for key, values in self._datasets(data, "data").items()
        }
        self.datasets = list(self.values)
        self.M = len(self.datasets)
        widths = {array.shape[1] for array in self.values.values()}
        if len(widths) != 1:
            raise DataError(f"the datasets have {', '.join(str(w) for w in sorted(widths))} columns; all need the same variables")
        self.Ndata = widths.pop()
        self.values = {key: self._values(key) for key in self.datasets}
        self.vector_vars: dict[int, Nodes] = dict(vector_vars or {k: [(k, 0)] for k in range(self.Ndata)})
        self.N = len(self.vector_vars)
        if sorted(self.vector_vars) != list(range(self.N)) or any(lag != 0 for of in self.vector_vars.values() for _, lag in of):
            raise NotCovered("vector_vars with lags is not covered by roscausal.tigramite; shift the columns, and give (column, 0)")
        self.has_vector_data = any(len(of) > 1 for of in self.vector_vars.values())
        self.mask = None if mask is None else self._masks(mask)
        self.data_type = None if data_type is None else self._masks(data_type, int)
        self.var_names: Any = dict(enumerate(range(self.N))) if var_names is None else list(var_names)
        self.names  # noqa: B018: names that repeat are refused here
        self.remove_missing_upto_maxlag = remove_missing_upto_maxlag
        #: What the reference's models set: `{"random_state": generator, "boot_blocklength": L}`.
        self.bootstrap: dict[str, Any] | None = None
        self.time_offsets = dict.fromkeys(self.datasets, 0) if time_offsets is None else dict(time_offsets)
        self.time_offsets_is_none = time_offsets is None
        if sorted(map(str, self.time_offsets)) != sorted(map(str, self.datasets)):
            raise SettingError("setting 'time_offsets': give one offset per dataset, under the dataset's key")
        self.reference_points = np.unique(np.arange(self.largest_time_step) if reference_points is None else reference_points)
        self._chosen()
        times = {key: np.arange(length) for key, length in self.T.items()}
        self.datatime = times if datatime is None else self._datasets(datatime, "datatime")
        self._initialized_from = "dict" if isinstance(data, Mapping) else f"{np.ndim(data)}d numpy array"

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        raise NotCovered(f"DataFrame.{name} is not covered by roscausal.tigramite")

    @property
    def T(self) -> dict[Any, int]:
        """The number of times of each dataset."""
        return {key: len(array) for key, array in self.values.items()}

    @property
    def largest_time_step(self) -> int:
        """One more than the last time of all datasets."""
        return max(length + self.time_offsets[key] for key, length in self.T.items())

    @property
    def reference_points_is_none(self) -> bool:
        """Whether all times count as samples."""
        return len(self.reference_points) == self.largest_time_step

    @property
    def names(self) -> list[str]:
        """The variables' names."""
        names = [str(self.var_names[k]) for k in range(len(self.var_names))]
        if len(names) != self.N:
            raise SettingError(f"setting 'var_names': {len(names)} names for {self.N} variables")
        repeated = next((name for name in names if names.count(name) > 1), None)
        if repeated is not None:
            raise SettingError(f"setting 'var_names': '{repeated}' is there twice; give each variable a name of its own")
        return names

    def _datasets(self, data: Any, what: str) -> dict[Any, Any]:
        if self.analysis_mode == "single":
            if isinstance(data, Mapping) and len(data) != 1:
                raise DataError(f"{what} is a dict of {len(data)}; several datasets need analysis_mode='multiple'")
            return dict(data) if isinstance(data, Mapping) else {0: data}
        if isinstance(data, Mapping):
            return dict(data)
        if getattr(data, "ndim", 0) == 3:
            return dict(enumerate(data))
        raise DataError(f"{what} of analysis_mode='multiple' is a dict of arrays (T, N), or one array (M, T, N)")

    def _masks(self, mask: Any, kind: Any = bool) -> dict[Any, NDArray[Any]]:
        masks = dict(zip(self.datasets, (np.ascontiguousarray(each, dtype=kind) for each in self._datasets(mask, "mask").values())))
        if {key: each.shape for key, each in masks.items()} != {key: array.shape for key, array in self.values.items()}:
            raise DataError("the mask's shape differs from that of the data")
        return masks

    def frame(self, mask_type: str | None, n_vars: int | None = None) -> _native.Frame:
        """The data as the engine takes them, with a test's `mask_type`: as they are now, whatever was changed in place."""
        nodes = [self.vector_vars[j] for j in range(self.N if n_vars is None else n_vars)]
        columns = [column for of in nodes for column, _ in of]
        places = np.split(np.arange(len(columns)), np.cumsum([len(of) for of in nodes])[:-1])
        arrays = [np.ascontiguousarray(self._values(key)[:, columns]) for key in self.datasets]
        names, vectors = self.names[: len(nodes)], []
        if len(columns) > len(nodes):
            vectors = [(name, of.tolist()) for name, of in zip(names, places)]
            names = [f"{name}.{k}" for name, of in vectors for k in of]
        masks = None
        if self.mask is not None and mask_type:
            rows = [mask[:, columns] for mask in self._masks(self.mask).values()]
            masks = [np.stack([mask[:, of].any(axis=1) for of in places], axis=1) for mask in rows]
        return _native.Frame(arrays, names, masks, mask_type or "", self.remove_missing_upto_maxlag, self._chosen(), vectors)

    def _values(self, key: Any) -> NDArray[np.float64]:
        array = array_of(self.values[key], f"dataset {key}")
        return array if self.missing_flag is None else np.where(array == self.missing_flag, np.nan, array)

    def _chosen(self) -> list[NDArray[np.bool_]] | None:
        """For each dataset the times that are reference points; None: all are."""
        points, last = np.atleast_1d(self.reference_points), self.largest_time_step - 1
        if points.dtype.kind not in "iu" or points.size == 0 or points.min() < 0 or points.max() > last:
            raise SettingError(f"setting 'reference_points': give whole numbers from 0 to {last}")
        every = [np.isin(np.arange(length) + self.time_offsets[key], points) for key, length in self.T.items()]
        return None if all(chosen.all() for chosen in every) else every

    def construct_array(
        self, X: Nodes, Y: Nodes, Z: Nodes, tau_max: int, extraZ: Nodes | None = None, mask: Any = None,
        mask_type: str | None = None, data_type: Any = None, return_cleaned_xyz: bool = False, do_checks: bool = True,
        remove_overlaps: bool = True, cut_off: str = "2xtau_max", verbosity: int = 0,
    ) -> tuple[Any, ...]:  # fmt: skip
        """The samples of a test as rows of one array.

        Args:
            X: Nodes (variable, -lag); so are Y, Z and extraZ.
            mask_type: Roles, of "x", "y", "z", in which a masked value excludes a sample.
            return_cleaned_xyz: Whether the nodes come back, too, without those that are in a role before.
            remove_overlaps: Whether a node counts only in its first role.
            cut_off: Samples at the beginning that are never used: "2xtau_max", "tau_max" or "max_lag"; tau_max is that of the run.

        Returns:
            The array (nodes, samples); the role of each row, 0 to 3 for x, y, z, extraZ; [the nodes by role;] None.

        Raises:
            ValueError: Nodes that are not there.
        """
        given, of = (X, Y, Z or [], extraZ or []), self.vector_vars
        spread = [[(column, lag) for var, lag in role for column, _ in of.get(var, [(var, 0)])] for role in given]
        roles = [list(dict.fromkeys(role)) for role in spread]
        if remove_overlaps:
            # X and Y stay; a condition that is X or Y, or is there already, goes.
            roles[2] = [node for node in roles[2] if node not in roles[0] + roles[1]]
            roles[3] = [node for node in roles[3] if node not in roles[0] + roles[1] + roles[2]]
        nodes = [node for role in roles for node in role]
        start = start_of(cut_off, tau_max, nodes)
        for var, lag in nodes if do_checks else []:
            if not 0 <= var < self.Ndata or lag > 0:
                raise ValueError(f"({var}, {lag}) is not a node: variables are 0 to {self.Ndata - 1}, lags 0 or less")
        if do_checks and not any(lag == 0 for _, lag in roles[1]):
            raise ValueError(f"Y = {roles[1]}: one of its nodes is at lag 0")
        masks = self.mask if mask is None else self._masks(mask)
        xyz = np.array([role for role, of_role in enumerate(roles) for _ in of_role])
        types = self.data_type if data_type is None else self._masks(data_type, int)
        chosen = self._chosen() or [np.ones(length, dtype=bool) for length in self.T.values()]
        blocks, kinds = [], []
        for key, points in zip(self.datasets, chosen):
            times, values = np.arange(start, self.T[key]), self._values(key)
            if self.bootstrap is not None:
                length, many = int(self.bootstrap["boot_blocklength"]), len(times)
                firsts = deepcopy(self.bootstrap["random_state"]).integers(0, max(many - length, 1), -(-many // length))
                times = times[(firsts[:, np.newaxis] + np.arange(length)).ravel()[:many]]
            rows = np.array([values[times + lag, var] for var, lag in nodes])
            missing = np.isnan(rows).any(axis=0)
            dropped = ~points[times] | missing
            for (var, lag), role in zip(nodes, xyz):
                if masks is not None and "xyze"[role] in (mask_type or ""):
                    dropped |= masks[key][times + lag, var]
            for after in np.flatnonzero(missing) if self.remove_missing_upto_maxlag else ():
                dropped[after : after + start + 1] = True
            blocks.append(rows[:, ~dropped])
            if types is not None:
                kinds.append(np.array([types[key][times + lag, var] for var, lag in nodes])[:, ~dropped])
        array, kind = np.concatenate(blocks, axis=1), np.concatenate(kinds, axis=1) if kinds else None
        return (array, xyz, tuple(roles[:3]), kind) if return_cleaned_xyz else (array, xyz, kind)


def adopted(frame: Any) -> DataFrame:
    """The frame; one of the reference's as one of ours, with the same arrays, so that what is changed in place counts."""
    if isinstance(frame, DataFrame):
        return frame
    names = ("values", "mask", "missing_flag", "vector_vars", "var_names", "data_type", "datatime", "analysis_mode", "reference_points",
             "time_offsets", "remove_missing_upto_maxlag")  # fmt: skip
    if not all(hasattr(frame, name) for name in names) or not isinstance(frame.values, dict):
        kind = f"{type(frame).__module__}.{type(frame).__name__}"
        raise SettingError(f"setting 'dataframe': give a roscausal.tigramite.data_processing.DataFrame, not a {kind}")
    own = DataFrame(frame.values, **{name: getattr(frame, name) for name in names[1:]})
    own.values, own.mask, own.data_type = frame.values, frame.mask, frame.data_type
    return own


def bootstrapped(frame: Any, fit: Callable[[], Any], boot_samples: int, boot_blocklength: int, first: int | None) -> list[Any]:
    """What `fit` returns on each of so many draws of a frame's samples, in blocks; `first`: the first draw's seed, None: another one each time."""
    first = int(np.random.default_rng().integers(2**31)) if first is None else first
    fits = []
    try:
        for number in range(boot_samples):
            frame.bootstrap = {"boot_blocklength": boot_blocklength, "random_state": np.random.default_rng(first + number)}
            fits.append(fit())
    finally:
        frame.bootstrap = None
    return fits


def start_of(cut_off: str, tau_max: int, nodes: Nodes) -> int:
    """How many samples at the beginning of a dataset a test does not use."""
    max_lag = max((abs(lag) for _, lag in nodes), default=0)
    starts = {"2xtau_max": 2 * tau_max, "tau_max": tau_max, "max_lag": max_lag, "max_lag_or_tau_max": max(max_lag, tau_max)}
    if cut_off not in starts:
        raise SettingError(f"setting 'cut_off': '{cut_off}' is unknown; allowed: {', '.join(starts)}")
    return starts[cut_off]


def trafo2normal(data: ArrayLike, mask: ArrayLike | None = None, thres: float = 0.001) -> NDArray[np.float64]:
    """Normal scores: the quantile of each value within its column; what is masked or missing stays."""
    values = np.array(data, dtype=np.float64)
    keep = np.isfinite(values) if mask is None else np.isfinite(values) & ~np.asarray(mask, dtype=bool)
    normal = np.vectorize(NormalDist().inv_cdf, otypes=[float])
    for column, used in zip(np.atleast_2d(values.T), np.atleast_2d(keep.T)):
        shares = np.searchsorted(np.sort(column[used]), column[used], side="right") / max(used.sum(), 1)
        column[used] = normal(np.clip(shares, thres, 1 - thres))
    return values


def time_bin_with_mask(data: ArrayLike, time_bin_length: int, mask: ArrayLike | None = None) -> tuple[NDArray[Any], int]:
    """Means over bins of so many times, without what is masked (0 where all of a bin is), and the number of bins."""
    values = np.asarray(data)
    bins = len(values) // time_bin_length
    used = np.ones(values.shape, dtype=bool) if mask is None else ~np.asarray(mask, dtype=bool)
    parts, left = (a[: bins * time_bin_length].reshape(bins, time_bin_length, *values.shape[1:]) for a in (values, used))
    means: NDArray[Any] = np.where(left, parts, 0.0).sum(axis=1) / np.maximum(left.sum(axis=1), 1)
    return means.astype("float32"), bins


def quantile_bin_array(data: NDArray[np.float64], bins: int = 6) -> NDArray[np.int32]:
    """Values (T, N) as numbers 0 to bins - 1, of which each but the last has equally many."""
    width = -(-len(data) // bins)
    columns = [np.searchsorted(np.sort(column)[width::width], column, side="right") for column in data.T]
    return np.stack(columns, axis=1).astype(np.int32)


def weighted_avg_and_std(values: ArrayLike, axis: int, weights: Any) -> tuple[Any, Any]:
    """Weighted mean and standard deviation along an axis, without missing values."""
    known = np.ma.masked_invalid(values)
    mean = np.ma.average(known, axis=axis, weights=weights)
    return mean, np.sqrt(np.ma.average((known - np.expand_dims(mean, axis)) ** 2, axis=axis, weights=weights))
