"""`Gsquared`: dependence of discrete variables."""

from __future__ import annotations

from typing import Any

from ..refusal import not_covered
from .independence_tests_base import CondIndTest


class Gsquared(CondIndTest):
    """G-squared: dependence of discrete variables. The keywords are those of `CondIndTest`.

    Example:
        >>> import numpy as np
        >>> from roscausal.tigramite.independence_tests.gsquared import Gsquared
        >>> x = np.arange(60) * 7 % 5
        >>> Gsquared().run_test_raw(x, x * x)[1] < 0.05
        True
    """

    measure, _engine = "gsquared", "gsquared"

    def __init__(self, n_symbs: int | None = None, **others: Any) -> None:
        # The engine counts the values that are there, and so does the reference where it is not told.
        not_covered(n_symbs=n_symbs)
        super().__init__(**others)
