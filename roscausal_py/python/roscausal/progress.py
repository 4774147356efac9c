"""Progress of an analysis: a bar in a notebook, a line in a terminal."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from html import escape
from typing import Any

Progress = bool | Callable[[int, int], object] | None


def reporter(progress: Progress, unit: str = "tests") -> Callable[[int, int], object] | None:
    """The callback that `progress` means: None, the caller's own function, or for True a bar."""
    if progress is None or progress is False:
        return None
    return Bar(unit) if progress is True else progress


class Bar:
    """A bar that is drawn again with each call: as HTML in a notebook, else as one line on stderr.

    Args:
        unit: What is counted.

    Example:
        >>> from roscausal.progress import Bar
        >>> Bar().words(50, 200, seconds=3.0)
        '50/200 tests, 3 s, about 9 s left'
    """

    def __init__(self, unit: str = "tests") -> None:
        self.unit, self._start = unit, time.monotonic()
        self._shown = _display()

    def words(self, done: int, total: int, seconds: float) -> str:
        """The numbers as a reader wants them.

        Args:
            done: How many are done.
            total: How many there will be, as estimated now.
            seconds: Since the start.

        Returns:
            Such as `50/200 tests, 3 s, about 9 s left`; without what is left while nothing is done, and at the end.
        """
        text = f"{done}/{total} {self.unit}, {_duration(seconds)}"
        if 0 < done < total:
            text += f", about {_duration(seconds * (total - done) / done)} left"
        return text

    def __call__(self, done: int, total: int) -> None:
        words = self.words(done, total, time.monotonic() - self._start)
        if self._shown is not None:
            bar = f"<progress value='{done}' max='{max(total, 1)}'></progress> {escape(words)}"
            self._shown.update({"text/html": bar, "text/plain": words}, raw=True)
            return
        share = done / total if total else 1.0
        end = "\n" if done >= total else ""
        print(f"\r{'#' * round(30 * share):30} {words:40}", end=end, file=sys.stderr, flush=True)


def _duration(seconds: float) -> str:
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


def _display() -> Any:
    """What shows HTML (or text) below the cell, over what it showed before; None outside of a notebook."""
    ipython: Any = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    if shell is None or not hasattr(shell, "kernel"):
        return None
    return ipython.display.display({"text/plain": ""}, raw=True, display_id=True)
