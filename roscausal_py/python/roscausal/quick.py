"""From data to a model in one call."""

from __future__ import annotations

import inspect
import json
import math
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import _native
from .data import Recordings, frame_of, read, recordings_of
from .model import Model
from .progress import Progress, reporter

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from .settings import Settings


def discover(
    data: Any, *, columns: Sequence[str] | None = None, test: str | Callable[..., Any] | object | None = None,
    dt: float | None = None, progress: Progress = None, features: str | Sequence[str] | None = None, where: str | None = None,
    mask: str | None = None, rows: str | None = None, missing_value: float | Sequence[float] | str | None = None,
    recording: str | None = None, time_column: str | None = None, time_unit: str | None = None,
    keep: str | Sequence[str] | None = None, encode: str | None = None, resample: str | None = None, max_gap: float | None = None,
    difference: bool | Sequence[str] = False, detrend: bool | Sequence[str] = False, standardise: bool | Sequence[str] = False,
    season: int | str | None = None, drop_empty: bool = False, drop_constant: bool = False, **settings: Unpack[Settings],
) -> Model:  # fmt: skip
    """Finds which variable drives which, and how many steps later.

    Args:
        data: An array (T, N), times in rows; a pandas or polars table; an Arrow table; a dict of series (T,); a path of a
            .csv, .bag, .mcap or .db3 file; what `rc.read` returns; or a list of these, as recordings of one system. A table is
            read by the rules of its CSV file (docs/data.md): a column or index of times gives the step, a gap ends a recording.
        columns: The variables to analyse, in this order; for an array: its names.
        test: Name of an independence test, or None: the method's own; or your own: a function `f(x, y, z) -> (value, p)` of arrays
            (n,), (n,), (n, k), or an object with `run_test_raw(x, y, z)` of arrays (n, 1), (n, 1), (n, k), or with
            `run_test(X, Y, Z, tau_max)` of nodes `[(variable, -lag)]`; or a test of `roscausal.tigramite`.
        dt: Seconds per step; None: from the data.
        progress: True: a bar in a notebook, a line on stderr elsewhere; or a function of (tests done, estimated total).
        features: Variables to add, such as "speed = norm(rate(x), rate(y))".
        where: Rows that may be effects, such as "near < 3"; mask: a column that is 0 there; rows: a window of rows, "1..5000".
        missing_value: Numbers that stand for missing values; "none": there are none.
        recording: Column that says which recording a row is of. The levels of an index beside the times say it, too.
        time_column: Name of the column of times; "none": there is none; time_unit: its unit, such as "ms".
        keep: Columns that stay variables although they count rows; "all".
        encode: "codes": words become numbers.
        resample: With `dt`, what a row holds: "last", "mean", "linear".
        max_gap: A longer step ends a recording, seconds; None: five steps.
        difference: Analyse changes, detrend: without a straight line, standardise: with mean 0 and deviation 1: of all, or of those named.
        season: Period whose mean course is taken out: rows, or "24h".
        drop_empty: Leave out columns without any number; drop_constant: those with one only.
        **settings: The settings of the analysis:

    With `resamples`, links have a `confidence`, and the model `link_frequency`, `val_low`, `val_high` and `advice`. A model that
    `time_budget` ends early is a partial one; its `status` says so.

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
    found = recordings_of(
        data, columns, dt=dt, features=features, where=where, mask=mask, rows=rows, missing_value=missing_value, recording=recording,
        time_column=time_column, time_unit=time_unit, keep=keep, encode=encode, resample=resample, max_gap=max_gap, difference=difference,
        detrend=detrend, standardise=standardise, season=season, drop_empty=drop_empty, drop_constant=drop_constant,
    )  # fmt: skip
    own = None if test is None or isinstance(test, str) else getattr(test, "spec", test)
    given = settings_of(found, dt=dt, test=test if own is None else None, **settings)
    return Model(_native.discover(frame_of(found), as_json(given), own, reporter(progress)), found)


def settings_of(found: Recordings, *, exogenous: Sequence[str] | None = None, dt: float | None = None, **given: Any) -> dict[str, Any]:
    """The settings of an analysis, with what the data and files say themselves."""
    if isinstance(exogenous, str):
        raise _native.SettingError("setting 'exogenous': it is one word; give a list of names")
    for name in ("null_dist", "links"):
        given[name] = content_of(given.get(name))
    of_data = {"exogenous": [*(exogenous or ()), *found.exogenous], "dt": found.dt if dt is None else dt, "warnings": found.warnings}
    return {**given, **of_data}


def content_of(given: Any) -> Any:
    """The text of a file, or what is given itself."""
    if not isinstance(given, (str, os.PathLike)):
        return given
    try:
        return Path(given).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise _native.DataError(f"{given}: {error}") from None


def as_json(settings: dict[str, Any]) -> str:
    """Settings for the native module; numpy's numbers are numbers."""
    for name, value in settings.items():
        if isinstance(value, float) and not math.isfinite(value):
            raise _native.SettingError(f"setting '{name}': {value} is not a finite number")
        if isinstance(value, Mapping):
            settings[name] = {str(key): one for key, one in value.items()}
    return json.dumps(settings, default=lambda value: dict(value) if isinstance(value, Mapping) else plain(value))


def plain(value: Any, what: str = "a word") -> Any:
    """numpy's numbers and arrays as JSON has them; `what` may stand there beside numbers."""
    if hasattr(value, "tolist"):
        return value.tolist()
    raise _native.SettingError(f"a setting is {value!r}, of type {type(value).__name__}, which is neither a number nor {what}")


def whole(name: str, value: Any, least: int = 0, what: str = "a whole number of 0 or more") -> int:
    """A whole number, refused where it is none or below the least one."""
    if isinstance(value, bool) or not hasattr(value, "__index__") or value < least:
        raise _native.SettingError(f"setting '{name}': {value!r} is not {what}")
    return int(value)


def _completed(function: Callable[..., Model]) -> None:
    """Puts the table of settings into a function's signature and its documentation."""
    table = [one for one in json.loads(_native.words())["settings"] if one["id"] not in ("test", "dt")]
    signature = inspect.signature(function)
    named = list(signature.parameters.values())[:-1]
    named += [inspect.Parameter(one["id"], inspect.Parameter.KEYWORD_ONLY, default=one["default"]) for one in table]
    function.__signature__ = signature.replace(parameters=named)  # type: ignore[attr-defined]
    words = [f"{one['id']}: {one['help']}{': ' if one['words'] else ''}{', '.join(one['words'])}" for one in table]
    unset = [f"; None: {one['unset']}." if one["unset"] else "." for one in table]
    lines = "\n".join(f"            {text}{end}" for text, end in zip(words, unset))
    function.__doc__ = (function.__doc__ or "").replace("settings of the analysis:\n", f"settings of the analysis:\n\n{lines}\n", 1)


_completed(discover)


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
