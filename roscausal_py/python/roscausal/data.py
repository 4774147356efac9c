"""What a user may give as data, and what the engine takes: recordings (T, N) of float64, and names of the variables."""

from __future__ import annotations

import os
import re
import tempfile
import zipfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _native
from ._native import DataError, SettingError

#: What an index without a name is called where it holds times, and where it says which recording a row is of.
TIME, RECORDING = "time", "recording"


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
        >>> pair.rows(0, 2, 5)[0].shape, pair.select(["b"]).names
        ((3, 2), ['b'])
    """

    names: list[str]
    arrays: list[NDArray[np.float64]] = field(repr=False)
    dt: float | None = None
    exogenous: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    masked: list[NDArray[np.bool_]] = field(default_factory=list, repr=False)

    def __len__(self) -> int:
        return len(self.arrays)

    def __getitem__(self, index: int) -> NDArray[np.float64]:
        return self.arrays[index]

    def __iter__(self) -> Iterator[NDArray[np.float64]]:
        return iter(self.arrays)

    def rows(self, recording: int, start: int, end: int) -> Recordings:
        """The rows `start` to `end - 1` of one recording, as one recording."""
        masked = [rows[start:end] for rows in self.masked[recording : recording + 1]]
        return Recordings(self.names, [self.arrays[recording][start:end]], self.dt, self.exogenous, self.warnings, masked)

    def select(self, columns: Sequence[str]) -> Recordings:
        """The same recordings with the variables of these names only, in this order. A name that is not there is a SettingError."""
        for name in columns:
            if name not in self.names:
                what = f"there is no column '{name}'{nearest(name, self.names)} (columns: {', '.join(self.names)})"
                raise SettingError(_native.visible(f"setting 'columns': {what}"))
        places = [self.names.index(name) for name in columns]
        arrays = [np.ascontiguousarray(array[:, places]) for array in self.arrays]
        exogenous = [name for name in self.exogenous if name in columns]
        return Recordings(list(columns), arrays, self.dt, exogenous, self.warnings, self.masked)


def nearest(name: str, known: Iterable[str]) -> str:
    """The end of a message about an unknown name."""
    import difflib

    near = difflib.get_close_matches(name, known, 1)
    return f"; did you mean '{near[0]}'?" if near else ""


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
    # The reader's notes have the command's flags.
    notes = [re.sub(r"--([a-z][a-z-]*[a-z])", lambda flag: flag[1].replace("-", "_"), note) for note in found["warnings"]]
    return Recordings(found["names"], found["arrays"], found["dt"], found["exogenous"], notes, found["masked"])


def _flags(options: Mapping[str, object]) -> list[str]:
    """`person=7` as `--person=7`."""
    flags = []
    for name, value in options.items():
        flag = "--" + ("feature" if name == "features" else name.replace("_", "-"))
        if isinstance(value, Mapping):
            flags += [f"{flag}={key}={each}" for key, each in value.items()]
        elif flag == "--feature" and not isinstance(value, str) and value is not None:
            flags += [f"{flag}={each}" for each in value]  # type: ignore[attr-defined]
        elif isinstance(value, (list, tuple)):
            flags.append(f"{flag}={','.join(str(each) for each in value)}")
        elif value is not None and value is not False:
            flags.append(flag if value is True else f"{flag}={value}")
    return flags


def recordings_of(data: Any, columns: Sequence[Any] | None = None, **reading: Any) -> Recordings:
    """Whatever a user gives as recordings, read with these options of `rc.read`: see `rc.discover`."""
    if isinstance(columns, str):
        raise SettingError("setting 'columns': it is one word; give a list of names")
    names = None if columns is None else [str(name) for name in columns]
    reading = {name: value for name, value in reading.items() if value is not None and value is not False}
    parts = list(data) if isinstance(data, (list, tuple)) else [data]
    if not parts:
        raise DataError("no data: the list of recordings is empty")
    if all(np.isscalar(part) and not isinstance(part, str) for part in parts) and isinstance(data, (list, tuple)):
        raise DataError("a list of numbers is one variable; a cause and an effect need at least two, as an array (T, N)")
    if all(isinstance(part, (list, tuple)) and part and np.isscalar(part[0]) for part in parts):
        parts = [np.asarray(parts)]
    if any(isinstance(part, Recordings) for part in parts):
        for name in reading:
            if name != "dt":
                raise SettingError(f"setting '{name}': these data are read already; give it to rc.read")
        found = _joined([part if isinstance(part, Recordings) else recordings_of(part) for part in parts])
        return found if names is None else found.select(names)
    if all(isinstance(part, np.ndarray) for part in parts):
        arrays = [array_of(part) for part in parts]
        widths = [array.shape[1] for array in arrays]
        odd = next((k for k, width in enumerate(widths) if width != widths[0]), None)
        if odd is not None:
            raise DataError(f"recording {odd} has {widths[odd]} columns, but recording 0 has {widths[0]}")
        if names is not None and len(names) != widths[0]:
            raise SettingError(f"setting 'columns': {len(names)} names for {widths[0]} columns")
        called = [f"x{k}" for k in range(widths[0])] if names is None else names
        if set(reading) <= {"dt"}:
            return Recordings(called, arrays)
        parts, names = [dict(zip(called, array.T)) for array in arrays], None
        reading.setdefault("keep", "all")
    # Commas part the names that the reader takes.
    told = names is not None and not any(set(name) & set(',"') for name in names)
    with tempfile.TemporaryDirectory() as folder:
        files: list[Any] = []
        for number, part in enumerate(parts):
            if isinstance(part, (str, os.PathLike)):
                files.append(part)
                continue
            table, recording = _table(part)
            if recording:
                reading.setdefault("recording", RECORDING)
            files.append(os.path.join(folder, "data.npz" if len(parts) == 1 else f"recording {number}.npz"))
            which = list(table.get(str(reading.get("recording")), ()))
            if len(which):
                places = {one: place for place, one in enumerate(dict.fromkeys(map(str, which)))}
                table[str(reading["recording"])] = [places[str(one)] for one in which]
            _save(files[-1], {name: _plain(name, column) for name, column in table.items()})
        if told:
            reading["columns"] = names
        try:
            found = _read_as_told(files, reading)
        except (DataError, SettingError) as error:
            raise type(error)(str(error).replace(folder + os.sep, "").replace(".npz", "")) from None
    found = replace(found, warnings=[note.replace(folder + os.sep, "").replace(".npz", "") for note in found.warnings])
    return found if names is None or told else found.select(names)


def _read_as_told(files: Sequence[Any], reading: dict[str, Any]) -> Recordings:
    try:
        return read(*files, **reading)
    except DataError as error:
        # Without times, dt says the step and nothing is resampled.
        if "dt" not in reading or "resample" in reading or "it has no times" not in str(error):
            raise
        return read(*files, **{name: value for name, value in reading.items() if name != "dt"})


def _save(path: str, table: Mapping[str, NDArray[Any]]) -> None:
    if not table:
        raise DataError("no data: the table has no column")
    if len({len(column) for column in table.values()}) != 1:
        sizes = _native.visible(", ".join(f"{name}: {len(column)}" for name, column in table.items()))
        raise DataError(f"the series have different lengths ({sizes}); give all of one recording the same times")
    # savez takes names as keywords, and one of them as its own.
    with zipfile.ZipFile(path, "w") as archive:
        for name, column in table.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as entry:
                np.lib.format.write_array(entry, np.ascontiguousarray(column), allow_pickle=False)


def _plain(name: str, column: Any) -> Any:
    """A column as numbers, times or words."""
    column = np.asanyarray(column)
    if isinstance(column, np.ma.MaskedArray):
        column = np.ma.filled(column.astype(np.float64), np.nan)  # type: ignore[no-untyped-call, unused-ignore]
    if column.ndim != 1:
        raise DataError(f"{_native.visible(repr(name))} has shape {column.shape}; a column is (T,)")
    if column.dtype.kind == "M":
        return column.astype("datetime64[ns]")
    if column.dtype.kind == "m":
        return column.astype("timedelta64[ns]").astype(np.int64) / 1e9
    if column.dtype.kind not in "OUST":
        return column
    gone = np.array([value is None or str(value) in ("<NA>", "nan", "NaT", "None") for value in column])
    try:
        if column.dtype.kind != "O" or any(isinstance(value, (str, bytes)) for value in column):
            raise TypeError
        return np.array([np.nan if no else float(value) for value, no in zip(column, gone)])
    except (TypeError, ValueError):
        return np.array(["" if no else str(value) for value, no in zip(column, gone)], dtype=str)


def frame_of(found: Recordings) -> _native.Frame:
    """The recordings as the engine takes them."""
    if not found.masked:
        return _native.Frame(found.arrays, found.names)
    masks = [np.repeat(rows[:, np.newaxis], len(found.names), axis=1) for rows in found.masked]
    return _native.Frame(found.arrays, found.names, masks, "y")


def _table(data: Any) -> tuple[dict[str, Any], bool]:
    """A user's table as named columns, and whether one says which recording a row is of. An index of times, or with a name, is one."""
    if hasattr(data, "dims") and hasattr(data, "coords"):
        return _of_xarray(data), False
    if isinstance(data, Mapping):
        return {str(name): values for name, values in data.items()}, False
    if isinstance(data, np.ndarray):
        return {f"x{k}": column for k, column in enumerate(array_of(data).T)}, False
    if not (hasattr(data, "to_numpy") and hasattr(data, "columns")):
        return _arrow(data), False
    names = list(data.columns)
    repeated = next((name for name in names if names.count(name) > 1), None)
    if repeated is not None:
        raise DataError(_native.visible(f"the column '{repeated}' is there twice; rename one"))
    table = {str(name): data[name].to_numpy() for name in names}
    index = getattr(data, "index", None)
    if index is None:
        return table, False
    levels = [index.get_level_values(k) for k in range(index.nlevels)]
    stamped = [str(getattr(level, "dtype", "")).startswith(("datetime", "timedelta", "period")) for level in levels]
    last = stamped.index(True) if any(stamped) else len(levels) - 1
    head: dict[str, Any] = {}
    if len(levels) > 1:
        head[RECORDING] = ["/".join(map(str, keys)) for keys in zip(*(level for k, level in enumerate(levels) if k != last))]
    times = levels[last]
    if stamped[last]:
        times = times.to_timestamp() if hasattr(times, "to_timestamp") else times
        head[TIME] = np.asarray(times, dtype=f"{times.dtype.kind}8[ns]")
    elif times.name is not None:
        head[str(times.name)] = times.to_numpy()
    return {**head, **table}, RECORDING in head


def _of_xarray(data: Any) -> dict[str, Any]:
    """The columns of an xarray: variables of a Dataset, or columns of a DataArray (time, variable); its first axis holds the times."""
    if hasattr(data, "data_vars"):
        columns = {str(name): values.values for name, values in data.data_vars.items()}
    elif data.ndim == 2:
        labels = data.coords[data.dims[1]].values if data.dims[1] in data.coords else [f"x{k}" for k in range(data.shape[1])]
        columns = {str(name): column for name, column in zip(labels, data.values.T)}
    else:
        raise DataError(f"the DataArray has shape {data.shape}; data are (T, N), times in rows and variables in columns")
    first = list(data.dims)[0]
    if first not in data.coords:
        return columns
    times = data.coords[first].values
    return {TIME if times.dtype.kind in "Mm" else str(first): times, **columns}


def _joined(parts: Sequence[Recordings]) -> Recordings:
    """Recordings of the same variables, in the first one's order."""
    first = parts[0]
    for number, part in enumerate(parts):
        if sorted(part.names) != sorted(first.names):
            ours, theirs = ", ".join(part.names), ", ".join(first.names)
            raise DataError(_native.visible(f"recording {number} has the variables {ours}, but recording 0 has {theirs}"))
    steps = {part.dt for part in parts}
    if len(steps) > 1:
        listed = ", ".join(str(step) for step in sorted(steps, key=str))
        raise DataError(f"the recordings have different time steps ({listed}); resample them to one")
    masked = [rows for part in parts for rows in part.masked or [np.zeros(len(array), dtype=np.bool_) for array in part.arrays]]
    arrays = [array for part in parts for array in part.select(first.names).arrays]
    notes = [note for part in parts for note in part.warnings]
    return Recordings(first.names, arrays, first.dt, first.exogenous, notes, masked if any(rows.any() for rows in masked) else [])


def array_of(values: Any, what: str = "the array") -> NDArray[np.float64]:
    """A float64 array (T, N) in C order. Masked values become NaN; any byte order, order of axes and number type will do."""
    array = np.asanyarray(values)
    if array.ndim != 2:
        raise DataError(f"{what} has shape {array.shape}; data are (T, N), times in rows and variables in columns")
    if array.dtype.kind not in "fiub":
        raise DataError(f"{what} holds {array.dtype}, not numbers")
    filled = np.ma.filled(array.astype(np.float64, copy=False), np.nan)  # type: ignore[no-untyped-call, unused-ignore]
    return np.ascontiguousarray(filled, dtype=np.float64)


def _arrow(data: Any) -> dict[str, NDArray[Any]]:
    """A table of Arrow columns."""
    if not hasattr(data, "__arrow_c_stream__"):
        raise DataError(
            f"data of type {type(data).__name__} are not understood; give an array (T, N), a pandas or polars table, a dict of "
            "series, a path, or a list of these"
        )
    try:
        import pyarrow  # type: ignore[import-not-found, import-untyped, unused-ignore]
    except ImportError:
        kind = type(data).__name__
        raise DataError(f"data of type {kind} are an Arrow stream; install pyarrow to read it, or call its to_pandas()") from None
    try:
        table = pyarrow.table(data)
    except (pyarrow.ArrowInvalid, TypeError) as error:
        raise DataError(f"data of type {type(data).__name__} are no table: {error}") from None
    return {str(name): np.asanyarray(table[name].to_numpy()) for name in table.column_names}
