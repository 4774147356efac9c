"""What a user may give as data, and what the engine takes: recordings (T, N) of float64, and names of the variables."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _native
from ._native import DataError, SettingError

#: The column that holds seconds and is not a variable.
TIME = "time"


@dataclass(frozen=True, eq=False)
class Recordings:
    """One or several recordings of the same variables: what `rc.read` returns and `rc.discover` takes.

    Attributes:
        names: Names of the N variables.
        arrays: One float64 array (T, N) per recording; NaN where a value is missing.
        dt: Step between samples in seconds, or None.
        exogenous: Variables that may be causes only, such as interventions.
        warnings: What a reader of the model should know, one sentence each.
        masked: For each recording one bool (T,), True where a row is the past of others and no effect; empty: all may be effects.

    Example:
        >>> import numpy as np, roscausal as rc
        >>> pair = rc.Recordings(["a", "b"], [np.zeros((100, 2)), np.zeros((50, 2))])
        >>> len(pair), pair[1].shape
        (2, (50, 2))
    """

    names: list[str]
    arrays: list[NDArray[np.float64]]
    dt: float | None = None
    exogenous: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    masked: list[NDArray[np.bool_]] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.arrays)

    def __getitem__(self, index: int) -> NDArray[np.float64]:
        return self.arrays[index]

    def __iter__(self) -> Iterator[NDArray[np.float64]]:
        return iter(self.arrays)

    def rows(self, recording: int, start: int, end: int) -> Recordings:
        """The rows `start` to `end - 1` of one recording, as one recording.

        Args:
            recording: Which one.
            start: First row.
            end: The row after the last one.

        Example:
            >>> import numpy as np, roscausal as rc
            >>> rc.Recordings(["a", "b"], [np.zeros((9, 2))]).rows(0, 2, 5)[0].shape
            (3, 2)
        """
        masked = [rows[start:end] for rows in self.masked[recording : recording + 1]]
        return Recordings(self.names, [self.arrays[recording][start:end]], self.dt, self.exogenous, self.warnings, masked)

    def select(self, columns: Sequence[str]) -> Recordings:
        """The same recordings with these variables only, in this order.

        Args:
            columns: Names of variables.

        Raises:
            SettingError: A name that is not there; the message has the nearest.

        Example:
            >>> import numpy as np, roscausal as rc
            >>> rc.Recordings(["a", "b"], [np.zeros((9, 2))]).select(["b"]).names
            ['b']
        """
        for name in columns:
            if name not in self.names:
                import difflib

                near = difflib.get_close_matches(name, self.names, 1)
                hint = f"; did you mean '{near[0]}'?" if near else ""
                known = ", ".join(self.names)
                what = f"setting 'columns': there is no column '{name}'{hint} (columns: {known})"
                raise SettingError(_native.visible(what))
        places = [self.names.index(name) for name in columns]
        arrays = [np.ascontiguousarray(array[:, places]) for array in self.arrays]
        exogenous = [name for name in self.exogenous if name in columns]
        return Recordings(list(columns), arrays, self.dt, exogenous, self.warnings, self.masked)


def read(*paths: str | os.PathLike[str], **options: object) -> Recordings:
    """Reads tables (.csv) and robots' recordings (ROS 1 .bag, ROS 2 .mcap and .db3, folders of them).

    Args:
        paths: One or several files; together they are recordings of one system.
        options: Those of `roscausal discover`, with underscores: `person=7`, `people="/people"`, `dt=0.1`,
            `robot_odom="/odom"`, `columns=["h_v", "h_dg"]`, `param={"data.safe_dist": 4}`.

    Returns:
        The recordings: arrays (T, N), names, step in seconds.

    Raises:
        DataError: A file that cannot be read, or that lacks what is needed.
        SettingError: An unknown option, or a value that is not allowed.

    Example:
        >>> import pathlib, tempfile, roscausal as rc
        >>> file = pathlib.Path(tempfile.mkdtemp()) / "walk.csv"
        >>> _ = file.write_text("time,speed,risk\\n0,1.0,0.1\\n0.5,1.1,0.2\\n1,0.9,0.3\\n")
        >>> walk = rc.read(file)
        >>> walk.names, walk[0].shape, walk.dt
        (['speed', 'risk'], (3, 2), 0.5)
    """
    if not paths:
        raise SettingError("setting 'paths': give at least one file")
    found = _native.read([os.fspath(path) for path in paths], _flags(options))
    return Recordings(
        found["names"], found["arrays"], found["dt"], found["exogenous"], found["warnings"], found["masked"]
    )  # fmt: skip


def _flags(options: Mapping[str, object]) -> list[str]:
    """`person=7` as `--person=7`."""
    flags = []
    for name, value in options.items():
        flag = "--" + name.replace("_", "-")
        if isinstance(value, Mapping):
            flags += [f"{flag}={key}={each}" for key, each in value.items()]
        elif isinstance(value, (list, tuple)):
            flags.append(f"{flag}={','.join(str(each) for each in value)}")
        elif value is not None:
            flags.append(f"{flag}={value}")
    return flags


def recordings_of(data: Any, columns: Sequence[str] | None = None) -> Recordings:
    """Whatever a user gives as recordings: see `rc.discover`."""
    if isinstance(columns, str):
        raise SettingError("setting 'columns': it is one word; give a list of names")
    found, named = _convert(data, columns)
    if columns is None:
        return found
    if not named and len(columns) == len(found.names):
        return Recordings(list(columns), found.arrays, found.dt, found.exogenous, found.warnings, found.masked)
    if not named:
        raise SettingError(f"setting 'columns': {len(columns)} names for {len(found.names)} columns")
    return found.select(columns)


def frame_of(found: Recordings) -> _native.Frame:
    """The recordings as the engine takes them."""
    if not found.masked:
        return _native.Frame(found.arrays, found.names)
    masks = [np.repeat(rows[:, np.newaxis], len(found.names), axis=1) for rows in found.masked]
    return _native.Frame(found.arrays, found.names, masks, "y")


def _convert(data: Any, wanted: Sequence[str] | None) -> tuple[Recordings, bool]:
    """The recordings, and whether the data brought names of their own. Columns that are not wanted may hold anything."""
    if isinstance(data, Recordings):
        return data, True
    if isinstance(data, (str, os.PathLike)):
        return read(data), True
    if isinstance(data, np.ndarray):
        array = array_of(data)
        return Recordings([f"x{k}" for k in range(array.shape[1])], [array]), False
    if isinstance(data, (list, tuple)):
        return _several(data, wanted)
    if isinstance(data, Mapping):
        lengths = {len(values) for values in data.values()}
        if len(lengths) > 1:
            sizes = _native.visible(", ".join(f"{name}: {len(values)}" for name, values in data.items()))
            raise DataError(f"the series have different lengths ({sizes}); give all of one recording the same times")
        return _table({str(name): np.asanyarray(values) for name, values in data.items()}, wanted), True
    if hasattr(data, "to_numpy") and hasattr(data, "columns"):
        names = list(data.columns)
        repeated = next((name for name in names if names.count(name) > 1), None)
        if repeated is not None:
            raise DataError(_native.visible(f"the column '{repeated}' is there twice; rename one"))
        table = {str(name): np.asanyarray(data[name].to_numpy()) for name in names}
        return _table(table, wanted, getattr(data, "index", None)), True
    if hasattr(data, "__arrow_c_stream__"):
        return _table(_arrow(data), wanted), True
    raise DataError(
        f"data of type {type(data).__name__} are not understood; give an array (T, N), a pandas or polars table, a dict of "
        "series, a path, or a list of these"
    )


def _several(data: Sequence[Any], wanted: Sequence[str] | None) -> tuple[Recordings, bool]:
    if not data:
        raise DataError("no data: the list of recordings is empty")
    if all(isinstance(each, (str, os.PathLike)) for each in data):
        return read(*data), True
    if all(np.isscalar(each) for each in data):
        raise DataError("a list of numbers is one variable; a cause and an effect need at least two, as an array (T, N)")
    parts = [_convert(each, wanted) for each in data]
    first = parts[0][0]
    arrays, warnings, masked, exogenous = [], [], [], list(first.exogenous)
    steps = {part.dt for part, _ in parts}
    for number, (part, named) in enumerate(parts):
        if named and sorted(part.names) != sorted(first.names):
            ours, theirs = ", ".join(part.names), ", ".join(first.names)
            raise DataError(
                _native.visible(f"recording {number} has the variables {ours}, but recording 0 has {theirs}")
            )
        if len(part.names) != len(first.names):
            raise DataError(f"recording {number} has {len(part.names)} columns, but recording 0 has {len(first.names)}")
        arrays += (part.select(first.names) if named else part).arrays
        warnings += part.warnings
        masked += part.masked or [np.zeros(len(array), dtype=np.bool_) for array in part.arrays]
    if len(steps) > 1:
        listed = ", ".join(str(step) for step in sorted(steps, key=str))
        raise DataError(f"the recordings have different time steps ({listed}); resample them to one")
    masked = masked if any(rows.any() for rows in masked) else []
    return Recordings(first.names, arrays, first.dt, exogenous, warnings, masked), parts[0][1]


def array_of(values: Any, what: str = "the array") -> NDArray[np.float64]:
    """A float64 array (T, N) in C order. Masked values become NaN; any byte order, order of axes and number type will do."""
    array = np.asanyarray(values)
    if array.ndim != 2:
        raise DataError(f"{what} has shape {array.shape}; data are (T, N), times in rows and variables in columns")
    if array.dtype.kind not in "fiub":
        raise DataError(f"{what} holds {array.dtype}, not numbers")
    if isinstance(array, np.ma.MaskedArray):
        array = np.ma.filled(array.astype(np.float64), np.nan)  # type: ignore[no-untyped-call, unused-ignore]
    return np.ascontiguousarray(array, dtype=np.float64)


def _table(columns: Mapping[str, NDArray[Any]], wanted: Sequence[str] | None, index: Any = None) -> Recordings:
    """A table of named columns. `time`, or else an index of times, gives the step."""
    dt = None
    if TIME in columns:
        dt = _step(columns[TIME])
    elif index is not None and getattr(getattr(index, "dtype", None), "kind", "") == "M":
        dt = _step(np.asarray(index))
    values = {name: column for name, column in columns.items() if name != TIME}
    if wanted is not None and all(name in values for name in wanted):
        values = {name: values[name] for name in wanted}
    odd = [name for name, column in values.items() if column.ndim != 1 or column.dtype.kind not in "fiub"]
    odd = [name for name in odd if not _holds_numbers(values[name])]
    if odd:
        raise DataError(
            f"not numbers: {', '.join(repr(name) for name in odd)}; leave these columns out (columns=[..]) or encode them"
        )
    if not values:
        raise DataError("no data: the table has no column")
    rows = [array_of(_numbers(column)[:, np.newaxis], f"'{name}'") for name, column in values.items()]
    return Recordings(list(values), [np.ascontiguousarray(np.hstack(rows))], dt)


def _numbers(column: NDArray[Any]) -> NDArray[Any]:
    return column if column.dtype.kind in "fiub" else _floats(column)


def _floats(column: NDArray[Any]) -> NDArray[Any]:
    """Objects that are numbers or None, as pandas has them for nullable columns."""
    missing = np.array([value is None or str(value) in ("<NA>", "nan", "NaT") for value in column])
    return np.array([np.nan if gone else float(value) for value, gone in zip(column, missing)])


def _holds_numbers(column: NDArray[Any]) -> bool:
    if column.ndim != 1 or column.dtype.kind != "O" or any(isinstance(value, (str, bytes)) for value in column):
        return False
    try:
        _floats(column)
    except (TypeError, ValueError):
        return False
    return True


def _step(times: NDArray[Any]) -> float | None:
    """The usual step of a column of times, in seconds."""
    if times.dtype.kind == "M":
        times = times.astype("datetime64[ns]").astype(np.int64) / 1e9
    elif times.dtype.kind not in "fiu":
        raise DataError("the column 'time' holds neither seconds nor times; rename it if it is a variable")
    steps = np.diff(np.asarray(times, dtype=np.float64))
    if steps.size == 0:
        return None
    if not np.all(steps > 0):
        row = int(np.argmax(~(steps > 0))) + 1
        raise DataError(f"the time does not rise at row {row}; sort the rows, or give each recording apart in a list")
    # The same one that the command takes for a file.
    return float(np.sort(steps)[steps.size // 2])


def _arrow(data: Any) -> dict[str, NDArray[Any]]:
    """A table of Arrow columns."""
    try:
        import pyarrow  # type: ignore[import-not-found, import-untyped, unused-ignore]
    except ImportError:
        kind = type(data).__name__
        raise DataError(f"data of type {kind} are an Arrow stream; install pyarrow to read it, or call its to_pandas()") from None
    table = pyarrow.table(data)
    return {str(name): np.asanyarray(table[name].to_numpy()) for name in table.column_names}
