"""`Gsquared`: dependence of discrete variables."""

from __future__ import annotations

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

    measure, _engine, _one_sided = "gsquared", "gsquared", True
    # The engine counts the values that are there, and so does the reference where it is not told.
    _fixed = {"n_symbs": None}
