"""From data to a model in one call."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from . import _native
from .data import Recordings, frame_of, read, recordings_of
from .model import Model
from .progress import Progress, reporter

Method = Literal[
    "fpcmci", "pcmci", "pcmciplus", "fullci", "bivci", "lagdep", "granger", "varlingam", "dynotears", "timino", "lpcmci",
    "candoit", "tsfci", "jpcmciplus",
]  # fmt: skip


def discover(
    data: Any,
    *,
    columns: Sequence[str] | None = None,
    method: Method | str = "fpcmci",
    test: str | Callable[..., Any] | object | None = None,
    alpha: float = 0.05,
    tau_min: int | None = None,
    tau_max: int = 1,
    pc_alpha: float | Literal["auto"] | None = None,
    f_alpha: float | None = None,
    te_estimator: str = "auto",
    fdr: Literal["none", "fdr_bh"] = "none",
    exogenous: Sequence[str] = (),
    acts_on: Mapping[str, str] | None = None,
    dt: float | None = None,
    gp_search: Literal["default", "exact"] = "default",
    gp_restarts: int = 0,
    null_dist: str | os.PathLike[str] | Mapping[int, Sequence[float]] | None = None,
    vectors: Mapping[str, Sequence[str]] | None = None,
    max_conds: int | None = None,
    max_sets: int | None = None,
    extra_conditions: bool = True,
    seed: int = 42,
    threads: int | None = None,
    time_budget: float | None = None,
    max_memory: int | None = None,
    resamples: int = 0,
    resampling: Literal["subsample", "bootstrap"] = "subsample",
    share: float = 0.632,
    block: int | Literal["cube_root"] = 1,
    progress: Progress = None,
) -> Model:
    """Finds which variable drives which, and how many steps later.

    Args:
        data: An array (T, N), times in rows; a pandas or polars table; an Arrow table; a dict of series (T,); a path of a
            .csv, .bag, .mcap or .db3 file; what `rc.read` returns; or a list of these, as recordings of one system. NaN,
            None and masked values are missing. A column `time` gives the step and is no variable.
        columns: The variables to analyse, in this order; for an array: its names.
        method: fpcmci, pcmci, pcmciplus, lpcmci, candoit, jpcmciplus, tsfci, timino, fullci, bivci, granger, varlingam, dynotears
            or lagdep.
        test: None: the method's own (jpcmciplus: parcorr, else gpdc); gpdc, parcorr, robustparcorr, cmiknn, gsquared, cmisymb, parcorrwls, parcorrmult or regressionci; or your own: a function `f(x, y, z) -> (value, p)` of arrays
            (n,), (n,), (n, k), or an object with `run_test_raw(x, y, z)` of arrays (n, 1), (n, 1), (n, k), or with
            `run_test(X, Y, Z, tau_max)` of nodes `[(variable, -lag)]`.
        alpha: Level of significance of a link, in (0, 1).
        tau_min: Smallest lag in steps; None: 0 for methods that know links at lag 0 with a direction, else 1.
        tau_max: Largest lag in steps, at most 100000.
        pc_alpha: Level of the condition selection; None: the method's own; "auto": chosen by a score.
        f_alpha: Level of F-PCMCI's filter; None: alpha.
        te_estimator: Estimator of F-PCMCI's filter: auto, gaussian, kraskov, ...
        fdr: Correction for many tests.
        exogenous: Variables that may be causes only; for jpcmciplus: contexts.
        acts_on: For candoit: columns of interventions to the variable that each sets; None: the demo's, as far as they are there.
        dt: Seconds per step; None: from the data.
        gp_search: How GPDC searches for its maxima.
        gp_restarts: GPDC's searches from random places.
        null_dist: For gpdc: null distributions, as a dict from the number of samples to values, or a CSV file whose first row has
            the numbers of samples; where it has none for a test, gpdc's own.
        max_conds: Largest set of conditions in the condition selection; None: no limit.
        max_sets: For lpcmci and candoit: sets of conditions of one size tested for a pair, from each of its ends; None: all.
        extra_conditions: For candoit: whether contexts of interventions join their variables as conditions, as published.
        vectors: For parcorrmult: columns that are one variable, such as `{"place": ["x", "y"]}`.
        seed: Of all random numbers.
        threads: None: all cores. They do not change the result.
        time_budget: Seconds after which a partial model is returned; its `status` says so.
        max_memory: Bytes that a test may take.
        resamples: The analysis again on this many resamples (20 or more): links then have a `confidence`, the share of the
            resamples that have them; the model has `link_frequency`, `val_low`, `val_high` and `advice`. 0: none.
        resampling: "subsample" (a share of the rows) or "bootstrap" (as many rows, drawn with replacement).
        share: Share of the rows in a subsample.
        block: Neighbouring rows that are drawn together.
        progress: True: a bar in a notebook, a line on stderr elsewhere; or a function of (tests done, estimated total).

    Returns:
        The model.

    Raises:
        DataError: Data that do not allow this analysis.
        SettingError: A setting that is not allowed.
        KeyboardInterrupt: Ctrl-C; the analysis has ended.

    Example:
        >>> import numpy as np, roscausal as rc
        >>> x = np.random.default_rng(2).normal(size=(200, 2))
        >>> x[1:, 1] += x[:-1, 0]
        >>> model = rc.discover({"cause": x[:, 0], "effect": x[:, 1]}, method="pcmci", test="parcorr")
        >>> print(model.links[0])
        cause at t-1 drives effect: strength 0.65, p < 0.001
    """
    found = recordings_of(data, columns)
    settings = settings_of(
        found, method=method, alpha=alpha, tau_min=tau_min, tau_max=tau_max, pc_alpha=pc_alpha, f_alpha=f_alpha,
        te_estimator=te_estimator, fdr=fdr, exogenous=exogenous, dt=dt, gp_search=gp_search, gp_restarts=gp_restarts, seed=seed,
        threads=threads, time_budget=time_budget, max_memory=max_memory,
        acts_on=None if acts_on is None else dict(acts_on), max_conds=max_conds, max_sets=max_sets,
        extra_conditions=extra_conditions,
    )  # fmt: skip
    settings |= {"resamples": resamples, "resampling": resampling, "share": share, "block": block}
    settings["vectors"] = None if vectors is None else {name: list(columns) for name, columns in vectors.items()}
    settings["null_dist"] = nulls_of(null_dist)
    own = None
    if test is None or isinstance(test, str):
        settings["test"] = test
    else:
        own = test
    return Model(_native.discover(frame_of(found), as_json(settings), own, reporter(progress)), found)


def settings_of(found: Recordings, *, exogenous: Sequence[str] = (), dt: float | None = None, **given: Any) -> dict[str, Any]:
    """The settings of an analysis, with what the data say themselves."""
    of_data = {"exogenous": [*exogenous, *found.exogenous], "dt": found.dt if dt is None else dt, "warnings": found.warnings}
    return {**given, **of_data}


def nulls_of(given: str | os.PathLike[str] | Mapping[int, Sequence[float]] | None) -> str | dict[int, list[float]] | None:
    """Null distributions as the native module takes them: the text of a file, or numbers."""
    if given is None:
        return None
    if isinstance(given, Mapping):
        return {int(size): [float(value) for value in values] for size, values in given.items()}
    try:
        return Path(given).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise _native.DataError(f"{given}: {error}") from None


def as_json(settings: dict[str, Any]) -> str:
    """Settings for the native module; numpy's numbers are numbers."""

    def plain(value: Any) -> Any:
        if hasattr(value, "item"):
            return value.item()
        raise _native.SettingError(f"a setting is {value!r}, of type {type(value).__name__}, which is neither a number nor a word")

    for name, value in settings.items():
        if isinstance(value, float) and not math.isfinite(value):
            raise _native.SettingError(f"setting '{name}': {value} is not a finite number")
    return json.dumps(settings, default=plain)


def demo(seed: int = 1, out: str | os.PathLike[str] | None = None) -> Model:
    """Simulates a robot and a person, records them for 300 s and finds the causal model, as `roscausal demo` does.

    Args:
        seed: Of the simulation.
        out: Folder for the batches, the model and the pictures; None: a temporary one, which is removed.

    Returns:
        The model of speed `h_v`, distance to the goal `h_dg` and risk `h_risk`.

    Raises:
        DataError: A folder that cannot be written.

    Example:
        >>> import roscausal as rc
        >>> rc.demo().features
        ['h_v', 'h_dg', 'h_risk']
    """
    if out is not None:
        return Model(_native.demo(seed, out), read(out))
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        return demo(seed, os.path.join(folder, "demo"))


def msg_definitions() -> dict[str, str]:
    """The texts of our ROS messages, for programs that read our bags without ROS, such as `rosbags`.

    Returns:
        Name, such as `roscausal_msgs/msg/CausalModel`, to text.

    Example:
        >>> import roscausal as rc
        >>> "roscausal_msgs/msg/CausalModel" in rc.msg_definitions()
        True
    """
    return dict(sorted(_native.messages()))
