"""A model per window of time: how links come and go."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from . import _native
from ._native import SettingError
from .data import frame_of, recordings_of
from .model import Model
from .progress import Progress, reporter
from .quick import as_json, settings_of, whole

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from .settings import Settings


@dataclass(frozen=True)
class Window:
    """One window and its model.

    Attributes:
        recording: Which recording, from 0.
        start: First row.
        end: The row after the last one.
        model: What was found in these rows; their causes may lie before the first one.

    Example:
        >>> import numpy as np, roscausal as rc
        >>> x = np.random.default_rng(1).normal(size=(300, 2))
        >>> window = rc.roll(x, window=100, step=100, method="pcmci", test="parcorr")[1]
        >>> window.start, window.end, window.model.features
        (100, 200, ['x0', 'x1'])
    """

    recording: int
    start: int
    end: int
    model: Model


@dataclass(frozen=True)
class Rolling(Sequence[Window]):
    """The models of all windows, in the order of recordings and times: what `rc.roll` returns.

    Attributes:
        windows: The windows.
        dt: Seconds per row, or None.
        status: `complete`, or `partial: ...` if the time budget ended before the last window; the ones before are there.

    Example:
        >>> import numpy as np, roscausal as rc
        >>> x = np.random.default_rng(2).normal(size=(400, 2))
        >>> x[1:200, 1] += 2 * x[:199, 0]                  # the link ends in the middle
        >>> found = rc.roll(x, columns=["a", "b"], window=100, step=100, method="pcmci", test="parcorr", alpha=0.001)
        >>> found.marks("a", "b", 1)
        ['-->', '-->', '', '']
    """

    windows: list[Window]
    dt: float | None = None
    status: str = "complete"

    def __len__(self) -> int:
        return len(self.windows)

    def __getitem__(self, index: Any) -> Any:
        return self.windows[index]

    def marks(self, cause: str, effect: str, lag: int) -> list[str]:
        """The mark of one link in each window; "" where there is none. A name or lag that no window has is a SettingError."""
        return [str(mark) for mark in self._each("graph", "", cause, effect, lag)]

    def values(self, cause: str, effect: str, lag: int) -> NDArray[np.float64]:
        """The strength of one link in each window, (windows,); NaN where F-PCMCI left a variable out. Arguments and errors as `marks`."""
        return np.array(self._each("val_matrix", np.nan, cause, effect, lag))

    def _each(self, matrix: str, absent: object, cause: str, effect: str, lag: int) -> list[Any]:
        if not self.windows:
            return []
        first = self.windows[0].model
        known = [*first.features, *first.dropped]
        for name in (cause, effect):
            if name not in known:
                raise SettingError(_native.visible(f"there is no variable '{name}'; variables: {', '.join(known)}"))
        if not 0 <= lag < first.graph.shape[2]:
            raise SettingError(f"setting 'lag': {lag} is not among 0 to {first.graph.shape[2] - 1}")
        entries = []
        for each in self.windows:
            names = each.model.features
            there = cause in names and effect in names
            entries.append(getattr(each.model, matrix)[names.index(cause), names.index(effect), lag] if there else absent)
        return entries

    def to_pandas(self) -> Any:
        """All links of all windows as a pandas table: recording, start, end, and the columns of `Model.to_pandas`.

        Raises:
            ImportError: pandas is not installed.
        """
        import pandas  # type: ignore[import-not-found, import-untyped, unused-ignore]

        tables = []
        for each in self.windows:
            table = each.model.to_pandas()
            for place, name in enumerate(("recording", "start", "end")):
                table.insert(place, name, getattr(each, name))
            tables.append(table)
        return pandas.concat(tables, ignore_index=True) if tables else pandas.DataFrame()


def roll(
    data: Any, *, window: int, step: int | None = None, columns: Sequence[str] | None = None, test: str | None = None,
    progress: Progress = None, **settings: Unpack[Settings],
) -> Rolling:  # fmt: skip
    """Analyses each window of the data on its own.

    Args:
        data: As for `rc.discover`. No window spans two recordings.
        window: Rows of a window.
        step: Rows from one window to the next; None: as many as a window has.
        columns: The variables to analyse, in this order; for an array: its names.
        test: Name of an independence test; None: the method's own.
        progress: True: a bar; or a function of (windows done, windows).
        settings: The other settings of `rc.discover`; not those of resamples. `time_budget` is that of all windows together.

    Returns:
        The models.

    Raises:
        DataError: Data that do not allow this analysis.
        SettingError: A setting that is not allowed, a window longer than the data.

    Example:
        >>> import numpy as np, roscausal as rc
        >>> x = np.random.default_rng(1).normal(size=(500, 2))
        >>> found = rc.roll(x, window=200, step=100, method="pcmci", test="parcorr")
        >>> [(each.start, each.end) for each in found]
        [(0, 200), (100, 300), (200, 400), (300, 500)]
    """
    if test is not None and not isinstance(test, str):
        raise SettingError("setting 'test': windows need a test by its name")
    given: dict[str, Any] = dict(settings)
    for name in ("resamples", "resampling", "share", "block"):
        if given.pop(name, None):
            raise SettingError(f"setting '{name}': windows are not resampled; call rc.discover on the rows of one window")
    found = recordings_of(data, columns)
    text = as_json(settings_of(found, test=test, **given))
    rows = "a number of rows from 1 on"
    cut = (whole("window", window, 1, rows), whole("step", window if step is None else step, 1, rows))
    windows, status = _native.roll(frame_of(found), text, *cut, reporter(progress, "windows"))
    models = [Window(k, start, end, Model(model, found.rows(k, start, end))) for k, start, end, model in windows]
    return Rolling(models, models[0].model.dt if models else found.dt, status)
