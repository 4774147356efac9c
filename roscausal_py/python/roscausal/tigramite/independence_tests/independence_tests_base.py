"""What the independence tests share: keywords, single tests on nodes and on arrays."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ... import _native
from ..._native import DataError, SettingError
from ..data_processing import DataFrame, Nodes, adopted, start_of
from ..refusal import NotCovered, not_covered, unknown

#: What the engine answers: value, p-value, interval, samples, and whether a threshold decides.
Found = tuple[float, float, tuple[float, float] | None, int, bool]
#: The settings of the engine that all tests have.
_SHARED = (
    "seed", "significance", "sig_samples", "sig_blocklength", "confidence", "conf_lev", "conf_samples", "conf_blocklength",
)  # fmt: skip


class CondIndTest:
    """An independence test: its name and settings. Use one of the tests; this class is what they share.

    Args:
        seed: Of shuffles and bootstraps.
        mask_type: Roles, of "x", "y", "z", in which a masked value excludes a sample.
        significance: "analytic", "shuffle_test" or "fixed_thres".
        sig_samples: Surrogates of a shuffle test, or size of a null distribution.
        sig_blocklength: Block length of a shuffle test; None: from the data.
        confidence: None, "analytic" or "bootstrap".
        conf_lev: Level of the two-sided interval.
        conf_samples: Bootstrap samples.
        conf_blocklength: Block length of the bootstrap; None: from the data.
        recycle_residuals: Only the speed depends on it; ignored.
        verbosity: Ignored.

    Raises:
        SettingError: An unknown keyword (with the nearest), or a value that is not allowed.
        NotImplementedError: Keywords that are not covered.
    """

    measure = ""
    _engine = ""
    _significance = "analytic"
    #: Keywords that only this test has, with the one value that the engine has.
    _fixed: Mapping[str, Any] = {}
    #: Whether a threshold is compared with the value, not with its size.
    _one_sided = False

    def __init__(
        self, *, seed: int = 42, mask_type: str | None = None, significance: str | None = None, fixed_thres: float | None = None,
        sig_samples: int = 500, sig_blocklength: int | None = None, confidence: str | None = None, conf_lev: float = 0.9,
        conf_samples: int = 100, conf_blocklength: int | None = None, recycle_residuals: bool = False, verbosity: int = 0,
        **others: object,
    ) -> None:  # fmt: skip
        other = {name: True for name, usual in self._fixed.items() if str(others.pop(name, usual)) != str(usual)}
        unknown(type(self).__name__, others, KEYWORDS)
        not_covered(fixed_thres=fixed_thres, **other)
        if not self._engine:
            raise NotCovered("a test of your own needs no base class: give PCMCI an object with run_test_raw(x, y, z)")
        self.seed, self.mask_type, self.verbosity = seed, mask_type, verbosity
        self.significance = self._significance if significance is None else significance
        self.sig_samples, self.sig_blocklength = sig_samples, sig_blocklength
        self.confidence, self.conf_lev = confidence or None, conf_lev
        self.conf_samples, self.conf_blocklength = conf_samples, conf_blocklength
        self.recycle_residuals = recycle_residuals
        self.dataframe: DataFrame | None = None
        # Settings that are not allowed are refused here, not in the run.
        self._ask(_PAIR, (0, 0), (1, 0), [], 0)

    def _own(self) -> dict[str, Any]:
        """Settings that only this test has."""
        return {}

    @property
    def two_sided(self) -> bool:
        """Whether a threshold is compared with the size of the value."""
        return not self._one_sided

    @property
    def spec(self) -> str:
        """Name and settings, as the engine takes them."""
        shared = {name: getattr(self, name) for name in _SHARED}
        return json.dumps({"name": self._engine, **shared, **self._own()}, default=lambda value: value.item())

    def set_dataframe(self, dataframe: DataFrame) -> None:
        """The data of `run_test` and `get_measure`."""
        self.dataframe = adopted(dataframe)

    def set_mask_type(self, mask_type: str | None) -> None:
        """The roles in which a masked value excludes a sample."""
        self.mask_type = mask_type

    def _ask(self, frame: _native.Frame, x: tuple[int, int], y: tuple[int, int], z: Nodes, cut_off: int) -> Found:
        def node(given: tuple[int, int]) -> tuple[int, int]:
            if given[1] > 0:
                raise SettingError(f"setting 'node': ({given[0]}, {given[1]}) is in the future; lags are 0 or less")
            return (int(given[0]), -int(given[1]))

        return _native.run_test(frame, self.spec, node(x), node(y), [node(each) for each in z], cut_off)

    def _on_nodes(self, X: Nodes, Y: Nodes, Z: Nodes | None, tau_max: int, cut_off: str) -> Found:
        if self.dataframe is None:
            raise DataError("there are no data: call set_dataframe first")
        check_test(self, self.dataframe)
        z = [node for node in dict.fromkeys((var, lag) for var, lag in Z or []) if node not in [*map(tuple, X), *map(tuple, Y)]]
        if len(X) != 1 or len(Y) != 1:
            raise NotCovered("X or Y of several nodes are not covered by roscausal.tigramite; make them one by DataFrame(vector_vars=..)")
        return self._ask(self.dataframe.frame(self.mask_type), X[0], Y[0], z, start_of(cut_off, tau_max, [*X, *Y, *z]))

    def run_test(
        self, X: Nodes, Y: Nodes, Z: Nodes | None = None, tau_max: int = 0, cut_off: str = "2xtau_max",
        alpha_or_thres: float | None = None,
    ) -> Any:  # fmt: skip
        """Tests X _||_ Y | Z on the data frame: (value, p-value), and the decision with a level or threshold `alpha_or_thres`.

        X and Y are one node `[(variable, -lag)]` each, Z any nodes; `cut_off` and `tau_max` are those of `construct_array`.
        """
        return self._decided(self._on_nodes(X, Y, Z, tau_max, cut_off), alpha_or_thres)

    def _decided(self, found: Found, level: float | None) -> Any:
        value, p_value, _, _, by_value = found
        if level is None:
            if by_value:
                raise SettingError("setting 'alpha_or_thres': fixed_thres needs a threshold")
            return value, p_value
        if by_value:
            dependent = bool((value if self._one_sided else abs(value)) >= level)
            return value, 0.0 if dependent else 1.0, dependent
        return value, p_value, bool(p_value <= level)

    def run_test_raw(
        self, x: ArrayLike, y: ArrayLike, z: ArrayLike | None = None, x_type: ArrayLike | None = None,
        y_type: ArrayLike | None = None, z_type: ArrayLike | None = None, alpha_or_thres: float | None = None,
    ) -> Any:  # fmt: skip
        """Tests x _||_ y | z on arrays (n,), or (n, k) for vectors and conditions, as `run_test`. Types are 0 for numbers, 1 for categories."""
        parts = [_columns(x, "x"), _columns(y, "y"), *([] if z is None else [_columns(z, "z")])]
        if len({part.shape[0] for part in parts}) != 1:
            raise DataError(f"x, y and z have {', '.join(str(part.shape[0]) for part in parts)} samples; give the same number")
        array = np.ascontiguousarray(np.hstack(parts))
        types = [given for given in (x_type, y_type, z_type) if given is not None]
        kinds = {0: np.hstack([_columns(given, "types") for given in types]).astype(int)} if types else None
        places = np.split(np.arange(array.shape[1]), [parts[0].shape[1], parts[0].shape[1] + parts[1].shape[1]])
        vectors = [places[0], places[1], *places[2][:, np.newaxis]]
        frame = DataFrame(array, vector_vars={k: [(column, 0) for column in of] for k, of in enumerate(vectors)}, data_type=kinds)
        check_test(self, frame)
        found = self._ask(frame.frame(None), (0, 0), (1, 0), [(k, 0) for k in range(2, len(vectors))], 0)
        return self._decided(found, alpha_or_thres)

    def _check(self, frame: DataFrame) -> None:
        """Refuses data that this test does not take."""

    def get_measure(self, X: Nodes, Y: Nodes, Z: Nodes | None = None, tau_max: int = 0, data_type: None = None) -> float:
        """The value of the test X _||_ Y | Z on the data frame."""
        not_covered(data_type=data_type)
        return self._on_nodes(X, Y, Z, tau_max, "2xtau_max")[0]

    def get_confidence(
        self, X: Nodes, Y: Nodes, Z: Nodes | None = None, tau_max: int = 0, data_type: None = None
    ) -> tuple[float, float] | None:
        """The confidence interval of the value, if the test has one."""
        not_covered(data_type=data_type)
        return self._on_nodes(X, Y, Z, tau_max, "2xtau_max")[2]

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        raise NotCovered(f"{type(self).__name__}.{name} is not covered by roscausal.tigramite")


#: Keywords of some test, which a message about an unknown one may name.
KEYWORDS = (
    *_SHARED, "mask_type", "recycle_residuals", "verbosity", "knn", "shuffle_neighbors", "transform", "workers", "n_symbs",
    "window_size", "correlation_type",
)  # fmt: skip

#: Two independent variables, to try settings on.
_PAIR = _native.Frame([np.ascontiguousarray((np.arange(24) * 7 % 11).reshape(12, 2).astype(float))], ["x", "y"])


def check_test(test: Any, frame: DataFrame) -> None:
    """Refuses a test of ours that does not take the data, or with functions of the user's, which the engine would never call."""
    if isinstance(test, CondIndTest):
        test._check(frame)
        ours = next(kind for kind in type(test).__mro__ if kind.__module__.startswith("roscausal."))
        between = type(test).__mro__[: type(test).__mro__.index(ours)]
        own = [name for kind in between for name, value in vars(kind).items() if callable(value) and name != "__init__"]
        if own:
            raise NotCovered(
                f"{type(test).__name__}.{own[0]} is not covered by roscausal.tigramite, which calls no functions of {ours.__name__}; give "
                "PCMCI an object of no base class with run_test_raw(x, y, z), or derive from tigramite's"
            )


def _columns(values: ArrayLike, what: str) -> NDArray[np.float64]:
    array = np.asarray(values, dtype=np.float64)
    if array.ndim not in (1, 2):
        raise DataError(f"{what} has shape {array.shape}; give (n,) or (n, k)")
    return array.reshape(array.shape[0], -1)
