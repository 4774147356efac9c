"""`Gsquared`: dependence of discrete variables."""

from __future__ import annotations

from .independence_tests_base import CondIndTest


class Gsquared(CondIndTest):
    """G-squared: dependence of discrete variables. The keywords are those of `CondIndTest`.

    Raises:
        SettingError: A keyword or value that this test does not have.

    Example:
        >>> import numpy as np
        >>> from roscausal.tigramite.independence_tests.gsquared import Gsquared
        >>> x = np.arange(60) * 7 % 5
        >>> value, p = Gsquared().run_test_raw(x, x * x)
        >>> p < 0.05
        True
    """

    measure = "gsquared"
    _engine = "gsquared"
