"""Refusing what is not covered, by its name."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from .._native import SettingError
from ..data import nearest


class NotCovered(NotImplementedError, AttributeError):
    """Something of tigramite that roscausal does not have.

    Example:
        >>> from roscausal.tigramite.refusal import NotCovered
        >>> issubclass(NotCovered, NotImplementedError)
        True
    """


def not_covered(**given: object) -> None:
    """Refuses the first of these arguments that was given (is neither None nor False)."""
    for name, value in given.items():
        if value is not None and value is not False:
            raise NotCovered(f"{name} is not covered by roscausal.tigramite; leave it out, or use tigramite for this run")


def unknown(where: str, given: Mapping[str, object], known: Iterable[str]) -> None:
    """Refuses keywords that nobody knows, with the nearest known one."""
    for name in given:
        raise SettingError(f"setting '{name}': {where} has no such keyword{nearest(name, known)}")


def missing(module: str, *names: str) -> Callable[[str], Any]:
    """A module's `__getattr__`: refuses these names, which the reference has there and we have not."""

    def refuse(name: str) -> Any:
        if name not in names:
            raise AttributeError(f"module {module} has no attribute {name}")
        theirs = module.removeprefix("roscausal.")
        # No AttributeError: `from .. import name` would hide the text.
        raise NotImplementedError(f"{module}.{name} is not covered by roscausal; {theirs}.{name} takes our frames and results")

    return refuse
